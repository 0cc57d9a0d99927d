"""Pairs of a relative error: the rules word for word, and gaps that are spanned."""

import math
from dataclasses import replace
from itertools import accumulate, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.metric import blockwise
from vobench.metric import rpe as pairs_module
from vobench.metric.comparison import in_plane
from vobench.metric.motion_error import errors_between
from vobench.metric.rpe import (
    distance_errors,
    part_errors,
    relative_lengths,
    relative_matrix_errors,
    select_pairs,
    tum_errors,
)
from vobench.metric.score import score
from vobench.metric.settings import LIKE, ScoreSettings
from vobench.trajectory.trajectory import Trajectory

SEEDS = st.integers(0, 2**32 - 1)
UNITS = ["f", "m", "s", "d", "r"]


def walk(rng, n=40, *, still=0.3):
    """Poses that move and turn by random steps, or stand still, and stamps with a random pace."""
    moving = rng.random((n, 1)) > still
    positions = np.cumsum(rng.normal(size=(n, 3)) * moving, axis=0)
    R = se3.rotation_z(np.cumsum(rng.normal(scale=0.2, size=n)))
    return se3.transform(R, positions), np.cumsum(rng.integers(1, 10**9, n))


def as_list(pairs):
    return list(zip(*(side.tolist() for side in pairs), strict=True))


def way(T):
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1))])


def slow_all_pairs(along, delta):
    """Of every pose the first of the later ones that miss delta least, if within a tenth."""
    found = []
    for i in range(len(along) - 1):
        miss = np.abs(along[i + 1 :] - along[i] - delta)
        if miss.min() <= 0.1 * delta:
            found.append((i, i + 1 + int(np.argmin(miss))))
    return found


def slow_chain(steps, delta):
    ends, total = [0], 0.0
    for k, step in enumerate(steps, 1):
        total += step
        if total >= delta:
            ends.append(k)
            total = 0.0
    return list(pairwise(ends))


@given(SEEDS, st.floats(0.1, 20))
def test_all_pairs_by_metres_are_those_of_the_rule_word_for_word(seed, delta):
    T, t_ns = walk(np.random.default_rng(seed))
    found = select_pairs(T, t_ns, delta=delta, unit="m", all_pairs=True, spanning=False)
    assert as_list(found) == slow_all_pairs(way(T), delta)


@given(SEEDS, st.integers(1, 8))
def test_where_poses_lie_on_a_grid_ties_are_the_rules_too(seed, delta):
    steps = np.random.default_rng(seed).integers(0, 3, 40) * 1.0
    T = se3.transform(np.eye(3), np.cumsum(steps)[:, None] * [1.0, 0.0, 0.0])
    found = select_pairs(T, np.arange(40), delta=float(delta), unit="m", all_pairs=True, spanning=False)
    assert as_list(found) == slow_all_pairs(way(T), delta)
    chained = select_pairs(T, np.arange(40), delta=float(delta), unit="m", all_pairs=False)
    assert as_list(chained) == slow_chain(steps[1:], delta)


@given(SEEDS, st.floats(0.2, 10))
def test_all_pairs_by_seconds_are_those_of_the_same_rule(seed, delta):
    T, t_ns = walk(np.random.default_rng(seed))
    found = select_pairs(T, t_ns, delta=delta, unit="s", all_pairs=True, spanning=False)
    assert as_list(found) == slow_all_pairs((t_ns - t_ns[0]) / 1e9, delta)


@given(SEEDS, st.floats(1, 170))
def test_all_pairs_by_angle_look_at_every_two_poses(seed, delta_deg):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(25, 4))
    R = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    T = se3.transform(R, np.zeros((25, 3)))
    apart = np.rad2deg(se3.rotation_angle(np.swapaxes(R, -1, -2)[:, None] @ R[None]))
    expected = [(i, j) for i in range(25) for j in range(i + 1, 25) if abs(apart[i, j] - delta_deg) <= 0.1 * delta_deg]
    assert as_list(select_pairs(T, np.arange(25), delta=delta_deg, unit="d", all_pairs=True)) == expected
    in_rad = select_pairs(T, np.arange(25), delta=np.deg2rad(delta_deg), unit="r", all_pairs=True)
    assert as_list(in_rad) == expected


