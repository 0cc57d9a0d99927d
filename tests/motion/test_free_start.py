"""A path of given shape starts where the robot keeps clear of everything."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.motion.course import Circle, PureRotation, Square
from vobench.motion.free_start import from_free_start, habits_of
from vobench.motion.spline import Pose, PoseSpline
from vobench.motion.wander import HABITS, Clearance, body_clearance_m, planar_poses

CELL_M = 0.1
NEEDED_M = 0.3  # of the Pioneer: its radius and the margin


def hall(*, side_m: float = 6.0, floor_m: float = 0.0) -> Clearance:
    """The free space of an empty square hall around the origin."""
    centres_m = np.arange(-side_m / 2 + CELL_M / 2, side_m / 2, CELL_M)
    to_wall_m = side_m / 2 - np.abs(centres_m)
    distance_m = np.minimum(to_wall_m[:, None], to_wall_m[None])
    return Clearance(centres_m[0], centres_m[0], floor_m, CELL_M, distance_m)


@pytest.mark.parametrize("spec", [Circle(radius_m=1.5), Square(side_m=1.2), PureRotation(angle_deg=360)])
@pytest.mark.parametrize("seed", range(5))
def test_the_robot_keeps_clear_on_the_whole_path(spec, seed):
    found = from_free_start(replace(spec, start_seed=seed), hall())
    poses = planar_poses(found.way(), 500)
    assert np.abs(poses[:, :2]).max() <= 3.0 - NEEDED_M + CELL_M
    assert body_clearance_m(hall(), poses, HABITS["pioneer"]).min() > NEEDED_M - 0.02


def test_only_the_start_changes():
    spec = Circle(radius_m=0.4, laps=0.5, start_seed=3)
    found = from_free_start(spec, hall())
    assert replace(found, start_m=(0, 0), start_heading_deg=0) == replace(spec, start_seed=None)


def test_starts_differ_by_seed_and_are_the_same_again():
    spec = Circle(radius_m=0.4)
    starts = {from_free_start(replace(spec, start_seed=seed), hall()).start for seed in [1, 2, 3, 1, 2]}
    assert len(starts) == 3


def test_a_start_does_not_depend_on_the_speed_or_the_laps():
    turn = PureRotation(angle_deg=360, start_seed=4)
    slow, fast = (from_free_start(replace(turn, turn_radps=speed), hall()) for speed in (1.0, 5.0))
    assert slow.start == fast.start
    for seed in range(20):
        circle = Circle(radius_m=1.5, start_seed=seed)
        starts = {from_free_start(replace(circle, laps=laps), hall()).start for laps in (0.2, 0.5, 3)}
        assert len(starts) == 1


def test_a_path_that_fits_nowhere_is_refused():
    with pytest.raises(MotionError, match=r"no start was found from which a circle keeps 0\.3 m clear of everything"):
        from_free_start(Circle(radius_m=3.0, start_seed=1), hall())
    with pytest.raises(MotionError, match="no start was found"):
        from_free_start(Circle(radius_m=0.1, start_seed=1), hall(side_m=0.4))


def test_floors_that_are_uneven_or_not_at_height_0_are_refused():
    spec = Circle(radius_m=0.4, start_seed=1)
    with pytest.raises(MotionError, match="level floor at z = 0"):
        from_free_start(spec, hall(floor_m=1.0))
    uneven = replace(hall(), ground_m=np.zeros_like(hall().distance_m))
    with pytest.raises(MotionError, match="level floor at z = 0"):
        from_free_start(spec, uneven)


def test_a_car_takes_the_space_of_a_car():
    car = Circle(radius_m=5, mover="ackermann", car="kitti_like", start_seed=1)
    assert habits_of(car) == HABITS["car"]
    assert habits_of(replace(car, car="small_robot")) == HABITS["pioneer"]


# --- Poses ---


def over_waves(pitch_deg: float) -> PoseSpline:
    """A bend through poses that pitch and roll."""
    poses = []
    for k in range(6):
        tilt_deg = pitch_deg * (-1) ** k
        position_m = (1.0 + 0.3 * k, 2.0 + 0.05 * k**2, 0.02 * (k % 2))
        poses.append(
            Pose(t_s=0.4 * k, position_m=position_m, yaw_deg=30 + 15 * k, pitch_deg=tilt_deg, roll_deg=-tilt_deg)
        )
    return PoseSpline(poses=tuple(poses), ease_s=0.5, start_seed=3)


def test_poses_are_moved_together_to_where_the_robot_keeps_clear():
    spec = over_waves(10.0)
    found = from_free_start(spec, hall(side_m=3.0))
    assert found.start_seed is None
    poses = planar_poses(found.motion(), 500)
    assert np.abs(poses[:, :2]).max() <= 1.5 - NEEDED_M + CELL_M
    given = [pose.T_world_body for pose in spec.poses]
    moved = [pose.T_world_body for pose in found.poses]
    T_moved_given = moved[0] @ np.linalg.inv(given[0])
    np.testing.assert_allclose(T_moved_given[2], [0, 0, 1, 0], atol=1e-12)  # about the vertical, at the same height
    np.testing.assert_allclose(T_moved_given @ given, moved, atol=1e-12)
    assert [pose.t_s for pose in found.poses] == [pose.t_s for pose in spec.poses]


def test_a_start_of_poses_does_not_depend_on_how_they_pitch_and_roll():
    flat, steep = (from_free_start(over_waves(pitch_deg), hall()) for pitch_deg in (0.0, 20.0))
    assert [pose.position_m for pose in flat.poses] == [pose.position_m for pose in steep.poses]
    assert [pose.yaw_deg for pose in flat.poses] == [pose.yaw_deg for pose in steep.poses]
