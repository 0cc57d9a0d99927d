"""Where each case's robot goes, and whether it can: known before anything is rendered."""

import numpy as np
from numpy.typing import NDArray

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
        outside = np.any(np.abs(at_m - [0, 0, size_m[2] / 2]) >= size_m / 2, axis=1)
        size = " × ".join(f"{side:g}" for side in size_m)
        _refuse(case, motion, at_m, outside, f"leaves the room ({size} m around the origin)")
        for b in case.scene.boxes:
            in_box_m = np.abs((at_m - b.center_m) @ se3.rotation_z(np.deg2rad(b.yaw_deg)))
            inside = np.all(in_box_m <= np.array(b.size_m) / 2, axis=1)
            _refuse(case, motion, at_m, inside, f"is inside the box of {b.material} at {b.center_m} m")


def _refuse(case: Case, motion: Drive, at_m: Array, wrong: NDArray[np.bool_], what: str) -> None:
    """Raise MotionError for the first instant at which a camera is where it cannot be."""
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        where = ", ".join(f"{x:.2f}" for x in at_m[first])
        raise MotionError(
            f"a camera of rig '{case.variant['rig']}' {what} of scene '{case.variant['scene']}' "
            f"after {motion.t_ns[first] / 1e9:.1f} s, at ({where}) m"
        )
