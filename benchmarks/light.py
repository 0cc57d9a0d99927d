"""How far the raster engine's pictures are from path traced ones, in linear light.

    python benchmarks/light.py [room office car_park street] [--lights all lamps sun sky] [--matt] [--samples 256]
                               [--width 320] [--out FOLDER] [--bakes FOLDER]

--lights sun leaves the sun alone in the scene, --lights lamps everything that is neither sun nor sky; each named set
has a table of its own. Path tracing takes the processor, or an NVIDIA GPU with VOBENCH_MITSUBA_VARIANT=cuda_ad_rgb.

One exposure per scene: the luminance that its file calls white is 1. PSNR = -10 log10 of the mean squared
difference to the path tracer over the pixels of a kind, each pixel's kind being that of the surface at its
centre. The path tracer draws two pictures a and b of half the samples with different seeds; the mean of
(raster - a)(raster - b) is the squared difference without the path tracer's own noise, which the column
"noise" gives in the same unit; 70 dB stands for a difference that the noise hides. Pixels that raster draws
white, which a camera would clip, and their neighbours are left out; "white" is their share in raster and in
the path tracer's picture.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_file import load_baked, save_baked
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.geometry import RayCaster
from vobench.rendering.path import PathRenderer
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.light import Light, Sky, Sun
from vobench.scene.material import Material
from vobench.scene.scene import Scene, triangles
from vobench.suite import catalog
from vobench.suite.free_space import largest_free_circle
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

# x, y in metres, heading and downward pitch in degrees: where a robot could stand, and its camera 0.4 m above.
PLACES = {
    "room": [
        (0.0, 0.0, 0.0, 15.0),
        (0.0, 0.0, 90.0, 5.0),
        (-3.0, -1.0, 200.0, 15.0),
        (3.0, 1.0, -80.0, 5.0),
        (-1.0, 1.0, 135.0, 5.0),
        (1.5, 0.0, 90.0, 90.0),
    ],
    "office": [
        (-4.5, 0.5, -20.0, 10.0),
        (3.0, -3.5, 120.0, 10.0),
        (0.0, -3.0, 60.0, 5.0),
        (1.4, 1.8, -165.0, 10.0),
        (-1.5, -0.5, 100.0, 5.0),
        (0.5, 0.0, 180.0, 15.0),
    ],
    "car_park": [],
    "street": [],
}
FREE_HEADINGS_DEG = (0.0, 120.0, 240.0)  # of the views in a place that has none above
CAMERA_HEIGHT_M = 0.4
LIGHT_SETS = ("all", "lamps", "sun", "sky")
KINDS = ("matt", "polished", "mirror", "glass")
FAINTEST_MSE = 1e-7  # where noise hides the difference
FEWEST_PIXELS = 100  # of a kind, for a line of its own
DIFFERENCE_GAIN = 4.0
DIFFERENCE_BLUR_PX = 2.0
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Pair:
    """One place drawn by both, in units of white: raster, and the path tracer's two halves."""

    raster: Radiance
    halves: tuple[Radiance, Radiance]
    kinds: dict[str, Mask]

    @property
    def traced(self) -> Radiance:
        """The better of the path tracer's pictures: the mean of its halves."""
        return (self.halves[0] + self.halves[1]) / 2

    def compared(self) -> Iterator[tuple[str, "Compared"]]:
        """What there is of each kind."""
        clipped = cv2.dilate((self.raster >= 1).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        for kind, mask in self.kinds.items():
            some = mask & ~clipped
            if some.sum() >= FEWEST_PIXELS:
                yield (
                    kind,
                    Compared(self.raster[some].astype(float), *(half[some].astype(float) for half in self.halves)),
                )


@dataclass(frozen=True, slots=True)
class Compared:
    """Pixels of one kind: raster (N,), and the path tracer's halves (N,)."""

    raster: Array
    a: Array
    b: Array

    def line(self) -> str:
        """Pixels, PSNR and how low and high it may be, noise, and the ratio of the mean luminances."""
        error = (self.raster - self.a) * (self.raster - self.b)
        noise = np.mean((self.a - self.b) ** 2) / 4
        mse = error.mean()
        sure = error.std() / np.sqrt(len(error))
        low, psnr, high = (decibels(mse + by * sure) for by in (1, 0, -1))
        ratio = 2 * self.raster.sum() / (self.a + self.b).sum()
        return f"{len(error):8}{psnr:9.1f}{low:8.1f}..{high:4.1f}{decibels(noise):10.1f}{ratio:8.3f}"


def pooled(parts: Sequence[Compared]) -> Compared:
    """All places together."""
    raster = np.concatenate([part.raster for part in parts])
    a = np.concatenate([part.a for part in parts])
    b = np.concatenate([part.b for part in parts])
    return Compared(raster, a, b)


def decibels(mse: float) -> float:
    """PSNR of a mean squared error against white."""
    return float(-10 * np.log10(max(mse, FAINTEST_MSE)))


def lens(width_px: int) -> Pinhole:
    """The paper's lens with square pixels, at another resolution."""
    height_px = round(width_px * 480 / 720)
    f = 32 / 35 * width_px
    return Pinhole(width_px, height_px, f, f, (width_px - 1) / 2, (height_px - 1) / 2)


def stand(x_m: float, y_m: float, heading_deg: float, pitch_deg: float) -> Array:
    """T_world_camera of a place."""
    T_world_body = se3.transform(se3.rotation_z(np.deg2rad(heading_deg)), [x_m, y_m, 0.0])
    return T_world_body @ looking(pitch_deg=pitch_deg, position_m=(0.25, 0.0, 0.4))


def views(scene: Scene) -> list[Array]:
    """T_world_camera of every view: the places above, or from the middle of the largest free circle."""
    if PLACES[scene.name]:
        return [stand(*place) for place in PLACES[scene.name]]
    faces = triangles(scene, t_ns=0)
    free = largest_free_circle(faces, RayCaster(faces))
    if free is None:
        raise SystemExit(f"{scene.name} has no free floor")
    seen = []
    for heading_deg in FREE_HEADINGS_DEG:
        rotation = se3.rotation_z(np.deg2rad(heading_deg))
        T_world_body = se3.transform(rotation, [free.x_m, free.y_m, free.floor_m])
        seen.append(T_world_body @ looking(pitch_deg=0.0, position_m=(0.0, 0.0, CAMERA_HEIGHT_M)))
    return seen


def with_lights(scene: Scene, light_set: str) -> Scene:
    """The scene with one of LIGHT_SETS alone."""
    kept = tuple(light for light in scene.lights if light_set in ("all", set_of(light)))
    return replace(scene, lights=kept)


def without_coats(scene: Scene) -> Scene:
    """The scene with matt things only: a path tracer finds no sun in a coat, which the raster engine mirrors."""
    matt = {}
    for name, material in scene.materials.items():
        is_body = material.kind == "body"
        matt[name] = replace(material, eta=1.0, roughness=0.0, metal=0.0) if is_body else material
    return replace(scene, materials=matt)


def set_of(light: Light) -> str:
    """The set of LIGHT_SETS that a light belongs to."""
    if isinstance(light, Sun):
        return "sun"
    return "sky" if isinstance(light, Sky) else "lamps"


def kinds(scene: Scene, camera: Pinhole, T_world_camera: Array) -> dict[str, Mask]:
    """Which pixels' centres see a surface of each kind first, from its front."""
    faces = triangles(scene, t_ns=0)
    directions = camera.rays(pixel_grid(camera)).reshape(-1, 3) @ T_world_camera[:3, :3].T
    origins = np.broadcast_to(T_world_camera[:3, 3], directions.shape)
    met = np.append(faces.thing, -1)[RayCaster(faces).nearest(origins, directions)]
    own = [scene.materials.get(thing.material) for thing in faces.things]
    shape = camera.height_px, camera.width_px
    masks = {}
    for name in KINDS:
        of_kind = np.array([material is not None and _kind(material) == name for material in own] + [False])
        masks[name] = of_kind[met].reshape(shape)
    return masks


def _kind(material: Material) -> str:
    bodies = "polished" if material.is_coated or material.metal else "matt"
    return {"body": bodies, "mirror": "mirror", "pane": "glass"}[material.kind]


def lit(scene: Scene, light_set: str, folder: Path | None) -> BakedScene:
    """The scene's bake, from a folder if it is there."""
    own = folder / f"{scene.name}-{light_set}" if folder else None
    if own and own.is_dir():
        return load_baked(own, scene)
    baked = bake(scene, BakeSettings())
    if own:
        own.mkdir(parents=True)
        save_baked(own, baked)
    return baked


def pairs(baked: BakedScene, white_cd_m2: float, camera: Pinhole, samples: int) -> Iterator[Pair]:
    """Every view of a scene, drawn by both."""
    scene = baked.scene
    raster = RasterRenderer(baked)
    tracer = PathRenderer(scene, samples=samples // 2, seed=1, max_depth=None)
    tracers = [tracer, tracer.with_seed(2)]
    for T_world_camera in views(scene):
        instants = single_instant(camera, T_world_camera)
        a, b = (tracer.radiance(camera, instants) / white_cd_m2 for tracer in tracers)
        yield Pair(raster.radiance(camera, instants) / white_cd_m2, (a, b), kinds(scene, camera, T_world_camera))
    raster.close()


def side_by_side(pair: Pair) -> NDArray[np.uint8]:
    """Raster, path tracer, and their difference around grey, as an sRGB-like picture.

    The difference is smoothed, or the path tracer's noise would be all that can be seen.
    """
    clipped = [np.clip(light, 0, 1) for light in (pair.raster, pair.traced)]
    smooth = [cv2.GaussianBlur(light, (0, 0), DIFFERENCE_BLUR_PX) for light in clipped]
    difference = 128 + 255 * DIFFERENCE_GAIN * (smooth[0] - smooth[1])
    pictures = [255 * light ** (1 / 2.2) for light in clipped]
    return np.clip(np.hstack([*pictures, difference]), 0, 255).astype(np.uint8)


def report(name: str, light_set: str, arguments: argparse.Namespace) -> None:
    """Print one scene's table and save its pictures."""
    spec = read_scene(catalog.find("scene", name).path)
    scene = with_lights(build(spec, {}), light_set)
    if arguments.matt:
        scene = without_coats(scene)
    if not scene.lights:
        print(f"{name} has no light of the set {light_set}\n")
        return
    camera = lens(arguments.width)
    started_s = time.monotonic()
    baked = lit(scene, light_set, arguments.bakes)
    bake_s = time.monotonic() - started_s
    size = f"{camera.width_px} x {camera.height_px}"
    print(f"{name}, lights: {light_set}, white {spec.white_cd_m2} cd/m², {size}, {arguments.samples} samples")
    print(
        f"{'place':>5} {'kind':10}{'pixels':>8}{'PSNR dB':>9}{'one sigma':>14}{'noise dB':>10}{'ratio':>8}{'white':>16}"
    )
    found: dict[str, list[Compared]] = {}
    for index, pair in enumerate(pairs(baked, spec.white_cd_m2, camera, arguments.samples)):
        white = f"{np.mean(pair.raster >= 1):.1%} {np.mean(pair.traced >= 1):.1%}"
        for kind, part in pair.compared():
            print(f"{index:5} {kind:10}{part.line()}{white:>16}", flush=True)
            found.setdefault(kind, []).append(part)
        if arguments.out:
            arguments.out.mkdir(parents=True, exist_ok=True)
            best = [cv2.IMWRITE_PNG_COMPRESSION, 9]
            cv2.imwrite(str(arguments.out / f"light_{name}_{light_set}_{index}.png"), side_by_side(pair), best)
    for kind, parts in found.items():
        print(f"  all {kind:10}{pooled(parts).line()}")
    print(f"bake {bake_s:.0f} s, images {time.monotonic() - started_s - bake_s:.0f} s\n", flush=True)


def main() -> None:
    """Read the arguments, and compare scene by scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(PLACES), help=f"of {', '.join(PLACES)}")
    parser.add_argument("--lights", nargs="+", choices=LIGHT_SETS, default=["all"], help="sets, a table for each")
    parser.add_argument("--matt", action="store_true", help="leave coats and metal out")
    parser.add_argument("--samples", type=int, default=256, help="paths a pixel, both halves together")
    parser.add_argument("--width", type=int, default=320, help="pixels; the height is two thirds of it")
    parser.add_argument("--out", type=Path, help="folder for the images: raster, path tracer, smoothed difference x 4")
    parser.add_argument("--bakes", type=Path, help="folder to keep bakes in, to compare again sooner")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        for light_set in arguments.lights:
            report(name, light_set, arguments)


if __name__ == "__main__":
    main()
