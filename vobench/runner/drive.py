"""Drives the trajectories of a suite without rendering: the motion of the body, its wheels and its motors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from vobench.errors import InputError, VobenchError, require_known
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.drive import Waypoints
from vobench.motion.motor import loop_voltages, wheel_voltages
from vobench.motion.wheeled import Wheeled
from vobench.runner.data_frame import data_frame
from vobench.runner.motion import BodyMotion, body_motion, check_cases, motion_name, place_in_suite
from vobench.runner.sensors import wheel_error_m
from vobench.suite.case import Case
from vobench.suite.floor_outline import floor_outlines_m
from vobench.suite.plan import Plan
from vobench.suite.scene_spec import SceneFile
from vobench.trajectory.kinematics import Kinematics
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

# The columns of a drive's CSV file that `identify_drives` reads.
RIM_COLUMNS = ("left_rim_rad", "right_rim_rad")
REFERENCE_COLUMNS = ("u_ref_mps", "omega_ref_radps")

POSE_COLUMNS = ("x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")
TWIST_COLUMNS = ("vx_mps", "vy_mps", "vz_mps", "wx_radps", "wy_radps", "wz_radps")
ACCELERATION_COLUMNS = ("ax_mps2", "ay_mps2", "az_mps2")
VOLTAGE_COLUMNS = ("left_V", "right_V")


@dataclass(frozen=True, slots=True)
class TrajectoryDrive:
    """The drive along one trajectory of a suite.

    `name` is the name of the motion.
    `case` is the first of the cases with this motion.
    `motion` is the motion of the body for the whole drive.
    `body` is the true motion at the stamps of the N frames.
    `refusals` are the reasons why `vobench run` would refuse cases with this motion, for example because a camera
    leaves the room.
    `place` is the scene of all of these cases, or None if they are in several scenes.
    """

    name: str
    case: Case
    motion: BodyMotion
    body: Kinematics
    refusals: tuple[str, ...]
    place: SceneFile | None = None

    @property
    def kind(self) -> str:
        """The kind of trajectory and, for a wheeled body, its mover: for example "waypoints, pioneer"."""
        spec = self.case.trajectory
        if isinstance(spec, Wheeled):
            return f"{spec.kind}, {spec.mover}"
        return spec.kind

    @property
    def frames(self) -> slice:
        """The frames of the case in the whole drive."""
        first = self.motion.first
        return slice(first, first + len(self.motion.t_ns))

    @property
    def reached_s(self) -> Array | None:
        """The times (K,) in s at which the K targets were reached; None without targets."""
        drive = self.motion.drive
        if drive is None or not isinstance(self.case.trajectory, Waypoints):
            return None
        return drive.t_ns[list(drive.reached)] / NS_PER_S

    @property
    def rim_rad(self) -> Array | None:
        """The angles (N, 2) in rad of the left and right rim at the frames; None for a body without wheels."""
        rims = self.motion.rims
        if rims is None:
            return None
        # Every stamp of a frame is also a stamp of the rims.
        rows_of_frames = np.searchsorted(rims.t_ns, self.motion.t_ns)
        return rims.rim_rad[rows_of_frames]

    @property
    def references(self) -> Array | None:
        """The reference speeds in m/s and yaw rates in rad/s (N, 2) of the controller; None without a controller."""
        drive = self.motion.drive
        return None if drive is None else drive.references[self.frames]

    @property
    def voltages_V(self) -> Array | None:
        """The voltages (N, 2) of the left and right motor; None if the suite contains no motor constants."""
        drive = self.motion.drive
        spec = self.case.trajectory
        if drive is None or not isinstance(spec, Wheeled) or spec.motors is None:
            return None

        u, omega = drive.state[:, 3:].T
        u_ref, omega_ref = drive.references.T
        u_rate, omega_rate = drive.rates.T
        v_u, v_omega = loop_voltages((u, omega), (u_ref, omega_ref), (u_rate, omega_rate), motors=spec.motors)
        left_and_right = np.stack(wheel_voltages(v_u, v_omega), -1)
        return left_and_right[self.frames]

    def as_dict(self) -> dict[str, Any]:
        """The summary of this drive as plain JSON values, as `vobench drive --json` prints it."""
        t_ns = self.motion.t_ns
        voltages_V = self.voltages_V
        reached_s = self.reached_s
        speeds_mps = np.linalg.norm(self.body.velocity_mps, axis=1)
        turns_radps = np.linalg.norm(self.body.angular_velocity_radps, axis=1)
        max_turn_per_frame_rad = _step_angles_rad(self.body).max()
        return {
            "trajectory": self.name,
            "kind": self.kind,
            "frames": len(t_ns),
            "duration_s": float(t_ns[-1] - t_ns[0]) / NS_PER_S,
            "path_m": float(_step_lengths_m(self.body).sum()),
            "max_speed_mps": float(speeds_mps.max()),
            "max_turn_degps": float(np.rad2deg(turns_radps.max())),
            "max_turn_per_frame_deg": float(np.rad2deg(max_turn_per_frame_rad)),
            "wheel_error_m": wheel_error_m(self.case, self.motion),
            "peak_V": None if voltages_V is None else float(np.abs(voltages_V).max()),
            "reached_s": None if reached_s is None else reached_s.tolist(),
            "refused": list(self.refusals),
        }

    def outlines_m(self) -> Array:
        """The outlines of the place as segments (S, 2, 2) in the plane.

        There are none if the drive is in several places, or if the place cannot be built. `refusals` has the reason.
        """
        no_outlines_m = np.zeros((0, 2, 2))
        if self.place is None:
            return no_outlines_m
        try:
            return floor_outlines_m(self.place)
        except VobenchError:
            return no_outlines_m

    def trajectory(self) -> Trajectory:
        """The true path of the body, with one pose per frame."""
        return Trajectory(self.motion.t_ns, self.body.T_world_body)

    def tum(self) -> str:
        """The true path of the body as the text of a TUM file."""
        return format_tum(self.trajectory())

    def csv(self) -> str:
        """The true motion at the frames as the text of a CSV file, one row per frame.

        Poses are in the world. Velocities and accelerations are in the axes of the body. The rim angles, references and
        motor voltages follow if the body has them.
        """
        positions_m = self.body.T_world_body[:, :3, 3]
        quaternions_xyzw = se3.to_quaternion(self.body.T_world_body[:, :3, :3])
        columns: list[tuple[Sequence[str], Array | None]] = [
            (POSE_COLUMNS, np.concatenate([positions_m, quaternions_xyzw], -1)),
            (TWIST_COLUMNS, self.body.twist),
            (ACCELERATION_COLUMNS, self.body.acceleration_mps2),
            (RIM_COLUMNS, self.rim_rad),
            (REFERENCE_COLUMNS, self.references),
            (VOLTAGE_COLUMNS, self.voltages_V),
        ]

        heading = ["t_ns"]
        known_values = []
        for names, values in columns:
            if values is not None:
                heading += names
                known_values.append(values)

        lines = [",".join(heading)]
        rows = np.concatenate(known_values, -1).tolist()
        for t_ns, row in zip(self.motion.t_ns.tolist(), rows, strict=True):
            cells = [str(t_ns), *map(repr, row)]  # repr has all digits of a number
            lines.append(",".join(cells))
        return "\n".join(lines) + "\n"


@dataclass(frozen=True, slots=True)
class SuiteDrive:
    """The drives along the trajectories of a suite, in the order of the suite."""

    drives: tuple[TrajectoryDrive, ...]

    @property
    def refusals(self) -> tuple[str, ...]:
        """The refusals of all drives, without duplicates."""
        all_refusals = [refusal for drive in self.drives for refusal in drive.refusals]
        return tuple(dict.fromkeys(all_refusals))

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values: the summary of each drive."""
        return {"trajectories": [drive.as_dict() for drive in self.drives]}

    def to_frame(self) -> "DataFrame":
        """A pandas table with one row per trajectory; its columns are the keys of `TrajectoryDrive.as_dict`."""
        return data_frame(drive.as_dict() for drive in self.drives)


