"""Where each case's robot goes, and whether it can: known before anything is rendered."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.pipeline.stream import generator
from vobench.robot.controller import CONTROLLERS
from vobench.robot.drive import Drive, drive
from vobench.robot.pioneer import THETAS
from vobench.robot.slip import SLIPS, STREAMS
from vobench.suite.expand import Case, Plan


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


BodyPath = Callable[[NDArray[np.int64]], Array]


def body_path(motion: Drive) -> BodyPath:
    """T_world_body (K, 4, 4) at any instants (K,) of a drive; at rest before it, going on evenly for a hair after.

    A cubic spline through the encoder instants, where the integrator's own states lie.
    """
    t_s = motion.encoder_t_ns / 1e9
    if len(t_s) < 2:
        return lambda t_ns: np.broadcast_to(motion.T_world_body[0], (len(t_ns), 4, 4))
    spline = CubicSpline(t_s, motion.axle)

    def poses(t_ns: NDArray[np.int64]) -> Array:
        x, y, heading = spline(np.maximum(t_ns / 1e9, t_s[0])).T
        return se3.transform(se3.rotation_z(heading), np.stack([x, y, np.zeros_like(x)], -1))

    return poses


def drive_all(plan: Plan) -> dict[str, Drive]:
    """The drive of each trajectory of a plan, by its name: said before hours of rendering.

    Raises SuiteError or MotionError where a target cannot be reached, a camera leaves the room, or
    its pictures take longer than a frame.
    """
    drives: dict[str, Drive] = {}
    for case in plan.cases:
        name = case.variant["trajectory"]
        with plan.at("trajectories", name):
            if name not in drives:
                drives[name] = drive_case(case)
            _check_in_room(case, drives[name])
        with plan.at("cameras", case.variant["camera"]):
            _check_fits_frame(case)
    return drives


def _check_fits_frame(case: Case) -> None:
    """Raise MotionError where a picture would still be exposed or read out when the next one begins."""
    camera, frame_ms = case.camera, 1e3 / case.trajectory.rate_hz
    durations = {"exposure_ms": camera.exposure_ms, "readout_ms": camera.readout_ms or 0.0}
    if camera.auto_exposure:
        durations["auto_exposure.t_max_ms"] = camera.auto_exposure.t_max_ms
    for key, lasts_ms in durations.items():
        if lasts_ms > frame_ms:
            raise MotionError(
                f"{key} {lasts_ms:g} is longer than a frame of trajectory '{case.variant['trajectory']}', "
                f"which lasts {frame_ms:.3g} ms at {case.trajectory.rate_hz:g} Hz"
            )


def _check_in_room(case: Case, motion: Drive) -> None:
    rig, room = case.build_rig(), case.scene.room
    for T_body_camera in map(rig.T_body_camera, rig.sides):
        at_m = (motion.T_world_body @ T_body_camera)[:, :3, 3]
        _refuse(case, motion, at_m, ~room.holds(at_m), f"leaves the room ({room.extent})")
        for b in case.scene.boxes:
            T_world_box = se3.transform(se3.rotation_z(np.deg2rad(b.yaw_deg)), b.center_m)
            inside = _within(at_m, T_world_box, b.size_m)
            _refuse(case, motion, at_m, inside, f"is inside the box of {b.material} at {b.center_m} m")
        for spec, mover in zip(case.scene.movers, case.build_scene().movers, strict=True):
            T_world_mover = np.stack([mover.path.pose(t_ns) for t_ns in motion.t_ns])
            inside = _within(at_m, T_world_mover, spec.size_m)
            _refuse(case, motion, at_m, inside, f"is inside the mover '{spec.name}'")


def _within(at_m: Array, T_world_box: Array, size_m: tuple[float, float, float]) -> NDArray[np.bool_]:
    """Which points (N, 3) are within a box around the origin of its frame, (4, 4) or (N, 4, 4)."""
    in_box_m = se3.apply(se3.inverse(T_world_box), at_m[:, None])[:, 0]
    within: NDArray[np.bool_] = np.all(np.abs(in_box_m) <= np.array(size_m) / 2, axis=-1)
    return within


def _refuse(case: Case, motion: Drive, at_m: Array, wrong: NDArray[np.bool_], what: str) -> None:
    """Raise MotionError for the first instant at which a camera is where it cannot be."""
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        where = ", ".join(f"{x:.2f}" for x in at_m[first])
        raise MotionError(
            f"a camera of rig '{case.variant['rig']}' {what} of scene '{case.variant['scene']}' "
            f"after {motion.t_ns[first] / 1e9:.1f} s, at ({where}) m"
        )
