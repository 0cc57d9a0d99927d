"""Computes the motion of a case's body and wheels, and checks whether a case can be simulated."""

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from vobench import stop
from vobench.errors import InputError, MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.motion.ackermann import ACKERMANNS, ackermann
from vobench.motion.controller import MOST_FRAMES, ControllerSettings
from vobench.motion.course import Planar, Unled, rolled
from vobench.motion.disturbance import DISTURBANCE_STREAMS, Generators
from vobench.motion.drive import Drive, Waypoints, follow, led_by, options
from vobench.motion.free_start import Startable, habits_of
from vobench.motion.handheld import Handheld
from vobench.motion.pioneer import Theta, feed_forward
from vobench.motion.replay import Replay
from vobench.motion.wander import Wander
from vobench.motion.wheeled import Wheeled
from vobench.rendering.geometry import RayCaster
from vobench.runner.wander import wander_motion
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing, Triangles, triangle_table
from vobench.suite.case import Case
from vobench.suite.clearance import at_free_start, column_on_wheels_m
from vobench.suite.plan import Plan
from vobench.suite.trajectory import TrajectorySpec, depends_on_place
from vobench.suite.yaml_file import checked
from vobench.suite.yaml_source import Mistakes
from vobench.trajectory.kinematics import Kinematics, Motion
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps
from vobench.trajectory.tum import parse_tum


def generator(seed: int, stream: str) -> np.random.Generator:
    """The random stream with a name. It does not depend on other streams or on the case."""
    digest = hashlib.sha256(stream.encode()).digest()
    stream_number = int.from_bytes(digest[:8], "big")
    return np.random.default_rng([seed, stream_number])


ENCODERS_PER_FRAME = 4
UP_M = 1e3  # the length of the ray that finds the ceiling


@dataclass(frozen=True, slots=True)
class Rims:
    """The angles (M, 2) in rad of the left and right rim at t_ns (M,), which the encoders measure."""

    t_ns: Stamps
    rim_rad: Array


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """The motion of a body, and the stamps t_ns (N,) of its pictures.

    All true poses, twists and accelerations come from `motion`, which can be evaluated at any time.
    `rims` are those of a body with wheels, and `drive` is that of a body with a controller.
    `first` is the index of the first picture among the pictures of the whole motion.
    `clearance_m` is the least distance from the body to anything, for one that wanders through free space.
    """

    motion: Motion
    t_ns: Stamps
    rims: Rims | None = None
    drive: Drive | None = None
    first: int = 0
    clearance_m: float | None = None

    def at_frames(self) -> Kinematics:
        """The poses and velocities of the body at the stamps of its pictures."""
        return self.motion.at(self.t_ns)


def body_motion(case: Case) -> BodyMotion:
    """The motion of the body of a case.

    It depends on the scene, and on the height of the cameras, only if a path or a start is found in the free space.

    Raises MotionError.
    """
    whole = _whole_motion(case)
    if case.frames is None:
        return whole
    first, end = case.frames
    if not first + 2 <= end <= len(whole.t_ns):
        raise MotionError(
            f"frames should be 2 or more of the {len(whole.t_ns)} there are, the first and the one after the last "
            f"(got [{first}, {end}])"
        )
    return replace(whole, t_ns=whole.t_ns[first:end], first=first)


def _whole_motion(case: Case) -> BodyMotion:
    spec = case.trajectory
    if isinstance(spec, Startable) and spec.start_seed is not None:
        column_m = column_on_wheels_m(case.build_rig(), habits_of(spec))
        spec = at_free_start(spec, case.scene, column_m)
    if isinstance(spec, Wheeled):
        if not isinstance(spec, Waypoints) and spec.mover != "pioneer":
            return _rolling(spec)
        drive = _driven(spec, case.seed)
        rims = Rims(drive.encoder_t_ns, drive.rim_rad)
        return BodyMotion(drive.motion, drive.t_ns, rims, drive)
    if isinstance(spec, Wander):
        return _wandering(case, spec)
    motion: Motion
    if isinstance(spec, Replay):
        assert case.replayed is not None  # it is read with the suite
        recorded = parse_tum(case.replayed, name=spec.file)
        motion = spec.motion(recorded)
    elif isinstance(spec, Handheld):
        motion = spec.motion(generator(case.seed, "shake"))
    else:
        motion = spec.motion()
    return BodyMotion(motion, stamps(motion, spec.rate_hz))


def _wandering(case: Case, spec: Wander) -> BodyMotion:
    """The motion of a body through the free space of the case's place. Its wheels, if it has any, do not slip."""
    found = wander_motion(case, spec)
    if spec.wheels is None:
        t_ns = stamps(found.motion, spec.rate_hz)
        return BodyMotion(found.motion, t_ns, clearance_m=found.clearance_m)
    encoder_t_ns = stamps(found.motion, spec.rate_hz, per_frame=ENCODERS_PER_FRAME)
    rims = Rims(encoder_t_ns, rolled(found.motion, encoder_t_ns, spec.wheels))
    return BodyMotion(found.motion, encoder_t_ns[::ENCODERS_PER_FRAME], rims, clearance_m=found.clearance_m)


