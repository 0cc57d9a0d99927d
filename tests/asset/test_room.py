"""Interiors: closed shells, names that seed, and the layouts of the built-in scenes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

import vobench
from vobench.asset.furniture import matt
from vobench.asset.room import FINISHES, KINDS, OUTWARD, Opening, Piece, shell, things
from vobench.geometry.triangle import face_normals
from vobench.scene.mesh import joined

SCENES = Path(vobench.__file__).parents[1] / "scenes"
WHITE = matt()
WINDOWS = (Opening("south", (-1.0, 1.6), (1.8, 1.5)), Opening("east", (1.0, 1.4), (2.0, 1.0), 0.3))


def pieces(scene: str) -> list[Piece]:
    (layout,) = (SCENES / scene).glob("*.yaml")
    rows: list[dict[str, Any]] = YAML(typ="safe").load(layout)["furniture"]
    return [Piece(**{key: tuple(value) if key == "at_m" else value for key, value in row.items()}) for row in rows]


def bare(openings: tuple[Opening, ...] = ()) -> dict[str, Any]:
    walls = dict.fromkeys(OUTWARD, WHITE)
    return dict(shell((6.0, 4.0, 3.0), openings, floor=WHITE, ceiling=WHITE, walls=walls))


def test_a_shell_faces_its_inside_and_encloses_its_volume() -> None:
    mesh = joined([part.mesh for parts in bare().values() for part in parts])
    c = mesh.triangles
    # The laps lie behind the faces.
    on_face = (np.isclose(np.abs(c - [0, 0, 1.5]), [3, 2, 1.5], atol=1e-9).all(axis=1)).any(axis=1)
    area = np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0])[on_face] / 2
    assert len(c) - on_face.sum() == 6 * 8
    assert np.einsum("fk,fk->", area, c[on_face].mean(axis=1)) / 3 == pytest.approx(-72)


def test_no_ray_from_inside_leaves_a_room_through_its_joints() -> None:
    embree = pytest.importorskip("embreex.mesh_construction")
    scenes = pytest.importorskip("embreex.rtcore_scene")
    mesh = joined([part.mesh for parts in bare().values() for part in parts])
    scene = scenes.EmbreeScene()
    embree.TriangleMesh(scene, mesh.triangles.astype(np.float32))
    along = np.random.default_rng(0).uniform(-1, 1, (20000, 1))
    edges = [np.array([3 * s, 0, 1.5 + 1.5 * t]) + along[:5000] * [0, 2, 0] for s in (-1, 1) for t in (-1, 1)]
    target = np.concatenate([*edges, [3, 2, 1.5] + along * [0, 0, 1.5]])
    origin = np.random.default_rng(1).uniform([-2.9, -1.9, 0.1], [2.9, 1.9, 2.9], target.shape)
    hit = scene.run(origin.astype(np.float32), (target - origin).astype(np.float32))
    assert (hit >= 0).all()


def test_a_window_lies_where_its_opening_says_and_its_pane_looks_in() -> None:
    window = bare(WINDOWS)
    for k, outward in ((0, [0, -1, 0]), (1, [1, 0, 0])):
        _, pane = window[f"window_{k}"]
        np.testing.assert_allclose(face_normals(pane.mesh.triangles), -np.tile(outward, (2, 1)), atol=1e-12)
    np.testing.assert_allclose(window["window_0"][1].mesh.vertices.mean(axis=0), [-1.0, -2.15, 1.6])
    np.testing.assert_allclose(window["window_1"][1].mesh.vertices.mean(axis=0), [3.3, 1.0, 1.4])


def test_adding_an_instance_changes_no_other_one() -> None:
    desk, shelf = Piece("desk", "desk", (0, 0, 0)), Piece("shelf", "shelf", (1, 2, 0), 30.0)
    few, _ = things(piece.build(5) for piece in (desk, shelf))
    more, _ = things(piece.build(5) for piece in (desk, Piece("mug", "mug", (0, 0, 0.74)), shelf))
    kept = [thing for thing in more if thing.name != "mug"]
    for one, other in zip(few, kept, strict=True):
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
        assert one.mesh.visual.uv.tobytes() == other.mesh.visual.uv.tobytes()


def test_two_names_and_two_seeds_make_different_shelves() -> None:
    made = [Piece("shelf", name, (0, 0, 0)).build(seed)[1][-1].mesh for name, seed in (("a", 0), ("b", 0), ("a", 1))]
    assert len({mesh.vertices.tobytes() for mesh in made}) == 3


def test_things_of_one_material_share_its_name_and_every_name_has_a_material() -> None:
    found, materials = things(Piece("desk", name, (0, 0, 0)).build() for name in ("one", "two"))
    assert {thing.material for thing in found} == set(materials)
    assert {thing.material for thing in found if thing.name == "two"} <= {f"one.{k}" for k in range(9)}


@pytest.mark.parametrize("name", FINISHES)
def test_a_finish_is_a_material(name: str) -> None:
    assert FINISHES[name]().kind in ("body", "mirror", "pane")


@pytest.mark.parametrize("scene", ["office", "room"])
def test_a_layout_names_each_piece_once_and_knows_its_kind(scene: str) -> None:
    names = [piece.name for piece in pieces(scene)]
    assert len(set(names)) == len(names)
    assert {piece.kind for piece in pieces(scene)} <= set(KINDS)


@pytest.mark.parametrize(("scene", "half_m"), [("office", (6.0, 4.5)), ("room", (5.0, 5.0))])
def test_what_drives_meets_nothing_and_nothing_stands_in_a_wall(scene: str, half_m: tuple[float, float]) -> None:
    for piece in pieces(scene):
        points = np.concatenate([part.mesh.vertices for part in piece.build()[1]])
        is_low = points[:, 2] < 1.5
        in_way = (points[:, :2] > -1.5).all(axis=1) & (points[:, 0] < 2.3) & (points[:, 1] < 2.05) & is_low
        assert not in_way.any(), piece.name
        if not piece.name.startswith(("window_frame", "blind", "sill")):
            assert (np.abs(points[:, :2]) <= np.array(half_m) + 0.001).all(), piece.name
