"""Counts are Poisson, by an expansion or a sum, and no draw depends on the light."""

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtri

from vobench.sensor.shot import EXPANSION_FROM, poisson

# The middles of a million equally likely slices of the normal distribution: a sample without chance.
EVEN = ndtri((np.arange(1_000_000) + 0.5) / 1_000_000)
MEANS = [0.01, 0.3, 2.0, 9.99, EXPANSION_FROM, 15.0, 40.0, 300.0, 5000.0, 40_000.0]


def counts_of(mean: float) -> np.ndarray:
    return poisson(np.full(len(EVEN), mean), EVEN)


@pytest.mark.parametrize("mean", MEANS)
def test_counts_are_distributed_as_poisson_says(mean: float) -> None:
    counts = counts_of(mean).astype(int)
    support = np.arange(counts.max() + 1)
    share = np.bincount(counts) / len(counts)
    exact = stats.poisson.pmf(support, mean)
    # A slice that straddles two counts goes to one of them: half a slice a count, on average.
    slices = np.ptp(counts) / len(counts)
    assert np.abs(share - exact).sum() / 2 < (6e-4 if mean >= EXPANSION_FROM else 1e-6) + slices
    assert counts.min() >= 0


@pytest.mark.parametrize("mean", MEANS)
def test_mean_and_variance_are_both_the_mean(mean: float) -> None:
    counts = counts_of(mean)
    assert counts.mean() == pytest.approx(mean, rel=3e-5)
    assert counts.var() == pytest.approx(mean, rel=3e-4)


@pytest.mark.parametrize("mean", [0.3, 9.99, 40.0, 5000.0])
def test_a_million_random_counts_pass_for_poisson(mean: float) -> None:
    counts = poisson(np.full(1_000_000, mean), np.random.default_rng(7).standard_normal(1_000_000))
    low, high = (int(stats.poisson.ppf(q, mean)) for q in (1e-4, 1 - 1e-4))
    seen = np.bincount(np.clip(counts, low, high).astype(int), minlength=high + 1)[low:]
    expected = stats.poisson.pmf(np.arange(low, high + 1), mean)
    expected[0], expected[-1] = stats.poisson.cdf(low, mean), stats.poisson.sf(high - 1, mean)
    assert stats.chisquare(seen, expected / expected.sum() * len(counts)).pvalue > 1e-3


@pytest.mark.parametrize("mean", [2.0, 9.99, 40.0, 5000.0])
def test_a_higher_draw_never_gives_fewer_electrons(mean: float) -> None:
    assert (np.diff(counts_of(mean)) >= 0).all()


def test_the_two_ways_meet() -> None:
    draws = EVEN[::10]
    below, above = (poisson(np.full(len(draws), mean), draws) for mean in (EXPANSION_FROM - 1e-9, EXPANSION_FROM))
    assert np.abs(below - above).max() <= 1
    assert (below != above).mean() < 4e-3


def test_each_pixel_has_its_own_mean() -> None:
    means = np.array([[0.0, 3.0], [30.0, 3e4]])
    draws = np.random.default_rng(1).standard_normal((20_000, 2, 2))
    counts = poisson(np.broadcast_to(means, draws.shape).copy(), draws)
    np.testing.assert_allclose(counts.mean(0), means, atol=5 * np.sqrt(means.max() / 20_000), rtol=0.02)
    assert (counts[:, 0, 0] == 0).all()
