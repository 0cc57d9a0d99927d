"""The uniforms of batches, by the laws of reflection."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("OpenGL.GL")

from vobench.rendering.batch import Batch
from vobench.rendering.probe import PROBE_MOST
from vobench.rendering.uniform_block import BATCH
from vobench.rendering.uniforms import set_batch
from vobench.scene.material import Material, Picture, fresnel

GREY = Batch(index=0, material=Material(), mover=-1, mirror=None, is_lamp=False, area_m2=1.0)
HALF_WHITE = Picture(np.array([[[0, 0, 0], [255, 255, 255]]], np.uint8), tile_m=0.5)


def uniforms_of(material: Material, *, is_lamp: bool = False) -> np.ndarray:
    uniforms = np.zeros((), BATCH.dtype)
    set_batch(uniforms, replace(GREY, material=material, is_lamp=is_lamp), texture=None)
    return uniforms


def test_a_smooth_coat_reflects_what_fresnel_says() -> None:
    for roughness in (0.0, 0.02):
        assert uniforms_of(Material(eta=1.5, roughness=roughness))["grazing_exponent"] == 0


def test_the_rougher_a_coat_the_less_its_reflectance_rises_towards_grazing_incidence() -> None:
    coats = [uniforms_of(Material(eta=1.5, roughness=alpha)) for alpha in (0.06, 0.1, 0.4, 1)]
    rises = [float(coat["grazing_rise"]) for coat in coats]
    assert rises == sorted(rises, reverse=True)
    assert all(coat["grazing_exponent"] > 0 for coat in coats)
    assert coats[0]["normal_reflectance"] == pytest.approx(fresnel(np.array(1.0), 1.5), rel=0.05)


def test_the_rougher_metal_is_the_less_it_reflects_at_grazing_incidence() -> None:
    rises = [float(uniforms_of(Material(metal=1.0, roughness=alpha))["metal_rise"]) for alpha in (0, 0.1, 0.4, 1)]
    assert rises[0] == 1
    assert rises == sorted(rises, reverse=True)
    assert rises[-1] == 0


def test_energy_that_enters_a_coat_and_energy_that_arrives_agree_without_a_coat() -> None:
    without_coat = uniforms_of(Material(eta=1.0))
    assert without_coat["inner_reflectance"] == pytest.approx(0, abs=1e-6)
    assert without_coat["arriving_over_entering"] == pytest.approx(1)
    assert uniforms_of(Material(eta=1.5))["arriving_over_entering"] > 1


def test_the_emission_of_a_lamp_is_relative_to_its_mean_and_that_of_a_screen_is_not() -> None:
    material = Material(emission_cd_m2=(100.0, 200.0, 300.0), emission_texture=HALF_WHITE)
    np.testing.assert_allclose(uniforms_of(material)["emission"], [100, 200, 300])
    np.testing.assert_allclose(uniforms_of(material, is_lamp=True)["emission"], [2, 2, 2], rtol=1e-6)


def test_an_emission_texture_half_as_large_as_a_tile_repeats_twice_in_it() -> None:
    material = Material(emission_cd_m2=(1.0, 1.0, 1.0), emission_texture=HALF_WHITE)
    assert uniforms_of(material)["emission_repeats"] == 2
    assert uniforms_of(replace(material, emission_texture=None))["emission_repeats"] == 1


def test_the_tint_scales_the_colour_of_a_mirror_but_not_that_of_a_body() -> None:
    for kind, scale in (("body", 1.0), ("mirror", 0.5), ("pane", 0.5)):
        material = Material(kind, colour=(0.2, 0.4, 0.8), tint=0.5)
        np.testing.assert_allclose(uniforms_of(material)["colour"], scale * np.array([0.2, 0.4, 0.8]), rtol=1e-6)


def test_the_share_of_the_probe_is_1_for_smooth_surfaces_and_decreases_to_0() -> None:
    shares = [float(uniforms_of(Material(roughness=alpha))["probe_share"]) for alpha in (0, 0.35, PROBE_MOST, 1)]
    assert shares == pytest.approx([1, 0.5, 0, 0])
    assert uniforms_of(Material("mirror", roughness=1.0))["probe_share"] == 1
