"""A short form of the benchmark of stated errors of calibration."""

import numpy as np
import pytest

from tests.benchmarks.loading import load

PAIRS = 6


@pytest.mark.parametrize(("kind", "is_perfect"), [("perfect", True), ("rotated, no truth", False)])
def test_intervals_hold_the_truth_and_perfect_pairs_are_not_said_to_be_off(kind: str, is_perfect: bool) -> None:
    benchmark = load("pair_calibration")
    results = benchmark.outcomes(benchmark.KINDS[kind], PAIRS, np.random.default_rng(7))
    stated = [statement for outcome in results for statement in outcome.statements]
    assert len(stated) > 10 * PAIRS
    assert np.mean([statement.is_covered for statement in stated]) >= 0.92
    offs = [outcome.is_off for outcome in results]
    assert sum(offs) <= 1 if is_perfect else all(offs)
    offset = next(row for row in benchmark.coverages(results) if row.name == "offset center")
    assert offset.sigma < 0.08
