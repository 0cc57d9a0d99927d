"""The score: what doesn't change it, what a failure looks like, and its JSON form."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vobench.errors import AlignmentError, SettingError
from vobench.geometry import se3
from vobench.metric.score import ScoreSettings, pooled, score, statistics
from vobench.metric.segment import devkit_distances, segment_errors
from vobench.metric.settings import LIKE
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
        {"rpe_rule": "tum", "rpe_unit": "s", "rpe_all_pairs": True, "rpe_pairs_from": "est", "project": "xy"},
        {"rpe_rule": "tartanair"},
        {"project": "zx"},
        {"alignment": "so3"},
        {"alignment": "sim3", "scale_rule": "tartanair"},
        {"align_n": 0},
        {"segment_step_frames": 0},
        {"segment_lengths_m": ()},
        {"segment_lengths_m": (1.0, 0.0)},
        {"fail_ratio": 0.0},
    ],
)
def test_settings_that_measure_nothing_are_refused(wrong):
    with pytest.raises(SettingError, match=f"^{next(iter(wrong))}.*: should "):
        ScoreSettings(**wrong)


def drives(seed, n, step_m=1.0):
    """A way that turns, with a pose every metre or so, and an estimate of it that drifts."""
    rng = np.random.default_rng(seed)
    yaw = np.cumsum(rng.normal(scale=0.02, size=n))
    steps = step_m * rng.uniform(0.5, 1.5, n)[:, None] * np.stack([np.cos(yaw), np.sin(yaw), 0 * yaw], -1)
    T_gt = se3.transform(se3.rotation_z(yaw), np.cumsum(steps, axis=0))
    drift = se3.transform(se3.rotation_z(1e-4 * np.arange(n)), 0.01 * np.cumsum(rng.normal(size=(n, 3)), axis=0))
    t_ns = np.arange(n, dtype=np.int64) * 10**8
    return Trajectory(t_ns, T_gt), Trajectory(t_ns, drift @ T_gt)


def devkit_sum(values):
    """One float32 after the other, as the devkit adds up."""
    total = np.float32(0.0)
    for value in values:
        total = np.float32(total + value)
    return total


def devkit_segments(gt, est):
    return segment_errors(
        gt.T_world_frame,
        est.T_world_frame,
        np.arange(len(gt)),
        devkit_distances(gt.positions_m),
        lengths_m=LIKE["kitti"].segment_lengths_m,
        step_frames=10,
        precision="devkit",
    )


def test_like_kitti_takes_its_means_in_float32_one_after_the_other():
    gt, est = drives(1, 3000)
    found, scored = devkit_segments(gt, est), score(gt, est, settings=LIKE["kitti"])
    t_rel, r_rel = (scored.metric(name).statistics for name in ("kitti_t_rel", "kitti_r_rel"))
    assert t_rel.n == len(found) > 1000
    assert t_rel.mean == float(devkit_sum(found.trans_ratio) / np.float32(len(found)))
    assert r_rel.mean == float(np.rad2deg(float(devkit_sum(found.rot_radpm) / np.float32(len(found)))))
    assert t_rel.mean != found.trans_ratio.astype(float).mean()


def test_per_length_is_the_mean_over_the_segments_of_that_length():
    gt, est = drives(2, 1000)
    found, scored = devkit_segments(gt, est), score(gt, est, settings=LIKE["kitti"])
    rows = {(row.name, row.length_m): row.statistics for row in scored.per_length}
    assert {length for _, length in rows} == set(found.length_m)
    for length in set(found.length_m):
        chosen = found.length_m == length
        assert rows["kitti_t_rel", length].n == chosen.sum()
        assert rows["kitti_t_rel", length].mean == pytest.approx(found.trans_ratio[chosen].mean(), rel=1e-6)
        expected = np.rad2deg(found.rot_radpm[chosen].astype(float).mean())
        assert rows["kitti_r_rel", length].mean == pytest.approx(expected, rel=1e-6)


def test_sequences_are_pooled_over_all_their_segments_and_not_over_their_means():
    pairs = [drives(3, 2500), drives(4, 400, step_m=1.2)]
    found = [devkit_segments(*pair) for pair in pairs]
    together = pooled([score(*pair, settings=LIKE["kitti"]) for pair in pairs])
    metrics = {metric.name: metric.statistics for metric in together.metrics}
    ratios = np.concatenate([s.trans_ratio for s in found])
    assert metrics["kitti_t_rel"].n == len(ratios)
    assert metrics["kitti_t_rel"].mean == float(devkit_sum(ratios) / np.float32(len(ratios)))
    of_means = np.mean([s.trans_ratio.mean() for s in found])
    assert metrics["kitti_t_rel"].mean != pytest.approx(of_means, rel=0.01)
    assert metrics["ate_trans"].n == 2900
    assert "; n=2900/2900]" in together.metrics[0].id


def test_every_pooled_statistic_is_that_of_all_errors_together():
    pairs = [drives(5, 300), drives(6, 200)]
    full = ScoreSettings(full=True, segment_lengths_m=(5.0, 10.0), segment_step_frames=1)
    scores = [score(*pair, settings=full) for pair in pairs]
    by_name = {metric.name: metric.statistics for metric in pooled(scores).metrics}
    assert list(by_name) == [metric.name for metric in scores[0].metrics]
    for name, found in by_name.items():
        errors = np.concatenate([part.errors for scored in scores for part in scored.samples if part.of.id == name])
        assert found.rmse == pytest.approx(statistics(errors).rmse, rel=1e-12)
        assert found.p95 == pytest.approx(statistics(errors).p95, rel=1e-12)
    assert pooled(scores[:1]).metrics == scores[0].metrics


def test_segments_of_other_lengths_are_not_pooled_and_that_is_said():
    together = pooled([score(*drives(7, 100)), score(*drives(8, 1000))])
    assert [metric.name for metric in together.metrics] == NAMES[:4]
    assert [warning.partition(",")[0] for warning in together.warnings] == [
        "kitti_t_rel is not pooled",
        "kitti_r_rel is not pooled",
    ]


def test_tartanairs_motions_are_those_between_every_two_poses_in_either_order():
    gt, est = drives(9, 30)
    scored = score(gt, est, settings=LIKE["tartanair"])
    lengths = []
    for i in range(30):
        for j in range(30):
            Q, P = (np.linalg.inv(t.T_world_frame[i]) @ t.T_world_frame[j] for t in (gt, est))
            lengths.append(np.linalg.norm((np.linalg.inv(Q) @ P)[:3, 3]))
    found = scored.metric("rpe_trans").statistics
    assert (found.n, found.mean) == (900, pytest.approx(np.mean(lengths), rel=1e-10))
    assert scored.metric("rpe_trans").id.startswith("rpe.trans.rmse[pairs=all/gt; rule=tartanair; align=se3;")


def test_tartanairs_scale_takes_a_wrong_one_out_of_positions_and_of_motions():
    gt, est = drives(10, 60)
    half = Trajectory(est.t_ns, se3.transform(est.T_world_frame[:, :3, :3], 0.5 * est.positions_m))
    settings = LIKE["tartanair_mono"]
    assert rmse(score(gt, half, settings=settings)) == pytest.approx(rmse(score(gt, est, settings=settings)), rel=1e-9)
    still = Trajectory(gt.t_ns, np.broadcast_to(gt.T_world_frame[0], gt.T_world_frame.shape).copy())
    assert score(gt, still, settings=settings).alignment.scale == 1.0


def test_in_a_plane_what_is_off_it_has_no_error():
    gt, est = drives(11, 80)
    lifted = est.T_world_frame.copy()
    lifted[:, 2, 3] += np.sin(np.arange(80.0))
    settings = ScoreSettings(alignment="none", project="xy", full=True)
    once, again = (rmse(score(gt, Trajectory(gt.t_ns, T), settings=settings)) for T in (est.T_world_frame, lifted))
    flat = {name: value for name, value in once.items() if not name.startswith("ate_z")}
    assert {name: again[name] for name in flat} == pytest.approx(flat, rel=1e-12)
    assert once["ate_z"] == again["ate_z"] == 0.0
    assert "align=none; project=xy;" in score(gt, est, settings=settings).metrics[0].id


ERRORS = st.lists(st.floats(0, 1e6), min_size=1, max_size=50)


@given(ERRORS)
def test_statistics_obey_their_laws(errors):
    s = statistics(errors)
    assert s.n == len(errors)
    assert s.rmse**2 == pytest.approx(s.mean**2 + s.std**2, rel=1e-9, abs=1e-9)
    assert s.sse == pytest.approx(s.n * s.rmse**2)
    ordered = [s.min, s.median, s.p95, s.p99, s.max]
    assert ordered == pytest.approx(sorted(ordered), rel=1e-12)
    assert s.min * (1 - 1e-12) <= s.mean <= s.rmse * (1 + 1e-12) + 1e-12


@given(ERRORS)
def test_percentiles_are_numpys(errors):
    s = statistics(errors)
    assert (s.median, s.p95, s.p99) == pytest.approx(tuple(np.percentile(errors, [50, 95, 99])), rel=1e-12)


def test_statistics_of_a_hundred_and_one_numbers():
    s = statistics(np.arange(101.0))
    assert (s.n, s.mean, s.median, s.min, s.max, s.p95, s.p99) == (101, 50, 50, 0, 100, 95, 99)
    assert s.sse == 338_350
    assert s.std == pytest.approx(np.sqrt(850))


def test_nothing_has_no_statistics():
    with pytest.raises(ValueError, match="got none"):
        statistics([])


def test_the_spread_of_a_sample_divides_by_one_less():
    assert statistics([1.0, 2.0, 3.0], ddof=1).std == 1.0
    assert statistics([4.0], ddof=1).std == 0.0
