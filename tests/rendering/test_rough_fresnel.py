"""The reflectance of rough coats: between that of a smooth coat and less, by energy and by the law of masking."""

import numpy as np
import pytest

from vobench.rendering.rough_fresnel import COSINES, directional_reflectance, rough_reflectance
from vobench.scene.material import fresnel

ROUGHNESSES = (0.05, 0.1, 0.2, 0.3, 0.4)


@pytest.mark.parametrize("eta", [1.33, 1.5, 1.8])
def test_a_coat_that_is_nearly_smooth_reflects_what_fresnel_says(eta: float) -> None:
    for cosine in (0.3, 0.5, 0.8, 1.0):
        expected = float(fresnel(np.array(cosine), eta))
        assert directional_reflectance(eta, 1e-3, cosine) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("roughness", ROUGHNESSES)
def test_the_curve_is_within_two_percent_of_the_light(roughness: float) -> None:
    curve = rough_reflectance(1.5, roughness)
    exact = [directional_reflectance(1.5, roughness, float(cosine)) for cosine in COSINES]
    np.testing.assert_allclose(curve.at(COSINES), exact, atol=0.02)


def test_the_average_over_facets_agrees_with_random_facets() -> None:
    """Facets drawn from the distribution of all normals, weighted by how much of each is seen."""
    rng = np.random.default_rng(0)
    eta, alpha, cosine = 1.5, 0.3, 0.2
    first, turn = rng.random((2, 400_000))
    tangent = alpha * np.sqrt(first / (1 - first))
    facet_cosine = 1 / np.sqrt(1 + tangent**2)
    sine = tangent * facet_cosine
    facets = np.stack([sine * np.cos(2 * np.pi * turn), sine * np.sin(2 * np.pi * turn), facet_cosine], -1)
    to_eye = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    along = facets @ to_eye
    seen = np.maximum(along, 0) / facet_cosine
    mirrored_height = 2 * along * facet_cosine - cosine
    slope = np.sqrt(1 - mirrored_height**2) / np.maximum(np.abs(mirrored_height), 1e-9)
    unmasked = np.where(mirrored_height > 0, 2 / (1 + np.sqrt(1 + (alpha * slope) ** 2)), 0)
    expected = np.sum(seen * fresnel(np.clip(along, 0, 1), eta) * unmasked) / seen.sum()
    assert directional_reflectance(eta, alpha, cosine) == pytest.approx(expected, rel=0.02)


def test_the_rougher_a_coat_the_less_it_reflects_at_grazing_incidence() -> None:
    grazing = [float(rough_reflectance(1.5, roughness).at(np.array(0.1))) for roughness in ROUGHNESSES]
    assert grazing == sorted(grazing, reverse=True)
    assert grazing[0] < float(fresnel(np.array(0.1), 1.5))


def test_without_refraction_nothing_is_reflected() -> None:
    curve = rough_reflectance(1.0, 0.3)
    np.testing.assert_allclose(curve.at(COSINES), 0, atol=1e-12)
