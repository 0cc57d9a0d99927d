"""Rays on baked light show what pictures show, lamp by lamp, without drawing any."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.rectangles import room
from vobench.asset.shape import at, block
from vobench.asset.texture import Procedural
from vobench.errors import RenderError
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.renderer import single_instant
from vobench.rendering.seen_light import SeenLight, read_seen_light, seen_light
from vobench.scene.light import PointLight, Sky, Steady
from vobench.scene.material import LUMINANCE, Material, fresnel, pane_reflectance
from vobench.scene.mesh import moved, quad
from vobench.scene.scene import Scene, ceiling_light
from vobench.scene.triangles import Thing

LENS = Pinhole(64, 48, 40.0, 40.0, 31.5, 23.5)
FLOOR = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
EYE = np.array([[0.0, 0.0, 1.5]])
DOWN = np.array([[0.0, 0.0, -1.0]])


def floor_scene(material: Material, *things: Thing, lights=(), **materials: Material) -> Scene:
    return Scene("floor", (Thing("floor", FLOOR, "floor"), *things), {"floor": material, **materials}, lights)


def seen_of(even_light, scene: Scene, *, origin=EYE, direction=DOWN) -> float:
    """The luminance that one ray shows under 100 lx everywhere."""
    baked = even_light(scene)
    return float(seen_light(baked, origin, direction).luminance(baked.scene.lights)[0])


def test_a_body_shows_reflectance_times_illuminance_over_pi(even_light) -> None:
    assert seen_of(even_light, floor_scene(Material(colour=(0.3, 0.3, 0.3)))) == pytest.approx(0.3 * 100 / np.pi)
    plain = Material(texture=Procedural("plain", 0.4))
    assert seen_of(even_light, floor_scene(plain)) == pytest.approx(0.4 * 100 / np.pi, rel=1e-5)


def test_a_pane_and_a_mirror_show_what_is_behind_and_before_them(even_light) -> None:
    grey = Material(colour=(0.3, 0.3, 0.3))
    through = 0.3 * 100 / np.pi * 0.8 * float(1 - pane_reflectance(np.array(1.0), 1.5))
    sheet = Thing("pane", quad((-1, -1, 1), (2, 0, 0), (0, 2, 0)), "pane")
    pane = Material("pane", eta=1.5, tint=0.8)
    assert seen_of(even_light, floor_scene(grey, sheet, pane=pane)) == pytest.approx(through)

    below = Thing("mirror", quad((-1, 1, 2), (2, 0, 0), (0, -2, 0)), "mirror")
    mirror = Material("mirror", tint=0.7)
    up = -DOWN
    assert seen_of(even_light, floor_scene(grey, below, mirror=mirror), direction=up) == pytest.approx(
        0.7 * 0.3 * 100 / np.pi
    )


def test_backs_of_faces_are_not_there(even_light) -> None:
    grey = Material(colour=(0.3, 0.3, 0.3))
    ceiling = Thing("ceiling", quad((-1, 1, 1), (2, 0, 0), (0, -2, 0)), "white")
    scene = floor_scene(grey, ceiling, white=Material())
    assert seen_of(even_light, scene) == pytest.approx(0.3 * 100 / np.pi)


def test_rays_that_miss_show_the_sky_and_count_as_sources(even_light) -> None:
    sky = Sky("sky", 5000.0, "uniform")
    baked = even_light(floor_scene(Material(), lights=(sky,)))
    seen = seen_light(baked, np.tile(EYE, (2, 1)), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]))
    assert seen.is_source.tolist() == [True, False]
    assert seen.luminance_cd_m2[1, 0] == pytest.approx(5000 / np.pi)


def test_a_coat_adds_what_it_mirrors_of_the_sky(even_light) -> None:
    sky = Sky("sky", 5000.0, "uniform")
    baked = even_light(floor_scene(Material(colour=(0.0, 0.0, 0.0), eta=1.5), lights=(sky,)))
    seen = seen_light(baked, EYE, DOWN)
    mirrored = float(fresnel(np.array(1.0), 1.5)) * 5000 / np.pi
    assert seen.luminance_cd_m2[1, 0] == pytest.approx(mirrored)
    assert not seen.is_source[0]


def test_levels_weigh_the_lights(even_light) -> None:
    baked = even_light(floor_scene(Material()))
    (light,) = baked.scene.lights
    seen = seen_light(baked, EYE, DOWN)
    half = seen.luminance([replace(light, level=Steady(0.5))])
    np.testing.assert_allclose(half, seen.luminance([light]) / 2)
    np.testing.assert_allclose(seen.luminance(), seen.luminance([light]))


def test_a_light_that_is_not_given_has_the_level_that_it_had_at_first(even_light) -> None:
    baked = even_light(floor_scene(Material()), level=Steady(0.25))
    seen = seen_light(baked, EYE, DOWN)
    np.testing.assert_allclose(seen.luminance(), 0.25 * seen.luminance_cd_m2[0])


def test_what_was_saved_is_read_and_a_torn_file_is_named(tmp_path) -> None:
    seen = SeenLight(
        np.arange(6, dtype=np.float32).reshape(2, 3), np.array([True, False, True]), ("a", "b"), (1.0, 0.5)
    )
    seen.save(tmp_path)
    read = read_seen_light(tmp_path)
    assert (read.names, read.levels) == (seen.names, seen.levels)
    np.testing.assert_array_equal(read.luminance_cd_m2, seen.luminance_cd_m2)
    np.testing.assert_array_equal(read.is_source, seen.is_source)
    (tmp_path / "seen_light.npz").write_bytes(b"torn")
    with pytest.raises(RenderError, match="delete this folder"):
        read_seen_light(tmp_path)


def test_rays_show_the_luminance_of_pictures(draw) -> None:
    """In a baked room with two lamps, a polished floor and a box, pixel by pixel."""
    things = room((4.0, 3.0, 2.5), floor="polished", wall="wall", ceiling="wall")
    materials = {
        "polished": Material(colour=(0.3, 0.25, 0.2), eta=1.5),
        "wall": Material(texture=Procedural("plaster", 0.5, 0.3, resolution_px=64)),
        "box": Material(colour=(0.6, 0.2, 0.2)),
    }
    box = Thing("box", moved(block((0.5, 0.5, 0.5), bevel_m=0), at(0.8, 0.3, 0.25)), "box")
    panel = ceiling_light("panel", np.array([0.0, 0.0, 2.4]), (0.6, 0.6), power_lm=2000.0)
    bulb = PointLight("bulb", np.array([-1.0, 0.5, 1.8]), 500.0)
    scene = Scene("room", (*things, box), materials, (panel, bulb))
    baked = bake(scene, BakeSettings(spacing_m=0.1, light_rays=4, indirect_spacing_m=0.3, indirect_rays=16))
    T = np.eye(4)
    T[:3, 3] = (-1.2, -0.8, 1.2)
    T = T @ looking(pitch_deg=15, position_m=(0, 0, 0))
    picture = draw(baked).radiance(LENS, single_instant(LENS, T), weights=LUMINANCE)

    columns, rows = np.meshgrid(np.arange(64), np.arange(48))
    directions = LENS.rays(np.stack([columns, rows], -1).reshape(-1, 2)) @ T[:3, :3].T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen = seen_light(baked, np.tile(T[:3, 3], (len(directions), 1)), directions).luminance(scene.lights)
    assert seen.mean() == pytest.approx(picture.mean(), rel=0.03)
    shares = [5, 25, 50, 75, 95]
    np.testing.assert_allclose(np.percentile(seen, shares), np.percentile(picture, shares), rtol=0.06)
