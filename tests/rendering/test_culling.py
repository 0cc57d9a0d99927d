"""What is not drawn would not have been seen."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from trimesh import Trimesh

from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.batch import Batch, Geometry, geometry
from vobench.rendering.culling import CullingSet
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import single_instant
from vobench.rendering.view import NEAR_M, PinholeView, Plane, pinhole_view
from vobench.scene.light import Sky
from vobench.scene.material import Material
from vobench.scene.mesh import make_mesh, quad
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing, triangle_table
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
MATERIALS: list[Material] = [Material(texture=Procedural("plain", 0.5, 0, 1, 8, 0)), Material("pane", eta=1.5)]
BOXES = [(0, 180, 0, 120), (0, 180, 40, 48), (60, 120, 20, 50)]
PLACES = np.stack(np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 40)), -1).reshape(-1, 2)


def random_quads(rng: np.random.Generator, count: int) -> tuple[Geometry, Array]:
    """Random parallelograms (count, 4, 3), a batch each, every other a pane, every third on a mover."""
    corner, along, up = rng.normal(0, 3, (count, 3)), *rng.normal(0, 0.7, (2, count, 3))
    materials = {str(i): replace(MATERIALS[i % 2], tint=1 - i / 1e4) for i in range(count)}
    things = [Thing(str(i), quad(corner[i], along[i], up[i]), str(i)) for i in range(count)]
    faces = triangle_table(things, [-1 + (i % 3 == 0) for i in range(count)], [-1] * count)
    drawn = geometry(faces, np.zeros((2 * count, 3, 2), np.float32), materials)
    return drawn, np.stack([corner, corner + along, corner + along + up, corner + up], 1)


def nth_quad(batch: Batch) -> int:
    return round((1 - batch.material.tint) * 1e4)


def shown(batch: Batch, corners: Array, view: PinholeView, box: Any) -> bool:
    """Whether one of many points of a batch, that faces the eye, is in the box."""
    corner, right, _, top = corners
    T = view.pose(batch.mover)
    on = se3.apply(T, corner + PLACES[:, :1] * (right - corner) + PLACES[:, 1:] * (top - corner))
    normal: Array = T[:3, :3] @ np.cross(right - corner, top - corner)
    if not batch.is_pane and normal @ (view.eye_m - on[0]) <= 0:
        return False
    if view.mirror is not None:
        on = on[on @ view.mirror.normal + view.mirror.offset_m > 0]
    seen = se3.apply((se3.inverse(view.T_world_camera) @ view.images), on)
    u, v = CAMERA.project(seen[seen[:, 2] > NEAR_M]).T
    return bool(((u > box[0] - 1) & (u < box[1]) & (v > box[2] - 1) & (v < box[3])).any())


@pytest.mark.parametrize("mirrors", [0, 1, 2])
@pytest.mark.parametrize("box", BOXES)
def test_no_face_that_can_be_seen_is_left_out_and_most_others_are(mirrors: int, box: Any) -> None:
    rng = np.random.default_rng(mirrors)
    drawn, quads = random_quads(rng, 600)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T_mover = se3.transform(se3.rotation_z(1.0), (0.3, 0.2, -0.4))
    view = pinhole_view(
        CAMERA,
        se3.transform(R * np.linalg.det(R), (0.1, 0.2, 0.3)),
        [T_mover],
        np.zeros((0, 4, 4)),
        ambient_cd_m2=np.zeros(3),
    )
    for turn in rng.normal(0, 0.2, (mirrors, 3)):
        towards_camera = turn - (se3.inverse(view.T_world_camera) @ view.images)[2, :3]
        view = view.through(Plane(towards_camera / np.linalg.norm(towards_camera), 2.0), strength=1.0)
    found = set(CullingSet(drawn.clusters).visible(view, box))
    must = {batch.index for batch in drawn.batches if shown(batch, quads[nth_quad(batch)], view, box)}
    assert must <= found
    assert len(must) > 0
    assert len(found) < 2 * len(must) + 15


def test_the_runs_of_visible_clusters_hold_every_face_once() -> None:
    ball = triangle_table([Thing("ball", sphere(60), "body")], [-1], [-1])
    drawn = geometry(ball, np.zeros((len(ball), 3, 2), np.float32), {"body": MATERIALS[0]})
    T = looking(pitch_deg=0, position_m=(-3.0, 0, 0))
    view = pinhole_view(CAMERA, T, [], np.zeros((0, 4, 4)), ambient_cd_m2=np.zeros(3))
    runs = CullingSet(drawn.clusters).visible(view, (0, 180, 0, 120))[0]
    chosen = np.concatenate([np.arange(first, first + count) for first, count in runs])
    assert len(set(chosen.tolist())) == len(chosen) < 0.8 * 3 * len(ball)
    corners = drawn.vertices[drawn.indices.reshape(-1, 3)][..., :3]
    towards = np.einsum("ij,ij->i", np.cross(*np.moveaxis(np.diff(corners, axis=1), 1, 0)), T[:3, 3] - corners[:, 0])
    assert set(np.flatnonzero(towards > 0).tolist()) <= set((chosen // 3).tolist())
    assert len(drawn.vertices) < len(ball)  # corners are shared


def sphere(count: int) -> Trimesh:
    """A ball of radius 1."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * count + 1), np.linspace(0, np.pi, count + 1))
    points = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1).reshape(-1, 3)
    a = (np.arange(count)[:, None] * (2 * count + 1) + np.arange(2 * count)).ravel()
    b = a + 2 * count + 1
    faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)]).astype(np.int32)
    return make_mesh(points, faces, np.stack([u, v], -1).reshape(-1, 2), points)


