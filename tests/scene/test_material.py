"""Boundaries split light by Fresnel's law, and nothing returns more than it gets."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.scene.material import (
    PATTERNS,
    Glass,
    Map,
    Matt,
    Mirror,
    Polished,
    fresnel,
    inner_reflectance,
    pane_reflectance,
    reflectance,
    texture_of,
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


def test_only_matt_and_polished_things_have_a_body() -> None:
    for material in (Matt("plain", 0.5), Polished("plain", 0.5)):
        assert texture_of(material) is material
    assert texture_of(Mirror()) is None
    assert texture_of(Glass()) is None


NAMES = list(PATTERNS)
DETAILED = [name for name in NAMES if name != "plain"]


def texture(kind: str, *, seed: int = 3, contrast: float = 0.4) -> Matt:
    return Matt(kind, albedo=0.5, contrast=contrast, tile_m=1.0, resolution_px=512, seed=seed)


def steps(tile: Map) -> Map:
    """Mean step (2, N) from each row to the next and each column to the next, the last one over the seam."""
    return np.stack([np.abs(tile - np.roll(tile, -1, axis)).mean(1 - axis) for axis in (0, 1)])


@pytest.mark.parametrize("kind", NAMES)
def test_a_texture_is_the_same_bytes_twice(kind: str) -> None:
    assert reflectance(texture(kind)).tobytes() == reflectance(texture(kind)).tobytes()


@pytest.mark.parametrize("kind", ["terrazzo", "plaster", "wood", "poster"])
def test_another_seed_makes_another_surface(kind: str) -> None:
    first, second = reflectance(texture(kind)), reflectance(texture(kind, seed=4))
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.4


@pytest.mark.parametrize("kind", NAMES)
def test_the_mean_of_a_texture_is_its_albedo(kind: str) -> None:
    assert reflectance(texture(kind)).mean() == pytest.approx(0.5, rel=0.002)


@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("tile_m", [0.05, 1.0, 10.0])
def test_a_tile_too_coarse_for_its_detail_is_smooth_and_never_nothing(kind: str, tile_m: float) -> None:
    tile = reflectance(replace(texture(kind), tile_m=tile_m, resolution_px=8))
    assert tile.mean() == pytest.approx(0.5, rel=0.05)  # NaN, where no feature fits, would be no number
    if kind == "checker":
        np.testing.assert_allclose(np.unique(tile), [0.3, 0.7], rtol=1e-6)


@pytest.mark.parametrize("kind", DETAILED)
def test_contrast_is_half_the_step_from_dark_to_bright_over_the_mean(kind: str) -> None:
    dark, bright = np.percentile(reflectance(texture(kind)), [1, 99])
    assert (bright - dark) / 2 / 0.5 == pytest.approx(0.4, rel=0.03)


@pytest.mark.parametrize("kind", NAMES)
def test_without_contrast_a_texture_is_one_tone(kind: str) -> None:
    np.testing.assert_array_equal(reflectance(texture(kind, contrast=0.0)), np.float32(0.5))


@pytest.mark.parametrize("kind", NAMES)
def test_no_surface_reflects_more_than_it_gets_or_nothing_at_all(kind: str) -> None:
    for albedo in (0.05, 0.95):
        tile = reflectance(replace(texture(kind, contrast=1.0), albedo=albedo))
        assert tile.dtype == np.float32
        assert tile.min() >= np.float32(0.02)
        assert tile.max() <= np.float32(0.98)


@pytest.mark.parametrize("kind", NAMES)
def test_a_tile_meets_itself_without_a_seam(kind: str) -> None:
    # No larger a step over the seam than anywhere inside; a pattern cut at the edge would stand out.
    across = steps(reflectance(texture(kind)))
    assert (across[:, -1] <= 1.02 * across[:, :-1].max(1)).all()


@pytest.mark.parametrize("kind", ["terrazzo", "plaster", "wood"])
def test_features_have_their_size_in_metres_whatever_the_resolution(kind: str) -> None:
    # Twice the area at twice the pixels: steps between neighbours are of the same size on average.
    small = texture(kind)
    large = replace(small, tile_m=2.0, resolution_px=1024)
    ratio = steps(reflectance(large)).mean() / steps(reflectance(small)).mean()
    assert ratio == pytest.approx(1.0, abs=0.15)


def test_a_checker_has_eight_squares_a_side_and_its_first_is_dark() -> None:
    tile = reflectance(texture("checker"))
    squares = tile.reshape(8, 64, 8, 64)
    np.testing.assert_array_equal(squares.min((1, 3)), squares.max((1, 3)))
    parity = np.add.outer(np.arange(8), np.arange(8)) % 2
    np.testing.assert_allclose(squares[:, 0, :, 0], np.where(parity, 0.7, 0.3), rtol=1e-6)
