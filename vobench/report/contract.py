"""Whether an estimator keeps the contract: it is run on recordings of a second, each with something of its own."""

import ast
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from importlib import import_module
from pathlib import Path
from statistics import fmean

import numpy as np

import vobench
from vobench import retired
from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import EstimatorFailure
from vobench.estimator.protocol import Image
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import ImuCalibration, Rig, stereo_rig
from vobench.geometry.se3 import transform
from vobench.runner import estimate as running
from vobench.runner.estimate import estimate, frames_of, read_outcome
from vobench.runner.folder import read_tum
from vobench.runner.frames import ANSWERS, TIMES, read_table
from vobench.runner.ground_truth import write_ground_truth
from vobench.runner.key import PLUGIN, offered_names
from vobench.runner.store import SilentProgress
from vobench.sensor.imu import ImuReadings
from vobench.sequence import Sequence, SequenceWriter
from vobench.suite.manifest import read_manifest
from vobench.suite.source import RecordedCase, Source
from vobench.suite.suite import Entrant, Trial

LENS = Pinhole(320, 240, 240.0, 240.0, 159.5, 119.5)
HEIGHT_M = 0.4
BASELINE_M = 0.05
STEP_M = 0.005
STEP_NS = 50_000_000
FRAMES = 20
FIRST_ODD = 10
LAST_ODD = 13
IMU = ImuCalibration(np.eye(4), 200.0, 1e-4, 1e-3, 1e-5, 1e-4)
RIG = stereo_rig(LENS, pitch_deg=90, baseline_m=BASELINE_M, height_m=HEIGHT_M)
STILL_M = 0.01  # farther than this no tracker of a resting picture should come in a second


class Verdict(StrEnum):
    """What a clause comes to. Only a broken one is a breach of the contract."""

    KEPT = "kept"
    BROKEN = "broken"
    NOT_TOLD = "not told"  # it could not be tested
    POOR = "poor"  # within the contract, but a poor result
    ADVICE = "advice"  # nothing wrong today


@dataclass(frozen=True, slots=True)
class Clause:
    """One thing that was looked at, what it comes to, and what was seen."""

    name: str
    verdict: Verdict
    seen: str


def _kept_if(holds: bool) -> Verdict:
    return Verdict.KEPT if holds else Verdict.BROKEN


@dataclass(frozen=True, slots=True)
class Practice:
    """What is recorded: a drive over a textured floor, seen from above, with something odd from FIRST_ODD on."""

    is_still: bool = False
    odd: Callable[[int, Image], Image | None] = field(default=lambda _, picture: picture)

    def write(self, folder: Path) -> Path:
        """Record it. A picture that the odd part makes None is missing."""
        floor = np.random.default_rng(7).integers(30, 220, (60, 42)).repeat(12, 0).repeat(12, 1)
        rig = Rig(RIG.left, RIG.right, RIG.T_body_left, RIG.T_body_right, RIG.wheels, IMU)
        disparity_px = round(240 * BASELINE_M / HEIGHT_M)
        step_px = round(240 * STEP_M / HEIGHT_M)
        with SequenceWriter(folder, rig, case_json=b"{}") as writer:
            for index in range(FRAMES):
                moved = 0 if self.is_still else index
                top = 300 - step_px * moved
                noise = np.random.default_rng(index).integers(-2, 3, (2, 240, 320))
                eyes = [floor[top : top + 240, left : left + 320] for left in (60, 60 + disparity_px)]
                pair = [self.odd(index, (eye + n).astype(np.uint8)) for eye, n in zip(eyes, noise, strict=True)]
                self._write_readings(writer, index, moved)
                if pair[0] is not None:
                    writer.write_frame(index * STEP_NS, pair[0], pair[1])
                    pose = transform(np.eye(3), [STEP_M * moved, 0.0, 0.0])
                    writer.write_truth(index * STEP_NS, pose, np.zeros(6))
        write_ground_truth(folder)
        return folder

    def _write_readings(self, writer: SequenceWriter, index: int, moved: int) -> None:
        t_ns = index * STEP_NS + np.arange(-9 if index else 0, 1) * 5_000_000
        level = np.tile([0.0, 0.0, 9.81], (len(t_ns), 1))
        writer.write_imu(ImuReadings(t_ns, np.zeros_like(level), level))
        wheels = RIG.wheels
        assert wheels
        ticks = round(STEP_M * moved / (2 * np.pi * wheels.radius_m) * wheels.ticks_per_revolution)
        writer.write_encoders([index * STEP_NS], [[ticks, ticks]])


