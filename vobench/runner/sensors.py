"""Simulates the readings of a body's wheels and IMU, and the per-pixel ground truth of its cameras."""

from dataclasses import replace

import numpy as np

from vobench.geometry.rig import Side
from vobench.motion.encoder import ENCODERS, ticks
from vobench.motion.wander import Wander
from vobench.motion.wheeled import Wheeled
from vobench.rendering.shot import CameraShot
from vobench.rendering.truth import TruthCaster
from vobench.runner.motion import BodyMotion, generator
from vobench.scene.scene import Scene
from vobench.sensor.imu import STREAMS, ImuBias, ImuReadings, measure
from vobench.sensor.pixel_truth import TruthFrame, TruthNames
from vobench.sensor.rolling_shutter import row_stamps
from vobench.sequence import SequenceWriter
from vobench.suite.case import Case
from vobench.trajectory.kinematics import Motion
from vobench.trajectory.nanoseconds import NS_PER_MS
from vobench.trajectory.trajectory import Stamps

EMPTY = np.zeros(0, np.int64)


class SensorFeed:
    """The readings of a case's encoders and IMU, if it has them, and the true biases of the IMU."""

    def __init__(self, case: Case, travel: BodyMotion) -> None:
        self._encoder_t_ns, self._counts = _encoder_readings(case, travel)
        self._imu = _imu_readings(case, travel)
        self._last_ns = int(travel.t_ns[0]) - 1  # all readings up to this stamp have been written

    def write_until(self, t_ns: int, writer: SequenceWriter) -> None:
        """Write the readings after the last call, up to and including a stamp."""
        rows = _between(self._encoder_t_ns, self._last_ns, t_ns)
        stamps = self._encoder_t_ns[rows].tolist()
        for stamp_ns, counts in zip(stamps, self._counts[rows], strict=True):
            self._write_imu(stamp_ns, writer)
            writer.write_encoders([stamp_ns], counts)
        self._write_imu(t_ns, writer)

    def _write_imu(self, t_ns: int, writer: SequenceWriter) -> None:
        if self._imu:
            readings, bias = self._imu
            rows = _between(readings.t_ns, self._last_ns, t_ns)
            new_readings = ImuReadings(readings.t_ns[rows], readings.gyro_radps[rows], readings.accel_mps2[rows])
            writer.write_imu(new_readings)
            new_biases = zip(bias.t_ns[rows].tolist(), bias.gyro_radps[rows], bias.accel_mps2[rows], strict=True)
            for stamp_ns, gyro_radps, accel_mps2 in new_biases:
                writer.write_imu_bias(stamp_ns, gyro_radps, accel_mps2)
        self._last_ns = t_ns


def _encoder_readings(case: Case, travel: BodyMotion) -> tuple[Stamps, Stamps]:
    """The stamps (M,) and the counts (M, 2) of both encoders, which are 0 at the first picture.

    They are empty for a body without wheels.
    """
    spec = case.trajectory
    if travel.rims is None or not isinstance(spec, Wheeled | Wander) or spec.wheels is None:
        return EMPTY, EMPTY.reshape(0, 2)
    t_ns = travel.rims.t_ns
    counts = ticks(travel.rims.rim_rad, spec.wheels, ENCODERS[spec.encoders])
    if travel.first:
        first_row = np.searchsorted(t_ns, travel.t_ns[0])
        counts = counts - counts[first_row]
    return t_ns, counts


def _imu_readings(case: Case, travel: BodyMotion) -> tuple[ImuReadings, ImuBias] | None:
    """The readings of the IMU and its true biases, with delayed stamps; None without an IMU."""
    if not case.rig.imu:
        return None
    rngs = {stream: generator(case.seed, f"imu.{stream}") for stream in STREAMS}
    readings, bias = measure(travel.motion, case.rig.imu, rngs=rngs)
    delay_ns = round(case.camera.timing.imu_delay_ms * NS_PER_MS)
    t_ns = readings.t_ns + delay_ns
    return replace(readings, t_ns=t_ns), replace(bias, t_ns=t_ns)


def _between(t_ns: Stamps, last_ns: int, now_ns: int) -> slice:
    """The rows with stamps after `last_ns`, up to and including `now_ns`."""
    first, end = np.searchsorted(t_ns, [last_ns, now_ns], side="right").tolist()
    return slice(first, end)


def wheel_error_m(case: Case, travel: BodyMotion) -> float | None:
    """The final position error of wheel odometry that starts at the true pose; None for a body without wheels."""
    wheels = case.build_rig().wheels
    if wheels is None:
        return None
    t_ns, counts = _encoder_readings(case, travel)
    is_in_case = (t_ns >= travel.t_ns[0]) & (t_ns <= travel.t_ns[-1])
    steps = np.diff(counts[is_in_case], axis=0)  # (M, 2), in ticks

    # In each step, the middle of the axle moves along an arc.
    left_m, right_m = steps.T * 2 * np.pi * wheels.radius_m / wheels.ticks_per_revolution
    turn_rad = (right_m - left_m) / wheels.track_m
    arc_m = (left_m + right_m) / 2
    chord_m = arc_m * np.sinc(turn_rad / 2 / np.pi)

    # The direction of a chord is the heading in the middle of its arc.
    T_world_first, T_world_last = travel.motion.at(travel.t_ns[[0, -1]]).T_world_body
    first_heading_rad = np.arctan2(T_world_first[1, 0], T_world_first[0, 0])
    chord_heading_rad = first_heading_rad + np.cumsum(turn_rad) - turn_rad / 2
    x_m = (chord_m * np.cos(chord_heading_rad)).sum()
    y_m = (chord_m * np.sin(chord_heading_rad)).sum()
    end_m = T_world_first[:2, 3] + np.array([x_m, y_m])
    return float(np.linalg.norm(end_m - T_world_last[:2, 3]))


class PixelTruth:
    """The per-pixel ground truth of a case's pictures. It is for the true rig, at the middle of each row's exposure."""

    def __init__(self, case: Case, scene: Scene, motion: Motion) -> None:
        self._rig = case.build_true_rig()
        self._readout_s = case.camera.readout_s
        self._motion = motion
        self._channels = case.truth
        self._caster = TruthCaster(scene)

    @property
    def names(self) -> TruthNames:
        """The names of the ids in the channels."""
        return self._caster.names

    def frame(self, side: Side, t_ns: int, next_t_ns: int | None) -> TruthFrame:
        """The channels of the picture with the stamp `t_ns`. The flow leads to the picture with `next_t_ns`, if any."""
        camera = self._rig.camera(side)
        shot = self._shot(side, t_ns)
        later = None if next_t_ns is None else self._shot(side, next_t_ns)
        return self._caster.frame(camera, shot, self._channels, later=later)

    def _shot(self, side: Side, t_ns: int) -> CameraShot:
        T_body_camera = self._rig.T_body_camera(side)
        if not self._readout_s:
            T_world_body = self._motion.at(np.array([t_ns])).T_world_body[0]
            return CameraShot(T_world_body @ T_body_camera, t_ns)
        stamps = row_stamps(self._rig.camera(side).height_px, readout_s=self._readout_s, t_ns=t_ns)
        T_world_body = self._motion.at(stamps).T_world_body
        return CameraShot(T_world_body @ T_body_camera, stamps)
