"""Values that are known on a grid: linear ones are interpolated exactly, and what differs is computed instead."""

import numpy as np
import pytest

from tests.rendering.test_texel_layout import board
from vobench.rendering.texel import Texels
from vobench.rendering.texel_field import TexelField
from vobench.rendering.texel_layout import STRIDES, TexelLayout

FINER_STRIDES = (*STRIDES[1:], 1)


def known_on_the_coarsest_grid(points: Texels, layout: TexelLayout, values: np.ndarray) -> TexelField:  # type: ignore[type-arg]
    field = TexelField.unknown(layout, len(points))
    rows = layout.on_grid(np.arange(len(points)), STRIDES[0])
    field.set(rows, values[rows].astype(np.float32))
    return field


@pytest.mark.parametrize(("wide", "high"), [(17, 13), (6, 5), (5, 6), (6, 6), (2, 4), (2, 3)])
def test_linear_values_are_interpolated_exactly_up_to_the_rims(wide: int, high: int) -> None:
    points, layout = board(wide, high)
    ramp = points.points_m @ [1.0, 2.0, 0.0]
    field = known_on_the_coarsest_grid(points, layout, ramp)
    rows = np.arange(len(points))
    for stride in FINER_STRIDES:
        assert len(field.refine(layout.on_grid(rows, stride), stride=stride, tolerance=np.inf)) == 0
    np.testing.assert_allclose(field.values, ramp, atol=3e-3)


def test_no_point_of_even_values_is_computed_again() -> None:
    points, layout = board(17, 13)
    field = known_on_the_coarsest_grid(points, layout, np.full(len(points), 0.7))
    rows = np.arange(len(points))
    for stride in FINER_STRIDES:
        asked = field.refine(layout.on_grid(rows, stride), stride=stride, tolerance=0.0, is_relative=True)
        assert len(asked) == 0
    np.testing.assert_allclose(field.values, 0.7)


def test_points_beside_an_edge_are_computed_and_those_far_from_it_are_not() -> None:
    points, layout = board(33, 9)
    edge_m = 0.775
    step = (points.points_m[:, 0] > edge_m).astype(float)
    field = known_on_the_coarsest_grid(points, layout, step)
    rows = np.arange(len(points))
    for stride in FINER_STRIDES:
        asked = field.refine(layout.on_grid(rows, stride), stride=stride, tolerance=0.2)
        assert (np.abs(points.points_m[asked, 0] - edge_m) < 0.05 * 2 * stride + 0.05).all()
        field.set(asked, step[asked].astype(np.float32))
    np.testing.assert_array_equal(field.values, step)


def test_a_relative_tolerance_is_that_of_the_greater_value() -> None:
    points, layout = board(9, 9)
    column = np.rint(points.points_m[:, 0] * 20).astype(int)
    values = np.where(column > column.max() // 2, 1000.0, 950.0)
    rows = layout.on_grid(np.arange(len(points)), 2)
    for tolerance, is_asked in ((0.04, True), (0.06, False)):
        field = known_on_the_coarsest_grid(points, layout, values)
        assert bool(len(field.refine(rows, stride=2, tolerance=tolerance, is_relative=True))) == is_asked


def test_points_without_known_ones_on_both_sides_are_computed() -> None:
    points, layout = board(9, 9)
    field = TexelField.unknown(layout, len(points))
    rows = layout.on_grid(np.arange(len(points)), 2)
    np.testing.assert_array_equal(field.refine(rows, stride=2, tolerance=1.0), rows)
    assert (field.values == 0).all()


def test_extremes_are_those_of_known_points_at_most_so_far_away_on_four_sides() -> None:
    points, layout = board(9, 9)
    values = points.points_m @ [1.0, 10.0, 0.0]
    field = TexelField.unknown(layout, len(points))
    field.set(np.arange(len(points)), values.astype(np.float32))
    centre = np.array([np.argmin(np.linalg.norm(points.points_m[:, :2] - 0.2, axis=1))])
    low, high = field.extremes(centre, steps=1)
    assert low[0] == pytest.approx(values[centre[0]] - 0.5, rel=1e-3)
    assert high[0] == pytest.approx(values[centre[0]] + 0.5, rel=1e-3)
    field.state[:] = 0
    low, high = field.extremes(centre, steps=4)
    assert low[0] == high[0] == np.float32(values[centre[0]])


def test_smoothing_keeps_even_values_and_takes_grain_out_of_the_rows_alone() -> None:
    points, layout = board(17, 17)
    rows = layout.on_grid(np.arange(len(points)), 4)
    field = TexelField.unknown(layout, len(points))
    field.set(rows, np.full(len(rows), 3.0, np.float32))
    field.smooth(rows, steps=4)
    np.testing.assert_allclose(field.values[rows], 3.0)
    grain = np.random.default_rng(0).random(len(rows)).astype(np.float32)
    field.set(rows, grain)
    field.smooth(rows, steps=4)
    assert field.values[rows].std() < 0.7 * grain.std()
    others = np.setdiff1d(np.arange(len(points)), rows)
    assert (field.values[others] == 0).all()
