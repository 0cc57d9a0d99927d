"""Figures 10, 11 and 12: two paths through targets, and how near (0, 1) is passed by two ways to stop."""

from dataclasses import astuple, replace
from functools import cache

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS, ControllerSettings
from vobench.motion.drive import Drive, drive
from vobench.motion.pioneer import THETAS, Theta, velocities

AS_PRINTED = THETAS["pioneer_3dx_paper"]
PAPER = CONTROLLERS["paper"]
FIGURE_10 = ((0, 0), (1, 1), (0, 1), (1, 0), (2, 2))
FIGURE_12 = ((0, 0), (0, 1), (1, 1), (2, 2))
BOTH_THETAS = pytest.mark.parametrize("theta", [AS_PRINTED, THETAS["pioneer_3dx"]], ids=["as printed", "mended"])


def to_the_second_target(run: Drive) -> Array:
    """Distance of h from (0, 1) on each axis at the frames of that leg, (N, 2)."""
    start, end = run.reached[1:3]
    return np.abs(run.state[start : end + 1, :2] - (0, 1))


@cache
def fine(theta: Theta = AS_PRINTED, controller: ControllerSettings = PAPER) -> Array:
    """Smallest distances (2,) at 30 Hz, stopped by the tolerance of 1 cm."""
    return to_the_second_target(drive(FIGURE_10[:3], theta=theta, controller=controller)).min(0)


@cache
def coarse(theta: Theta = AS_PRINTED, controller: ControllerSettings = PAPER, leg_s: float = 3.0) -> Array:
    """Smallest distances (2,) with steps of 0.1 s, each target held for its time; 3 s of rest at the first."""
    run = drive(FIGURE_10[:3], theta=theta, controller=controller, rate_hz=10.0, leg_s=leg_s)
    return to_the_second_target(run).min(0)


@pytest.mark.parametrize("path", [FIGURE_10, FIGURE_12], ids=["figure 10", "figure 12"])
@pytest.mark.parametrize(
    ("name", "integrator", "theta"),
    [
        ("paper", "euler", AS_PRINTED),
        ("paper", "rk4", THETAS["pioneer_3dx"]),
        ("smooth", "rk4", AS_PRINTED),
        ("easy", "euler", THETAS["pioneer_3dx"]),
    ],
    ids=["the paper's", "mended", "smooth", "easy"],
)
def test_figures_10_and_12_every_target_is_entered_within_1_cm_on_both_axes_in_order(
    path: tuple[tuple[int, int], ...], name: str, integrator: str, theta: Theta
) -> None:
    substeps = 1 if integrator == "euler" else 4
    run = drive(path, theta=theta, controller=CONTROLLERS[name], integrator=integrator, substeps=substeps)
    assert len(run.reached) == len(path)
    assert list(run.reached) == sorted(set(run.reached))
    assert np.abs(run.state[list(run.reached), :2] - path).max() < 0.01


@pytest.mark.parametrize("name", CONTROLLERS)
def test_figure_10_begins_at_its_first_target_and_may_begin_elsewhere(name: str) -> None:
    assert drive(FIGURE_10[:1], theta=AS_PRINTED, controller=CONTROLLERS[name]).reached[0] == 0
    run = drive(FIGURE_10[:2], theta=AS_PRINTED, controller=CONTROLLERS[name], start=(-0.4, 0.3, 2.0))
    assert run.reached[0] > 0
    assert np.abs(run.state[list(run.reached), :2] - FIGURE_10[:2]).max() < 0.01


@pytest.mark.parametrize(
    ("name", "steps", "fastest"),
    [
        ("paper", (0, 75, 114, 94, 154), (0.78, 1.67)),
        ("smooth", (0, 117, 133, 147, 173), (0.61, 1.64)),
        ("easy", (0, 276, 289, 316, 364), (0.43, 0.95)),
    ],
)
def test_figure_10_takes_these_steps_of_33_ms(name: str, steps: tuple[int, ...], fastest: tuple[float, float]) -> None:
    run = drive(FIGURE_10, theta=AS_PRINTED, controller=CONTROLLERS[name], rate_hz=1000 / 33)
    assert tuple(np.diff(run.reached, prepend=0)) == steps
    np.testing.assert_allclose(np.abs(run.state[:, 3:]).max(0), fastest, atol=0.006)


def test_figure_10_goes_on_from_each_target_with_the_speed_it_came_with() -> None:
    """As in the paper's script, whose next start is the last position: nothing is set to the target."""
    run = drive(FIGURE_10, theta=AS_PRINTED, controller=PAPER)
    rate = np.array([velocities(*now, a_m=PAPER.a_m) for now in run.state[:, 2:].tolist()])
    for frame, target in zip(run.reached[1:-1], FIGURE_10[1:-1], strict=True):
        moved = run.state[frame + 1, :3] - run.state[frame, :3]
        np.testing.assert_allclose(moved, (rate[frame] + rate[frame + 1]) / 2 / 30, rtol=0, atol=5e-4)
        assert np.hypot(*rate[frame, :2]) > 0.1
        assert np.hypot(*(run.state[frame, :2] - target)) > 1e-3


@BOTH_THETAS
def test_figure_11_the_30_hz_run_passes_0_1_nearer_in_x_than_the_clocked_100_ms_run(theta: Theta) -> None:
    assert fine(theta)[0] < coarse(theta)[0]


def test_figure_11_by_tolerance_both_minima_are_below_1_cm_because_the_leg_ends_no_sooner() -> None:
    for controller in CONTROLLERS.values():
        assert (fine(AS_PRINTED, controller) < 0.01).all()


def test_figure_11_by_the_clock_a_leg_too_short_misses_by_decimetres_and_a_long_one_by_millimetres() -> None:
    assert coarse(leg_s=2.5)[0] > 0.1
    assert (coarse(leg_s=6.0) < 0.003).all()


def test_figure_11_its_digits_are_not_the_robots_one_per_cent_on_any_number_moves_them_tenfold() -> None:
    def nearly(rng: np.random.Generator) -> tuple[Theta, ControllerSettings]:
        theta = Theta(*(np.array(astuple(AS_PRINTED)) * (1 + rng.uniform(-0.01, 0.01, 6))).tolist())
        return theta, replace(PAPER, gain_per_s=PAPER.gain_per_s * (1 + rng.uniform(-0.01, 0.01)))

    x_m = [fine(*nearly(rng))[0] for rng in np.random.default_rng(0).spawn(15)]
    assert max(x_m) > 10 * min(x_m)
