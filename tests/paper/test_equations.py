"""One test for each claim of the paper that the robot model rests on, by equation or figure."""

from dataclasses import astuple, replace

import numpy as np
import pytest

from vobench.geometry.rig import LENSES, PIONEER_WHEELS
from vobench.geometry.se3 import Array
from vobench.robot.controller import CONTROLLERS, ControllerSettings, references
from vobench.robot.drive import Drive, drive
from vobench.robot.integrate import over_period
from vobench.robot.pioneer import THETAS, Theta, accelerations, velocities, wheel_speeds
from vobench.robot.slip import SlipNow
from vobench.robot.vehicle import Vehicle

AS_PRINTED = THETAS["pioneer_3dx_paper"]
PAPER = CONTROLLERS["paper"]
FIGURE_10 = ((1, 1), (0, 1), (1, 0), (2, 2))
FIGURE_12 = ((0, 1), (1, 1), (2, 2))
STEP_33_MS = 1000 / 33


def held(u_ref: float, omega_ref: float, *, seconds: float, theta: Theta = AS_PRINTED) -> Array:
    """State x, y, psi, u, omega of (18)-(19) from rest under constant references."""

    def rates(state: Array) -> Array:
        _, _, psi, u, omega = state.tolist()
        return np.array([*velocities(psi, u, omega, a_m=0.2), *accelerations(u, omega, u_ref, omega_ref, theta=theta)])

    return over_period(rates, np.zeros(5), period_s=seconds, substeps=round(200 * seconds))[-1]


def minima_about(run_xy: Array, target: tuple[float, float]) -> Array:
    """Smallest distance to the target on each axis by itself, as figure 11 draws it."""
    return np.abs(run_xy - target).min(0)


def figure_10_at_30_hz(theta: Theta) -> Drive:
    return drive(FIGURE_10, theta=theta, controller=PAPER)


def figure_10_by_the_clock(theta: Theta) -> Array:
    """h (N, 2) at 10 Hz, with a new target every 3 s whether or not the last was reached."""
    vehicle = Vehicle(theta, PAPER, PIONEER_WHEELS, rate_hz=10.0, substeps=4, integrator="rk4")
    states = [np.zeros(7)]
    for target in np.repeat(np.array(FIGURE_10, float), 30, axis=0):
        reference = vehicle.references(states[-1], target)
        states.append(vehicle.advance(states[-1], reference, SlipNow())[-1])
    return np.array(states)[:, :2]


def test_equations_9_and_10_wheel_speeds_give_speed_and_yaw_rate_back() -> None:
    for u, omega in np.random.default_rng(0).uniform(-1, 1, (20, 2)).tolist():
        left, right = wheel_speeds(u, omega, track_m=0.331)
        assert ((right + left) / 2, (right - left) / 0.331) == (pytest.approx(u), pytest.approx(omega))


def test_equation_18_in_the_papers_matrix_form() -> None:
    t1, t2, t3, t4, t5, t6 = astuple(AS_PRINTED)
    for u, omega, u_ref, omega_ref in np.random.default_rng(1).uniform(-1, 1, (20, 4)).tolist():
        matrix = np.array([[-t4 / t1, t3 / t1 * omega], [-t5 / t2 * omega, -t6 / t2]])
        expected = matrix @ [u, omega] + np.diag([1 / t1, 1 / t2]) @ [u_ref, omega_ref]
        np.testing.assert_allclose(accelerations(u, omega, u_ref, omega_ref, theta=AS_PRINTED), expected, atol=1e-14)


def test_equation_18_on_a_straight_line_is_a_first_order_lag() -> None:
    x, y, psi, u, omega = held(0.5, 0.0, seconds=1.0)
    final, lag = 0.5 / AS_PRINTED.t4, AS_PRINTED.t1 / AS_PRINTED.t4
    assert u == pytest.approx(final * -np.expm1(-1 / lag), abs=1e-11)
    assert x == pytest.approx(final * (1 + lag * np.expm1(-1 / lag)), abs=1e-11)
    assert (x, u) == (pytest.approx(0.279691483417, abs=1e-11), pytest.approx(0.435771715724, abs=1e-11))
    assert (y, psi, omega) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("theta", [AS_PRINTED, THETAS["pioneer_3dx"]], ids=["as printed", "mended"])
