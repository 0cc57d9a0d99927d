"""The instants that lights are baked for lie all along the path of a sun."""

import numpy as np
import pytest

from vobench.rendering.key_time import SUN_STEP_RAD, key_times_ns, moving_suns, travelled_rad
from vobench.scene.light import PointLight, Sun
from vobench.scene.scene import Scene
from vobench.trajectory.nanoseconds import NS_PER_S

BULB = PointLight("bulb", np.zeros(3), 100.0)
STILL = Sun("still", 1e4, (3.0,), (10.0,), (40.0,))
MOVING = Sun("moving", 1e4, (0.0, 10.0), (0.0, 20.0), (40.0, 40.0))


@pytest.mark.parametrize(
    ("azimuths", "elevations"),
    [((0, 0, 90), (30, 30, 30)), ((0, 0, 0), (30, 30, 30)), ((0, 360), (20, 20)), ((10, 30, 30), (10, 80, 80))],
    ids=["rests first", "rests", "all around", "rests last"],
)
def test_the_light_of_a_sun_is_baked_all_along_its_path(azimuths, elevations):
    times = tuple(np.linspace(5.0, 25.0, len(azimuths)).tolist())
    sun = Sun("sun", 1e4, times, azimuths, elevations)
    keys = key_times_ns(sun)
    assert (keys[0], keys[-1]) == (5 * NS_PER_S, 25 * NS_PER_S)
    assert (np.diff(keys) > 0).all()
    directions = np.array([sun.direction(t) for t in keys])
    cosine = (directions[1:] * directions[:-1]).sum(1)
    assert np.arccos(np.clip(cosine, -1, 1)).max() <= SUN_STEP_RAD * (1 + 1e-9)


def test_lamps_and_suns_at_rest_have_one_instant() -> None:
    assert key_times_ns(BULB) == (0.0,)
    assert key_times_ns(STILL) == (3.0 * NS_PER_S,)


def test_only_suns_that_move_are_moving_suns() -> None:
    assert moving_suns(Scene("suns", (), {}, (BULB, MOVING, STILL))) == (1,)


def test_the_angle_travelled_grows_and_is_no_less_than_that_between_the_directions() -> None:
    sun = Sun("sun", 1e4, (0.0, 1.0, 2.0), (0.0, 20.0, 50.0), (10.0, 30.0, 30.0))
    travel_rad = travelled_rad(sun)
    directions = np.array([sun.direction(t * NS_PER_S) for t in sun.times_s])
    apart_rad = np.arccos((directions[1:] * directions[:-1]).sum(1))
    assert travel_rad[0] == 0
    assert (np.diff(travel_rad) >= apart_rad - 1e-9).all()
