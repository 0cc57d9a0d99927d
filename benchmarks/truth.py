"""What ground truth costs: each channel of one picture, alone and all together, and recording them.

    python benchmarks/truth.py [--scenes room office] [--poses 9]

720 × 480, the paper's lens looking 15° down. Milliseconds are medians over poses, wall clock and CPU over
all threads. A channel's time includes finding what each pixel sees, which all of them share. Before they are
measured, 100 pictures of `shadow` are drawn, in which it learns about the planes that are seen.
"""

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vobench.geometry import se3
from vobench.geometry.rig import LENSES, looking, stereo_rig
from vobench.geometry.se3 import Array
from vobench.rendering.truth import CameraShot, TruthCaster
from vobench.scene.scene import triangles
from vobench.sensor.pixel_truth import CHANNELS
from vobench.sequence import SequenceWriter
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

LENS = LENSES["paper_literal"]
PITCH_DEG = 15.0
STEP_NS = 100_000_000
STEP_RAD = 0.05
RING_M = 1.5
WARM_UP_PICTURES = 100


def poses(count: int) -> list[tuple[CameraShot, CameraShot]]:
    """Pairs of successive pictures on a circle around the room's middle."""
    mount = looking(pitch_deg=PITCH_DEG, position_m=(0.25, 0.06, 0.4))

    def at(angle: float) -> Array:
        place = [RING_M * np.cos(angle), RING_M * np.sin(angle), 0.0]
        return se3.transform(se3.rotation_z(angle + np.pi / 2), place) @ mount

    angles = np.linspace(0, 2 * np.pi, count, endpoint=False).tolist()
    return [(CameraShot(at(a), 0), CameraShot(at(a + STEP_RAD), STEP_NS)) for a in angles]


def median_ms(
    work: Callable[[CameraShot, CameraShot], object], pairs: list[tuple[CameraShot, CameraShot]]
) -> tuple[float, float]:
    """Wall and CPU time; the first pose is done once before it counts."""
    work(*pairs[0])
    spent = []
    for now, later in pairs:
        wall = time.perf_counter()
        cpu = time.process_time()
        work(now, later)
        spent.append((time.perf_counter() - wall, time.process_time() - cpu))
    wall_s, cpu_s = np.median(spent, axis=0)
    return 1e3 * wall_s, 1e3 * cpu_s


def warm_up(caster: TruthCaster, pairs: list[tuple[CameraShot, CameraShot]]) -> None:
    """What `shadow` costs until what it knows of the planes before the camera pays."""
    started = time.process_time()
    pictures = 0
    while pictures < WARM_UP_PICTURES:
        for now, _ in pairs:
            caster.frame(LENS, now, ("shadow",))
            pictures += 1
    print(f"  the first {pictures} images' shadow: {1e3 * (time.process_time() - started) / pictures:.0f} CPU ms each")


def cast(caster: TruthCaster, pairs: list[tuple[CameraShot, CameraShot]]) -> None:
    """A line for each channel, and one for all."""
    for name, channels in (*((name, (name,)) for name in CHANNELS), ("all", tuple(CHANNELS))):

        def work(now: CameraShot, later: CameraShot, channels: tuple[str, ...] = channels) -> None:
            caster.frame(LENS, now, channels, later=later)

        wall_ms, cpu_ms = median_ms(work, pairs)
        print(f"  {name:12}{wall_ms:9.1f}{cpu_ms:9.1f}")


def record(caster: TruthCaster, pairs: list[tuple[CameraShot, CameraShot]]) -> None:
    """A line for each channel: what writing it takes, and its size in the file."""
    rig = stereo_rig(LENS, pitch_deg=PITCH_DEG)
    frames = [caster.frame(LENS, now, later=later) for now, later in pairs]
    for name in CHANNELS:
        with tempfile.TemporaryDirectory() as folder:
            started = time.process_time()
            with SequenceWriter(Path(folder), rig, case_json=b"{}", truth_channels=[name]) as writer:
                empty = time.process_time() - started
                for index, frame in enumerate(frames):
                    alone = type(frame)(**{name: frame.channels()[name]})
                    writer.write_truth_frame(index, "left", alone)
            cpu_ms = 1e3 * (time.process_time() - started - empty) / len(frames)
            kb = (Path(folder) / "truth.mcap").stat().st_size / len(frames) / 1e3
        print(f"  {name:12}{cpu_ms:9.1f}{kb:9.1f}")


def main() -> None:
    """Print both tables for each scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", default=["room", "office"])
    parser.add_argument("--poses", type=int, default=9)
    arguments = parser.parse_args()
    pairs = poses(arguments.poses)
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    for name in arguments.scenes:
        scene = build(read_scene(catalog.find("scene", name).path), {})
        caster = TruthCaster(scene)
        print(f"{name}: {len(triangles(scene))} faces, {len(scene.lights)} lights")
        warm_up(caster, pairs)
        print(f"  {'channel':12}{'wall ms':>9}{'CPU ms':>9}")
        cast(caster, pairs)
        print(f"  {'recorded':12}{'CPU ms':>9}{'kB':>9}")
        record(caster, pairs)


if __name__ == "__main__":
    main()
