"""The same path at other times."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.analysis.retiming import at_half_speed, at_half_turn_rate, at_twice_the_rate
from vobench.motion.course import Square
from vobench.motion.replay import Replay
from vobench.runner.motion import body_motion
from vobench.suite.case import Case


@pytest.fixture
def square(hard: Case) -> Case:
    """A drive around a square, with slow straights and fast corners."""
    trajectory = Square(side_m=1.0, mover="unicycle", rate_hz=10.0)
    return replace(hard, trajectory=trajectory)


def positions_m(case: Case) -> np.ndarray:
    """The positions (N, 3) of the body at its frames."""
    return body_motion(case).at_frames().T_world_body[:, :3, 3]


def distance_m(points_m: np.ndarray, path_m: np.ndarray) -> float:
    """The largest distance of points (N, 3) from the nearest points of a path (M, 3)."""
    between = np.linalg.norm(points_m[:, None] - path_m[None], axis=-1)
    return float(between.min(1).max())


def finely(case: Case) -> np.ndarray:
    """The positions of the body on its path, close to each other."""
    return positions_m(replace(case, trajectory=replace(case.trajectory, rate_hz=200.0)))


def turn_radps(case: Case) -> np.ndarray:
    velocity = body_motion(case).at_frames().angular_velocity_radps
    return np.linalg.norm(velocity, axis=1)


def test_half_the_speed_is_the_same_path_in_twice_as_many_frames(square: Case) -> None:
    slow = at_half_speed(square)
    before = positions_m(square)
    after = positions_m(slow)
    assert len(after) == pytest.approx(2 * len(before), abs=2)
    assert np.abs(after[: 2 * len(before) : 2] - before[: len(after[::2])]).max() < 0.005
    assert distance_m(after, finely(square)) < 0.01


def test_half_the_turn_rate_is_the_same_path_and_its_straights_as_fast_as_before(square: Case) -> None:
    gentle = at_half_turn_rate(square)
    assert distance_m(positions_m(gentle), finely(square)) < 0.01
    assert turn_radps(gentle).max() == pytest.approx(turn_radps(square).max() / 2, rel=0.2)
    speed_before = np.linalg.norm(body_motion(square).at_frames().velocity_mps, axis=1)
    speed_after = np.linalg.norm(body_motion(gentle).at_frames().velocity_mps, axis=1)
    assert speed_after.max() == pytest.approx(speed_before.max(), rel=0.1)


def test_twice_the_rate_is_the_same_motion_in_twice_as_many_frames(square: Case) -> None:
    fine = at_twice_the_rate(square)
    before = positions_m(square)
    after = positions_m(fine)
    assert fine.trajectory.rate_hz == 2 * square.trajectory.rate_hz
    assert np.abs(after[::2][: len(before)] - before[: len(after[::2])]).max() < 0.005


def test_a_retimed_case_replays_its_path_under_a_name_of_its_own(square: Case) -> None:
    slow = at_half_speed(square)
    assert isinstance(slow.trajectory, Replay)
    assert slow.variant["trajectory"] == "short_half_speed"
    assert slow.replayed is not None
    assert replace(slow, trajectory=square.trajectory, variant=square.variant, replayed=None) == square


def test_a_part_of_a_case_keeps_its_times(square: Case) -> None:
    part = replace(square, frames=(0, 5))
    for change in (at_half_speed, at_half_turn_rate, at_twice_the_rate):
        assert change(part) == part
