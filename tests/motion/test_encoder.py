"""Encoder counts, and what an odometer makes of them."""

from functools import cache

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import PIONEER_WHEELS, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS
from vobench.motion.drive import Drive, drive
from vobench.motion.encoder import ENCODERS, EncoderErrors, ticks, true_rims
from vobench.motion.slip import SLIP_STREAMS, SLIPS

FIGURE_12 = ((0, 1), (1, 1), (2, 2))
ROUND = ((0, 2), (2, 0), (-1, 1), (1, -1), (0, 0), (0, 1), (1, 1), (2, 2), (0, 2), (2, 0), (-1, 1), (1, -1))
COARSE = WheelGeometry(radius_m=0.1, track_m=0.3, ticks_per_revolution=4)


@cache
def driven(controller: str, slip: str, seed: int = 0) -> Drive:
    rngs = dict(zip(SLIP_STREAMS, np.random.default_rng(seed).spawn(3), strict=True))
    return drive(FIGURE_12, controller=CONTROLLERS[controller], slip=SLIPS[slip], rngs=rngs)


def dead_reckoned(counts: Array, wheels: WheelGeometry) -> Array:
    """x, y, psi (M, 3) from counts: each interval an arc of constant curvature, by its chord."""
    left, right = np.diff(counts, axis=0).T * (2 * np.pi * wheels.radius_m / wheels.ticks_per_revolution)
    turn = (right - left) / wheels.track_m
    psi = np.concatenate([[0.0], np.cumsum(turn)])
    chord, middle = (left + right) / 2 * np.sinc(turn / (2 * np.pi)), psi[:-1] + turn / 2
    path = np.cumsum(chord[:, None] * np.stack([np.cos(middle), np.sin(middle)], -1), 0)
    return np.column_stack([np.concatenate([[[0.0, 0.0]], path]), psi])


def worst_position_error(run: Drive, errors: EncoderErrors) -> float:
    """In metres, over all frames, seen from the first pose."""
    estimate = dead_reckoned(ticks(run.rim_rad, PIONEER_WHEELS, errors), PIONEER_WHEELS)[::4]
    T_world_body = run.motion.at(run.t_ns).T_world_body
    truth = (se3.inverse(T_world_body[0]) @ T_world_body)[:, :2, 3]
    return float(np.linalg.norm(estimate[:, :2] - truth, axis=1).max())


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_counts_without_noise_give_the_path_back_to_less_than_a_millimetre(controller: str) -> None:
    assert worst_position_error(driven(controller, "none"), ENCODERS["exact"]) < 1e-3


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_counts_without_noise_give_over_a_minute_back_to_a_thousandth_of_the_path(controller: str) -> None:
    run = drive((*FIGURE_12, *ROUND), controller=CONTROLLERS[controller])
    x, y, psi = dead_reckoned(ticks(run.rim_rad, PIONEER_WHEELS), PIONEER_WHEELS).T
    assert run.encoder_t_ns[-1] > 60e9
    T = run.motion.at(run.encoder_t_ns).T_world_body
    truth = (se3.inverse(T[0]) @ T)[:, :2, 3]
    steps_m = np.linalg.norm(np.diff(truth, axis=0), axis=1)
    off_m = np.hypot(*(np.column_stack([x, y]) - truth).T)
    assert off_m.max() < 1e-3 * steps_m.sum()
    assert np.abs(psi[::4] - (run.state[:, 2] - run.state[0, 2])).max() < 1e-3


def test_slip_costs_centimetres_and_more_slip_costs_more() -> None:
    mean = {
        s: np.mean([worst_position_error(driven("smooth", s, n), ENCODERS["exact"]) for n in range(6)]) for s in SLIPS
    }
    assert mean["none"] < 1e-3
    assert 5e-3 < mean["nominal"] < mean["slippery"] < 1.0


def test_counts_are_whole_ticks_passed_also_when_rolling_back() -> None:
    quarter = np.pi / 2
    rims = quarter * np.array([[0.0, 0.0], [0.99, -0.01], [1.01, -1.01], [-0.5, 7.5]])
    np.testing.assert_array_equal(ticks(rims, COARSE), [[0, 0], [0, -1], [1, -2], [-1, 7]])
    assert ticks(rims, COARSE).dtype == np.int64


def test_quantisation_never_exceeds_one_tick() -> None:
    rims = np.random.default_rng(1).uniform(-50, 50, (1000, 2))
    short = rims - ticks(rims, PIONEER_WHEELS) * 2 * np.pi / PIONEER_WHEELS.ticks_per_revolution
    assert (short >= 0).all()
    assert (short < 2 * np.pi / PIONEER_WHEELS.ticks_per_revolution).all()


def test_without_errors_true_wheels_are_nominal() -> None:
    rims = np.random.default_rng(2).uniform(-5, 5, (10, 2))
    np.testing.assert_allclose(true_rims(rims, ENCODERS["exact"]), rims, atol=1e-14)


def test_a_larger_true_wheel_turns_less_and_the_estimate_bends_to_its_side() -> None:
    straight = np.linspace(0, 30, 100)[:, None] * [1, 1]
    rims = true_rims(straight, EncoderErrors(radius_left=0.01))
    np.testing.assert_allclose(rims[-1], [30 / 1.01, 30])
    _, y, psi = dead_reckoned(ticks(rims, PIONEER_WHEELS), PIONEER_WHEELS)[-1]
    assert psi == pytest.approx(0.0975 * 30 * (1 - 1 / 1.01) / 0.331, rel=1e-3)
    assert y > 0.1


def test_a_larger_true_track_overstates_turns_by_as_much_and_straight_lines_not_at_all() -> None:
    wide = EncoderErrors(track=0.01)
    spin = np.linspace(0, 20, 500)[:, None] * [-1, 1]
    exact, wider = (
        dead_reckoned(ticks(true_rims(spin, e), PIONEER_WHEELS), PIONEER_WHEELS)[-1, 2]
        for e in (ENCODERS["exact"], wide)
    )
    assert wider / exact == pytest.approx(1.01, rel=1e-4)
    straight = np.linspace(0, 20, 50)[:, None] * [1, 1]
    np.testing.assert_array_equal(true_rims(straight, wide), straight)


@pytest.mark.parametrize("field", ["radius_left", "radius_right", "track"])
def test_an_error_that_is_no_small_fraction_is_refused_by_name(field: str) -> None:
    with pytest.raises(InputError, match=field):
        EncoderErrors(**{field: float("nan")})
    with pytest.raises(InputError, match=field):
        EncoderErrors(**{field: 5.0})
