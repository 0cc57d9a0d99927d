"""Walls: areas less their holes, one texture throughout, laps behind the borders, and reveals that close a hole."""

import numpy as np
import pytest
from trimesh import Trimesh

from vobench.asset import picture
from vobench.asset import wall as walls
from vobench.geometry.se3 import Array


def areas(mesh: Trimesh) -> Array:
    """Area vectors (F, 3)."""
    a, b, c = mesh.triangles.swapaxes(0, 1)
    return np.cross(b - a, c - a) / 2


def test_a_pierced_wall_has_the_area_that_its_holes_leave_and_one_texture_throughout() -> None:
    holes = [(0.5, 1.5, 0.8, 2.0), (2.0, 3.0, 1.0, 2.2)]
    wall = walls.pierced((1, 2, 0), (4, 0, 0), (0, 0, 3), holes)
    on_plane = np.isclose(wall.triangles[:, :, 1], 2).all(axis=1)
    assert np.linalg.norm(areas(wall)[on_plane], axis=1).sum() == pytest.approx(12 - 2.4)
    np.testing.assert_allclose(wall.visual.uv, wall.vertices[:, [0, 2]] - [1, 0], atol=1e-12)


def test_laps_lie_behind_a_wall_and_cross_its_borders() -> None:
    wall = walls.pierced((0, 0, 0), (4, 0, 0), (0, 3, 0))
    laps = wall.vertices[wall.vertices[:, 2] != 0]
    assert set(laps[:, 2].round(9)) == {-walls.LAP_BEHIND_M}
    np.testing.assert_allclose([laps[:, 0].min(), laps[:, 0].max()], [-walls.LAP_M, 4 + walls.LAP_M])
    np.testing.assert_allclose([laps[:, 1].min(), laps[:, 1].max()], [-walls.LAP_M, 3 + walls.LAP_M])


def test_a_reveal_and_its_pane_and_face_enclose_the_hole() -> None:
    hole = (0.5, 1.5, 0.8, 2.0)
    sides = walls.reveal((0, 0, 0), (4, 0, 0), (0, 0, 3), hole, 0.15)
    # Open to the front and back, its area vectors still cancel; its normals look at the middle of the hole.
    np.testing.assert_allclose(areas(sides).sum(axis=0), 0, atol=1e-12)
    inward = np.array([1.0, 0.075, 1.4]) - sides.triangles.mean(axis=1)
    assert (np.einsum("fk,fk->f", inward, areas(sides)) > 0).all()
    assert sides.vertices[:, 1].max() == pytest.approx(0.15)


PLANKS = ((0.1, 0.55), (0.3, 0.9), (0.05, 0.4))  # of a tile of three rows
TILE_M = 1.5


def planked_floor(size_m: tuple[float, float] = (4.0, 2.6), *, seed: int = 0) -> Trimesh:
    width_m, height_m = size_m
    return walls.planked((1, 2, 0), (width_m, 0, 0), (0, height_m, 0), PLANKS, TILE_M, seed=seed)


def visible(floor: Trimesh) -> Array:
    """Which faces are of the floor itself and not of its laps."""
    return np.isclose(floor.triangles[:, :, 2], 0).all(axis=1)


@pytest.mark.parametrize("size_m", [(4.0, 2.6), (0.6, 0.3), (10.0, 5.0)])
def test_a_floor_of_planks_covers_its_rectangle_once(size_m: tuple[float, float]) -> None:
    floor = planked_floor(size_m)
    up_m2 = areas(floor)[visible(floor)]
    assert (up_m2[:, 2] > 0).all()
    assert up_m2[:, 2].sum() == pytest.approx(size_m[0] * size_m[1])
    corners_m = floor.triangles[visible(floor)].reshape(-1, 3)
    np.testing.assert_allclose(corners_m.min(0), [1, 2, 0], atol=1e-12)
    np.testing.assert_allclose(corners_m.max(0), [1 + size_m[0], 2 + size_m[1], 0], atol=1e-12)