SCENES = [Path(__file__).parents[2] / "scenes" / name / "scene.yaml" for name in ("office", "room")]
CAMERA_mesh = Pinhole(320, 240, 144.0, 144.0, 159.5, 119.5)
PLAIN = ("plain", 0.5, 0, 1, 8, 0)
SKY_CD_M2 = 1e9  # so bright that one sample of it shows, by way of a mirror too
WHITE_CD_M2 = 240
FRAMES = 24
WINDOWS = """
name: chamber
white_cd_m2: 240
materials:
  plain: {pattern: plain, albedo: 0.5, resolution_px: 8}
  wax: {kind: polished, pattern: plain, albedo: 0.5, resolution_px: 8}
  pane: {kind: glass, eta: 1.5}
room:
  size_m: [4.9, 4.1, 2.65]
  floor: wax
  wall: plain
  ceiling: plain
  windows:
    - {wall: south, center_m: [-0.6, 1.5], size_m: [1.3, 1.1], pane: pane, reveal: plain}
    - {wall: south, center_m: [1.2, 1.6], size_m: [0.7, 1.4], pane: pane, reveal: plain}
    - {wall: east, center_m: [0.3, 1.4], size_m: [1.1, 1.2], pane: pane, reveal: plain}
sky: {illuminance_lx: 9000, kind: clear}
"""


def plainly(material: Material, *, closed: bool, mirrors: bool) -> Material:
    """Without texture and glints, in which single bright pixels are nothing special; panes walled up if `closed`."""
    if material.kind == "pane":
        return Material(texture=Procedural(*PLAIN)) if closed else material
    eta = material.eta if mirrors and material.roughness == 0 else 1.0
    plain = replace(material, texture=Procedural(*PLAIN), emission_texture=None, eta=eta, metal=0.0)
    return plain if material.kind == "body" else material


def scene_in(path: Path, *, closed: bool, mirrors: bool = True) -> Scene:
    scene = build(read_scene(path), {})
    materials = {name: plainly(material, closed=closed, mirrors=mirrors) for name, material in scene.materials.items()}
    lamps = tuple(light for light in scene.lights if not isinstance(light, Sky))
    outside = Sky("outside", np.pi * SKY_CD_M2, "uniform", ground_albedo=1.0)
    # Between the slats of a blind the sky is rightly seen in single pixels.
    things = tuple(thing for thing in scene.things if not thing.name.startswith("blind"))
    return replace(scene, things=things, materials=materials, lights=(*lamps, outside) if closed else scene.lights)


def drive(renderer: RasterRenderer, scene: Scene, *, frames: int = FRAMES) -> Iterator[Array]:
    """Pictures from 1 m above the floor, once around the room, all around and up and down."""
    half_m = np.max([np.abs(thing.mesh.vertices[:, :2]).max(0) for thing in scene.things], axis=0)
    for index in range(frames):
        turn = 2 * np.pi * (index + 0.3) / frames
        at = (*0.62 * half_m * [np.cos(turn), np.sin(turn)], 0)
        camera = looking(pitch_deg=15 * np.sin(1.7 * index), position_m=(0, 0, 1.0))
        T = se3.transform(se3.rotation_z(2.4 * index), at) @ camera
        yield renderer.radiance(CAMERA_mesh, single_instant(CAMERA_mesh, T))


def specks(picture: Array) -> int:
    """Pixels 25 grey levels brighter than all of their eight neighbours, which are within 25 of one another."""
    grey = np.clip(255 / WHITE_CD_M2 * picture, 0, 255).astype(np.float32)
    ring = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)
    brightest, darkest = cv2.dilate(grey, ring), cv2.erode(grey, ring)
    found = (grey > brightest + 25) & (brightest < darkest + 25)
    return int(found[1:-1, 1:-1].sum())  # at the rim, half of the neighbours are not seen


@pytest.fixture(params=[*SCENES, "chamber"], ids=[*(path.parent.name for path in SCENES), "chamber"])
def path(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    if isinstance(request.param, Path):
        return request.param
    path = tmp_path / "chamber.yaml"
    path.write_text(WINDOWS)
    return path


def test_no_sample_sees_the_sky_from_a_room_whose_windows_are_walled_up(path: Path, draw: Any, even_light: Any) -> None:
    scene = scene_in(path, closed=True)
    pictures = list(drive(draw(even_light(scene)), scene))
    assert [int((picture > 1e-4 * SKY_CD_M2).sum()) for picture in pictures] == [0] * FRAMES
    assert all((picture > 0).all() for picture in pictures)


def found_specks(scene: Scene, draw: Any, even_light: Any) -> list[int]:
    return [specks(picture) for picture in drive(draw(even_light(scene, illuminance_lx=300)), scene)]


def test_no_pixel_is_a_bright_speck_on_a_drive_past_all_seams(path: Path, draw: Any, even_light: Any) -> None:
    scene = scene_in(path, closed=False, mirrors=path.stem == "chamber")
    assert found_specks(scene, draw, even_light) == [0] * FRAMES


@pytest.mark.xfail(strict=True, reason="4 pixels of 24 pictures see the sky by way of the floor, at feet of furniture")
def test_no_pixel_of_the_offices_polished_floor_is_a_bright_speck(draw: Any, even_light: Any) -> None:
    (office,) = (path for path in SCENES if path.parent.name == "office")
    assert found_specks(scene_in(office, closed=False), draw, even_light) == [0] * FRAMES


def test_a_speck_is_counted_and_an_edge_is_not() -> None:
    picture = np.full((9, 9), 50.0, np.float32)
    picture[:, 6:] = 150
    assert specks(picture) == 0
    picture[4, 2] = 110
    assert specks(picture) == 1