def _at_odd(change: Callable[[Image], Image | None], last: int = LAST_ODD) -> Callable[[int, Image], Image | None]:
    return lambda index, picture: change(picture) if FIRST_ODD <= index < last else picture


PRACTICES = {
    "drive": Practice(),
    "other end": Practice(odd=_at_odd(lambda picture: picture[::-1], FRAMES)),
    "black": Practice(odd=_at_odd(np.zeros_like)),
    "missing": Practice(odd=_at_odd(lambda _: None)),
    "standstill": Practice(is_still=True),
}


def contract(folder: Path) -> Iterator[Clause]:
    """Try an estimator, clause by clause. Raises SuiteError where its manifest is wrong."""
    manifest = read_manifest(folder)
    yield from foreign_imports(folder)
    entrant = Entrant(manifest.name, folder, manifest, manifest.params, manifest.limits)
    with tempfile.TemporaryDirectory(prefix="vobench-try-") as place:
        at = {name: practice.write(Path(place, name)) for name, practice in PRACTICES.items()}

        def run(name: str, again: str = "") -> Path:
            made = Path(place, f"{name} estimated{again}")
            made.mkdir()
            case = RecordedCase(name=name, variant={}, source=Source(path=str(at[name])))
            estimate(Trial(case, entrant, 0), at[name], made, SilentProgress())
            return made

        drive = run("drive")
        yield _ended("rigid poses in time", drive)
        if read_outcome(drive).kind != running.FINISHED:
            return
        yield _repeats(drive, run("drive", " again"), is_declared=manifest.deterministic)
        yield _causes(entrant, drive, lambda: run("other end"))
        yield from _in_one_process(entrant, at["drive"], drive)
        for name in ("black", "missing"):
            yield _ended(f"{name} frames", run(name))
        yield _rests(run("standstill"))
        yield _spends(drive, entrant)


def _ended(name: str, made: Path) -> Clause:
    outcome = read_outcome(made)
    poses = len(read_tum(made / running.ESTIMATE))
    frames = len(read_table(made / ANSWERS))
    if outcome.kind != running.FINISHED:
        return Clause(name, Verdict.BROKEN, f"{outcome.kind} after {frames} frames: {outcome.reason}")
    return Clause(name, Verdict.KEPT, f"{poses} poses of {frames} frames")


def _repeats(first: Path, second: Path, *, is_declared: bool) -> Clause:
    is_same = all((first / name).read_bytes() == (second / name).read_bytes() for name in (running.ESTIMATE, ANSWERS))
    seen = (
        f"two runs are {'the same' if is_same else 'not the same'}, declared deterministic: {str(is_declared).lower()}"
    )
    return Clause("determinism", _kept_if(is_same or not is_declared), seen)


def _causes(entrant: Entrant, drive: Path, run: Callable[[], Path]) -> Clause:
    """Other pictures from FIRST_ODD on must leave the poses before them as they were."""
    manifest = entrant.manifest
    if manifest.command or not (manifest.causal and manifest.deterministic):
        why = "it reads all at once" if manifest.command else "it is not declared causal and deterministic"
        return Clause("causality", Verdict.NOT_TOLD, f"{why}: nothing to compare")
    before = [read_tum(made / running.ESTIMATE) for made in (drive, run())]
    known = [each.T_world_frame[each.t_ns < FIRST_ODD * STEP_NS] for each in before]
    is_same = np.array_equal(known[0], known[1])
    return Clause("causality", _kept_if(is_same), f"poses {'do not hang' if is_same else 'hang'} on later frames")


def _in_one_process(entrant: Entrant, recording: Path, drive: Path) -> Iterator[Clause]:
    """What only a class can be asked: that it leaves its frames alone, and starts again from nothing."""
    manifest = entrant.manifest
    sequence = Sequence.open(recording)
    if not manifest.class_path:
        return
    frames = list(frames_of(sequence, manifest.needs))
    log = drive / "watched.txt"
    try:
        with EstimatorProcess.of_class(
            entrant.folder, manifest.class_path, name=manifest.name, log=log, limits=entrant.limits, is_watched=True
        ) as process:
            tracks = []
            for _ in range(2):
                process.start(sequence.rig, entrant.params, 0)
                answers = [process.process(frame).result for frame in frames]
                tracks.append(
                    [None if answer.T_odom_frame is None else answer.T_odom_frame.tolist() for answer in answers]
                )
    except EstimatorFailure as failure:
        yield Clause("frames unchanged, restart", Verdict.BROKEN, f"{failure.kind}: {failure.reason}")
        return
    yield Clause("frames unchanged", Verdict.KEPT, "no picture and no reading was written to")
    is_same = tracks[0] == tracks[1]
    seen = f"start() once more gives {'the same' if is_same else 'other'} poses"
    yield Clause("restart", _kept_if(is_same or not manifest.deterministic), seen)


