"""Case to sequence: the robot drives, the renderer sees, the chip exposes, the recording keeps."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vobench.pipeline.motion import drive_case
from vobench.pipeline.stream import generator
from vobench.pipeline.workshop import Workshop
from vobench.render.bake import BakedScene, BakeSettings, bake
from vobench.render.baked_file import load_baked, save_baked
from vobench.render.egl import require_drawing
from vobench.render.renderer import Renderer
from vobench.results.store import Store, canonical, code_digest, library_versions
from vobench.robot.drive import Drive
from vobench.sensor.camera import (
    CAMERAS,
    CameraSensor,
    FixedPattern,
    Grey,
    NoiseStreams,
    Radiance,
    expose,
    fixed_pattern,
)
from vobench.sensor.encoder import ENCODERS, ticks
from vobench.sequence import SequenceWriter
from vobench.suite.expand import Case

BAKE = BakeSettings()
LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "pyrender", "embreex", "mcap", "rosbags")


def simulate(case: Case, shop: Workshop) -> Path:
    """The folder of the case's sequence; made where the store has none of these inputs."""
    return shop.store.get("sequences", sequence_inputs(case), lambda folder: _record(case, folder, shop))


def is_simulated(case: Case, store: Store) -> bool:
    """Whether the store has the case's sequence already."""
    return store.path("sequences", sequence_inputs(case)).is_dir()


def sequence_inputs(case: Case) -> dict[str, Any]:
    """All that a sequence's bytes depend on; the names of the variants are not among it."""
    return {
        "case": _content(case),
        "bake": repr(BAKE),
        "code": code_digest("geometry", "robot", "scene", "sensor", "render", "sequence", "suite", "pipeline"),
        "libraries": library_versions(*LIBRARIES),
    }


def _content(case: Case) -> dict[str, Any]:
    """What is simulated, without what the suite calls it: the same for equal cases of two suites."""
    return case.model_dump(mode="json", exclude={"name": True, "variant": True, "scene": {"summary"}})


def _record(case: Case, folder: Path, shop: Workshop) -> None:
    # OpenGL is loaded only where pictures are drawn, so that cached cases need none.
    from vobench.render.raster import RasterRenderer

    require_drawing()  # said before the light is computed
    motion, rig = drive_case(case), case.build_rig()
    renderer = RasterRenderer(_baked(case, shop))
    try:
        frames = _pictures(case, motion, renderer)
        with SequenceWriter(folder, rig, case_json=canonical(_content(case)).encode()) as writer:
            _write(writer, case, motion, shop.progress.track(frames, f"simulate {case.name}", total=len(motion.t_ns)))
    finally:
        renderer.close()


def _write(writer: SequenceWriter, case: Case, motion: Drive, frames: Iterator[tuple[Grey, Grey]]) -> None:
    counts = ticks(motion.rim_rad, case.build_rig().wheels, ENCODERS[case.trajectory.encoders])
    # Readings up to each frame's stamp go before it.
    ends = np.searchsorted(motion.encoder_t_ns, motion.t_ns, side="right")
    starts = np.concatenate([[0], ends[:-1]])
    for index, (left, right) in enumerate(frames):
        t_ns, new = int(motion.t_ns[index]), slice(starts[index], ends[index])
        writer.write_encoders(motion.encoder_t_ns[new], counts[new])
        writer.write_frame(t_ns, left, right)
        writer.write_truth(t_ns, motion.T_world_body[index], motion.twist[index])


def _pictures(case: Case, motion: Drive, renderer: Renderer) -> Iterator[tuple[Grey, Grey]]:
    rig, chips = case.build_rig(), [_Chip(case, side) for side in ("left", "right")]
    for T_world_body in motion.T_world_body:
        left = renderer.radiance(rig.left, T_world_body @ rig.T_body_left)
        right = renderer.radiance(rig.right, T_world_body @ rig.T_body_right)
        yield chips[0].expose(left), chips[1].expose(right)


class _Chip:
    """One camera's chip with its own noise and fixed pattern."""

    def __init__(self, case: Case, side: str) -> None:
        self._sensor = _sensor(case)
        self._white_cd_m2 = case.scene.white_cd_m2
        streams = (generator(case.seed, f"camera.{side}.{kind}") for kind in ("shot", "read"))
        self._noise = NoiseStreams(*streams)
        self._pattern_rng = generator(case.seed, f"camera.{side}.pattern")
        self._pattern: FixedPattern | None = None

    def expose(self, luminance_cd_m2: Radiance) -> Grey:
        if self._pattern is None:
            self._pattern = fixed_pattern(luminance_cd_m2.shape, self._sensor, self._pattern_rng)
        return expose(luminance_cd_m2 / self._white_cd_m2, self._sensor, self._noise, pattern=self._pattern)


def _sensor(case: Case) -> CameraSensor:
    return replace(CAMERAS[case.camera.sensor], exposure_gain=case.camera.exposure_gain)


def _baked(case: Case, shop: Workshop) -> BakedScene:
    """The case's scene with its light, from the store where it has been computed before."""
    scene = case.build_scene()
    inputs = {
        "scene": case.scene.model_dump(mode="json", exclude={"summary", "white_cd_m2"}),
        "lighting": {name: lamp.power_lm for name, lamp in case.lighting.items()},
        "settings": repr(BAKE),
        "code": code_digest("geometry", "scene", "render"),
        "libraries": library_versions("numpy", "scipy", "embreex"),
    }

    def build(folder: Path) -> None:
        with shop.progress.step(f"light of {scene.name}"):
            save_baked(folder, bake(scene, BAKE))

    return load_baked(shop.store.get("bakes", inputs, build), scene)
