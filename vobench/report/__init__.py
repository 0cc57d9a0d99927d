"""Leaderboards, pages, plots, and the Rerun recording of a trial."""

from vobench.report.rerun import TrialView, TruthView, save_trial

__all__ = ["TrialView", "TruthView", "save_trial"]
