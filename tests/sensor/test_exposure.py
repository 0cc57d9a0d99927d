"""Auto-exposure finds its target within ten pictures from far off, without swinging, and keeps its limits."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import curve_fit

from vobench.errors import InputError, SettingError
from vobench.geometry.se3 import Array
from vobench.scene.light import Flicker
from vobench.sensor.exposure import (
    AutoExposure,
    Exposure,
    RowStrip,
    initial_exposures,
    next_exposures,
    row_stamps,
    strips,
)
from vobench.sensor.image_sensor import CAMERAS, CameraSensor, CameraSettings, NoiseStreams, Radiance, expose

FREE = AutoExposure(t_min_ms=1e-3, t_max_ms=1e4)
RNG = np.random.default_rng(0)
SCENES: dict[str, Radiance] = {
    "texture": np.exp(RNG.normal(-1.4, 0.7, (60, 80))).astype(np.float32),
    "even": np.full((60, 80), 0.3, np.float32),
    "window": np.where(np.arange(80) < 20, 30.0, 0.1 + 0.1 * RNG.random((60, 80))).astype(np.float32),
}


def levels(loop: AutoExposure, chip: CameraSensor, scene: Radiance, first: Exposure, pictures: int) -> Array:
    """Time × gain of each picture."""
    state, noise, taken = initial_exposures(loop, first), NoiseStreams(*np.random.default_rng(1).spawn(2)), []
    for _ in range(pictures):
        taken.append(state[0].time_s * state[0].amplification)
        state = next_exposures(
            loop, state, expose(scene, CameraSettings(chip=chip), noise, exposure=state[0]), chip.signal_of_grey
        )
    return np.array(taken)


@pytest.mark.parametrize(
    ("scene", "percentile"), [("texture", None), ("even", None), ("texture", 60.0), ("window", 60.0)]
)
@pytest.mark.parametrize("sensor", ["clean", "mt9v034"])
@pytest.mark.parametrize("response", ["linear", "srgb"])
@pytest.mark.parametrize("lag_frames", [1, 2, 3])
def test_it_settles_within_ten_pictures_from_sixteen_times_wrong_and_never_swings(
    scene: str, sensor: str, response: str, percentile: float | None, lag_frames: int
) -> None:
    chip = replace(CAMERAS[sensor], response=response)
    loop = replace(FREE, percentile=percentile, lag_frames=lag_frames)
    right = levels(loop, chip, SCENES[scene], Exposure(0.005), 40)[-1]
    for wrong in (16.0, 1 / 16):
        course = levels(loop, chip, SCENES[scene], Exposure(right * wrong), 40) / right
        assert np.abs(np.log(course[10:])).max() < 0.06
        moves = np.sign(np.diff(course))
        # A last correction may come back from the other side, by no more than the dead band.
        assert (moves * np.sign(np.log(wrong)) > 0).sum() <= 1
        assert np.ptp(course[15:]) == 0


def test_the_mean_of_a_picture_that_is_burnt_out_in_part_takes_longer_and_does_not_swing_either() -> None:
    # The burnt quarter says only that it is too bright, and stays white for long.
    course = levels(FREE, CAMERAS["clean"], SCENES["window"], Exposure(0.02), 40)
    assert np.abs(np.log(course[25:] / course[-1])).max() < 0.06
    assert (np.diff(course) <= 0).all()


def test_a_settled_picture_has_the_target_as_its_mean() -> None:
    chip, scene = CAMERAS["clean"], SCENES["texture"]
    level_s = levels(FREE, chip, scene, Exposure(0.02), 30)[-1]
    grey = expose(scene, CameraSettings(chip=chip), NoiseStreams(RNG, RNG), exposure=Exposure(float(level_s)))
    assert chip.signal_of_grey[grey].mean() == pytest.approx(FREE.target_share, rel=0.03)


def test_a_picture_changes_the_exposure_lag_frames_later_and_not_before() -> None:
    for lag_frames in (1, 2, 4):
        course = levels(replace(FREE, lag_frames=lag_frames), CAMERAS["clean"], SCENES["even"], Exposure(1e-3), 6)
        assert np.ptp(course[:lag_frames]) == 0
        assert course[lag_frames] > 1.5 * course[0]


def test_damping_is_the_share_of_the_error_that_a_picture_leaves() -> None:
    chip, scene = CAMERAS["clean"], SCENES["even"]
    right = levels(replace(FREE, damping=0.0), chip, scene, Exposure(0.004), 30)[-1]
    course = levels(replace(FREE, damping=0.6, lag_frames=1), chip, scene, Exposure(float(right / 2)), 4)
    np.testing.assert_allclose(np.log(course / right)[:3], np.log(0.5) * 0.6 ** np.arange(3), rtol=0.1)


def test_time_comes_before_gain_and_both_keep_their_limits() -> None:
    loop, chip = AutoExposure(t_min_ms=1.0, t_max_ms=8.0, gain_max_db=12.0), CAMERAS["clean"]
    noise, seen = NoiseStreams(RNG, RNG), []
    for level in (1e-6, 0.02, 0.05, 0.1, 0.3, 1.0, 1e3):
        state, scene = initial_exposures(loop, Exposure(0.005)), np.full((8, 8), level, np.float32)
        for _ in range(30):
            state = next_exposures(
                loop, state, expose(scene, CameraSettings(chip=chip), noise, exposure=state[0]), chip.signal_of_grey
            )
        seen.append(state[0])
    # The dead band may end a little before the limits.
    assert seen[0].gain_db == pytest.approx(12.0, abs=0.2)
    assert seen[-1].time_s == pytest.approx(1e-3, rel=0.02)
    assert seen[-1].gain_db == 0
    assert any(0 < exposure.gain_db < 12 for exposure in seen)
    assert all(exposure.time_s == 8e-3 for exposure in seen if exposure.gain_db > 0)
    assert all(1e-3 <= exposure.time_s <= 8e-3 for exposure in seen)


def test_a_start_beyond_the_limits_is_brought_within() -> None:
    loop = AutoExposure(t_max_ms=8.0, gain_max_db=6.0)
    assert initial_exposures(loop, Exposure(1.0))[0] == Exposure(8e-3, 6.0)
    assert initial_exposures(loop, Exposure(1e-6))[0] == Exposure(loop.t_min_ms / 1e3)


def test_the_percentile_meters_the_share_of_pixels_it_says() -> None:
    scene = np.where(np.arange(100) < 30, 0.5, 0.05)[None].repeat(50, 0).astype(np.float32)
    chip = replace(CAMERAS["clean"], response="linear")
    dark, bright = (
        levels(replace(FREE, percentile=percentile), chip, scene, Exposure(0.005), 30)[-1] for percentile in (50, 85)
    )
    assert dark / bright == pytest.approx(10, rel=0.1)


def test_a_raised_black_level_does_not_fool_it() -> None:
    plain = replace(CAMERAS["clean"], response="linear")
    level = [levels(FREE, replace(plain, black_dn=b), SCENES["even"], Exposure(0.005), 30)[-1] for b in (0.0, 30.0)]
    assert level[0] == pytest.approx(level[1], rel=0.05)


def test_gain_is_a_factor_of_ten_for_twenty_decibels() -> None:
    assert Exposure(1.0, 20.0).amplification == pytest.approx(10)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"target_share": 1.0}, "target_share: should be less than 1 (got 1.0)"),
        ({"percentile": 0}, "percentile: should be greater than 0 (got 0.0)"),
        ({"lag_frames": 0}, "lag_frames: should be 1 or more (got 0)"),
        ({"damping": 1}, "damping: should be less than 1 (got 1.0)"),
        ({"t_min_ms": 1000}, "t_min_ms: should be at most t_max_ms, but is 1000 against 20"),
        ({"gain_max_db": -1}, "gain_max_db: should be 0 or more (got -1.0)"),
        ({"gain_max_db": np.nan}, "gain_max_db: should be a finite number (got nan)"),
    ],
)
def test_settings_that_cannot_be_are_refused(change: dict[str, float], said: str) -> None:
    with pytest.raises(SettingError) as refused:
        AutoExposure(**change)
    assert str(refused.value) == said


def test_an_exposure_lasts_and_does_not_weaken() -> None:
    with pytest.raises(SettingError, match="time_s: should be greater than 0"):
        Exposure(0)
    for gain_db in (-6.0, np.nan):
        with pytest.raises(SettingError, match="gain_db: should be"):
            Exposure(0.01, gain_db)


GLOBAL = 0.0
HEIGHT, WIDTH = 480, 720
cuts = pytest.mark.parametrize(("row_strips", "sub_frames"), [(1, 1), (7, 3), (48, 13), (479, 2), (480, 1)])


@cuts
def test_strips_tile_the_picture_and_parts_the_exposure(row_strips: int, sub_frames: int) -> None:
    exposure_s, t_ns = 0.0100000037, 123_456_789_012_345_679
    cut = strips(HEIGHT, 0.0271234, t_ns, exposure_s, row_strips=row_strips, sub_frames=sub_frames)
    rows = np.concatenate([np.arange(HEIGHT)[strip.rows] for strip in cut])
    np.testing.assert_array_equal(rows, np.arange(HEIGHT))
    for strip in cut:
        assert strip.start_ns.dtype == strip.end_ns.dtype == np.int64
        np.testing.assert_array_equal(strip.start_ns[1:], strip.end_ns[:-1])
        assert strip.end_ns[-1] - strip.start_ns[0] == 10_000_004
        assert np.ptp(strip.end_ns - strip.start_ns) <= 1


def middle_ns(strip: RowStrip) -> float:
    return (int(strip.start_ns[0]) + int(strip.end_ns[-1])) / 2


@cuts
def test_the_stamp_is_the_middle_of_the_middle_row(row_strips: int, sub_frames: int) -> None:
    cut = strips(HEIGHT, 0.02, 5_000_000_000, 0.004, row_strips=row_strips, sub_frames=sub_frames)
    late = np.array([middle_ns(strip) for strip in cut]) - 5_000_000_000
    centre = np.array([(strip.rows.start + strip.rows.stop - 1) / 2 for strip in cut])
    np.testing.assert_allclose(late, (centre - 239.5) * 20e6 / HEIGHT, atol=0.5)


def test_rows_below_the_middle_are_as_late_as_those_above_are_early() -> None:
    cut = strips(HEIGHT, 0.0203777, 0, 0.004, row_strips=HEIGHT, sub_frames=1)
    late = np.array([middle_ns(strip) for strip in cut])
    np.testing.assert_array_equal(late[::-1], -late)


def test_the_middles_of_the_parts_average_to_the_middle_of_the_exposure() -> None:
    (strip,) = strips(HEIGHT, GLOBAL, 1_000_000_000, 0.008, row_strips=1, sub_frames=16)
    assert strip.mid_ns.mean() == 1_000_000_000
    assert (strip.start_ns < strip.mid_ns).all()
    assert (strip.mid_ns < strip.end_ns).all()


def test_a_global_shutter_is_one_strip_around_its_stamp() -> None:
    (strip,) = strips(HEIGHT, GLOBAL, 0, 0.01, row_strips=16, sub_frames=1)
    assert (strip.rows, strip.start_ns.tolist(), strip.end_ns.tolist()) == (slice(0, HEIGHT), [-5_000_000], [5_000_000])


def test_a_rolling_shutter_that_takes_no_time_is_a_global_one() -> None:
    for strip in strips(HEIGHT, 0.0, 7, 0.01, row_strips=8, sub_frames=4):
        (whole,) = strips(HEIGHT, GLOBAL, 7, 0.01, row_strips=1, sub_frames=4)
        np.testing.assert_array_equal(strip.start_ns, whole.start_ns)


def picture(scene: Callable[[float], Array], cut: list[RowStrip]) -> Array:
    """What a camera keeps of a moving scene: per strip the mean over its parts."""
    kept = np.empty((HEIGHT, WIDTH))
    for strip in cut:
        kept[strip.rows] = np.mean([scene(int(t_ns) / 1e9) for t_ns in strip.mid_ns], axis=0)
    return kept


def edge(speed_px_per_s: float) -> Callable[[float], Array]:
    """Columns (W,) of a picture that is white right of an edge; a pixel holds the share of its area."""
    return lambda t_s: np.clip(np.arange(WIDTH) + 0.5 - (360.3 + speed_px_per_s * t_s), 0.0, 1.0)


@pytest.mark.parametrize(("speed_px_per_s", "exposure_s"), [(1260.0, 0.01), (300.0, 0.033), (5000.0, 0.005)])
def test_a_moving_edge_is_blurred_over_speed_times_exposure(speed_px_per_s: float, exposure_s: float) -> None:
    moved_px = speed_px_per_s * exposure_s
    cut = strips(HEIGHT, GLOBAL, 0, exposure_s, row_strips=1, sub_frames=int(np.ceil(moved_px)))
    spread = np.diff(picture(edge(speed_px_per_s), cut)[0])
    columns = np.arange(len(spread))
    variance = spread @ columns**2 - (spread @ columns) ** 2
    # A box of that width, seen through pixels that are boxes of width 1.
    assert np.sqrt(12 * variance - 1) == pytest.approx(moved_px, rel=0.03)
    assert spread.sum() == pytest.approx(1)


@pytest.mark.parametrize("row_strips", [24, 48, 480])
def test_a_rolling_shutter_leans_a_moving_edge_by_speed_times_line_delay(row_strips: int) -> None:
    speed, readout_s = 900.0, 0.03
    cut = strips(HEIGHT, readout_s, 0, 0.001, row_strips=row_strips, sub_frames=1)
    position = WIDTH - 0.5 - picture(edge(speed), cut).sum(1)
    lean = np.polyfit(np.arange(HEIGHT), position, 1)[0]
    assert lean == pytest.approx(speed * readout_s / HEIGHT, rel=0.01)
    assert position.mean() == pytest.approx(360.3, abs=0.05)


def bands(flicker_hz: float, readout_s: float, exposure_s: float) -> Array:
    """Brightness (H,) of the rows of an even wall under a lamp that flickers, over each row's exposure."""
    lamp = Flicker(mains_hz=flicker_hz / 2, depth=0.4, phase_deg=40.0)
    cut = strips(HEIGHT, readout_s, 0, exposure_s, row_strips=HEIGHT, sub_frames=1)
    return np.array([lamp.mean(int(strip.start_ns[0]), int(strip.end_ns[0])) for strip in cut])


