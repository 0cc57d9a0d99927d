"""Laws of tests on one case: exact chances, and no more false marks than promised though the best was chosen."""

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from vobench.metric.repeat_test import difference_p, worse_than_best


@pytest.mark.parametrize(("n", "m"), [(4, 4), (5, 7), (9, 6)])
def test_chances_are_those_of_mann_and_whitney(n, m):
    rng = np.random.default_rng(n)
    a, b = rng.random(n), rng.random(m) + 0.3
    assert difference_p(a, b) == pytest.approx(mannwhitneyu(a, b, method="exact").pvalue)


def test_three_trials_decide_nothing_and_four_do_though_some_failed():
    assert difference_p(np.arange(3.0), np.arange(9.0) + 5) == 1
    assert difference_p(np.arange(4.0), np.array([5.0, 6.0, np.inf, np.inf])) < 0.05


def test_ties_are_half_wins():
    assert difference_p(np.zeros(5), np.zeros(5)) == 1
    assert difference_p(np.array([0.0, 0, 1, 1]), np.array([0.0, 0, 1, 1])) == 1


def test_an_order_is_all_that_counts():
    a, b = np.arange(5.0), np.arange(5.0) + 2.5
    assert difference_p(a, b) == difference_p(np.exp(a), np.exp(b)) == difference_p(b, a)


def test_an_estimator_far_behind_the_best_is_worse_and_its_equal_is_not():
    rng = np.random.default_rng(1)
    values = {"best": rng.random(12), "equal": rng.random(12), "far": rng.random(12) + 5}
    assert worse_than_best(values, "best") == {"far"}


def test_of_ten_that_are_alike_at_most_one_row_in_twenty_has_a_false_mark():
    """Tests of the best alone, uncorrected, mark one in 47 of 100 rows."""
    rng = np.random.default_rng(2)
    rows = 0
    for _ in range(300):
        values = {str(name): rng.random(8) for name in range(10)}
        best = min(values, key=lambda name: float(np.median(values[name])))
        rows += bool(worse_than_best(values, best))
    assert rows <= 15 + 2.33 * np.sqrt(300 * 0.05 * 0.95)
