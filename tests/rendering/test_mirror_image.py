"""A lamp in a mirror lights like its image behind it, through the mirror and nowhere else."""

import numpy as np
import pytest

from tests.rendering.lit_floor import BULB, PANEL, X, Y, Z, by_inverse_square, open_floor
from tests.rendering.rectangles import rectangle
from vobench.geometry.se3 import Array
from vobench.rendering.direct_light import direct_light
from vobench.rendering.emitter import Emitter
from vobench.rendering.mirror_image import mirror_images
from vobench.scene.light import Light, Sky
from vobench.scene.triangles import Thing

TINT = 0.8
MIRROR_X_M = -3.0
WIDE_MIRROR = rectangle(MIRROR_X_M * X + 5 * Z, 40 * Y, 40 * Z, "mirror", "mirror")
BULB_IMAGE_M = BULB.position_m * [-1, 1, 1] + [2 * MIRROR_X_M, 0, 0]


def light_by_images(light: Light, *things: Thing) -> tuple[Array, Array, list[Emitter]]:
    """Points (P, 3) on the floor, their illuminance (P,) by a light's images alone, and these."""
    points, layout, visibility = open_floor(*things)
    images = mirror_images(light, visibility, t_ns=0)
    cells = np.zeros(len(points), np.int32)
    among = np.ones(len(points), bool)
    total = np.zeros(len(points))
    for image in images:
        total += direct_light(image, points, layout, cells, visibility, side=4, among=among)
    return points.points_m.astype(float), total, images


def test_a_mirror_beside_the_floor_adds_its_share_of_the_light_of_the_image() -> None:
    points_m, light_lx, images = light_by_images(BULB, WIDE_MIRROR)
    assert len(images) == 1
    np.testing.assert_allclose(images[0].ball.centre_m, BULB_IMAGE_M, atol=1e-9)
    np.testing.assert_allclose(light_lx, TINT * by_inverse_square(points_m, BULB_IMAGE_M, 100), rtol=1e-3)


def test_only_points_that_see_the_image_in_the_mirror_are_lit() -> None:
    low_m = 0.62
    high_m = 0.76
    strip = rectangle(MIRROR_X_M * X + (low_m + high_m) / 2 * Z, 40 * Y, (high_m - low_m) * Z, "mirror", "strip")
    points_m, light_lx, _ = light_by_images(BULB, strip)
    share = (MIRROR_X_M - points_m[:, 0]) / (BULB_IMAGE_M[0] - points_m[:, 0])
    crossing_m = points_m[:, 2] + share * (BULB_IMAGE_M[2] - points_m[:, 2])
    is_inside = (crossing_m > low_m + 0.03) & (crossing_m < high_m - 0.03)
    is_outside = (crossing_m < low_m - 0.03) | (crossing_m > high_m + 0.03)
    assert is_inside.sum() > 20
    assert is_outside.sum() > 20
    assert (light_lx[is_inside] > 0).all()
    assert (light_lx[is_outside] == 0).all()


@pytest.mark.parametrize("x_m", [-2.0, -2.9], ids=["half way", "next to the mirror"])
def test_a_wall_before_the_mirror_hides_the_image(x_m: float) -> None:
    wall = rectangle(x_m * X + 5 * Z, 40 * Y, 40 * Z, "a", "wall")
    _, light_lx, _ = light_by_images(BULB, WIDE_MIRROR, wall)
    assert (light_lx == 0).all()


def test_an_image_has_the_width_and_the_unshadowed_light_of_a_lamp_where_the_image_is() -> None:
    points, _, visibility = open_floor(WIDE_MIRROR)
    (image,) = mirror_images(PANEL, visibility, t_ns=0)
    centre_m = image.ball.centre_m
    distance_m = np.linalg.norm(points.points_m - centre_m, axis=1)
    nearest = distance_m.argmin()
    width_rad = image.width_rad(points.points_m)
    np.testing.assert_allclose(width_rad * distance_m, width_rad[nearest] * distance_m[nearest], rtol=1e-5)
    lambertian_lx = PANEL.power_lm / np.pi * (centre_m[2] - points.points_m[:, 2]) ** 2 / distance_m**4
    np.testing.assert_allclose(image.unshadowed_light(points), TINT * lambertian_lx, rtol=0.01)


def test_the_sky_has_no_images() -> None:
    _, _, visibility = open_floor(WIDE_MIRROR)
    assert mirror_images(Sky("sky", 1000.0), visibility, t_ns=0) == []
