"""Checks a plan before it is run: its mistakes, its cases, and the remaining work."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from vobench.runner.exposure_doubt import doubts_of_plan
from vobench.runner.key import cache_folder
from vobench.runner.motion import BodyMotion, body_motions, motion_name
from vobench.runner.task import is_done, plan, sequence_tasks
from vobench.suite.plan import AnyCase, Plan
from vobench.suite.source import RecordedCase
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording
    from vobench.runner.dry_run import StageEstimate

IN_CACHE = "in the cache"
TO_SIMULATE = "to simulate"


@dataclass(frozen=True, slots=True)
class Preflight:
    """The motion of each trajectory and the recording of each recorded case, by name."""

    motions: Mapping[str, BodyMotion]
    recordings: "Mapping[str, Recording]"


@dataclass(frozen=True, slots=True)
class CaseSummary:
    """A case before it is created. `notes` are the assumptions of an import, and None for a simulated case.

    Frames and duration are None in a place of a generator that was not run. `clearance_m` is the least distance of a
    body that wanders from everything.
    """

    case: str
    frames: int | None
    duration_s: float | None
    simulated: bool
    sequence: str
    clearance_m: float | None = None
    notes: tuple[str, ...] | None = None

    def as_dict(self) -> dict[str, Any]:
        """The fields that apply, as plain JSON values."""
        content = asdict(self)
        if self.clearance_m is None:
            del content["clearance_m"]
        notes = content.pop("notes")
        return content if notes is None else {**content, "notes": list(notes)}


@dataclass(frozen=True, slots=True)
class PlanSummary:
    """A valid plan: its cases, and stage by stage the work that is left where that was asked for.

    `doubts` are about the exposure of cases whose light is in the cache.
    """

    plan: Plan
    cases: tuple[CaseSummary, ...]
    stages: "tuple[StageEstimate, ...] | None" = None
    doubts: tuple[str, ...] = ()

    @property
    def trials(self) -> int:
        """The number of trials."""
        return sum(len(self.plan.trials(case)) for case in self.plan.cases)

    def estimators(self) -> list[dict[str, Any]]:
        """Each estimator with its version, the sensors that it needs, and its folder."""
        return [
            {
                "estimator": estimator_entry.label,
                "version": estimator_entry.manifest.version,
                "needs": list(estimator_entry.manifest.needs),
                "path": str(estimator_entry.folder),
            }
            for estimator_entry in self.plan.estimator_entries
        ]

    def found(self) -> list[dict[str, str]]:
        """The scenes and estimators to which the names in the suite refer."""
        return [
            {"kind": entry.kind, "name": entry.name, "origin": entry.origin, "path": str(entry.path)}
            for entry in self.plan.found
        ]

    def tasks(self) -> list[dict[str, Any]]:
        """For each stage: the number of tasks, how many must be performed and why, and the estimated seconds."""
        rows = []
        for stage in self.stages or ():
            in_cache = stage.tasks - stage.pending
            rows.append({**asdict(stage), IN_CACHE: in_cache, "to do": stage.pending})
        return rows

    def as_dict(self) -> dict[str, Any]:
        """The summary as plain JSON values."""
        content = {
            "suite": self.plan.suite.name,
            "cases": [case.as_dict() for case in self.cases],
            "estimators": self.estimators(),
            "trials": self.trials,
            "found": self.found(),
            "doubts": list(self.doubts),
        }
        if self.stages is not None:
            content["tasks"] = self.tasks()
        return content


def preflight(planned: Plan, *, only_missing: bool = False, runs_generators: bool = True) -> Preflight:
    """Compute the motion of all simulated cases, and read the recordings of all recorded cases.

    With `only_missing`, cases whose sequence is cached are not checked. Without `runs_generators`, cases in places of
    generators are not checked; they are when they are simulated. Raises SuiteError with all mistakes.
    """
    wrong = planned.mistakes()
    motions: dict[str, BodyMotion] = {}
    recordings: dict[str, Recording] = {}
    with wrong.at():
        simulated = planned.simulated
        if not runs_generators:
            simulated = tuple(case for case in simulated if case.scene.generated is None)
        if only_missing:
            simulated = tuple(case for case in simulated if not is_in_cache(case))
        motions = body_motions(replace(planned, simulated=simulated))
    with wrong.at():
        if planned.recorded:
            from vobench.runner.import_recording import read_all

            recordings = read_all(planned)
    wrong.require_none()
    return Preflight(motions, recordings)


def summarize(planned: Plan, *, with_stages: bool = False) -> PlanSummary:
    """Validate a plan, and summarise it. With `with_stages`, the remaining work is counted, and no generator is run.

    Raises SuiteError with all mistakes.
    """
    checked = preflight(planned, runs_generators=not with_stages)
    cases = tuple(_case_summary(case, checked) for case in planned.cases)
    doubts = tuple(doubts_of_plan(planned))
    if not with_stages:
        return PlanSummary(planned, cases, doubts=doubts)

    from vobench.runner.dry_run import pending_tasks

    stages = pending_tasks(plan(planned, checked.recordings), cache_folder())
    return PlanSummary(planned, cases, tuple(stages), doubts)


def is_in_cache(case: AnyCase, recording: "Recording | None" = None) -> bool:
    """Whether the sequence of a case is cached."""
    return is_done(sequence_tasks(case, recording)[-1], cache_folder())


def _case_summary(case: AnyCase, checked: Preflight) -> CaseSummary:
    is_made = is_in_cache(case, checked.recordings.get(case.name))
    sequence = IN_CACHE if is_made else TO_SIMULATE
    if not isinstance(case, RecordedCase):
        motion = checked.motions.get(motion_name(case))
        t_ns = motion.t_ns if motion else None
        clearance_m = motion.clearance_m if motion else None
        return CaseSummary(case.name, *_extent(t_ns), is_made, sequence, clearance_m)

    recording = checked.recordings[case.name]
    if not is_made:
        sequence = f"to import from {case.source.path}"
    return CaseSummary(case.name, *_extent(recording.t_ns), False, sequence, notes=tuple(recording.notes))


def _extent(t_ns: Stamps | None) -> tuple[int | None, float | None]:
    """The number of frames, and the duration in s; None if they are unknown."""
    if t_ns is None:
        return None, None
    return len(t_ns), float(t_ns[-1] - t_ns[0]) / NS_PER_S
