"""Intervals over blocks of segments."""

import numpy as np
import pytest

from vobench.analysis.segment_bootstrap import block_interval, block_means


def test_a_change_by_the_same_factor_everywhere_has_an_interval_without_width() -> None:
    loss = np.random.default_rng(0).lognormal(-3, 1, 24)
    assert block_interval(loss, loss / 4) == pytest.approx((0.75, 0.75))
    assert block_interval(loss, loss) == pytest.approx((0, 0))


def test_an_interval_covers_the_change_and_is_wider_if_fewer_segments_change() -> None:
    rng = np.random.default_rng(1)
    before = rng.lognormal(-3, 0.3, 24)
    everywhere = before * np.where(np.arange(24) % 2, 0.4, 0.6)
    in_one_part = before * np.where(np.arange(24) < 6, 0.0, 2 / 3)
    widths = []
    for after in (everywhere, in_one_part):
        low, high = block_interval(before, after)
        assert low < 1 - after.mean() / before.mean() < high
        widths.append(high - low)
    assert widths[1] > 2 * widths[0]


def test_blocks_are_three_successive_segments_and_go_round_the_end() -> None:
    loss = 2.0 ** np.arange(6)
    starts = np.array([[0.0, 0.5], [0.2, 0.99], [1 / 6 + 1e-9, 0.0]])
    expected = [[0, 1, 2, 3, 4, 5], [1, 2, 3, 5, 0, 1], [1, 2, 3, 0, 1, 2]]
    assert block_means(loss, starts) == pytest.approx([np.mean(2.0 ** np.array(rows)) for rows in expected])
