"""Boundaries split light by Fresnel's law, and nothing returns more than it gets."""

import numpy as np
import pytest

from vobench.scene.material import (
    Material,
    Picture,
    fresnel,
    inner_reflectance,
    linear,
    linear_texture,
    pane_reflectance,
    reflectance,
    under_coat,
)

COSINES = np.linspace(1e-6, 1, 2001)
ETAS = [1.0, 1.33, 1.5, 1.9]


@pytest.mark.parametrize("eta", ETAS)
def test_fresnels_law_at_its_limits(eta: float) -> None:
    assert fresnel(np.array(1.0), eta) == pytest.approx(((eta - 1) / (eta + 1)) ** 2)
    reflected = fresnel(COSINES, eta)
    assert (reflected >= 0).all()
    assert (reflected <= 1).all()
    # More and more towards grazing, where all is reflected; equal media reflect nothing.
    assert (np.diff(reflected) <= 1e-12).all()
    assert reflected[0] == pytest.approx(1 if eta > 1 else 0, abs=1e-4)


def test_at_brewsters_angle_only_half_of_unpolarised_light_meets_a_mirror() -> None:
    eta = 1.5
    cosine = np.cos(np.arctan(eta))
    across = (eta**2 - 1) / (eta**2 + 1)
    assert fresnel(np.array(cosine), eta) == pytest.approx(across**2 / 2)


@pytest.mark.parametrize("eta", ETAS)
def test_a_pane_returns_the_sum_of_all_its_inner_reflections(eta: float) -> None:
    cosines = COSINES[1::20]
    F = fresnel(cosines, eta)
    # F, then through, back from the far face, out; and again with two more inner reflections each.
    series = F + sum((1 - F) ** 2 * F ** (2 * n + 1) for n in range(4000))
    np.testing.assert_allclose(pane_reflectance(cosines, eta), series, atol=2e-4)


@pytest.mark.parametrize("eta", ETAS[1:])
def test_inner_reflectance_is_the_mean_of_fresnels_law_from_inside(eta: float) -> None:
    # Diffuse light from below: cos² evenly spread; beyond the critical angle all is reflected.
    inside = np.sqrt((np.arange(200_000) + 0.5) / 200_000)
    sine_outside = eta * np.sqrt(1 - inside**2)
    outside = np.sqrt(np.maximum(1 - sine_outside**2, 0))
    reflected = np.where(sine_outside < 1, fresnel(outside, eta), 1)
    assert inner_reflectance(eta) == pytest.approx(reflected.mean(), abs=1e-4)


@pytest.mark.parametrize("eta", ETAS)
@pytest.mark.parametrize("albedo", [0.0, 0.5, 1.0])
def test_a_coated_body_returns_at_most_what_it_gets_and_all_of_it_where_it_is_white(eta: float, albedo: float) -> None:
    diffuse = np.sqrt((np.arange(20_000) + 0.5) / 20_000)
    let_out = 1 - fresnel(diffuse, eta).mean()
    for cosine in (0.05, 0.3, 0.7, 1.0):
        F = float(fresnel(np.array(cosine), eta))
        returned = F + (1 - F) * float(under_coat(np.array(albedo), eta)) * let_out
        assert returned <= 1 + 1e-6
        assert returned >= F
        if albedo == 1:
            assert returned == pytest.approx(1, abs=1e-5)


def test_without_a_step_in_index_a_coat_does_nothing() -> None:
    albedo = np.linspace(0, 1, 11)
    np.testing.assert_allclose(under_coat(albedo, 1.0), albedo, atol=1e-12)


def test_only_a_body_can_have_a_coat() -> None:
    assert Material(eta=1.5).is_coated
    assert not Material().is_coated
    assert not Material("pane", eta=1.5).is_coated
    assert not Material("mirror").is_coated


def test_a_body_reflects_the_luminance_of_its_colour_and_picture() -> None:
    red = np.full((2, 2, 3), (188, 0, 0), np.uint8)
    assert reflectance(Material(texture=Picture(red))) == pytest.approx(0.5029 * 0.2126, abs=1e-4)
    assert reflectance(Material(colour=(0.0, 0.5, 0.0))) == pytest.approx(0.5 * 0.7152)
    grey = Picture(np.full((2, 2), 0.3, np.float32))
    assert reflectance(Material(texture=grey, colour=(0.5, 0.5, 0.5))) == pytest.approx(0.15)


def test_srgb_is_linear_near_black_and_a_power_above() -> None:
    assert linear(np.array([0, 255], np.uint8)).tolist() == [0.0, 1.0]
    assert linear(np.array([0.04045 / 2])) == pytest.approx(0.04045 / 2 / 12.92)
    assert linear(np.array([0.5])) == pytest.approx(0.2140, abs=1e-4)


def test_a_linear_texture_is_a_grey_one_as_it_is_and_a_coloured_one_without_its_encoding_and_opacity() -> None:
    grey = np.array([[0.1, 0.5], [0.7, 0.9]], np.float32)
    np.testing.assert_array_equal(linear_texture(Picture(grey)), grey[..., None])
    coloured = np.array([[[0, 128, 255, 40]]], np.uint8)
    np.testing.assert_array_equal(linear_texture(Picture(coloured)), linear(coloured[..., :3]))
    assert linear_texture(Picture(coloured)).shape == (1, 1, 3)
