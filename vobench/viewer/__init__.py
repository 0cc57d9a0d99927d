"""Runs as Rerun recordings: pictures, tracks, both paths and the error, on one time line."""

from vobench.viewer.recording import RunView, save_run
from vobench.viewer.truth import TruthView

__all__ = ["RunView", "TruthView", "save_run"]
