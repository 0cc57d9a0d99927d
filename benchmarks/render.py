"""What pictures cost: the engines raster and pyrender on the same scenes, with mirrors, lenses, strips and blur.

    python benchmarks/render.py [--views 12] [--fine]

Times are medians per stereo pair of 720 × 480, wall clock and CPU over all threads. Compare within a run only.
"""

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import KannalaBrandt
from vobench.geometry.rig import LENSES, Rig, stereo_rig
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.pyrender_engine import PyrenderRenderer
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Renderer, View, single_instant
from vobench.scene.material import Map
from vobench.scene.scene import Scene
from vobench.sensor.image_sensor import CameraSettings, NoiseStreams, expose
from vobench.sequence import SequenceWriter
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

VIEWS = {"down": 90.0, "ahead": 15.0}
NS_PER_FRAME = 100_000_000
# What is drawn does not depend on how finely light was sampled.
QUICK = BakeSettings(spacing_m=0.05, light_rays=4, indirect_spacing_m=0.2, indirect_rays=16)
FISHEYE = KannalaBrandt(720, 480, 290.0, 290.0, 359.5, 239.5, 0.0, 0.0, 0.0, 0.0)
STOCK = ": engine pyrender"
Shoot = Callable[[Renderer, Rig, Array], object]


@dataclass(frozen=True, slots=True)
class Cost:
    """Median milliseconds of one stereo pair."""

    wall_ms: float
    cpu_ms: float


Row = tuple[str, str, Cost]


def measure(work: Callable[[Array], object], poses: list[Array]) -> Cost:
    """The median cost of `work` over poses; the first one warms up and does not count."""
    spent = []
    for T_world_body in poses:
        wall = time.perf_counter()
        cpu = time.process_time()
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
        self._renderer = renderer
        self._rig = rig
        self._writer = writer
        self._white_cd_m2 = white_cd_m2
        self._noise = NoiseStreams(*np.random.default_rng(0).spawn(2))
        self._frames = 0

    def record(self, T_world_body: Array) -> None:
        """Add one pair and its truth."""
        rig = self._rig
        t_ns = self._frames * NS_PER_FRAME
        light = (picture / self._white_cd_m2 for picture in pair(self._renderer, rig, T_world_body))
        left, right = (expose(picture, CameraSettings(), self._noise) for picture in light)
        self._writer.write_frame(t_ns, left, right)
        self._writer.write_truth(t_ns, T_world_body, np.zeros(6))
        self._frames += 1


def pair(renderer: Renderer, rig: Rig, T_world_body: Array) -> list[Map]:
    """Both eyes' pictures, each at one instant."""
    eyes = ((rig.left, T_world_body @ rig.T_body_left), (rig.right, T_world_body @ rig.T_body_right))
    return [renderer.radiance(camera, single_instant(camera, T)) for camera, T in eyes]


def blurred(renderer: Renderer, rig: Rig, T_world_body: Array) -> None:
    """Both eyes, eight sub-frames each."""
    way = T_world_body @ se3.transform(np.eye(3), np.linspace([0, 0, 0], [0.01, 0, 0], 8))
    now = np.zeros(8, np.int64)
    for T_body_camera in (rig.T_body_left, rig.T_body_right):
        renderer.radiance(rig.left, [View(slice(0, rig.left.height_px), way @ T_body_camera, now, now)])


def rolled(renderer: Renderer, rig: Rig, T_world_body: Array) -> None:
    """Both eyes, sixty strips each."""
    edges = np.linspace(0, rig.left.height_px, 61).astype(int).tolist()
    now = np.zeros(1, np.int64)
    for T_body_camera in (rig.T_body_left, rig.T_body_right):
        T = (T_world_body @ T_body_camera)[None]
        renderer.radiance(rig.left, [View(slice(a, b), T, now, now) for a, b in pairwise(edges)])


def room_rows(scene: Scene, settings: BakeSettings, white_cd_m2: float, poses: list[Array]) -> Iterator[Row]:
    """Costs of drawing a room in every way."""
    renderer = RasterRenderer(bake(scene, settings))
    for view, rig in _rigs():
        for name, shoot in (("", pair), (", 60 strips", rolled), (", 8 sub-frames", blurred)):
            yield "room" + name, view, measure(partial(shoot, renderer, rig), poses)
        fisheye = stereo_rig(FISHEYE, pitch_deg=VIEWS[view])
        yield "room, fisheye", view, measure(partial(pair, renderer, fisheye), poses)
    yield from _recorded("room", renderer, white_cd_m2, poses)
    renderer.close()


