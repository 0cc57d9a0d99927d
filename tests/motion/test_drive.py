"""A drive enters every target, keeps the physics, and gives the same truth however it is sampled."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vobench.errors import MotionError, SettingError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS, references
from vobench.motion.disturbance import DELTAS, DISTURBANCE_STREAMS, random_disturbances
from vobench.motion.drive import Drive, drive
from vobench.motion.floor_patch import FloorPatch
from vobench.motion.pioneer import THETAS, AccelerationLimits, Theta, accelerations, over_period, velocities
from vobench.motion.slip import SLIP_STREAMS, SLIPS, SlipSettings
from vobench.trajectory.kinematics import level

PATHS = {"figure_10": ((1, 1), (0, 1), (1, 0), (2, 2)), "figure_12": ((0, 1), (1, 1), (2, 2))}
SHORT = ((0.5, 0.3),)


def axle_poses(x_h_m: Array, y_h_m: Array, psi_rad: Array, *, a_m: float) -> Array:
    """T_world_body (N, 4, 4) of the axle midpoint, from the point h that is `a_m` ahead of it."""
    return level(x_h_m - a_m * np.cos(psi_rad), y_h_m - a_m * np.sin(psi_rad), psi_rad)


@cache
def driven(path: str, controller: str, slip: str = "none", seed: int = 0) -> Drive:
    rngs = dict(zip(SLIP_STREAMS, np.random.default_rng(seed).spawn(3), strict=True))
    return drive(PATHS[path], controller=CONTROLLERS[controller], slip=SLIPS[slip], rngs=rngs)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_every_target_is_entered_within_a_centimetre_on_both_axes_in_order(path: str, controller: str) -> None:
    run = driven(path, controller)
    assert list(run.reached) == sorted(set(run.reached))
    for frame, target in zip(run.reached, PATHS[path], strict=True):
        assert np.abs(run.state[frame, :2] - target).max() < 0.01
    assert run.reached[-1] == len(run.t_ns) - 1


def test_a_target_counts_from_the_first_frame_inside_and_not_before() -> None:
    run, start = driven("figure_10", "smooth"), 0
    for frame, target in zip(run.reached, PATHS["figure_10"], strict=True):
        assert (np.abs(run.state[start:frame, :2] - target).max(1) >= 0.01).all()
        start = frame


def test_a_later_target_that_is_met_on_the_way_does_not_count() -> None:
    first, second = drive([(0.5, 0.3), (0, 0)]).reached
    assert 0 < first < second


def test_nothing_jumps_at_a_target() -> None:
    run = driven("figure_10", "smooth")
    largest = np.abs(np.diff(run.state, axis=0)).max(0)
    assert (largest < [0.03, 0.03, 0.06, 0.06, 0.3]).all()


def test_stamps_are_index_over_rate_and_every_fourth_encoder_instant_is_a_frame() -> None:
    run = driven("figure_12", "smooth")
    assert run.t_ns.tolist() == [round(i * 1e9 / 30) for i in range(len(run.t_ns))]
    np.testing.assert_array_equal(run.encoder_t_ns[::4], run.t_ns)
    assert len(run.rim_rad) == len(run.encoder_t_ns) == 4 * (len(run.t_ns) - 1) + 1


@pytest.mark.parametrize(
    "slip",
    [replace(SLIPS["none"], skid_s=0.05), replace(SLIPS["none"], angle_std_rad=0.1, correlation_s=1e9)],
    ids=["skid", "side slip"],
)
def test_the_body_moves_as_its_twist_says(slip: SlipSettings) -> None:
    fine = drive(SHORT, rate_hz=500.0, slip=slip, rngs={"side": np.random.default_rng(1)})
    T, twist = axle_poses(*fine.state[:, :3].T, a_m=0.2), fine.motion.at(fine.t_ns).twist
    step = (se3.inverse(T[:-2]) @ T[2:])[:, :2, 3] * 250
    R_first_middle = se3.rotation_z(np.diff(fine.state[:, 2])[:-1])[:, :2, :2]
    middle = np.einsum("nij,nj->ni", R_first_middle, twist[1:-1, :2])
    np.testing.assert_allclose(step, middle, atol=2e-4)
    np.testing.assert_allclose(twist[:, 5], fine.state[:, 4], atol=1e-12)
    assert np.abs(twist[:, 1]).max() > 1e-3


def test_without_slip_the_axle_never_moves_sideways_and_rims_roll_what_it_travels() -> None:
    run = driven("figure_10", "smooth")
    np.testing.assert_allclose(run.motion.at(run.t_ns).velocity_mps[:, 1], 0, atol=1e-12)
    np.testing.assert_allclose(np.diff(run.rim_rad, axis=1)[::4, 0] * 0.0975 / 0.331, run.state[:, 2], atol=1e-12)


def test_a_mirrored_course_is_driven_in_mirror_image_to_the_last_bit() -> None:
    ahead = drive([(0.5, 0.3), (0.2, -0.4)], start=(0.1, 0.2, 0.3))
    mirrored = drive([(0.5, -0.3), (0.2, 0.4)], start=(0.1, -0.2, -0.3))
    np.testing.assert_array_equal(mirrored.state, ahead.state * [1, -1, -1, 1, -1])
    np.testing.assert_array_equal(mirrored.rim_rad, ahead.rim_rad[:, ::-1])


def test_the_course_may_lie_anywhere_if_the_controller_treats_all_directions_alike() -> None:
    # tanh acts on each world axis; without its bend (a high axis speed) the law is a rotation-free gain.
    linear = replace(CONTROLLERS["smooth"], axis_speed_mps=1e9)
    angle, shift = 0.7, np.array([3.0, -1.0])
    R = se3.rotation_z(angle)[:2, :2]
    here = drive(np.array([[0.5, 0.3], [0.2, -0.4]]), controller=linear)
    there = drive(np.array([[0.5, 0.3], [0.2, -0.4]]) @ R.T + shift, controller=linear, start=(*shift, angle))
    first = min(here.reached[0], there.reached[0])  # the square of tolerance does not turn with the course
    np.testing.assert_allclose(there.state[:first, :2], here.state[:first, :2] @ R.T + shift, atol=1e-9)
    np.testing.assert_allclose(there.state[:first, 3:], here.state[:first, 3:], atol=1e-9)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_number_of_substeps_changes_no_step_count(controller: str) -> None:
    coarse = drive(PATHS["figure_12"], controller=CONTROLLERS[controller], substeps=1)
    assert coarse.reached == driven("figure_12", controller).reached


@pytest.mark.parametrize("name", [n for n in THETAS if n != "robulab_10"])
def test_every_robot_of_the_table_drives_the_short_course(name: str) -> None:
    assert drive(SHORT, theta=THETAS[name]).reached


@pytest.mark.parametrize("integrator", ["rk4", "euler"])
def test_without_disturbance_a_drive_is_18_to_21_and_nothing_else_to_the_last_bit(integrator: str) -> None:
    theta, settings = THETAS["pioneer_3dx"], CONTROLLERS["smooth"]
    run = drive(SHORT, integrator=integrator)
    states = [np.zeros(5)]
    for _ in run.t_ns[1:]:
        x, y, psi = states[-1][:3].tolist()
        asked = references(SHORT[0][0] - x, SHORT[0][1] - y, psi, settings)

        def rates(state: Array, asked: tuple[float, float] = asked) -> Array:
            _, _, psi, u, omega = state.tolist()
            return np.array([*velocities(psi, u, omega, a_m=0.2), *accelerations(u, omega, *asked, theta=theta)])

        states.append(over_period(rates, states[-1], period_s=1 / 30, substeps=4, integrator=integrator)[-1])
    np.testing.assert_array_equal(run.state, states)


def test_slip_moves_the_truth_and_the_same_seed_moves_it_the_same() -> None:
    first, clean = driven("figure_12", "smooth", "slippery", seed=1), driven("figure_12", "smooth")
    again = driven.__wrapped__("figure_12", "smooth", "slippery", seed=1)
    np.testing.assert_array_equal(first.state, again.state)
    np.testing.assert_array_equal(first.rim_rad, again.rim_rad)
    assert np.abs(first.rim_rad[:1000] - clean.rim_rad[:1000]).max() > 0.01


def test_longitudinal_slip_alone_shows_in_the_rims_and_not_in_the_path() -> None:
    rngs = dict(zip(SLIP_STREAMS, np.random.default_rng(2).spawn(3), strict=True))
    slipping = drive(SHORT, slip=replace(SLIPS["slippery"], angle_std_rad=0.0, skid_s=0.0), rngs=rngs)
    clean = drive(SHORT)
    np.testing.assert_array_equal(slipping.state, clean.state)
    assert np.abs(slipping.rim_rad - clean.rim_rad).max() > 0.01


def test_a_start_on_the_target_is_reached_at_once_and_settling_adds_its_frames() -> None:
    assert len(drive([(0, 0)]).t_ns) == 1
    assert len(drive([(0, 0)], settle_s=0.5).t_ns) == 16


def test_a_target_out_of_time_says_which_and_how_far() -> None:
    with pytest.raises(MotionError, match=r"target 2 at \(9, 0\) m was not entered.*away"):
        drive([(0.1, 0), (9, 0)], max_time_s=3.0)


def test_an_unstable_gain_is_refused_with_the_gain_that_would_do() -> None:
    with pytest.raises(MotionError, match=r"gain_per_s 10 at 10 Hz with euler.*below 9\.56"):
        drive(
            SHORT,
            theta=THETAS["pioneer_3dx_paper"],
            controller=CONTROLLERS["paper"],
            rate_hz=10.0,
            substeps=1,
            integrator="euler",
        )


def test_a_motion_that_runs_away_is_stopped() -> None:
    wild = Theta(0.5, 0.2, 0.0, 1.0, -50.0, 1.0)
    with pytest.raises(MotionError, match="diverged"):
        drive([(5, 5)], theta=wild, integrator="euler", substeps=1)


@pytest.mark.parametrize(
    ("targets", "options", "sentence"),
    [
        ([(0, float("nan"))], {}, "target 1 is"),
        ([], {}, "one or more targets"),
        ([(1, 2, 3)], {}, "two coordinates"),
        (SHORT, {"start": (0.0, 0.0, float("inf"))}, "start"),
        (SHORT, {"rate_hz": 0.0}, "rate_hz"),
        (SHORT, {"rate_hz": 1e6}, "10000 or less .got 1000000"),
        (SHORT, {"rate_hz": 0.1}, "no gain does; raise rate_hz or substeps"),
        (SHORT, {"substeps": 0}, "substeps"),
        (SHORT, {"substeps": 4.0}, "substeps: should be a whole number"),
        (SHORT, {"substeps": 2.5}, "substeps: should be a whole number"),
        (SHORT, {"tolerance_m": 0.0}, "tolerance_m"),
        (SHORT, {"max_time_s": float("nan")}, "max_time_s"),
        (SHORT, {"max_time_s": 1e12}, "max_time_s: should be 3600 or less .got 1000000000000"),
        (SHORT, {"settle_s": -1.0}, "settle_s"),
        (SHORT, {"integrator": "ode3"}, "no integrator named 'ode3'"),
    ],
)
def test_what_cannot_be_driven_is_refused(targets: object, options: dict[str, object], sentence: str) -> None:
    with pytest.raises((MotionError, SettingError), match=sentence):
        drive(targets, **options)


COURSE = ((0.5, 0.3), (0.2, -0.4))
WET = FloorPatch(surface="wet", center_m=(0.3, 0.1), size_m=(0.2, 0.4), yaw_deg=17)
# Rates whose sub-steps are whole nanoseconds, so that a stamp is the very instant of its state.
KINDS = {
    "clean": {"substeps": 4},
    "coarse": {"substeps": 1, "rate_hz": 10.0},
    "euler": {"substeps": 1, "integrator": "euler"},
    "ideal": {"substeps": 4, "theta": None},
    "limited": {"substeps": 4, "limits": AccelerationLimits(0.3, 1.745)},
    "disturbed": {"substeps": 4, "slip": SLIPS["slippery"], "delta": DELTAS["bumpy"], "floor": (WET,)},
}


@cache
def driven_driven(kind: str) -> Drive:
    rngs = dict(zip(DISTURBANCE_STREAMS, np.random.default_rng(3).spawn(6), strict=True))
    return drive(COURSE, **{"rate_hz": 25.0, "rngs": rngs, **KINDS[kind]})


def instants(run: Drive, step_ns: float, *, margin: float) -> Array:
    """One instant in every sub-step, away from both its ends by a share of it."""
    pieces = np.arange(len(run.encoder_t_ns) - 1)
    return (pieces + np.random.default_rng(1).uniform(margin, 1 - margin, len(pieces))) * step_ns


def slope(run: Drive, t_ns: Array, h_ns: float, what: str) -> Array:
    """Sixth-order central difference by time of a quantity in world axes, (K, 3)."""

    def world(shift: int) -> Array:
        now = run.motion.at(t_ns + shift * h_ns)
        if what == "position":
            return now.T_world_body[:, :3, 3]
        return np.einsum("nij,nj->ni", now.T_world_body[:, :3, :3], now.velocity_mps)

    weighted = sum(w * (world(i) - world(-i)) for i, w in ((1, 45.0), (2, -9.0), (3, 1.0)))
    return weighted / (60 * h_ns / 1e9)


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_and_acceleration_are_the_first_and_second_derivative_of_position(kind: str) -> None:
    run = driven_driven(kind)
    step_ns = float(run.encoder_t_ns[1])
    t_ns = instants(run, step_ns, margin=0.3)
    now = run.motion.at(t_ns)
    R = now.T_world_body[:, :3, :3]
    for what, claimed in (("position", now.velocity_mps), ("velocity", now.acceleration_mps2)):
        found = np.einsum("nji,nj->ni", R, slope(run, t_ns, step_ns / 10, what))
        np.testing.assert_allclose(found, claimed, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_the_turn_is_the_derivative_of_heading_and_its_rate_that_of_the_turn(kind: str) -> None:
    run = driven_driven(kind)
    knots = run.encoder_t_ns.astype(float)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    middle, half = (knots[1:] + knots[:-1])[:, None] / 2, np.diff(knots)[:, None] / 2
    now = run.motion.at((middle + half * nodes).ravel())
    ends = run.motion.at(np.stack([knots[:-1] + 1e-3, knots[1:] - 1e-3], -1).ravel())
    turned = now.angular_velocity_radps[:, 2].reshape(-1, 4) @ weights * half[:, 0] / 1e9
    sped_up = now.angular_acceleration_radps2[:, 2].reshape(-1, 4) @ weights * half[:, 0] / 1e9
    np.testing.assert_allclose(turned.reshape(-1, KINDS[kind]["substeps"]).sum(1), np.diff(run.state[:, 2]), atol=1e-11)
    np.testing.assert_allclose(sped_up, np.diff(ends.angular_velocity_radps[:, 2].reshape(-1, 2))[:, 0], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_pose_and_speeds_at_the_frames_are_those_of_the_states(kind: str) -> None:
    run = driven_driven(kind)
    now = run.motion.at(run.t_ns)
    np.testing.assert_allclose(now.T_world_body, axle_poses(*run.state[:, :3].T, a_m=0.2), atol=1e-12)
    speeds = np.stack([now.velocity_mps[:, 0], now.angular_velocity_radps[:, 2]], -1)
    np.testing.assert_allclose(speeds, run.state[:, 3:], atol=1e-11)
    assert not now.twist[:, 2:5].any()


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_never_jumps_and_acceleration_only_at_control_instants(kind: str) -> None:
    run = driven_driven(kind)
    knots = run.encoder_t_ns[1:].astype(float)
    before, after = run.motion.at(knots - 1e-3), run.motion.at(knots + 1e-3)
    np.testing.assert_allclose(after.twist, before.twist, atol=1e-9)
    inside = ~np.isin(knots, run.motion.breaks_ns)
    jump = np.abs(after.acceleration_mps2 - before.acceleration_mps2)
    if kind in ("clean", "disturbed"):
        assert jump[inside].max() < 1e-6
        assert jump[~inside].max() > 1e-3


@pytest.mark.parametrize("kind", ["clean", "disturbed"])
def test_between_two_states_acceleration_runs_evenly_and_does_not_ring(kind: str) -> None:
    run = driven_driven(kind)
    knots, share = run.encoder_t_ns.astype(float), np.array([1e-9, 0.25, 0.5, 0.75, 1 - 1e-9])
    now = run.motion.at((knots[:-1, None] + share * np.diff(knots)[:, None]).ravel())
    world = np.einsum("nij,nj->ni", now.T_world_body[:, :3, :3], now.acceleration_mps2)
    rates = np.column_stack([world[:, :2], now.angular_acceleration_radps2[:, 2]]).reshape(-1, 5, 3)
    line = rates[:, :1] + share[:, None] * (rates[:, -1:] - rates[:, :1])
    assert (np.abs(rates - line).max((0, 1)) < 0.004 * np.abs(rates).max((0, 1))).all()


def test_with_fine_steps_it_is_the_solution_of_18_and_19_at_any_instant() -> None:
    run, theta = drive(COURSE, rate_hz=25.0, substeps=16), THETAS["pioneer_3dx"]
    for frame in (0, 5, 40, 60):
        u_ref, omega_ref = run.references[frame]

        def rates(_: float, s: Array, u_ref: float = u_ref, omega_ref: float = omega_ref) -> Array:
            moved = velocities(*s[2:].tolist(), a_m=0.2)
            return np.array([*moved, *accelerations(*s[3:].tolist(), u_ref, omega_ref, theta=theta)])

        t_s = np.linspace(0.0011, 0.0389, 7)
        state = solve_ivp(rates, (0, 0.04), run.state[frame], "DOP853", t_s, rtol=1e-13, atol=1e-14).y
        now = run.motion.at((frame * 0.04 + t_s) * 1e9)
        np.testing.assert_allclose(now.T_world_body, axle_poses(*state[:3], a_m=0.2), atol=1e-12)
        u_rate, omega_rate = accelerations(state[3], state[4], u_ref, omega_ref, theta=theta)
        np.testing.assert_allclose(now.velocity_mps[:, :2], np.stack([state[3], 0 * state[3]], -1), atol=1e-9)
        np.testing.assert_allclose(now.acceleration_mps2[:, :2], np.stack([u_rate, state[3] * state[4]], -1), atol=1e-6)
        np.testing.assert_allclose(now.angular_acceleration_radps2[:, 2], omega_rate, atol=1e-6)


def test_the_slide_of_a_side_slipping_robot_is_in_its_velocity_and_its_acceleration() -> None:
    run = driven_driven("disturbed")
    side = run.state[:, 3] * np.tan(run.slip[:, 2]) - SLIPS["slippery"].skid_s * run.state[:, 3] * run.state[:, 4]
    np.testing.assert_allclose(run.motion.at(run.t_ns).velocity_mps[:, 1], side, atol=1e-10)
    assert np.abs(side).max() > 0.01


def test_before_its_start_the_robot_rests_and_after_its_end_it_goes_on_with_its_last_references() -> None:
    run = drive(COURSE[:1], rate_hz=25.0)
    longer = drive(COURSE[:1], rate_hz=25.0, settle_s=0.04)
    before, after = run.motion.at(np.array([-5e8, -1.0])), run.motion.at(run.t_ns[-1:] + 40_000_000)
    np.testing.assert_array_equal(before.T_world_body, run.motion.at(np.zeros(2)).T_world_body)
    assert not before.twist.any()
    assert not before.acceleration_mps2.any()
    np.testing.assert_allclose(after.T_world_body, longer.motion.at(longer.t_ns[-1:]).T_world_body, atol=1e-12)
    late = run.motion.at(run.t_ns[-1:] + np.arange(80_000_000, 960_000_000, 40_000_000))
    speeds = late.velocity_mps[:, 0], late.angular_velocity_radps[:, 2]
    u_rate, omega_rate = accelerations(*speeds, *run.references[-1].tolist(), theta=THETAS["pioneer_3dx"])
    np.testing.assert_allclose(late.acceleration_mps2[:, 0], u_rate, atol=1e-9)
    np.testing.assert_allclose(late.angular_acceleration_radps2[:, 2], omega_rate, atol=1e-9)
    assert (run.motion.start_ns, run.motion.end_ns) == (0, run.t_ns[-1])


def test_a_robot_that_starts_on_its_target_has_a_motion_that_stands_still() -> None:
    still = drive([(0, 0)]).motion.at(np.array([0, 10_000_000, 900_000_000]))
    assert not still.twist.any()
    assert not still.acceleration_mps2.any()


def test_the_last_instant_that_the_drive_knows_is_the_limit_of_those_before() -> None:
    motion = driven_driven("clean").motion
    last_ns = float(motion.breaks_ns[-1])
    before, last = motion.at(np.array([last_ns - 1.0])), motion.at(np.array([last_ns]))
    np.testing.assert_allclose(last.T_world_body, before.T_world_body, atol=1e-8)
    np.testing.assert_allclose(last.twist, before.twist, atol=1e-8)


@pytest.mark.parametrize("late_ns", [float("nan"), 1e12])
def test_an_instant_that_the_drive_does_not_know_is_refused(late_ns: float) -> None:
    motion = driven_driven("clean").motion
    last_ns = motion.breaks_ns[-1] + 1
    motion.at(np.array([last_ns]))
    with pytest.raises(MotionError, match=rf"ends at \d+ ns, but its position at {late_ns:.0f} ns is needed"):
        motion.at(np.array([last_ns, late_ns]))


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_integrated_acceleration_closes_although_it_jumps_at_every_control_instant(controller: str) -> None:
    run = drive(COURSE, controller=CONTROLLERS[controller])
    knots = run.motion.breaks_ns[: len(run.t_ns)]
    nodes, weights = np.polynomial.legendre.leggauss(8)
    middle, half = (knots[1:] + knots[:-1])[:, None] / 2, np.diff(knots)[:, None] / 2
    now = run.motion.at((middle + half * nodes).ravel())
    world = np.einsum("nij,nj->ni", now.T_world_body[:, :3, :3], now.acceleration_mps2)
    gained = (world.reshape(-1, 8, 3).transpose(0, 2, 1) @ weights * half / 1e9).sum(0)
    end = run.motion.at(knots[-1:])
    np.testing.assert_allclose(gained, end.T_world_body[0, :3, :3] @ end.velocity_mps[0], atol=1e-8)


def test_the_disturbance_of_each_frame_is_the_one_drawn_for_it() -> None:
    def generators() -> dict[str, np.random.Generator]:
        return {stream: np.random.default_rng(k) for k, stream in enumerate(DISTURBANCE_STREAMS)}

    slip = SLIPS["slippery"]
    delta = DELTAS["bumpy"]
    run = drive([(0.5, 0.0)], slip=slip, delta=delta, rngs=generators())
    rows = random_disturbances(len(run.slip), slip, delta, (), step_s=1 / 30, rngs=generators()).rows

    np.testing.assert_array_equal(run.slip, rows[:, :3])
    np.testing.assert_array_equal(run.delta, rows[:, 3:])
