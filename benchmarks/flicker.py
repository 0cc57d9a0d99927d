"""How much pictures sparkle: grey values against those of 36 samples a pixel, by kind of pixel, and over a slow drive.

    python benchmarks/flicker.py [office street park] [--frames 10] [--out FOLDER] [--bakes FOLDER]

One exposure per scene: the luminance that its file calls white is 200 grey values (DN), without noise or rounding. The
reference is the mean of the 3 x 3 pixels that a camera of three times the resolution has in each pixel. A pixel is of
the first kind in the list that one of nine rays through it finds: `cut-out`, a material with holes; `outline`, two
things, or two faces of one that turn or stand apart; `gloss`, a surface that mirrors; `texture`; `plain`; `sky`.
The column "energy" is the share of the squared error that a kind holds. In the drive the camera moves by 2 mm and
0.01 degrees a frame; where nothing flickers, the second difference of a pixel's grey values is that of the scene alone.
"""

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from light import stand
from numpy.typing import NDArray
from render import QUICK

from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_file import load_baked, save_baked
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.batch import depends_on_view
from vobench.rendering.geometry import RayCaster
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import single_instant
from vobench.scene.material import Material
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.sensor.image_sensor import CameraSettings
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

Place = tuple[float, float, float, float]
# x, y in metres, heading and downward pitch in degrees.
PLACES: dict[str, list[Place]] = {
    "office": [(-4.5, 0.5, -20.0, 10.0), (0.0, -3.0, 60.0, 5.0), (0.5, 0.0, 180.0, 15.0)],
    "street": [(0.0, 0.0, 0.0, 5.0), (8.0, 0.0, 170.0, 10.0), (-6.0, -1.0, 60.0, 0.0)],
    "park": [(1.0, -9.5, 60.0, 0.0), (-14.0, -14.0, 30.0, 5.0), (9.0, 14.5, -150.0, 0.0)],
}
KINDS = ("cut-out", "outline", "gloss", "texture", "plain", "sky")
CAMERA = Pinhole(720, 480, 658.3, 658.3, 359.5, 239.5)
FINER = 3  # the reference's resolution over the camera's, each way; each of its pixels has four samples
CREASE_COSINE = 0.95  # between normals of faces that turn
STEP_SHARE = 0.02  # of the distance: faces that are so far apart along the normal
FORWARD_M = 0.002  # a frame
TURN_DEG = 0.01  # a frame
Grey = NDArray[np.float64]
Kinds = NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class View:
    """One place: the picture and its reference in DN (H, W), the kind of each pixel (H, W), CPU milliseconds."""

    picture: Grey
    reference: Grey
    kinds: Kinds
    cpu_ms: float

    @property
    def error(self) -> Grey:
        """Grey values above those of the reference."""
        return self.picture - self.reference


def grey(luminance: Array, white_cd_m2: float) -> Grey:
    """Grey values of luminance, as the default camera stores them but for rounding."""
    settings = CameraSettings()
    electrons = np.minimum(settings.white_e * luminance / white_cd_m2, settings.chip.full_well_e)
    return 255 * settings.chip.curve.encode(electrons / settings.chip.full_well_e)


def magnified(camera: Pinhole, times: int) -> Pinhole:
    """The same field of view in so many times as many pixels each way."""
    return replace(
        camera,
        width_px=times * camera.width_px,
        height_px=times * camera.height_px,
        fx_px=times * camera.fx_px,
        fy_px=times * camera.fy_px,
        cx_px=times * (camera.cx_px + 0.5) - 0.5,
        cy_px=times * (camera.cy_px + 0.5) - 0.5,
    )


def reference(renderer: RasterRenderer, T_world_camera: Array) -> Array:
    """Luminance (H, W) as the mean of 36 samples a pixel."""
    camera = magnified(CAMERA, FINER)
    luminance = renderer.radiance(camera, single_instant(camera, T_world_camera))
    blocks = luminance.astype(float).reshape(CAMERA.height_px, FINER, CAMERA.width_px, FINER)
    return np.asarray(blocks.mean((1, 3)))


