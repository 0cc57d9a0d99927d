"""Simulate a case, render a picture and open a sequence from Python."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

from vobench.errors import InputError, UnknownNameError, unknown_name_sentence
from vobench.notebook.display import choose_display
from vobench.notebook.runs import plan
from vobench.notebook.trajectories import read_trajectory
from vobench.runner.launch import perform_tasks
from vobench.runner.task import sequence_tasks
from vobench.suite.case import Case
from vobench.suite.source import RecordedCase

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vobench.dataset.recording import Recording
    from vobench.sequence import Sequence
    from vobench.trajectory.trajectory import Trajectory


class RenderOptions(TypedDict, total=False):
    """The options of `render`: the place of a generator, the camera's pose, time and sensor, and the engine."""

    seed: int | None
    lighting: str
    camera: str
    at_m: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float
    time_s: float
    sensor: str
    gain: float
    engine: str
    samples: int | None


@dataclass(frozen=True, slots=True)
class Simulation:
    """A case that was simulated or imported, and the folder `path` that holds its sequence and ground truth."""

    case: Case | RecordedCase
    path: Path

    @property
    def sequence(self) -> "Sequence":
        """The pictures and readings that an estimator may see."""
        return read_sequence(self.path)

    @property
    def ground_truth(self) -> "Trajectory":
        """The true trajectory of the left camera."""
        return read_trajectory(self.path)

    def __repr__(self) -> str:
        return f"Simulation({self.case.name}, {self.path})"


def simulate(
    case: Case | RecordedCase | str,
    *,
    name: str | None = None,
    changes: Mapping[str, Any] | None = None,
    quiet: bool = False,
) -> Simulation:
    """Simulate a case, or import it if it is a recording. A cached result is reused.

    `case` is a case from `check(suite).plan.cases`, or the name or path of a suite.
    `name` selects a case of the suite; without it, the first case is used.
    `changes` modify the suite, as in `run`.
    Raises SuiteError if the suite is wrong, UnknownNameError if there is no such suite or case, and InputError if
    `name` or `changes` are given without a suite.
    """
    chosen = _chosen_case(case, name, changes)
    tasks = sequence_tasks(chosen, _recordings(chosen))
    folder = perform_tasks(tasks, display=choose_display(is_quiet=quiet))
    return Simulation(chosen, folder)


def _chosen_case(
    case: Case | RecordedCase | str, name: str | None, changes: Mapping[str, Any] | None
) -> Case | RecordedCase:
    """The given case, or the case of the given suite that has this name."""
    if not isinstance(case, str):
        if name or changes:
            raise InputError("name and changes apply to a suite; a case of a plan already has both")
        return case

    cases = plan(case, changes=changes).cases
    case_by_name = {each.name: each for each in cases}
    if name is None:
        return next(iter(case_by_name.values()))
    if name not in case_by_name:
        raise UnknownNameError(unknown_name_sentence("case", name, list(case_by_name)))
    return case_by_name[name]


def _recordings(case: Case | RecordedCase) -> "dict[str, Recording]":
    """The recording of a recorded case by the case's name; a simulated case has none."""
    if not isinstance(case, RecordedCase):
        return {}
    from vobench.runner.import_recording import read_case

    return {case.name: read_case(case)}


def render(scene: str, **options: Unpack[RenderOptions]) -> "NDArray[np.uint8]":
    """An RGB picture (H, W, 3) of a scene, the same that `vobench render` draws.

    `options` are the keywords of `RenderOptions`: seed, lighting, camera, at_m, yaw_deg, pitch_deg, time_s, sensor,
    gain, engine, samples. Raises UnknownNameError, InputError and MissingDependencyError.
    """
    from vobench.runner.scene_picture import render_scene

    return render_scene(scene, **options).rgb


def read_sequence(folder: Path | str) -> "Sequence":
    """Open the sequence in a folder; its pictures and readings are read on access. Raises SequenceError."""
    from vobench.sequence import Sequence

    return Sequence.open(Path(folder))
