"""The stages from a suite to scores as tasks: the inputs, the dependencies and the code of each."""

import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from shutil import copyfile
from typing import TYPE_CHECKING, Any, Literal

from vobench import stop
from vobench.portable import is_portable
from vobench.runner.environment import MADE_ON, origin_here
from vobench.runner.key import code_digest, digest, folder_digest, imported_by, library_versions
from vobench.runner.simulate import content, libraries
from vobench.runner.store import Progress, SilentProgress, Store, write_json
from vobench.suite.case import Case
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.plan import AnyCase, Plan, Trial
from vobench.suite.scene_file import scene_content
from vobench.suite.scene_spec import SceneFile
from vobench.suite.source import RecordedCase
from vobench.suite.suite_spec import EXACT

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording

Stage = Literal["bake", "sequence", "import", "estimate", "score"]
# The folder of the store with the results of each stage.
KINDS: dict[Stage, str] = {
    "bake": "bakes",
    "sequence": "sequences",
    "import": "sequences",
    "estimate": "estimates",
    "score": "scores",
}
# The entry modules of each stage. Its key hashes all code that they import. A package stands for all of its modules.
ENTRIES: dict[Stage, tuple[str, ...]] = {
    "bake": (
        "vobench.rendering.bake",
        "vobench.rendering.wet_ground",
        "vobench.suite.scene_build",
        "vobench.suite.white",
    ),
    "sequence": ("vobench.runner.simulate", "vobench.runner.ground_truth"),
    "import": ("vobench.runner.import_recording", "vobench.runner.ground_truth", "vobench.dataset"),
    "estimate": ("vobench.runner.estimate", "vobench.estimator.worker"),
    "score": ("vobench.runner.score",),
}
# The settings of a scene on which its light does not depend. Levels are applied to the light of each lamp later.
UNLIT: dict[str, Any] = {
    "summary": True,
    "white_cd_m2": True,
    "lamps": {"__all__": {"level"}},
    "sun": {"level"},
    "sky": {"level"},
    "fog": True,
    "rain": {"rate_mm_per_h", "wind_mps"},
    "wind": True,
}
# The libraries whose versions can change the light of a scene.
BAKE_LIBRARIES = ("numpy", "scipy", "embreex", "xatlas", "pillow", "trimesh", "opencv-python-headless")

NO_LIMIT = 0  # of threads


@dataclass(frozen=True, slots=True)
class Task:
    """A unit of work whose result is a folder in the store.

    `inputs` is everything on which the bytes of the result depend, as plain JSON values.
    `subject` is the object that the stage processes, such as a case or a trial.
    `needs` are the keys of the tasks whose results it uses, in the order that its stage expects.
    """

    stage: Stage
    subject: SceneFile | AnyCase | Trial
    inputs: Mapping[str, Any]
    needs: tuple[str, ...]

    @property
    def name(self) -> str:
        """The name of the task for users. That of a place of a generator has its seed."""
        if isinstance(self.subject, SceneFile):
            return self.subject.place_name
        return self.subject.name

    @property
    def key(self) -> str:
        """The key of the task, which is the path of its result in the store."""
        return f"{KINDS[self.stage]}/{digest(self.inputs)}"


def plan(suite: Plan, recordings: "Mapping[str, Recording]") -> list[Task]:
    """All tasks of a suite without duplicates, each after those that it needs.

    `recordings` maps recorded cases by name to their recordings. Nothing is simulated, and only code is hashed.
    """
    tasks = dict[str, Task]()  # by key

    def add(task: Task) -> str:
        """Add a task, unless there is one with the same key already, and return its key."""
        key = task.key
        tasks.setdefault(key, task)
        return key

    codes = {entry.label: estimator_code(entry) for entry in suite.estimator_entries}
    for case in suite.cases:
        recording = recordings.get(case.name)
        keys = [add(task) for task in sequence_tasks(case, recording)]
        sequence = keys[-1]  # the key before it, if there is one, is that of the light
        for trial in suite.trials(case):
            code = codes[trial.estimator_entry.label]
            estimate = add(estimate_task(trial, sequence, code))
            add(score_task(trial, sequence, estimate))
    return list(tasks.values())


