"""The score: what doesn't change it, what a failure looks like, and its JSON form."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.metric.score import ScoreSettings, score
from vobench.trajectory.trajectory import Trajectory

N = 120
T_NS = np.arange(N, dtype=np.int64) * 33_333_333
NAMES = ["ate_trans", "ate_rot", "rpe_trans", "rpe_rot", "kitti_t_rel", "kitti_r_rel"]
UNITS = ["m", "deg", "m", "deg", "1", "deg/m"]
STATISTICS = ["n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99"]


def figure_of_eight():
    """Poses on a level eight of about 9 m that look where they go."""
    s = np.linspace(0, 2 * np.pi, N)
    yaw = np.arctan2(2 * np.cos(2 * s), np.cos(s))
    return se3.transform(se3.rotation_z(yaw), np.stack([np.sin(s), np.sin(2 * s), 0 * s], -1))


def random_pose(rng):
    q = rng.normal(size=4)
    return se3.transform(se3.from_quaternion(q / np.linalg.norm(q)), 10 * rng.normal(size=3))


def noisy(T, rng, size=0.01):
    step = se3.transform(se3.rotation_z(size * rng.normal(size=len(T))), size * rng.normal(size=(len(T), 3)))
    return T @ step


def rmse(result):
    return {metric.name: metric.statistics.rmse for metric in result.metrics}


GT = Trajectory(T_NS, figure_of_eight())
LINE = Trajectory(T_NS, se3.transform(np.eye(3), np.linspace(0, 5, N)[:, None] * [0.6, 0.8, 0.0]))


@pytest.mark.parametrize("kind", ["none", "origin", "se3", "sim3"])
@pytest.mark.parametrize("gt", [GT, LINE])
def test_the_truth_scores_zero(gt, kind):
    result = score(gt, gt, settings=ScoreSettings(alignment=kind))
    assert list(rmse(result)) == NAMES
    assert max(rmse(result).values()) < 1e-12
    assert result.coverage.ratio == 1.0


@pytest.mark.parametrize("gt", [GT, LINE])
@given(seed=st.integers(0, 2**32 - 1))
def test_a_rigid_motion_of_the_estimate_changes_nothing(gt, seed):
    rng = np.random.default_rng(seed)
    est = Trajectory(T_NS, noisy(gt.T_world_frame, rng))
    elsewhere = Trajectory(T_NS, random_pose(rng) @ est.T_world_frame)
    assert rmse(score(gt, elsewhere)) == pytest.approx(rmse(score(gt, est)), rel=1e-9)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_rigid_motion_of_the_truth_changes_nothing_either(seed):
    rng = np.random.default_rng(seed)
    est = Trajectory(T_NS, noisy(GT.T_world_frame, rng))
    elsewhere = Trajectory(T_NS, random_pose(rng) @ GT.T_world_frame)
    assert rmse(score(elsewhere, est)) == pytest.approx(rmse(score(GT, est)), rel=1e-9)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_truth_and_estimate_may_change_places(seed):
    est = Trajectory(T_NS, noisy(GT.T_world_frame, np.random.default_rng(seed)))
    here, there = rmse(score(GT, est)), rmse(score(est, GT))
    for name in ("ate_trans", "ate_rot", "rpe_trans", "rpe_rot"):
        assert there[name] == pytest.approx(here[name], rel=1e-9)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_freer_the_alignment_the_smaller_the_error(seed):
    rng = np.random.default_rng(seed)
    est = Trajectory(T_NS, random_pose(rng) @ noisy(GT.T_world_frame, rng, 0.05))
    of = {
        kind: rmse(score(GT, est, settings=ScoreSettings(alignment=kind)))["ate_trans"]
        for kind in ("none", "origin", "yaw", "se3", "sim3")
    }
    slack = 1 + 1e-12
    assert of["sim3"] <= of["se3"] * slack
    assert of["se3"] <= min(of["yaw"], of["origin"]) * slack
    assert of["yaw"] <= of["none"] * slack


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), factor=st.floats(1.001, 100))
def test_larger_errors_score_larger_in_proportion(seed, factor):
    offset_m = np.random.default_rng(seed).normal(size=(N, 3))

    def errors_of(size_m):
        T = se3.transform(GT.T_world_frame[:, :3, :3], GT.positions_m + size_m * offset_m)
        return rmse(score(GT, Trajectory(T_NS, T), settings=ScoreSettings(alignment="none")))

    small, large = errors_of(0.01), errors_of(0.01 * factor)
    for name in ("ate_trans", "rpe_trans", "kitti_t_rel"):
        assert large[name] == pytest.approx(factor * small[name], rel=1e-9)


@given(seed=st.integers(0, 2**32 - 1), scale=st.floats(0.01, 100))
def test_with_sim3_the_scale_of_the_estimate_changes_nothing(seed, scale):
    est = noisy(GT.T_world_frame, np.random.default_rng(seed))
    scaled = se3.transform(est[:, :3, :3], scale * est[:, :3, 3])
    settings = ScoreSettings(alignment="sim3")
    here, there = (score(GT, Trajectory(T_NS, T), settings=settings) for T in (est, scaled))
    assert rmse(there) == pytest.approx(rmse(here), rel=1e-9)
    assert there.alignment.scale * scale == pytest.approx(here.alignment.scale)


def test_se3_does_not_forgive_a_wrong_scale():
    scaled = se3.transform(GT.T_world_frame[:, :3, :3], 1.1 * GT.positions_m)
    result = score(GT, Trajectory(T_NS, scaled))
    spread_m = np.sqrt(np.mean(np.sum((GT.positions_m - GT.positions_m.mean(0)) ** 2, axis=1)))
    assert rmse(result)["ate_trans"] == pytest.approx(0.1 * spread_m)


def test_relative_errors_do_not_change_when_truth_and_estimate_change_places():
    est = Trajectory(T_NS, noisy(GT.T_world_frame, np.random.default_rng(1)))
    here, there = rmse(score(GT, est)), rmse(score(est, GT))
    assert (here["rpe_trans"], here["rpe_rot"]) == pytest.approx((there["rpe_trans"], there["rpe_rot"]))


def test_standing_still_scores_the_spread_of_the_truth_about_its_mean():
    result = score(GT, Trajectory(T_NS, np.broadcast_to(np.eye(4), (N, 4, 4))))
    spread_m = np.sqrt(np.mean(np.sum((GT.positions_m - GT.positions_m.mean(0)) ** 2, axis=1)))
    assert rmse(result)["ate_trans"] == pytest.approx(spread_m)
    assert result.ate_rot_deg[0] == pytest.approx(0.0)
    # All that was driven is missing: at most the length and the one frame that a segment may exceed it by.
    assert result.metric("kitti_t_rel").statistics.max <= 1.0 + np.diff(GT.distances_m()).max() / 0.5
    assert any("leave open: rotation;" in warning for warning in result.warnings)


def test_losing_track_at_the_hard_spot_does_not_pay():
    T = GT.T_world_frame.copy()
    T[60:] = se3.transform(np.eye(3), [0.0, 0.0, 0.5]) @ T[60:]
    kept = np.r_[0:55, 65:N]
    jump, lost = Trajectory(T_NS, T), Trajectory(T_NS[kept], T[kept])
    result = score(GT, lost)
    assert result.metric("rpe_trans").statistics.max == pytest.approx(
        score(GT, jump).metric("rpe_trans").statistics.max
    )
    assert (result.coverage.ratio, result.coverage.first_lost_frame) == (110 / 120, 55)
    assert result.warnings == (
        "the estimate has 110 of 120 frames; the first lost is 55, the longest gap 10 frames (0.367 s)",
    )


def test_no_overlap_in_time_names_both_ranges():
    late = Trajectory(T_NS + 10**10, GT.T_world_frame)
    with pytest.raises(
        AlignmentError,
        match=r"within 10 ms .* from 0\.000000000 s to 3\.966666627 s.* from 10\.000000000 s to 13\.966666627 s",
    ):
        score(GT, late)


def test_an_empty_estimate_is_an_error_of_ours():
    with pytest.raises(AlignmentError, match="the estimate no pose"):
        score(GT, Trajectory(T_NS[:0], GT.T_world_frame[:0]))


def test_a_metric_without_samples_is_left_out_and_a_warning_says_why():
    result = score(GT, Trajectory(T_NS[5:6], GT.T_world_frame[5:6]))
    assert [metric.name for metric in result.metrics] == ["ate_trans", "ate_rot"]
    assert result.metric("rpe_trans") is None
    assert any(warning.startswith("no relative pose error") for warning in result.warnings)
    assert any(warning.startswith("no segment error") for warning in result.warnings)


def test_the_id_says_how_the_number_came_about():
    settings = ScoreSettings(alignment="sim3", max_diff_ns=2_500_000, rpe_delta=5, segment_lengths_m=(0.5, 1))
    result = score(GT, Trajectory(T_NS[10:], GT.T_world_frame[10:]), settings=settings)
    tail = "align=sim3; assoc=nearest<=2.5ms; n=110/120]"
    assert [metric.id for metric in result.metrics] == [
        f"ate.trans.rmse[{tail}",
        f"ate.rot.rmse[{tail}",
        f"rpe.trans.rmse[delta=5f; pairs=consecutive/gt; {tail}",
        f"rpe.rot.rmse[delta=5f; pairs=consecutive/gt; {tail}",
        f"kitti.t_rel.mean[lengths=0.5,1m; step=1; {tail}",
        f"kitti.r_rel.mean[lengths=0.5,1m; step=1; {tail}",
    ]


def test_the_json_form_has_these_keys_and_plain_values():
    result = score(GT, Trajectory(T_NS, noisy(GT.T_world_frame, np.random.default_rng(2)))).as_dict()
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert list(result) == ["metrics", "association", "coverage", "alignment", "failure", "warnings"]
    assert [metric["unit"] for metric in result["metrics"]] == UNITS
    assert all(list(metric) == ["id", "name", "unit", *STATISTICS] for metric in result["metrics"])
    assert result["association"] == {"pairs": N, "gt_poses": N, "est_poses": N, "max_diff_s": 0.01}
    assert list(result["alignment"]) == ["kind", "rotation", "translation", "scale", "unobservable"]
    assert (result["coverage"], result["warnings"]) == (1.0, [])


def test_the_series_are_one_entry_a_matched_frame():
    kept = np.r_[0:50, 60:N]
    result = score(GT, Trajectory(T_NS[kept], noisy(GT.T_world_frame[kept], np.random.default_rng(3))))
    np.testing.assert_array_equal(result.gt_frames, kept)
    np.testing.assert_array_equal(result.gt_t_ns, T_NS[kept])
    errors = np.linalg.norm(result.aligned_positions_m - GT.positions_m[kept], axis=1)
    np.testing.assert_array_equal(result.ate_trans_m, errors)
    assert len(result.ate_rot_deg) == 110


@pytest.mark.parametrize(
    "wrong",
    [
        {"max_diff_ns": -1},
        {"rpe_delta": 0},
        {"rpe_delta": -1.0},
        {"rpe_delta": float("nan")},
        {"rpe_delta": 1.5},
        {"rpe_delta": 181.0, "rpe_unit": "d"},
        {"rpe_unit": "km"},
        {"rpe_rule": "tum", "rpe_unit": "m"},
        {"rpe_rule": "tum", "rpe_unit": "s", "rpe_all_pairs": False, "rpe_pairs_from": "est"},
        {"alignment": "so3"},
        {"align_n": 0},
        {"segment_step_frames": 0},
        {"segment_lengths_m": ()},
        {"segment_lengths_m": (1.0, 0.0)},
        {"fail_ratio": 0.0},
    ],
)
def test_settings_that_measure_nothing_are_refused(wrong):
    with pytest.raises(AlignmentError, match=f"{next(iter(wrong))}.* should be"):
        ScoreSettings(**wrong)
