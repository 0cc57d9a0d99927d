"""Shadow maps show bodies where rays meet them, and no point that may lose light is left out."""

import numpy as np
import pytest

from vobench.asset.shape import at, block
from vobench.rendering.geometry import BoundingSphere, RayCaster
from vobench.rendering.mover_kernels import (
    TILE,
    EmitterAt,
    LightMap,
    MovingParts,
    ShadowMaps,
    draw_map,
    hidden_share,
    hiding_pairs,
    mark_in_views,
    take_shaded,
)
from vobench.rendering.mover_light import shadow_matrices
from vobench.scene.mesh import moved
from vobench.scene.triangles import Thing, triangle_table

PILLAR = moved(block((0.5, 0.3, 1.8), bevel_m=0), at(0.4, -0.2, 0.9, yaw=25))
CASTER = RayCaster(triangle_table([Thing("pillar", PILLAR, "grey")], [-1], [-1]))
CORNERS_M = PILLAR.triangles.reshape(-1, 3)
CENTRE_M = (CORNERS_M.min(0) + CORNERS_M.max(0)) / 2
RADIUS_M = float(np.linalg.norm(CORNERS_M - CENTRE_M, axis=1).max())
BULB = np.array([-1.0, 0.5, 2.5, 1.0])
INSIDE = np.array([0.45, -0.2, 1.7, 1.0])  # a sample inside the pillar, where some corners are behind it
SUN = np.array([0.6, 0.0, 0.8, 0.0])
SIDE_PX = 64


def shadow_map(place: np.ndarray) -> ShadowMaps:
    matrices = shadow_matrices(place[None], BoundingSphere(CENTRE_M, RADIUS_M)).astype(np.float32)
    nearness = np.zeros((1, SIDE_PX, SIDE_PX), np.float32)
    draw_map(PILLAR.triangles.astype(np.float32), matrices[0], bool(place[3] > 0), nearness[0])
    return ShadowMaps(matrices, nearness)


def emitter_at(place: np.ndarray) -> EmitterAt:
    return EmitterAt(
        centre_m=place[:3].astype(np.float32),
        radius_m=np.float32(0),
        is_hard=True,
        places=place[None].astype(np.float32),
        axes=np.zeros((1, 4), np.float32),
        strength=np.ones(1, np.float32),
        reach=np.ones((1, 1), np.float32),
        map_of=np.zeros((1, 1), np.int32),
    )


OCCLUDERS = MovingParts(CENTRE_M[None].astype(np.float32), np.array([RADIUS_M], np.float32), np.zeros(1, np.int32))


def floor_points(count: int) -> np.ndarray:
    points_m = np.zeros((count, 3), np.float32)
    points_m[:, :2] = np.random.default_rng(1).uniform(-4, 4, (count, 2))
    points_m[:, 2] = 1e-3
    return points_m


def hidden_by_rays(points_m: np.ndarray, place: np.ndarray) -> np.ndarray:
    targets_m = np.broadcast_to(place[:3], points_m.shape) if place[3] else points_m + 100 * place[:3]
    return CASTER.occluded(points_m, targets_m)


@pytest.mark.parametrize("place", [BULB, SUN], ids=["bulb", "sun"])
def test_a_shadow_map_hides_the_points_whose_rays_meet_the_body(place: np.ndarray) -> None:
    """Except for points at the rim of the shadow, which is as wide as a pixel of the map."""
    points_m = floor_points(4000)
    maps = shadow_map(place)
    shares = np.array([hidden_share(maps, 0, place[3] > 0, *point) for point in points_m])
    is_hidden = hidden_by_rays(points_m, place)
    is_rim = (shares > 0) & (shares < 1)
    assert is_hidden.sum() > 50
    assert is_rim.mean() < 0.05
    np.testing.assert_array_equal(shares[~is_rim] > 0.5, is_hidden[~is_rim])


def test_a_body_around_a_sample_hides_it_though_part_of_the_body_is_behind_it() -> None:
    maps = shadow_map(INSIDE)
    assert hidden_share(maps, 0, True, np.float32(0.4), np.float32(-0.2), np.float32(-0.1)) == 1


@pytest.mark.parametrize("place", [BULB, SUN], ids=["bulb", "sun"])
def test_no_point_from_which_a_ray_meets_the_body_is_left_out(place: np.ndarray) -> None:
    pair_sample = np.zeros(1, np.int64)
    pair_body = np.zeros(1, np.int64)
    points_m = floor_points(4000)
    emitter = emitter_at(place)
    counts = [hiding_pairs(OCCLUDERS, emitter, point, np.float32(0), pair_sample, pair_body) for point in points_m]
    is_kept = np.array(counts) > 0
    is_hidden = hidden_by_rays(points_m, place)
    assert is_hidden.any()
    assert not (is_hidden & ~is_kept).any()
    assert is_kept.mean() < 0.8


def test_hidden_sites_lose_the_light_of_the_emitter_and_no_others_change() -> None:
    """Sites of one texel each, in a map with a row of tiles; the emitter gives two of three units of light."""
    count = 4 * TILE
    points_m = np.zeros((count, 3), np.float32)
    points_m[:, 0] = np.linspace(-1, 3, count)
    points_m[:, 1] = -0.4
    light_lx = np.full((1, count, 3), 3, np.float32)
    is_changed = np.zeros((1, 4), bool)
    columns = np.arange(count, dtype=np.int32)
    take_shaded(
        points_m,
        np.tile(np.float32([0, 0, 1]), (count, 1)),
        np.zeros(count, np.int32),
        columns,
        np.ones(count, np.int32),
        np.zeros(count, np.float32),
        np.full(count, 2, np.float32),
        np.arange(count),
        1,
        points_m,
        np.zeros(count, np.float32),
        OCCLUDERS,
        emitter_at(BULB),
        shadow_map(BULB),
        np.ones(3, np.float32),
        LightMap(light_lx, is_changed),
    )
    is_hidden = hidden_by_rays(points_m, BULB)
    is_dark = np.isclose(light_lx[0, :, 0], 1)
    is_bright = light_lx[0, :, 0] == 3
    assert is_hidden.any()
    assert not (is_dark & ~is_hidden).any()
    assert not (is_bright & is_hidden).any()
    assert (~is_dark & ~is_bright).sum() <= 8
    np.testing.assert_array_equal(is_changed[0], (light_lx[0, :, 0] != 3).reshape(4, TILE).any(1))


def test_spheres_are_marked_up_to_a_margin_outside_the_planes_of_any_view() -> None:
    centres_m = np.array([[0, 0, 0], [-1.05, 0, 0], [-1.3, 0, 0]], np.float32)
    radius_m = np.ones(3, np.float32)
    views = np.zeros((1, 6, 4), np.float32)
    views[0, 0] = (1, 0, 0, 0)  # what has a positive x is inside
    marked = np.zeros(3, bool)
    mark_in_views(centres_m, radius_m, views, 0.1, marked)
    np.testing.assert_array_equal(marked, [True, True, False])
