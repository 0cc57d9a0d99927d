"""Writes the ground truth for scoring, and the exposures of the frames, as files beside a sequence."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.runner.frames import EXPOSURE_COLUMNS, EXPOSURES, GROUND_TRUTH, new_table
from vobench.sequence import Sequence, read_truth
from vobench.suite.plan import AnyCase
from vobench.suite.source import RecordedCase
from vobench.suite.suite_spec import EXACT, TruthNoise, Window
from vobench.trajectory.trajectory import Stamps, Trajectory, poses_at
from vobench.trajectory.tum import format_tum, parse_tum

NOISE_STREAM = 9_173  # separates the noise of the truth from the other random streams of a seed
LONGEST_GAP_NS = 200_000_000  # the truth is not interpolated over longer gaps


def left_truth(folder: Path) -> Trajectory:
    """The true poses of the left camera at the stamps of pictures.

    If the truth has other stamps, it is interpolated.
    Pictures before, after or in a gap of the truth are omitted, so they are not scored.
    Raises SequenceError if no picture remains.
    """
    sequence = Sequence.open(folder)
    truth = read_truth(folder)
    if not len(truth):
        raise SequenceError(f"no ground truth, so nothing can be scored: {folder}")
    stamps = sequence.frame_stamps()
    if not np.array_equal(stamps, truth.t_ns):
        stamps = stamps[is_known(truth.t_ns, stamps)]
        if not len(stamps):
            raise SequenceError(f"the ground truth covers none of the images in time: {folder}")
        truth = Trajectory(stamps, poses_at(truth, stamps))
    return truth.of_mounted(sequence.rig.T_body_left)


def scored_truth(exact: str, case: AnyCase) -> str:
    """The truth for scoring estimates on a case, as TUM text: the exact truth with the noise of the case."""
    if isinstance(case, RecordedCase):
        return exact
    return noisy(exact, case.truth_noise, seed=case.seed, frames=case.frames)


def noisy(exact: str, noise: TruthNoise, *, seed: int, frames: Window | None) -> str:
    """The truth as TUM text, with noise added to each pose. A window of frames has the noise of the whole case."""
    if noise == EXACT:
        return exact
    truth = parse_tum(exact, name=GROUND_TRUTH)
    skipped = frames[0] if frames else 0
    rng = np.random.default_rng([seed, NOISE_STREAM])
    draws = rng.standard_normal((skipped + len(truth), 2, 3))
    position_draws, rotation_draws = draws[skipped:].swapaxes(0, 1)  # (N, 3) each
    R = Rotation.from_rotvec(noise.rotation_deg * rotation_draws, degrees=True).as_matrix()
    T_true_noisy = se3.transform(R, noise.position_m * position_draws)
    return format_tum(Trajectory(truth.t_ns, truth.T_world_frame @ T_true_noisy))


def is_known(truth_ns: Stamps, stamps: Stamps) -> NDArray[np.bool_]:
    """Whether the truth is known at each stamp (M,): at a pose, or between poses at most LONGEST_GAP_NS apart."""
    after = np.searchsorted(truth_ns, stamps, side="left")
    before = np.searchsorted(truth_ns, stamps, side="right") - 1
    last = len(truth_ns) - 1
    is_covered = (before >= 0) & (after <= last)
    after_ns = truth_ns[np.minimum(after, last)]
    before_ns = truth_ns[np.maximum(before, 0)]
    return np.asarray(is_covered & (after_ns - before_ns <= LONGEST_GAP_NS))


def write_ground_truth(folder: Path) -> None:
    """Write the files beside a sequence that trials read: the true path, and the exposure of each frame."""
    (folder / GROUND_TRUTH).write_text(format_tum(left_truth(folder)), encoding="utf-8")
    sequence = Sequence.open(folder)
    stamps, exposures = sequence.exposures()
    known = dict(zip(stamps.tolist(), exposures.tolist(), strict=True))
    with new_table(folder / EXPOSURES, EXPOSURE_COLUMNS) as table:
        for frame, t_ns in enumerate(sequence.frame_stamps().tolist()):
            exposure_s, gain_db = known.get(t_ns, ("", ""))
            table.writerow({"frame": frame, "t_ns": t_ns, "exposure_s": exposure_s, "gain_db": gain_db})
