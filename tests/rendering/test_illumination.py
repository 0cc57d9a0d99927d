"""Layers add up by their levels; a moving sun gives the light of one at rest."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.parts import light_at
from vobench.asset.shape import block
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.illumination import Illumination
from vobench.scene.light import NS_PER_S, Dimmer, Flicker, Light, PointLight, Sun, Switched
from vobench.scene.material import Material
from vobench.scene.mesh import moved, quad
from vobench.scene.scene import Mover, Scene, ceiling_light
from vobench.scene.triangles import Thing

COARSE = BakeSettings(spacing_m=0.1, light_rays=16, indirect_spacing_m=0.3, indirect_rays=64, bounces=3)
DIRECT = replace(COARSE, bounces=0)
MATERIALS = {"grey": Material(texture=Procedural("plain", 0.5, 0.0, 1.0, 8, 0)), "pane": Material("pane", eta=1.5)}
X, Y, Z = np.diag([4.0, 4.0, 2.5])
ROOM = tuple(
    Thing(name, quad(corner, u, v), "grey")
    for name, corner, u, v in (
        ("floor", -(X + Y) / 2, X, Y),
        ("ceiling", Z - (X + Y) / 2, Y, X),
        ("east", (X - Y) / 2, Z, Y),
        ("west", -(X + Y) / 2, Y, Z),
        ("north", (Y - X) / 2, X, Z),
        ("south", -(X + Y) / 2, Z, X),
    )
)
PANEL = ceiling_light("panel", np.array([0.5, 0.3, 2.4]), (0.4, 0.4), power_lm=1000)
BULB = PointLight("bulb", np.array([-1.0, 0.5, 2.0]), 500.0)
UP = se3.transform(np.eye(3), [0, 0, 0.5])
CRATE = Thing("crate", moved(block((0.4, 0.6, 1.0), bevel_m=0), UP), "grey")
PLACES = np.random.default_rng(0).dirichlet((1, 1, 1), 1500)  # on a triangle


def scene(*lights: Light, things: tuple[Thing, ...] = ROOM, movers: tuple[Mover, ...] = ()) -> Scene:
    return Scene("test", things, MATERIALS, lights, movers)


def on(baked: BakedScene, light: np.ndarray, name: str) -> np.ndarray:
    """Light (N,) at places all over the faces of one thing."""
    of_thing = [baked.faces.things[thing].name == name for thing in baked.faces.thing]
    faces = np.unique(baked.parts.parent[of_thing])
    face = np.repeat(faces, len(PLACES))
    _, u, v = np.tile(PLACES, (len(faces), 1)).T
    return light_at(baked, light[..., 1], face, u, v)


def layer(baked: BakedScene, index: int) -> np.ndarray:
    """The map (H, W, 3) of one light alone, which is white, at level 1."""
    around = (baked.spread @ baked.bounced[index]).reshape(*baked.direct.shape[1:], 3)
    return baked.direct[index][..., None] + around


def ns(t_s: float) -> int:
    return round(t_s * NS_PER_S)


@pytest.fixture(scope="module")
def lamps() -> BakedScene:
    lights = (
        PANEL,
        replace(BULB, name="flickers", level=Flicker(depth=0.5)),
        replace(BULB, name="switched", position_m=np.array([1.0, -1, 2]), level=Switched((1.0,))),
    )
    return bake(scene(*lights), COARSE)


def test_the_light_is_the_sum_of_layers_by_their_levels(lamps: BakedScene) -> None:
    light = Illumination(lamps)
    for start, end in ((0, 0), (ns(0.1), ns(0.103)), (ns(0.9), ns(1.1)), (ns(2), ns(2.004))):
        levels = [one.level.mean(start, end) for one in lamps.scene.lights]
        np.testing.assert_allclose(
            light.at(start, end), sum(level * layer(lamps, i) for i, level in enumerate(levels)), rtol=1e-4
        )


def test_a_light_switched_off_leaves_what_the_others_give(lamps: BakedScene) -> None:
    after = Illumination(lamps).at(ns(2), ns(2))
    flicker = np.float32(lamps.scene.lights[1].level.mean(ns(2), ns(2)))
    np.testing.assert_allclose(after, layer(lamps, 0) + flicker * layer(lamps, 1), rtol=1e-4)


def test_nothing_is_computed_anew_where_nothing_has_changed(lamps: BakedScene) -> None:
    light = Illumination(lamps)
    first = light.at(ns(0.1), ns(0.105))
    assert light.at(ns(0.1), ns(0.105)) is first
    # A whole period on it is the same again; a quarter on it is not.
    assert light.at(ns(0.101), ns(0.106)) is not first
    steady = Illumination(bake(scene(PANEL), DIRECT))
    assert steady.at(0, 0) is steady.at(ns(5), ns(6))


def test_a_dimmer_scales_its_own_layer_only() -> None:
    dimmed = replace(BULB, level=Dimmer((0.0, 10.0), (1.0, 0.0)))
    baked = bake(scene(PANEL, dimmed), DIRECT)
    light = Illumination(baked)
    np.testing.assert_allclose(light.at(ns(5), ns(5)) - light.at(ns(10), ns(10)), 0.5 * layer(baked, 1), atol=1e-3)


def window_room() -> tuple[Thing, ...]:
    """A room whose north wall is glass."""
    return tuple(replace(thing, material="pane") if thing.name == "north" else thing for thing in ROOM)


@pytest.mark.parametrize(
    "t_s", [4.3, pytest.param(0.0, marks=pytest.mark.slow), pytest.param(10.0, marks=pytest.mark.slow)]
)
def test_a_moving_sun_lights_as_one_that_stands_where_it_is(t_s: float) -> None:
    sun = Sun("sun", 1e4, (0.0, 10.0), (80.0, 100.0), (30.0, 40.0))
    baked = bake(scene(sun, things=window_room()), COARSE)
    later = Illumination(baked).at(ns(t_s), ns(t_s))
    still = Sun("sun", 1e4, (0.0,), (80 + 2 * t_s,), (30 + t_s,))
    rest = bake(scene(still, things=window_room()), COARSE)
    alone = on(rest, layer(rest, 0), "floor")
    difference = np.abs(on(baked, later, "floor") - alone)
    # The sun's patch may differ by a step of the sun at its rim; indirect light is interpolated.
    assert np.median(difference) < 0.01 * alone.mean()
    assert difference.mean() < 0.01 * alone.mean()


def test_a_slow_sun_is_traced_anew_only_when_it_has_turned_a_little() -> None:
    sun = Sun("sun", 1e4, (0.0, 3600.0), (80.0, 95.0), (30.0, 30.0))
    light = Illumination(bake(scene(sun, things=window_room()), DIRECT))
    assert light.at(ns(10), ns(10)) is light.at(ns(10.1), ns(10.1))
    assert light.at(ns(10), ns(10)) is not light.at(ns(60), ns(60))


def test_a_sun_that_rests_first_lights_as_one_that_stands_there():
    coarse = BakeSettings(spacing_m=0.5, light_rays=4, indirect_spacing_m=1.0, indirect_rays=16, bounces=2)
    sun = Sun("sun", 1e4, (0.0, 10.0, 20.0), (90.0, 90.0, 100.0), (30.0, 30.0, 30.0))
    baked = bake(scene(sun, things=window_room()), coarse)
    np.testing.assert_allclose(Illumination(baked).at(0, 0), layer(baked, 0), rtol=1e-4, atol=1e-2)


def test_a_sun_that_ends_where_it_began_moves_meanwhile():
    coarse = BakeSettings(spacing_m=0.5, light_rays=1, indirect_spacing_m=1.0, indirect_rays=4, bounces=1)
    sun = Sun("sun", 1e4, (0.0, 10.0), (90.0, 450.0), (30.0, 30.0))
    light = Illumination(bake(scene(sun, things=window_room()), coarse))
    north, south = light.at(0, 0), light.at(ns(5), ns(5))
    assert north.sum() > 2 * south.sum()
