"""What a picture costs: vobench's renderer against stock pyrender on the same room, in one run.

    python benchmarks/render.py [--views 12]

Times are medians per stereo pair of 720 × 480, wall clock and CPU over all threads. Compare within a run only.
"""

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vobench.catalog import catalog, yaml_file
from vobench.geometry import se3
from vobench.geometry.rig import LENSES, Rig, stereo_rig
from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene, BakeSettings, bake
from vobench.render.geometry import corners
from vobench.render.raster import FAR_M, NEAR_M, T_CV_GL, RasterRenderer
from vobench.scene.scene import AreaLight
from vobench.scene.texture import Map
from vobench.sensor.camera import CAMERAS, NoiseStreams, expose
from vobench.sequence import SequenceWriter
from vobench.suite.scene_file import SceneFile, build

VIEWS = {"down": 90.0, "ahead": 15.0}
NS_PER_FRAME = 100_000_000


@dataclass(frozen=True, slots=True)
class Cost:
    """Median milliseconds of one stereo pair."""

    wall_ms: float
    cpu_ms: float


def measure(work: Callable[[Array], object], poses: list[Array]) -> Cost:
    """The median cost of `work` over poses; the first one warms up and does not count."""
    spent = []
    for T_world_body in poses:
        wall, cpu = time.perf_counter(), time.process_time()
        work(T_world_body)
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall_s, cpu_s = np.median(spent[1:], axis=0)
    return Cost(1e3 * wall_s, 1e3 * cpu_s)


def stand_points(count: int) -> list[Array]:
    """Poses of the robot on a circle around the room's middle."""
    angles = np.linspace(0, 2 * np.pi, count + 1)
    places = np.stack([1.5 * np.cos(angles), 1.5 * np.sin(angles), 0 * angles], -1)
    return list(se3.transform(se3.rotation_z(angles + np.pi / 2), places))


class Recorder:
    """Renders, exposes, compresses and writes stereo pairs, as a simulation does."""

    def __init__(self, renderer: RasterRenderer, rig: Rig, writer: SequenceWriter, white_cd_m2: float) -> None:
        self._renderer, self._rig, self._writer, self._white_cd_m2 = renderer, rig, writer, white_cd_m2
        self._noise, self._frames = NoiseStreams(*np.random.default_rng(0).spawn(2)), 0

    def record(self, T_world_body: Array) -> None:
        """Add one pair and its truth."""
        rig, t_ns = self._rig, self._frames * NS_PER_FRAME
        eyes = ((rig.left, T_world_body @ rig.T_body_left), (rig.right, T_world_body @ rig.T_body_right))
        light = (self._renderer.radiance(*eye) / self._white_cd_m2 for eye in eyes)
        left, right = (expose(picture, CAMERAS["clean"], self._noise) for picture in light)
        self._writer.write_frame(t_ns, left, right)
        self._writer.write_truth(t_ns, T_world_body, np.zeros(6))
        self._frames += 1


def ours(baked: BakedScene, white_cd_m2: float, poses: list[Array]) -> Iterator[tuple[str, str, Cost]]:
    """Costs of drawing, and of drawing and recording."""
    renderer = RasterRenderer(baked)
    for view, pitch_deg in VIEWS.items():
        rig = stereo_rig(LENSES["paper_literal"], pitch_deg=pitch_deg)

        def draw(T_world_body: Array, rig: Rig = rig) -> None:
            renderer.radiance(rig.left, T_world_body @ rig.T_body_left)
            renderer.radiance(rig.right, T_world_body @ rig.T_body_right)

        yield "vobench", view, measure(draw, poses)
        with (
            tempfile.TemporaryDirectory() as folder,
            SequenceWriter(Path(folder), rig, case_json=b"{}") as writer,
        ):
            recorder = Recorder(renderer, rig, writer, white_cd_m2)
            yield "vobench + chip + PNG + MCAP", view, measure(recorder.record, poses)
    renderer.close()


