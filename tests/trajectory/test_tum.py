"""TUM text is the inverse of parsing."""

import numpy as np

from tests.trajectory.random_poses import random_trajectory
from vobench.trajectory.tum import format_tum, parse_tum


def test_text_is_the_inverse_of_parsing():
    before = random_trajectory(500, seed=1)
    after = parse_tum(format_tum(before), name="x")
    np.testing.assert_array_equal(after.t_ns, before.t_ns)
    np.testing.assert_array_equal(after.positions_m, before.positions_m)
    np.testing.assert_allclose(after.T_world_frame, before.T_world_frame, rtol=0, atol=1.5e-15)


def test_an_empty_trajectory_is_empty_text_and_back():
    assert format_tum(parse_tum("# nothing\n", name="x")) == ""
