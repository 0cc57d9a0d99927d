"""A moving target is followed, the clock is kept, and a leg that never ends says how."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.rig import PIONEER_WHEELS
from vobench.geometry.se3 import Array
from vobench.robot.controller import CONTROLLERS, ControllerSettings
from vobench.robot.drive import drive, follow
from vobench.robot.pioneer import THETAS
from vobench.robot.roll import rolled
from vobench.robot.slip import SLIPS

SQUARE = ((1, 1), (0, 1), (1, 0), (2, 2))
SECONDS = np.arange(601) / 30


def straight(speed_mps: float, heading_rad: float = 0.0) -> tuple[Array, Array]:
    ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
    return speed_mps * SECONDS[:, None] * ahead, np.tile(speed_mps * ahead, (len(SECONDS), 1))


def circle(radius_m: float, turn_radps: float) -> tuple[Array, Array]:
    angle = turn_radps * SECONDS
    outward, along = np.stack([np.cos(angle), np.sin(angle)], -1), np.stack([-np.sin(angle), np.cos(angle)], -1)
    return radius_m * outward, radius_m * turn_radps * along


def test_the_ideal_unicycle_comes_onto_a_straight_line_from_beside_it() -> None:
    path = straight(0.4)
    run = follow(*path, start=(-0.1, 0.3, 0.5), theta=None)
    np.testing.assert_allclose(run.state[-1], [*path[0][-1], 0.0, 0.4, 0.0], atol=1e-6)


@pytest.mark.parametrize("name", ["pioneer_3dx", "pioneer_3dx_laser", "wheelchair_125kg"])
def test_a_real_robot_ends_behind_the_line_by_what_its_drag_costs(name: str) -> None:
    theta, gain = THETAS[name], CONTROLLERS["smooth"].gain_per_s
    path = straight(0.1)
    run = follow(*path, start=(0.0, 0.2, 0.0), theta=theta)
    behind = (theta.t4 - 1) * 0.1 / gain
    bent = 0.5 * np.arctanh(gain * behind / 0.5) / gain
    assert path[0][-1, 0] - run.state[-1, 0] == pytest.approx(bent, abs=2e-4)
    assert run.state[-1, 1] == pytest.approx(0.0, abs=2e-4)


def test_without_its_velocity_fed_forward_the_robot_lags_behind_the_same_path() -> None:
    path_m, path_mps = circle(1.0, 0.3)
    fed, unfed = (follow(path_m, v, start=(1.0, 0.0, np.pi / 2)) for v in (path_mps, 0 * path_mps))
    late_fed, late_unfed = (np.hypot(*(run.state[300:, :2] - path_m[300:]).T).max() for run in (fed, unfed))
    assert late_fed < 0.03
    assert late_unfed > 0.3


def test_following_is_the_same_wherever_the_path_lies() -> None:
    linear = replace(CONTROLLERS["smooth"], axis_speed_mps=1e9)
    path_m, path_mps = circle(1.0, 0.3)
    angle, shift = 0.7, np.array([3.0, -1.0])
    R = se3.rotation_z(angle)[:2, :2]
    here = follow(path_m, path_mps, start=(1.0, 0.1, 0.3), controller=linear)
    start = (*(R @ [1.0, 0.1] + shift), 0.3 + angle)
    there = follow(path_m @ R.T + shift, path_mps @ R.T, start=start, controller=linear)
    np.testing.assert_allclose(there.state[:, :2], here.state[:, :2] @ R.T + shift, atol=1e-9)
    np.testing.assert_allclose(there.state[:, 3:], here.state[:, 3:], atol=1e-9)


def test_a_path_in_the_mirror_is_followed_in_the_mirror_to_the_last_bit() -> None:
    path_m, path_mps = circle(1.0, 0.3)
    ahead = follow(path_m, path_mps, start=(1.0, 0.1, 0.3))
    mirrored = follow(path_m * [1, -1], path_mps * [1, -1], start=(1.0, -0.1, -0.3))
    np.testing.assert_array_equal(mirrored.state, ahead.state * [1, -1, -1, 1, -1])


def test_a_path_that_stands_still_is_a_target() -> None:
    still = follow(np.tile([0.5, 0.3], (200, 1)), np.zeros((200, 2)), start=(0.0, 0.0, 0.0))
    waypoint = drive([(0.5, 0.3)], leg_s=199 / 30)
    np.testing.assert_array_equal(still.state, waypoint.state)


def test_a_drive_along_a_path_has_a_frame_for_every_row_and_no_targets() -> None:
    run = follow(*straight(0.3), start=(0.0, 0.0, 0.0))
    assert len(run.t_ns) == len(SECONDS)
    assert run.reached == run.steps_per_leg == ()


def test_by_the_clock_every_leg_takes_its_time_and_speed_is_carried_over() -> None:
    run = drive(SQUARE, rate_hz=10.0, leg_s=3.0, settle_s=1.0)
    assert run.reached == (30, 60, 90, 120)
    assert len(run.t_ns) == 131
    assert np.abs(np.diff(run.state[:, 3])).max() < 0.2
    assert np.abs(run.state[30, 3:]).max() > 0.05


def test_a_leg_that_lasts_no_whole_number_of_frames_does_not_add_up() -> None:
    assert drive(SQUARE, leg_s=0.35).reached == (10, 21, 32, 42)


def test_until_the_first_change_the_clock_makes_no_difference() -> None:
    clocked, patient = drive(SQUARE, leg_s=2.0), drive(SQUARE)
    np.testing.assert_array_equal(clocked.state[:61], patient.state[:61])


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_ideal_unicycle_enters_every_target_and_obeys_within_a_frame(controller: str) -> None:
    run = drive(SQUARE, theta=None, controller=CONTROLLERS[controller])
    assert len(run.reached) == 4
    np.testing.assert_allclose(run.state[1:, 3:], run.references[:-1], atol=1e-12)
    rolling = rolled(run.motion, run.encoder_t_ns, PIONEER_WHEELS)
    np.testing.assert_allclose(rolling, run.rim_rad, atol=1e-6)


def test_a_robot_without_lag_drives_like_the_ideal_unicycle() -> None:
    quick = replace(THETAS["khepera_3"], t1=1e-3, t2=1e-3, t3=0.0, t4=1.0, t5=0.0, t6=1.0)
    ideal, lagging = (
        drive([(0.5, 0.3)], theta=theta, rate_hz=200.0, substeps=16, leg_s=2.0) for theta in (None, quick)
    )
    np.testing.assert_allclose(lagging.state[:, :3], ideal.state[:, :3], atol=2e-3)


def test_a_leg_that_ends_in_a_limit_cycle_says_between_which_distances() -> None:
    wild = ControllerSettings(10.0, 10.0, a_m=0.1)
    with pytest.raises(MotionError, match=r"keeps circling it, between 2\.1\d* and 2\.9\d* m away"):
        drive([(1, 1)], theta=THETAS["pioneer_3dx_paper"], controller=wild, integrator="euler", substeps=1)


def test_a_leg_that_is_only_long_says_how_far_the_robot_still_is() -> None:
    with pytest.raises(MotionError, match=r"target 1 at \(40, 1\) m was not entered.*the robot is 35\.\d m away"):
        drive([(40, 1)], max_time_s=10.0)


@pytest.mark.parametrize("max_time_s", [0.01, 0.1, 0.2])
def test_a_leg_of_a_few_frames_is_out_of_time_like_any_other(max_time_s: float) -> None:
    with pytest.raises(MotionError, match=r"the robot is (1|0\.9\d*) m away"):
        drive([(1, 0)], max_time_s=max_time_s)


def test_side_slip_that_holds_the_robot_off_its_path_is_corrected() -> None:
    sliding = replace(SLIPS["none"], angle_std_rad=0.05, correlation_s=1e9)
    run = follow(*straight(0.3), start=(0.0, 0.0, 0.0), slip=sliding, rngs={"side": np.random.default_rng(1)})
    assert np.abs(run.state[-60:, 1]).max() < 0.03
    assert abs(run.state[-1, 2]) > 1e-3


@pytest.mark.parametrize(
    ("path", "options", "sentence"),
    [
        (([(0, 0), (1, 0)], [(0.1, 0)]), {}, "2 points and 1 velocities"),
        (([(0, float("nan"))], [(0, 0)]), {}, "path point 1"),
        (([(0, 0)], [(0, float("inf"))]), {}, "path velocity 1"),
        (([(0, 0), (1, 0)], [(0.1, 0), (0.9, 0)]), {}, r"0\.9 m/s at point 2.*0\.75 m/s at most"),
        (straight(0.3), {"rate_hz": float("nan")}, "rate_hz"),
        (straight(0.3), {"start": (0.0, 0.0)}, "three finite values"),
    ],
)
def test_a_path_that_cannot_be_followed_is_refused(path: object, options: dict[str, object], sentence: str) -> None:
    with pytest.raises(MotionError, match=sentence):
        follow(*path, **{"start": (0.0, 0.0, 0.0), **options})


@pytest.mark.parametrize(("leg_s", "sentence"), [(0.01, "one frame or more"), (0.0, "leg_s"), (float("nan"), "leg_s")])
def test_a_clock_that_cannot_be_kept_is_refused(leg_s: float, sentence: str) -> None:
    with pytest.raises(MotionError, match=sentence):
        drive(SQUARE, leg_s=leg_s)
