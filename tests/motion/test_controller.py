"""A moving target is followed, the clock is kept, what is told is done, and a leg that never ends says how."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError, SettingError
from vobench.geometry import se3
from vobench.geometry.rig import PIONEER_WHEELS
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS, ControllerSettings, Vehicle, loop_growth, references, settling_gain
from vobench.motion.course import Circle, PureRotation, Reverse, rolled
from vobench.motion.disturbance import DELTAS, Disturbance
from vobench.motion.drive import Drive, drive, follow, led_by
from vobench.motion.pioneer import THETAS, AccelerationLimits, Theta, feed_forward, velocities
from vobench.motion.slip import SLIPS
from vobench.trajectory.kinematics import CurveMotion, level

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
    assert run.reached == ()


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
        (([(0, 0), (1, 0)], [(0.1, 0), (0.9, 0)]), {}, r"0\.9 m/s after 0\.0 s.*allows 0\.75 m/s"),
        (straight(0.3), {"rate_hz": float("nan")}, "rate_hz"),
        (straight(0.3), {"start": (0.0, 0.0)}, "three finite values"),
    ],
)
def test_a_path_that_cannot_be_followed_is_refused(path: object, options: dict[str, object], sentence: str) -> None:
    with pytest.raises((MotionError, SettingError), match=sentence):
        follow(*path, **{"start": (0.0, 0.0, 0.0), **options})


@pytest.mark.parametrize(("leg_s", "sentence"), [(0.01, "one frame or more"), (0.0, "leg_s"), (float("nan"), "leg_s")])
def test_a_clock_that_cannot_be_kept_is_refused(leg_s: float, sentence: str) -> None:
    with pytest.raises((MotionError, SettingError), match=sentence):
        drive(SQUARE, leg_s=leg_s)


WAYS = {
    "back": Reverse(length_m=1.5, speed_mps=0.3).way(),
    "back on an arc": Reverse(
        length_m=1.5, speed_mps=0.3, radius_m=-1.0, start_m=(0.3, -0.2), start_heading_deg=np.rad2deg(2.0)
    ).way(),
    "turn": PureRotation(angle_deg=np.rad2deg(-6.0), turn_radps=1.0).way(),
    "circle": Circle(radius_m=1.0, speed_mps=0.3).way(),
}


def told(
    way: CurveMotion, *, theta: str = "pioneer_3dx", rate_hz: float = 30.0, **options: object
) -> tuple[Drive, Array]:
    """The robot told what would take it along a way, and how far (N,) from there it is."""
    t_ns = np.arange(int(way.end_ns * rate_hz / 1e9) + 1) * 1e9 / rate_hz
    ideal, amid = way.at(t_ns).T_world_body, way.at(t_ns + 0.5e9 / rate_hz)
    speeds = amid.velocity_mps[:, 0], amid.angular_velocity_radps[:, 2]
    rates = amid.acceleration_mps2[:, 0], amid.angular_acceleration_radps2[:, 2]
    asked = np.stack(feed_forward(*speeds, *rates, theta=THETAS[theta]), -1)
    h_m = ideal[0, :2, 3] + 0.2 * ideal[0, :2, 0]
    start = (*h_m.tolist(), float(np.arctan2(*ideal[0, 1::-1, 0])))
    run = led_by(asked, start=start, theta=THETAS[theta], rate_hz=rate_hz, **options)
    return run, np.linalg.norm(run.motion.at(run.t_ns).T_world_body[:, :2, 3] - ideal[:, :2, 3], axis=1)


@pytest.mark.parametrize("theta", ["pioneer_3dx", "pioneer_3dx_laser", "wheelchair_125kg"])
@pytest.mark.parametrize("name", WAYS)
def test_a_robot_that_is_told_what_its_dynamics_need_goes_the_way_exactly(name: str, theta: str) -> None:
    _, off_m = told(WAYS[name], theta=theta)
    assert off_m.max() < 5e-5


@pytest.mark.parametrize("name", WAYS)
def test_what_is_left_is_that_references_are_held_and_falls_with_the_square_of_the_period(name: str) -> None:
    coarse, fine = (told(WAYS[name], rate_hz=rate_hz)[1].max() for rate_hz in (20.0, 80.0))
    assert 1.8 < np.log(coarse / fine) / np.log(4) < 2.3


def test_after_going_back_the_robot_stands_where_it_began() -> None:
    run, _ = told(WAYS["back on an arc"])
    assert run.state[:, 3].min() < -0.29
    T_world_body = run.motion.at(run.t_ns).T_world_body
    np.testing.assert_allclose(T_world_body[-1], T_world_body[0], atol=1e-4)
    assert np.linalg.norm(T_world_body[len(run.t_ns) // 2, :2, 3] - T_world_body[0, :2, 3]) > 1


def test_what_disturbs_a_robot_that_nothing_leads_is_never_made_good() -> None:
    rngs = {
        name: np.random.default_rng(n) for n, name in enumerate(("left", "right", "side", "delta_u", "delta_omega"))
    }
    _, slid_m = told(WAYS["back"], slip=SLIPS["slippery"], rngs=rngs)
    pushed, pushed_m = told(WAYS["back"], delta=DELTAS["bumpy"], rngs=rngs)
    assert 1e-3 < slid_m[-1] < 0.3
    assert 1e-2 < pushed_m[-1] < 0.5
    assert abs(pushed.state[-1, 2]) > 1e-3


def test_what_is_told_does_not_depend_on_where_the_robot_is() -> None:
    asked = np.tile([0.2, -0.5], (40, 1))
    here, there = (led_by(asked, start=start) for start in ((0.0, 0.0, 0.0), (5.0, -3.0, 1.0)))
    np.testing.assert_array_equal(here.references, asked)
    np.testing.assert_allclose(there.state[:, 3:], here.state[:, 3:], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ([(0.1, 0.0), (-0.8, 0.0)], r"reference after 0\.0 s is 0\.8 m/s, but the controller allows 0\.75 m/s"),
        (
            [(0.0, 0.0)] * 30 + [(0.0, 2.0)],
            r"reference after 1\.0 s is 2 rad/s, but the controller allows 1\.745 rad/s",
        ),
        ([(0.0, float("nan"))], "reference 1"),
    ],
)
def test_what_a_robot_cannot_be_asked_for_is_refused(asked: object, sentence: str) -> None:
    with pytest.raises(MotionError, match=sentence):
        led_by(asked, start=(0.0, 0.0, 0.0))


FREE = ControllerSettings(10.0, 10.0)
PAPER_THETA = THETAS["pioneer_3dx_paper"]
ERRORS = np.random.default_rng(4).uniform(-3, 3, (40, 3)).tolist()


@pytest.mark.parametrize("settings", CONTROLLERS.values(), ids=CONTROLLERS.keys())
def test_references_stay_within_the_limits(settings: ControllerSettings) -> None:
    for x, y, psi in ERRORS:
        u_ref, omega_ref = references(x, y, psi, settings)
        assert abs(u_ref) <= settings.max_speed_mps * (1 + 1e-12)
        assert abs(omega_ref) <= settings.max_turn_radps * (1 + 1e-12)


def test_limits_slow_h_down_but_do_not_turn_its_way() -> None:
    tight = replace(FREE, max_speed_mps=0.5, max_turn_radps=1.0)
    for x, y, psi in ERRORS:
        free_x, free_y, _ = velocities(psi, *references(x, y, psi, FREE), a_m=FREE.a_m)
        tight_x, tight_y, _ = velocities(psi, *references(x, y, psi, tight), a_m=tight.a_m)
        assert np.arctan2(tight_y, tight_x) == pytest.approx(np.arctan2(free_y, free_x), abs=1e-12)


def test_on_the_target_it_asks_for_nothing() -> None:
    assert references(0.0, 0.0, 1.0, FREE) == (0.0, 0.0)


@pytest.mark.parametrize("period_s", [0.02, 1 / 30, 0.1])
def test_one_euler_step_a_period_is_stable_exactly_below_theta4_over_the_period(period_s: float) -> None:
    threshold = min(PAPER_THETA.t4, PAPER_THETA.t6) / period_s

    def growth(k: float) -> float:
        return loop_growth(k, PAPER_THETA, period_s=period_s, substeps=1, integrator="euler")

    assert growth(threshold) == pytest.approx(1.0, abs=1e-12)
    assert growth(0.999 * threshold) < 1 < growth(1.001 * threshold)


def test_the_papers_gain_is_unstable_with_euler_at_ten_hertz_and_stable_with_runge_kutta() -> None:
    assert loop_growth(10, PAPER_THETA, period_s=0.1, substeps=1, integrator="euler") == pytest.approx(1.0041, abs=5e-5)
    assert loop_growth(10, PAPER_THETA, period_s=0.1, substeps=4, integrator="rk4") == pytest.approx(0.9588, abs=5e-5)


@pytest.mark.parametrize(
    ("theta", "substeps", "integrator"),
    [(PAPER_THETA, 1, "euler"), (PAPER_THETA, 4, "euler"), (PAPER_THETA, 4, "rk4"), (None, 4, "rk4")],
)
def test_below_the_settling_gain_errors_shrink_and_above_it_they_grow(
    theta: Theta | None, substeps: int, integrator: str
) -> None:
    cut = {"period_s": 0.1, "substeps": substeps, "integrator": integrator}
    limit = settling_gain(100.0, lambda gain: loop_growth(gain, theta, **cut))
    assert loop_growth(0.999 * limit, theta, **cut) < 1 < loop_growth(1.001 * limit, theta, **cut)


def test_the_ideal_unicycle_settles_below_two_over_the_period() -> None:
    def growth(gain: float) -> float:
        return loop_growth(gain, None, period_s=0.1, substeps=1, integrator="rk4")

    assert settling_gain(100.0, growth) == pytest.approx(20.0)


def test_the_velocity_of_a_moving_target_is_added_to_what_h_is_asked_to_do() -> None:
    for x, y, psi in ERRORS:
        still = velocities(psi, *references(x, y, psi, FREE), a_m=FREE.a_m)
        moving = velocities(psi, *references(x, y, psi, FREE, path_mps=(0.3, -0.2)), a_m=FREE.a_m)
        np.testing.assert_allclose(np.subtract(moving, still)[:2], [0.3, -0.2], atol=1e-12)


@pytest.mark.parametrize("field", ["gain_per_s", "axis_speed_mps", "a_m", "max_speed_mps"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_settings_that_are_not_positive_are_refused_by_name(field: str, value: float) -> None:
    with pytest.raises(MotionError, match=field):
        replace(FREE, **{field: value})


STATES = np.random.default_rng(0).uniform(-1, 1, (20, 7))


def vehicle(theta: Theta | None = THETAS["pioneer_3dx"], **options: object) -> Vehicle:
    return Vehicle(theta, CONTROLLERS["smooth"], PIONEER_WHEELS, 30.0, 4, "rk4", **options)


def test_the_wheels_are_foreseen_where_they_are_a_period_on_if_nothing_is_asked_to_change() -> None:
    robot, slip = vehicle(None), Disturbance(beta=0.1, skid_s=0.02)
    for state in STATES:
        x, y, psi = robot.advance(state, (state[3], state[4]), slip)[-1, :3]
        T_world_body = level(x - 0.2 * np.cos(psi), y - 0.2 * np.sin(psi), psi)
        half = PIONEER_WHEELS.track_m / 2
        expected = (T_world_body @ [[0, 0, 0], [half, -half, 0], [0, 0, 0], [1, 1, 1]])[:2].T
        np.testing.assert_allclose(robot.contacts_ahead(state, slip), expected, atol=2e-3)


def test_turning_on_the_spot_the_wheels_are_foreseen_on_their_circle() -> None:
    state = np.array([0.2, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0])
    left, right, _ = vehicle().contacts_ahead(state, Disturbance())
    half = PIONEER_WHEELS.track_m / 2
    np.testing.assert_allclose(np.subtract(left, right), 2 * half * np.array([-np.sin(0.1), np.cos(0.1)]), atol=1e-12)


def test_speeds_of_the_ideal_unicycle_run_evenly_to_what_is_asked_in_one_period() -> None:
    for state in STATES:
        speeds = vehicle(None).advance(state, (0.5, -1.0), Disturbance())[:, 3:5]
        share = np.array([0.25, 0.5, 0.75, 1.0])[:, None]
        np.testing.assert_allclose(speeds, (1 - share) * state[3:5] + share * [0.5, -1.0], atol=1e-12)


def test_a_push_acts_beyond_the_limits_of_the_drive_train() -> None:
    robot = vehicle(limits=AccelerationLimits(0.1, 0.1))
    calm = robot.speed_rates(0.0, 0.0, (1.0, 1.0), (0.0, 0.0), (0.0, 0.0))
    assert calm == (0.1, 0.1)
    assert robot.speed_rates(0.0, 0.0, (1.0, 1.0), (0.0, 0.0), (0.3, -0.2)) == pytest.approx((0.4, -0.1))


def test_slip_that_stays_is_the_same_however_it_is_said() -> None:
    robot, slip = vehicle(), Disturbance(0.02, -0.03, 0.05, 0.01, 0.02, 0.1, -0.1)
    almost = slip._replace(left=0.02 + 1e-15)
    for state in STATES:
        held, running = robot.advance(state, (0.5, 0.3), slip, slip), robot.advance(state, (0.5, 0.3), slip, almost)
        np.testing.assert_allclose(held, running, atol=1e-13)
        np.testing.assert_array_equal(held, robot.advance(state, (0.5, 0.3), slip))
