"""The floor plan of a place: cuts of faces by level planes, and what stands on the floor of a scene."""

import numpy as np
import pytest

from vobench.scene.mesh import flat_shaded
from vobench.scene.triangles import Thing, triangle_table
from vobench.suite import floor_outline
from vobench.suite.floor_outline import CUT_HEIGHTS_M, floor_outlines_m, section_m
from vobench.suite.scene_file import read_scene

ROOM = """name: cell
white_cd_m2: 50
materials: {grain: {pattern: plain, albedo: 0.5, resolution_px: 8}}
room: {size_m: [4, 3, 2.5], floor: grain, wall: grain, ceiling: grain}
boxes: [{name: crate, center_m: [1, 0.5, 0.25], size_m: [0.4, 0.6, 0.5], material: grain}]
lamps: [{name: lamp, center_m: [0, 0, 2.4], size_m: [0.4, 0.4], power_lm: 600}]
"""
TETRAHEDRON_M = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [0, 0, 2]])
SIDES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
UV = np.zeros((4, 2))


def faces_of(vertices_m):
    return triangle_table([Thing("it", flat_shaded(vertices_m, SIDES, UV), "grain")], [-1], [-1])


@pytest.mark.parametrize("height_m", [0.25, 1.0, 1.75])
def test_a_cut_of_a_closed_body_is_a_closed_outline_of_the_right_length(height_m):
    segments_m = section_m(faces_of(TETRAHEDRON_M), height_m)
    leg_m = 2 - height_m  # the cut is a right triangle that shrinks with the height
    assert len(segments_m) == 3
    assert np.linalg.norm(segments_m[:, 1] - segments_m[:, 0], axis=1).sum() == pytest.approx(leg_m * (2 + 2**0.5))
    ends = np.rint(segments_m.reshape(-1, 2) * 1e6).astype(int).tolist()
    assert all(ends.count(end) == 2 for end in ends)


def test_nothing_is_cut_above_below_and_at_the_height_of_a_face():
    faces = faces_of(TETRAHEDRON_M)
    assert [len(section_m(faces, height_m)) for height_m in (-0.1, 2.0, 2.1)] == [0, 0, 0]


def test_a_cut_does_not_depend_on_the_order_of_corners():
    turned = [Thing("it", flat_shaded(TETRAHEDRON_M, np.roll(SIDES, 1, axis=1), UV), "grain")]
    usual = section_m(faces_of(TETRAHEDRON_M), 0.5)
    others = section_m(triangle_table(turned, [-1], [-1]), 0.5)
    for segment in usual:
        same = np.isclose(others, segment).all((1, 2)) | np.isclose(others, segment[::-1]).all((1, 2))
        assert same.sum() == 1


@pytest.fixture
def room(tmp_path):
    def read(text=ROOM):
        path = tmp_path / "cell.yaml"
        path.write_text(text)
        return read_scene(path)

    return read


def test_a_room_has_its_walls_at_every_height_and_a_low_crate_only_below_its_top(room):
    outlines_m = floor_outlines_m(room())
    lengths_m = np.linalg.norm(outlines_m[:, 1] - outlines_m[:, 0], axis=1)
    is_crate = np.abs(outlines_m - [1, 0.5]).max((1, 2)) < 0.31
    heights_below_top = sum(height_m < 0.5 for height_m in CUT_HEIGHTS_M)
    assert lengths_m[~is_crate].sum() == pytest.approx(
        2 * (4 + 3) * len(CUT_HEIGHTS_M), rel=0.02
    )  # walls overlap at corners
    assert lengths_m[is_crate].sum() == pytest.approx(2 * (0.4 + 0.6) * heights_below_top, rel=1e-6)


def test_what_moves_is_not_in_the_plan(room):
    mover = """movers: [{name: cart, size_m: [0.5, 0.4, 0.6], material: grain,
  path: [{t_s: 0, position_m: [-1, 0, 0.3]}, {t_s: 2, position_m: [1, 0, 0.3]}]}]
"""
    np.testing.assert_array_equal(floor_outlines_m(room(ROOM + mover)), floor_outlines_m(room()))


def test_a_scene_without_a_floor_has_no_plan(room, monkeypatch):
    monkeypatch.setattr(floor_outline, "floor_height_m", lambda faces: None)
    assert floor_outlines_m(room()).shape == (0, 2, 2)