@given(SEEDS, st.sampled_from(UNITS), st.integers(1, 5))
def test_consecutive_pairs_lie_end_to_end_and_none_is_short(seed, unit, delta):
    T, t_ns = walk(np.random.default_rng(seed))
    first, last = select_pairs(T, t_ns, delta=delta, unit=unit, all_pairs=False)
    assert (first[1:] == last[:-1]).all()
    assert not first.size or first[0] == 0
    turned = np.concatenate([[0.0], np.cumsum(se3.rotation_angle(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3]))])
    along = {"f": np.arange(40), "m": way(T), "s": t_ns / 1e9, "d": np.rad2deg(turned), "r": turned}[unit]
    assert (along[last] - along[first] > delta - 1e-9).all()
    assert (along[last - 1] - along[first] < delta + 1e-9).all()


@pytest.mark.parametrize("all_pairs", [False, True])
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("n", [0, 1, 2])
def test_few_poses_have_few_pairs_and_raise_nothing(n, unit, all_pairs):
    T, t_ns = walk(np.random.default_rng(1), n=2, still=0.0)
    first, last = select_pairs(T[:n], t_ns[:n], delta=1, unit=unit, all_pairs=all_pairs)
    assert len(first) == len(last) <= max(n - 1, 0)


def straight_with_gap():
    """Steps of 0.1 m at 10 Hz; frames 5 to 14 are lost, a metre of path."""
    frames = np.r_[0:5, 15:30]
    return se3.transform(np.eye(3), frames[:, None] * [0.1, 0.0, 0.0]), frames * 10**8, frames


@pytest.mark.parametrize("unit", ["m", "s"])
@pytest.mark.parametrize("all_pairs", [False, True])
def test_the_motion_across_a_gap_is_always_in_some_pair(unit, all_pairs):
    T, t_ns, frames = straight_with_gap()
    first, last = select_pairs(T, t_ns, delta=0.5, unit=unit, all_pairs=all_pairs)
    assert ((frames[first] < 5) & (frames[last] >= 15)).any()
    if all_pairs:
        spanning = dict(zip(frames[first].tolist(), frames[last].tolist(), strict=True))
        assert [spanning[frame] for frame in range(5)] == [15] * 5
        short = select_pairs(T, t_ns, delta=0.5, unit=unit, all_pairs=True, spanning=False)
        assert not ((frames[short[0]] < 5) & (frames[short[1]] >= 15)).any()


@given(SEEDS, st.floats(0.1, 20))
def test_without_gaps_there_is_nothing_to_span(seed, delta):
    T, _ = walk(np.random.default_rng(seed))
    t_ns = np.arange(40) * 10**8
    plain, spanned = (select_pairs(T, t_ns, delta=delta, unit="m", all_pairs=True, spanning=s) for s in (False, True))
    assert as_list(plain) == as_list(spanned)


def test_more_pairs_by_angle_than_memory_holds_are_refused(monkeypatch):
    monkeypatch.setattr(pairs_module, "MAX_PAIRS", 10)
    T = se3.transform(se3.rotation_z(np.arange(30) * 0.1), np.zeros((30, 3)))
    with pytest.raises(AlignmentError, match="take consecutive pairs"):
        select_pairs(T, np.arange(30), delta=0.5, unit="r", all_pairs=True)


@pytest.mark.parametrize("chunk", [1, 40, 10**6])
def test_pairs_by_angle_do_not_depend_on_the_size_of_the_chunks(monkeypatch, chunk):
    T, t_ns = walk(np.random.default_rng(2))
    expected = as_list(select_pairs(T, t_ns, delta=20, unit="d", all_pairs=True))
    monkeypatch.setattr(pairs_module, "CHUNK", chunk)
    assert expected
    assert as_list(select_pairs(T, t_ns, delta=20, unit="d", all_pairs=True)) == expected


# RMSE of `flight`, computed by `rpgs_own`.
GOLDEN = {
    "rel_trans": 0.6820349059980029,
    "rel_rot": 8.58826633323742,
    "rel_yaw": 4.35883688079246,
    "rel_gravity": 7.373479360628293,
}
N = 400


def rotation_x(angle):
    return se3.rotation_z(angle)[..., [2, 0, 1], :][..., [2, 0, 1]]


def circle(n=N, radius_m=5.0):
    angle = np.linspace(0, 2 * np.pi, n)
    level = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    return se3.transform(se3.rotation_z(angle + np.pi / 2), radius_m * level)


