"""How models that nobody here made are exposed: a table of saturated and black pixels along the free path.

    python benchmarks/foreign.py FOLDER [--out PICTURES] [--coarse]

For every .glb, .gltf and .obj below FOLDER: whether it can be read, its faces, its lights, its white, and the shares of
pixels at 255 and at 16 or less in drawn pictures along its free path, or around it if it is an object. With --out, a
sheet with a plan, four views and two of these pictures is written for each model.
"""

import argparse
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.scene_report import SceneReport, survey_scene
from vobench.analysis.scene_sheet import sheet
from vobench.errors import VobenchError
from vobench.geometry.camera import Pinhole
from vobench.geometry.triangle import areas_m2
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.geometry import RayCaster
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import single_instant
from vobench.scene.light import Sky, Sun
from vobench.scene.material import LUMINANCE, srgb
from vobench.scene.scene import Scene, triangles
from vobench.sequence.picture import write_png
from vobench.suite.viewpoint import viewpoints
from vobench.suite.white import SATURATED, ExposedShares, exposed_shares, fitting_white_cd_m2, look_around

SUFFIXES = (".glb", ".gltf", ".obj")
COARSE = BakeSettings(spacing_m=0.05, light_rays=4, indirect_spacing_m=0.2, indirect_rays=16)
COARSE_SAMPLES = 200_000  # of light, about
LENS = Pinhole(240, 160, 120.0, 120.0, 119.5, 79.5)
SHOWN = 4  # pictures of each model on its sheet
MOST_SATURATED = 0.1
MOST_BLACK = 0.2


@dataclass(frozen=True, slots=True)
class Result:
    """A model's name, why it could not be drawn, and otherwise how it is exposed."""

    name: str
    failure: str = ""
    kind: str = ""
    faces: int = 0
    lights: str = ""
    white_cd_m2: float = 0.0
    shares: ExposedShares | None = None
    seconds: float = 0.0

    def row(self) -> str:
        """The row of the table."""
        if self.shares is None:
            return f"| {self.name} | {self.failure} | | | | | | |"
        is_good = self.shares.saturated <= MOST_SATURATED and self.shares.black <= MOST_BLACK
        percent = f"{self.shares.saturated:.1%} | {self.shares.black:.1%}"
        verdict = "yes" if is_good else "NO"
        columns = [self.name, self.kind, f"{self.faces:,}", self.lights, f"{self.white_cd_m2:g}", percent]
        return f"| {' | '.join(columns)} | {verdict} | {self.seconds:.0f} |"


def models(folder: Path) -> list[Path]:
    """All models below a folder."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES)


def coarse_settings(scene: Scene) -> BakeSettings:
    """Settings that take seconds for any scene, however large."""
    area_m2 = float(areas_m2(triangles(scene).corners_m).sum())
    spacing_m = max(COARSE.spacing_m, float(np.sqrt(area_m2 / COARSE_SAMPLES)))
    return replace(COARSE, spacing_m=spacing_m, indirect_spacing_m=4 * spacing_m)


def examine(path: Path, out: Path | None, *, is_coarse: bool) -> Result:
    """Bake a model and draw it from its viewpoints."""
    began_s = time.monotonic()
    try:
        report = survey_scene(str(path))
    except VobenchError as error:
        return Result(path.name, f"{error}")
    settings = coarse_settings(report.scene) if is_coarse else BakeSettings()
    baked = bake(report.scene, settings)
    seen = look_around(baked)
    white_cd_m2 = fitting_white_cd_m2(seen.luminance(report.scene.lights), seen.is_source)
    with closing(RasterRenderer(baked)) as renderer:
        pictures = [*_pictures(baked, renderer)]
        if out:
            _write_sheet(out / f"{path.stem}.png", report, renderer, pictures, white_cd_m2)
    luminance_cd_m2 = np.stack(pictures) @ np.array(LUMINANCE)
    is_daylit = any(isinstance(light, Sun | Sky) for light in report.scene.lights)
    return Result(
        path.name,
        kind="place" if report.survey.is_place else "object",
        faces=report.survey.face_count,
        lights=f"{len(report.scene.lights)}{', daylight' if is_daylit else ''}",
        white_cd_m2=white_cd_m2,
        shares=exposed_shares(luminance_cd_m2, white_cd_m2),
        seconds=time.monotonic() - began_s,
    )


def _pictures(baked: BakedScene, renderer: RasterRenderer) -> Iterator[NDArray[np.float32]]:
    """Pictures (H, W, 3) from all viewpoints of a scene."""
    for viewpoint in viewpoints(baked.faces, RayCaster(baked.faces)):
        yield renderer.radiance(LENS, single_instant(LENS, viewpoint.T_world_camera()), weights=None)


def _write_sheet(
    path: Path,
    report: SceneReport,
    renderer: RasterRenderer,
    pictures: list[NDArray[np.float32]],
    white_cd_m2: float,
) -> None:
    overview = sheet(report.scene, report.survey, renderer, white_cd_m2, report.lines())
    step = len(pictures) // SHOWN
    shown = [srgb(picture / (SATURATED * white_cd_m2)) for picture in pictures[::step][:SHOWN]]
    strip = np.hstack(shown)
    margin = np.full((strip.shape[0], overview.shape[1] - strip.shape[1], 3), 255, np.uint8)
    write_png(path, np.vstack([overview, np.hstack([strip, margin])]))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, help="write a sheet of images for each model into this folder")
    parser.add_argument("--coarse", action="store_true", help="bake with coarser light, in less time")
    arguments = parser.parse_args()
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
    print("| model | kind | faces | lights | white, cd/m² | saturated | black | good | s |")
    print("|---|---|---|---|---|---|---|---|---|")
    for path in models(arguments.folder):
        print(examine(path, arguments.out, is_coarse=arguments.coarse).row(), flush=True)


if __name__ == "__main__":
    main()
