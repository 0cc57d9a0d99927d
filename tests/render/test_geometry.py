"""Rays agree with the planes they meet."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.render.geometry import RayCaster, ball, corners, inventory
from vobench.scene.material import Glass, Material, Matt
from vobench.scene.scene import Mover, Path, Scene, ceiling_light
from vobench.scene.surface import box, rectangle, room

MATERIALS: dict[str, Material] = {"a": Matt("plain", 0.5, 0.0, 1.0, 8, 0), "pane": Glass()}
LAMP = ceiling_light("lamp", np.array([0.5, 0.5, 2.9]), (0.6, 0.6), power_lm=1)
CRATE = box(np.array([2.0, -0.5, 0.4]), (0.8, 0.6, 0.8), yaw_deg=30, material="a")
PANE = rectangle(np.array([-2.0, 0, 1]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), "pane")
WALK = Path(np.array([0.0, 2.0]), np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([0.0, 90.0]))
CART = Mover("cart", tuple(box(np.array([0, 0, 0.3]), (0.4, 0.2, 0.4), yaw_deg=0, material="a")), WALK)
SCENE = Scene("test", (*room((8, 6, 3), floor="a", wall="a", ceiling="a"), *CRATE, PANE), MATERIALS, (LAMP,), (CART,))
THINGS = inventory(SCENE)
ALL = np.arange(len(THINGS.surfaces))
CASTER = RayCaster(THINGS.surfaces, ALL)


def nearest_plane_m(origin_m: Array, directions: Array) -> Array:
    """Distance along each direction (N, 3) to the nearest rectangle, in float64 and without Embree."""
    nearest = np.full(len(directions), np.inf)
    for surface in THINGS.surfaces:
        along = directions @ surface.normal
        distance = (surface.corner_m - origin_m) @ surface.normal / np.where(along == 0, np.nan, along)
        local = origin_m + distance[:, None] * directions - surface.corner_m
        u, v = (local @ edge / (edge @ edge) for edge in (surface.edge_u_m, surface.edge_v_m))
        hit = (distance > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        nearest = np.where(hit & (distance < nearest), distance, nearest)
    return nearest


def test_the_way_to_a_surface_is_that_to_its_plane() -> None:
    rng = np.random.default_rng(3)
    directions = rng.standard_normal((20_000, 3))
    origin = np.array([0.3, 0.5, 1.1])
    distance = CASTER.hits(np.broadcast_to(origin, directions.shape), directions).distance
    error = np.abs(distance / nearest_plane_m(origin, directions) - 1)
    # Rays that graze an edge may fall on either side of it.
    assert (error > 1e-5).mean() < 1e-3
    assert np.median(error) < 2e-7


def test_a_ray_into_nothing_has_no_distance_and_no_surface() -> None:
    hits = CASTER.hits([[0.0, 0.0, 10.0]], [[0.0, 0.0, 1.0]])
    assert np.isnan(hits.distance).all()
    assert hits.surface.tolist() == [-1]


def test_a_hit_names_its_surface_and_the_place_on_it() -> None:
    rng = np.random.default_rng(1)
    for index, surface in enumerate(THINGS.surfaces[:6]):
        u, v = rng.uniform(0.02, 0.98, (2, 200))
        targets = surface.at(u, v)
        starts = targets + 0.01 * surface.normal
        hits = CASTER.hits(starts, np.broadcast_to(-surface.normal, starts.shape))
        at_crate = np.abs(targets - [2.0, -0.5, 0.4]).max(1) < 0.8
        assert (hits.surface[~at_crate] == index).all()
        np.testing.assert_allclose(hits.u[~at_crate], u[~at_crate], atol=1e-5)
        np.testing.assert_allclose(hits.v[~at_crate], v[~at_crate], atol=1e-5)


def test_rays_among_some_surfaces_pass_the_others_and_keep_their_names() -> None:
    origin, east = [[0.0, -0.5, 0.4]], [[1.0, 0.0, 0.0]]
    crate = CASTER.hits(origin, east).surface
    assert crate[0] in range(6, 12)
    assert RayCaster(THINGS.surfaces, ALL[:6]).hits(origin, east).surface.tolist() == [2]
    assert RayCaster(THINGS.surfaces, crate).hits(origin, east).surface.tolist() == crate.tolist()
    assert RayCaster(THINGS.surfaces, []).hits(origin, east).surface.tolist() == [-1]


def test_sight_is_blocked_by_what_stands_between_and_only_then_and_both_ways() -> None:
    before, behind, above = [0.5, -0.5, 0.3], [3.5, -0.5, 0.3], [3.5, -0.5, 2.5]
    assert CASTER.occluded([before, behind, before, above], [behind, before, above, before]).tolist() == [
        True,
        True,
        False,
        False,
    ]


def test_the_corners_of_a_surface_go_round_its_normal() -> None:
    for surface in THINGS.surfaces:
        a, b, c, _ = corners(surface)
        normal = np.cross(b - a, c - b)
        np.testing.assert_allclose(normal / np.linalg.norm(normal), surface.normal, atol=1e-12)


def test_the_inventory_keeps_one_order_while_movers_move() -> None:
    later = inventory(SCENE, t_ns=2e9)
    assert len(later.surfaces) == len(SCENE.surfaces) + 1 + len(CART.surfaces)
    np.testing.assert_array_equal(later.mover, THINGS.mover)
    np.testing.assert_array_equal(np.flatnonzero(later.panel == 0), [len(SCENE.surfaces)])
    assert [THINGS.surfaces[i].material for i in np.flatnonzero(later.pane)] == ["pane"]
    for before, after, own in zip(THINGS.surfaces, later.surfaces, later.mover, strict=True):
        assert np.array_equal(before.corner_m, after.corner_m) == (own < 0)
    # A quarter turn left, and a metre ahead.
    first, moved = CART.surfaces[0], later.surfaces[-len(CART.surfaces)]
    np.testing.assert_allclose(moved.normal, first.normal, atol=1e-12)
    np.testing.assert_allclose(moved.at(np.array(0.5), np.array(0.5)), [1.0, 0, 0.5], atol=1e-12)


def test_a_ball_holds_all_corners_and_touches_one() -> None:
    around = ball(CRATE)
    far = np.linalg.norm(np.concatenate([corners(s) for s in CRATE]) - around.centre_m, axis=1)
    assert far.max() == around.radius_m
