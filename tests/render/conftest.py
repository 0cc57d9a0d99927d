"""Scenes small enough to light in a test, and a hall of chequers whose corners' places are known."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene
from vobench.render.geometry import all_surfaces
from vobench.render.lightmap import layout
from vobench.render.raster import RasterRenderer
from vobench.render.renderer import Radiance
from vobench.scene.scene import Scene, Surface, room
from vobench.scene.texture import Texture, reflectance

EvenLight = Callable[..., BakedScene]
Draw = Callable[[BakedScene], RasterRenderer]


def light_evenly(scene: Scene, *, illuminance_lx: float = 100.0) -> BakedScene:
    """A scene under the same illuminance everywhere, without a bake."""
    where = layout(all_surfaces(scene), spacing_m=1.0)
    light = np.full((where.height, where.width), illuminance_lx, np.float32)
    return BakedScene(scene, where, light, {name: reflectance(t) for name, t in scene.textures.items()})


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

    surface: Surface
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

    def corners(self, camera: Pinhole, T_world_camera: Array, *, apart_px: float = 50) -> list[tuple[Lattice, Array]]:
        """Per surface the corners' pixels (M, 2) by K and the pose: those well inside, with room around, not askew."""
        T_camera_world = se3.inverse(T_world_camera)
        return [(lattice, _in_sight(camera, T_camera_world, lattice, apart_px)) for lattice in self.lattices]


def _in_sight(camera: Pinhole, T_camera_world: Array, lattice: Lattice, apart_px: float) -> Array:
    def pixels(points_m: Array) -> Array:
        return camera.project(se3.apply(T_camera_world, points_m))

    uv, (along_u, along_v) = pixels(lattice.corners_m), lattice.steps_m
    a, b = pixels(lattice.corners_m + along_u) - uv, pixels(lattice.corners_m + along_v) - uv
    behind = [pixels(lattice.corners_m - step) - uv for step in (along_u, along_v)]
    nearest = np.min([np.linalg.norm(step, axis=1) for step in (a, b, *behind)], 0)
    skew = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)
    inside = ((uv > 20) & (uv < [camera.width_px - 21, camera.height_px - 21])).all(1)
    return uv[inside & (nearest > apart_px) & (skew > 0.5)]


def _lattice(surface: Surface, square_m: float) -> Lattice:
    width, height = surface.size_m
    # Only corners with a whole square on every side.
    u, v = (np.arange(1, int(edge / square_m + 1e-9)) * square_m / edge for edge in (width, height))
    return Lattice(surface, square_m, surface.at(*np.meshgrid(u, v)).reshape(-1, 3))


@pytest.fixture(scope="session")
def hall(draw: Draw) -> Hall:
    fine, coarse = Texture("checker", 0.5, 0.8, 0.8, 512, 0), Texture("checker", 0.5, 0.8, 3.2, 1024, 0)
    surfaces = tuple(room((8, 8, 3), floor="fine", wall="coarse", ceiling="coarse"))
    scene = Scene("hall", surfaces, {"fine": fine, "coarse": coarse}, ())
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