def recorded_drive(folder: Path) -> Drive:
    """The drive of a recorded sequence, which is repeated from its case.

    Raises SequenceError if it has no case, and InputError if its body is not a Pioneer with a controller.
    """
    from vobench.sequence import read_case

    case = json.loads(read_case(folder))
    if case["trajectory"].get("mover") != "pioneer":
        raise InputError(f"a drive to identify is one of mover pioneer, and this body is none: {folder}")
    try:
        spec: Waypoints | Planar = checked(TrajectorySpec, case["trajectory"])  # type: ignore[arg-type]
    except ValidationError:
        raise InputError(f"recorded by another vobench, whose trajectories this one cannot read: {folder}") from None
    if depends_on_place(spec):
        raise InputError(f"the drive starts where its place is free, so it cannot be repeated without that: {folder}")
    return _driven(spec, case["seed"])


def _driven(spec: Waypoints | Planar, seed: int) -> Drive:
    """The drive to the targets or along the path, with the disturbances and the slip of the seed."""
    rngs = {stream: generator(seed, f"slip.{stream}") for stream in DISTURBANCE_STREAMS}
    if isinstance(spec, Waypoints):
        return spec.drive(rngs)
    return _along(spec, rngs)


def stamps(motion: Motion, rate_hz: float, *, per_frame: int = 1) -> Stamps:
    """Stamps from the start to the end of a motion. There are `per_frame` per frame; the first is that of the frame.

    Raises MotionError if there would be more than MOST_FRAMES frames.
    """
    lasts_s = (motion.end_ns - motion.start_ns) / NS_PER_S
    frames = int(lasts_s * rate_hz + 1e-6)
    if frames > MOST_FRAMES:
        raise MotionError(f"{lasts_s:.4g} s at {rate_hz:g} Hz are {frames} frames; at most {MOST_FRAMES} are possible")
    index = np.arange(frames * per_frame + 1)
    since_start_ns = np.rint(index * NS_PER_S / per_frame / rate_hz)
    return since_start_ns.astype(np.int64) + motion.start_ns


def _along(spec: Planar, rngs: Generators) -> Drive:
    """The drive of the Pioneer along a path. Its point h follows that of an ideal robot.

    If no point ahead of the axle can lead it, it gets the speeds that would move it along the path undisturbed.
    """
    ideal = spec.way()
    robot = options(spec, rngs)
    t_ns = stamps(ideal, spec.rate_hz)
    path_m, path_mps = _path_of_h(ideal, t_ns, robot["controller"])
    x, y = path_m[0].tolist()
    start = (x, y, spec.start[2])
    if isinstance(spec, Unled):
        middle_ns = t_ns + round(NS_PER_S / spec.rate_hz / 2)
        return led_by(_fed_forward(ideal, middle_ns, spec.theta), start=start, **robot)
    return follow(path_m, path_mps, start=start, **robot)


def _path_of_h(ideal: Motion, t_ns: Stamps, controller: ControllerSettings) -> tuple[Array, Array]:
    """The positions and velocities (N, 2) in the world of the point h of a body with an ideal motion."""
    T_body_h = se3.transform(np.eye(3), [controller.a_m, 0.0, 0.0])
    h = ideal.at(t_ns).of_mounted(T_body_h)
    R_world_h = h.T_world_body[:, :3, :3]
    velocity_mps = np.einsum("kij,kj->ki", R_world_h, h.velocity_mps)
    return h.T_world_body[:, :2, 3], velocity_mps[:, :2]


def _fed_forward(motion: Motion, t_ns: Stamps, theta: Theta) -> Array:
    """The references (N, 2) for which the robot of eq. (18) has this motion at t_ns, the middles of its frames."""
    ideal = motion.at(t_ns)
    u = ideal.velocity_mps[:, 0]
    omega = ideal.angular_velocity_radps[:, 2]
    u_rate = ideal.acceleration_mps2[:, 0]
    omega_rate = ideal.angular_acceleration_radps2[:, 2]
    return np.stack(feed_forward(u, omega, u_rate, omega_rate, theta=theta), -1)


def _rolling(spec: Planar) -> BodyMotion:
    """The motion of a body whose wheels move exactly as commanded. A car moves as its steering allows."""
    path = spec.way()
    encoder_t_ns = stamps(path, spec.rate_hz, per_frame=ENCODERS_PER_FRAME)
    motion: Motion = path
    if spec.mover == "ackermann":
        motion = ackermann(path, ACKERMANNS[spec.car])
    rims = Rims(encoder_t_ns, rolled(motion, encoder_t_ns, spec.wheels))
    return BodyMotion(motion, encoder_t_ns[::ENCODERS_PER_FRAME], rims)


