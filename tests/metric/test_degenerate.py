"""What breaks other tools: each input gives a correct number or an error that names it, never nan or a random roll."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import AlignmentError, SettingError, TrajectoryError
from vobench.geometry import se3
from vobench.metric.score import ScoreSettings, score
from vobench.metric.settings import LIKE
from vobench.trajectory.align import AlignmentKind
from vobench.trajectory.trajectory import Trajectory

N = 60
T_NS = np.arange(N, dtype=np.int64) * 10**8
KINDS = list(AlignmentKind.__args__)
SETTINGS = [ScoreSettings(alignment=kind, full=True) for kind in KINDS] + list(LIKE.values())
NAMES = [*KINDS, *LIKE]
DIRECTIONS = [(1, 0, 0), (0, 0, 1), (0.6, 0.8, 0), (0.36, 0.48, 0.8), (-1, 2, -3)]


def line(direction, length_m=5.0, n=N):
    """A robot of constant orientation that drives straight ahead."""
    u = np.asarray(direction, float) / np.linalg.norm(direction)
    return se3.transform(np.eye(3), np.linspace(0, length_m, n)[:, None] * u)


def random_pose(rng):
    q = rng.normal(size=4)
    return se3.transform(se3.from_quaternion(q / np.linalg.norm(q)), rng.normal(size=3))


def finite(result):
    """The statistics by metric, each a finite number that fits its neighbours."""
    found = {metric.name: metric.statistics for metric in result.metrics}
    for name, s in found.items():
        assert all(np.isfinite(value) for value in dataclasses.astuple(s)), name
        assert s.min <= s.median <= s.p95 <= s.max, name
    assert np.isfinite(result.alignment.rotation).all()
    assert se3.is_rotation(result.alignment.rotation, tolerance=1e-9)
    return found


def trajectory(T, t_ns=T_NS):
    return Trajectory(t_ns[: len(T)], T)


@pytest.mark.parametrize("settings", SETTINGS, ids=NAMES)
@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("noise_m", [0.0, 1e-9, 1e-12])
def test_perfect_orientation_on_a_straight_line_scores_zero_degrees(direction, noise_m, settings):
    rng = np.random.default_rng(1)
    T = line(direction)
    noisy = T.copy()
    noisy[:, :3, 3] += noise_m * rng.normal(size=(N, 3))
    found = finite(score(trajectory(T), trajectory(noisy), settings=settings))
    assert found["ate_rot"].max < 1e-6
    assert found["ate_trans"].max < 10 * noise_m + 1e-12
    assert found["rpe_rot"].max < 1e-6


@pytest.mark.parametrize("noise_m", [0.0, 1e-9])
@given(seed=st.integers(0, 2**32 - 1))
def test_on_a_line_the_estimates_own_world_does_not_matter(noise_m, seed):
    rng = np.random.default_rng(seed)
    T = line((0.36, 0.48, 0.8))
    noisy = T.copy()
    noisy[:, :3, 3] += noise_m * rng.normal(size=(N, 3))
    result = score(trajectory(T), trajectory(random_pose(rng) @ noisy))
    assert result.alignment.unobservable == ("roll about the path",)
    assert finite(result)["ate_rot"].max < 1e-5
    assert any("roll about the path" in warning for warning in result.warnings)


@pytest.mark.parametrize("settings", SETTINGS, ids=NAMES)
@pytest.mark.parametrize("moving", ["neither", "truth", "estimate"])
def test_what_stands_still_scores_the_spread_of_the_other_about_it(moving, settings):
    still, path = np.broadcast_to(np.eye(4), (N, 4, 4)), line((1, 0, 0))
    gt, est = path if moving == "truth" else still, path if moving == "estimate" else still
    result = score(trajectory(gt), trajectory(est), settings=settings)
    found = finite(result)
    spread_m = np.linspace(0, 5, N).std()
    if settings.alignment in ("se3", "sim3", "yaw"):
        assert found["ate_trans"].rmse == pytest.approx(0.0 if moving == "neither" else spread_m, abs=1e-12)
        assert result.alignment.unobservable
    assert result.alignment.scale == 1.0
    assert found["ate_rot"].max < 1e-9
    if moving != "truth":
        assert result.failure.lost_aware is None
        assert "rpe_point_percent" not in found


@pytest.mark.parametrize("settings", SETTINGS, ids=NAMES)
@pytest.mark.parametrize("extent_m", [1e-9, 1e9])
def test_size_alone_breaks_nothing(extent_m, settings):
    angle = np.linspace(0, 5, N)
    T = se3.transform(se3.rotation_z(angle), np.stack([np.sin(angle), np.sin(2 * angle), np.sin(3 * angle)], -1))
    T[:, :3, 3] *= extent_m
    result = score(trajectory(T), trajectory(T), settings=settings)
    found = finite(result)
    assert found["ate_trans"].max < 1e-12 * extent_m
    assert found["ate_rot"].max < 1e-5
    assert result.failure.lost_aware == pytest.approx(1.0)


@pytest.mark.parametrize("settings", SETTINGS, ids=NAMES)
@pytest.mark.parametrize("n", [1, 2, 3])
def test_very_few_poses_have_an_absolute_error_and_say_what_is_missing(n, settings):
    T = line((1, 0, 0), length_m=0.1, n=n) if n > 1 else np.eye(4)[None]
    result = score(trajectory(T), trajectory(T), settings=settings)
    found = finite(result)
    assert found["ate_trans"].max < 1e-12
    assert any(warning.startswith("no segment error") for warning in result.warnings)
    assert ("rpe_trans" in found) == (not any(w.startswith("no relative pose error") for w in result.warnings))


def test_no_overlap_is_an_error_that_names_both_ranges():
    T = line((1, 0, 0))
    with pytest.raises(AlignmentError, match="within 10 ms of a ground-truth pose: the truth has 60 poses from 0"):
        score(trajectory(T), trajectory(T, T_NS + 10**12))


@pytest.mark.parametrize("side", ["gt", "est"])
def test_an_empty_side_is_an_error_that_says_so(side):
    full, empty = trajectory(line((1, 0, 0))), Trajectory(T_NS[:0], np.zeros((0, 4, 4)))
    with pytest.raises(AlignmentError, match="no pose"):
        score(empty if side == "gt" else full, empty if side == "est" else full)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
def test_a_position_that_is_none_is_named(value):
    T = line((1, 0, 0))
    T[17, 1, 3] = value
    with pytest.raises(TrajectoryError, match="pose 17"):
        trajectory(T)


def test_a_mirrored_estimate_is_refused_where_its_rotations_show_it():
    T = line((1, 0, 0))
    T[:, :3, :3] = np.diag([1.0, -1.0, 1.0])
    with pytest.raises(TrajectoryError, match="pose 0 is mirrored"):
        trajectory(T)


def test_mirrored_positions_still_get_a_proper_rotation():
    rng = np.random.default_rng(2)
    T = se3.transform(np.broadcast_to(np.eye(3), (N, 3, 3)), rng.normal(size=(N, 3)))
    mirrored = T.copy()
    mirrored[:, 1, 3] *= -1
    found = finite(score(trajectory(T), trajectory(mirrored)))
    assert found["ate_trans"].rmse > 0.5


@pytest.mark.parametrize("delta", [0, 0.0, -1, np.nan, np.inf])
@pytest.mark.parametrize("unit", ["f", "m", "s", "d", "r"])
def test_a_delta_that_measures_nothing_is_named(delta, unit):
    with pytest.raises(SettingError, match=r"rpe_delta: should be (greater than 0|a finite number)"):
        ScoreSettings(rpe_delta=delta, rpe_unit=unit)


@pytest.mark.parametrize("unit", ["f", "m", "s", "d", "r"])
@pytest.mark.parametrize("all_pairs", [False, True])
def test_a_delta_beyond_the_path_leaves_the_metric_out_and_says_so(unit, all_pairs):
    gt = trajectory(line((1, 0, 0)))
    settings = ScoreSettings(rpe_delta=100.0, rpe_unit=unit if unit != "r" else "d", rpe_all_pairs=all_pairs)
    result = score(gt, gt, settings=settings)
    assert result.metric("rpe_trans") is None
    assert any("no two matched poses are 100 " in warning for warning in result.warnings)


@pytest.mark.parametrize("like", sorted(LIKE))
def test_several_estimates_near_one_true_pose_break_nothing(like):
    T = line((1, 0, 0))
    stamps = np.sort(np.concatenate([T_NS, T_NS + 1_000_000, T_NS + 2_000_000]))
    est = Trajectory(stamps, np.repeat(T, 3, axis=0))
    result = score(trajectory(T), est, settings=LIKE[like])
    assert finite(result)["ate_trans"].max < 1e-12
    assert len(result.gt_frames) == N
