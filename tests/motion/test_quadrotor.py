"""The quadrotor: through its points with the least snap, its thrust where its z axis is."""

import numpy as np
import pytest

from vobench.errors import MotionError, SettingError
from vobench.motion.quadrotor import HOVER_THRUST_MPS2, Quadrotor, minimum_snap, snap_cost

POINTS = np.array([[0, 0, 0], [0, 0, 1], [2, 0, 1.5], [3, 2, 1], [1, 3, 2], [0, 2, 1.0]])
TIMES_S = np.array([0, 2, 4, 6, 8, 11.0])


def sampled(motion, count=2000):
    return motion.at(np.linspace(motion.start_ns, motion.end_ns, count))


def test_it_passes_its_points_at_their_times():
    found = Quadrotor(points_m=POINTS.tolist(), t_s=(TIMES_S + 3).tolist()).motion().at(TIMES_S * 1e9)
    np.testing.assert_allclose(found.T_world_body[:, :3, 3], POINTS, atol=1e-12)


@pytest.mark.parametrize("yaw_deg", [None, 40.0])
def test_its_z_axis_is_the_direction_of_its_thrust(yaw_deg):
    k = sampled(Quadrotor(points_m=POINTS.tolist(), yaw_deg=yaw_deg, speed_mps=1.5).motion())
    thrust = np.einsum("kij,kj->ki", k.T_world_body[:, :3, :3], k.acceleration_mps2) + HOVER_THRUST_MPS2
    z = k.T_world_body[:, :3, 2]
    np.testing.assert_allclose(z, thrust / np.linalg.norm(thrust, axis=1, keepdims=True), atol=1e-12)


def test_an_accelerometer_on_it_feels_thrust_along_z_alone():
    k = sampled(Quadrotor(points_m=POINTS.tolist(), speed_mps=1).motion())
    felt = k.acceleration_mps2 + np.einsum("kji,j->ki", k.T_world_body[:, :3, :3], HOVER_THRUST_MPS2)
    np.testing.assert_allclose(felt[:, :2], 0, atol=1e-10)
    assert felt[:, 2].min() > 0


def test_a_fixed_yaw_is_kept_and_its_nose_turns_to_neither_side():
    k = sampled(Quadrotor(points_m=POINTS.tolist(), yaw_deg=np.rad2deg(0.7), speed_mps=1).motion())
    side = k.T_world_body[:, :2, 0] @ [-np.sin(0.7), np.cos(0.7)]
    np.testing.assert_allclose(side / np.hypot(*k.T_world_body[:, :2, 0].T), 0, atol=0.05)
    ends = sampled(Quadrotor(points_m=POINTS.tolist(), yaw_deg=np.rad2deg(0.7), speed_mps=1).motion(), 2).T_world_body[
        :, :2, 0
    ]
    np.testing.assert_allclose(ends, np.broadcast_to([np.cos(0.7), np.sin(0.7)], (2, 2)), atol=1e-9)


def test_it_looks_along_the_way_at_its_points():
    motion = Quadrotor(points_m=POINTS.tolist(), t_s=TIMES_S.tolist(), speed_mps=1).motion()
    k = motion.at(TIMES_S[2:-1] * 1e9)
    v = np.einsum("kij,kj->ki", k.T_world_body[:, :3, :3], k.velocity_mps)[:, :2]
    nose = k.T_world_body[:, :2, 0]
    cosine = np.sum(v * nose, axis=1) / np.linalg.norm(v, axis=1) / np.linalg.norm(nose, axis=1)
    assert cosine.min() > np.cos(np.deg2rad(3))


def test_its_nose_turns_the_shorter_way_also_across_the_rear():
    around = [[0, 0, 1], [-2, 0.5, 1], [-4, 0, 1], [-6, -0.8, 1]]
    turned_rad = sampled(Quadrotor(points_m=around, speed_mps=1).motion()).angular_velocity_radps[:, 2]
    assert (
        np.abs(np.cumsum(turned_rad)).max() * Quadrotor(points_m=around, speed_mps=1).motion().end_ns / 1e9 / 2000
        < np.pi / 3
    )


@pytest.mark.parametrize("leg", range(5))
def test_no_detour_between_the_points_has_less_snap(leg):
    best, (begin, end) = minimum_snap(TIMES_S, POINTS), TIMES_S[leg : leg + 2]
    nodes, weights = np.polynomial.legendre.leggauss(12)
    at_s = (begin + end) / 2 + (end - begin) / 2 * nodes
    bump = np.polynomial.Polynomial.fromroots([begin] * 4 + [end] * 4).deriv(4)(at_s)
    for axis in range(3):
        # Cost is quadratic: least where the first variation is zero, and it grows to both sides.
        slope = 2 * np.sum(best(at_s, 4)[:, axis] * bump * weights)
        assert abs(slope) < 1e-9 * np.sqrt(np.sum(best(at_s, 4)[:, axis] ** 2 * weights) * np.sum(bump**2 * weights))
    assert np.sum(bump**2 * weights) > 0