def test_planks_meet_without_a_gap_since_each_inner_edge_is_of_two_faces() -> None:
    triangles_m = planked_floor().triangles[visible(planked_floor())]
    keys = np.rint(triangles_m[..., :2] * 1e6).astype(int)
    edges = np.concatenate([keys[:, [0, 1]], keys[:, [1, 2]], keys[:, [2, 0]]])
    count: dict[tuple[tuple[int, int], ...], int] = {}
    for first, second in edges.tolist():
        edge = tuple(sorted([tuple(first), tuple(second)]))
        count[edge] = count.get(edge, 0) + 1
    border = np.rint(np.array([1, 5, 2, 4.6]) * 1e6).astype(int)
    for (first, second), faces in count.items():
        is_on_border = (first[0] == second[0] and first[0] in border[:2]) or (
            first[1] == second[1] and first[1] in border[2:]
        )
        assert faces == (1 if is_on_border else 2)


def test_each_plank_shows_one_plank_of_the_texture_at_its_size() -> None:
    floor = planked_floor()
    row_m = TILE_M / len(PLANKS)
    for face in np.flatnonzero(visible(floor)):
        uv = np.asarray(floor.visual.uv)[floor.faces[face]]
        edges_uv = uv - uv.mean(0)
        edges_m = floor.triangles[face][:, :2] - floor.triangles[face][:, :2].mean(0)
        np.testing.assert_allclose(edges_uv, edges_m, atol=1e-9)
        row = int(uv[:, 1].mean() // row_m)
        assert (uv[:, 1] >= row * row_m - 1e-9).all()
        assert (uv[:, 1] <= (row + 1) * row_m + 1e-9).all()
        cuts_m = np.array(PLANKS[row]) * TILE_M
        begins = [cut for cut in [*cuts_m, *(cuts_m + TILE_M)] if cut <= uv[:, 0].min() + 1e-9]
        ends = [cut for cut in [*cuts_m, *(cuts_m + TILE_M)] if cut >= uv[:, 0].max() - 1e-9]
        assert begins
        assert min(ends) - max(begins) == pytest.approx(np.diff([*cuts_m, cuts_m[0] + TILE_M])[len(begins) - 1])


def test_the_planks_form_no_pattern_that_repeats() -> None:
    """Where a tile would be repeated, the same planks would lie a tile apart."""
    floor = planked_floor((12.0, 6.0))
    faces = np.flatnonzero(visible(floor))
    centres_m = floor.triangles[faces].mean(1)[:, :2]
    uv = np.asarray(floor.visual.uv)[floor.faces[faces]].mean(1)
    offset = (centres_m - uv) / TILE_M
    shifts = np.round(offset % 1, 3)
    assert len(np.unique(shifts[:, 0])) > 20


def test_a_seed_lays_the_same_floor_again_and_another_seed_another_one() -> None:
    np.testing.assert_array_equal(planked_floor().vertices, planked_floor().vertices)
    assert not np.array_equal(planked_floor().visual.uv[:50], planked_floor(seed=1).visual.uv[:50])


def test_painted_boards_know_where_their_planks_are_cut() -> None:
    texture = picture.boards("oak", 1, 256, 2.0, rows=4, joint_m=0.02)
    assert texture is picture.boards("oak", 1, 256, 2.0, rows=4, joint_m=0.02)
    assert len(texture.planks) == 4
    grey = texture.pixels().mean(-1)
    for row, cuts in enumerate(texture.planks):
        rows = grey[64 * row + 8 : 64 * row + 56]
        columns = rows.mean(0)
        for cut in cuts:
            at_cut = int(cut * 256)
            joint = columns[[(at_cut + step) % 256 for step in (-1, 0, 1)]].min()
            assert joint < 0.75 * np.median(columns)
    assert picture.boards("oak", 1, 256).planks == ()
