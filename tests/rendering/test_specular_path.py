"""Rays are followed by mirrors and panes, and lose what these do not return."""

import numpy as np

from tests.rendering.gathered_room import MATERIALS, GatheredRoom, gathered_room
from tests.rendering.rectangles import rectangle
from vobench.geometry.se3 import Array
from vobench.rendering.ray_batch import RayBatch, joined_ends
from vobench.rendering.specular_path import SpecularTracer, hemisphere_rays
from vobench.scene.material import pane_reflectance
from vobench.scene.triangles import Thing

X, Y, Z = np.eye(3)
FLOOR = rectangle(0 * Z, 6 * X, 6 * Y, "grey", "floor")
MIRROR = rectangle(2 * Z, 6 * Y, 6 * X, "mirror", "mirror")  # it faces the floor
GLASS = rectangle(Z, 6 * X, 6 * Y, "glass", "glass")
DITHER = np.full((1, 2), 0.5, np.float32)


def tracer_of(*things: Thing) -> tuple[SpecularTracer, GatheredRoom]:
    lit = gathered_room(things, spacing_m=0.2, step_m=0.5)
    gatherer = lit.gatherer
    tracer = SpecularTracer(gatherer.atlas, gatherer.visibility, gatherer.response, gatherer.surfel_of, lamp_column=-1)
    return tracer, lit


def ray(origin_m: Array, direction: Array) -> RayBatch:
    return RayBatch(
        point=np.zeros(1, np.int32),
        origins_m=np.asarray(origin_m, np.float32)[None],
        directions=np.asarray(direction, np.float32)[None],
        weight=np.ones(1, np.float32),
        is_direct=np.ones(1, bool),
    )


def test_a_ray_ends_at_the_surfel_below_it() -> None:
    tracer, lit = tracer_of(FLOOR)
    followed = tracer.follow(ray([0.71, -0.33, 0.5], -Z), DITHER, is_first=True)
    (surfel,) = followed.ends.column
    np.testing.assert_allclose(lit.middles.points_m[surfel, :2], [0.71, -0.33], atol=0.5)
    assert followed.ends.share.tolist() == [1.0]
    assert followed.ends.is_near.tolist() == [True]
    assert len(followed.onward.point) == len(followed.escaped.point) == 0


def test_a_mirror_sends_a_ray_on_with_the_share_of_its_tint() -> None:
    tracer, _ = tracer_of(FLOOR, MIRROR)
    slant = np.array([0.6, 0, 0.8])
    first = tracer.follow(ray([-1.0, 0, 0.4], slant), DITHER, is_first=False)
    assert len(first.ends.point) == 0
    np.testing.assert_allclose(first.onward.directions, [[0.6, 0, -0.8]], atol=1e-6)
    np.testing.assert_allclose(first.onward.origins_m, [[0.2, 0, 2.0]], atol=1e-3)
    np.testing.assert_allclose(first.onward.weight, MATERIALS["mirror"].tint)
    second = tracer.follow(first.onward, DITHER, is_first=False)
    np.testing.assert_allclose(second.ends.share, MATERIALS["mirror"].tint)
    assert second.ends.is_near.tolist() == [False]


def test_a_ray_that_meets_nothing_escapes_and_keeps_its_direction() -> None:
    tracer, _ = tracer_of(FLOOR)
    followed = tracer.follow(ray([0, 0, 0.5], Z), DITHER, is_first=True)
    np.testing.assert_array_equal(followed.escaped.directions, [Z])
    assert len(followed.ends.point) == len(followed.onward.point) == 0


def test_a_pane_splits_a_ray_into_what_it_lets_pass_and_what_it_reflects() -> None:
    tracer, _ = tracer_of(FLOOR, GLASS)
    cosine = 0.2
    slant = np.array([np.sqrt(1 - cosine**2), 0, -cosine])
    reflectance = float(pane_reflectance(np.array(cosine), 1.5))
    followed = tracer.follow(ray([-2.5, 0, 1.1], slant), DITHER, is_first=False)
    np.testing.assert_allclose(followed.onward.directions, [slant * [1, 1, -1]], atol=1e-6)
    total = followed.onward.weight.sum() + followed.escaped.weight.sum() + followed.ends.share.sum()
    np.testing.assert_allclose(followed.onward.weight, reflectance, rtol=1e-4)
    np.testing.assert_allclose(total, 1, rtol=1e-4)


def test_the_rays_of_a_point_fill_the_hemisphere_by_their_cosine() -> None:
    _, lit = tracer_of(FLOOR)
    rays = hemisphere_rays(lit.points.take(np.arange(3)), side=16)
    assert np.bincount(rays.point).tolist() == [256, 256, 256]
    np.testing.assert_allclose(rays.weight, 1)
    np.testing.assert_allclose(rays.directions[:, 2].mean(), 2 / 3, atol=5e-3)


def test_ends_and_batches_are_joined_in_order() -> None:
    tracer, _ = tracer_of(FLOOR)
    first = tracer.follow(ray([0.7, -0.3, 0.5], -Z), DITHER, is_first=True).ends
    second = tracer.follow(ray([-2.0, 1.0, 1.5], -Z), DITHER, is_first=True).ends
    joined = joined_ends([first, second])
    assert joined.texel.tolist() == [*first.texel, *second.texel]
    assert joined.is_near.tolist() == [True, False]
    both = ray([0, 0, 1], Z).joined(ray([0, 0, 2], -Z))
    np.testing.assert_array_equal(both.origins_m[:, 2], [1, 2])
