"""Rays against bodies that move, compared with the planes they meet, in float64 and without Embree."""

from itertools import pairwise

import numpy as np
import pytest

from tests.rendering.rectangles import box, rectangle, room
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.occlusion import Bodies
from vobench.rendering.shot import CameraShot, shot_transforms
from vobench.scene.material import Material
from vobench.scene.mesh import moved, quad
from vobench.scene.scene import Mover, Scene, WaypointMotion
from vobench.scene.triangles import Thing

MATERIALS = {"a": Material(), "glass": Material("pane", eta=1.5)}
WALK = WaypointMotion(np.array([0.0, 2.0]), np.array([[1.0, 0, 0], [2.0, 1.0, 0]]), np.array([0.0, 90.0]))
CART = Mover("cart", tuple(box(np.array([0, 0, 0.3]), (0.4, 0.2, 0.6), yaw_deg=0, material="a")), WALK)
PANE = rectangle(np.array([-1.5, 0, 1]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), "glass")
SIDES = room((6, 5, 3), floor="a", wall="a", ceiling="a")
SCENE = Scene("room", (*SIDES, PANE), MATERIALS, (), (CART,))
BODIES = Bodies(SCENE)
T_NS = 700_000_000
POSE = se3.transform(se3.rotation_z(0.4), [-0.3, 0.2, 1.1])
RNG = np.random.default_rng(0)


def unit_rays(count: int) -> Array:
    rays = RNG.normal(size=(count, 3))
    return rays / np.linalg.norm(rays, axis=1, keepdims=True)


def nearest_fronts_m(bodies: Bodies, directions: Array, T_bodies_camera: list[Array], *, glass: bool) -> Array:
    """How far the first face is that rays (R, 3) meet from its front, infinite for none, by planes and edges alone."""
    nearest = np.full(len(directions), np.inf)
    for face, corners in enumerate(bodies.faces.corners_m):
        thing = bodies.faces.things[bodies.faces.thing[face]]
        if (thing.material == "glass") is not glass:
            continue
        T = T_bodies_camera[bodies.body[face]]
        turned = directions @ T[:3, :3].T
        normal = bodies.normals[face]
        cosine = turned @ normal
        distance = (bodies.offsets_m[face] - T[:3, 3] @ normal) / np.where(cosine == 0, np.nan, cosine)
        points = T[:3, 3] + distance[:, None] * turned
        inside = [np.cross(corners[i - 2] - corners[i], points - corners[i]) @ normal >= 0 for i in range(3)]
        meets = (cosine < 0) & (distance > 0) & np.all(inside, axis=0)
        nearest = np.where(meets, np.minimum(nearest, distance), nearest)
    return nearest


def test_what_a_camera_sees_is_the_nearest_front_to_float64() -> None:
    transforms = shot_transforms(SCENE.movers, CameraShot(POSE, T_NS))
    rays = unit_rays(5000)
    hits = BODIES.visible(rays, transforms.T_bodies_camera)
    expected = nearest_fronts_m(BODIES, rays, transforms.T_bodies_camera, glass=False)
    assert (BODIES.body[hits.face] == 1).sum() > 20
    np.testing.assert_allclose(hits.distance, expected, rtol=1e-9)


def test_glass_is_looked_through_and_lies_before_what_is_seen_behind_it() -> None:
    transforms = shot_transforms(SCENE.movers, CameraShot(POSE, T_NS))
    rays = unit_rays(5000)
    hits = BODIES.visible(rays, transforms.T_bodies_camera)
    pane_m = nearest_fronts_m(BODIES, rays, transforms.T_bodies_camera, glass=True)
    turned_away = nearest_fronts_m(BODIES, rays, transforms.T_bodies_camera, glass=False)
    behind = BODIES.behind_panes(rays, transforms.T_bodies_camera, hits.distance)
    assert behind.sum() > 50
    front = np.isfinite(pane_m)
    np.testing.assert_array_equal(behind[front], (pane_m < turned_away)[front])
    assert "glass" not in {BODIES.faces.things[thing].material for thing in BODIES.faces.thing[hits.face]}


def test_a_point_is_hidden_from_another_as_that_is_from_it() -> None:
    transforms = shot_transforms(SCENE.movers, CameraShot(POSE, T_NS))
    count = 3000
    starts = RNG.uniform([-2.9, -2.4, 0.1], [2.9, 2.4, 2.9], (count, 3)).astype(np.float32)
    ends = RNG.uniform([-2.9, -2.4, 0.1], [2.9, 2.4, 2.9], (count, 3)).astype(np.float32)
    reach = np.ones(count, np.float32)
    there = BODIES.blocked(starts, ends - starts, transforms.T_bodies_world, reach)
    back = BODIES.blocked(ends, starts - ends, transforms.T_bodies_world, reach)
    assert 10 < there.sum() < count / 2
    assert (there != back).mean() < 1e-3


def test_rays_without_reach_are_not_blocked_and_a_shorter_reach_never_blocks_more() -> None:
    transforms = shot_transforms(SCENE.movers, CameraShot(POSE, T_NS))
    starts = np.tile(POSE[:3, 3], (2000, 1)).astype(np.float32)
    vectors = (10 * unit_rays(2000)).astype(np.float32)
    blocked = [
        BODIES.blocked(starts, vectors, transforms.T_bodies_world, np.full(2000, reach, np.float32))
        for reach in (-1.0, 0.05, 0.2, 1.0)
    ]
    assert not blocked[0].any()
    assert blocked[-1].all()
    for shorter, longer in pairwise(blocked):
        assert not (shorter & ~longer).any()


@pytest.mark.parametrize("shift", [[0, 0, 0], [2000.0, -900.0, 40.0]])
def test_no_ray_slips_through_a_floor_of_many_triangles(shift: list[float]) -> None:
    side = np.linspace(-1, 1, 41)
    quads = [quad([x, y, 0], [0.05, 0, 0], [0, 0.05, 0]) for x in side[:-1] for y in side[:-1]]
    things = tuple(Thing("tile", moved(mesh, se3.transform(np.eye(3), shift)), "a") for mesh in quads)
    bodies = Bodies(Scene("floor", things, MATERIALS, ()))
    eye_m = np.array([0.01, 0.02, 1.0])
    above = se3.transform(np.eye(3), shift + eye_m)
    corners_m = np.stack([*RNG.choice(side[1:-1], (2, 2000)), np.zeros(2000)], -1)
    targets = corners_m - eye_m
    rays = targets / np.linalg.norm(targets, axis=1, keepdims=True)
    hits = bodies.visible(rays, [above])
    assert (hits.face >= 0).all()
    np.testing.assert_allclose(hits.distance, np.linalg.norm(targets, axis=1), rtol=1e-6)