@given(SEEDS)
def test_roll_pitch_and_yaw_make_the_rotation_again(seed):
    q = np.random.default_rng(seed).normal(size=(20, 4))
    R = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    roll, pitch, yaw = se3.roll_pitch_yaw_rad(R).T
    Ry = rotation_x(pitch)[..., [2, 0, 1], :][..., [2, 0, 1]]
    np.testing.assert_allclose(se3.rotation_z(yaw) @ Ry @ rotation_x(roll), R, atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2])
def test_where_roll_and_yaw_are_one_yaw_has_it_all(pitch):
    Ry = rotation_x(pitch)[[2, 0, 1], :][:, [2, 0, 1]]
    roll, found, yaw = se3.roll_pitch_yaw_rad(se3.rotation_z(0.3) @ Ry)
    assert (roll, found, yaw) == pytest.approx((0.0, pitch, 0.3))


@given(SEEDS, st.sampled_from(["xy", "xz", "yz"]))
def test_in_a_plane_a_pose_keeps_its_euler_angle_about_the_normal_and_its_place_along_the_plane(seed, plane):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(20, 4))
    T = se3.transform(se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True)), rng.normal(size=(20, 3)))
    (normal,) = {0, 1, 2} - {"xyz".index(axis) for axis in plane}
    flat = in_plane(T, plane)
    angles = Rotation.from_matrix(T[:, :3, :3]).as_euler("xyz")
    expected = Rotation.from_rotvec(angles * np.eye(3)[normal]).as_matrix()
    np.testing.assert_allclose(flat[:, :3, :3], expected, atol=1e-12)
    np.testing.assert_array_equal(flat[:, :3, 3], T[:, :3, 3] * (1 - np.eye(3)[normal]))
    np.testing.assert_allclose(in_plane(flat, plane), flat, atol=1e-12)


def test_lengths_are_tenths_of_the_path_cut_to_centimetres_or_ov_evals():
    assert relative_lengths(12.349, "rpg") == (1.23, 2.46, 3.7, 4.93, 6.17)
    assert relative_lengths(0.02, "rpg") == (0.01,)
    assert relative_lengths(0.0, "rpg") == ()
    assert relative_lengths(12.0, "openvins") == (8.0, 16.0, 24.0, 32.0, 40.0, 48.0)


@pytest.mark.parametrize("rule", ["rpg", "openvins"])
def test_the_truth_has_no_error(rule):
    errors = part_errors(circle(), circle(), relative_lengths(31.4, rule), rule=rule)
    assert set(errors.length_m) >= {8.0, 16.0} or rule == "rpg"
    assert max(errors.trans_m.max(), errors.rot_rad.max(), errors.yaw_rad.max()) < 1e-7


def test_a_drift_in_yaw_is_yaw_and_not_tilt():
    T_gt = circle()
    drift = se3.transform(se3.rotation_z(np.linspace(0, 0.2, N)), np.zeros((N, 3)))
    errors = part_errors(T_gt, drift @ T_gt, (3.0, 6.0), rule="rpg")
    np.testing.assert_allclose(errors.yaw_rad, errors.rot_rad, atol=1e-9)
    assert errors.gravity_rad.max() < 1e-9
    of_length = [errors.yaw_rad[errors.length_m == length].mean() for length in (3.0, 6.0)]
    assert of_length[1] / of_length[0] == pytest.approx(2.0, rel=0.02)


def test_a_drift_in_roll_of_the_world_is_tilt_and_not_yaw():
    T_gt = circle()
    drift = se3.transform(rotation_x(np.linspace(0, 0.01, N)), np.zeros((N, 3)))
    errors = part_errors(T_gt, drift @ T_gt, (3.0,), rule="rpg")
    np.testing.assert_allclose(errors.gravity_rad, errors.rot_rad, rtol=1e-3)
    assert errors.yaw_rad.max() < 1e-3 * errors.gravity_rad.max()


def test_a_length_with_fewer_than_two_parts_is_left_out():
    assert len(part_errors(circle(), circle(), (31.4, 100.0), rule="rpg")) >= 2
    assert len(part_errors(circle(), circle(), (500.0,), rule="rpg")) == 0
    assert len(part_errors(circle(1), circle(1), (1.0,), rule="rpg")) == 0


def test_a_part_ends_within_half_a_metre_or_a_fifth_of_its_length():
    T = se3.transform(np.eye(3), np.arange(20)[:, None] * [3.0, 0.0, 0.0])
    assert len(part_errors(T, T, (8.0,), rule="openvins")) == 0
    assert len(part_errors(T, T, (8.0,), rule="rpg")) == 17