@pytest.mark.parametrize(
    ("asked", "settled"),
    [
        ((0.75, 1.745), (0.741536178556, 1.751149160017)),
        ((0.5, 0.5), (0.519612492557, 0.492515407421)),
        ((0.0, 1.0), (-0.012473632767, 0.943350369582)),
    ],
)
def test_equation_18_settles_in_a_turn_where_speed_and_turn_depend_on_each_other(
    theta: Theta, asked: tuple[float, float], settled: tuple[float, float]
) -> None:
    u, omega = held(*asked, seconds=12.0, theta=theta)[3:]
    assert theta.t4 * u == pytest.approx(asked[0] + theta.t3 * omega**2, abs=1e-9)
    assert (theta.t6 + theta.t5 * u) * omega == pytest.approx(asked[1], abs=1e-9)
    assert (u, omega) == (pytest.approx(settled[0], abs=1e-9), pytest.approx(settled[1], abs=1e-9))


def test_equation_19_in_the_papers_matrix_form() -> None:
    psi, a, u, omega = 0.8, 0.2, 0.5, -0.7
    matrix = np.array([[np.cos(psi), -a * np.sin(psi)], [np.sin(psi), a * np.cos(psi)], [0, 1]])
    np.testing.assert_allclose(velocities(psi, u, omega, a_m=a), matrix @ [u, omega], atol=1e-15)


def test_equations_20_and_21_invert_19_so_h_moves_straight_as_the_tanh_terms_say() -> None:
    free = ControllerSettings(10.0, 10.0)
    for x, y, psi in np.random.default_rng(2).uniform(-3, 3, (20, 3)).tolist():
        moved = velocities(psi, *references(x, y, psi, free), a_m=free.a_m)[:2]
        np.testing.assert_allclose(moved, [10 * np.tanh(x), 10 * np.tanh(y)], atol=1e-12)


def test_equation_20_needs_the_error_target_minus_position_the_other_sign_drives_away() -> None:
    def distance_after_a_second(sign: float) -> float:
        vehicle = Vehicle(AS_PRINTED, PAPER, PIONEER_WHEELS, rate_hz=30.0, substeps=4, integrator="rk4")
        state = np.zeros(7)
        for _ in range(30):
            error_x, error_y = sign * (1.0 - state[0]), sign * (0.5 - state[1])
            state = vehicle.advance(state, references(error_x, error_y, state[2], PAPER), SlipNow())[-1]
        return float(np.hypot(1.0 - state[0], 0.5 - state[1]))

    start = np.hypot(1.0, 0.5)
    assert distance_after_a_second(1.0) < 0.8 * start < 1.2 * start < distance_after_a_second(-1.0)


@pytest.mark.parametrize(("name", "overshoot"), [("paper", 0.515), ("smooth", 0.034)])
def test_gains_of_10_overshoot_by_half_and_gains_of_point_8_hardly(name: str, overshoot: float) -> None:
    settings = replace(CONTROLLERS[name], axis_speed_mps=10.0)
    damping = AS_PRINTED.t4 / (2 * np.sqrt(settings.gain_per_s * AS_PRINTED.t1))
    assert np.exp(-np.pi * damping / np.sqrt(1 - damping**2)) == pytest.approx(overshoot, abs=1e-3)
    run = drive(
        [(0, 0)], theta=AS_PRINTED, controller=settings, start=(-0.05, 0, 0), rate_hz=1000, substeps=1, settle_s=4
    )
    assert run.state[:, 0].max() / 0.05 == pytest.approx(overshoot, abs=0.01)


def test_the_printed_theta_mixes_the_robot_with_and_without_its_laser() -> None:
    printed, bare, laser = THETAS["pioneer_3dx_paper"], THETAS["pioneer_3dx"], THETAS["pioneer_3dx_laser"]
    assert astuple(printed) == (0.5338, 0.2509, -0.0134, 0.9560, -0.0843, 1.0590)
    assert replace(printed, t2=bare.t2) == bare
    assert printed.t2 == laser.t2 != bare.t2