def kind_of(material: Material | None) -> int:
    """The place in KINDS of a material."""
    if material is None:
        return KINDS.index("plain")
    if material.cutout is not None:
        return KINDS.index("cut-out")
    if depends_on_view(material):
        return KINDS.index("gloss")
    return KINDS.index("texture" if material.texture is not None else "plain")


class PixelKinds:
    """Tells what pixels of a scene show."""

    def __init__(self, scene: Scene) -> None:
        self._faces: Triangles = triangles(scene, t_ns=0)
        self._caster = RayCaster(self._faces)
        of_things = [kind_of(scene.materials.get(thing.material)) for thing in self._faces.things]
        of_faces = np.array(of_things, np.int8)[self._faces.thing]
        self._kind = np.append(of_faces, KINDS.index("sky")).astype(np.int8)
        self._thing = np.append(self._faces.thing, -1)
        self._normal = np.concatenate([self._faces.plane, np.zeros((1, 3))])

    def of(self, T_world_camera: Array) -> Kinds:
        """The kind (H, W) of each pixel."""
        camera = magnified(CAMERA, FINER)
        directions = camera.rays(pixel_grid(camera)).reshape(-1, 3) @ T_world_camera[:3, :3].T
        origins_m = np.broadcast_to(T_world_camera[:3, 3], directions.shape)
        hits = self._caster.hits(origins_m, directions)
        face = _by_pixel(hits.face)
        distance_m = np.where(face < len(self._faces.thing), _by_pixel(hits.distance), 0.0)
        points_m = distance_m[..., None] * _by_pixel(directions)
        middle = FINER * FINER // 2
        normal = self._normal[face]
        turns = np.einsum("...j,...j", normal, normal[..., middle : middle + 1, :]) < CREASE_COSINE
        apart_m = np.einsum("...kj,...j", points_m - points_m[..., middle : middle + 1, :], normal[..., middle, :])
        stands_apart = np.abs(apart_m) > STEP_SHARE * distance_m[..., middle, None]
        is_other = self._thing[face] != self._thing[face[..., middle, None]]
        is_sky = face[..., middle] == len(self._faces.thing)
        is_outline = is_other.any(-1) | ((turns | stands_apart).any(-1) & ~is_sky)
        kind = self._kind[face]
        kinds = np.where(is_outline, KINDS.index("outline"), kind[..., middle])
        is_cutout = (kind == KINDS.index("cut-out")).any(-1)
        return np.where(is_cutout, KINDS.index("cut-out"), kinds).astype(np.int8)


