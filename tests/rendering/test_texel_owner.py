"""Each texel belongs to the nearest face, and knows the nearest place on it."""

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.atlas import Atlas
from vobench.rendering.texel_owner import CLAIMED_PX, READ_PX, claimed, owners

RNG = np.random.default_rng(0)
SIZE = 24


def random_atlas(count: int) -> Atlas:
    corners = RNG.uniform(2, SIZE - 2, (count, 3, 2)).astype(np.float32)
    return Atlas(corners, np.arange(count, dtype=np.int32), SIZE, SIZE)


def distance_px(corners: Array, points: Array) -> Array:
    """How far points (P, 2) are from a triangle (3, 2), by many places on it."""
    steps = np.linspace(0, 1, 120)
    u, v = (part.ravel() for part in np.meshgrid(steps, steps))
    within = u + v <= 1 + 1e-12
    a, b, c = corners.astype(float)
    places = a + u[within, None] * (b - a) + v[within, None] * (c - a)
    return np.array([np.linalg.norm(places - point, axis=1).min() for point in points])


def test_owners_are_the_nearest_faces_at_their_distance() -> None:
    atlas = random_atlas(5)
    owner = owners(atlas)
    middles = np.stack(np.meshgrid(np.arange(SIZE), np.arange(SIZE)), -1).reshape(-1, 2) + 0.5
    distances = np.array([distance_px(corners, middles) for corners in atlas.light_px])
    nearest = distances.min(0)
    tolerance_px = 0.15  # of the places above
    far = nearest > READ_PX + tolerance_px
    assert (owner.face[far] == -1).all()
    near = nearest < READ_PX - tolerance_px
    assert (owner.face[near] >= 0).all()
    np.testing.assert_allclose(owner.distance_px[near], nearest[near], atol=tolerance_px)
    own = distances[owner.face[near], np.flatnonzero(near)]
    assert (own <= nearest[near] + tolerance_px).all()


def test_the_place_on_a_face_is_the_texel_itself_where_it_lies_inside() -> None:
    atlas = random_atlas(4)
    owner = owners(atlas)
    inside = np.flatnonzero((owner.face >= 0) & (owner.distance_px == 0))
    assert len(inside) > 50
    a, b, c = atlas.light_px[owner.face[inside]].astype(float).swapaxes(0, 1)
    u, v = owner.uv[inside].T
    places = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    middles = np.stack([inside % SIZE, inside // SIZE], -1) + 0.5
    np.testing.assert_allclose(places, middles, atol=1e-4)
    assert (owner.uv[inside] >= -1e-6).all()
    assert (owner.uv[inside].sum(1) <= 1 + 1e-6).all()


def test_faces_without_a_chart_or_an_area_own_nothing() -> None:
    atlas = random_atlas(3)
    flat = atlas.light_px.copy()
    flat[1] = flat[1, 0]
    owner = owners(Atlas(flat, np.array([0, 1, -1], np.int32), SIZE, SIZE))
    assert set(np.unique(owner.face)) == {-1, 0}


def test_only_texels_near_a_face_among_those_asked_for_are_claimed() -> None:
    owner = owners(random_atlas(4))
    every = claimed(owner, np.ones(4, bool))
    assert (owner.distance_px[every] <= CLAIMED_PX).all()
    assert set(np.unique(owner.face[every])) <= {0, 1, 2, 3}
    second = claimed(owner, np.arange(4) == 2)
    np.testing.assert_array_equal(second, every[owner.face[every] == 2])
