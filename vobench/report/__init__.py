"""Leaderboards, pages, plots, tables of scores, Rerun recordings of trials, and the verification of runs."""
