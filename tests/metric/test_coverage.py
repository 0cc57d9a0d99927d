"""Coverage: how much there is, and where it stops."""

import numpy as np
import pytest

from vobench.metric.coverage import Coverage, coverage

T_NS = np.arange(10, dtype=np.int64) * 100_000_000


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        (range(10), Coverage(1.0, 0, 0, 0.0, None)),
        ([], Coverage(0.0, 1, 10, 0.9, 0)),
        ([0], Coverage(0.1, 1, 9, 0.9, 1)),
        ([9], Coverage(0.1, 1, 9, 0.9, 0)),
        ([0, 1, 5, 6, 8, 9], Coverage(0.6, 2, 3, 0.4, 2)),
        ([2, 3, 4, 5, 6, 7, 8, 9], Coverage(0.8, 1, 2, 0.2, 0)),
    ],
)
def test_gaps_are_runs_of_frames_without_an_estimate(frames, expected):
    assert coverage(T_NS, np.array(frames, np.int64)) == expected
