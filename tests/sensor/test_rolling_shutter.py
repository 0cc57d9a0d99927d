"""Strips tile the picture, parts tile the exposure, and rows are as late as the readout says."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import curve_fit

from vobench.errors import InputError
from vobench.geometry.se3 import Array
from vobench.scene.light import Flicker
from vobench.sensor.rolling_shutter import RowStrip, row_stamps, row_strips

GLOBAL = 0.0
HEIGHT, WIDTH = 480, 720
cuts = pytest.mark.parametrize(("strip_count", "sub_frames"), [(1, 1), (7, 3), (48, 13), (479, 2), (480, 1)])


@cuts
def test_strips_tile_the_picture_and_parts_the_exposure(strip_count: int, sub_frames: int) -> None:
    exposure_s, t_ns = 0.0100000037, 123_456_789_012_345_679
    cut = row_strips(
        HEIGHT, readout_s=0.0271234, t_ns=t_ns, exposure_s=exposure_s, strip_count=strip_count, sub_frames=sub_frames
    )
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
def test_the_stamp_is_the_middle_of_the_middle_row(strip_count: int, sub_frames: int) -> None:
    cut = row_strips(
        HEIGHT, readout_s=0.02, t_ns=5_000_000_000, exposure_s=0.004, strip_count=strip_count, sub_frames=sub_frames
    )
    late = np.array([middle_ns(strip) for strip in cut]) - 5_000_000_000
    centre = np.array([(strip.rows.start + strip.rows.stop - 1) / 2 for strip in cut])
    np.testing.assert_allclose(late, (centre - 239.5) * 20e6 / HEIGHT, atol=0.5)


def test_rows_below_the_middle_are_as_late_as_those_above_are_early() -> None:
    cut = row_strips(HEIGHT, readout_s=0.0203777, t_ns=0, exposure_s=0.004, strip_count=HEIGHT, sub_frames=1)
    late = np.array([middle_ns(strip) for strip in cut])
    np.testing.assert_array_equal(late[::-1], -late)


def test_the_middles_of_the_parts_average_to_the_middle_of_the_exposure() -> None:
    (strip,) = row_strips(HEIGHT, readout_s=GLOBAL, t_ns=1_000_000_000, exposure_s=0.008, strip_count=1, sub_frames=16)
    assert strip.mid_ns.mean() == 1_000_000_000
    assert (strip.start_ns < strip.mid_ns).all()
    assert (strip.mid_ns < strip.end_ns).all()


def test_a_global_shutter_is_one_strip_around_its_stamp() -> None:
    (strip,) = row_strips(HEIGHT, readout_s=GLOBAL, t_ns=0, exposure_s=0.01, strip_count=16, sub_frames=1)
    assert (strip.rows, strip.start_ns.tolist(), strip.end_ns.tolist()) == (slice(0, HEIGHT), [-5_000_000], [5_000_000])


def test_a_rolling_shutter_that_takes_no_time_is_a_global_one() -> None:
    for strip in row_strips(HEIGHT, readout_s=0.0, t_ns=7, exposure_s=0.01, strip_count=8, sub_frames=4):
        (whole,) = row_strips(HEIGHT, readout_s=GLOBAL, t_ns=7, exposure_s=0.01, strip_count=1, sub_frames=4)
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
    cut = row_strips(
        HEIGHT, readout_s=GLOBAL, t_ns=0, exposure_s=exposure_s, strip_count=1, sub_frames=math.ceil(moved_px)
    )
    spread = np.diff(picture(edge(speed_px_per_s), cut)[0])
    columns = np.arange(len(spread))
    variance = spread @ columns**2 - (spread @ columns) ** 2
    # A box of that width, seen through pixels that are boxes of width 1.
    assert np.sqrt(12 * variance - 1) == pytest.approx(moved_px, rel=0.03)
    assert spread.sum() == pytest.approx(1)


@pytest.mark.parametrize("strip_count", [24, 48, 480])
def test_a_rolling_shutter_leans_a_moving_edge_by_speed_times_line_delay(strip_count: int) -> None:
    speed, readout_s = 900.0, 0.03
    cut = row_strips(HEIGHT, readout_s=readout_s, t_ns=0, exposure_s=0.001, strip_count=strip_count, sub_frames=1)
    position = WIDTH - 0.5 - picture(edge(speed), cut).sum(1)
    lean = np.polyfit(np.arange(HEIGHT), position, 1)[0]
    assert lean == pytest.approx(speed * readout_s / HEIGHT, rel=0.01)
    assert position.mean() == pytest.approx(360.3, abs=0.05)


def bands(flicker_hz: float, readout_s: float, exposure_s: float) -> Array:
    """Brightness (H,) of the rows of an even wall under a lamp that flickers, over each row's exposure."""
    lamp = Flicker(mains_hz=flicker_hz / 2, depth=0.4, phase_deg=40.0)
    cut = row_strips(HEIGHT, readout_s=readout_s, t_ns=0, exposure_s=exposure_s, strip_count=HEIGHT, sub_frames=1)
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
    ("exposure_s", "strip_count", "sub_frames", "said"),
    [
        (1e-9, 1, 2, "an exposure of 1 ns cannot be divided into 2 sub-frames"),
        (0.01, 1, 0, "cannot be divided into 0 sub-frames"),
        (0.01, 0, 1, "480 rows cannot be divided into 0 strips"),
        (0.01, 481, 1, "480 rows cannot be divided into 481 strips"),
    ],
)
def test_cuts_that_cannot_be_are_refused(exposure_s: float, strip_count: int, sub_frames: int, said: str) -> None:
    with pytest.raises(InputError, match=said):
        row_strips(
            HEIGHT, readout_s=0.01, t_ns=0, exposure_s=exposure_s, strip_count=strip_count, sub_frames=sub_frames
        )


@pytest.mark.parametrize("height", [1, 4, 5])
def test_rows_are_stamped_from_the_top_down_one_line_after_another(height: int) -> None:
    stamps = row_stamps(height, readout_s=0.02, t_ns=10**9)
    assert stamps[0] == 10**9 - round(0.02e9 * (height - 1) / height / 2)
    np.testing.assert_allclose(np.diff(stamps), 0.02e9 / height, atol=1)
