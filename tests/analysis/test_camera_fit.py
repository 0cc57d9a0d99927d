"""A fitted camera's exposure, contrast, blur and noise are those that its images were made with."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from vobench.analysis.camera_fit import (
    WELL_E,
    CameraLook,
    Lights,
    _fit_noise,
    camera_of,
    fit_camera,
    look_of,
    solve_increasing,
)
from vobench.analysis.conditions import chip_noise_dn
from vobench.analysis.image_statistics import edge_px, gradients
from vobench.runner.store import SilentProgress


def light(seed: int = 3, shape: tuple[int, int] = (120, 160)) -> np.ndarray:
    rng, picture = np.random.default_rng(seed), np.full(shape, 0.4, np.float32)
    for _ in range(25):
        x, y = rng.integers(0, shape[1] - 10), rng.integers(0, shape[0] - 10)
        picture[y : y + rng.integers(8, 40), x : x + rng.integers(8, 50)] = rng.uniform(0.05, 1.2)
    return picture


def develop(settings):
    return Lights([light()]).develop(settings)


@pytest.mark.parametrize(
    ("gain", "gamma", "blur_px", "noise"), [(0.8, 0.6, 0.9, 1.8), (0.3, 0.4, 0.3, 0.5), (1.5, 0.9, 1.6, 1.0)]
)
def test_a_cameras_exposure_contrast_blur_and_noise_are_found(gain, gamma, blur_px, noise) -> None:
    lights = [light(seed, (120, 480)) for seed in range(4)]
    wanted = look_of(Lights(lights, seed=1).develop(camera_of(gain, gamma, blur_px, noise)))
    settings, look = fit_camera(wanted, Lights(lights))
    assert look.mean_dn == pytest.approx(wanted.mean_dn, rel=0.01)
    assert look.sd_dn == pytest.approx(wanted.sd_dn, rel=0.02)
    assert look.saturated_share == pytest.approx(wanted.saturated_share, abs=0.01)
    assert look.edge_px == pytest.approx(wanted.edge_px, rel=0.05)
    assert look.noise_dn == pytest.approx(wanted.noise_dn, rel=0.15)
    assert settings.exposure_gain == pytest.approx(gain, rel=0.05)
    assert settings.chip.response == pytest.approx(1 / gamma, rel=0.05)
    assert settings.blur_sigma_px == pytest.approx(blur_px, abs=0.15)
    assert settings.chip.full_well_e == pytest.approx(WELL_E / noise**2, rel=0.3)


class Counter(SilentProgress):
    """Records what is shown."""

    def __init__(self) -> None:
        super().__init__()
        self.shares: list[float] = []

    @contextmanager
    def step(self, what: str):
        self.what = what
        yield self.shares.append


def test_the_fit_shows_its_developments_and_needs_some_dozens() -> None:
    lights = Lights([light(seed, (120, 480)) for seed in range(4)])
    progress = Counter()
    fit_camera(look_of(lights.develop(camera_of(0.8, 0.6, 0.9, 1.8))), lights, progress=progress)
    assert progress.what == "camera: about 80 developments of windows of pictures"
    assert 20 < len(progress.shares) < 100
    assert progress.shares == sorted(progress.shares)
    assert progress.shares[0] == pytest.approx(1 / 80)


def test_a_look_that_windows_misrepresent_is_corrected_by_whole_pictures() -> None:
    # The only window of one picture is at its left, where it is brightest.
    picture = light(shape=(120, 900))
    picture[:, :150] *= 2
    lights = Lights([picture])
    wanted = look_of(lights.develop(camera_of(0.5, 0.6, 0.9, 0.5)))
    assert look_of(lights.windows().develop(camera_of(0.5, 0.6, 0.9, 0.5))).mean_dn > 1.15 * wanted.mean_dn
    settings, look = fit_camera(wanted, lights)
    assert look.mean_dn == pytest.approx(wanted.mean_dn, rel=0.02)
    assert settings.exposure_gain == pytest.approx(0.5, rel=0.1)


def test_windows_are_as_high_as_the_pictures_and_cover_them_in_turn() -> None:
    columns = np.broadcast_to(np.linspace(0, 0.9, 900, dtype=np.float32), (50, 900))
    windows = Lights([columns] * 6).windows().develop(camera_of(1.0, 1.0, 0.0, 0.03))
    assert [window.shape for window in windows] == [(50, 150)] * 6
    means = [window.mean() for window in windows]
    assert means == sorted(means)
    np.testing.assert_allclose(np.mean(means), Lights([columns]).develop(camera_of(1, 1, 0, 0.03))[0].mean(), rtol=0.01)


def test_windows_of_small_pictures_are_the_pictures() -> None:
    (image,) = Lights([light(shape=(100, 90))]).windows().develop(camera_of(1.0, 0.6, 0.0, 0.1))
    assert image.shape == (100, 90)


def test_a_camera_takes_the_same_picture_again_and_a_blur_spreads_its_light() -> None:
    lights = Lights([light()], seed=4)
    settings = camera_of(0.8, 0.6, 1.2, 1.0)
    np.testing.assert_array_equal(lights.develop(settings)[0], lights.develop(settings)[0])
    assert (lights.develop(settings)[0] != Lights([light()], seed=5).develop(settings)[0]).any()
    sharp = lights.develop(camera_of(0.8, 0.6, 0.0, 0.03))[0]
    blurred = lights.develop(camera_of(0.8, 0.6, 1.2, 0.03))[0]
    assert edge_px(blurred, gradients(blurred)) > 1.5 * edge_px(sharp, gradients(sharp))


def test_a_place_that_cannot_have_the_wanted_look_compromises_on_saturated_pixels_too() -> None:
    lights = Lights([light(seed, (120, 480)) for seed in range(4)])
    look = look_of(lights.develop(camera_of(1.8, 0.8, 0.9, 1.0)))
    assert 0.02 < look.saturated_share < 0.6
    more_saturated = replace(look, saturated_share=look.saturated_share + 0.2)
    _, found = fit_camera(more_saturated, lights)
    assert found.saturated_share > look.saturated_share + 0.01
    assert found.mean_dn == pytest.approx(look.mean_dn, rel=0.1)


def test_pictures_without_edges_or_flat_parts_are_fitted_too() -> None:
    lights = Lights([np.full((100, 90), 0.4, np.float32)])
    wanted = CameraLook(100.0, 0.0, 0.0, 0.0, np.zeros(0))
    settings, look = fit_camera(wanted, lights)
    assert look.mean_dn == pytest.approx(100, rel=0.02)
    assert settings.blur_sigma_px < 0.1


# --- The look ---


def test_the_look_is_the_mean_of_those_of_the_images() -> None:
    images = [np.full((120, 160), value, np.uint8) for value in (80, 120)]
    images[1][:, 80:] = 160
    images[0][0, :80] = 254
    look = look_of(images)
    images[0][0, :80] = 80
    assert look.saturated_share == pytest.approx(80 / (2 * 120 * 160))
    look = look_of(images)
    assert look.saturated_share == 0
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
    for noise in (0.5, 3.0):
        chip = camera_of(1.0, 0.6, 0.0, noise).chip
        variance = np.mean([chip_noise_dn(chip, grey_dn) ** 2 for grey_dn in flat_dn])
        wanted = CameraLook(100.0, 30.0, float(np.sqrt(variance + 1 / 12)), 3.0, flat_dn)
        assert _fit_noise(0.6, wanted) == pytest.approx(noise, rel=1e-6)
    assert _fit_noise(0.6, CameraLook(100.0, 30.0, 0.1, 3.0, flat_dn)) == 0.03  # less than rounding makes
    assert _fit_noise(0.6, CameraLook(100.0, 30.0, 1e4, 3.0, flat_dn)) == 30
    assert _fit_noise(0.6, CameraLook(100.0, 30.0, 2.0, 3.0, np.zeros(0))) == 0.03


@pytest.mark.parametrize("wanted", [0.2, 1.7, 3.9])
def test_bisection_finds_the_argument_to_a_256th_of_the_range(wanted: float) -> None:
    found = solve_increasing(lambda x: x, wanted, (0.0, 4.0))
    assert found == pytest.approx(wanted, abs=4 / 2**8)
    assert solve_increasing(lambda x: x, -1.0, (0.0, 4.0)) < 4 / 2**7
    assert solve_increasing(lambda x: x, 9.0, (0.0, 4.0)) > 4 - 4 / 2**7
