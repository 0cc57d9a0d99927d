"""Work in slices gives what it gives at once, in order."""

import numpy as np
import pytest

from vobench.rendering.thread_pool import CHUNK, chunked, in_chunks


@pytest.mark.parametrize("count", [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 5 * CHUNK + 3])
def test_slices_cover_all_things_once_and_in_order(count: int) -> None:
    values = np.arange(count) ** 2
    np.testing.assert_array_equal(chunked(lambda part: values[part], count), values)


def test_no_slice_is_longer_than_a_chunk_and_progress_ends_at_one() -> None:
    shares: list[float] = []
    sizes = in_chunks(lambda part: part.stop - part.start, 25, chunk=10, done=shares.append)
    assert sizes == [10, 10, 5]
    assert shares == pytest.approx([1 / 3, 2 / 3, 1])


def test_what_fails_in_a_thread_fails_outside() -> None:
    def fail(part: slice) -> int:
        if part.start:
            raise ValueError("the second slice")
        return 0

    with pytest.raises(ValueError, match="second slice"):
        in_chunks(fail, 25, chunk=10)
