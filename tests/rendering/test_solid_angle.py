"""A rectangle's solid angle, spots on it, and its light agree with what is known without sampling."""

import numpy as np
import pytest

from tests.rendering import rectangles
from vobench.geometry.se3 import Array
from vobench.rendering.solid_angle import SeenRectangle, SolidAngle, rectangle

PANEL = rectangles.rectangle(np.array([0.2, 0.1, 2.0]), np.array([0, 1.2, 0]), np.array([0.8, 0, 0]), "a")
FACE = rectangle(PANEL.mesh.triangles)
assert FACE is not None
POINTS = np.array([[0.0, 0, 0], [1.5, -0.3, 0.4], [0.2, 0.1, 1.9], [-2, 3, 1.0], [0.2, 0.1, 2.5]])


def unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def grid(count: int) -> tuple[Array, Array]:
    middle = (np.arange(count) + 0.5) / count
    a, b = np.meshgrid(middle, middle)
    return a.ravel(), b.ravel()


@pytest.mark.parametrize("point", POINTS)
def test_the_solid_angle_is_the_integral_over_the_rectangle_from_either_side(point: Array) -> None:
    way = PANEL.at(*grid(1000)) - point
    squared = np.einsum("ij,ij->i", way, way)
    integral = (np.abs(way @ PANEL.normal) / squared**1.5).mean() * np.prod(PANEL.size_m)
    assert SolidAngle(SeenRectangle(FACE, point[None])).steradian[0] == pytest.approx(integral, rel=1e-3)


@pytest.mark.parametrize("point", POINTS)
def test_spots_lie_on_the_rectangle_and_are_spread_evenly_over_its_solid_angle(point: Array) -> None:
    a, b = grid(200)
    seen = SolidAngle(SeenRectangle(FACE, np.repeat(point[None], len(a), axis=0)))
    spots = seen.vectors_m(a, b) + point
    local = spots - PANEL.corner_m
    assert np.abs(local @ PANEL.normal).max() < 1e-5
    for edge in (PANEL.edge_u_m, PANEL.edge_v_m):
        share = local @ edge / (edge @ edge)
        assert -1e-5 < share.min() < share.max() < 1 + 1e-5
    # The mean direction over the solid angle, by area elements instead.
    way = PANEL.at(*grid(1000)) - point
    weight = np.abs(way @ PANEL.normal) / np.linalg.norm(way, axis=1) ** 3
    expected = (unit(way) * weight[:, None]).sum(0) / weight.sum()
    np.testing.assert_allclose(unit(seen.vectors_m(a, b)).mean(0), expected, atol=1e-3)


@pytest.mark.parametrize("point", POINTS)
@pytest.mark.parametrize(
    "tilt", [(0.0, 0.0, 1.0), (0.3, -0.2, 0.9), (0.9, 0.4, 0.1), (0.1, 0.0, -1.0), (0.0, 1.0, 0.0)]
)
def test_the_projected_solid_angle_is_the_integral_of_the_cosine_above_the_horizon(
    point: Array, tilt: tuple[float, float, float]
) -> None:
    normal = unit(np.array(tilt))
    vectors = PANEL.at(*grid(1000)) - point
    squared = np.einsum("ij,ij->i", vectors, vectors)
    area_seen = np.abs(vectors @ PANEL.normal) / squared**1.5 * np.prod(PANEL.size_m)
    cosine = vectors @ normal / np.sqrt(squared)
    integral = (area_seen * np.maximum(cosine, 0)).mean()
    seen = SeenRectangle(FACE, point[None])
    assert seen.projected_sr(normal[None], normal[None])[0] == pytest.approx(integral, rel=2e-3, abs=1e-6)


def test_what_the_horizon_of_a_curved_shape_cuts_is_unknown() -> None:
    point = np.array([[1.5, -0.3, 2.0]])
    plane = np.array([[0.0, 0.0, 1.0]])
    curved = unit(np.array([[0.3, 0.0, 0.9]]))
    assert np.isnan(SeenRectangle(FACE, point).projected_sr(curved, plane)[0])
