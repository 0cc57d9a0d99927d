"""Sites: level areas, footprints, and polygons that overlap."""

import numpy as np
import pytest

from vobench.asset.furniture import Part, matt, stood
from vobench.asset.shape import at
from vobench.asset.site import Area, LevelAreas, SitePiece, footprint, has_overlap, overlap_m, polygon_area_m2
from vobench.geometry.se3 import Array

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


def shifted(x_m: float, y_m: float, corners_m: Array = SQUARE) -> Array:
    return corners_m + np.array([x_m, y_m])


def box(name: str, x_m: float, z_m: float = 0.0, high_m: float = 1.0) -> SitePiece:
    parts: list[Part] = [stood((1.0, 1.0, high_m), matt(), x_m, 0, z_m, bevel=0)]
    return SitePiece(name, tuple(parts), 0.1)


def test_the_area_of_a_polygon_does_not_depend_on_its_orientation() -> None:
    assert polygon_area_m2(SQUARE) == pytest.approx(4.0)
    assert polygon_area_m2(SQUARE[::-1]) == pytest.approx(4.0)


def test_polygons_overlap_by_the_least_shift_that_parts_them() -> None:
    assert overlap_m(SQUARE, shifted(1.5, 0.3)) == pytest.approx(0.5)
    assert overlap_m(SQUARE, shifted(2.5, 0.0)) == pytest.approx(-0.5)
    turn = at(yaw=45)[:2, :2]
    diamond = shifted(2 + np.sqrt(2) - 0.1, 1.0, (SQUARE - 1) @ turn.T)
    assert overlap_m(SQUARE, diamond) == pytest.approx(0.1)


def test_touching_polygons_do_not_overlap() -> None:
    assert not has_overlap([SQUARE, shifted(2.0, 0.0)], 1e-9)
    assert has_overlap([SQUARE, shifted(5.0, 0.0), shifted(1.0, 0.0)], 1e-9)


def test_the_first_of_overlapping_areas_counts() -> None:
    ground = LevelAreas((Area(SQUARE, 0.0), Area(shifted(1.0, 0.0), 0.12)))
    heights_m = ground.heights_m(np.array([[0.5, 1.0], [1.5, 1.0], [2.5, 1.0], [9.0, 9.0]]))
    np.testing.assert_array_equal(heights_m, [0.0, 0.0, 0.12, np.nan])


def test_pieces_meet_only_at_the_same_height() -> None:
    one = footprint(box("one", 0.0))
    assert one.overlap_depth_m(footprint(box("beside", 0.9)), 0.01) == pytest.approx(0.1)
    assert one.overlap_depth_m(footprint(box("on top", 0.0, z_m=1.0)), 0.01) == 0
    assert one.overlap_depth_m(footprint(box("apart", 1.2)), 0.01) == 0


def test_what_is_above_a_body_is_in_nobodys_way() -> None:
    crown = stood((4.0, 4.0, 1.0), matt(), 0, 0, 3.0, bevel=0)
    trunk = stood((0.3, 0.3, 3.0), matt(), 0, 0, 0, bevel=0)
    tree = footprint(SitePiece("tree", (trunk, crown), 0.5))
    np.testing.assert_allclose(np.ptp(tree.corners_m, axis=0), [0.3, 0.3])
