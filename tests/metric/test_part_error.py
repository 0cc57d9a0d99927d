"""Errors over parts of the path: drifts are named for their axes, and published definitions are met."""

import math
from dataclasses import replace
from itertools import accumulate, pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.metric.part_error import nominal_lengths_m, part_errors
from vobench.metric.score import score
from vobench.metric.settings import LIKE
from vobench.trajectory.trajectory import Trajectory

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


def test_lengths_are_tenths_of_the_path_cut_to_centimetres_or_ov_evals():
    assert nominal_lengths_m(12.349, "rpg") == (1.23, 2.46, 3.7, 4.93, 6.17)
    assert nominal_lengths_m(0.02, "rpg") == (0.01,)
    assert nominal_lengths_m(0.0, "rpg") == ()
    assert nominal_lengths_m(12.0, "openvins") == (8.0, 16.0, 24.0, 32.0, 40.0, 48.0)


@pytest.mark.parametrize("rule", ["rpg", "openvins"])
def test_the_truth_has_no_error(rule):
    errors = part_errors(circle(), circle(), nominal_lengths_m(31.4, rule), rule=rule)
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
