"""What light costs: baking the built-in scenes from nothing, then each picture's share while things change.

    python benchmarks/bake.py [--scenes room office] [--pictures 5]
    python benchmarks/bake.py --stages [--scenes room office]

Wall clock and CPU over all threads; compare within a run only. With --stages every built-in scene, or those named, is
baked in a process of its own, and what each stage of the bake took is shown in place of what changes. Generated places
are named with their seed, as in office.1.
"""

import argparse
import multiprocessing
import os
import platform
import resource
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from vobench.asset.shape import at, block
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.rendering import bake as bake_module
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.illumination import Illumination
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import single_instant
from vobench.scene.light import Flicker, Sun
from vobench.scene.material import Material
from vobench.scene.mesh import moved
from vobench.scene.scene import Mover, Scene, WaypointMotion
from vobench.scene.triangles import Thing
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_place

NS_PER_PICTURE = 100_000_000


def main() -> None:
    """Bake, then change; print what it took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+")
    parser.add_argument("--pictures", type=int, default=5)
    parser.add_argument("--stages", action="store_true", help="what each stage of a bake takes, of all built-in scenes")
    arguments = parser.parse_args()
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    if arguments.stages:
        _print_stages(arguments.scenes or ALL_SCENES)
        return
    for name in arguments.scenes or ("room", "office"):
        scene = _scene(name)
        baked = _baked(scene)
        for change, light in _changes(baked):
            print(f"{name}: {change}: {_milliseconds(light, arguments.pictures)}")
        for count in (1, 3):
            milliseconds = _with_movers(scene, count, arguments.pictures)
            print(f"{name}: {count} movers as tall as people, a stereo pair beyond one without changes: {milliseconds}")


ALL_SCENES = (
    "room",
    "office",
    "flat",
    "hall",
    "corridor",
    "warehouse",
    "car_park",
    "ramp",
    "street",
    "park",
)
# stages of a bake by the functions that they consist of, as the module of the bake calls them
STAGES = {
    "sampled_faces": "spacings",
    "unwrap": "unwrap",
    "static_points": "texels",
    "surfels": "surfels",
    "blend": "blend",
    "albedo": "albedo",
    "bounced": "bounces",
}
Timed = Callable[..., object]


def _print_stages(names: Sequence[str]) -> None:
    """CPU seconds of each stage, place by place, each in a new process so that its peak of memory is its own."""
    for name in names:
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
            print(pool.submit(_stages, name).result(), flush=True)


def _stages(name: str) -> str:
    """Bake a place once, and what its stages took in CPU seconds."""
    spent: dict[str, float] = {}

    def timed(function: Timed, stage: Callable[..., str]) -> Timed:
        def wrapped(*arguments: object, **keywords: object) -> object:
            started = time.process_time()
            result = function(*arguments, **keywords)
            label = stage(*arguments)
            spent[label] = spent.get(label, 0.0) + time.process_time() - started
            return result

        return wrapped

    for function, stage in STAGES.items():
        setattr(bake_module, function, timed(getattr(bake_module, function), lambda *_, stage=stage: stage))
    for name_of_method in ("sample", "light", "deposited"):
        method = getattr(bake_module.Gatherer, name_of_method)
        setattr(bake_module.Gatherer, name_of_method, timed(method, lambda *_, stage=name_of_method: stage))
    direct_light = bake_module.direct_light
    bake_module.direct_light = timed(  # type: ignore[attr-defined]
        direct_light, lambda emitter, *_: f"direct {type(emitter).__name__}"
    )
    scene = _scene(name)
    started = time.process_time()
    line = _baking(scene)[1]
    spent["rest"] = time.process_time() - started - sum(spent.values())
    parts = ", ".join(f"{stage} {cpu_s:.1f}" for stage, cpu_s in spent.items())
    return f"{line}\n  {parts}"


def _scene(name: str) -> Scene:
    """A built-in scene, or a generated place by its name and seed, as in office.1."""
    place, _, seed = name.partition(".")
    return build(read_place(place, seed=int(seed) if seed else None), {})


def _baked(scene: Scene) -> BakedScene:
    baked, line = _baking(scene)
    print(line)
    return baked


def _baking(scene: Scene) -> tuple[BakedScene, str]:
    """The scene's light, and a line about what it took."""
    started = time.perf_counter()
    cpu_started = time.process_time()
    baked = bake(scene, BakeSettings())
    wall_s = time.perf_counter() - started
    cpu_s = time.process_time() - cpu_started
    texels = int((baked.patches.surfel_of >= 0).sum())
    gigabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    lights = f"{len(scene.lights)} lights, {texels} samples"
    return baked, f"{scene.name}: {lights}, bake {wall_s:.1f} s wall, {cpu_s:.1f} s CPU, peak {gigabytes:.2f} GB"


