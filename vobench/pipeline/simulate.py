"""Case to sequence: the robot drives, the renderer sees, the chip exposes, the recording keeps."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vobench.errors import MotionError
from vobench.pipeline.workshop import Workshop
from vobench.render.bake import BakedScene, BakeSettings, bake
from vobench.render.baked_file import load_baked, save_baked
from vobench.render.renderer import Renderer
from vobench.results.store import Store, code_digest, library_versions
from vobench.robot.controller import CONTROLLERS
from vobench.robot.drive import Drive, drive
from vobench.robot.pioneer import THETAS
from vobench.robot.slip import SLIPS, STREAMS
from vobench.sensor.camera import CAMERAS, CameraSensor, FixedPattern, Grey, Radiance, expose, fixed_pattern
from vobench.sensor.encoder import ENCODERS, ticks
from vobench.sequence import SequenceWriter
from vobench.suite.expand import Case, Plan

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
        "case": case.model_dump(mode="json", exclude={"name": True, "variant": True, "scene": {"summary"}}),
        "code": code_digest("geometry", "robot", "scene", "sensor", "render", "sequence"),
        "libraries": library_versions(*LIBRARIES),
    }


def drive_case(case: Case) -> Drive:
    """The case's robot on its way; the same for every scene, rig and camera. Raises MotionError."""
    t = case.trajectory
    return drive(
        t.targets_m,
        theta=THETAS[t.robot],
        controller=CONTROLLERS[t.controller],
        slip=SLIPS[t.slip],
        start=(*t.start_m, np.deg2rad(t.start_heading_deg)),
        rate_hz=t.rate_hz,
        tolerance_m=t.tolerance_m,
        max_time_s=t.max_time_s,
        rngs={stream: generator(case.seed, f"slip.{stream}") for stream in STREAMS},
    )


def drive_all(plan: Plan) -> dict[str, Drive]:
    """The drive of each trajectory of a plan, by its name: said before hours of rendering.

    Raises SuiteError or MotionError where a target cannot be reached, or a camera leaves the room.
    """
    drives: dict[str, Drive] = {}
    for case in plan.cases:
        name = case.variant["trajectory"]
        with plan.at("trajectories", name):
            if name not in drives:
                drives[name] = drive_case(case)
            _check_in_room(case, drives[name])
    return drives


def _check_in_room(case: Case, motion: Drive) -> None:
    rig, size_m = case.build_rig(), np.array(case.scene.room.size_m)
    for T_body_camera in (rig.T_body_left, rig.T_body_right):
        at_m = (motion.T_world_body @ T_body_camera)[:, :3, 3]
        outside = (np.abs(at_m[:, :2]) >= size_m[:2] / 2).any(1) | (at_m[:, 2] >= size_m[2])
        if outside.any():
            first, size = int(np.flatnonzero(outside)[0]), " × ".join(f"{side:g}" for side in size_m)
            where = ", ".join(f"{x:.2f}" for x in at_m[first])
            raise MotionError(
                f"a camera of rig '{case.variant['rig']}' leaves the room of scene '{case.variant['scene']}' "
                f"({size} m around the origin) after {motion.t_ns[first] / 1e9:.1f} s, at ({where}) m"
            )


def generator(seed: int, stream: str) -> np.random.Generator:
    """The random stream of that name: no other stream, and nothing else in a case, changes its draws."""
    name = int.from_bytes(hashlib.sha256(stream.encode()).digest()[:8], "big")
    return np.random.default_rng([seed, name])


def _record(case: Case, folder: Path, shop: Workshop) -> None:
    # OpenGL is loaded only where pictures are drawn, so that cached cases need none.
    from vobench.render.raster import RasterRenderer

    motion, rig = drive_case(case), case.build_rig()
    renderer = RasterRenderer(_baked(case, shop))
    try:
        frames = _pictures(case, motion, renderer)
        with SequenceWriter(folder, rig, case_json=case.model_dump_json().encode()) as writer:
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
        self._noise = generator(case.seed, f"camera.{side}.noise")
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
