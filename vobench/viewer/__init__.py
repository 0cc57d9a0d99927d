"""Runs as Rerun recordings: pictures, tracks, both paths and the error, on one time line."""

from vobench.viewer.recording import RunView, save_run

__all__ = ["RunView", "save_run"]
