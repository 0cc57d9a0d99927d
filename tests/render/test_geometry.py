"""Rays agree with the planes they meet."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import LENSES, looking
from vobench.geometry.se3 import Array
from vobench.render.geometry import RayCaster, all_surfaces, corners
from vobench.scene.scene import Scene, box, ceiling_light, room

LAMP = ceiling_light("lamp", np.array([0.5, 0.5, 2.9]), (0.6, 0.6), power_lm=1)
CRATE = box(np.array([2.0, -0.5, 0.4]), (0.8, 0.6, 0.8), yaw_deg=30, material="a")
SCENE = Scene("test", (*room((8, 6, 3), floor="a", wall="a", ceiling="a"), *CRATE), {}, (LAMP,))
CASTER = RayCaster(SCENE)


def nearest_plane_m(origin_m: Array, directions: Array) -> Array:
    """Distance along each direction (N, 3) to the nearest rectangle, in float64 and without Embree."""
    nearest = np.full(len(directions), np.inf)
    for surface in all_surfaces(SCENE):
        along = directions @ surface.normal
        distance = (surface.corner_m - origin_m) @ surface.normal / np.where(along == 0, np.nan, along)
        local = origin_m + distance[:, None] * directions - surface.corner_m
        u, v = (local @ edge / (edge @ edge) for edge in (surface.edge_u_m, surface.edge_v_m))
        hit = (distance > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        nearest = np.where(hit & (distance < nearest), distance, nearest)
    return nearest


@pytest.mark.parametrize("camera", LENSES.values(), ids=list(LENSES))
@pytest.mark.parametrize("pitch_deg", [90, 30, 5])
def test_depth_at_pixel_centres_is_that_of_the_planes(camera: Pinhole, pitch_deg: float) -> None:
    turn = se3.transform(se3.rotation_z(np.deg2rad(-20)), (-0.3, 0.2, 0))
    T_world_camera = turn @ looking(pitch_deg=pitch_deg, position_m=(0.25, 0.06, 0.4))
    depth = CASTER.depth(camera, T_world_camera)
    rays = camera.rays(camera.pixel_grid()).reshape(-1, 3) @ T_world_camera[:3, :3].T
    exact = nearest_plane_m(T_world_camera[:3, 3], rays).reshape(depth.shape)
    error = np.abs(depth / exact - 1)
    # Rays that graze an edge may fall on either side of it.
    assert (error > 1e-5).mean() < 1e-4
    assert np.median(error) < 2e-7


def test_depth_is_along_the_optical_axis_not_along_the_ray() -> None:
    camera = LENSES["paper_blender"]
    depth = CASTER.depth(camera, looking(pitch_deg=90, position_m=(0, 0, 0.4)))
    np.testing.assert_allclose(depth, 0.4, rtol=1e-6)


def test_a_ray_into_nothing_has_no_distance_and_no_surface() -> None:
    outside, up = [[0.0, 0.0, 10.0]], [[0.0, 0.0, 1.0]]
    assert np.isnan(CASTER.distance(outside, up)).all()
    assert CASTER.hits(outside, up).surface.tolist() == [-1]


def test_a_hit_names_its_surface_and_the_place_on_it() -> None:
    rng = np.random.default_rng(1)
    for index, surface in enumerate(all_surfaces(SCENE)[:6]):
        u, v = rng.uniform(0.02, 0.98, (2, 200))
        targets = surface.at(u, v)
        starts = targets + 0.01 * surface.normal
        hits = CASTER.hits(starts, np.broadcast_to(-surface.normal, starts.shape))
        at_crate = np.abs(targets - [2.0, -0.5, 0.4]).max(1) < 0.8
        assert (hits.surface[~at_crate] == index).all()
        np.testing.assert_allclose(hits.u[~at_crate], u[~at_crate], atol=1e-5)
        np.testing.assert_allclose(hits.v[~at_crate], v[~at_crate], atol=1e-5)


def test_sight_is_blocked_by_what_stands_between_and_only_then_and_both_ways() -> None:
    before, behind, above = [0.5, -0.5, 0.3], [3.5, -0.5, 0.3], [3.5, -0.5, 2.5]
    assert CASTER.occluded([before, behind, before, above], [behind, before, above, before]).tolist() == [
        True,
        True,
        False,
        False,
    ]


def test_the_corners_of_a_surface_go_round_its_normal() -> None:
    for surface in all_surfaces(SCENE):
        a, b, c, _ = corners(surface)
        normal = np.cross(b - a, c - b)
        np.testing.assert_allclose(normal / np.linalg.norm(normal), surface.normal, atol=1e-12)
