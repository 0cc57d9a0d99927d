"""Whether ground truth and estimate were given in each other's place: what each looks like, by itself."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.trajectory.associate import associate
from vobench.trajectory.trajectory import Trajectory

AT_ORIGIN = 1e-6  # m, and the same of a rotation's elements: odometry begins at the identity, a truth seldom
DENSER = 2.0  # truth from a tracker has more poses a second than frames have
NOISIER, PLAINLY_NOISIER = 1.5, 2.0
NOISE = 5e-3  # of a step; below it motion itself is what is seen
ENOUGH = 2  # signs that have to agree; each alone has an innocent explanation
MIN_POSES = 8


@dataclass(frozen=True, slots=True)
class Signs:
    """What speaks for swapped inputs: each figure is of the "truth" over the "estimate", as they were given."""

    noise: float
    density: float
    only_gt_begins_at_origin: bool
    only_est_says_truth: bool
    votes: int

    @property
    def are_enough(self) -> bool:
        """Whether the inputs look swapped."""
        return self.votes >= ENOUGH


def signs_of_swap(gt: Trajectory, est: Trajectory, *, says_truth: tuple[bool, bool]) -> Signs | None:
    """The signs in two trajectories on one clock, None where either has no noise to compare.

    `says_truth`: whether the files call themselves ground truth, first that of the truth.
    """
    pairs = associate(gt.t_ns, est.t_ns)
    noises = [_noise(t.positions_m[chosen]) for t, chosen in ((gt, pairs.gt), (est, pairs.est))]
    if len(pairs) < MIN_POSES or not min(noises) > 0:
        return None
    noise, density = noises[0] / noises[1], _rate(gt) / _rate(est)
    origins = _begins_at_origin(gt), _begins_at_origin(est)
    # Truth that has a pose at exactly each estimated one was interpolated, and that makes it smooth.
    is_noisy = noises[0] > NOISE
    same_instants = len(gt) == len(est) == len(pairs)
    votes = [
        int(is_noisy and noise > NOISIER) + int(is_noisy and noise > PLAINLY_NOISIER and same_instants),
        int(density < 1 / DENSER) - int(density > DENSER),
        int(origins == (True, False)) - int(origins == (False, True)),
        int(says_truth == (False, True)) - int(says_truth == (True, False)),
    ]
    return Signs(noise, density, origins == (True, False), says_truth == (False, True), sum(votes))


def _noise(positions_m: Array) -> float:
    """Median third difference as share of the median step: of steady motion nearly 0, of noise up to 20."""
    if len(positions_m) < MIN_POSES:
        return 0.0
    jerks, steps = (np.linalg.norm(np.diff(positions_m, order, axis=0), axis=1) for order in (3, 1))
    return float(np.median(jerks) / max(np.median(steps), 1e-300))


def _rate(trajectory: Trajectory) -> float:
    return 1.0 / float(np.median(np.diff(trajectory.t_ns)))


def _begins_at_origin(trajectory: Trajectory) -> bool:
    return bool(np.abs(trajectory.T_world_frame[0] - np.eye(4)).max() <= AT_ORIGIN)
