"""What the path tracer costs over Mitsuba itself: the same room, paths, depth and variant, in one run.

    python benchmarks/path.py [--samples 4] [--pictures 6]

Mitsuba draws with its own perspective camera and film; vobench brings its own rays, which any lens can have.
Times are medians per picture of 720 × 480, wall clock and CPU over all threads. Compare within a run only.
"""

import argparse
import platform
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from vobench.geometry.rig import LENSES, looking
from vobench.geometry.se3 import Array
from vobench.rendering.mitsuba import wanted_variant
from vobench.rendering.mitsuba_description import load_scene
from vobench.rendering.path import PathRenderer
from vobench.rendering.renderer import single_instant
from vobench.scene.scene import Scene
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

LENS = LENSES["paper_blender"]  # square pixels: Mitsuba's camera has no others
MAX_DEPTH = 8
# Mitsuba's camera looks along +z with x left and y up.
T_CV_MITSUBA = np.diag([-1.0, -1.0, 1.0, 1.0])


def seconds(work: Callable[[int], object], pictures: int) -> tuple[float, float]:
    """Median wall and CPU seconds of `work` over pictures; the first one warms up and does not count."""
    spent = []
    for index in range(pictures + 1):
        wall = time.perf_counter()
        cpu = time.process_time()
        work(index)
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall_s, cpu_s = np.median(spent[1:], axis=0)
    return float(wall_s), float(cpu_s)


def mitsuba_itself(scene: Scene, T_world_camera: Array, samples: int) -> Callable[[int], object]:
    """Draws one picture the way Mitsuba's own documentation does."""
    import mitsuba as mi

    world = load_scene(mi, scene)
    w = LENS.width_px
    h = LENS.height_px
    film = {"type": "hdrfilm", "width": w, "height": h, "rfilter": {"type": "box"}, "pixel_format": "luminance"}
    sensor = mi.load_dict(
        {
            "type": "perspective",
            "fov": float(np.rad2deg(2 * np.arctan(w / 2 / LENS.fx_px))),
            "to_world": mi.ScalarTransform4f(T_world_camera @ T_CV_MITSUBA),
            "film": film,
            "sampler": {"type": "independent", "sample_count": samples},
        }
    )
    integrator = mi.load_dict({"type": "path", "max_depth": MAX_DEPTH})

    def draw(seed: int) -> Any:
        return mi.render(world, sensor=sensor, integrator=integrator, spp=samples, seed=seed).numpy()[..., 0]

    return draw


def compare(scene: Scene, samples: int, pictures: int) -> None:
    """Print both costs, their ratio, and how far the mean pictures are apart."""
    T_world_camera = looking(pitch_deg=15, position_m=(-2.5, 0.0, 0.4))
    renderer = PathRenderer(scene, samples=samples, max_depth=MAX_DEPTH)
    direct = mitsuba_itself(scene, T_world_camera, samples)

    def ours(index: int) -> Any:
        return renderer.radiance(LENS, single_instant(LENS, T_world_camera, t_ns=index))

    rows = [("Mitsuba itself", *seconds(direct, pictures)), ("vobench", *seconds(ours, pictures))]
    print(f"{platform.machine()}, {scene.name}, {samples} paths a pixel, depth {MAX_DEPTH}, {wanted_variant()}")
    for name, wall_s, cpu_s in rows:
        print(f"{name:16s} wall {wall_s:6.2f} s   CPU {cpu_s:6.2f} s")
    print(f"ratio            wall {rows[1][1] / rows[0][1]:6.2f}     CPU {rows[1][2] / rows[0][2]:6.2f}")
    means = []
    for draw in (direct, ours):
        pictures_drawn = [draw(index) for index in range(2)]
        means.append(np.mean(pictures_drawn))
    print(f"mean luminance   {means[0]:.3f} and {means[1]:.3f} cd/m²")


def main() -> None:
    """Read the arguments, and compare on the room."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=4)
    parser.add_argument("--pictures", type=int, default=6)
    arguments = parser.parse_args()
    scene = build(read_scene(catalog.find("scene", "room").path), {})
    compare(scene, arguments.samples, arguments.pictures)


if __name__ == "__main__":
    main()
