"""Cuts ground truth and sensor readings to the time of the pictures."""

import numpy as np

from vobench.sensor.imu import ImuReadings
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory


def overlap(t_ns: Stamps, frames_ns: Stamps) -> slice | None:
    """The indices of the stamps in the time of the pictures, with one stamp before and one after it.

    None if no stamp is in the time of the pictures.
    """
    first_ns = frames_ns[0]
    last_ns = frames_ns[-1]
    if not len(t_ns) or t_ns[-1] < first_ns or t_ns[0] > last_ns:
        return None
    not_later = int(np.searchsorted(t_ns, first_ns, side="right"))
    begin = max(not_later - 1, 0)
    end = int(np.searchsorted(t_ns, last_ns, side="left")) + 1
    return slice(begin, end)


def overlapping_truth(truth: Trajectory, frames_ns: Stamps) -> tuple[Trajectory | None, list[str]]:
    """The poses in the time of the pictures, with one before and one after it, and notes on what was dropped."""
    t_ns = truth.t_ns
    rows = overlap(t_ns, frames_ns)
    if rows is None:
        return None, [_disjoint("truth", t_ns, frames_ns)]

    selected = Trajectory(t_ns[rows], truth.T_world_frame[rows])
    notes = []
    dropped = len(truth) - len(selected)
    if dropped:
        notes.append(f"{dropped} of {len(truth)} true poses lie outside the images' time; dropped.")
    is_outside = (frames_ns < t_ns[0]) | (frames_ns > t_ns[-1])
    outside = int(np.sum(is_outside))
    if outside:
        notes.append(f"{outside} of {len(frames_ns)} images lie outside the truth's time; they have no true pose.")
    return selected, notes


def overlapping_imu(imu: ImuReadings, frames_ns: Stamps) -> tuple[ImuReadings | None, list[str]]:
    """The readings in the time of the pictures, with one before and one after it, and notes on what was dropped."""
    rows = overlap(imu.t_ns, frames_ns)
    if rows is None:
        return None, [_disjoint("IMU", imu.t_ns, frames_ns)]

    selected = ImuReadings(imu.t_ns[rows], imu.gyro_radps[rows], imu.accel_mps2[rows])
    count = len(imu.t_ns)
    dropped = count - len(selected.t_ns)
    if not dropped:
        return selected, []
    imu_s = (imu.t_ns[-1] - imu.t_ns[0]) / NS_PER_S
    frames_s = (frames_ns[-1] - frames_ns[0]) / NS_PER_S
    note = (
        f"{dropped} of {count} IMU readings lie outside the images' time "
        f"({imu_s:.1f} s beside {frames_s:.1f} s); dropped."
    )
    return selected, [note]


def _disjoint(what: str, t_ns: Stamps, frames_ns: Stamps) -> str:
    span = f" ({t_ns[0]} to {t_ns[-1]} ns)" if len(t_ns) else ""
    frames_span = f"{frames_ns[0]} to {frames_ns[-1]} ns"
    return f"The {what}{span} was dropped: it shares no time with the images ({frames_span})."
