"""Materials keep their colour, their holes, and what they reflect and emit, in pyrender's terms."""

import numpy as np
import pytest

pytest.importorskip("pyrender")

from vobench.rendering.pyrender_material import TILE_EDGES_M, lamp_material, pyrender_material, texture_tile_m
from vobench.scene.material import Material, Picture, pane_reflectance
from vobench.scene.scene import ceiling_light

WHITE_CD_M2 = 200.0
COLOUR = (0.2, 0.4, 0.6)
HALF_OPAQUE = np.full((2, 2, 4), 100, np.uint8)
HALF_OPAQUE[0, :, 3] = 255
LAMP = ceiling_light("lamp", np.array([0.0, 0, 2.0]), (0.4, 0.3), power_lm=500)


def test_a_plain_body_has_its_colour_and_no_highlight() -> None:
    made = pyrender_material(Material(colour=COLOUR), WHITE_CD_M2)
    np.testing.assert_allclose(made.baseColorFactor, [*COLOUR, 1.0])
    assert (made.metallicFactor, made.roughnessFactor, made.alphaMode) == (0.0, 1.0, "OPAQUE")


def test_a_coat_and_metal_have_the_root_of_their_roughness() -> None:
    for material in (Material(eta=1.5, roughness=0.09), Material(metal=0.5, roughness=0.09)):
        assert pyrender_material(material, WHITE_CD_M2).roughnessFactor == pytest.approx(0.3)
    assert pyrender_material(Material(metal=0.5), WHITE_CD_M2).metallicFactor == 0.5


def test_a_mirror_is_metal_of_its_tint() -> None:
    made = pyrender_material(Material("mirror", tint=0.8), WHITE_CD_M2)
    np.testing.assert_allclose(made.baseColorFactor, [0.8, 0.8, 0.8, 1.0])
    assert made.metallicFactor == 1.0


def test_a_pane_hides_what_it_reflects_and_absorbs_and_is_seen_from_both_sides() -> None:
    made = pyrender_material(Material("pane", eta=1.5, tint=0.7), WHITE_CD_M2)
    passed = 0.7 * (1 - float(pane_reflectance(np.array(1.0), 1.5)))
    assert made.baseColorFactor[3] == pytest.approx(1 - passed)
    assert made.doubleSided
    assert made.alphaMode == "BLEND"


def test_holes_are_transparent_and_the_rest_is_opaque() -> None:
    made = pyrender_material(Material(texture=Picture(HALF_OPAQUE, 1.0), cutout=0.5), WHITE_CD_M2)
    assert made.alphaMode == "BLEND"
    assert made.baseColorTexture.source[..., 3].tolist() == [[255, 255], [0, 0]]
    whole = pyrender_material(Material(texture=Picture(HALF_OPAQUE, 1.0)), WHITE_CD_M2)
    assert (whole.baseColorTexture.source[..., 3] == 255).all()


def test_grey_values_above_1_are_scaled_into_the_factor() -> None:
    grey = Picture(np.array([[2.0, 0.5]], np.float32), 1.0)
    made = pyrender_material(Material(colour=COLOUR, texture=grey), WHITE_CD_M2)
    np.testing.assert_allclose(made.baseColorFactor[:3], 2 * np.array(COLOUR))
    assert made.baseColorTexture.source[0, 0, 0] == 255


def test_emission_counts_in_shares_of_white() -> None:
    made = pyrender_material(Material(emission_cd_m2=(50.0, 100.0, 200.0)), WHITE_CD_M2)
    np.testing.assert_allclose(np.square(made.emissiveFactor), [0.25, 0.5, 1.0])


def test_a_lamp_is_black_and_emits_its_luminance_or_what_its_look_says() -> None:
    glowing, emitted_cd_m2, tile_m = lamp_material(LAMP, None)
    np.testing.assert_allclose(glowing.baseColorFactor, [0, 0, 0, 1])
    np.testing.assert_allclose(emitted_cd_m2, LAMP.luminance_cd_m2)
    assert tile_m == TILE_EDGES_M
    screen = Material(emission_cd_m2=(1.0, 2.0, 3.0), emission_texture=Picture(HALF_OPAQUE, 0.25))
    _, emitted_cd_m2, tile_m = lamp_material(LAMP, screen)
    np.testing.assert_allclose(emitted_cd_m2, [1, 2, 3])
    assert tile_m == 0.25


def test_the_tile_is_that_of_the_texture_or_else_of_the_emission() -> None:
    picture = Picture(HALF_OPAQUE, 0.5)
    assert texture_tile_m(Material(texture=picture)) == 0.5
    assert texture_tile_m(Material(emission_texture=picture, emission_cd_m2=(1.0, 1.0, 1.0))) == 0.5
    assert texture_tile_m(Material()) == TILE_EDGES_M
