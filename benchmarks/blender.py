"""What a picture costs in Blender Cycles and in the raster engine, and how far each is from the path traced one.

    python benchmarks/blender.py --python PYTHON_WITH_BPY [--samples 1024] [--width 720] [--bakes FOLDER]

The room, all matt, the same poses for all. Error: PSNR against white (a luminance of 1) in linear light over
pixels that are not clipped, the reference's own noise taken out by its two halves as in light.py. The raster
engine's time is that of a picture, its bake (once per scene) apart. bpy is a wheel ("pip install bpy" in an environment
of its own, with the Python that it is made for), is GPL, and is only ever run as a separate process.
"""

import argparse
import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from light import PLACES, decibels, lens, lit, stand

from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.path import PathRenderer
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.material import reflectance
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays
from vobench.scene.scene import Scene
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

# Paths a pixel, and whether Cycles' own Open Image Denoise follows.
WAYS = [(4, True), (16, True), (64, True), (64, False), (256, False)]
POSES = 2


def job(scene: Scene, camera: Pinhole, poses: Sequence[Array]) -> dict[str, Any]:
    """The scene as triangles, tiles and panels, under names that blender_draw.py knows."""
    content: dict[str, Any] = {"poses": np.array(poses), "ways": np.array(WAYS)}
    content["lens"] = [camera.width_px, camera.height_px, camera.fx_px]
    used = list(dict.fromkeys(thing.material for thing in scene.things))
    for name in used:
        material = scene.materials[name]
        content[f"tile.{name}"] = reflectance(material)
        content |= _triangles(name, [as_arrays(t.mesh) for t in scene.things if t.material == name], material.tile_m)
    for panel in scene.panels:
        content[f"luminance.{panel.name}"] = panel.luminance_cd_m2
        content |= _triangles(panel.name, [as_arrays(panel.mesh)], 1.0)
    return content | {"materials": [*used, *(panel.name for panel in scene.panels)]}


def _triangles(name: str, meshes: Sequence[MeshArrays], tile: float) -> dict[str, Any]:
    whole = joined_arrays(meshes)
    return {f"corners.{name}": whole.corners_m, f"uv.{name}": whole.uv[whole.faces] / tile}


def matt(scene: Scene) -> Scene:
    """The scene without mirrors, panes and gloss."""
    bodies = {name: replace(m, eta=1.0) for name, m in scene.materials.items() if m.kind == "body"}
    return replace(scene, materials=bodies, things=tuple(t for t in scene.things if t.material in bodies))


def in_blender(python: str, content: dict[str, Any]) -> tuple[Any, Any]:
    """Pictures (ways, poses, H, W) and seconds (ways, poses) of Cycles."""
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "job.npz"
        made = Path(folder) / "pictures.npz"
        np.savez(given, **content)
        command = [python, str(Path(__file__).with_name("blender_draw.py")), str(given), str(made)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        with np.load(made) as stored:
            return stored["pictures"], stored["seconds"]


def timed(renderer: Any, camera: Pinhole, poses: Sequence[Array]) -> tuple[list[Radiance], float]:
    """Pictures at all poses, and the median seconds of one; a first one warms up."""
    renderer.radiance(camera, single_instant(camera, poses[0], t_ns=1))
    pictures = []
    spent = []
    for pose in poses:
        started = time.perf_counter()
        pictures.append(renderer.radiance(camera, single_instant(camera, pose)))
        spent.append(time.perf_counter() - started)
    return pictures, float(np.median(spent))


def error_db(pictures: Sequence[Radiance], halves: Sequence[Sequence[Radiance]], white: float) -> float:
    """PSNR over all poses, of pixels that the reference does not draw white."""
    errors = []
    for picture, a, b in zip(pictures, *halves, strict=True):
        some = (a + b) / 2 < white
        errors.append(((picture - a) * (picture - b))[some].astype(float) / white**2)
    return decibels(float(np.mean(np.concatenate(errors))))


def main() -> None:
    """Draw the room in all ways, and print time and error of each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", required=True, help="a Python interpreter that can import bpy")
    parser.add_argument("--samples", type=int, default=1024, help="of the reference, both halves together")
    parser.add_argument("--width", type=int, default=720)
    parser.add_argument("--bakes", type=Path)
    arguments = parser.parse_args()
    spec = read_scene(catalog.find("scene", "room").path)
    scene = matt(build(spec, {}))
    camera = lens(arguments.width)
    poses = [stand(*place) for place in PLACES["room"][:POSES]]
    raster = RasterRenderer(lit(scene, arguments.bakes))
    drawn, raster_s = timed(raster, camera, poses)
    raster.close()
    pictures, seconds = in_blender(arguments.python, job(scene, camera, poses))
    tracers = [PathRenderer(scene, samples=arguments.samples // 2, seed=seed, max_depth=None) for seed in (1, 2)]
    views = [single_instant(camera, pose) for pose in poses]

    def traced_by(tracer: PathRenderer) -> list[np.ndarray]:
        return [tracer.radiance(camera, view) for view in views]

    halves = [traced_by(tracer) for tracer in tracers]
    print(f"room, {camera.width_px} x {camera.height_px}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"{'':28}{'s a picture':>12}{'PSNR dB':>9}{'mean / path':>13}{'times raster':>14}")
    traced = np.mean(halves)
    error = error_db(drawn, halves, spec.white_cd_m2)
    ratio = np.mean(drawn) / traced
    print(f"{'raster':28}{raster_s:12.3f}{error:9.1f}{ratio:13.4f}{1:14.1f}")
    for (samples, denoised), own, spent in zip(WAYS, pictures, seconds, strict=True):
        name = f"Cycles {samples:4} samples{', denoised' if denoised else ''}"
        error = error_db(own, halves, spec.white_cd_m2)
        ratio = np.mean(own) / traced
        slower = np.median(spent) / raster_s
        print(f"{name:28}{np.median(spent):12.3f}{error:9.1f}{ratio:13.4f}{slower:14.1f}")


if __name__ == "__main__":
    main()
