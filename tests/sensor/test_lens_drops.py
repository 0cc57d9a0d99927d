"""Drops on the lens: how they bend light, how much of the glass they cover, and that light is conserved."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vobench.geometry.camera import KannalaBrandt, Pinhole, pixel_grid
from vobench.sensor import lens_drops as module
from vobench.sensor.lens_drops import (
    APERTURE_M,
    APERTURE_POINTS,
    CONTACT_RAD,
    GLASS_M,
    POINT_SPACING_M,
    SMOOTH_REACH,
    WATER_ETA,
    GlassDrops,
    aperture_points,
    bending_rad,
    deflected,
    drops_on_glass,
    lens_drops,
)

CAMERA = Pinhole(120, 80, 100.0, 100.0, 59.5, 39.5)
TANGENTS = (CAMERA.rays(pixel_grid(CAMERA))[..., :2] / CAMERA.rays(pixel_grid(CAMERA))[..., 2:]).reshape(-1, 2)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_the_edge_of_a_drop_bends_light_by_snells_law() -> None:
    outside_rad = np.arcsin(WATER_ETA * np.sin(CONTACT_RAD))
    assert bending_rad(np.array([1.0]))[0] == pytest.approx(outside_rad - CONTACT_RAD)


def test_near_its_middle_a_drop_is_a_thin_lens() -> None:
    """The focal length of a plane and a sphere is R / (n - 1)."""
    distance = np.array([1e-4])
    focal_radii = 1 / np.sin(CONTACT_RAD) / (WATER_ETA - 1)  # in radii of the drop
    np.testing.assert_allclose(bending_rad(distance), distance / focal_radii, rtol=1e-6)


def test_light_that_passes_a_drop_turns_towards_its_middle() -> None:
    drops = GlassDrops(np.array([[4e-3, 1e-3]]), np.array([2e-3]))
    ((pixels, changes),) = deflected(TANGENTS, drops)
    assert len(pixels)
    distance_m = np.linalg.norm(GLASS_M * TANGENTS[pixels] - drops.middles_m, axis=1)
    assert distance_m.max() <= drops.radii_m[0] + APERTURE_M / 2
    far = distance_m > APERTURE_M  # so that all rays of the pixel are on one side of the middle
    towards = -(GLASS_M * TANGENTS[pixels[far]] - drops.middles_m[0])
    assert (np.einsum("ij,ij->i", changes[far], towards) > 0).all()


def test_the_last_drop_hides_those_below() -> None:
    middle_m = np.array([0.0, 0.0])
    below = GlassDrops(np.array([middle_m, middle_m]), np.array([1e-3, 2e-3]))
    first, last = deflected(TANGENTS, below)
    assert len(first[0]) == 0
    above = GlassDrops(np.array([middle_m, middle_m]), np.array([2e-3, 1e-3]))
    first, last = deflected(TANGENTS, above)
    assert len(first[0]) > 0
    assert len(last[0]) > 0


def test_the_points_of_the_aperture_cover_a_disc_evenly() -> None:
    points_m = aperture_points()
    assert points_m.shape == (APERTURE_POINTS, 2)
    assert np.linalg.norm(points_m, axis=1).max() < APERTURE_M / 2
    np.testing.assert_allclose(points_m.mean(0), 0, atol=0.01 * APERTURE_M)
    # The second moment of a uniform disc is its squared radius over 2.
    assert (points_m**2).sum(1).mean() == pytest.approx((APERTURE_M / 2) ** 2 / 2, rel=1e-3)


@pytest.mark.parametrize("share", [0.05, pytest.param(0.3, marks=pytest.mark.slow)])
def test_drops_cover_the_share_of_the_glass_on_average(share: float) -> None:
    covered = []
    for seed in range(40):
        rays = sum(len(pixels) for pixels, _ in deflected(TANGENTS, drops_on_glass(TANGENTS, share, rng(seed))))
        covered.append(rays / (len(TANGENTS) * APERTURE_POINTS))
    error = np.std(covered) / np.sqrt(len(covered))
    assert np.mean(covered) == pytest.approx(share, abs=4 * error + 0.01)


def test_a_larger_share_has_the_drops_of_a_smaller_one_and_more() -> None:
    few = drops_on_glass(TANGENTS, 0.05, rng())
    many = drops_on_glass(TANGENTS, 0.3, rng())
    assert len(many.radii_m) > len(few.radii_m)
    np.testing.assert_array_equal(many.middles_m[: len(few.radii_m)], few.middles_m)


@pytest.mark.parametrize("camera", [CAMERA, KannalaBrandt(120, 90, 60.0, 60.0, 59.5, 44.5, 0.0, 0.0, 0.0, 0.0)])
def test_an_even_picture_stays_even_behind_drops(camera: Pinhole | KannalaBrandt) -> None:
    even = np.full((camera.height_px, camera.width_px), 7.0, np.float32)
    np.testing.assert_allclose(lens_drops(camera, 0.3, rng()).apply(even), even, rtol=1e-5)


def test_a_pixel_far_from_drops_keeps_its_light() -> None:
    picture = rng(5).uniform(0, 1, (CAMERA.height_px, CAMERA.width_px)).astype(np.float32)
    light = picture.ravel()
    behind = lens_drops(CAMERA, 0.1, rng()).apply(picture).ravel()
    drops = drops_on_glass(TANGENTS, 0.1, rng())
    nearest_m = np.full(len(TANGENTS), np.inf)
    for middle_m, radius_m in zip(drops.middles_m, drops.radii_m, strict=True):
        outside_m = np.linalg.norm(GLASS_M * TANGENTS - middle_m, axis=1) - radius_m
        nearest_m = np.minimum(nearest_m, outside_m)
    smoothing_m = (SMOOTH_REACH + 1) * POINT_SPACING_M
    is_clear = nearest_m > APERTURE_M / 2 + smoothing_m
    assert 0.3 < is_clear.mean() < 1
    np.testing.assert_allclose(behind[is_clear], light[is_clear], atol=1e-6)
    assert (np.abs(behind - light)[nearest_m < -APERTURE_M / 2 - smoothing_m / 2] > 1e-3).mean() > 0.9


def test_a_drop_turns_the_picture_behind_it_upside_down() -> None:
    """A drop of one focal length before the aperture crosses the rays: the upper rim shows what lies below."""
    drops = GlassDrops(np.zeros((1, 2)), np.array([2e-3]))
    ((pixels, changes),) = deflected(TANGENTS, drops)
    seen = TANGENTS[pixels] + changes
    rim = np.abs(TANGENTS[pixels, 1]) > 0.7 * drops.radii_m[0] / GLASS_M
    is_up = TANGENTS[pixels, 1] < 0
    assert (seen[rim & is_up, 1] > 0).all()
    assert (seen[rim & ~is_up, 1] < 0).all()


def test_a_block_of_the_picture_is_seen_as_its_mean() -> None:
    """Also the blocks at the right and the lower border, which are smaller."""
    drops = lens_drops(CAMERA, 0.3, rng())
    picture = rng(6).uniform(0, 1, (CAMERA.height_px, CAMERA.width_px)).astype(np.float32)
    side = drops.block_px
    means = [
        picture[row : row + side, column : column + side].mean()
        for row in range(0, CAMERA.height_px, side)
        for column in range(0, CAMERA.width_px, side)
    ]
    bent = (drops.bent @ np.array(means, np.float32)).reshape(picture.shape)
    smooth = gaussian_filter(bent, drops.smooth_px, mode="nearest", truncate=SMOOTH_REACH)
    expected = drops.direct.reshape(picture.shape) * picture + smooth
    np.testing.assert_allclose(drops.apply(picture), expected, rtol=1e-5)


def test_eight_times_as_many_points_give_nearly_the_same_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Smoothing stands for rays between those that are traced."""
    picture = np.zeros((CAMERA.height_px, CAMERA.width_px), np.float32)
    picture[:20] = 1.0  # a bright sky
    coarse = lens_drops(CAMERA, 0.3, rng()).apply(picture)
    monkeypatch.setattr(module, "APERTURE_POINTS", 8 * APERTURE_POINTS)
    fine = lens_drops(CAMERA, 0.3, rng()).apply(picture)
    assert np.abs(coarse - fine).mean() < 0.01
    assert np.sqrt(np.mean((coarse - fine) ** 2)) < 0.03