def test_no_other_speed_at_a_point_has_less_snap():
    best = minimum_snap(TIMES_S, POINTS)
    finer_s = np.sort(np.append(TIMES_S, 5.0))
    for off_m in (-0.1, 0.1):
        through = np.insert(POINTS, 3, best(5.0) + off_m, axis=0)
        assert snap_cost(minimum_snap(finer_s, through), finer_s) > snap_cost(best, TIMES_S)


def test_free_times_have_less_snap_than_even_ones_and_the_mean_speed_asked():
    motion = Quadrotor(points_m=POINTS.tolist(), speed_mps=0.8).motion()
    legs_m = np.linalg.norm(np.diff(POINTS, axis=0), axis=1)
    assert motion.end_ns / 1e9 == pytest.approx(legs_m.sum() / 0.8)
    free_s = np.concatenate([[0], motion.breaks_ns / 1e9, [motion.end_ns / 1e9]])
    for shares in (np.ones(5), legs_m, np.sqrt(legs_m)):
        times_s = np.concatenate([[0], np.cumsum(shares / shares.sum())]) * free_s[-1]
        assert snap_cost(minimum_snap(free_s, POINTS), free_s) < snap_cost(minimum_snap(times_s, POINTS), times_s)


def test_free_times_are_the_best_near_them():
    motion = Quadrotor(points_m=POINTS.tolist(), speed_mps=0.8).motion()
    free_s = np.concatenate([[0], motion.breaks_ns / 1e9, [motion.end_ns / 1e9]])
    for k in range(1, 5):
        for later_s in (-0.05, 0.05):
            times_s = free_s + later_s * (np.arange(6) == k)
            assert snap_cost(minimum_snap(times_s, POINTS), times_s) > snap_cost(minimum_snap(free_s, POINTS), free_s)


def test_straight_up_and_down_is_flown_level():
    k = sampled(Quadrotor(points_m=[[0, 0, 0], [0, 0, 2], [0, 0, 1]], speed_mps=1).motion())
    np.testing.assert_allclose(k.T_world_body[:, :3, :3], np.broadcast_to(np.eye(3), (2000, 3, 3)), atol=1e-12)


def test_a_fall_that_leaves_less_than_a_tenth_of_the_weight_to_lift_is_refused():
    drop = [[0, 0, 10], [0, 0, 0]]  # the septic from rest to rest accelerates by 7.513 lengths over time squared
    lift = {lasts_s: 1 - 7.513 * 10 / lasts_s**2 / 9.80665 for lasts_s in (2.84, 3.0)}
    assert lift[2.84] < 0.1 < lift[3.0] < 0.15
    assert Quadrotor(points_m=drop, t_s=[0, 3.0], speed_mps=1).motion().end_ns == 3 * 10**9
    with pytest.raises(MotionError, match=r"the rotors would lift 0\.05\d* of the weight; .* 0\.1 or more"):
        Quadrotor(points_m=drop, t_s=[0, 2.84], speed_mps=1).motion()


@pytest.mark.parametrize(
    ("points", "options", "sentence"),
    [
        ([[0, 0, 0], [0, 0, 0]], {}, "points 0 and 1 of the flight are the same"),
        (POINTS.tolist(), {"t_s": [0, 1]}, "there are 2 times for 6 points"),
        (POINTS.tolist(), {"t_s": [0, 1, 1, 2, 3, 4]}, "point 2 is at 1 s, the same time as point 1 at 1 s"),
        (POINTS.tolist(), {"speed_mps": 20.0}, "the rotors would lift .* of the weight; allow more time"),
    ],
)
def test_a_flight_that_cannot_be_flown_is_a_sentence(points, options, sentence):
    with pytest.raises(MotionError, match=sentence):
        Quadrotor(points_m=points, **options).motion()


@pytest.mark.parametrize(
    ("keys", "sentence"),
    [
        ({"points_m": [[0, 0, 0]]}, "points_m: should have 2 or more entries"),
        ({"points_m": [[0, 0, 0], [0, np.inf, 0]]}, r"points_m\.1\.1: should be a finite number"),
        ({"speed_mps": 0}, "speed_mps: should be greater than 0"),
        ({"yaw_deg": np.nan}, "yaw_deg: should be a finite number"),
    ],
)
def test_a_setting_that_cannot_be_is_a_sentence_with_its_key(keys, sentence):
    with pytest.raises(SettingError, match=sentence):
        Quadrotor(**{"points_m": POINTS.tolist(), **keys})
