"""Falloff is cos⁴, blur has its width and loses no light, dirt stays where it is; off is off."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import SettingError
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.se3 import Array
from vobench.sensor.image_sensor import CameraSettings, Radiance
from vobench.sensor.lens import (
    LensMaps,
    apply_lens,
    blur,
    dirt,
    disc_transfer,
    gaussian_transfer,
    lens_maps,
    vignetting,
)

SHAPE = (120, 160)
CLEAN = CameraSettings()


CAMERA = Pinhole(160, 120, 100.0, 100.0, 79.5, 59.5)


def rays() -> Array:
    """Unit rays (H, W, 3) of the camera."""
    return CAMERA.rays(pixel_grid(CAMERA))


def light(seed: int = 0) -> Radiance:
    return np.random.default_rng(seed).random(SHAPE, np.float32)


def maps(effects: CameraSettings, seed: int = 0) -> LensMaps:
    return lens_maps(effects, CAMERA, np.random.default_rng(seed))


def test_a_lens_without_effects_hands_light_through_untouched() -> None:
    radiance = light()
    assert maps(CLEAN) == LensMaps()
    assert apply_lens(radiance, maps(CLEAN)) is radiance


def test_flare_moves_light_in_proportion_and_keeps_its_sum() -> None:
    flares = maps(replace(CLEAN, flare=0.2, ghost=0.05, blur_sigma_px=0.7))
    one, other = light(1), 40 * light(2) ** 20
    for radiance in (one, other):
        assert apply_lens(radiance, flares).sum() == pytest.approx(radiance.sum(), rel=1e-6)
    both = apply_lens(one, flares) + apply_lens(other, flares)
    np.testing.assert_allclose(apply_lens(one + other, flares), both, rtol=1e-5)


def test_a_lamp_has_its_veil_about_it_and_its_ghost_across_the_middle() -> None:
    lamp = np.zeros(SHAPE, np.float32)
    lamp[30, 100] = 1000.0
    seen = apply_lens(lamp, maps(replace(CLEAN, flare=0.1, ghost=0.04)))
    assert seen[30, 100] == pytest.approx(860, rel=0.01)  # and what the veil is there
    ghost = seen[89 - 10 : 89 + 11, 59 - 10 : 59 + 11]  # three sigma of it to all sides
    assert ghost.argmax() == 10 * 21 + 10
    alone = apply_lens(lamp, maps(replace(CLEAN, flare=0.1)))
    assert (ghost - alone[79:100, 49:70]).sum() == pytest.approx(40, rel=0.01)
    h_px, r_px = 0.1 * SHAPE[1], 12
    middle = apply_lens(np.roll(lamp, (30, -20), (0, 1)), maps(replace(CLEAN, flare=0.1)))
    assert middle[60, 80 + r_px] == pytest.approx(100 * h_px / (2 * np.pi * (h_px**2 + r_px**2) ** 1.5), rel=0.05)


def test_falloff_is_the_fourth_power_of_the_cosine() -> None:
    seen = apply_lens(np.full(SHAPE, 0.7, np.float32), maps(replace(CLEAN, vignetting=1.0)))
    cosine = rays()[..., 2]
    np.testing.assert_allclose(seen, 0.7 * cosine**4, rtol=0.01)
    exponent, _ = np.polyfit(np.log(cosine.ravel()), np.log(seen.ravel()), 1)
    assert exponent == pytest.approx(4, rel=0.01)


def test_falloff_does_not_ask_how_long_a_ray_is() -> None:
    np.testing.assert_allclose(vignetting(rays()), vignetting(rays() / rays()[..., 2:]))


def test_strength_is_an_exponent() -> None:
    np.testing.assert_allclose(vignetting(rays(), strength=0.25), rays()[..., 2])


def along(theta_deg: Array) -> Array:
    theta = np.deg2rad(theta_deg)
    return np.stack([np.sin(theta), 0 * theta, np.cos(theta)], -1)[None]


def test_rims_cut_light_off_at_their_angle_and_less_before() -> None:
    theta_deg = np.linspace(0, 60, 121)
    share = vignetting(along(theta_deg), strength=0.0, cutoff_deg=50.0)[0]
    assert share[0] == pytest.approx(1)
    assert (share[theta_deg >= 50] < 1e-12).all()
    assert (np.diff(share[theta_deg <= 50]) < 0).all()
    # Two discs half a diameter apart share 39.1 % of their area.
    halfway_deg = np.rad2deg(np.arctan(np.tan(np.deg2rad(50)) / 2))
    assert vignetting(along(np.array([halfway_deg])), strength=0.0, cutoff_deg=50.0)[0, 0] == pytest.approx(
        0.391, abs=5e-4
    )


def test_no_light_comes_from_behind_or_from_nowhere() -> None:
    backwards = np.array([[[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [np.nan, np.nan, np.nan]]])
    np.testing.assert_array_equal(vignetting(backwards), 0)


def point(transfer: Array) -> Array:
    lamp = np.zeros(SHAPE, np.float32)
    lamp[60, 80] = 1e4
    return blur(lamp, transfer) / 1e4


def variance_px2(spread: Array) -> Array:
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.array([(spread * (v - 60) ** 2).sum(), (spread * (u - 80) ** 2).sum()])


@pytest.mark.parametrize("sigma_px", [0.05, 0.3, 0.7, 1.0, 3.0, 8.0])
def test_blur_is_as_wide_as_it_says_and_loses_no_light(sigma_px: float) -> None:
    spread = point(gaussian_transfer(SHAPE, sigma_px))
    assert spread.sum() == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(np.sqrt(variance_px2(spread)), sigma_px, rtol=0.01)
    assert spread.min() >= 0


@pytest.mark.parametrize("sigma_px", [1.0, 2.0, 6.0])
def test_blur_has_the_shape_of_a_gaussian(sigma_px: float) -> None:
    row = point(gaussian_transfer(SHAPE, sigma_px)).sum(0)
    exact = np.exp(-((np.arange(SHAPE[1]) - 80) ** 2) / (2 * sigma_px**2)) / (sigma_px * np.sqrt(2 * np.pi))
    np.testing.assert_allclose(row, exact, atol=1e-6 + 1e-4 * exact.max())


def test_two_blurs_are_one_of_the_root_of_their_squares() -> None:
    once = blur(light(), gaussian_transfer(SHAPE, 5.0))
    twice = blur(blur(light(), gaussian_transfer(SHAPE, 3.0)), gaussian_transfer(SHAPE, 4.0))
    np.testing.assert_allclose(once, twice, atol=1e-6)


@pytest.mark.parametrize("diameter_px", [4.7, 8.0, 15.5])
def test_defocus_is_a_disc_seen_by_pixels(diameter_px: float) -> None:
    spread = point(disc_transfer(SHAPE, diameter_px))
    assert spread.sum() == pytest.approx(1, abs=1e-6)
    # The disc's own variance is d²/16; sorting it into pixels adds that of a pixel, 1/12.
    np.testing.assert_allclose(variance_px2(spread), diameter_px**2 / 16 + 1 / 12, rtol=0.03)
    v, u = np.mgrid[: SHAPE[0], : SHAPE[1]]
    distance = np.hypot(v - 60, u - 80)
    np.testing.assert_allclose(spread[distance < diameter_px / 2 - 1], 4 / (np.pi * diameter_px**2), rtol=0.02)
    assert spread[distance > diameter_px / 2 + 1].max() < 1e-7


def test_a_disc_within_a_pixel_changes_nothing() -> None:
    np.testing.assert_allclose(disc_transfer(SHAPE, 0.9), 1)


@pytest.mark.parametrize("effects", [CameraSettings(blur_sigma_px=2.5), CameraSettings(defocus_px=7.0)])
def test_blur_keeps_the_sum_of_any_picture_and_even_light_even(effects: CameraSettings) -> None:
    assert apply_lens(light(), maps(effects)).sum(dtype=float) == pytest.approx(light().sum(dtype=float), rel=1e-6)
    np.testing.assert_allclose(apply_lens(np.full(SHAPE, 0.3, np.float32), maps(effects)), 0.3, rtol=1e-6)


def test_blurring_leaves_no_negative_light_beside_a_lamp() -> None:
    radiance = light() * 1e-3
    radiance[50:60, 70:80] = 1e5
    blurred = apply_lens(radiance, maps(CameraSettings(blur_sigma_px=1.0)))
    assert blurred.min() >= 0
    assert blurred[:10].max() < 1.1e-3


@pytest.mark.parametrize("amount", [0.01, 0.1, 0.4])
def test_dirt_takes_the_share_of_light_it_says(amount: float) -> None:
    taken = dirt(SHAPE, amount, np.random.default_rng(3))
    assert taken.mean() == pytest.approx(amount, rel=1e-6)
    assert taken.min() >= 0
    assert taken.max() < 1


def test_dirt_lies_in_blobs_with_clean_glass_between() -> None:
    for seed in range(5):
        taken = dirt(SHAPE, 0.1, np.random.default_rng(seed))
        cleanest, thickest = np.quantile(taken, [0.05, 0.95])
        assert cleanest < 0.03
        assert thickest > 0.2


def test_dirt_is_one_per_camera_and_only_thickens() -> None:
    thin, thick, other = (
        dirt(SHAPE, amount, np.random.default_rng(seed)) for amount, seed in ((0.05, 1), (0.2, 1), (0.05, 2))
    )
    np.testing.assert_array_equal(thin, dirt(SHAPE, 0.05, np.random.default_rng(1)))
    assert (thick >= thin).all()
    assert np.corrcoef(np.log1p(-thin).ravel(), np.log1p(-thick).ravel())[0, 1] == pytest.approx(1)
    assert np.corrcoef(thin.ravel(), other.ravel())[0, 1] < 0.5


def test_the_dirt_of_a_seed_stays_what_it_was_so_that_sequences_come_again() -> None:
    taken = dirt(SHAPE, 0.1, np.random.default_rng(3))
    np.testing.assert_allclose(taken[60, ::40], [0.05316098, 0.15589388, 0.24826597, 0.06259832], rtol=1e-6)


def test_dirt_dims_what_is_bright_and_veils_what_is_dark() -> None:
    dirty, radiance = maps(CameraSettings(dirt=0.2)), np.zeros(SHAPE, np.float32)
    radiance[:60] = 2.0
    seen = apply_lens(radiance, dirty)
    assert (seen[:60] <= 2.0).all()
    assert (seen[60:] > 0).any()
    assert seen.sum() < radiance.sum()


def test_effects_work_in_the_order_of_the_light() -> None:
    effects = CameraSettings(vignetting=1.0, dirt=0.1, blur_sigma_px=1.5)
    dirty, shaded, blurred = (
        maps(effect)
        for effect in (CameraSettings(dirt=0.1), CameraSettings(vignetting=1.0), CameraSettings(blur_sigma_px=1.5))
    )
    stepwise = apply_lens(apply_lens(apply_lens(light(), dirty), shaded), blurred)
    np.testing.assert_allclose(apply_lens(light(), maps(effects)), stepwise, atol=1e-6)


@pytest.mark.parametrize("name", ["vignetting", "blur_sigma_px", "defocus_px"])
def test_only_dirt_draws(name: str) -> None:
    rng = np.random.default_rng(1)
    lens_maps(replace(CLEAN, **{name: 1.0}), CAMERA, rng)
    assert rng.bit_generator.state == np.random.default_rng(1).bit_generator.state


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vignetting": -1}, "vignetting: should be 0 or more (got -1.0)"),
        ({"blur_sigma_px": np.nan}, "blur_sigma_px: should be a finite number (got nan)"),
        ({"dirt": 0.6}, "dirt: should be 0.5 or less (got 0.6)"),
        ({"vignetting_cutoff_deg": 90}, "vignetting_cutoff_deg: should be less than 90 (got 90.0)"),
    ],
)
def test_a_lens_that_cannot_be_is_refused(change: dict[str, float], said: str) -> None:
    with pytest.raises(SettingError) as refused:
        CameraSettings(**change)
    assert str(refused.value) == said


def test_each_channel_of_a_colour_picture_passes_the_lens_as_a_grey_one_would() -> None:
    lens = maps(CameraSettings(dirt=0.1, vignetting=1.0, blur_sigma_px=1.0, flare=0.1))
    picture = np.random.default_rng(3).random((*SHAPE, 3), np.float32)
    seen = apply_lens(picture, lens)
    for channel in range(3):
        np.testing.assert_array_equal(seen[..., channel], apply_lens(picture[..., channel], lens))
