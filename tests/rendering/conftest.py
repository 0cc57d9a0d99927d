"""Scenes small enough to light in a test, and a hall of chequers whose corners' places are known."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import scipy

from tests.rendering.rectangles import Rectangle, room
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.atlas import Atlas
from vobench.rendering.baked_scene import BakedScene, Patches
from vobench.rendering.context import create_context
from vobench.rendering.face_parts import FaceParts
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.light import STEADY, Level, PointLight
from vobench.scene.material import Material, reflectance
from vobench.scene.scene import Scene, triangles

EvenLight = Callable[..., BakedScene]
Draw = Callable[[BakedScene], RasterRenderer]


@pytest.fixture(scope="module")
def gl_context() -> Iterator[None]:
    """An OpenGL context that is current during the tests of a file."""
    context = create_context()
    yield
    context.release()


def light_evenly(scene: Scene, *, illuminance_lx: float = 100.0, level: Level = STEADY) -> BakedScene:
    """A scene under the same illuminance everywhere, without a bake, from a lamp that is too weak to count."""
    lamp = PointLight("even", np.zeros(3), 1e-12, level)
    lit = replace(scene, lights=(lamp, *scene.lights))
    faces, count = triangles(lit), len(lit.lights)
    atlas = Atlas(np.full((len(faces), 3, 2), 1.5, np.float32), np.full(len(faces), -1, np.int32), 3, 3)
    direct = np.zeros((count, 3, 3), np.float32)
    direct[0] = illuminance_lx
    middle, dark = np.where(np.arange(9) == 4, 0, -1).astype(np.int32), np.zeros((count, 1, 3), np.float32)
    areas, albedo = areas_m2(faces.corners_m), np.zeros((len(faces), 3))
    for thing, material in enumerate(lit.materials.get(thing.material) for thing in faces.things):
        if material is not None and material.kind == "body":
            albedo[faces.thing == thing] = reflectance(material).mean()
    own = albedo.any(1)
    mean = np.average(albedo[own], 0, areas[own]) if own.any() else np.zeros(3)
    patches = Patches(middle, mean[None].astype(np.float32), np.array([max(areas[own].sum(), 1e-9)], np.float32), dark)
    parts = FaceParts.whole(len(faces))
    spread = scipy.sparse.csr_matrix((9, 1), dtype=np.float32)
    return BakedScene(lit, parts, faces, atlas, direct, dark, spread, patches)


@pytest.fixture(scope="session")
def even_light() -> EvenLight:
    return light_evenly


@pytest.fixture(scope="session")
def draw() -> Iterator[Draw]:
    """Renderers of baked scenes, closed at the end."""
    renderers: list[RasterRenderer] = []

    def of(baked: BakedScene) -> RasterRenderer:
        renderers.append(RasterRenderer(baked))
        return renderers[-1]

    yield of
    for renderer in renderers:
        renderer.close()


@dataclass(frozen=True, slots=True)
class Lattice:
    """Corners (N, 3) of one surface's squares, and the steps (3,) from each to the next."""

    surface: Rectangle
    square_m: float
    corners_m: Array

    @property
    def steps_m(self) -> tuple[Array, Array]:
        width, height = self.surface.size_m
        return self.surface.edge_u_m / width * self.square_m, self.surface.edge_v_m / height * self.square_m


@dataclass(frozen=True, slots=True)
class Hall:
    """A lit room of chequers, 8 × 8 × 3 m: squares of 0.1 m on the floor, of 0.4 m elsewhere."""

    renderer: RasterRenderer
    lattices: tuple[Lattice, ...]

    def picture(self, camera: Camera, T_world_camera: Array) -> Radiance:
        return self.renderer.radiance(camera, single_instant(camera, T_world_camera))

    def corners(self, camera: Camera, T_world_camera: Array, *, apart_px: float = 50) -> list[tuple[Lattice, Array]]:
        """Per surface the corners' pixels (M, 2) by K and the pose: those well inside, with room around, not askew."""
        T_camera_world = se3.inverse(T_world_camera)
        return [(lattice, _in_sight(camera, T_camera_world, lattice, apart_px)) for lattice in self.lattices]


def _in_sight(camera: Camera, T_camera_world: Array, lattice: Lattice, apart_px: float) -> Array:
    def pixels(points_m: Array) -> Array:
        return camera.project(se3.apply(T_camera_world, points_m))

    uv, (along_u, along_v) = pixels(lattice.corners_m), lattice.steps_m
    a, b = pixels(lattice.corners_m + along_u) - uv, pixels(lattice.corners_m + along_v) - uv
    behind = [pixels(lattice.corners_m - step) - uv for step in (along_u, along_v)]
    nearest = np.min([np.linalg.norm(step, axis=1) for step in (a, b, *behind)], 0)
    skew = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    inside = ((uv > 20) & (uv < [camera.width_px - 21, camera.height_px - 21])).all(1)
    return uv[inside & (nearest > apart_px) & (skew > 0.5)]


