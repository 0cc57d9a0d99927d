"""Photon transfer gives back the chip's constants; each effect has draws of its own; the clean chip is exact."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy import stats
from scipy.special import ndtri

from vobench.errors import RenderError, SettingError
from vobench.geometry.se3 import Array
from vobench.sensor import image_sensor
from vobench.sensor.exposure import Exposure
from vobench.sensor.image_sensor import (
    CAMERAS,
    EXPANSION_FROM,
    CameraSensor,
    CameraSettings,
    FixedPattern,
    NoiseStreams,
    Radiance,
    fixed_pattern,
    poisson,
)
from vobench.sensor.image_sensor import expose as expose_camera
from vobench.sensor.response import Grey, response_of

CLEAN, NOISY = CAMERAS["clean"], CAMERAS["mt9v034"]
# A linear picture with raised black, and with fourfold gain: noise is well above one grey value.
BENCH = replace(NOISY, response="linear", black_dn=20.0, dark_e_per_s=0.0, adc_bits=None)
LOUD = Exposure(0.005, gain_db=20 * np.log10(4))
LOUD_K = BENCH.dn_per_electron * LOUD.amplification
every_response = pytest.mark.parametrize("response", ["linear", "srgb", 2.2])


def expose(radiance: Radiance, sensor: CameraSensor, noise: NoiseStreams, **how: object) -> Grey:
    """A picture of a chip whose aperture is set as it is when nothing is said."""
    return expose_camera(radiance, CameraSettings(chip=sensor), noise, **how)


def white_e(sensor: CameraSensor) -> float:
    return CameraSettings(chip=sensor).white_e


def streams(seed: int) -> NoiseStreams:
    return NoiseStreams(*np.random.default_rng(seed).spawn(2))


def flat(level: float, *, side: int = 400) -> Radiance:
    return np.full((side, side), level, np.float32)


def photon_transfer(sensor: CameraSensor, levels: Array, exposure: Exposure | None = None) -> tuple[Array, Array]:
    """Mean and temporal variance in grey values at each level, from pairs of pictures of one flat field."""
    rng, means, variances = streams(11), [], []
    for level in levels:
        first, second = (expose(flat(level), sensor, rng, exposure=exposure).astype(float) for _ in range(2))
        means.append((first + second).mean() / 2)
        variances.append((first - second).var() / 2)
    return np.array(means), np.array(variances)


@pytest.mark.parametrize("adc_bits", [None, 12, 10])
def test_the_slope_of_photon_transfer_is_the_gain_and_its_start_the_read_noise(adc_bits: int | None) -> None:
    levels = np.linspace(0.0, 0.2, 12)
    mean, variance = photon_transfer(replace(BENCH, adc_bits=adc_bits), levels, LOUD)
    converter = 0 if adc_bits is None else (255 / (2**adc_bits - 1)) ** 2 / 12
    slope, start = np.polyfit(mean - BENCH.black_dn, variance - 1 / 12 - converter, 1)
    assert slope == pytest.approx(LOUD_K, rel=0.02)
    assert np.sqrt(start) / LOUD_K == pytest.approx(BENCH.read_noise_e, rel=0.05)


@pytest.mark.parametrize("name", [name for name in CAMERAS if name != "clean"])
def test_the_best_signal_to_noise_is_the_root_of_the_full_well(name: str) -> None:
    sensor = replace(CAMERAS[name], response="linear", read_noise_e=0.0, dark_e_per_s=0.0, adc_bits=None)
    # Four deviations below saturation, which would cut the noise.
    mean_e = sensor.full_well_e - 4 * np.sqrt(sensor.full_well_e)
    mean, variance = photon_transfer(sensor, np.array([mean_e / white_e(sensor)]))
    assert mean[0] / np.sqrt(variance[0] - 1 / 12) == pytest.approx(np.sqrt(sensor.full_well_e), rel=0.03)


@pytest.mark.parametrize(("name", "snr_db"), [("imx249", 45.1), ("imx255", 40.3), ("mt9m034", 43.9)])
def test_full_wells_are_those_of_the_published_signal_to_noise(name: str, snr_db: float) -> None:
    assert 10 * np.log10(CAMERAS[name].full_well_e) == pytest.approx(snr_db, abs=0.05)


@pytest.mark.parametrize(("name", "range_db"), [("imx249", 73.0), ("imx255", 71.3)])
def test_read_noises_are_those_of_the_published_dynamic_range(name: str, range_db: float) -> None:
    sensor = CAMERAS[name]
    assert 20 * np.log10(sensor.full_well_e / sensor.read_noise_e) == pytest.approx(range_db, abs=0.4)


@pytest.mark.parametrize("adc_bits", [None, 8, 10, 12])
def test_rounding_errs_evenly_with_the_variance_of_its_steps(adc_bits: int | None) -> None:
    sensor = replace(CLEAN, response="linear", adc_bits=adc_bits)
    light = np.random.default_rng(3).uniform(0.1, 1.2, (600, 600)).astype(np.float32)
    error = expose(light, sensor, streams(0)) - light * 200.0
    converter = 0 if adc_bits in (None, 8) else (255 / (2**adc_bits - 1)) ** 2
    assert error.mean() == pytest.approx(0, abs=0.003)
    assert error.var() == pytest.approx((1 + converter) / 12, rel=0.01)
    assert np.abs(error).max() <= 0.5001 + np.sqrt(converter) / 2


@every_response
def test_the_clean_chip_rounds_the_response_of_its_light(response) -> None:
    light = np.random.default_rng(4).uniform(0, 1.5, (700, 700)).astype(np.float32)
    sensor = replace(CLEAN, response=response)
    linear = np.minimum(light.astype(float) * white_e(sensor), sensor.full_well_e) * sensor.dn_per_electron / 255
    expected = np.floor(255 * response_of(response).encode(linear) + 0.5)
    np.testing.assert_array_equal(expose(light, sensor, streams(0)), expected)


def test_mean_grey_value_is_linear_in_light_with_a_linear_response() -> None:
    levels = np.linspace(0.0, 0.2, 12)
    mean, _ = photon_transfer(BENCH, levels, LOUD)
    np.testing.assert_allclose(mean, BENCH.black_dn + LOUD_K * white_e(BENCH) * levels, atol=0.03)


@every_response
def test_the_clean_chip_puts_white_at_200_and_repeats_itself_whatever_the_generator(response) -> None:
    sensor, picture = replace(CLEAN, response=response), np.random.default_rng(1).random((40, 50), np.float32)
    assert expose(flat(1.0), sensor, streams(0))[0, 0] == 200
    first, second = (expose(picture, sensor, streams(seed)) for seed in (2, 3))
    np.testing.assert_array_equal(first, second)
    assert first.dtype == np.uint8


@every_response
def test_the_clean_chip_is_monotone_and_uses_every_grey_value(response) -> None:
    # Denser in the dark, where a gamma is steep.
    ramp = (2 * np.linspace(0, 1, 50_000) ** 3).astype(np.float32)[None]
    grey = expose(ramp, replace(CLEAN, response=response), streams(0))[0].astype(int)
    assert (np.diff(grey) >= 0).all()
    assert np.unique(grey).tolist() == list(range(256))


def test_more_light_than_a_well_holds_is_white_and_infinite_light_too() -> None:
    for sensor in (CLEAN, replace(NOISY, read_noise_e=0.0)):
        assert (expose(flat(100.0, side=8), sensor, streams(0)) == 255).all()
        assert (expose(flat(np.inf, side=8), sensor, streams(0)) == 255).all()


def test_one_generator_state_gives_one_noisy_picture() -> None:
    first, second, other = (expose(flat(0.5, side=64), NOISY, streams(seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, second)
    assert (first != other).any()


def test_a_chips_pattern_stays_where_noise_averages_out() -> None:
    sensor = replace(BENCH, prnu=0.02, dsnu_e=20.0)
    pattern, rng = fixed_pattern((64, 64), sensor, np.random.default_rng(8)), streams(9)
    light = flat(0.2, side=64)
    mean = np.mean([expose(light, sensor, rng, pattern=pattern, exposure=LOUD) for _ in range(60)], axis=0)
    mean_e = 0.2 * white_e(sensor) * pattern.gain + pattern.offset_e
    np.testing.assert_allclose(mean, sensor.black_dn + LOUD_K * mean_e, atol=2.5)
    assert np.std(pattern.gain) == pytest.approx(0.02, rel=0.05)


def seen_pattern(seed: int, noise: NoiseStreams) -> Array:
    """What 40 pictures of an even wall have in common."""
    sensor = replace(BENCH, prnu=0.02, dsnu_e=20.0)
    pattern, light = fixed_pattern((64, 64), sensor, np.random.default_rng(seed)), flat(0.2, side=64)
    pictures = [expose(light, sensor, noise, pattern=pattern, exposure=LOUD) for _ in range(40)]
    return np.mean(pictures, axis=0).ravel()


def test_the_pattern_is_one_over_time_and_another_in_another_camera() -> None:
    noise = streams(10)
    early, late, other = seen_pattern(1, noise), seen_pattern(1, noise), seen_pattern(2, noise)
    assert np.corrcoef(early, late)[0, 1] > 0.85
    assert abs(np.corrcoef(early, other)[0, 1]) < 0.05


FULL = replace(
    BENCH, prnu=0.02, dsnu_e=20.0, column_e=10.0, dark_e_per_s=300.0, hot_share=0.05, hot_e_per_s=9000.0
)  # fmt: skip


def pattern_of(**changes: float) -> FixedPattern:
    return fixed_pattern((50, 60), replace(FULL, **changes), np.random.default_rng(12))


@pytest.mark.parametrize(
    ("effect", "touched"),
    [
        ("prnu", "gain"),
        ("dsnu_e", "offset_e"),
        ("column_e", "offset_e"),
        ("hot_share", "dark_e_per_s"),
        ("dark_e_per_s", "dark_e_per_s"),
    ],
)
def test_an_effect_of_the_pattern_switched_off_leaves_all_others_byte_equal(effect: str, touched: str) -> None:
    full, less = pattern_of(), pattern_of(**{effect: 0.0})
    for field in fields(FixedPattern):
        same = np.array_equal(getattr(full, field.name), getattr(less, field.name))
        assert same == (field.name != touched)
    # Where two effects add up, what is left is the other's own.
    alone = {name: 0.0 for name in ("prnu", "dsnu_e", "column_e", "hot_share", "dark_e_per_s") if name != effect}
    rest = getattr(full, touched) - getattr(pattern_of(**alone), touched)
    np.testing.assert_allclose(rest, getattr(less, touched) - (touched == "gain"), atol=1e-9)


def test_column_offsets_run_down_their_columns() -> None:
    offset_e = pattern_of(dsnu_e=0.0).offset_e
    assert np.ptp(offset_e, axis=0).max() == 0
    assert np.std(offset_e[0]) == pytest.approx(10.0, rel=0.3)


def test_hot_pixels_stay_hot_when_there_are_more() -> None:
    few, many = (pattern_of(hot_share=share).dark_e_per_s > 300.0 for share in (0.01, 0.1))
    assert few.mean() == pytest.approx(0.01, abs=0.006)
    assert many.mean() == pytest.approx(0.1, abs=0.02)
    assert (many | ~few).all()


def states_after(sensor: CameraSensor, level: float = 0.5, **camera: float) -> dict[str, object]:
    noise = streams(4)
    pattern = fixed_pattern((16, 16), sensor, np.random.default_rng(0))
    expose_camera(flat(level, side=16), CameraSettings(chip=sensor, **camera), noise, pattern=pattern)
    return {"shot": noise.shot.bit_generator.state, "read": noise.read.bit_generator.state}


ELECTRONICS = {"prnu": 0.0, "dsnu_e": 0.0, "column_e": 0.0, "dark_e_per_s": 0.0, "hot_share": 0.0, "black_dn": 0.0}


@pytest.mark.parametrize("change", [*ELECTRONICS.items(), ("adc_bits", 8)])
def test_noise_takes_the_same_draws_whatever_else_is_on(change: tuple[str, float]) -> None:
    assert states_after(FULL) == states_after(replace(FULL, **dict([change])))


@pytest.mark.parametrize(("stops", "factor"), [(-3, 1 / 8), (-1, 1 / 2), (0, 1), (2, 4)])
def test_a_stop_of_compensation_doubles_the_light_of_any_gain(stops: float, factor: float) -> None:
    compensated = CameraSettings(exposure_gain=3.0, exposure_compensation_ev=stops)
    assert compensated.white_e == CameraSettings(exposure_gain=3.0 * factor).white_e


@pytest.mark.parametrize("change", [{"exposure_gain": 0.001}, {"exposure_ms": 1000.0}])
def test_noise_takes_the_same_draws_whatever_the_aperture_is_set_for(change: dict[str, float]) -> None:
    assert states_after(FULL) == states_after(FULL, **change)


def test_shot_and_read_noise_are_switched_without_each_other() -> None:
    assert states_after(FULL)["read"] == states_after(replace(FULL, shot_noise=False))["read"]
    assert states_after(FULL)["shot"] == states_after(replace(FULL, read_noise_e=0.0))["shot"]


@pytest.mark.parametrize("level", [0.0, 1e-4, 100.0])
def test_the_draws_of_noise_do_not_depend_on_the_light(level: float) -> None:
    assert states_after(FULL, level) == states_after(FULL)


def test_noise_itself_is_byte_equal_where_another_effect_only_adds_a_constant() -> None:
    def noise_e(black_dn: float) -> Array:
        sensor = replace(BENCH, black_dn=black_dn)
        return expose(flat(0.2, side=64), sensor, streams(6), exposure=LOUD).astype(int) - int(black_dn)

    np.testing.assert_array_equal(noise_e(20.0), noise_e(45.0))


def test_dark_current_grows_with_time_and_hot_pixels_most() -> None:
    sensor = replace(CLEAN, response="linear", dark_e_per_s=20_000.0, hot_share=0.01, hot_e_per_s=400_000.0)
    pattern = fixed_pattern((80, 80), sensor, np.random.default_rng(2))
    short, long = (
        expose(flat(0.0, side=80), sensor, streams(0), pattern=pattern, exposure=Exposure(time_s)).astype(float)
        for time_s in (0.02, 0.1)
    )
    hot = pattern.dark_e_per_s > sensor.dark_e_per_s
    assert np.unique(short[~hot]) == round(400 * sensor.dn_per_electron)
    assert np.unique(long[~hot]) == round(2000 * sensor.dn_per_electron)
    assert (long[hot] >= long[~hot].max()).all()
    assert long[hot].mean() > 5 * long[~hot].mean()


@every_response
def test_the_nominal_exposure_without_gain_changes_nothing(response) -> None:
    camera = CameraSettings(chip=replace(FULL, response=response), exposure_ms=12.3)
    pattern, light = fixed_pattern((40, 40), camera.chip, np.random.default_rng(5)), flat(0.2, side=40)
    plain, stated = (
        expose_camera(light, camera, streams(1), pattern=pattern, exposure=each) for each in (None, camera.exposure)
    )
    np.testing.assert_array_equal(plain, stated)


def test_electrons_grow_with_time_and_grey_values_with_gain() -> None:
    sensor = replace(CLEAN, response="linear")
    for exposure, factor in ((Exposure(0.01), 2.0), (Exposure(0.0025), 0.5), (Exposure(0.005, gain_db=6.0), 1.9953)):
        grey = expose(flat(0.3, side=4), sensor, streams(0), exposure=exposure)
        assert grey[0, 0] == round(60 * factor)


def test_gain_makes_the_grey_of_more_time_but_not_its_quiet() -> None:
    sensor = replace(BENCH, read_noise_e=0.0)

    def variance(exposure: Exposure) -> float:
        pictures = expose(flat(0.3), sensor, streams(3), exposure=exposure).astype(float)
        return float(pictures.var() - 1 / 12)

    slow, loud = Exposure(0.01), Exposure(0.0025, gain_db=20 * np.log10(4))
    assert variance(loud) == pytest.approx(4 * variance(slow), rel=0.05)


def test_a_picture_is_that_of_its_parts_one_after_the_other() -> None:
    light = np.random.default_rng(1).random((250, 300), np.float32)
    pattern = fixed_pattern(light.shape, FULL, np.random.default_rng(2))
    noise, parts = streams(3), (slice(0, 71), slice(71, 250))
    piecewise = [expose(light[rows], FULL, noise, pattern=pattern.of(rows)) for rows in parts]
    np.testing.assert_array_equal(expose(light, FULL, streams(3), pattern=pattern), np.concatenate(piecewise))


def test_negative_light_or_nan_is_refused_with_its_pixel() -> None:
    for bad in (-1.0, np.nan):
        picture = flat(0.5, side=4)
        picture[1, 2] = bad
        with pytest.raises(RenderError, match=r"pixel \(2, 1\)"):
            expose(picture, CLEAN, streams(0))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"full_well_e": 0}, "full_well_e: should be greater than 0 (got 0.0)"),
        ({"read_noise_e": -1.0}, "read_noise_e: should be 0 or more (got -1.0)"),
        ({"prnu": np.nan}, "prnu: should be a finite number (got nan)"),
        ({"hot_share": 1.5}, "hot_share: should be 1 or less (got 1.5)"),
        ({"adc_bits": 9}, "adc_bits: should be 8, 10 or 12 (got 9)"),
    ],
)
def test_a_chip_that_cannot_be_is_refused(change: dict[str, float], said: str) -> None:
    with pytest.raises(SettingError) as refused:
        replace(CLEAN, **change)
    assert str(refused.value) == said


# The middles of a million equally likely slices of the normal distribution: a sample without chance.
EVEN = ndtri((np.arange(1_000_000) + 0.5) / 1_000_000)
MEANS = [0.01, 0.3, 2.0, 9.99, EXPANSION_FROM, 15.0, 40.0, 300.0, 5000.0, 40_000.0]


def counts_of(mean: float) -> np.ndarray:
    return poisson(np.full(len(EVEN), mean), EVEN)


@pytest.mark.parametrize("mean", MEANS)
def test_counts_are_distributed_as_poisson_says(mean: float) -> None:
    counts = counts_of(mean).astype(int)
    support = np.arange(counts.max() + 1)
    share = np.bincount(counts) / len(counts)
    exact = stats.poisson.pmf(support, mean)
    # A slice that straddles two counts goes to one of them: half a slice a count, on average.
    slices = np.ptp(counts) / len(counts)
    assert np.abs(share - exact).sum() / 2 < (6e-4 if mean >= EXPANSION_FROM else 1e-6) + slices
    assert counts.min() >= 0


@pytest.mark.parametrize("mean", MEANS)
def test_mean_and_variance_are_both_the_mean(mean: float) -> None:
    counts = counts_of(mean)
    assert counts.mean() == pytest.approx(mean, rel=3e-5)
    assert counts.var() == pytest.approx(mean, rel=3e-4)


@pytest.mark.parametrize("mean", [0.3, 9.99, 40.0, 5000.0])
def test_a_million_random_counts_pass_for_poisson(mean: float) -> None:
    counts = poisson(np.full(1_000_000, mean), np.random.default_rng(7).standard_normal(1_000_000))
    low, high = (int(stats.poisson.ppf(q, mean)) for q in (1e-4, 1 - 1e-4))
    seen = np.bincount(np.clip(counts, low, high).astype(int), minlength=high + 1)[low:]
    expected = stats.poisson.pmf(np.arange(low, high + 1), mean)
    expected[0], expected[-1] = stats.poisson.cdf(low, mean), stats.poisson.sf(high - 1, mean)
    assert stats.chisquare(seen, expected / expected.sum() * len(counts)).pvalue > 1e-3


@pytest.mark.parametrize("mean", [2.0, 9.99, 40.0, 5000.0])
def test_a_higher_draw_never_gives_fewer_electrons(mean: float) -> None:
    assert (np.diff(counts_of(mean)) >= 0).all()


def test_the_two_ways_meet() -> None:
    draws = EVEN[::10]
    below, above = (poisson(np.full(len(draws), mean), draws) for mean in (EXPANSION_FROM - 1e-9, EXPANSION_FROM))
    assert np.abs(below - above).max() <= 1
    assert (below != above).mean() < 4e-3


def test_each_pixel_has_its_own_mean() -> None:
    means = np.array([[0.0, 3.0], [30.0, 3e4]])
    draws = np.random.default_rng(1).standard_normal((20_000, 2, 2))
    counts = poisson(np.broadcast_to(means, draws.shape).copy(), draws)
    np.testing.assert_allclose(counts.mean(0), means, atol=5 * np.sqrt(means.max() / 20_000), rtol=0.02)
    assert (counts[:, 0, 0] == 0).all()


@pytest.mark.parametrize("bits", [8, 10, 12])
def test_a_converter_in_colour_has_two_to_the_power_of_its_bits_counts(bits: int) -> None:
    chip = CameraSensor(response="linear", adc_bits=bits)  # type: ignore[arg-type]
    signals = np.unique(image_sensor._digital(np.linspace(0, 1, 60_000), chip))
    np.testing.assert_allclose(signals, np.arange(2**bits) / (2**bits - 1))


@pytest.mark.parametrize("bits", [8, 10, 12])
def test_grey_values_change_where_the_converter_counts_on(bits: int) -> None:
    chip = CameraSensor(response="linear", adc_bits=bits)  # type: ignore[arg-type]
    largest = 2**bits - 1
    signal = np.linspace(0, 1, 60_000)
    counts = np.floor(signal * largest + 0.5)
    grey = image_sensor._grey(signal.copy(), chip)
    np.testing.assert_array_equal(grey, np.floor(255 * counts / largest + 0.5))
