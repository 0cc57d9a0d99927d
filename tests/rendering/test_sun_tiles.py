"""Faces are divided where the edge of a sun's shadow crosses some of their tiles, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.face_parts import FaceParts
from vobench.rendering.sun_tiles import TILE_SAMPLES, sunlit_parts
from vobench.scene.mesh import quad
from vobench.scene.triangles import Thing, Triangles, triangle_table

SPACING_M = 0.025
OVERHEAD = np.array([0.0, 0.0, 1.0])
FLOOR = Thing("floor", quad((0.0, 0, 0), (6.0, 0, 0), (0, 4.0, 0)), "grey")


def table(*things: Thing) -> Triangles:
    return triangle_table(things, [-1] * len(things), [-1] * len(things))


def roof(from_x_m: float, to_x_m: float) -> Thing:
    """A plate two metres above the floor, whose shadow the sun overhead throws straight down."""
    width_m = to_x_m - from_x_m
    return Thing("roof", quad((from_x_m, -1.0, 2.0), (0, 6.0, 0), (width_m, 0, 0)), "grey")


def parts_of(faces: Triangles, direction: Array = OVERHEAD) -> tuple[FaceParts, Array]:
    everywhere = np.ones(len(faces), bool)
    spacing_m = np.full(len(faces), SPACING_M)
    return sunlit_parts(faces, everywhere, everywhere, [direction], spacing_m)


def test_a_floor_all_in_the_sun_or_all_in_shadow_stays_whole_and_coarse() -> None:
    for faces in (table(FLOOR), table(FLOOR, roof(-1.0, 7.0))):
        parts, is_fine = parts_of(faces)
        assert parts.parent.tolist() == list(range(len(faces)))
        assert not is_fine.any()


def test_parts_cover_their_faces_and_keep_plane_and_texture() -> None:
    faces = table(FLOOR, roof(-1.0, 2.13))
    parts, is_fine = parts_of(faces)
    assert len(parts.parent) > len(faces)
    assert (parts.weights >= 0).all()
    np.testing.assert_allclose(parts.weights.sum(2), 1)
    parted = parts.of(faces)
    area_m2 = np.bincount(parts.parent, areas_m2(parted.corners_m))
    np.testing.assert_allclose(area_m2, areas_m2(faces.corners_m), rtol=1e-12)
    np.testing.assert_allclose(parted.corners_m[parted.thing == 0, :, 2], 0, atol=1e-15)
    per_metre = (faces.uv[0, 1] - faces.uv[0, 0]) / 6.0
    uv = faces.uv[0, 0] + parted.corners_m[parted.thing == 0, :, :1] * per_metre
    np.testing.assert_allclose(parted.uv[parted.thing == 0, :, 0], uv[..., 0], atol=1e-12)
    assert is_fine.any()


@pytest.mark.parametrize("edge_x_m", [1.83, 2.4, 3.0, 3.61])
def test_parts_are_fine_where_an_edge_is_within_two_samples_and_coarse_two_tiles_away(edge_x_m: float) -> None:
    faces = table(FLOOR, roof(-1.0, edge_x_m))
    parts, is_fine = parts_of(faces)
    corners_m = parts.of(faces).corners_m
    is_floor = faces.thing[parts.parent] == 0
    low_m = corners_m[..., 0].min(1)
    high_m = corners_m[..., 0].max(1)
    is_crossed = (low_m < edge_x_m - 0.01) & (high_m > edge_x_m + 0.01)
    assert is_fine[is_floor & is_crossed].all()
    tile_m = TILE_SAMPLES * SPACING_M
    is_far = (low_m > edge_x_m + 2 * tile_m) | (high_m < edge_x_m - 2 * tile_m)
    assert not is_fine[is_floor & is_far].any()
    beside = is_floor & (low_m < edge_x_m + SPACING_M) & (high_m > edge_x_m - SPACING_M)
    assert is_fine[beside].all()


def test_a_small_thing_is_fine_as_a_whole_if_any_edge_crosses_it() -> None:
    table_top = Thing("desk", quad((1.0, 1.0, 0.7), (1.6, 0, 0), (0, 0.8, 0)), "grey")
    lamp = replace(table_top, name="shelf", mesh=quad((4.0, 1.0, 0.7), (1.0, 0, 0), (0, 0.4, 0)))
    faces = table(table_top, lamp, roof(-1.0, 1.9))
    parts, is_fine = parts_of(faces)
    of_desk = faces.thing[parts.parent] == 0
    of_shelf = faces.thing[parts.parent] == 1
    assert np.count_nonzero(of_desk) == 2
    assert is_fine[of_desk].all()
    assert not is_fine[of_shelf].any()


def test_without_a_sun_nothing_is_divided() -> None:
    faces = table(FLOOR, roof(-1.0, 2.0))
    everywhere = np.ones(len(faces), bool)
    parts, is_fine = sunlit_parts(faces, everywhere, everywhere, [], np.full(len(faces), SPACING_M))
    assert len(parts.parent) == len(faces)
    assert not is_fine.any()
