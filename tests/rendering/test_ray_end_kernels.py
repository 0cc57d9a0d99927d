"""A ray ends at the side of a face that it comes from, finds the light there, and is mirrored at its angle."""

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.rendering.ray_batch import RayBatch, RayEnds, empty_batch, empty_ends
from vobench.rendering.ray_end_kernels import (
    FACE,
    LIFT_M,
    Faces,
    RayHits,
    RayTargets,
    end_rays,
    face_towards,
    reflected,
    texel_at,
)

LAMP_COLUMN = 10
DOWNWARD = np.array([0.6, 0.0, -0.8])


def floor(**properties: float) -> Faces:
    """A face that looks up, with the properties of a face of FACE, and the entry for no face."""
    faces = np.zeros(2, FACE)
    faces["normal"] = [0, 0, 1]
    faces["light_px"] = [[0.5, 0.5], [2.5, 0.5], [0.5, 1.5]]
    faces["twin"] = -1
    faces["lamp"] = -1
    for name, value in properties.items():
        faces[name] = value
    return faces


def ended(
    faces: Faces, *, direction: Array = DOWNWARD, is_direct: bool = False, is_hit: bool = True
) -> tuple[RayEnds, RayBatch, list[int]]:
    """What becomes of one ray of weight 0.5 that hits the first face, 2 m away."""
    rays = RayBatch(
        point=np.array([3], np.int32),
        origins_m=np.array([[0, 0, 1.6]], np.float32),
        directions=direction[None].astype(np.float32),
        weight=np.array([0.5], np.float32),
        is_direct=np.array([is_direct]),
    )
    face = np.array([0 if is_hit else -1], np.int32)
    quarter = np.array([0.25], np.float32)
    hits = RayHits(face, quarter, quarter, np.array([2], np.float32))
    surfel_of = np.arange(6, dtype=np.int32)
    targets = RayTargets(faces, surfel_of, height=2, width=3, lamp_column=LAMP_COLUMN)
    ends = empty_ends(1)
    onward = empty_batch(1)
    escaped = np.empty(1, np.int64)
    dither = np.zeros((4, 2), np.float32)
    end_count, onward_count, escaped_count = end_rays(rays, hits, targets, dither, True, ends, onward, escaped)
    return ends.take(slice(end_count)), onward.take(slice(onward_count)), escaped[:escaped_count].tolist()


def test_of_a_sheet_a_ray_meets_the_side_that_it_comes_from() -> None:
    faces = np.zeros(2, FACE)
    faces["normal"] = [[0, 0, 1], [0, 0, -1]]
    faces["twin"] = [1, 0]
    assert face_towards(faces, 0, 0.0, 0.0, -1.0) == (0, False)
    assert face_towards(faces, 0, 0.0, 0.0, 1.0) == (1, True)
    faces["twin"] = -1
    assert face_towards(faces, 0, 0.0, 0.0, 1.0) == (0, False)


def test_a_diffuse_face_gives_the_whole_ray_to_the_surfel_of_its_texel() -> None:
    ends, onward, escaped = ended(floor(scatters=True))
    assert (ends.point.tolist(), ends.column.tolist(), ends.share.tolist()) == ([3], [1], [0.5])
    assert ends.texel.tolist() == [1]  # the place is (1, 0.75)
    assert not ends.is_near[0]
    assert len(onward.point) == 0
    assert escaped == []


def test_a_ray_that_hits_nothing_escapes_and_one_that_hits_a_back_ends() -> None:
    assert ended(floor(scatters=True), is_hit=False)[2] == [0]
    ends, onward, escaped = ended(floor(scatters=True), direction=-DOWNWARD)
    assert (len(ends.point), len(onward.point), escaped) == (0, 0, [])


@pytest.mark.parametrize(("is_direct", "columns"), [(False, [LAMP_COLUMN + 2]), (True, [])])
def test_the_light_of_a_lamp_counts_unless_it_is_direct(is_direct: bool, columns: list[int]) -> None:
    ends, _, _ = ended(floor(lamp=2), is_direct=is_direct)
    assert ends.column.tolist() == columns


def test_bare_metal_mirrors_its_share_at_the_angle_of_incidence() -> None:
    ends, onward, _ = ended(floor(scatters=True, metal=0.4))
    np.testing.assert_allclose(ends.share, [0.5])
    np.testing.assert_allclose(onward.weight, [0.4 * 0.5])
    np.testing.assert_allclose(onward.directions, [[0.6, 0, 0.8]], atol=1e-6)
    np.testing.assert_allclose(onward.origins_m, [[1.2, 0, LIFT_M]], atol=1e-6)


def test_a_coat_divides_a_ray_between_its_reflection_and_the_body() -> None:
    ends, onward, _ = ended(floor(scatters=True, eta=3.0, tint=1.0), direction=np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(onward.weight, [0.5 * 0.25])  # ((3 - 1) / (3 + 1))²
    np.testing.assert_allclose(ends.share, [0.5 * 0.75])


def test_a_reflection_reverses_the_part_along_the_normal_alone() -> None:
    assert reflected(0.6, 0.0, -0.8, 0.0, 0.0, 1.0) == pytest.approx((0.6, 0.0, 0.8))
    assert reflected(*reflected(0.3, 0.4, -0.5, 0.6, 0.0, 0.8), 0.6, 0.0, 0.8) == pytest.approx((0.3, 0.4, -0.5))


def test_a_place_outside_of_the_map_belongs_to_the_nearest_texel() -> None:
    light_px = np.array([[-1, -1], [9, -1], [-1, 9]], np.float32)
    assert texel_at(light_px, 0.0, 0.0, 2, 3) == 0
    assert texel_at(light_px, 1.0, 0.0, 2, 3) == 2
    assert texel_at(light_px, 0.0, 1.0, 2, 3) == 3