def motion_name(case: Case) -> str:
    """The name of the motion of a case: that of its trajectory, with the scene if it depends on that."""
    trajectory = case.variant["trajectory"]
    if depends_on_place(case.trajectory):
        return f"{trajectory} in {case.variant['scene']}"
    return trajectory


def cut(planned: Plan, frames: int) -> Plan:
    """The plan with at most `frames` frames of each simulated case. Recordings are not cut.

    Raises SuiteError if a body cannot follow its trajectory.
    """
    motions = body_motions(planned, are_checked=False)
    cases = []
    for case in planned.simulated:
        motion = motions[motion_name(case)]
        is_longer = len(motion.t_ns) > frames
        window = (motion.first, motion.first + frames)
        cases.append(replace(case, frames=window) if is_longer else case)
    return replace(planned, simulated=tuple(cases))


def body_motions(plan: Plan, *, are_checked: bool = True) -> dict[str, BodyMotion]:
    """The motions of the cases of a plan by `motion_name`. Nothing is rendered.

    Raises SuiteError with all mistakes: a target cannot be reached and, if cases `are_checked`, a trajectory ends
    within a frame, a camera leaves the room, its pictures take longer than a frame, or an IMU would feel the noise of
    a recording.
    """
    motions = dict[str, BodyMotion]()
    mistakes = plan.mistakes()
    for name, cases in _grouped(plan.simulated, motion_name).items():
        stop.check()
        with mistakes.at(*place_in_suite(cases[0], "trajectory")):
            motions[name] = body_motion(cases[0])
            if are_checked:
                check_cases(cases, motions[name], mistakes)
    mistakes.require_none()
    return motions


def check_cases(cases: Sequence[Case], motion: BodyMotion, mistakes: Mistakes) -> None:
    """Collect the mistakes because of which cases with this trajectory cannot be simulated."""
    with mistakes.at(*place_in_suite(cases[0], "trajectory")):
        _check_moves(cases[0], motion)
    for case, *_ in _by(cases, "scene", "rig").values():
        with mistakes.at(*place_in_suite(case, "trajectory")):
            _check_clear(case, motion)
            _check_smooth(case)
    for case, *_ in _by(cases, "rig", "camera").values():
        with mistakes.at(*place_in_suite(case, "camera")):
            _check_fits_frame(case)
            _check_imu_delay(case)


def require_possible(case: Case, motion: BodyMotion) -> None:
    """Raise MotionError if a case cannot be simulated, for the reasons that `check_cases` collects."""
    _check_moves(case, motion)
    _check_clear(case, motion)
    _check_smooth(case)
    _check_fits_frame(case)
    _check_imu_delay(case)


def _check_moves(case: Case, motion: BodyMotion) -> None:
    if len(motion.t_ns) < 2:
        raise MotionError(
            f"the trajectory ends within its first frame at {case.trajectory.rate_hz:g} Hz: one image shows "
            "no motion; go further, more slowly or with a higher rate_hz"
        )


AXIS_KEYS = {"trajectory": "trajectories", "camera": "cameras"}


def place_in_suite(case: Case, axis: str) -> tuple[str, str]:
    """The key and the name of the variant of a case on an axis, as they are in the suite."""
    if case.scenario:
        return "scenarios", case.scenario
    name = case.variant[axis]
    if axis == "trajectory" and isinstance(case.trajectory, Wander):
        name = name.removesuffix(f".{case.trajectory.seed}")  # of a number of seeds
    return AXIS_KEYS[axis], name


def _by(cases: Sequence[Case], *axes: str) -> dict[str, list[Case]]:
    """The cases of each combination of variants on some axes."""
    return _grouped(cases, lambda case: " ".join(case.variant[axis] for axis in axes))


def _grouped(cases: Sequence[Case], name_of: Callable[[Case], str]) -> dict[str, list[Case]]:
    """The cases by the name that a function gives them."""
    groups = dict[str, list[Case]]()
    for case in cases:
        groups.setdefault(name_of(case), []).append(case)
    return groups


def _check_smooth(case: Case) -> None:
    is_noisy = isinstance(case.trajectory, Replay) and case.trajectory.exact
    if is_noisy and case.rig.imu:
        raise MotionError(
            f"the IMU of rig '{case.variant['rig']}' would feel the noise of an exact replay; "
            "leave exact out, or the IMU"
        )


def _check_imu_delay(case: Case) -> None:
    has_delay = bool(case.camera.timing.imu_delay_ms)
    if has_delay and not case.rig.imu:
        raise MotionError(f"timing.imu_delay_ms delays the IMU, and rig '{case.variant['rig']}' has none")


