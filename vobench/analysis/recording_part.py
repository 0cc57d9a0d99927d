"""Reads the images of the worst part of a recording, and of runs of frames from the rest of it."""

from collections.abc import Sequence

import numpy as np

from vobench.analysis.frame_failure import FrameRange, Frames
from vobench.analysis.picture_evidence import RecordingPart
from vobench.analysis.stereo_matches import PairShot
from vobench.dataset.recording import Recording
from vobench.errors import InputError
from vobench.sequence import StereoFrame
from vobench.sequence.picture import grey
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at

REFERENCE_RUNS = 4
FEWEST_RUNS = 2
RUN_S = 2.0  # in which a moving camera sees something else
FEWEST_FRAMES_OF_RUN = 14


def frames_of_run(period_ns: int) -> int:
    """The number of frames of a reference run, given the time between two frames."""
    return max(FEWEST_FRAMES_OF_RUN, round(RUN_S * NS_PER_S / period_ns))


def reference_runs(window: FrameRange, is_failing: Frames, run_frames: int) -> list[FrameRange]:
    """Up to four runs of successive frames outside of a window, spread over the N frames; no frame of them fails.

    Raises InputError if there are fewer than two.
    """
    is_usable = ~is_failing
    is_usable[window.frames] = False
    usable_in_run = np.convolve(is_usable, np.ones(run_frames), "valid")
    candidates = np.flatnonzero(usable_in_run == run_frames)
    separate = list[int]()
    for start in candidates.tolist():
        if not separate or start >= separate[-1] + run_frames:
            separate.append(start)
    if len(separate) < FEWEST_RUNS:
        raise InputError(
            f"the worst part is compared with {FEWEST_RUNS * run_frames} other frames or more in which the estimator "
            f"does not fail, and this recording has {run_frames * len(separate)} in runs of {run_frames}"
        )
    chosen = np.unique(np.linspace(0, len(separate) - 1, REFERENCE_RUNS).astype(int))
    return [FrameRange(separate[index], separate[index] + run_frames) for index in chosen]


def read_parts(recording: Recording, t_ns: Stamps, windows: Sequence[FrameRange]) -> list[RecordingPart]:
    """Read the frames of windows of a recording, of which `t_ns` (N,) are the stamps with a true pose."""
    shots = read_shots(recording, np.unique(np.concatenate([t_ns[window.frames] for window in windows])))
    parts = []
    for window in windows:
        stamps = t_ns[window.frames]
        parts.append(RecordingPart(stamps, tuple(shots[int(stamp)] for stamp in stamps)))
    return parts


def read_shots(recording: Recording, t_ns: Stamps) -> dict[int, PairShot]:
    """Read the frames at some stamps with a true pose, by their stamps."""
    truth = recording.truth
    assert truth is not None
    wanted_ns = set(t_ns.tolist())
    last_ns = max(wanted_ns)
    shots = dict[int, PairShot]()
    for frame in recording.frames():
        if frame.t_ns in wanted_ns:
            shots[frame.t_ns] = _shot(frame, recording, truth)
        if frame.t_ns >= last_ns:
            break
    return shots


def _shot(frame: StereoFrame, recording: Recording, truth: Trajectory) -> PairShot:
    """The grey images of a frame, and the true pose of the left camera."""
    assert frame.right is not None
    (T_world_body,) = poses_at(truth, np.array([frame.t_ns]))
    return PairShot(
        grey(frame.left, frame.colour),
        grey(frame.right, frame.colour),
        T_world_body @ recording.rig.T_body_left,
    )
