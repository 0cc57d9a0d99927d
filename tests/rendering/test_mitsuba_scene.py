"""The state of a scene is what changes its pictures; a scene in Mitsuba's memory is brought into any state and back."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.rectangles import box, rectangle
from vobench.errors import MissingDependencyError
from vobench.rendering import mitsuba
from vobench.rendering.mitsuba_scene import MitsubaScene, SceneState, scene_state
from vobench.scene.light import Dimmer, PointLight, Sun
from vobench.scene.material import Material
from vobench.scene.scene import Mover, Scene, WaypointMotion

FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "grey")
BULB = PointLight("bulb", np.array([0.0, 0, 2.0]), 500.0, Dimmer((0.0, 2.0), (0.0, 1.0)))
SUN = Sun("sun", 1e4, (0.0, 10.0), (0.0, 90.0), (40.0, 40.0))
WALK = WaypointMotion(np.array([0.0, 2.0]), np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.zeros(2))
CART = Mover("cart", tuple(box(0.2 * np.eye(3)[2], (0.4, 0.4, 0.4), yaw_deg=0, material="grey")), WALK)
STILL = Scene("still", (FLOOR,), {"grey": Material(colour=(0.5, 0.5, 0.5))}, (BULB,))
SECOND_NS = 1_000_000_000
DOWN = np.array([[1.0, 0, 0, 0], [0, -1.0, 0, 0], [0, 0, -1.0, 3.0], [0, 0, 0, 1.0]])  # from 3 m above


def test_a_state_has_the_mean_levels_of_an_interval() -> None:
    assert scene_state(STILL, 0, SECOND_NS).levels == pytest.approx((0.25,))
    assert scene_state(STILL, SECOND_NS, SECOND_NS).levels == pytest.approx((0.5,))


def test_the_instant_counts_only_where_something_moves() -> None:
    assert scene_state(STILL, 0, SECOND_NS).t_ns == 0
    assert scene_state(replace(STILL, movers=(CART,)), 0, SECOND_NS).t_ns == SECOND_NS / 2
    assert scene_state(replace(STILL, lights=(SUN,)), SECOND_NS, SECOND_NS).t_ns == SECOND_NS


@pytest.fixture
def require_mitsuba() -> None:
    try:
        mitsuba.prepare()
    except MissingDependencyError as error:
        pytest.skip(str(error))


def middle_radiance(world: MitsubaScene) -> float:
    """The radiance of a single pixel below the camera."""
    corners = np.array([[[-0.05, -0.05, 1], [0.05, -0.05, 1]], [[-0.05, 0.05, 1], [0.05, 0.05, 1]]], np.float32)
    radiance = world.trace(corners, np.zeros(1, np.int64), DOWN[None], samples=64, seed=1)
    return float(radiance.mean()) / 64


@pytest.mark.usefixtures("require_mitsuba")
def test_light_follows_its_level_and_a_mover_its_path_there_and_back() -> None:
    world = MitsubaScene(replace(STILL, movers=(CART,)), max_depth=2)
    world.become(SceneState((1.0,), 0.0))
    on_cart = middle_radiance(world)
    world.become(SceneState((0.5,), 0.0))
    assert middle_radiance(world) == pytest.approx(on_cart / 2, rel=1e-4)
    world.become(SceneState((1.0,), 2.0 * SECOND_NS))
    on_floor = middle_radiance(world)
    assert on_floor == pytest.approx(on_cart * (1.6 / 2) ** 2, rel=0.02)  # the cart is 0.4 m nearer to the bulb
    world.become(SceneState((1.0,), 0.0))
    assert middle_radiance(world) == on_cart
