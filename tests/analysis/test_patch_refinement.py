"""Matches are refined to where the patches are, however they shift, stretch and shear."""

import numpy as np
import pytest

from vobench.analysis.patch_refinement import AFFINE, SLANT, refined

CENTRE_PX = np.array([120.0, 90.0])


def painted(places_px: np.ndarray) -> np.ndarray:
    """Grey values at places (..., 2) of a texture that is known between pixels, too: a sum of waves."""
    rng = np.random.default_rng(0)
    values = np.full(places_px.shape[:-1], 128.0)
    for _ in range(60):
        angle, wavelength_px, phase = rng.uniform(0, np.pi), rng.uniform(6, 40), rng.uniform(0, 2 * np.pi)
        along_px = places_px @ [np.cos(angle), np.sin(angle)]
        values += 8 * np.sin(2 * np.pi * along_px / wavelength_px + phase)
    return values


PIXELS = np.stack(np.meshgrid(np.arange(240.0), np.arange(180.0)), -1)


def texture() -> np.ndarray:
    return painted(PIXELS)


def warped(A: np.ndarray, shift_px: tuple[float, float]) -> np.ndarray:
    """The texture with each point p moved to A (p - centre) + centre + shift."""
    return painted((PIXELS - CENTRE_PX - shift_px) @ np.linalg.inv(A).T + CENTRE_PX)


def grid_of_points() -> np.ndarray:
    x, y = np.meshgrid(np.arange(60.0, 181, 20), np.arange(40.0, 141, 20))
    points = np.stack([x, y], -1).reshape(-1, 2)
    dither_px = np.random.default_rng(1).uniform(-0.5, 0.5, points.shape)
    return (points + dither_px).astype(np.float32)


def is_small(error_px: np.ndarray) -> bool:
    """Whether errors are no larger than those of sampling between pixels, which cancel on average."""
    return bool(np.abs(error_px).max() < 0.15 and np.abs(error_px.mean(0)).max() < 0.025)


def refine(A: np.ndarray, shift_px: tuple[float, float], *, shape: int, guess_px=(0.4, -0.3), gain=1.0, brightness=0.0):
    points = grid_of_points()
    expected = (points - CENTRE_PX) @ A.T + CENTRE_PX + shift_px
    later = gain * warped(A, shift_px) + brightness
    found, settled = refined(texture(), later, points, np.float32(expected + guess_px), shape=shape)
    return found - expected, settled


def linear(a=0.0, b=0.0, c=0.0, d=0.0) -> np.ndarray:
    return np.eye(2) + np.array([[a, b], [c, d]])


@pytest.mark.parametrize("shift_px", [(0.0, 0.0), (3.25, 0.0), (0.0, -2.5), (-1.7, 0.6)])
@pytest.mark.parametrize("shape", [SLANT, AFFINE])
def test_a_shift_is_found_between_pixels(shift_px, shape) -> None:
    error_px, settled = refine(linear(), shift_px, shape=shape)
    assert settled.all()
    assert is_small(error_px)


@pytest.mark.parametrize("A", [linear(a=0.05), linear(b=0.06), linear(a=-0.04, b=0.03)])
def test_a_slanted_surface_stretches_and_shears_along_rows(A) -> None:
    for shape in (SLANT, AFFINE):
        error_px, settled = refine(A, (0.5, 0.0), shape=shape)
        assert settled.mean() > 0.9
        assert is_small(error_px[settled])


@pytest.mark.parametrize("A", [linear(d=0.06), linear(c=0.05), linear(b=-0.04, c=0.04), linear(a=0.05, d=0.05)])
def test_a_turn_or_an_approach_takes_all_four_terms(A) -> None:
    affine_px, settled = refine(A, (0.5, 0.3), shape=AFFINE)
    assert settled.mean() > 0.9
    assert is_small(affine_px[settled])


def test_gain_and_brightness_do_not_matter() -> None:
    plain_px, _ = refine(linear(a=0.03), (0.5, 0.0), shape=SLANT)
    changed_px, settled = refine(linear(a=0.03), (0.5, 0.0), shape=SLANT, gain=0.7, brightness=20.0)
    assert settled.all()
    np.testing.assert_allclose(changed_px, plain_px, atol=0.02)


def test_a_guess_that_is_too_far_away_does_not_settle() -> None:
    assert not refine(linear(), (0.0, 0.0), shape=SLANT, guess_px=(8.0, 0.0))[1].any()
    assert refine(linear(), (0.0, 0.0), shape=SLANT, guess_px=(1.2, 0.0))[1].mean() > 0.9
    assert not refine(linear(), (0.0, 0.0), shape=SLANT, guess_px=(1.3, 1.3))[1].any()


def test_no_points_and_no_texture_settle_nowhere() -> None:
    nothing = np.zeros((0, 2), np.float32)
    found, settled = refined(texture(), texture(), nothing, nothing, shape=SLANT)
    assert (len(found), len(settled)) == (0, 0)
    points = grid_of_points()
    other = texture()[::-1, ::-1]
    assert refined(texture(), other, points, points, shape=AFFINE)[1].mean() < 0.3
