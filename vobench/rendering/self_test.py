"""Draws a small picture as a run does, and compares it with the one expected by geometry and photometry."""

import json
import sys
from dataclasses import asdict, dataclass

import numpy as np

from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.bake import BakeSettings, bake
from vobench.rendering.context import DriverFacts, devices, driver_facts
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.mesh import quad
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing

CAMERA = Pinhole(96, 64, 80.0, 80.0, 47.5, 31.5)
CAMERA_M = (0.1, -0.05, 0.8)
FLOOR_M = 0.7
REFLECTANCE = (0.6, 0.3, 0.15)
LAMP_M = (0.2, 0.1, 1.5)
LAMP_CD = 100.0
# Light is computed every 2 cm and interpolated, which costs 0.02 %.
TOLERANCE = 0.005
EDGE_PX = 1.5  # a pixel nearer to the floor's edge than this shows both
DOWN = se3.transform(np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]), CAMERA_M)


@dataclass(frozen=True, slots=True)
class DrawingCheck:
    """How far a picture is from the expected one: the largest relative error on the floor, the most light beside it.

    `well`: whether both are within the tolerance.
    """

    well: bool
    largest_error: float
    stray_cd_m2: float
    driver: DriverFacts
    devices: tuple[str, ...]


def check_drawing() -> DrawingCheck:
    """Draw a plain floor under a small lamp, from above, and compare.

    Raises MissingDependencyError where this machine cannot draw.
    """
    facts = driver_facts()
    picture = _drawn()
    expected, is_floor, is_beside = _expected()
    errors = np.abs(picture[is_floor] / expected[is_floor] - 1)
    stray_cd_m2 = float(np.abs(picture[is_beside]).max())
    largest_error = float(errors.max())
    well = bool(np.isfinite(picture).all()) and largest_error < TOLERANCE and stray_cd_m2 == 0
    return DrawingCheck(well, largest_error, stray_cd_m2, facts, tuple(map(str, devices())))


def _drawn() -> Radiance:
    """The picture (H, W, 3) in cd/m², by the raster engine."""
    half_m = FLOOR_M / 2
    floor = quad((-half_m, -half_m, 0), (FLOOR_M, 0, 0), (0, FLOOR_M, 0))
    lamp = PointLight("lamp", np.array(LAMP_M), 4 * np.pi * LAMP_CD)
    scene = Scene("self-test", (Thing("floor", floor, "paint"),), {"paint": Material(colour=REFLECTANCE)}, (lamp,))
    settings = BakeSettings(
        spacing_m=0.02,
        light_rays=1,
        indirect_spacing_m=1.0,
        indirect_rays=1,
        bounces=0,
    )
    renderer = RasterRenderer(bake(scene, settings))
    try:
        return renderer.radiance(CAMERA, single_instant(CAMERA, DOWN), weights=None)
    finally:
        renderer.close()


def _expected() -> tuple[Array, Array, Array]:
    """Radiance (H, W, 3) in cd/m², and which pixels (H, W) are wholly on the floor, and wholly beside it."""
    rays = CAMERA.rays(pixel_grid(CAMERA)) @ DOWN[:3, :3].T
    lengths = CAMERA_M[2] / -rays[..., 2:]
    points_m = np.array(CAMERA_M) + rays * lengths
    towards_lamp = np.array(LAMP_M) - points_m
    distance_m = np.linalg.norm(towards_lamp, axis=-1)
    illuminance_lx = LAMP_CD * towards_lamp[..., 2] / distance_m**3
    radiance = illuminance_lx[..., None] * np.array(REFLECTANCE) / np.pi

    inwards_m = FLOOR_M / 2 - np.abs(points_m[..., :2]).max(-1)
    edge_m = EDGE_PX * CAMERA_M[2] / CAMERA.fx_px
    return radiance, inwards_m > edge_m, inwards_m < -edge_m


def main() -> None:
    """Print the check as one JSON object, or what this machine lacks: {"error": sentence}."""
    try:
        result = asdict(check_drawing())
    except VobenchError as error:
        result = {"error": str(error)}
    except Exception as error:  # a driver may fail with anything
        reason = " ".join(str(error).split())
        result = {"error": f"{type(error).__name__}: {reason[:300]}"}
    json.dump(result, sys.stdout)


if __name__ == "__main__":
    main()
