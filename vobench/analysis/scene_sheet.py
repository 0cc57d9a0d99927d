"""Draws a picture of a scene: its plan, lines of text, and views from the free circle."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.analysis.scene_survey import EYE_HEIGHT_M, SceneSurvey
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.bake import BakedScene
from vobench.rendering.geometry import RayCaster
from vobench.rendering.renderer import Renderer, single_instant
from vobench.scene.material import reflectance, srgb
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.suite.free_space import downward_directions
from vobench.suite.viewpoint import COARSE_LENS, Viewpoint, around
from vobench.suite.white import fitting_white_cd_m2, look_around

Rgb8 = NDArray[np.uint8]
CELL_WIDTH_PX = 480
CELL_HEIGHT_PX = 320
VIEWS_DEG = (45, 135, 225, 315)  # the yaw of each view
VIEW_PITCH_DEG = 8
VIEW_WHITE = 1.5  # the white of views relative to that of the scene, so views are slightly darker than its images
LENS = Pinhole(CELL_WIDTH_PX, CELL_HEIGHT_PX, 240.0, 240.0, 239.5, 159.5)


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
    free = survey.free_circle
    if free is None or not survey.is_place:
        return around(survey.low_m, survey.high_m, count=len(VIEWS_DEG))
    eye_m = (free.x_m, free.y_m, free.floor_m + EYE_HEIGHT_M)
    return [Viewpoint(eye_m, yaw_deg, VIEW_PITCH_DEG) for yaw_deg in VIEWS_DEG]


def _view(renderer: Renderer, viewpoint: Viewpoint, white_cd_m2: float) -> Rgb8:
    """A view (H, W, 3)."""
    radiance = renderer.radiance(LENS, single_instant(LENS, viewpoint.T_world_camera()), weights=None)
    return srgb(radiance / (VIEW_WHITE * white_cd_m2))


# --- The plan ---

PLAN_MARGIN = 0.96  # of the cell that the plan fills
PLAN_HEIGHT_M = 2.0  # above the floor, where the plan is cut: below lamps and ceilings
MIN_EXTENT_M = 1e-6
TONE_OF_UNKNOWN = 0.9  # reflectance of objects without a material
AMBIENT = 0.35  # brightness of a vertical face relative to a horizontal one
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
        """Positions (N, 2) of pixels (N, 2)."""
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
    """The brightness (N,) of the surfaces below points (N, 3); white if there is none."""
    hits = RayCaster(faces).hits(origins_m, downward_directions(len(origins_m)))
    is_hit = hits.face >= 0
    tone_of_material = {name: reflectance(material).mean() for name, material in scene.materials.items()}
    materials = [thing.material for thing in faces.things]
    tone_of_thing = np.array([tone_of_material.get(name, TONE_OF_UNKNOWN) for name in materials])
    tone = tone_of_thing[faces.thing[hits.face]]
    light = AMBIENT + (1 - AMBIENT) * np.abs(faces.plane[hits.face, 2])
    return np.where(is_hit, tone * light, 1.0)


# --- The sheet of many places ---

PLACE_WIDTH_PX = 340  # of the view of a place, which stands beside its plan
PLACE_HEIGHT_PX = 224
PLACE_COLUMNS = 4
GAP_PX = 6
PLACE_LENS = Pinhole(PLACE_WIDTH_PX, PLACE_HEIGHT_PX, 190.0, 190.0, 169.5, 111.5)
DIRECTIONS = 16  # in which a view may look


def place_picture(baked: BakedScene, survey: SceneSurvey, renderer: Renderer, label: str) -> Rgb8:
    """A view (H, W, 3) of a place from its free circle, in the direction in which most is seen, beside its plan."""
    seen = look_around(baked)
    white_cd_m2 = fitting_white_cd_m2(seen.luminance(), seen.is_source)
    viewpoint = _widest_view(baked.faces, survey)
    radiance = renderer.radiance(PLACE_LENS, single_instant(PLACE_LENS, viewpoint.T_world_camera()), weights=None)
    view = srgb(radiance / (VIEW_WHITE * white_cd_m2))
    whole_plan = plan(baked.scene, survey)
    left_px = (CELL_WIDTH_PX - CELL_HEIGHT_PX) // 2
    square = whole_plan[:, left_px : left_px + CELL_HEIGHT_PX]
    small_plan = cv2.resize(square, (PLACE_HEIGHT_PX, PLACE_HEIGHT_PX), interpolation=cv2.INTER_AREA)
    picture = np.hstack([view, small_plan])
    position_px = (8, PLACE_HEIGHT_PX - 10)
    for colour, width_px in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(picture, label, position_px, cv2.FONT_HERSHEY_SIMPLEX, FONT_SCALE, colour, width_px, cv2.LINE_AA)
    return picture


def _widest_view(faces: Triangles, survey: SceneSurvey) -> Viewpoint:
    """The viewpoint from which the surfaces in view are farthest away; without a free circle, one from around."""
    free = survey.free_circle
    if free is None or not survey.is_place:
        return around(survey.low_m, survey.high_m, count=1)[0]
    eye_m = (free.x_m, free.y_m, free.floor_m + EYE_HEIGHT_M)
    caster = RayCaster(faces)
    best = Viewpoint(eye_m, 0.0, VIEW_PITCH_DEG)
    farthest_m = -1.0
    for yaw_deg in np.linspace(0, 360, DIRECTIONS, endpoint=False).tolist():
        viewpoint = Viewpoint(eye_m, yaw_deg, VIEW_PITCH_DEG)
        rays = viewpoint.rays(COARSE_LENS)
        hits = caster.hits(np.tile(eye_m, (len(rays), 1)), rays)
        distance_m = float(np.median(np.where(hits.face >= 0, hits.distance, 0.0)))
        if distance_m > farthest_m:
            farthest_m = distance_m
            best = viewpoint
    return best


def contact_sheet(pictures: Sequence[Rgb8]) -> Rgb8:
    """Pictures of one size in rows of four, with white gaps between them."""
    margins_px = ((GAP_PX, 0), (GAP_PX, 0), (0, 0))
    framed = [np.pad(picture, margins_px, constant_values=255) for picture in pictures]
    missing = -len(framed) % PLACE_COLUMNS if len(framed) > PLACE_COLUMNS else 0
    framed += [np.full_like(framed[0], 255)] * missing
    columns = min(len(framed), PLACE_COLUMNS)
    rows = [np.hstack(framed[first : first + columns]) for first in range(0, len(framed), columns)]
    return np.vstack(rows)


# --- The text ---

FONT_SCALE = 0.45
TEXT_RGB = (30, 30, 30)
FIRST_LINE_PX = (16, 30)
LINE_HEIGHT_PX = 22


def _text(lines: Sequence[str]) -> Rgb8:
    """A cell (H, W, 3) with lines of text on white."""
    page = np.full((CELL_HEIGHT_PX, CELL_WIDTH_PX, 3), 255, np.uint8)
    left_px, top_px = FIRST_LINE_PX
    for number, line in enumerate(lines):
        position_px = (left_px, top_px + LINE_HEIGHT_PX * number)
        cv2.putText(page, line, position_px, cv2.FONT_HERSHEY_SIMPLEX, FONT_SCALE, TEXT_RGB, 1, cv2.LINE_AA)
    return page