def _lattice(surface: Rectangle, square_m: float) -> Lattice:
    width, height = surface.size_m
    # Only corners with a whole square on every side.
    u, v = (np.arange(1, int(edge / square_m + 1e-9)) * square_m / edge for edge in (width, height))
    return Lattice(surface, square_m, surface.at(*np.meshgrid(u, v)).reshape(-1, 3))


@pytest.fixture(scope="session")
def hall(draw: Draw) -> Hall:
    fine, coarse = ("checker", 0.5, 0.8, 0.8, 512, 0), ("checker", 0.5, 0.8, 3.2, 1024, 0)
    surfaces = tuple(room((8, 8, 3), floor="fine", wall="coarse", ceiling="coarse"))
    scene = Scene(
        "hall",
        surfaces,
        {"fine": Material(texture=Procedural(*fine)), "coarse": Material(texture=Procedural(*coarse))},
        (),
    )
    lattices = tuple(_lattice(s, 0.1 if s.material == "fine" else 0.4) for s in surfaces)
    return Hall(draw(light_evenly(scene)), lattices)


def find_corners(picture: Radiance, near_px: Array) -> Array:
    """Corners (M, 2) by gradients. Blurred first: on unblurred edges cornerSubPix itself errs by up to 0.15 px."""
    blurred = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 2.0)
    start = near_px.astype(np.float32).reshape(-1, 1, 2).copy()
    found = cv2.cornerSubPix(blurred, start, (11, 11), (-1, -1), (3, 200, 1e-6))
    return np.asarray(found, float).reshape(-1, 2)


@pytest.fixture(scope="session")
def corner_finder() -> Callable[[Radiance, Array], Array]:
    return find_corners


LIMIT_PX = 0.05


def check(error_px: Array, *, at_least: int) -> None:
    """Points where they should be; `pytest -rP` shows the figures."""
    distance = np.linalg.norm(error_px, axis=1)
    figures = {"mean": distance.mean(), "95th percentile": np.percentile(distance, 95), "max": distance.max()}
    print(", ".join(f"{name} {value:.4f} px" for name, value in figures.items()))
    assert len(distance) >= at_least
    assert distance.mean() <= 0.01, figures
    assert figures["95th percentile"] < LIMIT_PX, figures
    assert figures["max"] < 2 * LIMIT_PX, figures


def exact_window(camera: Camera, T_world_camera: Array, lattice: Any, middle: Array, half: int) -> Array:
    """Reflectance of a chequered plane in the pixels around `middle`, each the mean over 8 × 8 cells of it.

    The point in each cell is drawn anew in every pixel: on a regular grid, edges along it would err together.
    """
    steps, cells = np.arange(-half, half + 1), (np.arange(8) + 0.5) / 8 - 0.5
    centres = middle + np.stack(np.meshgrid(steps, steps), -1)
    points = np.stack(np.meshgrid(cells, cells), -1).reshape(-1, 2)
    jitter = np.random.default_rng(0).uniform(-1 / 16, 1 / 16, (*centres.shape[:2], 64, 2))
    rays = camera.rays(centres[..., None, :] + points + jitter) @ T_world_camera[:3, :3].T
    surface, origin = lattice.surface, T_world_camera[:3, 3]
    distance = (surface.corner_m - origin) @ surface.normal / (rays @ surface.normal)
    on_plane = origin + distance[..., None] * rays - surface.corner_m
    squares = sum(np.floor(on_plane @ step / lattice.square_m**2) for step in lattice.steps_m)
    return np.where(squares % 2 == 1, 0.9, 0.1).mean(-1)


def shift_px(seen: Array, exact: Array) -> Array:
    """How far `seen` lies right of and below `exact`: one least-squares step, gain and offset free."""
    seen, exact = (cv2.GaussianBlur(window.astype(float), (0, 0), 2.0)[4:-4, 4:-4] for window in (seen, exact))
    down, right = np.gradient(exact)
    columns = np.stack([right.ravel(), down.ravel(), exact.ravel(), np.ones(exact.size)], -1)
    fit = np.linalg.lstsq(columns, seen.ravel(), rcond=None)[0]
    return -fit[:2] / fit[2]


@pytest.fixture(scope="session")
def measure() -> SimpleNamespace:
    """How far a picture lies from where geometry alone puts it."""
    return SimpleNamespace(LIMIT_PX=LIMIT_PX, check=check, exact_window=exact_window, shift_px=shift_px)
