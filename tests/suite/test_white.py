"""White follows from what cameras see: most of it is exposed well, and windows and lamps may be brighter."""

import numpy as np
import pytest

from vobench.sensor.image_sensor import CAMERAS, CameraSettings, NoiseStreams, expose, fixed_pattern
from vobench.suite.scene_spec import SceneFile
from vobench.suite.white import (
    BLACK,
    BLACK_DN,
    LENS,
    SATURATED,
    SATURATED_DN,
    ExposedShares,
    Remedy,
    doubt_sentence,
    exposed_shares,
    fitting_white_cd_m2,
    white_of,
)

SURFACES = np.random.default_rng(0).lognormal(np.log(20), 0.7, 4000)  # cd/m²
NO_SOURCE = np.zeros(4000, bool)


def with_window(share: float, luminance_cd_m2: float):
    """Luminances of which a share shows a window, and which of them do."""
    count = round(share * len(SURFACES))
    is_source = np.arange(len(SURFACES)) < count
    return np.where(is_source, luminance_cd_m2, SURFACES), is_source


@pytest.mark.parametrize("factor", [1e-3, 2.0, 1e4])
def test_a_scene_with_so_many_times_the_light_has_so_many_times_the_white(factor: float) -> None:
    once = fitting_white_cd_m2(SURFACES, NO_SOURCE)
    assert fitting_white_cd_m2(factor * SURFACES, NO_SOURCE) == pytest.approx(factor * once, rel=0.01)


def test_white_is_a_high_percentile_of_the_surfaces() -> None:
    white_cd_m2 = fitting_white_cd_m2(SURFACES, NO_SOURCE)
    assert white_cd_m2 == pytest.approx(np.percentile(SURFACES, 95), rel=0.01)
    shares = exposed_shares(SURFACES, white_cd_m2)
    assert shares.saturated < 0.05
    assert shares.black < 0.2


@pytest.mark.parametrize("share", [0.02, 0.1, 0.18])
def test_a_window_burns_and_does_not_darken_the_room(share: float) -> None:
    luminance_cd_m2, is_source = with_window(share, 50_000.0)
    white_cd_m2 = fitting_white_cd_m2(luminance_cd_m2, is_source)
    assert white_cd_m2 == pytest.approx(fitting_white_cd_m2(SURFACES, NO_SOURCE), rel=0.05)


def test_a_sky_that_is_a_little_too_bright_is_exposed_for() -> None:
    surfaces_cd_m2 = fitting_white_cd_m2(SURFACES, NO_SOURCE)
    luminance_cd_m2, is_source = with_window(0.4, 2.5 * surfaces_cd_m2)
    white_cd_m2 = fitting_white_cd_m2(luminance_cd_m2, is_source)
    assert white_cd_m2 > surfaces_cd_m2
    assert exposed_shares(luminance_cd_m2, white_cd_m2).saturated < 0.05


def test_a_sunny_patch_in_a_dark_place_is_given_up_for_the_dark() -> None:
    """6 % in the sun are 1,000 times as bright as the rest, which would be black."""
    luminance_cd_m2 = np.where(np.arange(4000) < 240, 1000.0, 1.0)
    white_cd_m2 = fitting_white_cd_m2(luminance_cd_m2, NO_SOURCE)
    assert exposed_shares(luminance_cd_m2, white_cd_m2).black == 0
    assert exposed_shares(luminance_cd_m2, white_cd_m2).saturated == pytest.approx(0.06)


def test_a_dark_scene_and_one_of_lamps_only_have_a_white() -> None:
    assert fitting_white_cd_m2(np.zeros(10), np.zeros(10, bool)) == 1
    assert fitting_white_cd_m2(np.full(10, 30.0), np.ones(10, bool)) == 30


def test_the_thresholds_are_those_of_the_usual_camera() -> None:
    camera = CameraSettings(chip=CAMERAS["clean"])
    pattern = fixed_pattern((1, 4), camera.chip, np.random.default_rng(0))
    noise = NoiseStreams(np.random.default_rng(0), np.random.default_rng(1))
    relative = np.array([[0.98 * SATURATED, 1.02 * SATURATED, 0.9 * BLACK, 1.1 * BLACK]], np.float32)
    grey = expose(relative, camera, noise, pattern=pattern)[0]
    assert grey[0] < SATURATED_DN <= grey[1]
    assert grey[2] <= BLACK_DN < grey[3]


def test_a_stated_white_is_kept_and_a_scene_without_needs_its_light() -> None:
    assert white_of(SceneFile(name="a", maker="a.py", white_cd_m2=7.0), None) == 7
    with pytest.raises(ValueError, match="needs its light"):
        white_of(SceneFile(name="a", maker="a.py"), None)


def test_the_small_pictures_have_square_pixels_and_look_92_by_66_degrees_around_their_axes() -> None:
    edges_px = np.array([[-0.5, 9.5], [31.5, 9.5], [15.5, -0.5], [15.5, 19.5]])
    left, right, top, bottom = LENS.rays(edges_px)
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(92, abs=0.5)
    assert np.degrees(np.arccos(top @ bottom)) == pytest.approx(66, abs=0.5)
    assert left + right == pytest.approx([0, 0, left[2] + right[2]])
    assert top + bottom == pytest.approx([0, 0, top[2] + bottom[2]])
    columns, rows = LENS.project(LENS.rays([[15.5, 9.5], [16.5, 10.5]])).T
    assert np.diff(columns) == pytest.approx(np.diff(rows))


def sentence(remedy: Remedy, luminance_cd_m2=SURFACES, is_source=NO_SOURCE) -> str:
    shares = exposed_shares(luminance_cd_m2, remedy.effective_white_cd_m2)
    assert shares.is_doubtful
    return doubt_sentence(shares, luminance_cd_m2, is_source, remedy)


def test_a_doubt_names_the_key_and_a_value_that_ends_it() -> None:
    said = sentence(Remedy(white_cd_m2=5.0))
    assert "of the pixels are saturated and 0% black; raise white_cd_m2 of the scene from 5 to about" in said
    suggested_cd_m2 = float(said.split()[-1])
    assert not exposed_shares(SURFACES, suggested_cd_m2).is_doubtful
    assert "lower white_cd_m2 of the scene from 1e+05 to about" in sentence(Remedy(white_cd_m2=1e5))


def test_a_doubt_about_a_camera_counts_all_of_its_gain() -> None:
    remedy = Remedy(white_cd_m2=60.0, exposure_gain=2.0, amplification=4.0, changes_white=False)
    said = sentence(remedy)
    assert "lower exposure_gain of the camera from 2 to about" in said
    gain = float(said.split(",")[0].split()[-1])
    assert not exposed_shares(SURFACES, 60.0 / (gain * 4.0)).is_doubtful


def test_a_doubt_that_no_exposure_ends_asks_for_light() -> None:
    luminance_cd_m2 = np.where(np.arange(4000) < 1200, 0.0, 20.0)
    assert "light the dark parts of the scene" in sentence(Remedy(white_cd_m2=20.0), luminance_cd_m2)


def test_a_good_exposure_is_not_doubted() -> None:
    assert not ExposedShares(0.2, 0.2).is_doubtful
    assert ExposedShares(0.21, 0.0).is_doubtful
    assert ExposedShares(0.0, 0.21).is_doubtful
