"""The parts of a recording put together, and held against each other."""

from collections.abc import Iterable
from dataclasses import replace

from vobench.dataset.recording import NO_TRUTH, Recording
from vobench.dataset.stream import PictureStream
from vobench.dataset.truth import apart, around, cut_to
from vobench.errors import InputError
from vobench.geometry.rectify import rectification
from vobench.geometry.rig import Rig
from vobench.sensor.imu import ImuReadings
from vobench.sequence.messages import END_OF_STAMPS_NS
from vobench.trajectory.trajectory import Stamps, Trajectory

LEAST_BASELINE_M = 1e-6
UNRECTIFIABLE = "The right camera is not to the right of the left one and looking the same way: nothing rectifies them."


def assemble(
    form: str,
    rig: Rig,
    stream: PictureStream,
    t_ns: Stamps,
    *,
    truth: Trajectory | None,
    imu: ImuReadings | None = None,
    notes: Iterable[str] = (),
    calibration: str,
) -> Recording:
    """A recording with pictures at t_ns (N,); `calibration` is the file that says what the rig is.

    Raises InputError where pictures are not of the rig's size, or stamps are before 0 or beyond ROS's seconds.
    """
    stream.require(rig, calibration)
    said = [*notes, *_pair_notes(rig, calibration), *stream.notes()]
    if truth is None:
        said.append(NO_TRUTH)
    else:
        truth, cut = cut_to(truth, t_ns)
        said += cut
    if imu is not None and len(imu.t_ns):
        imu, cut = _imu_within(imu, t_ns)
        said += cut
    if imu is None:
        rig = replace(rig, imu=None)
    starts = [_span(t_ns, "picture")]
    if truth is not None:
        starts.append(_span(truth.t_ns, "true pose"))
    if imu is not None and len(imu.t_ns):
        starts.append(_span(imu.t_ns, "IMU reading"))
    return Recording(
        form=form,
        rig=rig,
        frames=stream.frames,
        encoded_frames=stream.encoded_frames,
        t_ns=t_ns,
        start_ns=min(starts),
        truth=truth,
        imu=imu,
        notes=tuple(dict.fromkeys(said)),
    )


def _pair_notes(rig: Rig, calibration: str) -> tuple[str, ...]:
    """What is odd about a pair. Raises InputError where both cameras are in one place."""
    if rig.right is None:
        return ()
    if not rig.baseline_m > LEAST_BASELINE_M:
        raise InputError(f"left and right camera are in the same place, {rig.baseline_m:g} m apart: {calibration}")
    return () if rectification(rig) else (UNRECTIFIABLE,)


def _imu_within(imu: ImuReadings, frames_ns: Stamps) -> tuple[ImuReadings | None, tuple[str, ...]]:
    """The readings of the pictures' time, with one before and one after as the truth has, and what that dropped."""
    inside, count = around(imu.t_ns, frames_ns), len(imu.t_ns)
    if inside is None:
        return None, (apart("IMU", imu.t_ns, frames_ns),)
    kept = ImuReadings(imu.t_ns[inside], imu.gyro_radps[inside], imu.accel_mps2[inside])
    if len(kept.t_ns) == count:
        return kept, ()
    lasts_s = [(t_ns[-1] - t_ns[0]) / 1e9 for t_ns in (imu.t_ns, frames_ns)]
    return kept, (
        f"{count - len(kept.t_ns)} of {count} IMU readings lie outside the pictures' time "
        f"({lasts_s[0]:.1f} s beside {lasts_s[1]:.1f} s); dropped.",
    )


def _span(t_ns: Stamps, what: str) -> int:
    """The first stamp. Raises InputError where one is no ROS time."""
    first, last = int(t_ns[0]), int(t_ns[-1])
    if first < 0 or last >= END_OF_STAMPS_NS:
        raise InputError(
            f"stamps should be within 0 and {END_OF_STAMPS_NS - 1} ns, but a {what} has {first if first < 0 else last}"
        )
    return first
