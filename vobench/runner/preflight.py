"""Checks a plan before it is run: its mistakes, its cases, and the remaining work."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from vobench.runner.exposure_doubt import doubts_of_plan
from vobench.runner.key import cache_folder
from vobench.runner.motion import BodyMotion, body_motions, motion_name
from vobench.runner.task import is_done, plan, sequence_tasks
from vobench.suite.case import Case
from vobench.suite.plan import Plan
from vobench.suite.source import RecordedCase
from vobench.trajectory.nanoseconds import NS_PER_S

if TYPE_CHECKING:
    from vobench.dataset.recording import Recording
    from vobench.runner.dry_run import ToDo

IN_CACHE = "in the cache"
TO_SIMULATE = "to simulate"


@dataclass(frozen=True, slots=True)
class Preflight:
    """The motion of each trajectory and the recording of each recorded case, by name."""

    motions: Mapping[str, BodyMotion]
    recordings: "Mapping[str, Recording]"


@dataclass(frozen=True, slots=True)
class CaseSummary:
    """A case before it is created. `notes` are the assumptions of an import, and None for a simulated case."""

    case: str
    frames: int
    duration_s: float
    simulated: bool
    sequence: str
    notes: tuple[str, ...] | None = None

    def as_dict(self) -> dict[str, Any]:
        """The fields that apply, as plain JSON values."""
        content = asdict(self)
        notes = content.pop("notes")
        return content if notes is None else {**content, "notes": list(notes)}


@dataclass(frozen=True, slots=True)
class PlanSummary:
    """A valid plan: its cases, and stage by stage the work that is left where that was asked for.

    `doubts` are about the exposure of cases whose light is in the cache.
    """

    plan: Plan
    cases: tuple[CaseSummary, ...]
    stages: "tuple[ToDo, ...] | None" = None
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
            in_cache = stage.tasks - stage.to_do
            rows.append({**asdict(stage), IN_CACHE: in_cache, "to do": stage.to_do})
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


def preflight(planned: Plan, *, only_missing: bool = False) -> Preflight:
    """Compute the motion of all simulated cases, and read the recordings of all recorded cases.

    With `only_missing`, cases whose sequence is cached are not checked. Raises SuiteError with all mistakes.
    """
    wrong = planned.mistakes()
    motions: dict[str, BodyMotion] = {}
    recordings: dict[str, Recording] = {}
    with wrong.at():
        simulated = planned.simulated
        if only_missing:
            simulated = tuple(case for case in simulated if not is_in_cache(case, {}))
        motions = body_motions(replace(planned, simulated=simulated))
    with wrong.at():
        if planned.recorded:
            from vobench.runner.import_recording import read_all

            recordings = read_all(planned)
    wrong.require_none()
    return Preflight(motions, recordings)


def summarize(planned: Plan, *, with_stages: bool = False) -> PlanSummary:
    """Validate a plan, and summarise it. With `with_stages`, the remaining work is counted, too.

    Raises SuiteError with all mistakes.
    """
    checked = preflight(planned)
    cases = tuple(_case_summary(case, checked) for case in planned.cases)
    doubts = tuple(doubts_of_plan(planned))
    if not with_stages:
        return PlanSummary(planned, cases, doubts=doubts)

    from vobench.runner.dry_run import to_do

    stages = to_do(plan(planned, checked.recordings), cache_folder())
    return PlanSummary(planned, cases, tuple(stages), doubts)


def is_in_cache(case: Case | RecordedCase, recordings: "Mapping[str, Recording]") -> bool:
    """Whether the sequence of a case is cached."""
    return is_done(sequence_tasks(case, recordings)[-1], cache_folder())


def _case_summary(case: Case | RecordedCase, checked: Preflight) -> CaseSummary:
    is_made = is_in_cache(case, checked.recordings)
    notes: tuple[str, ...] | None = None
    if isinstance(case, RecordedCase):
        recording = checked.recordings[case.name]
        t_ns = recording.t_ns
        to_make = f"to import from {case.source.path}"
        notes = tuple(recording.notes)
    else:
        t_ns = checked.motions[motion_name(case)].t_ns
        to_make = TO_SIMULATE
    return CaseSummary(
        case=case.name,
        frames=len(t_ns),
        duration_s=float(t_ns[-1] - t_ns[0]) / NS_PER_S,
        simulated=is_made and not isinstance(case, RecordedCase),
        sequence=IN_CACHE if is_made else to_make,
        notes=notes,
    )
