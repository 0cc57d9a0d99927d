"""Lights as ground truth sees them: where each shines, and from where on something may hide it."""

import numpy as np
import pytest

from tests.rendering.rectangles import room
from vobench.rendering.lamp import Lamp, lamp_groups, lamp_of, lamps_on
from vobench.rendering.occlusion import Bodies
from vobench.scene.light import PointLight, Sky, SpotLight, Steady, Sun
from vobench.scene.material import Material
from vobench.scene.mesh import face_corners
from vobench.scene.scene import Scene, ceiling_light

DOWN = np.array([0.0, 0.0, -1.0])
POINTS = np.random.default_rng(0).normal(size=(200, 3)).astype(np.float32)


def test_a_spot_shines_within_its_cone_alone() -> None:
    position_m = np.array([0.1, 0.2, 3.0])
    lamp = Lamp(position_m, DOWN, float(np.cos(np.deg2rad(25.0))))
    vectors_m = lamp.vectors_m(POINTS)
    np.testing.assert_allclose(POINTS + vectors_m, np.tile(position_m, (200, 1)), atol=1e-5)
    cosine = vectors_m @ -DOWN / np.linalg.norm(vectors_m, axis=1)
    shines = lamp.shines(vectors_m)
    np.testing.assert_array_equal(shines, cosine > np.cos(np.deg2rad(25.0)))
    assert 0 < np.mean(shines) < 1


def test_the_sun_is_in_one_direction_from_everywhere_and_shines_on_what_faces_it() -> None:
    towards = np.array([0.6, 0.0, 0.8])
    lamp = Lamp(None, towards)
    vectors_m = lamp.vectors_m(POINTS)
    assert np.ptp(vectors_m, axis=0).max() == 0
    np.testing.assert_allclose(vectors_m[0] / np.linalg.norm(vectors_m[0]), towards, rtol=1e-6)
    assert lamp.shines(vectors_m) is True
    normals = np.array([[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0]])
    assert lamp.is_before(normals, np.array([5.0, -5.0, 5.0])).tolist() == [True, False, True]


def test_a_flat_panel_shines_only_to_its_front() -> None:
    panel = ceiling_light("lamp", np.array([0.0, 0, 2.0]), (1.0, 0.5), power_lm=1)
    lamp = lamp_of(face_corners(panel.mesh))
    np.testing.assert_allclose(lamp.center_m, [0, 0, 2.0], atol=1e-9)
    np.testing.assert_allclose(lamp.axis, DOWN, atol=1e-12)
    points = np.array([[0.3, 0.1, 1.0], [0.3, 0.1, 3.0]], np.float32)
    assert np.broadcast_to(lamp.shines(lamp.vectors_m(points)), 2).tolist() == [True, False]
    assert lamp.is_before(np.array([[0, 0, 1.0]]), np.array([1.0])).tolist() == [True]
    assert lamp.is_before(np.array([[0, 0, 1.0]]), np.array([2.5])).tolist() == [False]


def test_lamps_that_are_off_and_the_sky_are_none() -> None:
    lights = (
        PointLight("on", np.array([0.0, 0, 1.0]), 10.0),
        PointLight("off", np.array([0.0, 0, 1.0]), 10.0, Steady(0.0)),
        SpotLight("spot", np.array([0.0, 0, 2.0]), DOWN, 10.0, 20.0, 30.0),
        Sun("sun", 1e4, (0.0,), (0.0,), (45.0,)),
        Sky("sky", 1e3),
    )
    sides = tuple(room((4, 4, 3), floor="a", wall="a", ceiling="a"))
    scene = Scene("room", sides, {"a": Material()}, lights)
    assert lamps_on(scene, 0) == (0, 2, 3)
    bodies = Bodies(scene)
    is_lit = np.ones(len(bodies.normals), bool)
    is_lit[0] = False
    (group,) = lamp_groups(scene, bodies, is_lit, (0, 2, 3), 0)
    assert group.lamps[1].min_cosine == pytest.approx(np.cos(np.deg2rad(30.0)))
    assert group.lamps[2].center_m is None
    assert group.facing[0] == 0
    assert group.facing[-1] == 0
    for bit, lamp in enumerate(group.lamps):
        is_before = lamp.is_before(bodies.normals, bodies.offsets_m) & is_lit
        np.testing.assert_array_equal((group.facing >> np.uint32(bit)) & 1, is_before)


def test_more_lamps_than_bits_are_several_groups() -> None:
    bulbs = tuple(PointLight(f"bulb_{nth}", np.array([0.0, 0, 1.0]), 10.0) for nth in range(40))
    scene = Scene("room", tuple(room((4, 4, 3), floor="a", wall="a", ceiling="a")), {"a": Material()}, bulbs)
    bodies = Bodies(scene)
    is_lit = np.ones(len(bodies.normals), bool)
    groups = list(lamp_groups(scene, bodies, is_lit, range(40), 0))
    assert [len(group.lamps) for group in groups] == [32, 8]
