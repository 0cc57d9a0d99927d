"""Batches and ends keep all arrays of a ray together when rays are picked and joined."""

import numpy as np
import pytest

from vobench.rendering.ray_batch import RayBatch, RayEnds, empty_batch, empty_ends, joined_ends


def numbered(table: RayBatch | RayEnds) -> None:
    """Write the number of each ray to all of its arrays."""
    for column in table:
        rays = np.arange(len(column))
        column[:] = rays.reshape(-1, *[1] * (column.ndim - 1))


@pytest.mark.parametrize("create", [empty_batch, empty_ends])
@pytest.mark.parametrize("rows", [np.array([2, 0]), np.array([True, False, True]), slice(1, 3)])
def test_the_same_rays_are_picked_from_all_arrays(create, rows):
    table = create(3)
    numbered(table)
    expected = np.arange(3)[rows]
    for column, picked in zip(table, table.take(rows), strict=True):
        first = picked.reshape(len(picked), -1)[:, 0]
        np.testing.assert_array_equal(first, expected.astype(column.dtype))
        assert picked.dtype == column.dtype


def test_parts_are_joined_in_order():
    first = empty_ends(1)
    second = empty_ends(2)
    numbered(first)
    numbered(second)
    assert joined_ends([first, second]).texel.tolist() == [0, 0, 1]
    one = empty_batch(1)
    two = empty_batch(2)
    numbered(one)
    numbered(two)
    joined = one.joined(two)
    assert joined.point.tolist() == [0, 0, 1]
    assert joined.origins_m.shape == (3, 3)
