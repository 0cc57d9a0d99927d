"""What a body's wheels and IMU say on its way, handed over in order of time."""

import numpy as np

from vobench.pipeline.motion import Travel
from vobench.pipeline.stream import generator
from vobench.sensor.encoder import ENCODERS, ticks
from vobench.sensor.imu import STREAMS, ImuBias, ImuReadings, measure
from vobench.sequence import SequenceWriter
from vobench.suite.expand import Case
from vobench.suite.ground_spec import GroundSpec
from vobench.trajectory.trajectory import Stamps

EMPTY = np.zeros(0, np.int64)


class SensorFeed:
    """The readings of a case's encoders and IMU, where it has them, and the IMU's true biases."""

    def __init__(self, case: Case, travel: Travel) -> None:
        self._encoder_t_ns, self._ticks = _counted(case, travel)
        self._imu = _felt(case, travel)
        self._last_ns = np.iinfo(np.int64).min

    def write_until(self, t_ns: int, writer: SequenceWriter) -> None:
        """Write what was read since the last call, up to and at a stamp."""
        new = _between(self._encoder_t_ns, self._last_ns, t_ns)
        for now_ns, counts in zip(self._encoder_t_ns[new].tolist(), self._ticks[new], strict=True):
            self._write_imu(now_ns, writer)
            writer.write_encoders([now_ns], counts)
        self._write_imu(t_ns, writer)

    def _write_imu(self, t_ns: int, writer: SequenceWriter) -> None:
        if self._imu:
            _write_imu(*self._imu, _between(self._imu[0].t_ns, self._last_ns, t_ns), writer)
        self._last_ns = t_ns


def _counted(case: Case, travel: Travel) -> tuple[Stamps, Stamps]:
    """Stamps (M,) and counts (M, 2) of both encoders; none where nothing rolls."""
    spec = case.trajectory
    if travel.rims is None or not isinstance(spec, GroundSpec):
        return EMPTY, EMPTY.reshape(0, 2)
    return travel.rims.t_ns, ticks(travel.rims.rim_rad, spec.wheels, ENCODERS[spec.encoders])


def _felt(case: Case, travel: Travel) -> tuple[ImuReadings, ImuBias] | None:
    if case.rig.imu is None:
        return None
    rngs = {stream: generator(case.seed, f"imu.{stream}") for stream in STREAMS}
    return measure(travel.motion, case.rig.imu.build(), rngs=rngs)


def _write_imu(readings: ImuReadings, bias: ImuBias, new: slice, writer: SequenceWriter) -> None:
    writer.write_imu(ImuReadings(readings.t_ns[new], readings.gyro_radps[new], readings.accel_mps2[new]))
    rows = zip(bias.t_ns[new].tolist(), bias.gyro_radps[new], bias.accel_mps2[new], strict=True)
    for t_ns, gyro_radps, accel_mps2 in rows:
        writer.write_imu_bias(t_ns, gyro_radps, accel_mps2)


def _between(t_ns: Stamps, last_ns: int, now_ns: int) -> slice:
    """The readings after one instant, up to and including another."""
    first, end = np.searchsorted(t_ns, [last_ns, now_ns], side="right").tolist()
    return slice(first, end)


def wheel_error_m(case: Case, travel: Travel) -> float | None:
    """How far off an odometer is at the end that believes the wheels from a known start; None where nothing rolls."""
    spec = case.trajectory
    if not isinstance(spec, GroundSpec):
        return None
    _, counts = _counted(case, travel)
    left, right = np.diff(counts, axis=0).T * 2 * np.pi * spec.wheels.radius_m / spec.wheels.ticks_per_revolution
    turned = (right - left) / spec.wheels.track_m
    first, last = travel.motion.at(travel.t_ns[[0, -1]]).T_world_body
    heading = np.arctan2(first[1, 0], first[0, 0]) + np.cumsum(turned) - turned / 2
    # Each step is an arc, and its chord a little shorter.
    chord_m = (left + right) / 2 * np.sinc(turned / 2 / np.pi)
    believed_m = first[:2, 3] + np.array([(chord_m * np.cos(heading)).sum(), (chord_m * np.sin(heading)).sum()])
    return float(np.linalg.norm(believed_m - last[:2, 3]))