def _check_fits_frame(case: Case) -> None:
    """Raise MotionError if a picture would still be exposed or read out when the next one begins."""
    camera = case.camera
    frame_ms = 1e3 / case.trajectory.rate_hz
    durations = {
        "exposure_ms": camera.exposure_ms,
        "readout_ms": camera.readout_ms or 0.0,
        "timing: three times jitter_ms and right_delay_ms": camera.timing.latest_ms,
    }
    if camera.auto_exposure:
        durations["auto_exposure.t_max_ms"] = camera.auto_exposure.t_max_ms
    for key, lasts_ms in durations.items():
        if lasts_ms > frame_ms:
            raise MotionError(
                f"{key} {lasts_ms:g} is longer than a frame of trajectory '{case.variant['trajectory']}', "
                f"which lasts {frame_ms:.3g} ms at {case.trajectory.rate_hz:g} Hz"
            )


def _check_clear(case: Case, motion: BodyMotion) -> None:
    """Raise MotionError if a camera leaves the room, starts inside of a thing or moves through one."""
    rig = case.build_rig()
    scene = case.build_scene()
    T_world_body = motion.at_frames().T_world_body
    for side in rig.sides:
        positions_m = (T_world_body @ rig.T_body_camera(side))[:, :3, 3]  # (N, 3), world
        _check_path(case, scene, motion, positions_m)


def _check_path(case: Case, scene: Scene, motion: BodyMotion, positions_m: Array) -> None:
    """Raise MotionError if a camera at positions (N, 3) leaves the room or collides with a thing."""
    room = case.scene.room
    if room:
        is_outside = ~room.holds(positions_m / case.scene.scale)
        is_under = positions_m[np.argmax(is_outside), 2] <= 0
        what = "is under the floor" if is_under else f"leaves the room ({room.extent})"
        _refuse(case, motion, positions_m, is_outside, what)

    _check_things(case, motion, positions_m, scene.things, positions_m)
    for mover in scene.movers:
        T_world_mover = np.stack([mover.path.pose(t_ns) for t_ns in motion.t_ns])
        relative_m = se3.apply(se3.inverse(T_world_mover), positions_m[:, None])[:, 0]
        _check_things(case, motion, positions_m, mover.things, relative_m)


def _check_things(
    case: Case, motion: BodyMotion, positions_m: Array, things: tuple[Thing, ...], relative_m: Array
) -> None:
    """Raise MotionError if a path, `relative_m` (N, 3) in the frame of the things, goes through one of them."""
    if not things:
        return
    met_faces = _met_faces(things, relative_m)
    is_met = met_faces >= 0
    if is_met.any():
        faces, _ = _faces_and_caster(things)
        first_face = met_faces[np.argmax(is_met)]
        name = faces.things[faces.thing[first_face]].name
        _refuse(case, motion, positions_m, is_met, f"runs into '{name}'")


def _met_faces(things: tuple[Thing, ...], positions_m: Array) -> NDArray[np.int32]:
    """The face (N,) through which each step to a position (N, 3) goes; -1 for none.

    For the first position, it is the face straight above if its back is visible, which means that the position is
    inside of a thing.
    """
    faces, caster = _faces_and_caster(things)
    upwards_m = [[0.0, 0.0, UP_M]]
    starts_m = np.append(positions_m[:-1], positions_m[:1], axis=0)
    steps_m = np.append(np.diff(positions_m, axis=0), upwards_m, axis=0)
    hits = caster.hits(starts_m, steps_m)
    met = np.where(hits.distance <= 1, hits.face, -1)
    above = met[-1]
    if above >= 0 and faces.plane[above, 2] <= 0:
        met[-1] = -1
    return np.asarray(np.roll(met, 1), np.int32)


@lru_cache(maxsize=8)
def _faces_and_caster(things: tuple[Thing, ...]) -> tuple[Triangles, RayCaster]:
    """The faces of things and their ray caster. They are cached, because many cases share a scene."""
    no_index = [-1] * len(things)
    faces = triangle_table(things, no_index, no_index)
    return faces, RayCaster(faces, np.arange(len(faces)))


def _refuse(case: Case, motion: BodyMotion, positions_m: Array, is_wrong: NDArray[np.bool_], what: str) -> None:
    """Raise MotionError for the first instant at which a camera is at an impossible position."""
    if is_wrong.any():
        first = int(np.argmax(is_wrong))
        position = ", ".join(f"{x:.2f}" for x in positions_m[first])
        raise MotionError(
            f"a camera of rig '{case.variant['rig']}' {what} of scene '{case.variant['scene']}' "
            f"after {motion.t_ns[first] / NS_PER_S:.1f} s, at ({position}) m"
        )