def sequence_tasks(case: AnyCase, recording: "Recording | None" = None) -> list[Task]:
    """The tasks that create the sequence of a case. The last one is the task of the sequence.

    If the rendering engine needs the light of the scene, the task that computes it comes first.
    `recording` is the recording of a recorded case if it has been read already.
    """
    if isinstance(case, RecordedCase):
        return [_import_task(case, recording)]
    needs_light = case.rendering.needs_bake or case.scene.white_cd_m2 is None
    light_tasks = [bake_task(case.scene)] if needs_light else []
    needs = tuple(task.key for task in light_tasks)
    inputs = {
        "case": content(case),
        **_stage_inputs("sequence", needs),
        "libraries": library_versions(*libraries(case.rendering)),
    }
    return [*light_tasks, Task("sequence", case, inputs, needs)]


def bake_task(spec: SceneFile) -> Task:
    """The task that computes the light of a scene, which does not depend on the levels of lights."""
    inputs = {
        "scene": scene_content(spec, exclude=UNLIT),
        **_stage_inputs("bake"),
        **_generator_code(spec),
        "libraries": library_versions(*BAKE_LIBRARIES),
    }
    return Task("bake", spec, inputs, ())


def _generator_code(spec: SceneFile) -> dict[str, str]:
    """The hash of all code of vobench that the generator of a place imports; nothing for other scenes."""
    if spec.generated is None or spec.generator is None:
        return {}
    return {"generator": _imported_code(Path(spec.generator).parent)}


@cache
def _imported_code(folder: Path) -> str:
    """The hash of the code of vobench that the Python files of a folder import. It is read once in a process."""
    return code_digest(*imported_by(folder))


def _import_task(case: RecordedCase, recording: "Recording | None") -> Task:
    from vobench.runner import import_recording

    if recording is None:
        recording = import_recording.read_case(case)
    inputs = {
        **import_recording.content(case, recording),
        **_stage_inputs("import"),
        "libraries": library_versions(*import_recording.LIBRARIES),
    }
    return Task("import", case, inputs, ())


def estimator_code(estimator_entry: EstimatorEntry) -> dict[str, str]:
    """The hashes of an estimator's folder, and of all code of vobench that runs it or that it imports."""
    code = code_digest(*ENTRIES["estimate"], *imported_by(estimator_entry.folder))
    return {"estimator": folder_digest(estimator_entry.folder), "code": code}


def estimate_task(trial: Trial, sequence: str, code: Mapping[str, str]) -> Task:
    """The task that runs an estimator on the sequence with a key. `code` is its `estimator_code`."""
    estimator_entry = trial.estimator_entry
    needs = (sequence,)
    inputs = {
        "params": estimator_entry.params,
        "repeat": trial.repeat,
        "limits": asdict(estimator_entry.limits),
        "mode": estimator_entry.mode,
        "needs": needs,
        **code,
        **_portable(),
        "libraries": library_versions("numpy", "scipy", "opencv-python-headless"),
    }
    return Task("estimate", trial, inputs, needs)


def score_task(trial: Trial, sequence: str, estimate: str) -> Task:
    """The task that scores the estimate with a key against the truth of its sequence."""
    inputs = {
        "case": trial.case.name,
        "variant": trial.case.variant,
        "estimator": trial.estimator_entry.label,
        "claims": trial.estimator_entry.claims,
        "sensors": trial.estimator_entry.manifest.needs,
        **_noise(trial.case),
        "repeat": trial.repeat,
        **_stage_inputs("score", (sequence, estimate)),
        "libraries": library_versions("numpy", "scipy"),
    }
    return Task("score", trial, inputs, (sequence, estimate))


def _noise(case: AnyCase) -> dict[str, Any]:
    """The settings on which the scored truth of a case depends, besides the exact truth."""
    if isinstance(case, RecordedCase) or case.truth_noise == EXACT:
        return {}
    first_frame = case.frames[0] if case.frames else None
    return {"truth_noise": asdict(case.truth_noise), "seed": case.seed, "first": first_frame}


def _stage_inputs(stage: Stage, needs: tuple[str, ...] = ()) -> dict[str, Any]:
    """The inputs that all tasks of a stage have: the keys of the tasks that they need, and the code of the stage."""
    return {"needs": needs, "code": code_digest(*ENTRIES[stage]), **_portable()}


def _portable() -> dict[str, bool]:
    """An input that distinguishes the keys of portable results. The keys of other results do not contain it."""
    return {"portable": True} if is_portable() else {}