def _changes(baked: BakedScene) -> Iterator[tuple[str, Illumination]]:
    """The scene with more and more that changes. The bake stays as it is: what is timed does not depend on it."""
    scene = baked.scene
    flicker = tuple(replace(light, level=Flicker(depth=0.2)) for light in scene.lights)
    yield "steady", Illumination(baked)
    one = (flicker[0], *scene.lights[1:])
    yield "one light flickers", Illumination(replace(baked, scene=replace(scene, lights=one)))
    yield "all lights flicker", Illumination(replace(baked, scene=replace(scene, lights=flicker)))
    suns = [light for light in scene.lights if isinstance(light, Sun)]
    for sun in suns:
        moving = replace(
            sun,
            times_s=(0.0, 60.0),
            azimuth_deg=(sun.azimuth_deg[0], sun.azimuth_deg[0] + 10),
            elevation_deg=2 * sun.elevation_deg,
        )
        yield (
            "the sun moves",
            Illumination(
                bake(
                    replace(scene, lights=tuple(moving if light is sun else light for light in scene.lights)),
                    replace(BakeSettings(), light_rays=1, bounces=1, indirect_rays=4),
                )
            ),
        )


WALKER = Material(texture=Procedural("plain", 0.4, 0.0, 1.0, 8, 0))


CAMERA = Pinhole(720, 480, 500.0, 500.0, 359.5, 239.5)
EYES_M = (0.06, -0.06)


def _with_movers(scene: Scene, count: int, pictures: int) -> str:
    """Median of what a stereo pair costs more at an instant that is new than once its light is known."""
    materials = {**scene.materials, "walker": WALKER}
    walkers = replace(scene, movers=tuple(_walker(i) for i in range(count)), materials=materials)
    renderer = RasterRenderer(bake(walkers, replace(BakeSettings(), bounces=1, indirect_rays=4)))
    T_world_body = se3.transform(se3.rotation_z(np.pi / 2), (-0.5, -2.5, 0))
    spent = []
    for index in range(pictures + 1):
        times = [(time.perf_counter(), time.process_time())]
        for _ in range(2):
            for eye_m in EYES_M:
                T = T_world_body @ looking(pitch_deg=5, position_m=(0, eye_m, 1.0))
                renderer.radiance(CAMERA, single_instant(CAMERA, T, t_ns=index * NS_PER_PICTURE))
            times.append((time.perf_counter(), time.process_time()))
        new, known = np.diff(times, axis=0)
        spent.append(new - known)
    renderer.close()
    wall_s, cpu_s = np.median(spent[1:], axis=0)
    return f"{1e3 * wall_s:.1f} ms wall, {1e3 * cpu_s:.1f} ms CPU"


def _walker(index: int) -> Mover:
    body = Thing(f"walker_{index}", moved(block((0.5, 0.3, 1.8), bevel_m=0), at(0, 0, 0.9)), "walker")
    positions = np.array([[-1.5 + index, -1.0, 0.0], [-1.5 + index, 4.0, 0.0]])
    return Mover(f"walker_{index}", (body,), WaypointMotion(np.array([0.0, 5.0]), positions, np.array([0.0, 90.0])))


def _milliseconds(light: Illumination, pictures: int) -> str:
    """Median per picture after the first."""
    spent = []
    for index in range(pictures + 1):
        wall = time.perf_counter()
        cpu = time.process_time()
        light.at(index * NS_PER_PICTURE, index * NS_PER_PICTURE + 10_000_000 + index)
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall_s, cpu_s = np.median(spent[1:], axis=0)
    return f"{1e3 * wall_s:.1f} ms wall, {1e3 * cpu_s:.1f} ms CPU"


if __name__ == "__main__":
    main()
