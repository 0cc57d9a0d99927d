"""Statistics: the laws that tie them together, and no number for nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.metric.statistic import statistics

ERRORS = st.lists(st.floats(0, 1e6), min_size=1, max_size=50)


@given(ERRORS)
def test_statistics_obey_their_laws(errors):
    s = statistics(errors)
    assert s.n == len(errors)
    assert s.rmse**2 == pytest.approx(s.mean**2 + s.std**2, rel=1e-9, abs=1e-9)
    assert s.sse == pytest.approx(s.n * s.rmse**2)
    ordered = [s.min, s.median, s.p95, s.p99, s.max]
    assert ordered == pytest.approx(sorted(ordered), rel=1e-12)
    assert s.min * (1 - 1e-12) <= s.mean <= s.rmse * (1 + 1e-12) + 1e-12


@given(ERRORS)
def test_percentiles_are_numpys(errors):
    s = statistics(errors)
    assert (s.median, s.p95, s.p99) == pytest.approx(tuple(np.percentile(errors, [50, 95, 99])), rel=1e-12)


def test_statistics_of_a_hundred_and_one_numbers():
    s = statistics(np.arange(101.0))
    assert (s.n, s.mean, s.median, s.min, s.max, s.p95, s.p99) == (101, 50, 50, 0, 100, 95, 99)
    assert s.sse == 338_350
    assert s.std == pytest.approx(np.sqrt(850))


def test_nothing_has_no_statistics():
    with pytest.raises(ValueError, match="got none"):
        statistics([])


def test_the_spread_of_a_sample_divides_by_one_less():
    assert statistics([1.0, 2.0, 3.0], ddof=1).std == 1.0
    assert statistics([4.0], ddof=1).std == 0.0
