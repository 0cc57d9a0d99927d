"""The layout of points on the map: neighbours are mutual, smoothing keeps even light, grids hold rims."""

import numpy as np
import pytest

from vobench.rendering.atlas import Atlas
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_layout import STRIDES, TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.scene.material import Material
from vobench.scene.mesh import quad
from vobench.scene.triangles import Thing, triangle_table

MATERIALS = {"grey": Material()}
LEFT, RIGHT, ABOVE, BELOW = range(4)


def board(wide: int, high: int, spacing_m: float = 0.05) -> tuple[Texels, TexelLayout]:
    """Points in rows and columns."""
    size_m = [spacing_m * (wide - 1), spacing_m * (high - 1)]
    things = [Thing("board", quad([0, 0, 0], [size_m[0], 0, 0], [0, size_m[1], 0]), "grey")]
    faces, lit = triangle_table(things, [-1], [-1]), np.ones(2, bool)
    atlas = unwrap(faces, np.full(2, spacing_m), lit)
    return texels(faces, MATERIALS, atlas, owners(atlas), among=lit, seed=0)


@pytest.mark.parametrize("stride", STRIDES)
@pytest.mark.parametrize(("wide", "high"), [(9, 9), (10, 7), (2, 4)])
def test_a_grid_has_every_so_many_points_and_the_last_of_each_row_and_column(wide: int, high: int, stride: int) -> None:
    points, layout = board(wide, high)
    rows = np.arange(len(points))
    on_grid = np.isin(rows, layout.on_grid(rows, stride))
    row, column = np.divmod(points.index, layout.width)
    in_column = (column % stride == 0) | (column == column.min()) | (column == column.max())
    in_row = (row % stride == 0) | (row == row.min()) | (row == row.max())
    np.testing.assert_array_equal(on_grid, in_column & in_row)


def test_the_finest_grid_has_all_points_and_each_grid_those_of_the_coarser_one() -> None:
    points, layout = board(12, 11)
    rows = np.arange(len(points))
    np.testing.assert_array_equal(layout.on_grid(rows, 1), rows)
    coarse, fine = (layout.on_grid(rows, stride) for stride in STRIDES)
    assert set(coarse.tolist()) < set(fine.tolist()) < set(rows.tolist())


def test_the_neighbour_of_a_neighbour_on_the_other_side_is_the_point_itself() -> None:
    points, layout = board(7, 5)
    itself = np.arange(len(points))
    for there, back in ((LEFT, RIGHT), (RIGHT, LEFT), (ABOVE, BELOW), (BELOW, ABOVE)):
        other = layout.neighbours[there]
        inner = other != itself
        assert inner.sum() > len(points) / 2
        np.testing.assert_array_equal(layout.neighbours[back][other[inner]], itself[inner])


def test_blurring_keeps_even_light_and_the_mean_and_makes_grain_finer() -> None:
    points, layout = board(9, 9)
    even = np.full(len(points), 3.0)
    np.testing.assert_allclose(layout.blurred(even), even)
    grain = np.random.default_rng(0).random(len(points))
    blurred = layout.blurred(grain)
    assert blurred.mean() == pytest.approx(grain.mean())
    assert blurred.std() < 0.5 * grain.std()


def test_a_mark_spreads_by_so_many_steps_along_rows_and_columns() -> None:
    points, layout = board(9, 9, spacing_m=0.1)
    centre = int(np.argmin(np.linalg.norm(points.points_m[:, :2] - 0.4, axis=1)))
    marked = np.arange(len(points)) == centre
    for steps in range(4):
        distance = np.abs(points.points_m[:, :2] - points.points_m[centre, :2]).sum(1)
        np.testing.assert_array_equal(layout.dilated(marked, steps=steps), distance < 0.1 * steps + 0.05)


def test_texels_take_their_value_from_a_point_or_stay_dark() -> None:
    points, layout = board(5, 4)
    values = np.arange(1, 1 + len(points), dtype=np.float32)
    light = layout.filled(values)
    assert light.shape == (layout.height, layout.width)
    np.testing.assert_array_equal(light.ravel()[points.index], values)
    assert (light.ravel()[layout.source == len(points)] == 0).all()
    assert set(np.unique(light)) <= {0.0, *values.tolist()}


def test_where_points_are_far_apart_a_finer_grid_stands_for_a_coarse_one() -> None:
    for spacing_m, strides in ((0.05, (4, 2)), (0.1, (2, 2)), (0.2, (1, 1))):
        points, layout = board(17, 13, spacing_m)
        row, column = np.divmod(points.index, layout.width)
        inner = (row > row.min()) & (row < row.max()) & (column > column.min()) & (column < column.max())
        for grid, stride in zip(layout.grids, strides, strict=True):
            np.testing.assert_array_equal(grid[inner], ((row % stride == 0) & (column % stride == 0))[inner])


def test_light_is_not_smoothed_across_a_crease_within_one_chart() -> None:
    size_m, spacing_m = 0.4, 0.05
    floor = Thing("floor", quad([0, 0, 0], [size_m, 0, 0], [0, size_m, 0]), "grey")
    wall = Thing("wall", quad([size_m, 0, 0], [0, 0, size_m], [0, size_m, 0]), "grey")
    faces = triangle_table([floor, wall], [-1, -1], [-1, -1])
    across_m = faces.corners_m[..., 0] + faces.corners_m[..., 2]
    light_px = np.stack([across_m, faces.corners_m[..., 1]], -1) / spacing_m + 0.5
    everything = np.ones(len(faces), bool)
    atlas = Atlas(light_px.astype(np.float32), np.zeros(len(faces), np.int32), 10, 18)
    points, layout = texels(faces, MATERIALS, atlas, owners(atlas), among=everything, seed=0)
    is_wall = faces.thing[points.face] == 1
    assert set(is_wall.tolist()) == {False, True}
    np.testing.assert_array_equal(layout.blurred(is_wall.astype(float)), is_wall)