def flight(n=240):
    """A way through space, and an estimate of its middle: half as large, in a tilted world, and drifting."""
    s = np.linspace(0, 7, n)
    p = np.stack([6 * np.cos(s), 4 * np.sin(1.3 * s), 1.5 * np.sin(0.7 * s)], -1)
    gt = se3.transform(se3.rotation_z(s) @ rotation_x(0.3 * np.sin(2 * s)), p)
    drift = se3.transform(se3.rotation_z(0.02 * s) @ rotation_x(0.01 * s**2), 0.03 * np.stack([s, s**2, -s], -1))
    tilted = se3.transform(rotation_x(1.1) @ se3.rotation_z(0.4), [3.0, -2.0, 1.0])
    est = tilted @ drift @ gt
    est[:, :3, 3] *= 0.5
    t_ns = np.arange(n, dtype=np.int64) * 50_000_000
    return Trajectory(t_ns, gt), Trajectory(t_ns[30:200], est[30:200])


def rpgs_own(gt, est, scale):
    """Word for word after Zhang and Scaramuzza (2018), with nothing of ours."""
    T_gt, T_est = gt.T_world_frame[30:200], est.T_world_frame
    whole_m = sum(math.dist(a, b) for a, b in pairwise(gt.positions_m))
    along = [0.0, *accumulate(math.dist(a, b) for a, b in pairwise(T_gt[:, :3, 3]))]
    for share in (0.1, 0.2, 0.3, 0.4, 0.5):
        length = math.trunc(share * whole_m * 100) / 100
        for i, begin in enumerate(along):
            miss, j = min((abs(end - begin - length), j) for j, end in enumerate(along) if j >= i)
            if miss >= 0.2 * length:
                continue
            moved_gt, moved_est = np.linalg.inv(T_gt[i]) @ T_gt[j], np.linalg.inv(T_est[i]) @ T_est[j]
            moved_est[:3, 3] *= scale
            E, R = np.linalg.inv(moved_gt) @ moved_est, T_est[j, :3, :3]
            yaw, pitch, roll = Rotation.from_matrix(R @ E[:3, :3] @ R.T).as_euler("ZYX")
            angle = Rotation.from_matrix(E[:3, :3]).magnitude()
            yield length, np.linalg.norm(E[:3, 3]), angle, abs(yaw), math.hypot(pitch, roll)


def test_like_rpg_measures_what_their_definition_says():
    gt, est = flight()
    scored = score(gt, est, settings=LIKE["rpg"])
    length, trans, rot, yaw, tilt = np.array(list(rpgs_own(gt, est, scored.alignment.scale))).T
    expected = {
        "rel_trans": trans,
        "rel_trans_percent": 100 * trans / length,
        "rel_rot": np.rad2deg(rot),
        "rel_rot_per_m": np.rad2deg(rot) / length,
        "rel_yaw": np.rad2deg(yaw),
        "rel_gravity": np.rad2deg(tilt),
    }
    for name, errors in expected.items():
        found = scored.metric(name).statistics
        assert found.n == len(errors)
        of_ours = [found.rmse, found.mean, found.median, found.std, found.max]
        of_theirs = [np.sqrt(np.mean(errors**2)), errors.mean(), np.median(errors), errors.std(), errors.max()]
        np.testing.assert_allclose(of_ours, of_theirs, rtol=1e-10, err_msg=name)
        rows = [row for row in scored.per_length if row.name == name]
        assert [row.length_m for row in rows] == sorted(set(length))
        for row in rows:
            assert row.statistics.mean == pytest.approx(errors[length == row.length_m].mean(), rel=1e-10)


def test_a_known_flight_keeps_rpgs_figures():
    scored = score(*flight(), settings=LIKE["rpg"])
    rmse = {name: scored.metric(name).statistics.rmse for name in ("rel_trans", "rel_rot", "rel_yaw", "rel_gravity")}
    assert rmse == pytest.approx(GOLDEN, rel=1e-11)


def shortest_part_m(gt, est):
    return min(row.length_m for row in score(gt, est, settings=LIKE["rpg"]).per_length if row.name == "rel_trans")


def test_what_the_truth_did_before_and_after_the_estimate_makes_rpgs_lengths_longer():
    gt, est = flight()
    matched = Trajectory(gt.t_ns[30:200], gt.T_world_frame[30:200])
    assert shortest_part_m(gt, est) == np.trunc(0.1 * gt.distances_m()[-1] * 100) / 100
    assert shortest_part_m(matched, est) == np.trunc(0.1 * matched.distances_m()[-1] * 100) / 100
    assert shortest_part_m(matched, est) < 0.8 * shortest_part_m(gt, est)


