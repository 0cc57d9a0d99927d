"""Paint mixes its reflectance with that of what it covers, and leaves lamps, mirrors, panes and holes alone."""

import numpy as np
import pytest

from vobench.scene.material import Material, Picture, linear, linear_texture, reflectance
from vobench.scene.paint import Paint, painted

GREY = Picture(np.random.default_rng(1).uniform(0.02, 0.98, (16, 16)).astype(np.float32), tile_m=2.0)
PHOTO = Picture(np.random.default_rng(2).integers(0, 256, (16, 16, 3), np.uint8))
LEAF = Picture(np.random.default_rng(3).integers(0, 256, (16, 16, 4), np.uint8))
OLIVE = (0.4, 0.5, 0.2)
COVERS = [0.3, 0.9, 1.0]


def luminance(material: Material) -> np.ndarray:
    """The luminous reflectance of each texel."""
    return np.asarray(reflectance(material), float)


@pytest.mark.parametrize("cover", COVERS)
@pytest.mark.parametrize(
    ("material", "tolerance"),
    [
        (Material(colour=OLIVE), 1e-6),
        (Material(colour=OLIVE, texture=GREY), 1e-6),
        (Material(colour=OLIVE, texture=PHOTO), 0.005),  # pictures have 8 bits
        (Material(texture=PHOTO), 0.005),
    ],
)
def test_the_luminous_reflectance_is_mixed_with_that_of_the_paint(material, tolerance, cover) -> None:
    expected = (1 - cover) * luminance(material) + cover * 0.6
    found = luminance(painted(material, Paint(cover=cover, albedo=0.6)))
    np.testing.assert_allclose(found, expected, atol=tolerance)


@pytest.mark.parametrize("texture", [None, GREY, PHOTO])
def test_everything_is_grey_under_closed_paint(texture) -> None:
    material = painted(Material(colour=OLIVE, texture=texture), Paint(cover=1.0, albedo=0.5))
    colour = np.array(material.colour)
    if texture is not None:
        colour = colour * linear_texture(material.texture)
    np.testing.assert_allclose(colour, 0.5, atol=0.005)


def test_colours_of_a_picture_are_mixed_channel_by_channel() -> None:
    material = painted(Material(texture=PHOTO), Paint(cover=0.6, albedo=0.5))
    expected = 0.4 * linear(PHOTO.values) + 0.3
    np.testing.assert_allclose(linear(material.texture.pixels()), expected, atol=0.005)


def test_no_paint_changes_nothing_and_twice_the_paint_is_one_thicker_layer() -> None:
    material = Material(texture=GREY)
    assert painted(material, Paint(cover=0.0)) is material
    twice = painted(painted(material, Paint(cover=0.5)), Paint(cover=0.5))
    np.testing.assert_allclose(luminance(twice), luminance(painted(material, Paint(cover=0.75))), atol=1e-6)


@pytest.mark.parametrize(
    "material",
    [Material("mirror"), Material("pane", eta=1.5), Material(emission_cd_m2=(9.0, 9.0, 9.0), texture=GREY)],
)
def test_mirrors_panes_and_lamps_stay_bare(material) -> None:
    assert painted(material, Paint(cover=1.0)) is material


def test_coats_holes_and_tiles_stay_and_metal_is_covered() -> None:
    polished = painted(Material(texture=GREY, eta=1.5, roughness=0.1, metal=0.8), Paint(cover=0.5))
    assert (polished.eta, polished.roughness, polished.metal, polished.tile_m) == (1.5, 0.1, 0.4, 2.0)
    leaf = painted(Material(texture=LEAF, cutout=0.5, is_foliage=True), Paint(cover=0.5))
    np.testing.assert_array_equal(leaf.texture.pixels()[..., 3], LEAF.values[..., 3])
    assert (leaf.cutout, leaf.is_foliage) == (0.5, True)