@pytest.mark.parametrize(("flicker_hz", "readout_s"), [(100.0, 0.03), (120.0, 0.02), (100.0, 0.0143)])
def test_flicker_makes_bands_as_far_apart_as_rows_read_in_a_period(flicker_hz: float, readout_s: float) -> None:
    rows, seen = np.arange(HEIGHT), bands(flicker_hz, readout_s, 0.002)
    pitch = HEIGHT / (readout_s * flicker_hz)

    def wave(v: Array, period: float, depth: float, phase: float) -> Array:
        return 1 + depth * np.cos(2 * np.pi * v / period + phase)

    (period, depth, _), _ = curve_fit(wave, rows, seen, p0=(1.1 * pitch, 0.3, 0.0))
    assert period == pytest.approx(pitch, rel=1e-3)
    assert abs(depth) == pytest.approx(0.4 * np.sinc(flicker_hz * 0.002), rel=1e-3)


def test_an_exposure_of_a_whole_period_has_no_bands() -> None:
    assert np.ptp(bands(100.0, 0.03, 0.01)) < 1e-6


@pytest.mark.parametrize(
    ("exposure_s", "row_strips", "sub_frames", "said"),
    [
        (1e-9, 1, 2, "an exposure of 1 ns cannot be divided into 2 sub-frames"),
        (0.01, 1, 0, "cannot be divided into 0 sub-frames"),
        (0.01, 0, 1, "480 rows cannot be divided into 0 strips"),
        (0.01, 481, 1, "480 rows cannot be divided into 481 strips"),
    ],
)
def test_cuts_that_cannot_be_are_refused(exposure_s: float, row_strips: int, sub_frames: int, said: str) -> None:
    with pytest.raises(InputError, match=said):
        strips(HEIGHT, 0.01, 0, exposure_s, row_strips=row_strips, sub_frames=sub_frames)


@pytest.mark.parametrize("height", [1, 4, 5])
def test_rows_are_stamped_from_the_top_down_one_line_after_another(height: int) -> None:
    stamps = row_stamps(height, 0.02, 10**9)
    assert stamps[0] == 10**9 - round(0.02e9 * (height - 1) / height / 2)
    np.testing.assert_allclose(np.diff(stamps), 0.02e9 / height, atol=1)
