"""Surfels group points that are near, face alike and see each other, and average their values."""

import numpy as np

from tests.rendering.gathered_room import gathered_room
from tests.rendering.rectangles import rectangle, room
from vobench.rendering.surfel import Surfels, stratified_middles

X, Y, Z = np.eye(3)


def test_means_of_surfels_are_weighted_and_even_values_stay() -> None:
    surfels = Surfels(np.array([0, 0, 1, 1, 1], np.int32), np.array([0, 2]), np.ones(2, np.float32))
    weights = np.array([1.0, 3.0, 1.0, 1.0, 2.0])
    values = np.array([[0.0], [4.0], [1.0], [2.0], [3.0]])
    np.testing.assert_allclose(surfels.mean(values, weights), [[3.0], [2.25]])
    np.testing.assert_allclose(surfels.mean(np.full((5, 3), 0.7), weights), 0.7, rtol=1e-6)
    assert len(surfels) == 2


def test_the_points_of_a_surfel_are_of_one_thing_in_one_cell_with_one_direction() -> None:
    lit = gathered_room(room((2, 2, 2), floor="grey", wall="grey", ceiling="grey"), spacing_m=0.1, step_m=0.5)
    points = lit.points
    for surfel in range(len(lit.groups)):
        members = np.flatnonzero(lit.groups.of == surfel)
        assert lit.groups.middle[surfel] in members
        assert len(np.unique(lit.thing[members])) == 1
        assert np.ptp(points.points_m[members], axis=0).max() <= 0.5
        assert (points.planes[members] == points.planes[members[0]]).all()


def test_points_on_both_sides_of_a_wall_are_in_different_surfels() -> None:
    floor = rectangle(0.5 * X + 0.5 * Y, X, Y, "grey", "floor")
    wall = rectangle(0.37 * X + 0.5 * Y + 0.5 * Z, 3 * Y, Z, "mirror", "wall")
    open_floor = gathered_room([floor], spacing_m=0.05, step_m=1.0)
    divided = gathered_room([floor, wall], spacing_m=0.05, step_m=1.0)
    is_left = divided.points.points_m[:, 0] < 0.37
    assert len(np.unique(divided.groups.of)) >= 2
    assert not set(divided.groups.of[is_left]) & set(divided.groups.of[~is_left])
    assert len(open_floor.groups) < len(divided.groups)


def test_points_close_behind_a_cover_are_in_other_surfels_than_those_beside_it() -> None:
    """So that a cabinet's points behind its drawers, which are dark, do not stand for those that can be seen."""
    floor = rectangle(0.5 * X + 0.5 * Y, X, Y, "grey", "floor")
    cover = rectangle(0.26 * X + 0.5 * Y + 0.02 * Z, 0.52 * X, Y, "grey", "cover")
    lit = gathered_room([floor, cover], spacing_m=0.05, step_m=1.0)
    is_floor = lit.points.points_m[:, 2] < 0.01
    is_covered = lit.points.points_m[:, 0] < 0.52
    covered = set(lit.groups.of[is_floor & is_covered])
    open_to_light = set(lit.groups.of[is_floor & ~is_covered])
    assert covered
    assert open_to_light
    assert not covered & open_to_light


def test_the_sample_offsets_of_neighbouring_surfels_are_stratified() -> None:
    lit = gathered_room([rectangle(2 * X + 2 * Y, 4 * X, 4 * Y, "grey")], spacing_m=0.1, step_m=0.5)
    middles = stratified_middles(lit.middles, lit.groups.step_m)
    cell = np.floor(middles.points_m / 0.5).astype(int)
    square = np.flatnonzero((cell[:, 0] < 4) & (cell[:, 1] < 4) & (cell[:, :2] >= 0).all(1))
    assert len(square) == 16
    unshifted = middles.dither[square] - lit.middles.dither[:1]
    strata = np.floor((unshifted + 1e-4) % 1 * 4).astype(int)
    assert len(np.unique(strata, axis=0)) == 16