def missing(tasks: Iterable[Task], root: Path) -> list[Task]:
    """The tasks to perform, in order. Tasks with a stored result, and light that no sequence needs, are omitted."""
    needed = set[str]()
    to_perform = list[Task]()
    # From last to first, so that the sequences that need a light are known before the task of that light is reached.
    for task in reversed(list(tasks)):
        is_needed = task.stage != "bake" or task.key in needed
        if is_needed and not is_done(task, root):
            needed.update(task.needs)
            to_perform.append(task)
    return to_perform[::-1]


def is_done(task: Task, root: Path) -> bool:
    """Whether the store contains the result of a task. A failure does not count, because its cause may be gone."""
    is_stored = Store(root).has(task.key)
    return is_stored and not has_failed(task, root / task.key)


def has_failed(task: Task, folder: Path) -> bool:
    """Whether a folder contains the result of a trial whose estimator failed.

    That a recording lacks a sensor is no failure here, because the same recording always lacks it.
    """
    from vobench.runner.estimate import FINISHED, read_outcome
    from vobench.runner.folder import NOT_APPLICABLE

    if task.stage not in ("estimate", "score"):
        return False
    return read_outcome(folder).kind not in (FINISHED, NOT_APPLICABLE)


def perform(
    task: Task,
    root: Path,
    threads: int = NO_LIMIT,
    *,
    progress: Progress = SilentProgress(),  # noqa: B008 - no state
) -> Path:
    """Compute the result of a task in the store at `root`, and return its folder.

    `threads` limits the threads for rendering and filtering; NO_LIMIT does not limit them. The function may be called
    in a separate process.
    """
    stop.check()
    if threads != NO_LIMIT:
        _limit(threads)
    store = Store(root)

    def build(folder: Path) -> None:
        began_s = time.monotonic()
        needs = [store.need(key) for key in task.needs]
        PERFORMERS[task.stage](task.subject, needs, folder, progress)
        engine = ""
        if isinstance(task.subject, Case):
            engine = task.subject.rendering.engine
        origin = origin_here(needs, engine=engine)
        write_json(folder / MADE_ON, asdict(origin))
        store.note_seconds(task.stage, time.monotonic() - began_s)

    def keeps(folder: Path) -> bool:
        return not has_failed(task, folder)

    return store.get(KINDS[task.stage], task.inputs, build, keeps=keeps, tell=progress.say)


def _limit(threads: int) -> None:
    import cv2

    os.environ["LP_NUM_THREADS"] = str(threads)  # Mesa reads it when it renders for the first time
    cv2.setNumThreads(threads)


# Each stage imports its modules when it is performed, so that other processes do not load them.


def _bake(spec: SceneFile, _: list[Path], folder: Path, progress: Progress) -> None:
    from vobench.runner.simulate import bake_scene

    bake_scene(spec, folder, progress)


def _sequence(case: Case, needs: list[Path], folder: Path, progress: Progress) -> None:
    from vobench.runner.ground_truth import write_ground_truth
    from vobench.runner.simulate import simulate

    simulate(case, folder, light=needs[0] if needs else None, progress=progress)
    write_ground_truth(folder)


def _import(case: RecordedCase, _: list[Path], folder: Path, progress: Progress) -> None:
    from vobench.runner.ground_truth import write_ground_truth
    from vobench.runner.import_recording import import_recording, read_case

    with progress.step(f"import {case.name}"):
        import_recording(read_case(case), folder)
    write_ground_truth(folder)


def _estimate(trial: Trial, needs: list[Path], folder: Path, progress: Progress) -> None:
    from vobench.runner.estimate import estimate

    estimate(trial, needs[0], folder, progress)


def _score(trial: Trial, needs: list[Path], folder: Path, _: Progress) -> None:
    from vobench.runner.estimate import OUTCOME
    from vobench.runner.score import score_trial

    sequence, estimate = needs
    score_trial(trial, sequence, estimate, folder)
    copyfile(estimate / OUTCOME, folder / OUTCOME)


PERFORMERS: dict[Stage, Callable[[Any, list[Path], Path, Progress], None]] = {
    "bake": _bake,
    "sequence": _sequence,
    "import": _import,
    "estimate": _estimate,
    "score": _score,
}
