"""How an analysis has a plan run, whoever runs it: a terminal, a notebook, a test."""

from typing import Protocol

from vobench.runner.folder import RunFolder
from vobench.suite.plan import Plan


class PlanRunner(Protocol):
    """Runs every trial of a plan: makes its sequences, runs its estimators and scores them.

    Where runs are stored, how many tasks run at once, which reports are written and how progress is shown is up to
    the implementation. It reads the recordings of `plan.recorded` itself (`import_recording.read_all`).
    """

    def __call__(self, plan: Plan, /) -> RunFolder:
        """Run the plan and return the folder of the finished run."""
