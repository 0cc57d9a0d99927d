"""Procedural textures keep to their size, tone and seed, and tile without a seam."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset.texture import PATTERNS, Procedural
from vobench.scene.material import Map

NAMES = list(PATTERNS)
DETAILED = [name for name in NAMES if name != "plain"]


def texture(kind: str, *, seed: int = 3, contrast: float = 0.4) -> Procedural:
    return Procedural(kind, albedo=0.5, contrast=contrast, tile_m=1.0, resolution_px=512, seed=seed)


def steps(tile: Map) -> Map:
    """Mean step (2, N) from each row to the next and each column to the next, the last one over the seam."""
    return np.stack([np.abs(tile - np.roll(tile, -1, axis)).mean(1 - axis) for axis in (0, 1)])


@pytest.mark.parametrize("kind", NAMES)
def test_a_texture_is_the_same_bytes_twice(kind: str) -> None:
    assert texture(kind).pixels().tobytes() == texture(kind).pixels().tobytes()


@pytest.mark.parametrize("kind", ["terrazzo", "plaster", "wood", "poster"])
def test_another_seed_makes_another_surface(kind: str) -> None:
    first, second = texture(kind).pixels(), texture(kind, seed=4).pixels()
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.4


@pytest.mark.parametrize("kind", NAMES)
def test_the_mean_of_a_texture_is_its_albedo(kind: str) -> None:
    assert texture(kind).pixels().mean() == pytest.approx(0.5, rel=0.002)


@pytest.mark.parametrize("kind", NAMES)
@pytest.mark.parametrize("tile_m", [0.05, 1.0, 10.0])
def test_a_tile_too_coarse_for_its_detail_is_smooth_and_never_nothing(kind: str, tile_m: float) -> None:
    tile = replace(texture(kind), tile_m=tile_m, resolution_px=8).pixels()
    assert tile.mean() == pytest.approx(0.5, rel=0.05)  # NaN, where no feature fits, would be no number
    if kind == "checker":
        np.testing.assert_allclose(np.unique(tile), [0.3, 0.7], rtol=1e-6)


@pytest.mark.parametrize("kind", DETAILED)
def test_contrast_is_half_the_step_from_dark_to_bright_over_the_mean(kind: str) -> None:
    dark, bright = np.percentile(texture(kind).pixels(), [1, 99])
    assert (bright - dark) / 2 / 0.5 == pytest.approx(0.4, rel=0.03)


@pytest.mark.parametrize("kind", NAMES)
def test_without_contrast_a_texture_is_one_tone(kind: str) -> None:
    np.testing.assert_array_equal(texture(kind, contrast=0.0).pixels(), np.float32(0.5))


@pytest.mark.parametrize("kind", NAMES)
def test_no_surface_reflects_more_than_it_gets_or_nothing_at_all(kind: str) -> None:
    for albedo in (0.05, 0.95):
        tile = replace(texture(kind, contrast=1.0), albedo=albedo).pixels()
        assert tile.dtype == np.float32
        assert tile.min() >= np.float32(0.02)
        assert tile.max() <= np.float32(0.98)


@pytest.mark.parametrize("kind", NAMES)
def test_a_tile_meets_itself_without_a_seam(kind: str) -> None:
    # No larger a step over the seam than anywhere inside; a pattern cut at the edge would stand out.
    across = steps(texture(kind).pixels())
    assert (across[:, -1] <= 1.02 * across[:, :-1].max(1)).all()


@pytest.mark.parametrize("kind", ["terrazzo", "plaster", "wood"])
def test_features_have_their_size_in_metres_whatever_the_resolution(kind: str) -> None:
    # Twice the area at twice the pixels: steps between neighbours are of the same size on average.
    small = texture(kind)
    large = replace(small, tile_m=2.0, resolution_px=1024)
    ratio = steps(large.pixels()).mean() / steps(small.pixels()).mean()
    assert ratio == pytest.approx(1.0, abs=0.15)


def test_a_checker_has_eight_squares_a_side_and_its_first_is_dark() -> None:
    tile = texture("checker").pixels()
    squares = tile.reshape(8, 64, 8, 64)
    np.testing.assert_array_equal(squares.min((1, 3)), squares.max((1, 3)))
    parity = np.add.outer(np.arange(8), np.arange(8)) % 2
    np.testing.assert_allclose(squares[:, 0, :, 0], np.where(parity, 0.7, 0.3), rtol=1e-6)
