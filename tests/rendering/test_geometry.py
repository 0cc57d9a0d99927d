"""Rays agree with the planes they meet."""

from dataclasses import replace

import numpy as np

from tests.rendering.rectangles import box, rectangle, room
from vobench.asset.texture import Procedural
from vobench.geometry.se3 import Array
from vobench.rendering.embree import Hits
from vobench.rendering.geometry import RayCaster, bounding_sphere, sample_points
from vobench.rendering.visibility import Visibility
from vobench.scene.material import Material, pane_reflectance
from vobench.scene.mesh import quad
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light, triangles
from vobench.scene.triangles import Thing, triangle_table

MATERIALS: dict[str, Material] = {
    "a": Material(texture=Procedural("plain", 0.5, 0.0, 1.0, 8, 0)),
    "pane": Material("pane", eta=1.5),
}
LAMP = ceiling_light("lamp", np.array([0.5, 0.5, 2.9]), (0.6, 0.6), power_lm=1)
CRATE = box(np.array([2.0, -0.5, 0.4]), (0.8, 0.6, 0.8), yaw_deg=30, material="a")
PANE = rectangle(np.array([-2.0, 0, 1]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), "pane")
WALK = WaypointMotion(np.array([0.0, 2.0]), np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([0.0, 90.0]))
CART = Mover("cart", tuple(box(np.array([0, 0, 0.3]), (0.4, 0.2, 0.4), yaw_deg=0, material="a")), WALK)
SCENE = Scene("test", (*room((8, 6, 3), floor="a", wall="a", ceiling="a"), *CRATE, PANE), MATERIALS, (LAMP,), (CART,))
FACES = triangles(SCENE, t_ns=0)
CASTER = RayCaster(FACES)
ROOM, BOX = np.flatnonzero(FACES.thing < 6), np.flatnonzero((FACES.thing >= 6) & (FACES.thing < 12))


def nearest_plane_m(origin_m: Array, directions: Array) -> Array:
    """Distance along each direction (N, 3) to the nearest face, in float64 and without Embree."""
    nearest = np.full(len(directions), np.inf)
    for corners, normal in zip(FACES.corners_m, FACES.plane, strict=True):
        along = directions @ normal
        distance = (corners[0] - origin_m) @ normal / np.where(along == 0, np.nan, along)
        local = origin_m + distance[:, None] * directions
        sides = [np.cross(corners[i - 2] - corners[i], local - corners[i]) @ normal for i in range(3)]
        hit = (distance > 0) & (np.min(sides, axis=0) >= 0)
        nearest = np.where(hit & (distance < nearest), distance, nearest)
    return nearest


def test_the_way_to_a_face_is_that_to_its_plane() -> None:
    rng = np.random.default_rng(3)
    directions = rng.standard_normal((20_000, 3))
    origin = np.array([0.3, 0.5, 1.1])
    distance = CASTER.hits(np.broadcast_to(origin, directions.shape), directions).distance
    error = np.abs(distance / nearest_plane_m(origin, directions) - 1)
    # Rays that graze an edge may fall on either side of it.
    assert (error > 1e-5).mean() < 1e-3
    assert np.median(error) < 2e-7


def test_a_ray_into_nothing_has_no_distance_and_no_face() -> None:
    hits = CASTER.hits([[0.0, 0.0, 10.0]], [[0.0, 0.0, 1.0]])
    assert np.isnan(hits.distance).all()
    assert hits.face.tolist() == [-1]
    assert CASTER.nearest([[0.0, 0.0, 10.0]], [[0.0, 0.0, 1.0]]).tolist() == [-1]


def test_a_hit_names_its_face_and_the_place_on_it() -> None:
    rng = np.random.default_rng(1)
    for face in BOX:
        a, b = rng.uniform(0.02, 0.98, (2, 200))
        u, v = np.sqrt(a) * (1 - b), np.sqrt(a) * b
        targets = Hits(np.full(200, face), u, v, u).at(FACES.corners_m)
        starts = targets + 0.01 * FACES.plane[face]
        hits = CASTER.hits(starts, np.broadcast_to(-FACES.plane[face], starts.shape))
        clear = np.abs(starts[:, 2]) > 0.02  # the underside lies on the floor
        assert (hits.face[clear] == face).all()
        np.testing.assert_allclose(hits.at(FACES.corners_m)[clear], targets[clear], atol=1e-5)


