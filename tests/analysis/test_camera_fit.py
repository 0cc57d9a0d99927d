"""A fitted camera's exposure, contrast, blur and noise are those that its images were made with."""

import numpy as np
import pytest

from vobench.analysis.camera_fit import (
    WELL_E,
    CameraLook,
    _fit_blur_px,
    _fit_gain,
    _fit_gamma,
    _fit_noise,
    _Parameters,
    camera_of,
    fit_camera,
    look_of,
    solve_increasing,
)
from vobench.analysis.conditions import chip_noise_dn
from vobench.analysis.image_statistics import edge_px, gradients
from vobench.geometry.camera import Pinhole
from vobench.sensor.image_sensor import NoiseStreams, expose
from vobench.sensor.lens import apply_lens, lens_maps

LENS = Pinhole(160, 120, 150.0, 150.0, 79.5, 59.5)


def light() -> np.ndarray:
    rng, picture = np.random.default_rng(3), np.full((120, 160), 0.4, np.float32)
    for _ in range(25):
        x, y = rng.integers(0, 150), rng.integers(0, 110)
        picture[y : y + rng.integers(8, 40), x : x + rng.integers(8, 50)] = rng.uniform(0.05, 1.2)
    return picture


def develop(settings):
    maps = lens_maps(settings, LENS, np.random.default_rng(0))
    noise = NoiseStreams(np.random.default_rng(1), np.random.default_rng(2))
    return [expose(apply_lens(light(), maps), settings, noise)]


def test_a_cameras_exposure_contrast_blur_and_noise_are_found():
    wanted = look_of(develop(camera_of(0.8, 0.6, 0.9, 1.8)))
    settings, look = fit_camera(wanted, develop)
    assert look.mean_dn == pytest.approx(wanted.mean_dn, rel=0.05)
    assert look.sd_dn == pytest.approx(wanted.sd_dn, rel=0.1)
    assert look.noise_dn == pytest.approx(wanted.noise_dn, rel=0.15)
    assert settings.chip.full_well_e == pytest.approx(WELL_E / 1.8**2, rel=0.3)
    assert settings.blur_sigma_px == pytest.approx(0.9, abs=0.25)


# --- The look ---


def test_the_look_is_the_mean_of_those_of_the_images() -> None:
    images = [np.full((120, 160), value, np.uint8) for value in (80, 120)]
    images[1][:, 80:] = 160
    look = look_of(images)
    assert look.mean_dn == pytest.approx((80 + 140) / 2)
    assert look.sd_dn == pytest.approx((0 + 20) / 2)
    assert look.edge_px == pytest.approx(edge_px(images[1], gradients(images[1])) / 2)
    assert look.noise_dn == 0
    assert len(look.flat_dn) == 20


# --- The camera ---


def test_a_camera_has_the_settings_that_are_named_and_noise_grows_as_it_is_asked() -> None:
    camera = camera_of(0.8, 0.5, 0.9, 2.0)
    assert (camera.exposure_gain, camera.blur_sigma_px) == (0.8, 0.9)
    assert camera.chip.response == 2.0
    for grey_dn in (40.0, 150.0):
        quiet, noisy = (chip_noise_dn(camera_of(1.0, 0.5, 0.0, noise).chip, grey_dn) for noise in (1.0, 2.0))
        assert noisy == pytest.approx(2 * quiet)


@pytest.mark.parametrize("noise", [0.5, 1.0, 3.0])
def test_the_noise_is_that_of_20_000_electrons_and_a_read_noise_of_25_times_as_large(noise: float) -> None:
    chip = camera_of(1.0, 1.0, 0.0, noise).chip
    assert chip.adc_bits == 10
    for grey_dn in (40.0, 150.0):
        sigma_e = np.sqrt(25**2 + 20_000 * grey_dn / 255)
        assert chip_noise_dn(chip, grey_dn) == pytest.approx(noise * 255 * sigma_e / 20_000, rel=1e-6)


def test_the_noise_is_solved_from_that_of_flat_parts_less_that_of_rounding() -> None:
    flat_dn = np.array([60.0, 120.0])
    parameters = _Parameters(gain=1.0, gamma=0.6, blur_px=0.0, noise=1.0)
    for noise in (0.5, 3.0):
        chip = camera_of(1.0, 0.6, 0.0, noise).chip
        variance = np.mean([chip_noise_dn(chip, grey_dn) ** 2 for grey_dn in flat_dn])
        wanted = CameraLook(100.0, 30.0, float(np.sqrt(variance + 1 / 12)), 3.0, flat_dn)
        assert _fit_noise(parameters, wanted) == pytest.approx(noise, rel=1e-6)
    assert _fit_noise(parameters, CameraLook(100.0, 30.0, 0.1, 3.0, flat_dn)) == 0.03  # less than rounding makes
    assert _fit_noise(parameters, CameraLook(100.0, 30.0, 1e4, 3.0, flat_dn)) == 30
    assert _fit_noise(parameters, CameraLook(100.0, 30.0, 2.0, 3.0, np.zeros(0))) == 0.03


@pytest.mark.parametrize("wanted", [0.2, 1.7, 3.9])
def test_bisection_finds_the_argument_to_a_256th_of_the_range(wanted: float) -> None:
    found = solve_increasing(lambda x: x, wanted, (0.0, 4.0))
    assert found == pytest.approx(wanted, abs=4 / 2**8)
    assert solve_increasing(lambda x: x, -1.0, (0.0, 4.0)) < 4 / 2**7
    assert solve_increasing(lambda x: x, 9.0, (0.0, 4.0)) > 4 - 4 / 2**7


def test_exposure_is_solved_over_orders_of_magnitude() -> None:
    def linear(settings):
        return [np.full((8, 8), min(10 * settings.exposure_gain, 255.0))]

    parameters = _Parameters(gain=1.0, gamma=0.6, blur_px=0.0, noise=1.0)
    for gain in (0.05, 1.0, 20.0):
        wanted = CameraLook(10 * gain, 0.0, 0.0, 0.0, np.zeros(0))
        assert _fit_gain(parameters, wanted, linear) == pytest.approx(gain, rel=0.04)


def test_contrast_is_solved_at_the_exposure_that_gives_the_mean() -> None:
    light = np.linspace(0.02, 1.0, 4096).reshape(64, 64)

    def perfect(settings):
        response = float(settings.chip.response)
        return [255 * np.clip(settings.exposure_gain * light, 0, 1) ** (1 / response)] * 2

    def look(gain: float, gamma: float) -> CameraLook:
        image = perfect(camera_of(gain, gamma, 0.0, 1.0))[0]
        return CameraLook(float(image.mean()), float(image.std()), 0.0, 0.0, np.zeros(0))

    start = _Parameters(gain=1.0, gamma=0.45, blur_px=0.0, noise=1.0)
    for gain, gamma in ((0.5, 0.8), (0.9, 0.4)):
        assert _fit_gamma(start, look(gain, gamma), perfect) == pytest.approx(gamma, abs=0.03)


def test_blur_is_solved_from_the_width_of_edges() -> None:
    start = _Parameters(gain=0.8, gamma=0.6, blur_px=0.0, noise=0.3)
    for blur_px in (0.7, 1.4):
        wanted = look_of(develop(camera_of(0.8, 0.6, blur_px, 0.3)))
        assert _fit_blur_px(start, wanted, develop) == pytest.approx(blur_px, abs=0.15)
