"""Triangles leave no gap: corners that meet are one, and edges have the corners of others that lie on them."""

from collections.abc import Iterator

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.rendering.watertight import watertight
from vobench.scene.mesh_arrays import MeshArrays
from vobench.scene.mesh_arrays import quad_arrays as quad


def sphere(count: int) -> MeshArrays:
    """A ball of radius 1."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * count + 1), np.linspace(0, np.pi, count + 1))
    points = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1).reshape(-1, 3)
    a = (np.arange(count)[:, None] * (2 * count + 1) + np.arange(2 * count)).ravel()
    b = a + 2 * count + 1
    faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)]).astype(np.int32)
    return MeshArrays(points, faces, np.stack([u, v], -1).reshape(-1, 2), points)


def edges(triangles: Array) -> list[tuple[bytes, bytes]]:
    """Directed edges of all triangles (T, 3, 3), by the bits that OpenGL is given."""
    ends = [[(corner + 0.0).astype(np.float32).tobytes() for corner in triangle] for triangle in triangles]
    return [(here, there) for ring in ends for here, there in zip(ring, ring[1:] + ring[:1], strict=True)]


def tiling(rng: np.random.Generator, u: tuple[float, float], v: tuple[float, float], depth: int) -> Iterator[Array]:
    """A rectangle cut into rectangles at random, again and again, its corners blurred as sums of floats are."""
    if depth == 0:
        corners = np.array([(u[0], v[0], 1.0), (u[1], v[0], 1.0), (u[1], v[1], 1.0), (u[0], v[1], 1.0)])
        yield corners + rng.uniform(-1e-6, 1e-6, corners.shape)
        return
    share = rng.uniform(0.2, 0.8)
    sides = (u, v) if depth % 2 else (v, u)
    middle = sides[0][0] + share * (sides[0][1] - sides[0][0])
    for half in ((sides[0][0], middle), (middle, sides[0][1])):
        yield from tiling(rng, *((half, v) if depth % 2 else (u, half)), depth - 1)


def halves(quads: list[Array]) -> Array:
    """Two triangles (2 Q, 3, 3) of each quad."""
    return np.concatenate([corners[[[0, 1, 2], [0, 2, 3]]] for corners in quads])


def test_in_a_wall_of_any_rectangles_each_edge_but_the_outer_ones_is_met_by_the_same_edge_backwards() -> None:
    faces = halves(list(tiling(np.random.default_rng(0), (-3.0, 4.0), (0.0, 2.6), 6)))
    parts = watertight(faces)
    directed = edges(parts.corners_m)
    alone = [(a, b) for a, b in directed if (b, a) not in set(directed)]
    assert len(faces) == 128 < len(parts.corners_m)
    assert len(set(directed)) == len(directed)
    # What is not met is the outer border: one closed ring.
    followed, at = 0, alone[0][0]
    following = dict(alone)
    while followed == 0 or at != alone[0][0]:
        followed, at = followed + 1, following[at]
    assert followed == len(alone) >= 4
    areas = np.linalg.norm(np.cross(*np.moveaxis(np.diff(parts.corners_m, axis=1), 1, 0)), axis=1) / 2
    assert areas.sum() == pytest.approx(7 * 2.6, rel=1e-5)
    np.testing.assert_allclose(parts.interpolated(faces), parts.corners_m, atol=2e-5)


def test_the_backs_of_a_wall_are_split_as_its_front_is() -> None:
    front = halves(list(tiling(np.random.default_rng(2), (0.0, 5.0), (0.0, 3.0), 4)))
    both = watertight(np.concatenate([front, front[:, ::-1]]))
    alone = watertight(front)
    assert len(both.corners_m) == 2 * len(alone.corners_m)


def test_what_is_watertight_is_not_changed() -> None:
    once = watertight(halves(list(tiling(np.random.default_rng(1), (0.0, 5.0), (0.0, 3.0), 5)))).corners_m
    np.testing.assert_array_equal(watertight(once).corners_m, once)


def test_what_only_comes_near_is_left_as_it_is() -> None:
    square = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)).corners_m
    beside = quad((0.2, -1, 0), (0.5, 0, 0), (0, 0.999, 0)).corners_m
    both = np.concatenate([square, beside])
    np.testing.assert_array_equal(watertight(both).corners_m, both)


def test_a_closed_mesh_is_left_as_it_is() -> None:
    ball = sphere(40).corners_m
    ball = ball[np.linalg.norm(np.cross(*np.moveaxis(np.diff(ball, axis=1), 1, 0)), axis=1) > 1e-9]
    assert len(watertight(ball).corners_m) == len(ball)


def test_weights_place_every_corner_between_those_of_its_face_and_add_up_to_one() -> None:
    faces = halves(list(tiling(np.random.default_rng(3), (0.0, 4.0), (0.0, 3.0), 5)))
    mesh = watertight(faces)
    np.testing.assert_allclose(mesh.weights.sum(-1), 1, atol=1e-12)
    assert (mesh.weights >= -1e-12).all()
    assert sorted(set(mesh.parent.tolist())) == list(range(len(faces)))
    linear = faces @ [1.0, -2.0, 0.5]
    interpolated = mesh.interpolated(linear[..., None])[..., 0]
    np.testing.assert_allclose(interpolated, mesh.corners_m @ [1.0, -2.0, 0.5], atol=5e-5)


def test_the_order_of_faces_changes_nothing_but_the_order() -> None:
    faces = halves(list(tiling(np.random.default_rng(4), (0.0, 4.0), (0.0, 3.0), 4)))
    order = np.random.default_rng(5).permutation(len(faces))
    one, other = watertight(faces), watertight(faces[order])
    assert len(one.corners_m) == len(other.corners_m)
    counts = np.bincount(one.parent)
    np.testing.assert_array_equal(np.bincount(other.parent), counts[order])
