"""Work in blocks gives the same arrays as work at once."""

import numpy as np
import pytest

from vobench.metric import blockwise


@pytest.mark.parametrize("n", [0, 1, 3, 4, 5, 8])
def test_blocks_are_joined_in_order(monkeypatch: pytest.MonkeyPatch, n: int) -> None:
    monkeypatch.setattr(blockwise, "BLOCK", 4)
    values = np.arange(n, dtype=float)
    sizes = []

    def work(block: slice) -> tuple[np.ndarray, np.ndarray]:
        part = values[block]
        sizes.append(len(part))
        return part, -part

    same, negative = blockwise.in_blocks(n, work)
    np.testing.assert_array_equal(same, values)
    np.testing.assert_array_equal(negative, -values)
    assert max(sizes) <= 4
    assert sum(sizes) == n
