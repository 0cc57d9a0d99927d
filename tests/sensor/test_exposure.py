"""Auto-exposure finds its target within ten pictures from far off, without swinging, and keeps its limits."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import SettingError
from vobench.geometry.se3 import Array
from vobench.sensor.exposure import (
    AutoExposure,
    Exposure,
    initial_exposures,
    next_exposures,
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