def _by_pixel(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Values (9 H W, ...) of the finer camera's pixels as (H, W, 9, ...)."""
    rest = values.shape[1:]
    blocks = values.reshape(CAMERA.height_px, FINER, CAMERA.width_px, FINER, *rest)
    return np.swapaxes(blocks, 1, 2).reshape(CAMERA.height_px, CAMERA.width_px, FINER * FINER, *rest)


def lit(scene: Scene, folder: Path | None) -> BakedScene:
    """The scene's quick bake, from a folder if it is there."""
    kept = folder / scene.name if folder else None
    if kept and kept.is_dir():
        return load_baked(kept, scene)
    baked = bake(scene, QUICK)
    if kept:
        kept.mkdir(parents=True)
        save_baked(kept, baked)
    return baked


def draw(renderer: RasterRenderer, T_world_camera: Array, white_cd_m2: float) -> tuple[Grey, float]:
    """A picture in DN and the CPU milliseconds that it took."""
    start = time.process_time()
    luminance = renderer.radiance(CAMERA, single_instant(CAMERA, T_world_camera))
    cpu_ms = 1e3 * (time.process_time() - start)
    return grey(luminance, white_cd_m2), cpu_ms


def drive(renderer: RasterRenderer, place: Place, white_cd_m2: float, frames: int) -> tuple[Grey, list[float]]:
    """Absolute second differences over time (frames - 2, H, W) in DN, and CPU milliseconds a frame."""
    x_m, y_m, heading_deg, pitch_deg = place
    ahead = np.array([np.cos(np.deg2rad(heading_deg)), np.sin(np.deg2rad(heading_deg))])
    pictures = []
    spent_ms = []
    for index in range(frames):
        step_m = FORWARD_M * index * ahead
        T_world_camera = stand(x_m + step_m[0], y_m + step_m[1], heading_deg + TURN_DEG * index, pitch_deg)
        picture, cpu_ms = draw(renderer, T_world_camera, white_cd_m2)
        pictures.append(picture)
        spent_ms.append(cpu_ms)
    return np.abs(np.diff(pictures, n=2, axis=0)), spent_ms


def table(views: Sequence[View]) -> str:
    """Errors by kind of pixel, all views together."""
    error = np.concatenate([view.error.ravel() for view in views])
    kinds = np.concatenate([view.kinds.ravel() for view in views])
    energy = (error**2).sum()
    lines = [f"  {'kind':10}{'pixels':>8}{'energy':>8}{'RMS DN':>8}{'p99 DN':>8}{'mean DN':>9}"]
    for name, members in [*((name, kinds == index) for index, name in enumerate(KINDS)), ("all", kinds >= 0)]:
        of_kind = error[members]
        if len(of_kind) == 0:
            continue
        squares = of_kind**2
        rms = np.sqrt(squares.mean())
        p99 = np.percentile(np.abs(of_kind), 99)
        shares = f"{members.mean():8.1%}{squares.sum() / energy:8.1%}"
        lines.append(f"  {name:10}{shares}{rms:8.2f}{p99:8.1f}{of_kind.mean():9.3f}")
    return "\n".join(lines)


def report(name: str, arguments: argparse.Namespace) -> None:
    """Print a scene's tables and save its pictures."""
    spec = read_scene(catalog.find("scene", name).path)
    baked = lit(build(spec, {}), arguments.bakes)
    white = spec.white_cd_m2
    kinds = PixelKinds(baked.scene)
    renderer = RasterRenderer(baked)
    views = []
    differences = []
    for index, place in enumerate(PLACES[name]):
        T_world_camera = stand(*place)
        if arguments.frames >= 3:
            second, spent_ms = drive(renderer, place, white, arguments.frames)
            differences.append(second)
        picture, cpu_ms = draw(renderer, T_world_camera, white)
        cpu_ms = float(np.median([*spent_ms[1:], cpu_ms])) if differences else cpu_ms
        finest = grey(reference(renderer, T_world_camera), white)
        view = View(picture, finest, kinds.of(T_world_camera), cpu_ms)
        views.append(view)
        print(
            f"{name} {index}: RMS {np.sqrt((view.error**2).mean()):.2f} DN, {cpu_ms:.0f} CPU ms per image", flush=True
        )
        if arguments.out:
            arguments.out.mkdir(parents=True, exist_ok=True)
            for suffix, values in (("", picture), ("_reference", finest), ("_error", 128 + 4 * view.error)):
                path = arguments.out / f"{name}_{index}{suffix}.png"
                cv2.imwrite(str(path), np.clip(np.rint(values), 0, 255).astype(np.uint8))
    renderer.close()
    print(table(views))
    if differences:
        second = np.concatenate(differences)
        p99, p999 = np.percentile(second, [99, 99.9])
        ever = (np.concatenate([part.max(0) for part in differences]) > 20).mean()
        print(f"  drive: second difference mean {second.mean():.2f}, p99 {p99:.1f}, p99.9 {p999:.1f} DN")
        print(f"  drive: {ever:.1%} of the pixels change by more than 20 DN at least once")


def main() -> None:
    """Read the arguments, and report scene by scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(PLACES), help=f"of {', '.join(PLACES)}")
    parser.add_argument("--frames", type=int, default=10, help="of a drive at each place; 0 for none")
    parser.add_argument("--out", type=Path, help="folder for images, references and four times their difference")
    parser.add_argument("--bakes", type=Path, help="folder to keep bakes in, to compare again sooner")
    arguments = parser.parse_args()
    for name in arguments.scenes:
        report(name, arguments)


if __name__ == "__main__":
    main()
