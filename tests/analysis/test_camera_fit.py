"""A fitted camera's exposure, contrast, blur and noise are those that its images were made with."""

import numpy as np
import pytest

from vobench.analysis.camera_fit import WELL_E, camera_of, fit_camera, look_of
from vobench.geometry.camera import Pinhole
from vobench.sensor.image_sensor import NoiseStreams, expose
from vobench.sensor.lens import lens_maps, through_lens

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
    return [expose(through_lens(light(), maps), settings, noise)]


def test_a_cameras_exposure_contrast_blur_and_noise_are_found():
    wanted = look_of(develop(camera_of(0.8, 0.6, 0.9, 1.8)))
    settings, look = fit_camera(wanted, develop)
    assert look.mean_dn == pytest.approx(wanted.mean_dn, rel=0.05)
    assert look.sd_dn == pytest.approx(wanted.sd_dn, rel=0.1)
    assert look.noise_dn == pytest.approx(wanted.noise_dn, rel=0.15)
    assert settings.chip.full_well_e == pytest.approx(WELL_E / 1.8**2, rel=0.3)
    assert settings.blur_sigma_px == pytest.approx(0.9, abs=0.25)
