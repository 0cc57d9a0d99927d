"""Colour: mosaics, their interpolation, and chips that tell red, green and blue apart."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.sensor.image_sensor import (
    CAMERAS,
    LUMINANCE,
    CameraSettings,
    NoiseStreams,
    demosaiced,
    expose,
    mosaic,
)

SHAPE = (24, 32)


def noise() -> NoiseStreams:
    return NoiseStreams(np.random.default_rng(1), np.random.default_rng(2))


def light(*rgb: float) -> np.ndarray:
    return np.full((*SHAPE, 3), rgb, np.float32)


def test_a_mosaic_keeps_one_channel_a_pixel_red_first() -> None:
    raw = mosaic(light(0.1, 0.2, 0.3))
    np.testing.assert_allclose(raw[:2, :2], [[0.1, 0.2], [0.2, 0.3]], rtol=1e-6)
    np.testing.assert_array_equal(raw, np.tile(raw[:2, :2], (12, 16)))


def test_interpolation_leaves_what_was_measured_and_is_exact_for_even_light() -> None:
    rgb = np.random.default_rng(3).uniform(0.2, 0.6, (*SHAPE, 3))
    raw = mosaic(rgb)
    np.testing.assert_array_equal(mosaic(np.moveaxis(demosaiced(raw), 0, -1)), raw)
    even = demosaiced(mosaic(light(0.5, 0.25, 0.125)).astype(float))
    np.testing.assert_allclose(even, np.array([0.5, 0.25, 0.125])[:, None, None].repeat(24, 1).repeat(32, 2), rtol=1e-6)


def test_interpolation_is_exact_on_grey_ramps_away_from_the_border() -> None:
    v, u = np.indices(SHAPE)
    grey = 0.2 + 0.01 * u + 0.005 * v
    rgb = demosaiced(grey)
    np.testing.assert_allclose(rgb[:, 2:-2, 2:-2], np.broadcast_to(grey, (3, *SHAPE))[:, 2:-2, 2:-2], atol=1e-12)


@pytest.mark.parametrize("colour", ["mono", "bayer", "rgb"])
def test_white_light_gives_every_chip_the_same_grey_value(colour: str) -> None:
    camera = CameraSettings(colour=colour)  # type: ignore[arg-type]
    white = np.ones(SHAPE, np.float32) if colour == "mono" else light(1, 1, 1)
    picture = expose(white, camera, noise())
    assert picture.shape == ((*SHAPE, 3) if colour == "rgb" else SHAPE)
    assert np.unique(picture).tolist() == [200]


def test_a_chip_in_colour_tells_red_from_blue_and_a_mono_one_weighs_them() -> None:
    picture = expose(light(1, 0.5, 0), CameraSettings(colour="rgb"), noise())
    assert (picture == picture[0, 0]).all()
    red, green, blue = picture[0, 0].tolist()
    assert red == 200
    assert red > green > blue == 0
    assert CameraSettings().weights == LUMINANCE
    assert CameraSettings(colour="bayer").weights is None


def test_noise_of_a_mosaic_is_that_of_a_mono_chip() -> None:
    chip = replace(CAMERAS["imx249"], prnu=0.0, dsnu_e=0.0)
    grey = np.full(SHAPE, 0.4, np.float32)
    mono = expose(grey, CameraSettings(chip=chip), noise())
    raw = expose(grey[..., None].repeat(3, -1), CameraSettings(chip=chip, colour="bayer"), noise())
    np.testing.assert_array_equal(mono, raw)
