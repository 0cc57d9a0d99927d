"""Boundaries split light by Fresnel's law, and nothing returns more than it gets."""

import numpy as np
import pytest

from vobench.scene.material import (
    Glass,
    Matt,
    Mirror,
    Polished,
    fresnel,
    inner_reflectance,
    pane_reflectance,
    texture_of,
    under_coat,
)
from vobench.scene.texture import Texture

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


def test_only_matt_and_polished_things_have_a_body() -> None:
    texture = Texture("plain", 0.5, 0.0, 1.0, 8, 0)
    assert texture_of(Matt(texture)) is texture
    assert texture_of(Polished(texture)) is texture
    assert texture_of(Mirror()) is None
    assert texture_of(Glass()) is None
