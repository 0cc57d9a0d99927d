"""Trajectories without any order, to test that files keep every number."""

import numpy as np

from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory


def random_trajectory(n: int, seed: int) -> Trajectory:
    """n poses in random directions, up to some 100 m away, at increasing times."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(n, 4))
    rotations = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    t_ns = np.cumsum(rng.integers(1, 10**10, n)).astype(np.int64)
    return Trajectory(t_ns, se3.transform(rotations, rng.normal(scale=100, size=(n, 3))))
