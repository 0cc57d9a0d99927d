"""The interface by which an analysis runs a plan, for example on a terminal, in a notebook or in a test."""

from typing import Protocol

from vobench.runner.folder import RunFolder
from vobench.suite.plan import Plan


class PlanRunner(Protocol):
    """Runs all trials of a plan: creates the sequences, runs the estimators and scores them.

    The implementation decides where runs are stored, how many tasks run at once, which reports are written, and how
    progress is shown. It reads the recordings of `plan.recorded` itself (`import_recording.read_all`).
    """

    def __call__(self, plan: Plan, /) -> RunFolder:
        """Run the plan and return the folder of the finished run."""