def _rests(made: Path) -> Clause:
    """How far the estimate moves while the camera stands still. Poor accuracy is no breach of the contract."""
    if read_outcome(made).kind != running.FINISHED:
        return _ended("standstill", made)
    path_m = read_tum(made / running.ESTIMATE).positions_m
    if not len(path_m):
        return Clause("standstill", Verdict.POOR, "no pose")
    away_m = float(np.linalg.norm(path_m - path_m[:1], axis=1).max())
    verdict = Verdict.KEPT if away_m <= STILL_M else Verdict.POOR
    seen = f"at most {1e3 * away_m:.2f} mm away within a second; at most {1e3 * STILL_M:g} mm is good"
    return Clause("standstill", verdict, seen)


def _spends(made: Path, entrant: Entrant) -> Clause:
    rows = read_table(made / TIMES)
    wall_ms, cpu_ms = ([float(row[name]) for row in rows] for name in ("wall_ms", "cpu_ms"))
    limit_ms = 1e3 * entrant.limits.frame_s
    cost = f"{fmean(wall_ms):.1f} ms a frame, {max(wall_ms):.1f} ms at most, {fmean(cpu_ms):.1f} ms of CPU"
    return Clause("time", _kept_if(max(wall_ms) <= limit_ms), f"{cost}; 320 x 240 pixels")


def foreign_imports(folder: Path) -> Iterator[Clause]:
    """An advice for each import of vobench, in the Python files of a folder, from elsewhere than `vobench.plugin`."""
    for path in sorted(folder.rglob("*.py")):
        with suppress(SyntaxError, ValueError):  # who runs it says what is wrong with it
            for line, module, name in _imports_of_vobench(ast.parse(path.read_bytes())):
                imported = f"{module}.{name}" if name else module
                place = f"{path.relative_to(folder)}:{line}"
                yield Clause("imports", Verdict.ADVICE, f"{place}: {imported}: {_instead_of(module, name)}")


def _imports_of_vobench(tree: ast.Module) -> Iterator[tuple[int, str, str]]:
    """Line, module and name of each import from the inside of vobench; no name where a module is imported."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            public = {PLUGIN.rpartition(".")[2], *vobench.__all__} if node.module == "vobench" else set()
            is_inside = node.module.split(".")[0] == "vobench" and node.module != PLUGIN
            if is_inside:
                yield from ((node.lineno, node.module, alias.name) for alias in node.names if alias.name not in public)
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.startswith("vobench.") and alias.name != PLUGIN:
                    yield node.lineno, alias.name, ""


def _instead_of(module: str, name: str) -> str:
    """What a plugin should import in place of a name of a module, or of the module where there is no name."""
    gone = retired.GONE.get(module, {}).get(name)
    if gone is not None:
        return gone
    moved = retired.MOVED.get(module, {}).get(name)
    if moved is not None and not moved.startswith(f"{PLUGIN}."):
        return f"it is {moved} now, which {PLUGIN} does not offer"
    offered = moved.rpartition(".")[2] if moved is not None else _offered_as(module, name)
    if offered is not None:
        return f"from {PLUGIN} import {offered}"
    return f"{PLUGIN} does not offer it, so it may change or leave without notice"


def _offered_as(module: str, name: str) -> str | None:
    """The name under which `vobench.plugin` offers a name of a module, or a module, None where it does not."""
    imported = f"{module}.{name}" if name else module
    for offered, home in offered_names().items():
        module_of_it, _, original = home.partition(":")
        is_module = module_of_it.rpartition(".")[2] == offered
        full_name = module_of_it if is_module else f"{module_of_it}.{original or offered}"
        if imported == full_name:
            return offered
    home = offered_names().get(name, "").partition(":")[0]
    with suppress(ImportError, AttributeError):  # a module that imports the name from its home
        if home and getattr(import_module(module), name) is getattr(import_module(home), name):
            return name
    return None


def assert_contract(folder: Path | str) -> None:
    """For a plugin's own tests: raises AssertionError with every clause that an estimator's folder does not keep."""
    broken = [f"{clause.name}: {clause.seen}" for clause in contract(Path(folder)) if clause.verdict is Verdict.BROKEN]
    if broken:
        raise AssertionError(f"{folder} does not keep the contract: {'; '.join(broken)}")
