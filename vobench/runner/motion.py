"""Where a case's body goes, and whether it can: motion, wheels, preflight checks."""

import hashlib
import json
from collections.abc import Sequence
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
from vobench.motion.controller import ControllerSettings
from vobench.motion.course import Planar, Unled, rolled
from vobench.motion.drive import Drive, Waypoints, follow, led_by, options
from vobench.motion.handheld import Handheld
from vobench.motion.pioneer import Theta, feed_forward
from vobench.motion.replay import Replay
from vobench.motion.slip import DISTURBANCE_STREAMS, Generators
from vobench.motion.wheeled import Wheeled
from vobench.rendering.geometry import RayCaster
from vobench.scene.mesh import Thing, Triangles, table
from vobench.suite.suite import Case, Plan
from vobench.suite.trajectory import TrajectorySpec
from vobench.suite.yaml_file import Mistakes, checked
from vobench.trajectory.formats import parse_tum
from vobench.trajectory.kinematics import Kinematics, Motion
from vobench.trajectory.trajectory import Stamps


def generator(seed: int, stream: str) -> np.random.Generator:
    """The random stream of that name: no other stream, and nothing else in a case, changes its draws."""
    name = int.from_bytes(hashlib.sha256(stream.encode()).digest()[:8], "big")
    return np.random.default_rng([seed, name])


NS_PER_S = 1e9
ENCODERS_PER_FRAME = 4
# Nearly two hours at 30 Hz.
MOST_FRAMES = 200_000
UP_M = 1e3


@dataclass(frozen=True, slots=True)
class Rims:
    """What the encoders measure: angles (M, 2) in rad of the left and right rim at t_ns (M,)."""

    t_ns: Stamps
    rim_rad: Array


@dataclass(frozen=True, slots=True)
class BodyMotion:
    """A body's way: its motion, the stamps t_ns (N,) of its pictures; `rims` where it rolls, `drive` where it is led.

    All that is true of it comes from `motion`: poses, twists, accelerations, at these stamps or any other. `first` is
    which of the way's pictures is the first that is taken.
    """

    motion: Motion
    t_ns: Stamps
    rims: Rims | None = None
    drive: Drive | None = None
    first: int = 0

    def at_frames(self) -> Kinematics:
        """Where the body is and how it moves at its pictures' stamps."""
        return self.motion.at(self.t_ns)


def body_motion(case: Case) -> BodyMotion:
    """The case's body on its way; the same for every scene, rig and camera. Raises MotionError."""
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
    if isinstance(spec, Wheeled):
        if not isinstance(spec, Waypoints) and spec.mover != "pioneer":
            return _rolling(spec)
        drive = _driven(spec, case.seed)
        return BodyMotion(drive.motion, drive.t_ns, Rims(drive.encoder_t_ns, drive.rim_rad), drive)
    if isinstance(spec, Replay):
        assert case.replayed is not None  # read with the suite
        motion: Motion = spec.motion(parse_tum(case.replayed, name=spec.file))
    else:
        motion = spec.motion(generator(case.seed, "shake")) if isinstance(spec, Handheld) else spec.motion()
    return BodyMotion(motion, stamps(motion, spec.rate_hz))


def recorded_drive(folder: Path) -> Drive:
    """The drive that a sequence was recorded on, driven again from its case.

    Raises SequenceError where it has no case, InputError where its body is no Pioneer under control.
    """
    from vobench.sequence import read_case

    case = json.loads(read_case(folder))
    if case["trajectory"].get("mover") != "pioneer":
        raise InputError(f"a drive to identify is one of mover pioneer, and this body is none: {folder}")
    try:
        spec: Waypoints | Planar = checked(TrajectorySpec, case["trajectory"])  # type: ignore[arg-type]
    except ValidationError:
        raise InputError(f"recorded by another vobench, whose trajectories this one cannot read: {folder}") from None
    return _driven(spec, case["seed"])


def _driven(spec: Waypoints | Planar, seed: int) -> Drive:
    """Led through its targets or along its way, pushed and slipping as the seed has it."""
    rngs = {stream: generator(seed, f"slip.{stream}") for stream in DISTURBANCE_STREAMS}
    return spec.drive(rngs) if isinstance(spec, Waypoints) else _along(spec, rngs)


def stamps(motion: Motion, rate_hz: float, *, per_frame: int = 1) -> Stamps:
    """Stamps from a motion's start to its end, `per_frame` to a frame, every `per_frame`-th exactly a frame's.

    Raises MotionError where there would be more than MOST_FRAMES.
    """
    lasts_s = (motion.end_ns - motion.start_ns) / NS_PER_S
    frames = int(lasts_s * rate_hz + 1e-6)
    if frames > MOST_FRAMES:
        raise MotionError(f"{lasts_s:.4g} s at {rate_hz:g} Hz are {frames} frames, and {MOST_FRAMES} are the most")
    index = np.arange(frames * per_frame + 1)
    return np.rint(index * NS_PER_S / per_frame / rate_hz).astype(np.int64) + motion.start_ns


