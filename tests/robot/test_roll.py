"""Wheels that roll without slip turn by what their ground travels."""

from dataclasses import dataclass

import numpy as np
import pytest

from vobench.geometry.rig import PIONEER_WHEELS
from vobench.geometry.se3 import Array
from vobench.robot.drive import drive
from vobench.robot.roll import rolled
from vobench.trajectory.kinematics import Kinematics, level

RADIUS, TRACK = PIONEER_WHEELS.radius_m, PIONEER_WHEELS.track_m


@dataclass(frozen=True, slots=True)
class Circling:
    """A body that goes round with speed u and turn w, and slides left, from `start_ns` on."""

    u: float
    w: float
    side: float = 0.0
    start_ns: int = 0
    end_ns: int = 10**10

    @property
    def breaks_ns(self) -> Array:
        return np.array([float(self.start_ns)])

    def at(self, t_ns: Array) -> Kinematics:
        t, still = np.asarray(t_ns) / 1e9, np.zeros(len(t_ns))
        velocity, turn = np.array([self.u, self.side, 0.0]), np.array([0.0, 0.0, self.w])
        poses = level(self.u * np.sin(self.w * t), still, self.w * t)
        rows = [np.tile(v, (len(t), 1)) for v in (velocity, turn, np.cross(turn, velocity), 0 * turn)]
        return Kinematics(poses, *rows)


def test_on_a_circle_each_wheel_goes_round_its_own() -> None:
    t_ns = np.array([0, 1, 10**9, 3 * 10**9 + 7])
    rims = rolled(Circling(0.5, 0.8), t_ns, PIONEER_WHEELS)
    expected = (0.5 + 0.8 * TRACK / 2 * np.array([-1, 1])) / RADIUS * t_ns[:, None] / 1e9
    np.testing.assert_allclose(rims, expected, atol=1e-12)


def test_backwards_they_roll_back_and_on_the_spot_against_each_other() -> None:
    ahead, back = (rolled(Circling(u, 0.0), np.array([10**9]), PIONEER_WHEELS) for u in (0.4, -0.4))
    np.testing.assert_array_equal(back, -ahead)
    left, right = rolled(Circling(0.0, 1.0), np.array([10**9]), PIONEER_WHEELS)[0]
    assert left == -right == pytest.approx(-TRACK / 2 / RADIUS)


def test_a_slide_to_the_side_turns_no_wheel() -> None:
    assert not rolled(Circling(0.0, 0.0, side=0.7), np.array([10**9]), PIONEER_WHEELS).any()


def test_they_stand_at_zero_at_the_start_wherever_the_first_instant_asked_is() -> None:
    early, late = Circling(0.5, 0.8), Circling(0.5, 0.8, start_ns=5 * 10**8)
    t_ns = np.array([10**9, 2 * 10**9])
    np.testing.assert_allclose(
        rolled(late, t_ns, PIONEER_WHEELS), rolled(early, t_ns - 5 * 10**8, PIONEER_WHEELS), atol=1e-12
    )


def test_before_the_start_they_have_yet_to_turn_there() -> None:
    rims = rolled(Circling(0.5, 0.0, start_ns=10**9), np.array([0, 10**9, 2 * 10**9]), PIONEER_WHEELS)
    np.testing.assert_allclose(rims[:, 0] * RADIUS, [-0.5, 0.0, 0.5], atol=1e-12)


def test_of_a_drive_without_slip_they_are_the_rims_that_its_own_equations_turned() -> None:
    run = drive([(0.5, 0.3), (0.2, -0.4)], rate_hz=25.0, substeps=20)
    np.testing.assert_allclose(rolled(run.motion, run.encoder_t_ns, PIONEER_WHEELS), run.rim_rad, atol=1e-9)


def test_with_four_sub_steps_they_are_as_near_as_the_integrator() -> None:
    run = drive([(0.5, 0.3), (0.2, -0.4)])
    np.testing.assert_allclose(rolled(run.motion, run.t_ns, PIONEER_WHEELS), run.rim_rad[::4], atol=1e-7)


def test_no_instant_no_angle() -> None:
    assert rolled(Circling(0.5, 0.8), np.array([], np.int64), PIONEER_WHEELS).shape == (0, 2)
