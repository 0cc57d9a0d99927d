"""The car: it obeys the bicycle model and its limits, stays on the way, and comes back to it."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError, SettingError
from vobench.motion import ackermann as module
from vobench.motion.ackermann import ACKERMANNS, ackermann
from vobench.motion.course import Circle, Figure8, PureRotation, Reverse, Square, StopAndGo
from vobench.trajectory.kinematics import CurveMotion, Kinematics, evenly, level

SMALL = ACKERMANNS["small_robot"]


def town(corner_radius_m=0.8):
    return Square(side_m=5, speed_mps=1, corner_radius_m=corner_radius_m).way()


def off_m(motion, t_ns=None):
    """Distance (K,) from where it should be."""
    t_ns = np.linspace(motion.start_ns, motion.end_ns, 1000) if t_ns is None else t_ns
    apart = motion.at(t_ns).T_world_body - motion.target.at(t_ns).T_world_body
    return np.linalg.norm(apart[:, :2, 3], axis=1)


@pytest.mark.parametrize(
    "target",
    [
        Circle(radius_m=2, speed_mps=1).way(),
        town(),
        Figure8(length_m=10, speed_mps=1).way(),
        Reverse(length_m=3, speed_mps=1, radius_m=2).way(),
        StopAndGo(legs_m=[2, 1], speed_mps=1, pause_s=1).way(),
    ],
    ids=["circle", "square", "figure 8", "reverse", "stop and go"],
)
def test_it_turns_as_its_steering_says_and_steers_within_its_limits(target):
    motion = ackermann(target)
    k = motion.at(motion.nodes_s * 1e9)
    steer_rad = motion.state[:, 3]
    np.testing.assert_allclose(
        k.angular_velocity_radps[:, 2] * SMALL.wheelbase_m, k.velocity_mps[:, 0] * np.tan(steer_rad), atol=1e-12
    )
    assert np.abs(steer_rad).max() <= SMALL.max_steer_rad
    assert np.abs(np.diff(steer_rad) / np.diff(motion.nodes_s)).max() <= SMALL.max_steer_radps * (1 + 1e-9)
    assert off_m(motion).max() < 0.01


def test_on_a_circle_it_is_the_circle():
    motion = ackermann(Circle(radius_m=2, speed_mps=1, laps=2).way())
    assert off_m(motion).max() < 1e-6
    np.testing.assert_allclose(motion.state[:, 3], np.arctan(SMALL.wheelbase_m / 2), atol=1e-9)


def test_steps_halved_leave_a_sixteenth_of_the_error(monkeypatch):
    t_ns = np.linspace(0, town().end_ns, 300)
    found = []
    for step_s in (0.04, 0.02, 0.01, 0.0025):
        monkeypatch.setattr(module, "STEP_S", step_s)
        found.append(ackermann(town()).at(t_ns).T_world_body[:, :2, 3])
    errors = [np.abs(positions - found[-1]).max() for positions in found[:-1]]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 3.6).all()
    assert (orders < 4.6).all()
    assert errors[-1] < 1e-8


def test_a_lazy_steering_leaves_the_way_and_comes_back_to_it():
    way = Square(side_m=10, speed_mps=1, corner_radius_m=0.8).way()
    lazy = ackermann(way, replace(SMALL, steer_lag_s=0.4, max_steer_radps=0.4))
    edges_ns = way.breaks_ns
    assert np.abs(np.diff(lazy.state[:, 3]) / np.diff(lazy.nodes_s)).max() == pytest.approx(0.4)
    corner = off_m(lazy, np.linspace(edges_ns[1], edges_ns[3], 200)).max()
    assert corner > 5 * off_m(ackermann(way)).max()
    assert off_m(lazy, edges_ns[4:5] - 1e8)[0] < corner / 30


def test_at_full_lock_it_steers_no_further_though_it_is_off_the_way():
    way = Square(side_m=6, speed_mps=1, corner_radius_m=1.01 * SMALL.sharpest_radius_m).way()
    late = ackermann(way, replace(SMALL, max_steer_radps=0.3))
    assert off_m(late).max() > 0.01
    assert 0.999 * SMALL.max_steer_rad < np.abs(late.state[:, 3]).max() <= SMALL.max_steer_rad


def test_a_mirrored_way_is_driven_as_its_mirror_image():
    left, right = (
        ackermann(Square(side_m=5, speed_mps=1, corner_radius_m=0.8, clockwise=c).way()) for c in (False, True)
    )
    t_ns = np.linspace(0, left.end_ns, 100)
    mirror = np.diag([1.0, -1, 1, 1])
    np.testing.assert_allclose(right.at(t_ns).T_world_body, mirror @ left.at(t_ns).T_world_body @ mirror, atol=1e-10)


def test_a_car_takes_a_corner_of_a_town():
    motion = ackermann(
        Square(side_m=80, speed_mps=8, corner_radius_m=15, accel_mps2=1.5).way(), ACKERMANNS["kitti_like"]
    )
    k = motion.at(np.linspace(0, motion.end_ns, 2000))
    assert off_m(motion).max() < 0.1
    assert k.velocity_mps[:, 0].max() == pytest.approx(8, rel=0.01)
    assert k.acceleration_mps2[:, 1].max() == pytest.approx(8**2 / 15, rel=0.05)


def test_a_way_too_sharp_is_a_sentence():
    with pytest.raises(
        MotionError, match=r"radius of 0\.5 m, but a wheelbase of 0\.33 m and 24 deg .* 0\.741 m or more"
    ):
        ackermann(Circle(radius_m=0.5, speed_mps=1).way())


@pytest.mark.parametrize(
    "target",
    [PureRotation(angle_deg=np.rad2deg(1), turn_radps=1).way(), Square(side_m=3, speed_mps=1).way()],
    ids=["rotation", "square"],
)
def test_a_turn_on_the_spot_is_a_sentence(target):
    with pytest.raises(MotionError, match="a car cannot turn on the spot"):
        ackermann(target)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("wheelbase_m", -0.3, "should be greater than 0"),
        ("lookahead_m", np.nan, "should be a finite number"),
        ("max_steer_radps", np.inf, "should be a finite number"),
        ("steer_lag_s", 0.001, "should be 0.01 or more"),
        ("max_steer_rad", 2.0, "should be less than 1.5708"),
    ],
)
def test_a_car_of_impossible_figures_is_refused_by_name(name, value, sentence):
    with pytest.raises(SettingError, match=rf"^{name}: {sentence} \(got {value}\)"):
        replace(SMALL, **{name: value})


class Unwinding:
    """A way that begins with a radius of 0.1 m and straightens out, smooth all along."""

    breaks = np.zeros(0)

    def at(self, s):
        ahead, up, none = np.array([1.0, 0, 0]), np.array([0, 0, 1.0]), np.zeros((len(s), 3))
        turn = 1 / (0.1 + s)
        return Kinematics(level(s, 0 * s, turn), none + ahead, turn[:, None] * up, none, none)


def test_a_way_too_sharp_in_its_first_metre_alone_is_a_sentence():
    with pytest.raises(MotionError, match=r"the path turns with a radius of 0\.1 m, but a wheelbase"):
        ackermann(CurveMotion(Unwinding(), evenly(0.0, 40.0)), ACKERMANNS["kitti_like"])
