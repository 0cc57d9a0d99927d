"""The settings of trajectories on wheels: the start, the wheels of each robot, and what a mover may be."""

from math import inf

import numpy as np
import pytest

from vobench.errors import SettingError
from vobench.geometry.rig import PIONEER_WHEELS
from vobench.motion.pioneer import THETAS, AccelerationLimits
from vobench.motion.wheeled import CAR_WHEELS, KEYS_WITHOUT_CONTROLLER, PIONEER_KEYS, Wheeled


def test_the_pose_at_the_start_has_the_position_and_heading_of_the_settings() -> None:
    wheeled = Wheeled(start_m=(1.0, -2.0), start_heading_deg=90.0)
    expected = [[0, -1, 0, 1], [1, 0, 0, -2], [0, 0, 1, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(wheeled.T_world_start, expected, atol=1e-15)


def test_a_car_has_its_own_wheels_and_other_movers_those_of_the_pioneer() -> None:
    assert Wheeled(mover="ackermann", car="kitti_like").wheels == CAR_WHEELS["kitti_like"]
    assert Wheeled(mover="unicycle").wheels == PIONEER_WHEELS
    assert Wheeled().wheels == PIONEER_WHEELS


def test_without_motors_the_dynamics_are_those_of_the_named_robot() -> None:
    assert Wheeled(robot="pioneer_3dx").theta == THETAS["pioneer_3dx"]


def test_without_limits_accelerations_are_unlimited() -> None:
    assert Wheeled().limits == AccelerationLimits(inf, inf)
    assert Wheeled(max_accel_mps2=2.0).limits == AccelerationLimits(2.0, inf)


def test_a_mover_that_does_not_exist_is_refused() -> None:
    with pytest.raises(SettingError) as refusal:
        Wheeled(mover="hovercraft")  # type: ignore[arg-type]
    assert "hovercraft" in str(refusal.value)


def test_only_the_controller_is_missing_where_speeds_are_given() -> None:
    assert set(PIONEER_KEYS) - set(KEYS_WITHOUT_CONTROLLER) == {"controller"}
