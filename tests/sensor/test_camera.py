"""Photon transfer gives back the chip's constants; the clean chip is deterministic and monotone."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.sensor.camera import (
    CAMERAS,
    CameraSensor,
    NoiseStreams,
    Radiance,
    Response,
    decode,
    encode,
    expose,
    fixed_pattern,
)

CLEAN, NOISY = CAMERAS["clean"], CAMERAS["mt9v034"]
# A linear picture with raised black and four times the amplification: noise is well above one grey value.
BENCH = replace(NOISY, response=Response.LINEAR, amplifier=4.0, black_dn=20.0)


def streams(seed: int) -> NoiseStreams:
    return NoiseStreams(*np.random.default_rng(seed).spawn(2))


def flat(level: float, *, side: int = 400) -> Radiance:
    return np.full((side, side), level, np.float32)


def photon_transfer(sensor: CameraSensor, levels: Array) -> tuple[Array, Array]:
    """Mean and temporal variance in grey values at each level, from pairs of pictures of one flat field."""
    rng, means, variances = streams(11), [], []
    for level in levels:
        first, second = (expose(flat(level), sensor, rng).astype(float) for _ in range(2))
        means.append((first + second).mean() / 2)
        variances.append((first - second).var() / 2)
    return np.array(means), np.array(variances)


def test_the_slope_of_photon_transfer_is_the_gain_and_its_start_the_read_noise() -> None:
    levels = np.linspace(0.0, 0.2, 12)
    mean, variance = photon_transfer(BENCH, levels)
    slope, start = np.polyfit(mean - BENCH.black_dn, variance - 1 / 12, 1)
    assert slope == pytest.approx(BENCH.dn_per_electron, rel=0.02)
    assert np.sqrt(start) / BENCH.dn_per_electron == pytest.approx(BENCH.read_noise_e, rel=0.05)


def test_mean_grey_value_is_linear_in_light_with_a_linear_response() -> None:
    levels = np.linspace(0.0, 0.2, 12)
    mean, _ = photon_transfer(BENCH, levels)
    np.testing.assert_allclose(mean, BENCH.black_dn + BENCH.dn_per_electron * BENCH.white_e * levels, atol=0.03)


def test_a_shorter_exposure_is_noisier_than_a_weaker_amplifier_for_the_same_grey() -> None:
    dim, short = replace(BENCH, amplifier=2.0), replace(BENCH, exposure_gain=0.5)
    (dim_mean, short_mean), (dim_var, short_var) = (
        np.array([photon_transfer(s, np.array([0.2]))[i][0] for s in (dim, short)]) for i in (0, 1)
    )
    assert dim_mean == pytest.approx(short_mean, abs=0.1)
    assert short_var > 1.5 * dim_var


@pytest.mark.parametrize("response", Response)
def test_the_clean_chip_puts_white_at_200_and_repeats_itself_whatever_the_generator(response: Response) -> None:
    sensor, picture = replace(CLEAN, response=response), np.random.default_rng(1).random((40, 50), np.float32)
    assert expose(flat(1.0), sensor, streams(0))[0, 0] == 200
    first, second = (expose(picture, sensor, streams(seed)) for seed in (2, 3))
    np.testing.assert_array_equal(first, second)
    assert first.dtype == np.uint8


@pytest.mark.parametrize("response", Response)
def test_the_clean_chip_is_monotone_and_uses_every_grey_value(response: Response) -> None:
    ramp = np.linspace(0, 2, 50_000, dtype=np.float32)[None]
    grey = expose(ramp, replace(CLEAN, response=response), streams(0))[0].astype(int)
    assert (np.diff(grey) >= 0).all()
    assert np.unique(grey).tolist() == list(range(256))


@pytest.mark.parametrize("response", Response)
def test_decoding_undoes_encoding(response: Response) -> None:
    signal = np.linspace(0, 1, 1001)
    # The standard's two pieces of sRGB miss each other by some 1e-8 where they meet.
    np.testing.assert_allclose(decode(encode(signal, response), response), signal, atol=1e-7)


def test_more_light_than_a_well_holds_is_white_and_infinite_light_too() -> None:
    for sensor in (CLEAN, replace(NOISY, read_noise_e=0.0)):
        assert (expose(flat(100.0, side=8), sensor, streams(0)) == 255).all()
        assert (expose(flat(np.inf, side=8), sensor, streams(0)) == 255).all()


def test_one_generator_state_gives_one_noisy_picture() -> None:
    first, second, other = (expose(flat(0.5, side=64), NOISY, streams(seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, second)
    assert (first != other).any()


def test_a_chips_pattern_stays_where_noise_averages_out() -> None:
    sensor = replace(BENCH, gain_spread=0.02, offset_spread_e=20.0)
    pattern, rng = fixed_pattern((64, 64), sensor, np.random.default_rng(8)), streams(9)
    mean = np.mean([expose(flat(0.2, side=64), sensor, rng, pattern=pattern) for _ in range(60)], axis=0)
    mean_e = 0.2 * sensor.white_e * pattern.gain + pattern.offset_e
    np.testing.assert_allclose(mean, sensor.black_dn + sensor.dn_per_electron * mean_e, atol=2.5)
    assert np.std(pattern.gain) == pytest.approx(0.02, rel=0.05)


def test_negative_light_or_nan_is_refused_with_its_pixel() -> None:
    for bad in (-1.0, np.nan):
        picture = flat(0.5, side=4)
        picture[1, 2] = bad
        with pytest.raises(RenderError, match=r"pixel \(2, 1\)"):
            expose(picture, CLEAN, streams(0))


@pytest.mark.parametrize("changed", [{"shot_noise": False}, {"exposure_gain": 0.01}])
def test_the_draws_of_the_electronics_do_not_depend_on_the_light(changed):
    def state_after(sensor: CameraSensor):
        noise = streams(4)
        expose(flat(0.5, side=16), sensor, noise)
        return noise.read.bit_generator.state

    assert state_after(BENCH) == state_after(replace(BENCH, **changed))
