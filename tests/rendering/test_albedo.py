"""The albedo of points is what their body scatters: texture times colour, less metal, no more than the largest."""

from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle
from vobench.geometry.se3 import Array
from vobench.rendering.albedo import LARGEST_ALBEDO, albedo
from vobench.rendering.geometry import lengths
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.scene.material import Material, Picture, linear, under_coat
from vobench.scene.triangles import Triangles, triangle_table

COLOUR = (0.2, 0.4, 0.6)
X, Y, _ = np.eye(3)


def floor_points(material: Material) -> tuple[Triangles, Texels]:
    """Points on a floor of 1 x 1 m with a material."""
    faces = triangle_table([rectangle(0.5 * X + 0.5 * Y, X, Y, "a")], [-1], [-1])
    atlas = unwrap(faces, np.full(len(faces), 0.1), np.ones(len(faces), bool))
    points, _ = texels(faces, {"a": material}, atlas, owners(atlas), among=np.ones(len(faces), bool), seed=0)
    return faces, points


def albedo_of(material: Material) -> Array:
    faces, points = floor_points(material)
    return albedo(faces, {"other": Material(), "a": material}, points)


def test_a_plain_body_has_its_colour_and_metal_scatters_nothing() -> None:
    np.testing.assert_allclose(albedo_of(Material(colour=COLOUR)), np.tile(COLOUR, (len(albedo_of(Material())), 1)))
    np.testing.assert_allclose(
        albedo_of(Material(colour=COLOUR, metal=0.75)).mean(0), 0.25 * np.array(COLOUR), rtol=1e-5
    )


def test_no_body_scatters_all_light() -> None:
    assert albedo_of(Material(colour=(1.0, 1.0, 1.0))).max() == pytest.approx(LARGEST_ALBEDO)


def test_a_coat_returns_a_part_of_the_light_to_the_body() -> None:
    expected = under_coat(np.array(COLOUR), 1.5)
    np.testing.assert_allclose(albedo_of(Material(colour=COLOUR, eta=1.5))[0], expected, rtol=1e-6)


@pytest.mark.parametrize("kind", ["mirror", "pane"])
def test_mirrors_and_panes_scatter_nothing(kind) -> None:
    assert (albedo_of(Material(kind, colour=COLOUR)) == 0).all()


def test_each_point_has_the_mean_of_the_texture_around_it() -> None:
    halves = np.zeros((64, 64, 3), np.uint8)
    halves[:, :32] = [255, 0, 0]
    halves[:, 32:] = [0, 0, 100]
    material = Material(texture=Picture(halves, 1.0))
    faces, points = floor_points(material)
    values = albedo(faces, {"a": material}, points)
    weights = np.column_stack([1 - points.uv.sum(1), points.uv])
    u = np.einsum("ni,ni->n", weights, faces.uv[points.face][..., 0]) % 1
    from_edge = np.minimum(np.abs(u - 0.5), np.minimum(u, 1 - u))
    is_left = (u < 0.5) & (from_edge > 0.06)
    is_right = (u > 0.5) & (from_edge > 0.06)
    np.testing.assert_allclose(values[is_left], np.tile([LARGEST_ALBEDO, 0, 0], (is_left.sum(), 1)), atol=1e-6)
    blue = linear(np.uint8(100))
    np.testing.assert_allclose(values[is_right], np.tile([0, 0, blue], (is_right.sum(), 1)), atol=1e-6)
    half_as_large = albedo(faces, {"a": replace(material, texture=Picture(halves, 0.5))}, points)
    assert not np.array_equal(half_as_large, values)


@pytest.mark.parametrize("size_px", [5, 10, 64])
def test_stripes_as_far_apart_as_the_points_have_their_mean(size_px: int) -> None:
    """Sampled at their middles, all points could be on a stripe, or none."""
    stripes = np.zeros((size_px, 10, 3), np.uint8)
    stripes[:, 0] = 200
    material = Material(texture=Picture(stripes, 0.1))
    faces, points = floor_points(material)
    values = albedo(faces, {"a": material}, points)
    has_neighbours = np.maximum(lengths(points.step_u_m), lengths(points.step_v_m)) > 0
    assert has_neighbours.sum() > 100
    np.testing.assert_allclose(values[has_neighbours], linear(np.uint8(200)) / 10, rtol=1e-3)