def _along(spec: Planar, rngs: Generators) -> Drive:
    """The Pioneer on a way: its point h goes after where an ideal robot's would be.

    Where no point ahead of the axle can lead it, it gets the speeds that would take it there undisturbed.
    """
    way = spec.way()
    robot = options(spec, rngs)
    t_ns = stamps(way, spec.rate_hz)
    path_m, path_mps = _path_of_h(way, t_ns, robot["controller"])
    x, y = path_m[0].tolist()
    start = (x, y, spec.start[2])
    if isinstance(spec, Unled):
        amid_ns = t_ns + round(NS_PER_S / spec.rate_hz / 2)
        return led_by(_fed_forward(way, amid_ns, spec.theta), start=start, **robot)
    return follow(path_m, path_mps, start=start, **robot)


def _path_of_h(way: Motion, t_ns: Stamps, controller: ControllerSettings) -> tuple[Array, Array]:
    """Places and velocities (N, 2) in the world of the point h of a body that goes this way exactly."""
    h = way.at(t_ns).of_mounted(se3.transform(np.eye(3), [controller.a_m, 0.0, 0.0]))
    velocity_mps = np.einsum("kij,kj->ki", h.T_world_body[:, :3, :3], h.velocity_mps)
    return h.T_world_body[:, :2, 3], velocity_mps[:, :2]


def _fed_forward(way: Motion, t_ns: Stamps, theta: Theta) -> Array:
    """References (N, 2) with which the robot of (18) moves as this way does at t_ns: the middles of its frames."""
    ideal = way.at(t_ns)
    u = ideal.velocity_mps[:, 0]
    omega = ideal.turn_radps[:, 2]
    u_rate = ideal.acceleration_mps2[:, 0]
    omega_rate = ideal.turn_rate_radps2[:, 2]
    return np.stack(feed_forward(u, omega, u_rate, omega_rate, theta=theta), -1)


def _rolling(spec: Planar) -> BodyMotion:
    """A body whose wheels do as they are told; a car's as its steering lets them."""
    way = spec.way()
    fine = stamps(way, spec.rate_hz, per_frame=ENCODERS_PER_FRAME)
    motion: Motion = ackermann(way, ACKERMANNS[spec.car]) if spec.mover == "ackermann" else way
    return BodyMotion(motion, fine[::ENCODERS_PER_FRAME], Rims(fine, rolled(motion, fine, spec.wheels)))


def cut(planned: Plan, frames: int) -> Plan:
    """The plan with so many frames of each simulated case, or all where there are no more; recordings stay whole.

    Raises SuiteError where a body cannot go its way.
    """
    travels = body_motions(planned, are_checked=False)

    def shorter(case: Case) -> Case:
        travel = travels[case.variant["trajectory"]]
        return replace(case, frames=(travel.first, travel.first + frames)) if frames < len(travel.t_ns) else case

    return replace(planned, simulated=tuple(shorter(case) for case in planned.simulated))


def body_motions(plan: Plan, *, are_checked: bool = True) -> dict[str, BodyMotion]:
    """The travel of each trajectory of a plan, by its name: said before hours of rendering.

    Raises SuiteError with all that is wrong: a target cannot be reached and, where cases `are_checked`, a way ends
    within a frame, a camera leaves the room, its pictures take longer than a frame, or an IMU would feel the noise of
    a recording.
    """
    travels = dict[str, BodyMotion]()
    wrong = plan.mistakes()
    for name, cases in _by(plan.simulated, "trajectory").items():
        stop.check()
        with wrong.at(*_said_at(cases[0], "trajectory")):
            travels[name] = body_motion(cases[0])
            if are_checked:
                check_cases(cases, travels[name], wrong)
    wrong.require_none()
    return travels


def check_cases(cases: Sequence[Case], travel: BodyMotion, wrong: Mistakes) -> None:
    """Gather why these cases of one trajectory cannot be: `travel` is the trajectory's."""
    with wrong.at(*_said_at(cases[0], "trajectory")):
        if len(travel.t_ns) < 2:
            raise MotionError(
                f"the way ends within its first frame at {cases[0].trajectory.rate_hz:g} Hz: one picture shows no "
                "motion; go further, more slowly or with a higher rate_hz"
            )
    for case, *_ in _by(cases, "scene", "rig").values():
        with wrong.at(*_said_at(case, "trajectory")):
            _check_clear(case, travel)
            _check_smooth(case)
    for case, *_ in _by(cases, "rig", "camera").values():
        with wrong.at(*_said_at(case, "camera")):
            _check_fits_frame(case)
            _check_heeded(case)


