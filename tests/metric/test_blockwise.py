"""Work in blocks gives the same arrays as work at once."""

from dataclasses import dataclass

import numpy as np
import pytest

from vobench.metric import blockwise


@dataclass(frozen=True)
class Both:
    same: np.ndarray
    negative: np.ndarray


@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 8])
def test_blocks_are_joined_in_order(monkeypatch: pytest.MonkeyPatch, n: int) -> None:
    monkeypatch.setattr(blockwise, "BLOCK", 4)
    values = np.arange(n, dtype=float)
    sizes = []

    def work(block: slice) -> Both:
        part = values[block]
        sizes.append(len(part))
        return Both(part, -part)

    whole = blockwise.in_blocks(n, work)
    np.testing.assert_array_equal(whole.same, values)
    np.testing.assert_array_equal(whole.negative, -values)
    assert max(sizes) <= 4
    assert sum(sizes) == n
