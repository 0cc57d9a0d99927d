"""Draws the contact sheet of a generator: one picture for each seed, in light that is computed coarsely."""

from contextlib import closing
from pathlib import Path

from vobench import stop
from vobench.analysis.scene_sheet import Rgb8, contact_sheet, place_picture
from vobench.analysis.scene_survey import scene_survey
from vobench.rendering.bake import BakeSettings, bake
from vobench.rendering.raster import RasterRenderer
from vobench.runner.store import SILENT, Progress
from vobench.sequence.picture import write_png
from vobench.suite.scene_build import build
from vobench.suite.scene_entry import DRAWN, generated_scene
from vobench.suite.scene_file import read_place
from vobench.suite.scene_spec import SceneFile

COARSE = BakeSettings(spacing_m=0.06, light_rays=4, indirect_spacing_m=0.25, indirect_rays=36)


def save_place_sheet(
    scene: str,
    path: Path,
    *,
    seeds: int,
    first_seed: int = 1,
    lighting: str = DRAWN,
    progress: Progress = SILENT,
) -> None:
    """Write a PNG of the places of a scene's generator with a number of seeds. Their light is not cached.

    Raises UnknownNameError if there is no such scene, SuiteError if it has no generator, and MissingDependencyError if
    this machine cannot render.
    """
    first = read_place(scene, seed=first_seed, lighting=lighting)
    places = [generated_scene(first, first_seed + number, lighting) for number in range(seeds)]
    pictures = []
    for place in progress.track(places, f"places of {first.name}", total=seeds):
        stop.check()
        pictures.append(_picture(place))
    write_png(path, contact_sheet(pictures))


def _picture(place: SceneFile) -> Rgb8:
    """The picture of one place."""
    scene = build(place, {})
    baked = bake(scene, COARSE)
    with closing(RasterRenderer(baked)) as renderer:
        return place_picture(baked, scene_survey(scene), renderer, place.place_name)
