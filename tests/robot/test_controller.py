"""The point controller of (20)-(21), its limits, and where its loop is stable."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.robot.controller import CONTROLLERS, ControllerSettings, loop_growth, references, settling_gain
from vobench.robot.pioneer import THETAS, Theta, velocities

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
    limit = settling_gain(100.0, theta, **cut)
    assert loop_growth(0.999 * limit, theta, **cut) < 1 < loop_growth(1.001 * limit, theta, **cut)


def test_the_ideal_unicycle_settles_below_two_over_the_period() -> None:
    assert settling_gain(100.0, None, period_s=0.1, substeps=1, integrator="rk4") == pytest.approx(20.0)


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
