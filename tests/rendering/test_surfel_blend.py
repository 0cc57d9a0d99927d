"""The light of surfels is interpolated between near ones that are not hidden, and even light stays even."""

import numpy as np

from tests.rendering.gathered_room import GatheredRoom, gathered_room
from tests.rendering.rectangles import rectangle, room
from vobench.rendering.array_types import Floats
from vobench.rendering.surfel_blend import NEIGHBOURS, blend

X, Y, Z = np.eye(3)


def weights_of(lit: GatheredRoom) -> Floats:
    """The weights (P, S) at the texels of points."""
    usable = np.ones(len(lit.groups), bool)
    return blend(lit.points, lit.groups, lit.layout, lit.visibility, usable).toarray()[lit.points.index]


def test_the_weights_of_each_texel_add_up_to_1_and_few_surfels_count() -> None:
    lit = gathered_room(room((2, 2, 2), floor="grey", wall="grey", ceiling="grey"), spacing_m=0.1, step_m=0.5)
    weights = weights_of(lit)
    np.testing.assert_allclose(weights.sum(1), 1, rtol=1e-5)
    assert weights.min() >= 0
    assert np.count_nonzero(weights, axis=1).max() <= NEIGHBOURS


def test_light_that_changes_evenly_along_a_floor_does_so_between_surfels() -> None:
    lit = gathered_room([rectangle(2 * X + 2 * Y, 4 * X, 4 * Y, "grey")], spacing_m=0.1, step_m=0.5)
    shown = weights_of(lit) @ lit.middles.points_m[:, 0]
    x_m = lit.points.points_m[:, 0]
    inside = (x_m > 0.5) & (x_m < 3.5)
    assert np.abs(shown - x_m)[inside].max() < 0.2  # less than half a cell
    assert np.corrcoef(shown[inside], x_m[inside])[0, 1] > 0.99


def test_no_light_crosses_a_wall() -> None:
    floor = rectangle(X + 0.5 * Y, 2 * X, Y, "grey", "floor")
    wall = rectangle(X + 0.5 * Y + 0.5 * Z, 3 * Y, 2 * Z, "mirror", "wall")
    other_side = rectangle(0.99 * X + 0.5 * Y + 0.5 * Z, 2 * Z, 3 * Y, "mirror", "wall")
    lit = gathered_room([floor, wall, other_side], spacing_m=0.05, step_m=0.5)
    weights = weights_of(lit)
    is_left_point = lit.points.points_m[:, 0] < 1
    is_left_surfel = lit.middles.points_m[:, 0] < 1
    assert weights[np.ix_(is_left_point, ~is_left_surfel)].max() == 0
    assert weights[np.ix_(~is_left_point, is_left_surfel)].max() == 0


def test_surfels_that_are_not_usable_have_no_weight() -> None:
    lit = gathered_room([rectangle(X + Y, 2 * X, 2 * Y, "grey")], spacing_m=0.1, step_m=0.5)
    usable = np.ones(len(lit.groups), bool)
    usable[::2] = False
    weights = blend(lit.points, lit.groups, lit.layout, lit.visibility, usable)
    assert weights[:, ~usable].nnz == 0
    np.testing.assert_allclose(weights.sum(1)[lit.points.index], 1, rtol=1e-5)
    nothing = blend(lit.points, lit.groups, lit.layout, lit.visibility, np.zeros(len(lit.groups), bool))
    assert nothing.nnz == 0
