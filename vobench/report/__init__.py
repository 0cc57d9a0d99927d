"""Leaderboards, pages, plots, tables of scores, the Rerun recording of a trial, and what is checked afterwards."""
