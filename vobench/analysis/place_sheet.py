"""Draws the contact sheet of a generator: one picture for each seed, in light that is computed coarsely."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np

from vobench import stop
from vobench.analysis.scene_plan import CELL_HEIGHT_PX, CELL_WIDTH_PX, Rgb8, plan
from vobench.analysis.scene_sheet import FONT_SCALE, VIEW_PITCH_DEG, VIEW_WHITE
from vobench.analysis.scene_survey import EYE_HEIGHT_M, SceneSurvey, scene_survey
from vobench.geometry.camera import Pinhole
from vobench.rendering import freed_memory
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.geometry import RayCaster
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Renderer, single_instant
from vobench.runner.store import SILENT, Progress
from vobench.scene.material import srgb
from vobench.scene.triangles import Triangles
from vobench.sequence.picture import write_png
from vobench.suite.scene_build import build_once
from vobench.suite.scene_entry import DRAWN, generated_scene
from vobench.suite.scene_file import read_place
from vobench.suite.scene_spec import SceneFile
from vobench.suite.viewpoint import COARSE_LENS, Viewpoint, around
from vobench.suite.white import fitting_white_cd_m2, look_around

COARSE = BakeSettings(spacing_m=0.06, indirect_spacing_m=0.25, indirect_rays=36)
PLACE_WIDTH_PX = 340  # of the view of a place, which stands beside its plan
PLACE_HEIGHT_PX = 224
PLACE_COLUMNS = 4
GAP_PX = 6
OUTLINE_PX = ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1))  # around a label
WHITE = (255, 255, 255)
BLACK = (0, 0, 0)
PLACE_LENS = Pinhole(PLACE_WIDTH_PX, PLACE_HEIGHT_PX, 190.0, 190.0, 169.5, 111.5)
DIRECTIONS = 16  # in which a view may look


def save_place_sheet(
    scene: str,
    path: Path,
    *,
    seeds: int,
    first_seed: int = 1,
    lighting: str = DRAWN,
    progress: Progress = SILENT,
) -> None:
    """Write a PNG of the places of a scene's generator with a number of seeds.

    Their light is not cached. The memory in use is that of one place, whatever the number of places.

    Raises UnknownNameError if there is no such scene, SuiteError if it has no generator, and MissingDependencyError if
    this machine cannot render.
    """
    first = read_place(scene, seed=first_seed, lighting=lighting)
    places = [generated_scene(first, first_seed + number, lighting) for number in range(seeds)]
    pictures = []
    for place in progress.track(places, f"places of {first.name}", total=seeds):
        stop.check()
        pictures.append(_picture(place))
        freed_memory.collect()
    write_png(path, contact_sheet(pictures))


def _picture(place: SceneFile) -> Rgb8:
    """The picture of one place. Nothing of the place is kept, since 24 places take gigabytes."""
    scene = build_once(place, {})
    baked = bake(scene, COARSE)
    with closing(RasterRenderer(baked)) as renderer:
        return _view_beside_plan(baked, scene_survey(scene), renderer, place.place_name)


def _view_beside_plan(baked: BakedScene, survey: SceneSurvey, renderer: Renderer, label: str) -> Rgb8:
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
    _write_label(picture, label)
    return picture


def _write_label(picture: Rgb8, label: str) -> None:
    """Write white text with a black outline, which is the same text moved by a pixel: thicker text would be longer."""
    left_px = 8
    base_px = PLACE_HEIGHT_PX - 10
    for right_px, down_px in (*OUTLINE_PX, (0, 0)):
        position_px = (left_px + right_px, base_px + down_px)
        colour = WHITE if (right_px, down_px) == (0, 0) else BLACK
        cv2.putText(picture, label, position_px, cv2.FONT_HERSHEY_SIMPLEX, FONT_SCALE, colour, 1, cv2.LINE_AA)


def _widest_view(faces: Triangles, survey: SceneSurvey) -> Viewpoint:
    """The viewpoint from which the surfaces in view are farthest away on average.

    Without a free circle, it is one from around the place.
    """
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
        # Not the median: along a street, few surfaces are far away, and most of what is seen is its ground.
        distance_m = float(np.mean(np.where(hits.face >= 0, hits.distance, 0.0)))
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
