"""Slip is a stationary process whose size does not depend on the frame rate, one generator for each part."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.robot.slip import SLIPS, STREAMS, SlipNow, SlipSettings, ornstein_uhlenbeck, slip_path

NOMINAL = SLIPS["nominal"]


def generators(seed: int) -> dict[str, np.random.Generator]:
    return dict(zip(STREAMS, np.random.default_rng(seed).spawn(len(STREAMS)), strict=True))


@pytest.mark.parametrize("rate_hz", [10.0, 30.0, 200.0])
def test_spread_and_memory_do_not_depend_on_the_rate(rate_hz: float) -> None:
    lag = round(0.3 * rate_hz)
    path = ornstein_uhlenbeck(400_000, std=0.02, step_s=1 / rate_hz, correlation_s=0.3, rng=np.random.default_rng(5))
    assert path.std() == pytest.approx(0.02, rel=0.03)
    assert np.corrcoef(path[:-lag], path[lag:])[0, 1] == pytest.approx(np.exp(-1), abs=0.03)


def test_the_process_has_its_full_spread_from_the_first_sample_on() -> None:
    firsts = [
        ornstein_uhlenbeck(1, std=0.02, step_s=0.1, correlation_s=0.3, rng=rng)[0]
        for rng in np.random.default_rng(6).spawn(2000)
    ]
    assert np.std(firsts) == pytest.approx(0.02, rel=0.06)


def test_a_longer_path_begins_with_the_shorter_one() -> None:
    short, long = (slip_path(n, NOMINAL, step_s=1 / 30, rngs=generators(1)) for n in (50, 500))
    np.testing.assert_array_equal(long[:50], short)


def test_switching_one_process_off_leaves_the_others_as_they_were() -> None:
    both = slip_path(100, NOMINAL, step_s=1 / 30, rngs=generators(2))
    straight = slip_path(100, replace(NOMINAL, angle_std_rad=0.0), step_s=1 / 30, rngs=generators(2))
    sliding = slip_path(100, replace(NOMINAL, ratio_std=0.0), step_s=1 / 30, rngs=generators(2))
    np.testing.assert_array_equal(straight, both * [1, 1, 0])
    np.testing.assert_array_equal(sliding, both * [0, 0, 1])


def test_the_three_processes_are_independent() -> None:
    path = slip_path(100_000, SLIPS["slippery"], step_s=1.0, rngs=generators(3))
    assert np.abs(np.corrcoef(path.T) - np.eye(3)).max() < 0.02


def test_a_slipping_rim_runs_ahead_of_the_ground() -> None:
    left, right = SlipNow(left=0.2, right=0.0).rim_rates(0.4, 0.4, radius_m=0.1)
    assert (left, right) == (pytest.approx(5.0), pytest.approx(4.0))


def test_skid_pushes_the_robot_out_of_its_turn() -> None:
    assert SlipNow(skid_s=0.02).side_speed(0.5, 1.0) == pytest.approx(-0.01)


def test_without_slip_no_generator_is_needed_and_with_slip_its_lack_is_named() -> None:
    assert not slip_path(10, SLIPS["none"], step_s=0.1, rngs=None).any()
    with pytest.raises(MotionError, match="needs a random generator for 'side', and rngs has none"):
        slip_path(10, NOMINAL, step_s=0.1, rngs={k: v for k, v in generators(0).items() if k != "side"})


def test_between_two_instants_slip_is_on_the_straight_line() -> None:
    first, second = SlipNow(0.1, -0.2, 0.3, 0.02, 0.0, 1.0, -1.0), SlipNow(0.3, 0.0, -0.1, 0.02, 0.0, 0.0, 0.0)
    assert first.towards(second, 0.0) == first
    np.testing.assert_allclose(first.towards(second, 0.25), [0.15, -0.15, 0.2, 0.02, 0.0, 0.75, -0.75])


@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_a_strained_rim_runs_ahead_of_the_ground_where_it_is_driven_on_and_behind_where_it_brakes(speed: float) -> None:
    slip = SlipNow(traction_s2pm=0.1)
    on, braked = (slip.rim_rates(speed, speed, radius_m=0.1, driven_mps2=(s * speed, s * speed)) for s in (1, -1))
    assert abs(on[0]) > abs(speed) / 0.1 > abs(braked[0])


@pytest.mark.parametrize(
    "bad",
    [
        {"ratio_std": -0.1},
        {"ratio_std": 0.5},
        {"correlation_s": 0.0},
        {"skid_s": float("nan")},
        {"traction_s2pm": -0.1},
    ],
)
def test_settings_out_of_range_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(MotionError, match="slip needs"):
        SlipSettings(**bad)
