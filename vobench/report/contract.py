"""Whether an estimator keeps the contract: it is tried on short recordings, each with something unusual."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from statistics import fmean

import numpy as np

from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import EstimatorFailure
from vobench.geometry.se3 import Array
from vobench.report.plugin_imports import foreign_imports
from vobench.report.practice import FIRST_CHANGED, HEIGHT_PX, PRACTICES, STEP_NS, WIDTH_PX
from vobench.runner.estimate import ESTIMATE, FINISHED, estimate, frames_of, read_outcome
from vobench.runner.folder import read_tum
from vobench.runner.frames import ANSWERS, TIMES, read_table
from vobench.runner.store import SilentProgress
from vobench.sequence import Sequence as Recording
from vobench.suite.estimator_entry import EstimatorEntry
from vobench.suite.manifest import read_manifest
from vobench.suite.plan import Trial
from vobench.suite.source import RecordedCase, Source
from vobench.temporary import temporary_folder

MOST_STATIONARY_M = 0.01  # which a tracker should not exceed within a second at rest
MM_PER_M = 1e3
MS_PER_S = 1e3


class Verdict(StrEnum):
    """The result of a clause. Only a broken clause is a breach of the contract."""

    KEPT = "kept"
    BROKEN = "broken"
    NOT_TESTED = "not tested"  # it could not be tested
    POOR = "poor"  # within the contract, but a poor result
    ADVICE = "advice"  # nothing wrong today


@dataclass(frozen=True, slots=True)
class Clause:
    """One clause of the contract, whether it is kept, and what was observed."""

    name: str
    verdict: Verdict
    seen: str


def contract(folder: Path) -> Iterator[Clause]:
    """Try an estimator, clause by clause. Raises SuiteError if its manifest is wrong."""
    manifest = read_manifest(folder)
    for path, foreign in foreign_imports(folder):
        yield Clause("imports", Verdict.ADVICE, f"{path}:{foreign.line}: {foreign.full_name}: {foreign.remedy}")
    estimator_entry = EstimatorEntry(manifest.name, folder, manifest, manifest.params, manifest.limits)
    with temporary_folder() as place:
        yield from _Attempt(estimator_entry, place).clauses()


def assert_contract(folder: Path | str) -> None:
    """For the tests of a plugin: raises AssertionError with every clause that an estimator's folder breaks."""
    clauses = list(contract(Path(folder)))
    broken = [f"{clause.name}: {clause.seen}" for clause in clauses if clause.verdict is Verdict.BROKEN]
    if broken:
        raise AssertionError(f"{folder} does not keep the contract: {'; '.join(broken)}")


class _Attempt:
    """An estimator that is run on practice recordings in a temporary folder."""

    def __init__(self, estimator_entry: EstimatorEntry, place: Path) -> None:
        self._estimator_entry = estimator_entry
        self._place = place
        self._recordings = {name: practice.write(place / name) for name, practice in PRACTICES.items()}

    def clauses(self) -> Iterator[Clause]:
        """Every clause of the contract; the first one alone if the estimator does not finish an ordinary drive."""
        manifest = self._estimator_entry.manifest
        drive = self._run("drive")
        yield _finishes("rigid poses in time", drive)
        if not _is_finished(drive):
            return
        yield _is_repeatable(drive, self._run("drive", " again"), is_declared=manifest.deterministic)
        yield self._is_causal(drive)
        if manifest.class_path:
            yield from self._leaves_frames_and_restarts(manifest.class_path, log=drive / "watched.txt")
        yield _finishes("black frames", self._run("black"))
        yield _finishes("missing frames", self._run("missing"))
        yield _is_stationary(self._run("standstill"))
        yield _is_in_time(drive, limit_ms=MS_PER_S * self._estimator_entry.limits.frame_s)

    def _run(self, name: str, suffix: str = "") -> Path:
        """The folder of the estimate on a recording."""
        folder = self._place / f"{name} estimated{suffix}"
        folder.mkdir()
        recording = self._recordings[name]
        case = RecordedCase(name=name, variant={}, source=Source(path=str(recording)))
        estimate(Trial(case, self._estimator_entry, 0), recording, folder, SilentProgress())
        return folder

    def _is_causal(self, drive: Path) -> Clause:
        """Whether other pictures from FIRST_CHANGED on leave the poses before them unchanged."""
        manifest = self._estimator_entry.manifest
        if manifest.command:
            return Clause("causality", Verdict.NOT_TESTED, "it reads all frames at once: nothing to compare")
        if not (manifest.causal and manifest.deterministic):
            seen = "it is not declared causal and deterministic: nothing to compare"
            return Clause("causality", Verdict.NOT_TESTED, seen)
        is_same = np.array_equal(_poses_before_change(drive), _poses_before_change(self._run("other end")))
        seen = "poses do not depend on later frames" if is_same else "poses depend on later frames"
        return Clause("causality", _kept_if(is_same), seen)

    def _leaves_frames_and_restarts(self, class_path: str, *, log: Path) -> Iterator[Clause]:
        """What only a class can be asked: that it does not write to its frames, and that start() resets it."""
        estimator_entry = self._estimator_entry
        sequence = Recording.open(self._recordings["drive"])
        frames = list(frames_of(sequence, estimator_entry.manifest.needs))
        tracks = []
        try:
            with EstimatorProcess.of_class(
                estimator_entry.folder,
                class_path,
                name=estimator_entry.manifest.name,
                log=log,
                limits=estimator_entry.limits,
                is_watched=True,
            ) as process:
                for _ in range(2):
                    process.start(sequence.rig, estimator_entry.params, 0)
                    answers = [process.process(frame).result for frame in frames]
                    tracks.append([_pose(answer.T_odom_frame) for answer in answers])
        except EstimatorFailure as failure:
            yield Clause("frames unchanged, restart", Verdict.BROKEN, f"{failure.kind}: {failure.reason}")
            return
        yield Clause("frames unchanged", Verdict.KEPT, "no image and no reading was changed")
        is_same = tracks[0] == tracks[1]
        seen = f"a second start() gives {'the same' if is_same else 'other'} poses"
        yield Clause("restart", _kept_if(is_same or not estimator_entry.manifest.deterministic), seen)


