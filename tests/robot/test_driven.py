"""The motion of a drive meets every state that was recorded, and is its own derivative twice over."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.robot.controller import CONTROLLERS
from vobench.robot.disturbance import DELTAS, STREAMS
from vobench.robot.drive import Drive, drive
from vobench.robot.floor import SURFACES, FloorPatch
from vobench.robot.limits import TOOLBOX
from vobench.robot.pioneer import THETAS, accelerations, axle_poses, velocities
from vobench.robot.slip import SLIPS

COURSE = ((0.5, 0.3), (0.2, -0.4))
WET = FloorPatch(SURFACES["wet"], (0.3, 0.1), (0.2, 0.4), 0.3)
# Rates whose sub-steps are whole nanoseconds, so that a stamp is the very instant of its state.
KINDS = {
    "clean": {"substeps": 4},
    "coarse": {"substeps": 1, "rate_hz": 10.0},
    "euler": {"substeps": 1, "integrator": "euler"},
    "ideal": {"substeps": 4, "theta": None},
    "limited": {"substeps": 4, "limits": TOOLBOX},
    "disturbed": {"substeps": 4, "slip": SLIPS["slippery"], "delta": DELTAS["bumpy"], "floor": (WET,)},
}


@cache
def driven(kind: str) -> Drive:
    rngs = dict(zip(STREAMS, np.random.default_rng(3).spawn(6), strict=True))
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
    run = driven(kind)
    step_ns = float(run.encoder_t_ns[1])
    t_ns = instants(run, step_ns, margin=0.3)
    now = run.motion.at(t_ns)
    R = now.T_world_body[:, :3, :3]
    for what, claimed in (("position", now.velocity_mps), ("velocity", now.acceleration_mps2)):
        found = np.einsum("nji,nj->ni", R, slope(run, t_ns, step_ns / 10, what))
        np.testing.assert_allclose(found, claimed, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_the_turn_is_the_derivative_of_heading_and_its_rate_that_of_the_turn(kind: str) -> None:
    run = driven(kind)
    knots = run.encoder_t_ns.astype(float)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    middle, half = (knots[1:] + knots[:-1])[:, None] / 2, np.diff(knots)[:, None] / 2
    now = run.motion.at((middle + half * nodes).ravel())
    ends = run.motion.at(np.stack([knots[:-1] + 1e-3, knots[1:] - 1e-3], -1).ravel())
    turned = now.turn_radps[:, 2].reshape(-1, 4) @ weights * half[:, 0] / 1e9
    sped_up = now.turn_rate_radps2[:, 2].reshape(-1, 4) @ weights * half[:, 0] / 1e9
    np.testing.assert_allclose(turned.reshape(-1, KINDS[kind]["substeps"]).sum(1), np.diff(run.state[:, 2]), atol=1e-11)
    np.testing.assert_allclose(sped_up, np.diff(ends.turn_radps[:, 2].reshape(-1, 2))[:, 0], atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_pose_and_speeds_at_the_frames_are_those_of_the_states(kind: str) -> None:
    run = driven(kind)
    now = run.motion.at(run.t_ns)
    np.testing.assert_allclose(now.T_world_body, axle_poses(*run.state[:, :3].T, a_m=0.2), atol=1e-12)
    speeds = np.stack([now.velocity_mps[:, 0], now.turn_radps[:, 2]], -1)
    np.testing.assert_allclose(speeds, run.state[:, 3:], atol=1e-11)
    assert not now.twist[:, 2:5].any()


@pytest.mark.parametrize("kind", KINDS)
def test_velocity_never_jumps_and_acceleration_only_at_control_instants(kind: str) -> None:
    run = driven(kind)
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
    run = driven(kind)
    knots, share = run.encoder_t_ns.astype(float), np.array([1e-9, 0.25, 0.5, 0.75, 1 - 1e-9])
    now = run.motion.at((knots[:-1, None] + share * np.diff(knots)[:, None]).ravel())
    world = np.einsum("nij,nj->ni", now.T_world_body[:, :3, :3], now.acceleration_mps2)
    rates = np.column_stack([world[:, :2], now.turn_rate_radps2[:, 2]]).reshape(-1, 5, 3)
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
        np.testing.assert_allclose(now.turn_rate_radps2[:, 2], omega_rate, atol=1e-6)


def test_the_slide_of_a_side_slipping_robot_is_in_its_velocity_and_its_acceleration() -> None:
    run = driven("disturbed")
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
    speeds = late.velocity_mps[:, 0], late.turn_radps[:, 2]
    u_rate, omega_rate = accelerations(*speeds, *run.references[-1].tolist(), theta=THETAS["pioneer_3dx"])
    np.testing.assert_allclose(late.acceleration_mps2[:, 0], u_rate, atol=1e-9)
    np.testing.assert_allclose(late.turn_rate_radps2[:, 2], omega_rate, atol=1e-9)
    assert (run.motion.start_ns, run.motion.end_ns) == (0, run.t_ns[-1])


def test_a_robot_that_starts_on_its_target_has_a_motion_that_stands_still() -> None:
    still = drive([(0, 0)]).motion.at(np.array([0, 10_000_000, 900_000_000]))
    assert not still.twist.any()
    assert not still.acceleration_mps2.any()


@pytest.mark.parametrize("late_ns", [float("nan"), 1e12])
def test_an_instant_that_the_drive_does_not_know_is_refused(late_ns: float) -> None:
    with pytest.raises(MotionError, match=r"ends at \d+ ns, and is asked"):
        driven("clean").motion.at(np.array([0.0, late_ns]))


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
