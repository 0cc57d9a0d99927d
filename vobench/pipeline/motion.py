"""Where each case's body goes: its motion, its wheels, and what the controller asked of it."""

from dataclasses import dataclass

import numpy as np

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.pipeline.stream import generator
from vobench.robot.ackermann import ACKERMANNS, ackermann
from vobench.robot.controller import CONTROLLERS, ControllerSettings
from vobench.robot.disturbance import DELTAS, STREAMS
from vobench.robot.drive import Drive, Options, drive, follow, led_by
from vobench.robot.pioneer import THETAS, Theta, feed_forward
from vobench.robot.roll import rolled
from vobench.robot.slip import SLIPS
from vobench.suite.expand import Case
from vobench.suite.ground_spec import GroundSpec
from vobench.suite.planar_spec import CurveSpec, UnledSpec, WaypointsSpec
from vobench.suite.replay_spec import ReplaySpec
from vobench.suite.spatial_spec import HandheldSpec
from vobench.suite.trajectory_spec import SpatialSpec
from vobench.trajectory.curve import CurveMotion
from vobench.trajectory.kinematics import Kinematics, Motion
from vobench.trajectory.trajectory import Stamps

NS_PER_S = 1e9
ENCODERS_PER_FRAME = 4
# Nearly two hours at 30 Hz.
MOST_FRAMES = 200_000


@dataclass(frozen=True, slots=True)
class Rims:
    """What the encoders measure: angles (M, 2) in rad of the left and right rim at t_ns (M,)."""

    t_ns: Stamps
    rim_rad: Array


@dataclass(frozen=True, slots=True)
class Travel:
    """A body's way: its motion, the stamps t_ns (N,) of its pictures; `rims` where it rolls, `drive` where it is led.

    All that is true of it comes from `motion`: poses, twists, accelerations, at these stamps or any other.
    """

    motion: Motion
    t_ns: Stamps
    rims: Rims | None = None
    drive: Drive | None = None

    def at_frames(self) -> Kinematics:
        """Where the body is and how it moves at its pictures' stamps."""
        return self.motion.at(self.t_ns)


def travel_of(case: Case) -> Travel:
    """The case's body on its way; the same for every scene, rig and camera. Raises MotionError."""
    spec = case.trajectory
    if isinstance(spec, WaypointsSpec):
        return _led(_through_targets(case, spec))
    if isinstance(spec, GroundSpec):
        return _led(_along(spec.way(), case, spec)) if spec.mover == "pioneer" else _rolling(spec)
    motion = _through_space(case, spec)
    return Travel(motion, stamps(motion, spec.rate_hz))


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


def _led(driven: Drive) -> Travel:
    return Travel(driven.motion, driven.t_ns, Rims(driven.encoder_t_ns, driven.rim_rad), driven)


def _through_targets(case: Case, spec: WaypointsSpec) -> Drive:
    return drive(
        spec.targets_m,
        start=spec.start,
        tolerance_m=spec.tolerance_m,
        max_time_s=spec.max_time_s,
        leg_s=spec.leg_s,
        **_robot(case, spec),
    )


def _along(way: CurveMotion, case: Case, spec: CurveSpec) -> Drive:
    """The Pioneer on a way: its point h goes after where an ideal robot's would be.

    Where no point ahead of the axle can lead it, it gets the speeds that would take it there undisturbed.
    """
    robot = _robot(case, spec)
    t_ns = stamps(way, spec.rate_hz)
    path_m, path_mps = _path_of_h(way, t_ns, robot["controller"])
    x, y = path_m[0].tolist()
    start = (x, y, spec.start[2])
    if isinstance(spec, UnledSpec):
        amid_ns = t_ns + round(NS_PER_S / spec.rate_hz / 2)
        return led_by(_fed_forward(way, amid_ns, THETAS[spec.robot]), start=start, **robot)
    return follow(path_m, path_mps, start=start, **robot)


def _robot(case: Case, spec: GroundSpec) -> Options:
    """Which robot it is, and what is done to it."""
    is_ideal = spec.mover == "unicycle"
    return {
        "theta": None if is_ideal else THETAS[spec.robot],
        "theta_std": 0.0 if is_ideal else spec.robot_spread,
        "controller": CONTROLLERS[spec.controller],
        "limits": spec.build_limits(),
        "slip": SLIPS["none" if is_ideal else spec.slip],
        "delta": DELTAS["none" if is_ideal else spec.delta],
        "floor": () if is_ideal else [patch.build() for patch in spec.floor],
        "rate_hz": spec.rate_hz,
        "substeps": spec.substeps,
        "integrator": spec.integrator,
        "rngs": {stream: generator(case.seed, f"slip.{stream}") for stream in STREAMS},
    }


def _path_of_h(way: Motion, t_ns: Stamps, controller: ControllerSettings) -> tuple[Array, Array]:
    """Places and velocities (N, 2) in the world of the point h of a body that goes this way exactly."""
    h = way.at(t_ns).of_mounted(se3.transform(np.eye(3), [controller.a_m, 0.0, 0.0]))
    velocity_mps = np.einsum("kij,kj->ki", h.T_world_body[:, :3, :3], h.velocity_mps)
    return h.T_world_body[:, :2, 3], velocity_mps[:, :2]


def _fed_forward(way: Motion, t_ns: Stamps, theta: Theta) -> Array:
    """References (N, 2) with which the robot of (18) moves as this way does at t_ns: the middles of its frames."""
    ideal = way.at(t_ns)
    u, omega = ideal.velocity_mps[:, 0], ideal.turn_radps[:, 2]
    u_rate, omega_rate = ideal.acceleration_mps2[:, 0], ideal.turn_rate_radps2[:, 2]
    return np.stack(feed_forward(u, omega, u_rate, omega_rate, theta=theta), -1)


def _rolling(spec: CurveSpec) -> Travel:
    """A body whose wheels do as they are told; a car's as its steering lets them."""
    way = spec.way()
    fine = stamps(way, spec.rate_hz, per_frame=ENCODERS_PER_FRAME)
    motion: Motion = ackermann(way, ACKERMANNS[spec.car]) if spec.mover == "ackermann" else way
    return Travel(motion, fine[::ENCODERS_PER_FRAME], Rims(fine, rolled(motion, fine, spec.wheels)))


def _through_space(case: Case, spec: SpatialSpec | ReplaySpec) -> Motion:
    if isinstance(spec, ReplaySpec):
        assert case.replayed is not None  # read with the suite
        return spec.motion(case.replayed)
    return spec.motion(generator(case.seed, "shake")) if isinstance(spec, HandheldSpec) else spec.motion()