def stock(baked: BakedScene, white_cd_m2: float, poses: list[Array]) -> Iterator[tuple[str, str, Cost]]:
    """Costs of pyrender as it comes: 8 bits, four samples a pixel, a shadow-mapped spot for each lamp, and none."""
    import pyrender

    scene, camera = _stock_scene(baked, white_cd_m2)
    lens = LENSES["paper_literal"]
    renderer = pyrender.OffscreenRenderer(lens.width_px, lens.height_px)
    for name, flags in (
        ("stock pyrender, shadows", pyrender.RenderFlags.SHADOWS_SPOT),
        ("stock pyrender, no shadows", pyrender.RenderFlags.NONE),
    ):
        for view, pitch_deg in VIEWS.items():
            rig = stereo_rig(lens, pitch_deg=pitch_deg)

            def draw(T_world_body: Array, rig: Rig = rig, flags: int = flags) -> None:
                for T_body_camera in (rig.T_body_left, rig.T_body_right):
                    scene.set_pose(camera, T_world_body @ T_body_camera @ T_CV_GL)
                    renderer.render(scene, flags)

            yield name, view, measure(draw, poses)
    renderer.delete()


def _stock_scene(baked: BakedScene, white_cd_m2: float) -> tuple[Any, Any]:
    """The same rectangles and tiles in pyrender's own materials, and its camera's node."""
    import pyrender

    scene = pyrender.Scene(ambient_light=[0.1, 0.1, 0.1])
    materials = {name: _stock_material(tile) for name, tile in baked.albedo.items()}
    for surface in baked.scene.surfaces:
        (width, height), tile_m = surface.size_m, baked.scene.textures[surface.material].tile_m
        primitive = pyrender.Primitive(
            positions=corners(surface),
            normals=np.tile(surface.normal, (4, 1)),
            texcoord_0=np.array([[0, 0], [width, 0], [width, height], [0, height]]) / tile_m,
            indices=np.array([[0, 1, 2], [0, 2, 3]]),
            material=materials[surface.material],
            mode=4,
        )
        scene.add(pyrender.Mesh([primitive]))
    for lamp in baked.scene.lights:
        scene.add(
            _stock_lamp(lamp, white_cd_m2), pose=se3.transform(np.eye(3), lamp.surface.at(np.array(0.5), np.array(0.5)))
        )
    lens = LENSES["paper_literal"]
    camera = pyrender.IntrinsicsCamera(lens.fx_px, lens.fy_px, lens.cx_px + 0.5, lens.cy_px + 0.5, NEAR_M, FAR_M)
    return scene, scene.add(camera)


def _stock_material(tile: Map) -> Any:
    import pyrender

    source = np.repeat(np.rint(255 * tile).astype(np.uint8)[..., None], 3, 2)
    texture = pyrender.Texture(source=source, source_channels="RGB")
    # Floats: pyrender reads the integer 1 as 1/255.
    return pyrender.MetallicRoughnessMaterial(
        baseColorTexture=texture, baseColorFactor=[1.0, 1.0, 1.0, 1.0], metallicFactor=0.0, roughnessFactor=1.0
    )


def _stock_lamp(lamp: AreaLight, white_cd_m2: float) -> Any:
    """A spot as bright as the lamp, in a unit that puts white at 1, as pyrender clips there."""
    import pyrender

    return pyrender.SpotLight(
        color=np.ones(3),
        intensity=lamp.power_lm / np.pi / white_cd_m2,
        innerConeAngle=np.pi / 4,
        outerConeAngle=np.pi / 2.2,
    )


def table(rows: list[tuple[str, str, Cost]]) -> str:
    """All costs, and how many times stock pyrender with shadows each is faster, by CPU time."""
    reference = {view: cost.cpu_ms for name, view, cost in rows if name == "stock pyrender, shadows"}
    lines = [f"{'per stereo pair':32}{'view':8}{'wall ms':>10}{'CPU ms':>10}{'CPU ratio':>11}"]
    for name, view, cost in rows:
        ratio = reference[view] / cost.cpu_ms
        lines.append(f"{name:32}{view:8}{cost.wall_ms:10.1f}{cost.cpu_ms:10.1f}{ratio:10.1f}x")
    return "\n".join(lines)


def main() -> None:
    """Bake the room, draw it in every way, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=12, help="poses per measurement")
    poses = stand_points(parser.parse_args().views)
    spec = yaml_file.read(catalog.find("scene", "room").path, SceneFile)
    started, cpu_started = time.perf_counter(), time.process_time()
    baked = bake(build(spec, {}), BakeSettings())
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print(f"bake: {time.perf_counter() - started:.1f} s wall, {time.process_time() - cpu_started:.1f} s CPU")
    # Stock pyrender comes last: when it ends, it takes the process's EGL display with it.
    print(table([*ours(baked, spec.white_cd_m2, poses), *stock(baked, spec.white_cd_m2, poses)]))


if __name__ == "__main__":
    main()