@pytest.mark.parametrize(("like", "is_of_its_own_world"), [("rpg", True), ("openvins", False)])
def test_rpg_splits_yaw_from_tilt_in_the_estimates_own_world_and_ov_eval_in_the_truths(like, is_of_its_own_world):
    gt, est = flight()
    settings = replace(LIKE[like], alignment="sim3")
    tilted = Trajectory(est.t_ns, se3.transform(rotation_x(1.0), np.zeros(3)) @ est.T_world_frame)
    once, again = ({m.name: m.statistics.rmse for m in score(gt, e, settings=settings).metrics} for e in (est, tilted))
    assert again["rel_rot"] == pytest.approx(once["rel_rot"], rel=1e-9)
    assert again["rel_trans"] == pytest.approx(once["rel_trans"], rel=1e-9)
    assert (abs(again["rel_yaw"] / once["rel_yaw"] - 1) > 0.1) == is_of_its_own_world
    assert (again["rel_gravity"] == pytest.approx(once["rel_gravity"], rel=1e-9)) != is_of_its_own_world


def straight(n, step_m=0.1):
    return se3.transform(np.eye(3), np.arange(n)[:, None] * [step_m, 0.0, 0.0])


def frames_apart(T, delta, *, all_pairs=True):
    return select_pairs(T, np.arange(len(T)) * 10**8, delta=delta, unit="f", all_pairs=all_pairs)