def chosen_trajectories(plan: Plan, *, trajectory: str | None = None) -> tuple[str, ...]:
    """The names of the motions of the plan's cases, or only those of the requested trajectory.

    A body that wanders has one motion for each seed in each scene. Raises InputError for a suite of recordings, and
    UnknownNameError for a name that is not in the suite.
    """
    names = tuple(dict.fromkeys(motion_name(case) for case in plan.simulated))
    if not names:
        raise InputError(f"suite '{plan.suite.name}' has no trajectory to drive, only recordings")
    if trajectory is None:
        return names
    chosen = tuple(name for name in names if _is_motion_of(name, trajectory))
    if not chosen:
        require_known("trajectory", trajectory, names)  # raises, because no motion has this name
    return chosen


def _is_motion_of(name: str, trajectory: str) -> bool:
    """Whether a motion belongs to a trajectory of the suite, or has this name.

    The motions of trajectory t are named `t`, with a seed `t.SEED`, and in a scene `t in SCENE`.
    """
    return name == trajectory or name.startswith((f"{trajectory}.", f"{trajectory} in "))


def drive_plan(plan: Plan, *, trajectory: str | None = None) -> SuiteDrive:
    """Drive the trajectories of a plan, or one of them, without rendering.

    Raises:
        InputError: the suite has no trajectories.
        UnknownNameError: it has no trajectory of this name.
        SuiteError: a body cannot follow its trajectory, for example because a target is out of reach.
    """
    names = chosen_trajectories(plan, trajectory=trajectory)
    return SuiteDrive(tuple(drive_trajectory(plan, name) for name in names))


def drive_trajectory(plan: Plan, name: str) -> TrajectoryDrive:
    """Drive the cases of a plan that have one motion. Raises SuiteError if the body cannot follow it."""
    cases = [case for case in plan.simulated if motion_name(case) == name]
    mistakes = plan.mistakes()
    first_case = cases[0]
    with mistakes.at(*place_in_suite(first_case, "trajectory")):
        motion = body_motion(first_case)
    mistakes.require_none()

    # From here on, mistakes do not prevent the drive. They are reported as refusals.
    check_cases(cases, motion, mistakes)
    refusals = dict.fromkeys(str(mistake) for mistake in mistakes.recorded)  # without duplicates
    place_names = {case.scene.place_name for case in cases}
    return TrajectoryDrive(
        name=name,
        case=first_case,
        motion=motion,
        body=motion.at_frames(),
        refusals=tuple(refusals),
        place=first_case.scene if len(place_names) == 1 else None,
    )


def _step_lengths_m(body: Kinematics) -> Array:
    """The distances (N - 1,) between the positions of successive frames."""
    steps_m = np.diff(body.T_world_body[:, :3, 3], axis=0)
    return np.asarray(np.linalg.norm(steps_m, axis=1))


def _step_angles_rad(body: Kinematics) -> Array:
    """The angles (N - 1,) between the orientations of successive frames; one 0 for a single frame."""
    R_world_body = body.T_world_body[:, :3, :3]
    if len(R_world_body) == 1:
        return np.zeros(1)
    R_body_world = np.swapaxes(R_world_body[:-1], -1, -2)
    return se3.rotation_angle(R_body_world @ R_world_body[1:])
