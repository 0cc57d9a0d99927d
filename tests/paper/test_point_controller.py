"""Equations (20)-(21): the point controller, the sign of its error, and what gains of 10 do."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.motion.controller import CONTROLLERS, ControllerSettings, references
from vobench.motion.drive import drive
from vobench.motion.pioneer import THETAS, accelerations, over_period, velocities

AS_PRINTED = THETAS["pioneer_3dx_paper"]
PAPER = CONTROLLERS["paper"]
WITHOUT_LIMITS = ControllerSettings(10.0, 10.0)
NOWS = np.random.default_rng(2).uniform(-3, 3, (20, 3)).tolist()


def test_equations_20_and_21_as_they_are_printed_but_for_the_name_of_the_second() -> None:
    k = l = 10.0  # noqa: E741 - the paper's letter
    for error_x, error_y, psi in NOWS:
        u_ref = np.tanh(error_y * k / l) * l * np.sin(psi) + np.tanh(error_x * k / l) * l * np.cos(psi)
        turn = np.tanh(error_y * k / l) * l * np.cos(psi) - np.tanh(error_x * k / l) * l * np.sin(psi)
        expected = (pytest.approx(u_ref), pytest.approx(turn / WITHOUT_LIMITS.a_m))
        assert references(error_x, error_y, psi, WITHOUT_LIMITS) == expected


def test_equations_20_and_21_invert_19_so_the_second_is_a_yaw_rate_and_h_moves_as_the_tanh_terms_say() -> None:
    for x, y, psi in NOWS:
        moved = velocities(psi, *references(x, y, psi, WITHOUT_LIMITS), a_m=WITHOUT_LIMITS.a_m)[:2]
        np.testing.assert_allclose(moved, [10 * np.tanh(x), 10 * np.tanh(y)], atol=1e-12)


def distance_after_a_second(sign: float) -> float:
    """How far h is from (1, 0.5) that it started to from the origin, with an error of this sign."""

    def moved(state: np.ndarray) -> np.ndarray:
        x, y, psi, u, omega = state.tolist()
        asked = references(sign * (1.0 - x), sign * (0.5 - y), psi, PAPER)
        return np.array([*velocities(psi, u, omega, a_m=PAPER.a_m), *accelerations(u, omega, *asked, theta=AS_PRINTED)])

    x, y = over_period(moved, np.zeros(5), period_s=1.0, substeps=200)[-1, :2]
    return float(np.hypot(1.0 - x, 0.5 - y))


def test_equation_20_needs_the_error_target_minus_position_the_other_sign_drives_away() -> None:
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


def test_gains_of_10_at_a_tenth_of_a_second_need_a_better_integrator_than_euler() -> None:
    with pytest.raises(MotionError, match=r"gain_per_s 10 at 10 Hz with euler"):
        drive([(1, 1)], theta=AS_PRINTED, controller=PAPER, rate_hz=10.0, substeps=1, integrator="euler")
    assert drive([(1, 1)], theta=AS_PRINTED, controller=PAPER, rate_hz=10.0).reached


def test_without_the_papers_max_velocities_gains_of_10_turn_faster_than_any_camera_follows() -> None:
    path = [(0, 0), (1, 1), (0, 1), (1, 0), (2, 2)]

    def turn_per_frame_deg(controller: ControllerSettings) -> float:
        run = drive(path, theta=AS_PRINTED, controller=controller, rate_hz=1000 / 33)
        return float(np.degrees(np.abs(np.diff(run.state[:, 2])).max()))

    assert turn_per_frame_deg(PAPER) < 3.5
    assert turn_per_frame_deg(WITHOUT_LIMITS) > 30