def test_rays_among_some_faces_pass_the_others_and_keep_their_names() -> None:
    origin, east = [[0.0, -0.5, 0.4]], [[1.0, 0.0, 0.0]]
    crate = CASTER.hits(origin, east).face
    assert crate[0] in BOX
    assert FACES.thing[RayCaster(FACES, ROOM).hits(origin, east).face].tolist() == [2]
    assert RayCaster(FACES, crate).hits(origin, east).face.tolist() == crate.tolist()
    assert RayCaster(FACES, []).hits(origin, east).face.tolist() == [-1]


def test_sight_is_blocked_by_what_stands_between_and_only_then_and_both_ways() -> None:
    before, behind, above = [0.5, -0.5, 0.3], [3.5, -0.5, 0.3], [3.5, -0.5, 2.5]
    assert CASTER.occluded([before, behind, before, above], [behind, before, above, before]).tolist() == [
        True,
        True,
        False,
        False,
    ]


def test_no_ray_slips_between_two_faces_that_share_an_edge() -> None:
    rng = np.random.default_rng(2)
    shared = rng.uniform(-3, 3, (200_000, 1)) * [1, 0, 0] + [0, 0, 0]
    corners = quad([-4, -3, 0], [8, 0, 0], [0, 6, 0])
    faces = triangle_table([Thing("floor", corners, "a")], [-1], [-1])
    on_diagonal = corners.vertices[0] + (shared[:, :1] / 8 + 0.5) * (corners.vertices[2] - corners.vertices[0])
    start = on_diagonal + rng.standard_normal((len(shared), 3)) * [1, 1, 0] + [0, 0, 2.0]
    assert RayCaster(faces).stops(start, 2 * (on_diagonal - start)).all()


def test_the_table_keeps_one_order_while_movers_move() -> None:
    later = triangles(SCENE, t_ns=2e9)
    moving = later.mover >= 0
    np.testing.assert_array_equal(later.corners_m[~moving], FACES.corners_m[~moving])
    # A quarter turn left, and a metre ahead.
    before = FACES.corners_m[moving] @ np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]]) + [1.0, 0, 0]
    np.testing.assert_allclose(later.corners_m[moving], before, atol=1e-12)


def test_a_ball_holds_all_corners_and_touches_one() -> None:
    corners = FACES.corners_m[BOX]
    around = bounding_sphere(corners)
    far = np.linalg.norm(corners.reshape(-1, 3) - around.centre_m, axis=1)
    assert far.max() == around.radius_m


def test_points_are_uniform_over_triangles() -> None:
    middle = (np.arange(400) + 0.5) / 400
    a, b = (part.ravel() for part in np.meshgrid(middle, middle))
    corners = np.array([[[0, 0, 0], [2, 0, 0], [0, 1, 0]], [[5, 0, 0], [6, 0, 0], [5, 1, 1]]], float)
    places = sample_points(corners, a, b)
    first = places[:, 0] < 3
    np.testing.assert_allclose(first.mean(), 1 / (1 + np.sqrt(0.5)), rtol=5e-3)
    np.testing.assert_allclose(places[first].mean(0), corners[0].mean(0), rtol=5e-3)
    np.testing.assert_allclose(places[~first].mean(0), corners[1].mean(0), rtol=5e-3)


def test_panes_one_behind_the_other_multiply_and_from_either_side() -> None:
    panes = [Thing("p", quad([-1, -1, z], [2, 0, 0], [0, 2, 0]), "pane") for z in (0.0, 0.5, 1.0)]
    faces = triangle_table(panes, [-1] * 3, [-1] * 3)
    seen = Visibility(faces, {"pane": replace(MATERIALS["pane"], tint=0.9)}, np.arange(len(faces)))
    start, way = np.array([[0.2, 0.1, -1.0]], np.float32), np.array([[0.3, 0.4, 3.0]], np.float32)
    once = 0.9 * (1 - pane_reflectance(np.array(3 / np.sqrt(9.25)), 1.5))
    for origin, direction in ((start, way), (start + way, -way)):
        np.testing.assert_allclose(seen.transmittance(origin, direction), once**3, rtol=1e-5)
