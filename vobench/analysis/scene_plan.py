"""Draws the plan of a scene: its surfaces from above, with the largest free circle on its floor."""

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.analysis.scene_survey import SceneSurvey
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.scene.material import reflectance, srgb
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.suite.free_space import downward_directions

Rgb8 = NDArray[np.uint8]
# The size of a plan, and of each other cell of a sheet.
CELL_WIDTH_PX = 480
CELL_HEIGHT_PX = 320
PLAN_MARGIN = 0.96  # the share of the cell that the plan fills
PLAN_HEIGHT_M = 2.0  # the height above the floor at which the plan is cut, below lamps and ceilings
MIN_EXTENT_M = 1e-6
TONE_OF_UNKNOWN = 0.9  # the reflectance of objects without a material
AMBIENT = 0.35  # the brightness of a vertical face relative to a horizontal one
CIRCLE_RGB = (20, 140, 60)
CIRCLE_WIDTH_PX = 2


class _PlanScale:
    """Maps positions in the plane to pixels of the plan."""

    def __init__(self, survey: SceneSurvey) -> None:
        low_m = np.array(survey.low_m[:2])
        high_m = np.array(survey.high_m[:2])
        extent_m = max((high_m - low_m).max(), MIN_EXTENT_M)
        self.px_per_m = min(CELL_WIDTH_PX, CELL_HEIGHT_PX) / extent_m * PLAN_MARGIN
        self._centre_m = (low_m + high_m) / 2
        self._centre_px = np.array([CELL_WIDTH_PX / 2, CELL_HEIGHT_PX / 2])
        self._axes = np.array([1, -1])  # rows of pixels go down

    def positions_m(self, pixels: Array) -> Array:
        """The positions (N, 2) in metres of pixels (N, 2)."""
        from_centre_m = (pixels - self._centre_px) / self.px_per_m * self._axes
        positions_m: Array = from_centre_m + self._centre_m
        return positions_m

    def pixel(self, x_m: float, y_m: float) -> tuple[int, int]:
        """The pixel of a position."""
        from_centre_m = np.array([x_m, y_m]) - self._centre_m
        exact_px = from_centre_m * self._axes * self.px_per_m + self._centre_px
        column, row = np.rint(exact_px).astype(int).tolist()
        return column, row


def plan(scene: Scene, survey: SceneSurvey) -> Rgb8:
    """Draw a scene from above (H, W, 3), cut below lamps and ceilings, with the free circle."""
    faces = triangles(scene, t_ns=0)
    scale = _PlanScale(survey)
    column, row = np.meshgrid(np.arange(CELL_WIDTH_PX), np.arange(CELL_HEIGHT_PX))
    centres_px = np.stack([column, row], -1).reshape(-1, 2).astype(float) + 0.5
    floor_m = survey.free_circle.floor_m if survey.free_circle else survey.low_m[2]
    heights_m = np.full(len(centres_px), floor_m + PLAN_HEIGHT_M)
    origins_m = np.column_stack([scale.positions_m(centres_px), heights_m])

    grey = _shaded(scene, faces, origins_m)
    rgb = srgb(grey[:, None].repeat(3, 1).astype(np.float32))
    picture = rgb.reshape(CELL_HEIGHT_PX, CELL_WIDTH_PX, 3).copy()
    if survey.free_circle:
        centre_px = scale.pixel(survey.free_circle.x_m, survey.free_circle.y_m)
        radius_px = round(survey.free_circle.radius_m * scale.px_per_m)
        cv2.circle(picture, centre_px, radius_px, CIRCLE_RGB, CIRCLE_WIDTH_PX, cv2.LINE_AA)
    return picture


def _shaded(scene: Scene, faces: Triangles, origins_m: Array) -> Array:
    """The brightness (N,) of the surfaces below points (N, 3), from 0 to 1; white without a surface."""
    hits = RayCaster(faces).hits(origins_m, downward_directions(len(origins_m)))
    is_hit = hits.face >= 0
    tone_of_material = {name: reflectance(material).mean() for name, material in scene.materials.items()}
    materials = [thing.material for thing in faces.things]
    tone_of_thing = np.array([tone_of_material.get(name, TONE_OF_UNKNOWN) for name in materials])
    tone = tone_of_thing[faces.thing[hits.face]]
    light = AMBIENT + (1 - AMBIENT) * np.abs(faces.plane[hits.face, 2])
    return np.where(is_hit, tone * light, 1.0)