def office_rows(office: Scene, settings: BakeSettings, white_cd_m2: float, poses: list[Array]) -> Iterator[Row]:
    """Costs of the office: matt, with its polished floor, and with all its mirrors and panes."""
    bodies = {name: m.kind == "body" for name, m in office.materials.items()}
    matt = {name: replace(m, eta=1.0) if bodies[name] else m for name, m in office.materials.items()}
    plain = tuple(thing for thing in office.things if bodies[thing.material])
    variants: tuple[tuple[str, Scene, tuple[tuple[str, Shoot], ...]], ...] = (
        ("office, all matt", replace(office, things=plain, materials=matt), (("", pair),)),
        ("office, gloss and polished floor", replace(office, things=plain), (("", pair),)),
        ("office", office, (("", pair), (", 60 strips", rolled), (", 8 sub-frames", blurred))),
    )
    for name, scene, shots in variants:
        renderer = RasterRenderer(bake(scene, settings))
        for view, rig in _rigs():
            for suffix, shoot in shots:
                yield name + suffix, view, measure(partial(shoot, renderer, rig), poses)
        yield from _recorded(name, renderer, white_cd_m2, poses)
        renderer.close()


def _rigs() -> Iterator[tuple[str, Rig]]:
    for view, pitch_deg in VIEWS.items():
        yield view, stereo_rig(LENSES["paper_literal"], pitch_deg=pitch_deg)


def _recorded(name: str, renderer: RasterRenderer, white_cd_m2: float, poses: list[Array]) -> Iterator[Row]:
    for view, rig in _rigs():
        with (
            tempfile.TemporaryDirectory() as folder,
            SequenceWriter(Path(folder), rig, case_json=b"{}") as writer,
        ):
            recorder = Recorder(renderer, rig, writer, white_cd_m2)
            yield f"{name} + chip + PNG + MCAP", view, measure(recorder.record, poses)


def stock_rows(name: str, scene: Scene, white_cd_m2: float, poses: list[Array]) -> Iterator[Row]:
    """Costs of the engine pyrender: the stock renderer, 8 bits, four samples a pixel, shadow maps of four spots."""
    renderer = PyrenderRenderer(scene, white_cd_m2=white_cd_m2)
    for view, rig in _rigs():
        yield f"{name}{STOCK}", view, measure(partial(pair, renderer, rig), poses)
    renderer.close()


def table(rows: list[Row]) -> str:
    """All costs, and the CPU time of the engine pyrender in the same place over each."""
    reference = {(name, view): cost.cpu_ms for name, view, cost in rows if name.endswith(STOCK)}
    lines = [f"{'per stereo pair':48}{'view':8}{'wall ms':>10}{'CPU ms':>10}{'CPU ratio':>11}"]
    for name, view, cost in rows:
        place = name.split(",")[0].split(":")[0].split(" ")[0]
        ratio = reference[f"{place}{STOCK}", view] / cost.cpu_ms
        lines.append(f"{name:48}{view:8}{cost.wall_ms:10.1f}{cost.cpu_ms:10.1f}{ratio:10.1f}x")
    return "\n".join(lines)


def main() -> None:
    """Bake the scenes, draw them in every way, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--views", type=int, default=12, help="poses per measurement")
    parser.add_argument("--fine", action="store_true", help="bake as a simulation does, which takes minutes")
    arguments = parser.parse_args()
    poses = stand_points(arguments.views)
    settings = BakeSettings() if arguments.fine else QUICK
    specs = {name: read_scene(catalog.find("scene", name).path) for name in ("room", "office")}
    scenes = {name: build(spec, {}) for name, spec in specs.items()}
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    rows = [
        row
        for name, draw in (("room", room_rows), ("office", office_rows))
        for row in draw(scenes[name], settings, specs[name].white_cd_m2, poses)
    ]
    for name, scene in scenes.items():
        rows += stock_rows(name, scene, specs[name].white_cd_m2, poses)
    print(table(rows))


if __name__ == "__main__":
    main()
