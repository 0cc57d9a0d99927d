"""Noise has the density that was asked for at any rate, a walk the spread, and a chip its range and steps."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.sensor.triad import FLAWLESS, Triad, read_out, started, walked


def draws(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, 3))


@pytest.mark.parametrize("rate_hz", [10.0, 200.0])
def test_the_mean_over_a_second_is_as_noisy_at_any_rate(rate_hz):
    silence = np.zeros((round(2000 * rate_hz), 3))
    readings = read_out(Triad(noise=0.01), silence, silence, draws(len(silence)), step_s=1 / rate_hz)
    seconds = readings.reshape(2000, -1, 3).mean(1)
    assert seconds.std() == pytest.approx(0.01, rel=0.03)


@pytest.mark.parametrize("rate_hz", [10.0, 200.0])
def test_a_walk_goes_as_far_in_a_second_at_any_rate(rate_hz):
    path = walked(Triad(walk=0.01), draws(round(2000 * rate_hz) + 1), step_s=1 / rate_hz)
    assert not path[0].any()
    assert np.diff(path[:: round(rate_hz)], axis=0).std() == pytest.approx(0.01, rel=0.03)


@pytest.mark.parametrize("rate_hz", [10.0, 100.0])
def test_a_walk_that_is_forgotten_has_spread_and_memory_at_any_rate(rate_hz):
    triad = Triad(walk=0.01, correlation_s=0.5)
    lag = round(0.5 * rate_hz)
    path = walked(triad, draws(200_000), step_s=1 / rate_hz)
    assert path.std() == pytest.approx(0.01 * np.sqrt(0.5 / 2), rel=0.03)
    assert np.corrcoef(path[:-lag, 0], path[lag:, 0])[0, 1] == pytest.approx(np.exp(-1), abs=0.03)


def test_a_walk_that_is_forgotten_has_its_spread_from_the_first_reading_on():
    triad = Triad(walk=0.01, correlation_s=0.5)
    firsts = np.stack([walked(triad, draws(1, seed), step_s=0.01)[0] for seed in range(1000)])
    assert firsts.std() == pytest.approx(0.005, rel=0.05)


def test_a_memory_of_ages_is_a_walk_that_is_never_forgotten():
    numbers = draws(1000)
    numbers[0] = 0.0
    never, ages = (walked(Triad(walk=0.01, correlation_s=tau), numbers, step_s=0.01) for tau in (inf, 1e7))
    np.testing.assert_allclose(ages, never, atol=1e-6)


@pytest.mark.parametrize("correlation_s", [0.5, inf])
def test_a_longer_walk_begins_with_the_shorter_one(correlation_s):
    triad, numbers = Triad(walk=0.01, correlation_s=correlation_s), draws(500)
    short, long = (walked(triad, numbers[:n], step_s=0.01) for n in (50, 500))
    np.testing.assert_array_equal(long[:50], short)


def test_walking_leaves_the_numbers_it_was_given_alone():
    numbers = draws(10)
    walked(Triad(walk=1.0), numbers, step_s=0.1)
    np.testing.assert_array_equal(numbers, draws(10))


def test_without_flaws_the_truth_is_read():
    true, none = draws(100), np.zeros((100, 3))
    np.testing.assert_array_equal(read_out(FLAWLESS, true, none, draws(100, 1), step_s=0.01), true)


def test_scale_and_misalignment_act_on_the_truth_and_not_on_the_bias():
    triad = Triad(bias=(0.1, 0.2, 0.3), gain=((1.01, 0.02, 0), (0, 0.98, 0), (0, 0, 1)))
    bias = started(triad, np.zeros(3))[None]
    (reading,) = read_out(triad, np.array([[1.0, 2.0, 3.0]]), bias, np.zeros((1, 3)), step_s=0.01)
    np.testing.assert_allclose(reading, [1.05 + 0.1, 1.96 + 0.2, 3.3])


def test_a_chip_reads_whole_steps_within_its_range():
    chip, none = Triad(limit=1.0, step=0.25), np.zeros((4, 3))
    true = np.array([[0.12, -0.13, 0.9], [5.0, -5.0, 0.0], [0.24, 0.26, 0.5], [np.pi, 1e9, -1e9]])
    said = [[0, -0.25, 1], [1, -1, 0], [0.25, 0.25, 0.5], [1, 1, -1]]
    np.testing.assert_array_equal(read_out(chip, true, none, none, step_s=0.01), said)


@pytest.mark.parametrize("field", ["noise", "walk", "bias_std", "step"])
@pytest.mark.parametrize("value", [-1e-9, nan, inf])
def test_a_size_that_is_none_is_refused_by_name(field, value):
    with pytest.raises(InputError, match=rf"an IMU's {field} should be finite and 0 or more, got {value}"):
        replace(FLAWLESS, **{field: value})


@pytest.mark.parametrize("field", ["correlation_s", "limit"])
@pytest.mark.parametrize("value", [0.0, -1.0, nan])
def test_a_bound_that_is_none_is_refused_by_name(field, value):
    with pytest.raises(InputError, match=rf"an IMU's {field} should be more than 0, or inf for none, got {value}"):
        replace(FLAWLESS, **{field: value})


@pytest.mark.parametrize(("field", "value"), [("bias", (0, 1)), ("bias", (0, nan, 0)), ("gain", (1.0, 1.0, 1.0))])
def test_numbers_that_are_too_few_or_none_are_refused_by_name(field, value):
    with pytest.raises(InputError, match=rf"an IMU's {field} should be \(3, ?3?\) finite numbers, got"):
        replace(FLAWLESS, **{field: value})
