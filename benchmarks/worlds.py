"""What generated places cost: CPU seconds from a seed to its first picture, and the plan of a suite of many places.

    python benchmarks/worlds.py [--seeds 6] [--first 1] [--place flat] [--place office]
    python benchmarks/worlds.py --plan 200

For each seed it builds the place, computes its light at the settings of a run, opens the renderer, and draws one colour
picture of 752 x 480 pixels from the free circle. `--plan N` instead reads a suite of N places and counts its tasks, as
`vobench run --dry-run` does, and prints the time that this takes and the memory of the process.
"""

import argparse
import resource
import tempfile
import time
from contextlib import closing
from pathlib import Path

import numpy as np

from vobench.geometry.camera import Pinhole
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.geometry import RayCaster
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import single_instant
from vobench.runner.preflight import summarize
from vobench.scene.scene import Scene, triangles
from vobench.suite.free_space import largest_free_circle
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_place
from vobench.suite.suite import read_plan
from vobench.suite.viewpoint import Viewpoint

PLACES = ("flat", "office", "park", "room", "street", "warehouse")
STAGES = ("build", "light", "open", "picture")
CAMERA = Pinhole(752, 480, 458.0, 458.0, 375.5, 239.5)
EYE_HEIGHT_M = 1.2
YAW_DEG = 45.0
PITCH_DEG = 8.0
MIB = 1 << 10  # of the KiB in which Linux counts memory
SCENARIOS = 4  # of the suite; together they have each place once
SUITE_KINDS = 4  # of places in the suite
SUITE = """name: many
scenes: [{name: flat, seeds: N}, {name: office, seeds: N}, {name: street, seeds: N}, {name: warehouse, seeds: N}]
trajectories: {tour: {kind: wander, length_m: 6}, car: {kind: wander, length_m: 30, body: car, mount: {height_m: 1.6}}}
scenarios: {noise: [1, 3], jpeg: [1, 3], drops: [1, 3], vignetting: [1, 3]}
spread: {units: UNITS, each: EACH, pairs: {flat: [tour], office: [tour], street: [car], warehouse: [tour]}}
estimators: [stand_still]
"""


def main() -> None:
    """Measure the places, or the plan of many, and print what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--place", action="append", choices=PLACES)
    parser.add_argument("--plan", type=int)
    options = parser.parse_args()
    if options.plan:
        _plan(options.plan)
        return
    for place in options.place or PLACES:
        seeds = range(options.first, options.first + options.seeds)
        costs_s = np.array([_costs_s(place, seed) for seed in seeds])  # (seeds, stages)
        print(f"{place}: {_text(costs_s.mean(0))} on average over {len(seeds)} seeds", flush=True)


def _costs_s(place: str, seed: int) -> list[float]:
    """The CPU seconds of each stage for one place."""
    spec = read_place(place, seed=seed)
    marks_s = [time.process_time()]
    scene = build(spec, {})
    marks_s.append(time.process_time())
    baked = bake(scene, BakeSettings())
    marks_s.append(time.process_time())
    camera = _viewpoint(scene)
    skipped_s = time.process_time() - marks_s[-1]  # a run looks for no free circle
    with closing(RasterRenderer(baked)) as renderer:
        marks_s.append(time.process_time() - skipped_s)
        renderer.radiance(CAMERA, single_instant(CAMERA, camera.T_world_camera()), weights=None)
        marks_s.append(time.process_time() - skipped_s)
    costs_s = np.diff(marks_s).tolist()
    print(f"{spec.place_name}: {_text(costs_s)}", flush=True)
    return costs_s


def _viewpoint(scene: Scene) -> Viewpoint:
    """A viewpoint above the middle of the free circle."""
    faces = triangles(scene)
    free = largest_free_circle(faces, RayCaster(faces))
    if free is None:
        raise SystemExit(f"{scene.name} has no free circle")
    return Viewpoint((free.x_m, free.y_m, free.floor_m + EYE_HEIGHT_M), YAW_DEG, PITCH_DEG)


def _text(costs_s: list[float]) -> str:
    """The cost of each stage and of all."""
    stages = ", ".join(f"{name} {cost_s:.2f}" for name, cost_s in zip(STAGES, costs_s, strict=True))
    return f"{sum(costs_s):.1f} CPU s ({stages})"


def _plan(places: int) -> None:
    """Read a suite of many places, count its tasks, and print what that costs."""
    seeds = places // SUITE_KINDS
    units = seeds * SUITE_KINDS
    text = SUITE.replace("UNITS", str(units)).replace("EACH", str(units // SCENARIOS)).replace("N}", f"{seeds}}}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "many.yaml"
        path.write_text(text, encoding="utf-8")
        start_s = time.process_time()
        plan = read_plan(str(path))
        read_s = time.process_time() - start_s
        summarize(plan, with_stages=True)
        whole_s = time.process_time() - start_s
    scenes = {case.variant["scene"] for case in plan.simulated}
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / MIB
    print(f"{len(plan.simulated)} cases in {len(scenes)} places: {read_s:.1f} CPU s to read, {whole_s:.1f} in all")
    print(f"{peak_mib:.0f} MiB at most")


if __name__ == "__main__":
    main()