def test_equations_14_to_17_tie_four_parameters_to_the_track_and_the_printed_theta_breaks_the_tie() -> None:
    def tie(t3: float, t4: float, t5: float, t6: float) -> float:
        return (t4 - 1) * t5 / ((t6 - 1) * t3)

    d = 0.331
    for ra_ka, m, b, r, friction, kpt, kpr in np.random.default_rng(3).uniform(0.1, 2.0, (20, 7)).tolist():
        t3, t5 = ra_ka * m * b * r / (2 * kpt), ra_ka * m * b * r / (d * kpr)
        t4, t6 = ra_ka * friction / (r * kpt) + 1, ra_ka * friction * d / (2 * r * kpr) + 1
        assert tie(t3, t4, t5, t6) == pytest.approx(4 / d**2)
    # The printed set is a least-squares fit: its theta_4 is below 1, which no friction and no motor can give.
    assert tie(*astuple(AS_PRINTED)[2:]) == pytest.approx(-4.69, abs=0.005)


@pytest.mark.parametrize("path", [FIGURE_10, FIGURE_12], ids=["figure 10", "figure 12"])
@pytest.mark.parametrize("integrator", ["euler", "rk4"])
@pytest.mark.parametrize("name", CONTROLLERS)
def test_figures_10_and_12_every_target_is_entered_within_1_cm_on_both_axes_in_order(
    path: tuple[tuple[int, int], ...], integrator: str, name: str
) -> None:
    substeps = 1 if integrator == "euler" else 4
    run = drive(path, theta=AS_PRINTED, controller=CONTROLLERS[name], integrator=integrator, substeps=substeps)
    assert list(run.reached) == sorted(set(run.reached))
    assert np.abs(run.state[list(run.reached), :2] - path).max() < 0.01


@pytest.mark.parametrize(
    ("name", "steps", "fastest"),
    [
        ("paper", (75, 114, 94, 154), (0.78, 1.67)),
        ("smooth", (117, 133, 147, 173), (0.61, 1.64)),
        ("easy", (276, 289, 316, 364), (0.43, 0.95)),
    ],
)
def test_figure_10_takes_these_steps_of_33_ms(name: str, steps: tuple[int, ...], fastest: tuple[float, float]) -> None:
    run = drive(FIGURE_10, theta=AS_PRINTED, controller=CONTROLLERS[name], rate_hz=STEP_33_MS)
    assert run.steps_per_leg == steps
    np.testing.assert_allclose(np.abs(run.state[:, 3:]).max(0), fastest, atol=0.006)


@pytest.mark.parametrize("theta", [AS_PRINTED, THETAS["pioneer_3dx"]], ids=["as printed", "mended"])
def test_figure_11_the_33_ms_run_passes_0_1_nearer_in_x_than_the_clocked_100_ms_run(theta: Theta) -> None:
    run = figure_10_at_30_hz(theta)
    first, second = run.reached[:2]
    fine = minima_about(run.state[first : second + 1, :2], (0, 1))
    coarse = minima_about(figure_10_by_the_clock(theta)[30:61], (0, 1))
    assert (fine < 1e-2).all()
    assert fine[0] < coarse[0]


def test_without_limits_gains_of_10_turn_the_robot_faster_than_any_camera_follows() -> None:
    run = drive(FIGURE_10, theta=AS_PRINTED, controller=ControllerSettings(10.0, 10.0), rate_hz=STEP_33_MS)
    turn_per_frame_deg = np.degrees(np.abs(np.diff(run.state[:, 2])).max())
    assert turn_per_frame_deg > 30
    assert np.degrees(np.abs(np.diff(figure_10_at_30_hz(AS_PRINTED).state[:, 2])).max()) < 3.5


def test_the_papers_32_mm_lens_has_pixels_that_are_not_square_unless_blender_fits_the_width() -> None:
    literal, blender = LENSES["paper_literal"], LENSES["paper_blender"]
    assert (literal.fx_px, literal.fy_px) == (pytest.approx(658.3, abs=0.05), pytest.approx(545.1, abs=0.05))
    assert blender.fx_px == blender.fy_px == literal.fx_px