AXIS_KEYS = {"trajectory": "trajectories", "camera": "cameras"}


def _said_at(case: Case, axis: str) -> tuple[str, str]:
    """Where a suite says what a case has on this axis."""
    return ("scenarios", case.scenario) if case.scenario else (AXIS_KEYS[axis], case.variant[axis])


def _by(cases: Sequence[Case], *axes: str) -> dict[str, list[Case]]:
    """The cases of each combination of variants on these axes."""
    of = dict[str, list[Case]]()
    for case in cases:
        of.setdefault(" ".join(case.variant[axis] for axis in axes), []).append(case)
    return of


def _check_smooth(case: Case) -> None:
    if isinstance(case.trajectory, Replay) and case.trajectory.exact and case.rig.imu:
        raise MotionError(
            f"the IMU of rig '{case.variant['rig']}' would feel the noise of an exact replay; "
            "leave exact out, or the IMU"
        )


def _check_heeded(case: Case) -> None:
    if case.camera.timing.imu_delay_ms and not case.rig.imu:
        raise MotionError(f"timing.imu_delay_ms delays the IMU, and rig '{case.variant['rig']}' has none")


def _check_fits_frame(case: Case) -> None:
    """Raise MotionError where a picture would still be exposed or read out when the next one begins."""
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


def _check_clear(case: Case, travel: BodyMotion) -> None:
    """Raise MotionError where a camera leaves the room, starts inside a thing or goes through one."""
    rig = case.build_rig()
    room = case.scene.room
    scene = case.build_scene()
    T_world_body = travel.at_frames().T_world_body
    for T_body_camera in map(rig.T_body_camera, rig.sides):
        at_m = (T_world_body @ T_body_camera)[:, :3, 3]
        if room:
            outside = ~room.holds(at_m / case.scene.scale)
            is_under = at_m[np.argmax(outside), 2] <= 0
            what = "is under the floor" if is_under else f"leaves the room ({room.extent})"
            _refuse(case, travel, at_m, outside, what)
        _refuse_met(case, travel, at_m, scene.things, at_m)
        for mover in scene.movers:
            poses = np.stack([mover.path.pose(t_ns) for t_ns in travel.t_ns])
            _refuse_met(case, travel, at_m, mover.things, se3.apply(se3.inverse(poses), at_m[:, None])[:, 0])


def _refuse_met(case: Case, travel: BodyMotion, at_m: Array, things: tuple[Thing, ...], own_m: Array) -> None:
    """Raise MotionError where a way, own_m (N, 3) in the things' frame, goes through one of them."""
    if things:
        faces, _ = _solid(things)
        met = _met(things, own_m)
        name = faces.things[faces.thing[met[np.argmax(met >= 0)]]].name
        _refuse(case, travel, at_m, met >= 0, f"runs into '{name}'")


def _met(things: tuple[Thing, ...], at_m: Array) -> NDArray[np.int32]:
    """The face (N,) that each way from a place (N, 3) to the next goes through, -1 for none.

    The last entry is of the first place: the back that it sees straight above, from inside a thing.
    """
    faces, caster = _solid(things)
    ways = np.append(np.diff(at_m, axis=0), [[0.0, 0.0, UP_M]], axis=0)
    hits = caster.hits(np.append(at_m[:-1], at_m[:1], axis=0), ways)
    met = np.where(hits.distance <= 1, hits.face, -1)
    if met[-1] >= 0 and faces.plane[met[-1], 2] <= 0:
        met[-1] = -1
    return np.asarray(np.roll(met, 1), np.int32)


@lru_cache(maxsize=8)
def _solid(things: tuple[Thing, ...]) -> tuple[Triangles, RayCaster]:
    """The faces of things in one frame, and rays against them; kept, as many cases share a scene."""
    faces = table(things, [-1] * len(things), [-1] * len(things))
    return faces, RayCaster(faces, np.arange(len(faces)))


def _refuse(case: Case, travel: BodyMotion, at_m: Array, wrong: NDArray[np.bool_], what: str) -> None:
    """Raise MotionError for the first instant at which a camera is where it cannot be."""
    if wrong.any():
        first = int(np.flatnonzero(wrong)[0])
        where = ", ".join(f"{x:.2f}" for x in at_m[first])
        raise MotionError(
            f"a camera of rig '{case.variant['rig']}' {what} of scene '{case.variant['scene']}' "
            f"after {travel.t_ns[first] / 1e9:.1f} s, at ({where}) m"
        )
