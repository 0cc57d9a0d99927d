"""How often the stated errors of a stereo pair's calibration are right, on pairs whose errors are known.

    python benchmarks/pair_calibration.py [--pairs 200] [--seed 1] [--kind rotated]
    python benchmarks/pair_calibration.py --rendered 6

Each pair is drawn by chance: points of a street or of a room are projected through cameras with known errors. Matches
and tracks have noise, part of which neighbours share and part of which every image of a run repeats, and outliers.
Printed are, by quantity, the share of stated 95 % intervals that hold the truth, the mean and the spread of errors, and
how often a pair without errors is said to have some. `--rendered` prints what is stated of rendered pairs, of which
every other one has no errors. Promised: intervals hold in 95 %, a pair without errors is said
to be off in at most 5 %.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.random import Generator

import vobench
from vobench.analysis.pair_calibration import CalibratedPair, calibrate, center_px
from vobench.analysis.pair_parameter import (
    BASELINE,
    CENTER_X,
    CENTER_Y,
    FOCAL,
    PITCH,
    RIGHT_FOCAL,
    ROLL,
    YAW,
)
from vobench.analysis.realism_report import realism_of
from vobench.analysis.stereo_fit import StereoFit
from vobench.analysis.stereo_matches import RowMatches
from vobench.analysis.tracked_motion import FRAMES_APART, TrackedPoints, true_information
from vobench.estimator.stereo import StereoPair, stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import CalibrationError, CameraError, Rig, stereo_rig, true_rig
from vobench.geometry.se3 import Array
from vobench.runner.recording import read_recording
from vobench.suite.yaml_file import plain

# Half of KITTI's pictures: their field of view at half of the size.
LENS = Pinhole(620, 188, 359.0, 359.0, 309.5, 93.5)
RIG = stereo_rig(LENS, pitch_deg=0, baseline_m=0.54)
RUNS = 4
IMAGES = 10  # of a run
MOTIONS = IMAGES - FRAMES_APART
POINTS = 500  # of a run
COVERED_SIGMAS = 1.96
PLAIN_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class Noise:
    """Standard deviations in px: of each measurement, of each point in a run, and of a region of the image in a run."""

    each: float = 0.12
    of_point: float = 0.06
    of_region: float = 0.03
    region_px: float = 70.0
    outliers: float = 0.03


@dataclass(frozen=True, slots=True)
class Kind:
    """How pairs are drawn: standard deviations of their errors, and whether the true motions are known.

    Angles are in degrees. `common` tells whether both cameras have errors of focal length and centre too.
    """

    angle_deg: float = 0.0
    right_focal: float = 0.0
    center_px: float = 0.0
    tangential: float = 0.0
    common: bool = False
    has_truth: bool = True


KINDS: Mapping[str, Kind] = {
    "perfect": Kind(),
    "perfect, no truth": Kind(has_truth=False),
    "rotated": Kind(angle_deg=0.05, right_focal=5e-4, common=True),
    "rotated, no truth": Kind(angle_deg=0.05, right_focal=5e-4, common=True, has_truth=False),
    "lens": Kind(angle_deg=0.05, right_focal=5e-4, center_px=3.0, tangential=2e-3, common=True),
    "lens, no truth": Kind(
        angle_deg=0.05, right_focal=5e-4, center_px=3.0, tangential=2e-3, common=True, has_truth=False
    ),
}


def draw_error(kind: Kind, rng: Generator) -> CalibrationError:
    """The errors of one pair."""
    roll_deg, pitch_deg, yaw_deg = kind.angle_deg * rng.standard_normal(3)
    center_x_px, center_y_px = kind.center_px * rng.standard_normal(2)
    tangential_1, tangential_2 = kind.tangential * rng.standard_normal(2)
    right = CameraError(
        focal_ratio=kind.right_focal * rng.standard_normal(),
        center_px=(center_x_px, center_y_px),
        tangential=(tangential_1, tangential_2),
    )
    focal, baseline, common_x, common_y = kind.common * rng.standard_normal(4)
    return CalibrationError(
        right_roll_deg=roll_deg,
        right_pitch_deg=pitch_deg,
        right_yaw_deg=yaw_deg,
        right=right,
        focal_ratio=0.003 * focal,
        center_px=(1.5 * common_x, 1.5 * common_y),
        baseline_ratio=0.003 * baseline,
    )


# --- Matches and tracks ---


@dataclass(frozen=True, slots=True)
class Measurements:
    """What is measured on one recording: row errors and tracked points."""

    rows: RowMatches
    motions: tuple[TrackedPoints, ...]


def measure_pair(error: CalibrationError, rng: Generator, *, has_truth: bool, noise: Noise = Noise()) -> Measurements:
    """Matches and tracks of runs of images in which a pair with some errors drives ahead."""
    pair = stereo_pair(RIG, "the benchmark")
    true = true_rig(RIG, error)
    lefts: list[Array] = []
    rights: list[Array] = []
    windows: list[Array] = []
    motions: list[TrackedPoints] = []
    for window in range(RUNS):
        run = _Run(_points_m(rng), true, noise, rng)
        for first in range(IMAGES):
            seen = run.is_seen(first)
            lefts.append(run.left_px[first][seen])
            rights.append(run.right_px[first][seen])
            windows.append(np.full(int(seen.sum()), window))
        motions += [run.tracks(first, pair, window=window, has_truth=has_truth) for first in range(MOTIONS)]
    left_px = np.concatenate(lefts)
    right_px = np.concatenate(rights)
    row_px = (pair.right.in_view(right_px) - pair.left.in_view(left_px))[:, 1]
    return Measurements(RowMatches(left_px, right_px, row_px, np.concatenate(windows)), tuple(motions))


def _points_m(rng: Generator) -> Array:
    """Points (N, 3) of a street, or of a room of the same shape: facades at both sides, the ground, and far things."""
    along_m = rng.uniform(4.0, 70.0, POINTS)
    height_m = rng.uniform(-5.0, 1.6, POINTS)
    side_m = np.where(rng.random(POINTS) < 0.5, -1, 1) * rng.uniform(4.0, 9.0, POINTS)
    points_m = np.stack([side_m, height_m, along_m], -1)
    is_ground = rng.random(POINTS) < 0.25
    points_m[is_ground, 0] = rng.uniform(-6, 6, int(is_ground.sum()))
    points_m[is_ground, 1] = 1.6
    is_far = rng.random(POINTS) < 0.2
    points_m[is_far, 2] = rng.uniform(60, 200, int(is_far.sum()))
    points_m[is_far, 0] = rng.uniform(-0.8, 0.8, int(is_far.sum())) * points_m[is_far, 2]
    points_m[is_far, 1] = rng.uniform(-0.15, 0.02, int(is_far.sum())) * points_m[is_far, 2]
    return points_m


class _Run:
    """The noisy pixels of points in all images of a run."""

    def __init__(self, points_m: Array, true: Rig, noise: Noise, rng: Generator) -> None:
        self._rng = rng
        step_m = rng.uniform(0.5, 1.0)
        turn_rad = rng.normal(0, 0.004)
        self.T_world_left = []
        for index in range(IMAGES):
            R = se3.rotation_z(0.0) @ _rotation_y(turn_rad * index)
            self.T_world_left.append(se3.transform(R, [0.0, 0.0, step_m * index]))
        T_left_world = [se3.inverse(T) for T in self.T_world_left]
        T_true_left = se3.inverse(true.T_body_left) @ RIG.T_body_left
        T_true_right = se3.inverse(true.T_body_camera("right")) @ RIG.T_body_left

        # In the left image the corner is where it is detected; all errors are those of the other images.
        of_right = _RunNoise(len(points_m), noise, rng)
        of_track = _RunNoise(len(points_m), noise, rng)
        self.left_px: list[Array] = []
        self.right_px: list[Array] = []
        self.tracked_px: list[Array] = []
        for T in T_left_world:
            in_left_m = se3.apply(T, points_m)
            exact_px = true.left.project(se3.apply(T_true_left, in_left_m))
            self.left_px.append(exact_px)
            right_px = true.camera("right").project(se3.apply(T_true_right, in_left_m))
            self.right_px.append(right_px + of_right.sample(exact_px))
            self.tracked_px.append(exact_px + of_track.sample(exact_px))

    def is_seen(self, index: int) -> Array:
        """Whether points (N,) are in both images."""
        return _is_inside(self.left_px[index]) & _is_inside(self.right_px[index])

    def tracks(self, first: int, pair: StereoPair, *, window: int, has_truth: bool) -> TrackedPoints:
        """The points that are seen before and after a motion, which begins at an image."""
        last = first + FRAMES_APART
        seen = self.is_seen(first) & _is_inside(self.tracked_px[last])
        left_px = self.left_px[first][seen]
        right_px = self.right_px[first][seen]
        disparity_px = pair.disparity(left_px, right_px, row_px=8.0)
        good = np.isfinite(disparity_px)
        T_after_before = se3.inverse(self.T_world_left[last]) @ self.T_world_left[first]
        information = true_information(T_after_before) if has_truth else np.zeros((6, 6))
        start = T_after_before.copy()
        start[:3, 3] *= 1 + (0.0 if has_truth else 0.003 * self._rng.standard_normal())
        return TrackedPoints(
            left_px=left_px[good],
            right_px=right_px[good],
            after_px=self.tracked_px[last][seen][good],
            disparity_px=disparity_px[good],
            T_after_before=start,
            information=information,
            window=window,
        )


def _rotation_y(angle_rad: float) -> Array:
    cosine = np.cos(angle_rad)
    sine = np.sin(angle_rad)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


def _is_inside(uv_px: Array, margin_px: float = 12.0) -> Array:
    with np.errstate(invalid="ignore"):
        limit = np.array([LENS.width_px, LENS.height_px]) - 1 - margin_px
        return ((uv_px >= margin_px) & (uv_px <= limit)).all(1)


class _RunNoise:
    """The noise of a run: a part of each point and a part of each region of the image persist."""

    def __init__(self, points: int, noise: Noise, rng: Generator) -> None:
        self._noise = noise
        self._rng = rng
        self._of_point = noise.of_point * rng.standard_normal((points, 2))
        is_outlier = rng.random(points) < noise.outliers
        self._of_point[is_outlier] += rng.uniform(-3, 3, (int(is_outlier.sum()), 2))
        # A sum of waves whose directions and phases are drawn: a smooth field with a known spread.
        self._waves = rng.normal(0, 1 / noise.region_px, (12, 2))
        self._phases = rng.uniform(0, 2 * np.pi, (12, 2))

    def sample(self, uv_px: Array) -> Array:
        """The noise (N, 2) in one image of points at pixels (N, 2)."""
        each = self._noise.each * self._rng.standard_normal(uv_px.shape)
        angle = np.nan_to_num(uv_px) @ self._waves.T
        waves = np.cos(angle[..., None] + self._phases)  # (N, 12, 2)
        of_region = self._noise.of_region * np.sqrt(2 / 12) * waves.sum(1)
        return each + self._of_point + of_region


# --- What is stated, and what is true ---

PLACES = {"center": (0.5, 0.5), "left": (0.25, 0.5), "right": (0.75, 0.5), "corner": (0.2, 0.85)}


@dataclass(frozen=True, slots=True)
class Statement:
    """A stated value with its standard deviation, and the true value."""

    name: str
    value: float
    sigma: float
    truth: float

    @property
    def is_covered(self) -> bool:
        """Whether the stated 95 % interval holds the truth."""
        return abs(self.value - self.truth) <= COVERED_SIGMAS * self.sigma


def true_parameters(error: CalibrationError) -> dict[str, float]:
    """The true values of parameters by name."""
    return {
        ROLL: error.right_roll_deg,
        PITCH: error.right_pitch_deg,
        YAW: error.right_yaw_deg,
        RIGHT_FOCAL: error.right.focal_ratio,
        BASELINE: error.baseline_ratio,
        FOCAL: error.focal_ratio,
        CENTER_X: error.center_px[0],
        CENTER_Y: error.center_px[1],
    }


def statements(
    found: CalibratedPair, error: CalibrationError, *, has_truth: bool, rig: Rig = RIG
) -> Iterator[Statement]:
    """All that a fit states, with the truth. Parameters are stated only if rotations explain the pair."""
    calibration = found.calibration
    if not found.has_lens_error:
        for name, truth in true_parameters(error).items():
            if name != BASELINE or has_truth:
                value, sigma = calibration.value(name)
                yield Statement(name, value, sigma, truth)
    if not found.is_offset_determined:
        return
    camera = rig.camera("right")
    uv_px = np.array(list(PLACES.values())) * [camera.width_px, camera.height_px]
    offsets_px, offset_sigmas_px = calibration.disparity_error(uv_px)
    rows_px, row_sigmas_px = calibration.row_error(uv_px)
    true_shift_px = true_right_shift_px(error, uv_px, rig=rig)
    for index, place in enumerate(PLACES):
        yield Statement(f"offset {place}", offsets_px[index], offset_sigmas_px[index], -true_shift_px[index, 0])
        yield Statement(f"row {place}", rows_px[index], row_sigmas_px[index], true_shift_px[index, 1])


def true_right_shift_px(error: CalibrationError, uv_px: Array, *, rig: Rig = RIG) -> Array:
    """By how much the errors of the right camera alone shift its pixels (N, 2)."""
    alone = true_rig(rig, replace(error, focal_ratio=0.0, center_px=(0.0, 0.0), baseline_ratio=0.0))
    T_true_nominal = se3.inverse(alone.T_body_camera("right")) @ rig.T_body_camera("right")
    rays = rig.camera("right").rays(uv_px)
    return alone.camera("right").project(se3.apply(T_true_nominal, rays)) - uv_px


def is_said_to_be_off(found: CalibratedPair) -> bool:
    """Whether a pair is said to be off: an angle, an offset or a lens error is significant."""
    angles = [found.calibration.value(name) for name in (ROLL, PITCH, YAW, RIGHT_FOCAL)]
    (offset_px,), (sigma_px,) = found.calibration.disparity_error(center_px(found.calibration.pair))
    is_off = abs(offset_px) > PLAIN_SIGMAS * sigma_px or found.has_lens_error
    return bool(is_off or any(abs(value) > PLAIN_SIGMAS * sigma for value, sigma in angles))


@dataclass(frozen=True, slots=True)
class Outcome:
    """What was stated of one pair; `is_off` tells whether it is said to be off."""

    statements: tuple[Statement, ...]
    is_off: bool
    has_lens_error: bool
    is_determined: bool


def outcomes(kind: Kind, pairs: int, rng: Generator, *, noise: Noise = Noise()) -> list[Outcome]:
    """The outcomes of pairs that are drawn by chance."""
    results = []
    for _ in range(pairs):
        error = draw_error(kind, rng)
        measured = measure_pair(error, rng, has_truth=kind.has_truth, noise=noise)
        found = calibrate(measured.rows, measured.motions, stereo_pair(RIG, "the benchmark"))
        assert found is not None
        stated = tuple(statements(found, error, has_truth=kind.has_truth))
        results.append(Outcome(stated, is_said_to_be_off(found), found.has_lens_error, found.is_offset_determined))
    return results


@dataclass(frozen=True, slots=True)
class Coverage:
    """The share of intervals that hold the truth, the mean error, its spread, and the mean standard deviation."""

    name: str
    count: int
    covered: float
    bias: float
    spread: float
    sigma: float


def coverages(results: Sequence[Outcome]) -> list[Coverage]:
    """The coverage of each quantity."""
    by_name: dict[str, list[Statement]] = {}
    for outcome in results:
        for statement in outcome.statements:
            by_name.setdefault(statement.name, []).append(statement)
    table = []
    for name, stated in by_name.items():
        errors = np.array([statement.value - statement.truth for statement in stated])
        covered = float(np.mean([statement.is_covered for statement in stated]))
        sigma = float(np.sqrt(np.mean([statement.sigma**2 for statement in stated])))
        table.append(Coverage(name, len(stated), covered, float(errors.mean()), float(errors.std()), sigma))
    return table


# --- Rendered pairs ---

AHEAD = {"targets_m": [[0.6, 0.3]], "controller": "smooth", "slip": "nominal", "rate_hz": 10}
STREET = {
    "kind": "rail",
    "speed_mps": 11,
    "accel_mps2": 10,
    "rate_hz": 10,
    "points_m": [[-44, 0.9, 1.65], [-20, 1, 1.65], [0, 0.9, 1.65], [20, 1, 1.65], [44, 0.9, 1.65]],
}
INDOOR_RIG = {"lens": "paper_blender", "picture_scale": 0.5, "pitch_deg": 10}
CAR_RIG = {
    "own": {
        "left": {"size_px": [613, 185], "focal_px": [353.5, 353.5], "center_px": [300.5, 91.5]},
        "right_at_m": [0.537, 0, 0],
    },
    "pitch_deg": 0,
    "forward_m": 0,
    "height_m": 0,
}
RENDERED_PLACES = {"room": (INDOOR_RIG, AHEAD), "street": (CAR_RIG, STREET), "car_park": (INDOOR_RIG, AHEAD)}


def rendered_statements(index: int, rng: Generator) -> tuple[str, StereoFit, CalibrationError, list[Statement]]:
    """What is stated of a rendered pair, which has no errors if its number is even."""
    names = list(RENDERED_PLACES)
    place = names[index // 2 % len(names)]
    rig, trajectory = RENDERED_PLACES[place]
    error = draw_error(KINDS["perfect" if index % 2 == 0 else "rotated"], rng)
    suite = {
        "name": "pair",
        "scenes": [place],
        "rigs": {"rig": {**rig, "calibration_error": plain(error)}},
        "trajectories": {"path": trajectory},
        "cameras": {"camera": {"sensor": "mt9v034", "blur_sigma_px": 0.35}},
        "frames": [0, 28],
        "estimators": ["stand_still"],
    }
    with TemporaryDirectory() as folder:
        file = Path(folder) / "pair.yaml"
        file.write_text(json.dumps(suite), encoding="utf-8")
        recording = read_recording(vobench.simulate(str(file), quiet=True).path)
    fit = realism_of(recording).pair
    assert fit is not None
    assert fit.calibrated is not None
    return place, fit, error, list(statements(fit.calibrated, error, has_truth=True, rig=recording.rig))


def print_rendered(pairs: int, rng: Generator) -> None:
    """Print what is stated of rendered pairs."""
    stated: list[Statement] = []
    for index in range(pairs):
        place, fit, _, new = rendered_statements(index, rng)
        assert fit.calibrated is not None
        print(f"{place}: said to be off {is_said_to_be_off(fit.calibrated)}, offset {fit.offset_px}")
        for statement in new:
            interval = f"{statement.value:+.5f} ± {statement.sigma:.5f}"
            mark = "" if statement.is_covered else "  MISSED"
            print(f"  {statement.name:24} {interval}, true {statement.truth:+.5f}{mark}", flush=True)
        stated += new
    print(f"intervals that hold: {np.mean([each.is_covered for each in stated]):.1%} of {len(stated)}")


def main() -> None:
    """Print the coverage of all kinds of pairs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=list(KINDS))
    parser.add_argument("--rendered", type=int, metavar="PAIRS")
    options = parser.parse_args()
    if options.rendered:
        print_rendered(options.rendered, np.random.default_rng(options.seed))
        return
    for name in [options.kind] if options.kind else list(KINDS):
        results = outcomes(KINDS[name], options.pairs, np.random.default_rng(options.seed))
        off = np.mean([outcome.is_off for outcome in results])
        lens = np.mean([outcome.has_lens_error for outcome in results])
        determined = np.mean([outcome.is_determined for outcome in results])
        print(f"{name}: said to be off {off:.1%}, lens error {lens:.1%}, offset determined {determined:.1%}")
        for row in coverages(results):
            print(
                f"  {row.name:24} {row.covered:6.1%} of {row.count}, bias {row.bias:+.5f}, spread {row.spread:.5f}, "
                f"stated {row.sigma:.5f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
