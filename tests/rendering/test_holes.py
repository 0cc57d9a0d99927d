"""Cut-outs in pictures: the rim of a hole is covered in proportion, near and far, and in strips."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tests.rendering.rectangles import Rectangle, rectangle
from vobench.asset.texture import Procedural
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import View, single_instant
from vobench.scene.material import Material, Picture
from vobench.scene.scene import Scene

CAMERA = Pinhole(180, 120, 164.5, 164.5, 89.5, 59.5)
FINER = 6
BRIGHT = Material(texture=Procedural("plain", 0.9, 0, 1, 8, 0))
T_WORLD_CAMERA = looking(pitch_deg=0, position_m=(0.0, 0.0, 0.0))
WALL = rectangle(np.array([4.0, 0, 0]), np.array([0, 0, 6.0]), np.array([0, 8.0, 0]), "bright")


def discs(side_px: int = 256) -> Array:
    """Pixels of dark discs on a transparent ground, two fifths of the whole."""
    rng = np.random.default_rng(3)
    v, u = np.mgrid[:side_px, :side_px]
    pixels = np.zeros((side_px, side_px, 4), np.uint8)
    for x, y in rng.uniform(0, side_px, (40, 2)):
        pixels[np.hypot(u - x, v - y) < 12, 3] = 255
    return pixels


def curtain(distance_m: float) -> Rectangle:
    """A sheet that fills the picture, at a distance, turned so that rows and columns of its mask are at a slant."""
    across = np.array([0.0, 0.94, 0.34])
    upwards = np.array([0.0, -0.34, 0.94])
    return rectangle(np.array([distance_m, 0, 0]), 8 * upwards, 8 * across, "leaves")


def renderer_of(draw: Any, even_light: Any, cutout: float, *sheets: Rectangle) -> RasterRenderer:
    leaves = Material(texture=Picture(discs(), 1.0), cutout=cutout)
    return draw(even_light(Scene("curtain", (WALL, *sheets), {"bright": BRIGHT, "leaves": leaves}, ())))


def fine_picture(renderer: RasterRenderer) -> Array:
    """The picture as the mean of 144 samples a pixel."""
    camera = replace(
        CAMERA,
        width_px=FINER * CAMERA.width_px,
        height_px=FINER * CAMERA.height_px,
        fx_px=FINER * CAMERA.fx_px,
        fy_px=FINER * CAMERA.fy_px,
        cx_px=FINER * (CAMERA.cx_px + 0.5) - 0.5,
        cy_px=FINER * (CAMERA.cy_px + 0.5) - 0.5,
    )
    picture = renderer.radiance(camera, single_instant(camera, T_WORLD_CAMERA)).astype(float)
    return picture.reshape(CAMERA.height_px, FINER, CAMERA.width_px, FINER).mean((1, 3))


@pytest.mark.parametrize(("distance_m", "rms_share"), [(0.5, 0.08), (2.0, 0.07)])
def test_rims_are_covered_as_many_samples_cover_them(
    draw: Any, even_light: Any, distance_m: float, rms_share: float
) -> None:
    renderer = renderer_of(draw, even_light, 0.5, curtain(distance_m))
    picture = renderer.radiance(CAMERA, single_instant(CAMERA, T_WORLD_CAMERA)).astype(float)
    fine = fine_picture(renderer)
    contrast = fine.max() - fine.min()
    covered = (fine.max() - fine) / contrast
    is_rim = (covered > 0.02) & (covered < 0.98)
    error = (picture - fine)[is_rim] / contrast
    rms = np.sqrt((error**2).mean())  # 0.11 where a sample is either solid or a hole
    print(f"{distance_m} m: RMS {rms:.3f} of the contrast")
    assert is_rim.mean() > 0.02
    assert rms < rms_share
    assert picture.mean() == pytest.approx(fine.mean(), rel=0.005)


@pytest.mark.parametrize("cutout", [0.01, 1.0])
def test_what_is_wholly_opaque_hides_what_is_behind_whatever_the_threshold(
    draw: Any, even_light: Any, cutout: float
) -> None:
    picture = renderer_of(draw, even_light, cutout, curtain(0.5)).radiance(
        CAMERA, single_instant(CAMERA, T_WORLD_CAMERA)
    )
    darkest = 1e-3 * picture.max()
    assert 0.1 < (picture < darkest).mean() < 0.6


def test_strips_of_a_picture_with_holes_are_the_bytes_of_the_whole(draw: Any, even_light: Any) -> None:
    renderer = renderer_of(draw, even_light, 0.5, curtain(2.0), curtain(2.3))
    whole = renderer.radiance(CAMERA, single_instant(CAMERA, T_WORLD_CAMERA))
    now = np.zeros(1, np.int64)
    edges = (0, 17, 50, 83, 120)
    strips = [View(slice(a, b), T_WORLD_CAMERA[None], now, now) for a, b in pairwise(edges)]
    np.testing.assert_array_equal(renderer.radiance(CAMERA, strips), whole)
