"""TUM text is the inverse of parsing."""

import numpy as np

from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum, parse_tum


def random_trajectory(n: int, seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(n, 4))
    rotations = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    t_ns = np.cumsum(rng.integers(1, 10**10, n)).astype(np.int64)
    return Trajectory(t_ns, se3.transform(rotations, rng.normal(scale=100, size=(n, 3))))


def test_text_is_the_inverse_of_parsing():
    before = random_trajectory(500, seed=1)
    after = parse_tum(format_tum(before), name="x")
    np.testing.assert_array_equal(after.t_ns, before.t_ns)
    np.testing.assert_array_equal(after.positions_m, before.positions_m)
    np.testing.assert_allclose(after.T_world_frame, before.T_world_frame, rtol=0, atol=1.5e-15)


def test_an_empty_trajectory_is_empty_text_and_back():
    assert format_tum(parse_tum("# nothing\n", name="x")) == ""
