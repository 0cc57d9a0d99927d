"""Draws a sheet of a scene: its plan, lines of text, and four views."""

from collections.abc import Sequence

import cv2
import numpy as np

from vobench.analysis.scene_plan import CELL_HEIGHT_PX, CELL_WIDTH_PX, Rgb8, plan
from vobench.analysis.scene_survey import EYE_HEIGHT_M, SceneSurvey
from vobench.geometry.camera import Pinhole
from vobench.rendering.renderer import Renderer, single_instant
from vobench.scene.material import srgb
from vobench.scene.scene import Scene
from vobench.suite.viewpoint import Viewpoint, around

VIEWS_DEG = (45, 135, 225, 315)  # the yaw of each view
VIEW_PITCH_DEG = 8
VIEW_WHITE = 1.5  # the white of views relative to that of the scene, so views are slightly darker than its images
LENS = Pinhole(CELL_WIDTH_PX, CELL_HEIGHT_PX, 240.0, 240.0, 239.5, 159.5)

# The lines of text.
FONT_SCALE = 0.45
TEXT_RGB = (30, 30, 30)
FIRST_LINE_PX = (16, 30)
LINE_HEIGHT_PX = 22


def sheet(
    scene: Scene,
    survey: SceneSurvey,
    renderer: Renderer,
    white_cd_m2: float,
    lines: Sequence[str],
) -> Rgb8:
    """Draw a picture (640, 1440, 3): the plan, lines of text, and four views.

    They are in four directions from the free circle, or from around a scene that has none.
    """
    views = [_view(renderer, viewpoint, white_cd_m2) for viewpoint in _viewpoints(survey)]
    upper = np.hstack([plan(scene, survey), views[0], views[1]])
    lower = np.hstack([_text(lines), views[2], views[3]])
    return np.vstack([upper, lower])


def _viewpoints(survey: SceneSurvey) -> list[Viewpoint]:
    """The four viewpoints of a sheet."""
    free = survey.free_circle
    if free is None or not survey.is_place:
        return around(survey.low_m, survey.high_m, count=len(VIEWS_DEG))
    eye_m = (free.x_m, free.y_m, free.floor_m + EYE_HEIGHT_M)
    return [Viewpoint(eye_m, yaw_deg, VIEW_PITCH_DEG) for yaw_deg in VIEWS_DEG]


def _view(renderer: Renderer, viewpoint: Viewpoint, white_cd_m2: float) -> Rgb8:
    """A view (H, W, 3)."""
    radiance = renderer.radiance(LENS, single_instant(LENS, viewpoint.T_world_camera()), weights=None)
    return srgb(radiance / (VIEW_WHITE * white_cd_m2))


def _text(lines: Sequence[str]) -> Rgb8:
    """A cell (H, W, 3) with lines of text on white."""
    page = np.full((CELL_HEIGHT_PX, CELL_WIDTH_PX, 3), 255, np.uint8)
    left_px, top_px = FIRST_LINE_PX
    for number, line in enumerate(lines):
        position_px = (left_px, top_px + LINE_HEIGHT_PX * number)
        cv2.putText(page, line, position_px, cv2.FONT_HERSHEY_SIMPLEX, FONT_SCALE, TEXT_RGB, 1, cv2.LINE_AA)
    return page