def test_an_error_made_while_lost_is_counted():
    T_gt = straight(20)
    frames = np.r_[0:5, 15:20]
    T_est = T_gt[frames].copy()
    T_est[5:, 0, 3] -= 1.0  # stood still for the ten lost frames
    errors = errors_between(T_gt[frames], T_est, *frames_apart(T_est, 1))
    np.testing.assert_allclose(errors.trans_m, [0, 0, 0, 0, 1.0, 0, 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize("all_pairs", [False, True])
def test_a_drift_of_one_percent_is_one_percent_of_each_step(all_pairs):
    T_gt, T_est = straight(20), straight(20, step_m=0.101)
    for delta in (1, 5):
        pairs = frames_apart(T_gt, delta, all_pairs=all_pairs)
        assert len(pairs[0]) == (20 - delta if all_pairs else 19 // delta)
        errors = errors_between(T_gt, T_est, *pairs)
        np.testing.assert_allclose(errors.trans_m, 0.001 * delta, atol=1e-12)
        point_m, percent = distance_errors(T_gt, T_est, pairs)
        np.testing.assert_allclose(point_m, 0.001 * delta, atol=1e-12)
        np.testing.assert_allclose(percent, 1.0, rtol=1e-9)


def test_each_relative_metric_is_the_error_that_it_is_called_by():
    T_gt, T_est = straight(20), straight(20, step_m=0.101)
    T_est[:, :3, :3] = se3.rotation_z(0.3 * np.arange(20))
    t_ns = np.arange(20) * 10**8
    settings = ScoreSettings(full=True, alignment="none", rpe_delta=1.0, rpe_unit="f")
    scored = score(Trajectory(t_ns, T_gt), Trajectory(t_ns, T_est), settings=settings)
    pairs = frames_apart(T_gt, 1)
    errors, (point_m, percent) = errors_between(T_gt, T_est, *pairs), distance_errors(T_gt, T_est, pairs)
    chordal, full = relative_matrix_errors(T_gt, T_est, pairs)
    wanted = {
        "rpe_trans": errors.trans_m,
        "rpe_rot": np.rad2deg(errors.rot_rad),
        "rpe_rot_chordal": chordal,
        "rpe_full": full,
        "rpe_point": point_m,
        "rpe_point_percent": percent,
    }
    for name, values in wanted.items():
        assert scored.metric(name).statistics.rmse == pytest.approx(np.sqrt(np.mean(values**2)), rel=1e-9), name


def test_a_turn_is_the_same_by_its_angle_and_by_its_matrix():
    T_gt, T_est = straight(9), straight(9)
    T_est[:, :3, :3] = se3.rotation_z(0.3 * np.arange(9))
    pairs = frames_apart(T_gt, 1)
    (chordal, full), errors = relative_matrix_errors(T_gt, T_est, pairs), errors_between(T_gt, T_est, *pairs)
    np.testing.assert_allclose(errors.rot_rad, 0.3, rtol=1e-12)
    np.testing.assert_allclose(chordal, 2 * np.sqrt(2) * np.sin(errors.rot_rad / 2), rtol=1e-12)
    np.testing.assert_allclose(full, np.hypot(chordal, errors.trans_m), rtol=1e-12)


def test_where_the_truth_stands_there_is_no_percentage():
    T_gt = straight(9, step_m=0.0)
    point_m, percent = distance_errors(T_gt, straight(9), frames_apart(T_gt, 1))
    assert len(percent) == 0
    np.testing.assert_allclose(point_m, 0.1)


def test_of_many_poses_as_many_pairs_are_drawn_as_the_most_that_are_all_taken(monkeypatch):
    monkeypatch.setattr(pairs_module, "MAX_POSES", 30)
    every = as_list(pairs_module.every_pair(30))
    assert sorted(every) == [(first, last) for first in range(30) for last in range(30)]
    first, last = pairs_module.every_pair(31)
    assert len(first) == len(last) == len(every)
    assert set(first) | set(last) == set(range(31))
    assert np.corrcoef(first, last)[0, 1] == pytest.approx(0, abs=0.15)
    assert as_list(pairs_module.every_pair(31)) == as_list((first, last))


def test_one_pose_has_no_relative_error():
    assert len(errors_between(straight(1), straight(1), *frames_apart(straight(1), 1))) == 0


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_errors_do_not_depend_on_the_size_of_the_blocks(monkeypatch, block):
    rng = np.random.default_rng(3)
    T_gt, T_est = (
        straight(50),
        straight(50) @ se3.transform(se3.rotation_z(rng.normal(size=50)), rng.normal(size=(50, 3))),
    )
    pairs = frames_apart(T_gt, 3)
    expected = errors_between(T_gt, T_est, *pairs)
    monkeypatch.setattr(blockwise, "BLOCK", block)
    found = errors_between(T_gt, T_est, *pairs)
    np.testing.assert_array_equal(found.trans_m, expected.trans_m)
    np.testing.assert_array_equal(found.rot_rad, expected.rot_rad)


def drive(t_ns, speed_mps=1.0):
    t_s = np.asarray(t_ns) / 1e9
    return Trajectory(
        np.asarray(t_ns, np.int64), se3.transform(se3.rotation_z(0.1 * t_s), t_s[:, None] * [speed_mps, 0, 0])
    )


TRUTH = drive(np.arange(1001) * 10_000_000)
EVERY_50_MS = np.arange(201) * 50_000_000


def test_the_truth_has_no_error_and_the_last_pose_ends_no_pair():
    errors = tum_errors(TRUTH, drive(EVERY_50_MS), delta_s=1.0)
    assert len(errors) == 201 - 20 - 1
    assert max(errors.trans_m.max(), errors.rot_rad.max()) < 1e-7


def test_a_speed_wrong_by_a_tenth_is_a_tenth_of_a_metre_a_second_until_it_is_scaled():
    fast = drive(EVERY_50_MS, speed_mps=1.1)
    assert tum_errors(TRUTH, fast, delta_s=1.0).trans_m == pytest.approx(0.1)
    assert tum_errors(TRUTH, fast, delta_s=1.0, scale=1 / 1.1).trans_m.max() < 1e-7


def test_the_offset_of_the_clock_is_undone():
    late = Trajectory(EVERY_50_MS - 10**9, drive(EVERY_50_MS).T_world_frame)
    assert len(tum_errors(TRUTH, late, delta_s=1.0)) == 180 - 20  # a second of it lies before the truth
    assert len(tum_errors(TRUTH, late, delta_s=1.0, offset_ns=10**9)) == 180


def test_where_the_truth_has_a_hole_there_is_no_pair():
    kept = np.r_[0:300, 400:1001]
    holed = Trajectory(TRUTH.t_ns[kept], TRUTH.T_world_frame[kept])
    errors = tum_errors(holed, drive(EVERY_50_MS), delta_s=1.0)
    assert 180 - 2 * 20 <= len(errors) < 180
    # What is left lies at most two steps beside the hole, where the nearest truth is a little off.
    assert errors.trans_m.max() < 0.03


@pytest.mark.parametrize("n", [0, 1, 2])
def test_few_poses_have_no_pair(n):
    assert len(tum_errors(TRUTH, drive(EVERY_50_MS[:n]), delta_s=1.0)) == 0
