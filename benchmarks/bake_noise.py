"""How much noise a bake leaves in pictures: the default one against one of another seed and with many more rays.

    python benchmarks/bake_noise.py [car_park ramp ...] [--rays 16] [--width 320]

Three views a place, from the middle of its largest free circle, 0.4 m above the floor. Of the ratio of luminances,
over all pixels that a camera would not clip, the mean, the standard deviation, and the 1st and 99th percentile.
Pixels darker than 1/50 of white, which the noise of an image sensor hides, are compared with 1/50 of white. The
noise that the default bake states for itself and its CPU time follow.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.geometry import RayCaster
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.scene import Scene, triangles
from vobench.suite import catalog
from vobench.suite.free_space import largest_free_circle
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

PLACES = ("room", "office", "flat", "hall", "corridor", "warehouse", "ramp", "car_park", "street", "park")
HEADINGS_DEG = (0.0, 120.0, 240.0)
CAMERA_HEIGHT_M = 0.4
DARKEST = 1 / 50  # of white


def poses(scene: Scene) -> list[Array]:
    """T_world_camera of the views."""
    faces = triangles(scene, t_ns=0)
    free = largest_free_circle(faces, RayCaster(faces))
    if free is None:
        raise SystemExit(f"{scene.name} has no free floor")
    result = []
    for heading_deg in HEADINGS_DEG:
        rotation = se3.rotation_z(np.deg2rad(heading_deg))
        T_world_body = se3.transform(rotation, [free.x_m, free.y_m, free.floor_m])
        result.append(T_world_body @ looking(pitch_deg=0.0, position_m=(0.0, 0.0, CAMERA_HEIGHT_M)))
    return result


def pictures(baked: BakedScene, white_cd_m2: float, camera: Pinhole) -> Iterator[Radiance]:
    """What a bake shows, in units of white."""
    renderer = RasterRenderer(baked)
    for T_world_camera in poses(baked.scene):
        yield renderer.radiance(camera, single_instant(camera, T_world_camera)) / white_cd_m2
    renderer.close()


def report(name: str, rays: int, camera: Pinhole) -> None:
    """Print a line for each view of a place."""
    spec = read_scene(catalog.find("scene", name).path)
    scene = build(spec, {})
    started_s = time.process_time()
    baked = bake(scene, BakeSettings())
    cpu_s = time.process_time() - started_s
    default = BakeSettings()
    many = replace(
        default,
        seed=1,
        light_rays=rays * default.light_rays,
        indirect_rays=rays * default.indirect_rays,
        light_noise=default.light_noise / np.sqrt(rays),
    )
    reference = bake(scene, many)
    pairs = zip(pictures(baked, spec.white_cd_m2, camera), pictures(reference, spec.white_cd_m2, camera), strict=True)
    for view, (picture, expected) in enumerate(pairs):
        is_clear = (picture < 1) & (expected < 1)
        ratio = 1 + (picture - expected)[is_clear] / np.maximum(expected[is_clear], DARKEST)
        low, high = np.quantile(ratio, [0.01, 0.99])
        print(
            f"{name:10} view {view}: mean {ratio.mean():.3f}, std {ratio.std():.3f}, "
            f"1 % {low:.3f}, 99 % {high:.3f}, stated {baked.light_noise:.3f}, {cpu_s:.1f} s CPU",
            flush=True,
        )


def main() -> None:
    """Read the arguments, and compare place by place."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("places", nargs="*", default=list(PLACES), help=f"of {', '.join(PLACES)}")
    parser.add_argument("--rays", type=int, default=16, help="times as many as the default bake's")
    parser.add_argument("--width", type=int, default=320, help="pixels; the height is two thirds of it")
    arguments = parser.parse_args()
    focal_px = 0.9 * arguments.width
    height_px = arguments.width * 2 // 3
    camera = Pinhole(arguments.width, height_px, focal_px, focal_px, (arguments.width - 1) / 2, (height_px - 1) / 2)
    for name in arguments.places:
        report(name, arguments.rays, camera)


if __name__ == "__main__":
    main()
