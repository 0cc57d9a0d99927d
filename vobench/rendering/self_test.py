"""Draws a small picture as a run does, and compares it with the one expected by geometry and photometry."""

import json
import sys
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.context import DriverFacts, driver_facts
from vobench.rendering.egl_device import devices
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.mesh import quad
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing

if TYPE_CHECKING:
    from trimesh import Trimesh

CAMERA = Pinhole(96, 64, 80.0, 80.0, 47.5, 31.5)
CAMERA_M = (0.1, -0.05, 0.8)
FLOOR_M = 0.7
# A pane over one corner of the floor, and a board above it, which the pane must not be drawn over.
PANE_LOW_M = (-0.30, -0.30, 0.1)
PANE_M = 0.25
BOARD_LOW_M = (-0.22, -0.22, 0.2)
BOARD_M = 0.1
REFLECTANCE = (0.6, 0.3, 0.15)
LAMP_M = (0.2, 0.1, 1.5)
LAMP_CD = 100.0
# Light is computed every 2 cm and interpolated, which costs 0.02 %.
TOLERANCE = 0.005
EDGE_PX = 1.5  # a pixel nearer to an edge than this shows both sides of it
PANE_MARGIN_M = 0.02  # around the pane, where light passes it before it falls on the floor
Mask = NDArray[np.bool_]
DOWN = se3.transform(np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]), CAMERA_M)


@dataclass(frozen=True, slots=True)
class DrawingCheck:
    """How far a picture is from the expected one.

    largest_error: the largest relative error on the floor and on the board. stray_cd_m2: the most light beside the
    floor, where nothing is. `well`: whether both are within the tolerance.
    """

    well: bool
    largest_error: float
    stray_cd_m2: float
    driver: DriverFacts
    devices: tuple[str, ...]


def check_drawing() -> DrawingCheck:
    """Draw a floor, a pane and a board under a small lamp, from above, and compare.

    The pane checks that drivers test the depth of what they blend: one was seen to draw panes over what hides them.
    Raises MissingDependencyError where this machine cannot draw.
    """
    facts = driver_facts()
    picture = _drawn()
    expected, is_known, is_beside = _expected()
    errors = np.abs(picture[is_known] / expected[is_known] - 1)
    stray_cd_m2 = float(np.abs(picture[is_beside]).max())
    largest_error = float(errors.max())
    well = bool(np.isfinite(picture).all()) and largest_error < TOLERANCE and stray_cd_m2 == 0
    return DrawingCheck(well, largest_error, stray_cd_m2, facts, tuple(map(str, devices())))


def _drawn() -> Radiance:
    """The picture (H, W, 3) in cd/m², by the raster engine."""
    half_m = FLOOR_M / 2
    things = (
        Thing("floor", _square((-half_m, -half_m, 0.0), FLOOR_M), "paint"),
        Thing("pane", _square(PANE_LOW_M, PANE_M), "glass"),
        Thing("board", _square(BOARD_LOW_M, BOARD_M), "paint"),
    )
    materials = {"paint": Material(colour=REFLECTANCE), "glass": Material(kind="pane", eta=1.5)}
    lamp = PointLight("lamp", np.array(LAMP_M), 4 * np.pi * LAMP_CD)
    scene = Scene("self-test", things, materials, (lamp,))
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


def _square(low_m: tuple[float, float, float], side_m: float) -> "Trimesh":
    """A level square that faces up."""
    return quad(low_m, (side_m, 0, 0), (0, side_m, 0))


def _expected() -> tuple[Array, Mask, Mask]:
    """Radiance (H, W, 3) in cd/m², and which pixels (H, W) show it, and which are wholly beside the floor.

    The radiance is known where a pixel is wholly on the board, or wholly on the floor and away from the pane.
    """
    half_m = FLOOR_M / 2
    floor, floor_inside_m = _level_square((-half_m, -half_m, 0.0), FLOOR_M)
    board, board_inside_m = _level_square(BOARD_LOW_M, BOARD_M)
    _, pane_inside_m = _level_square(PANE_LOW_M, PANE_M)

    edge_m = EDGE_PX * CAMERA_M[2] / CAMERA.fx_px
    is_board = board_inside_m > edge_m
    is_floor = (floor_inside_m > edge_m) & (pane_inside_m < -PANE_MARGIN_M)
    is_beside = (floor_inside_m < -edge_m) & (pane_inside_m < -PANE_MARGIN_M)
    radiance = np.where(is_board[..., None], board, floor)
    return radiance, is_board | is_floor, is_beside


def _level_square(low_m: tuple[float, float, float], side_m: float) -> tuple[Array, Array]:
    """Radiance (H, W, 3) in cd/m² of a square's plane, and how far inside the square (H, W) each pixel's ray meets it.

    The distance is to the nearest side, in metres; it is negative outside.
    """
    rays = CAMERA.rays(pixel_grid(CAMERA)) @ DOWN[:3, :3].T
    lengths = (CAMERA_M[2] - low_m[2]) / -rays[..., 2:]
    points_m = np.array(CAMERA_M) + rays * lengths
    towards_lamp = np.array(LAMP_M) - points_m
    distance_m = np.linalg.norm(towards_lamp, axis=-1)
    illuminance_lx = LAMP_CD * towards_lamp[..., 2] / distance_m**3
    radiance = illuminance_lx[..., None] * np.array(REFLECTANCE) / np.pi

    centre_m = np.array(low_m[:2]) + side_m / 2
    inside_m = side_m / 2 - np.abs(points_m[..., :2] - centre_m).max(-1)
    return radiance, inside_m


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