def _kept_if(holds: bool) -> Verdict:
    return Verdict.KEPT if holds else Verdict.BROKEN


def _is_finished(folder: Path) -> bool:
    return read_outcome(folder).kind == FINISHED


def _finishes(name: str, folder: Path) -> Clause:
    """Whether the estimator went through a recording."""
    outcome = read_outcome(folder)
    poses = len(read_tum(folder / ESTIMATE))
    frames = len(read_table(folder / ANSWERS))
    if not _is_finished(folder):
        return Clause(name, Verdict.BROKEN, f"{outcome.kind} after {frames} frames: {outcome.reason}")
    return Clause(name, Verdict.KEPT, f"{poses} poses for {frames} frames")


def _is_repeatable(first: Path, second: Path, *, is_declared: bool) -> Clause:
    """Whether two runs give the same bytes, if that is declared."""
    is_same = all((first / name).read_bytes() == (second / name).read_bytes() for name in (ESTIMATE, ANSWERS))
    runs = "two runs are the same" if is_same else "two runs are not the same"
    seen = f"{runs}, declared deterministic: {str(is_declared).lower()}"
    return Clause("determinism", _kept_if(is_same or not is_declared), seen)


def _poses_before_change(folder: Path) -> Array:
    """The poses (N, 4, 4) of the frames before FIRST_CHANGED."""
    track = read_tum(folder / ESTIMATE)
    return track.T_world_frame[track.t_ns < FIRST_CHANGED * STEP_NS]


def _pose(T_odom_frame: Array | None) -> Sequence[Sequence[float]] | None:
    """A pose as numbers that can be compared."""
    if T_odom_frame is None:
        return None
    rows: list[list[float]] = T_odom_frame.tolist()
    return rows


def _is_stationary(folder: Path) -> Clause:
    """How far the estimate moves while the camera is stationary. Poor accuracy is no breach of the contract."""
    if not _is_finished(folder):
        return _finishes("standstill", folder)
    positions_m = read_tum(folder / ESTIMATE).positions_m
    if not len(positions_m):
        return Clause("standstill", Verdict.POOR, "no pose")
    distance_m = float(np.linalg.norm(positions_m - positions_m[:1], axis=1).max())
    verdict = Verdict.KEPT if distance_m <= MOST_STATIONARY_M else Verdict.POOR
    seen = (
        f"moves by up to {MM_PER_M * distance_m:.2f} mm within a second; "
        f"up to {MM_PER_M * MOST_STATIONARY_M:g} mm is good"
    )
    return Clause("standstill", verdict, seen)


def _is_in_time(folder: Path, *, limit_ms: float) -> Clause:
    """Whether every frame was processed within the limit."""
    rows = read_table(folder / TIMES)
    wall_ms = [float(row["wall_ms"]) for row in rows]
    cpu_ms = [float(row["cpu_ms"]) for row in rows]
    seen = (
        f"{fmean(wall_ms):.1f} ms per frame, {max(wall_ms):.1f} ms at most, {fmean(cpu_ms):.1f} ms of CPU time; "
        f"{WIDTH_PX} × {HEIGHT_PX} pixels"
    )
    return Clause("time", _kept_if(max(wall_ms) <= limit_ms), seen)
