"""Readings of a body's wheels and IMU on its way, and the ground truth of its cameras' pixels."""

from dataclasses import replace

import numpy as np

from vobench.geometry.rig import Side
from vobench.motion.wheeled import ENCODERS, Wheeled, ticks
from vobench.rendering.shot import Shot
from vobench.rendering.truth import TruthCaster
from vobench.runner.motion import BodyMotion, generator
from vobench.scene.scene import Scene
from vobench.sensor.exposure import row_stamps
from vobench.sensor.imu import STREAMS, ImuBias, ImuReadings, measure
from vobench.sensor.pixel_truth import TruthFrame, TruthNames
from vobench.sequence import SequenceWriter
from vobench.suite.suite import Case
from vobench.trajectory.kinematics import Motion
from vobench.trajectory.nanoseconds import NS_PER_MS
from vobench.trajectory.trajectory import Stamps

EMPTY = np.zeros(0, np.int64)


class SensorFeed:
    """The readings of a case's encoders and IMU, where it has them, and the IMU's true biases."""

    def __init__(self, case: Case, travel: BodyMotion) -> None:
        self._encoder_t_ns, self._ticks = _counted(case, travel)
        self._imu = _felt(case, travel)
        self._last_ns = int(travel.t_ns[0]) - 1

    def write_until(self, t_ns: int, writer: SequenceWriter) -> None:
        """Write what was read since the last call, up to and at a stamp."""
        new = _between(self._encoder_t_ns, self._last_ns, t_ns)
        for now_ns, counts in zip(self._encoder_t_ns[new].tolist(), self._ticks[new], strict=True):
            self._write_imu(now_ns, writer)
            writer.write_encoders([now_ns], counts)
        self._write_imu(t_ns, writer)

    def _write_imu(self, t_ns: int, writer: SequenceWriter) -> None:
        if self._imu:
            readings, bias = self._imu
            new = _between(readings.t_ns, self._last_ns, t_ns)
            writer.write_imu(ImuReadings(readings.t_ns[new], readings.gyro_radps[new], readings.accel_mps2[new]))
            for row in zip(bias.t_ns[new].tolist(), bias.gyro_radps[new], bias.accel_mps2[new], strict=True):
                writer.write_imu_bias(*row)
        self._last_ns = t_ns


def _counted(case: Case, travel: BodyMotion) -> tuple[Stamps, Stamps]:
    """Stamps (M,) and counts (M, 2) of both encoders, 0 at the first picture; none where nothing rolls."""
    spec = case.trajectory
    if travel.rims is None or not isinstance(spec, Wheeled):
        return EMPTY, EMPTY.reshape(0, 2)
    t_ns = travel.rims.t_ns
    counts = ticks(travel.rims.rim_rad, spec.wheels, ENCODERS[spec.encoders])
    if travel.first:
        counts = counts - counts[np.searchsorted(t_ns, travel.t_ns[0])]
    return t_ns, counts


def _felt(case: Case, travel: BodyMotion) -> tuple[ImuReadings, ImuBias] | None:
    if not case.rig.imu:
        return None
    rngs = {stream: generator(case.seed, f"imu.{stream}") for stream in STREAMS}
    readings, bias = measure(travel.motion, case.rig.imu, rngs=rngs)
    t_ns = readings.t_ns + round(case.camera.timing.imu_delay_ms * NS_PER_MS)
    return replace(readings, t_ns=t_ns), replace(bias, t_ns=t_ns)


def _between(t_ns: Stamps, last_ns: int, now_ns: int) -> slice:
    """The readings after one instant, up to and including another."""
    first, end = np.searchsorted(t_ns, [last_ns, now_ns], side="right").tolist()
    return slice(first, end)


def wheel_error_m(case: Case, travel: BodyMotion) -> float | None:
    """How far off an odometer is at the end that believes the wheels from a known start; None where nothing rolls."""
    spec = case.trajectory
    if not isinstance(spec, Wheeled):
        return None
    t_ns, counts = _counted(case, travel)
    gone = counts[(t_ns >= travel.t_ns[0]) & (t_ns <= travel.t_ns[-1])]
    left, right = np.diff(gone, axis=0).T * 2 * np.pi * spec.wheels.radius_m / spec.wheels.ticks_per_revolution
    turned = (right - left) / spec.wheels.track_m
    first, last = travel.motion.at(travel.t_ns[[0, -1]]).T_world_body
    heading = np.arctan2(first[1, 0], first[0, 0]) + np.cumsum(turned) - turned / 2
    # Each step is an arc, and its chord a little shorter.
    chord_m = (left + right) / 2 * np.sinc(turned / 2 / np.pi)
    believed_m = first[:2, 3] + np.array([(chord_m * np.cos(heading)).sum(), (chord_m * np.sin(heading)).sum()])
    return float(np.linalg.norm(believed_m - last[:2, 3]))


class PixelTruth:
    """Ground truth of a case's pictures, amid each row's exposure; the true rig sees it."""

    def __init__(self, case: Case, scene: Scene, motion: Motion) -> None:
        self._rig = case.build_true_rig()
        self._readout_s = case.camera.readout_s
        self._motion = motion
        self._channels = case.truth
        self._caster = TruthCaster(scene)

    @property
    def names(self) -> TruthNames:
        """What ids stand for."""
        return self._caster.names

    def frame(self, side: Side, t_ns: int, next_t_ns: int | None) -> TruthFrame:
        """The channels of the picture stamped t_ns; the one stamped next_t_ns is where flow leads."""
        later = None if next_t_ns is None else self._shot(side, next_t_ns)
        return self._caster.frame(self._rig.camera(side), self._shot(side, t_ns), self._channels, later=later)

    def _shot(self, side: Side, t_ns: int) -> Shot:
        T_body_camera = self._rig.T_body_camera(side)
        if not self._readout_s:
            return Shot(self._motion.at(np.array([t_ns])).T_world_body[0] @ T_body_camera, t_ns)
        stamps = row_stamps(self._rig.camera(side).height_px, self._readout_s, t_ns)
        return Shot(self._motion.at(stamps).T_world_body @ T_body_camera, stamps)
