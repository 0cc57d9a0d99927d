"""Simulate a case from Python."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.errors import InputError, UnknownNameError, unknown_name_sentence
from vobench.notebook.display import choose_display
from vobench.notebook.runs import plan
from vobench.notebook.sequences import read_sequence
from vobench.notebook.trajectories import read_trajectory
from vobench.runner.launch import perform_tasks
from vobench.runner.task import sequence_tasks
from vobench.suite.plan import AnyCase

if TYPE_CHECKING:
    from vobench.sequence import Sequence
    from vobench.trajectory.trajectory import Trajectory


@dataclass(frozen=True, slots=True)
class Simulation:
    """A case that was simulated or imported, and the folder `path` that holds its sequence and ground truth."""

    case: AnyCase
    path: Path

    @property
    def sequence(self) -> "Sequence":
        """The pictures and readings that an estimator may see."""
        return read_sequence(self.path)

    @property
    def ground_truth(self) -> "Trajectory":
        """The true trajectory of the left camera."""
        return read_trajectory(self.path)  # of a sequence's folder, this is the truth of its left camera

    def __repr__(self) -> str:
        return f"Simulation({self.case.name}, {self.path})"


def simulate(
    suite_or_case: str | AnyCase,
    *,
    case_name: str | None = None,
    changes: Mapping[str, Any] | None = None,
    quiet: bool = False,
) -> Simulation:
    """Simulate a case, or import it if it is a recording. A cached result is reused.

    `suite_or_case` is the name or path of a suite, or a case from `check(suite).plan.cases`.
    `case_name` selects a case of the suite; without it, the first case is used.
    `changes` modify the suite, as in `run`.
    Raises SuiteError if the suite is wrong, UnknownNameError if there is no such suite or case, and InputError if
    `case_name` or `changes` are given with a case.
    """
    case = _selected_case(suite_or_case, case_name, changes)
    folder = perform_tasks(sequence_tasks(case), display=choose_display(is_quiet=quiet))
    return Simulation(case, folder)


def _selected_case(
    suite_or_case: str | AnyCase,
    case_name: str | None,
    changes: Mapping[str, Any] | None,
) -> AnyCase:
    """The given case, or the case of the given suite that has this name."""
    if not isinstance(suite_or_case, str):
        if case_name or changes:
            raise InputError("case_name and changes are for the cases of a suite; leave them out for a case object")
        return suite_or_case

    cases = plan(suite_or_case, changes=changes).cases
    if case_name is None:
        return cases[0]
    cases_by_name = {case.name: case for case in cases}
    if case_name not in cases_by_name:
        raise UnknownNameError(unknown_name_sentence("case", case_name, list(cases_by_name)))
    return cases_by_name[case_name]
