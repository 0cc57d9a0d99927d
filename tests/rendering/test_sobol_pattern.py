"""The offsets of every square of texels are stratified, and so are those of each row of squares."""

import numpy as np
import pytest

from vobench.rendering.sobol_pattern import SobolPattern

WIDTH = 128
NO_SHIFT = np.zeros((1, 2), np.float32)


def offsets_of_square(pattern: SobolPattern, row: int, column: int, side: int) -> np.ndarray:
    """The offsets (N, 2) of side x side texels that count, from a row and a column on."""
    rows, columns = np.mgrid[:side, :side].reshape(2, -1) * pattern.stride
    index = (row + rows) * WIDTH + column + columns
    return pattern.offsets(index, np.full((len(index), 2), np.nan, np.float32))


@pytest.mark.parametrize("stride", [1, 2, 4])
@pytest.mark.parametrize("side", [2, 4, 8])
def test_a_square_of_texels_has_one_sample_in_each_elementary_interval(side: int, stride: int) -> None:
    corner = 8 * stride
    offsets = offsets_of_square(SobolPattern(WIDTH, stride, NO_SHIFT), corner, 2 * corner, side)
    count = side * side
    for columns in (2**power for power in range(int(np.log2(count)) + 1)):
        cells = np.floor(offsets * [columns, count // columns]).astype(int)
        assert len(np.unique(cells, axis=0)) == count


def test_a_shift_moves_all_offsets_and_they_stay_below_1() -> None:
    shift = np.array([[0.7, 0.4]], np.float32)
    index = np.arange(WIDTH * 8)
    others = np.zeros((len(index), 2), np.float32)
    before = SobolPattern(WIDTH, 1, NO_SHIFT).offsets(index, others)
    after = SobolPattern(WIDTH, 1, shift).offsets(index, others)
    np.testing.assert_allclose((before + shift) % 1, after, atol=1e-6)
    assert after.min() >= 0
    assert after.max() < 1


def test_texels_that_the_stride_leaves_out_keep_their_own_offsets() -> None:
    index = np.arange(4 * WIDTH)
    others = np.full((len(index), 2), 2.0, np.float32)
    offsets = SobolPattern(WIDTH, 2, NO_SHIFT).offsets(index, others)
    row, column = np.divmod(index, WIDTH)
    counts = (row % 2 == 0) & (column % 2 == 0)
    assert (offsets[counts] < 1).all()
    assert (offsets[~counts] == 2).all()


def test_texels_64_apart_have_the_same_offsets() -> None:
    pattern = SobolPattern(WIDTH, 1, NO_SHIFT)
    np.testing.assert_array_equal(offsets_of_square(pattern, 0, 0, 4), offsets_of_square(pattern, 0, 64, 4))
