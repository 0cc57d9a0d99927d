"""Statistics of recordings that were made with known ones, and what is said about them."""

from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest
from pydantic import TypeAdapter

from tests.analysis.test_image_noise import as_grey, boards
from tests.analysis.test_stereo_fit import MOVING_SHOTS
from tests.analysis.test_stereo_fit import RIG as PAINTED_RIG
from tests.analysis.test_stereo_fit import shots as painted_shots
from vobench.analysis.image_statistics import gradients, picture_statistics, spectrum, track_statistics
from vobench.analysis.pair_parameter import ROLL
from vobench.analysis.realism import (
    STATISTICS,
    WINDOW,
    FrameSample,
    Realism,
    all_errors,
    measure,
    pair_sentences,
    residual,
    shots_of,
    side_effects,
    window_starts,
)
from vobench.analysis.stereo_fit import StereoFit, Uncertain, fit_pair
from vobench.analysis.stereo_matches import Matches
from vobench.errors import InputError
from vobench.estimator.stereo import stereo_pair
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import CalibrationError, CameraError, stereo_rig, true_rig
from vobench.runner.recording import read_recording
from vobench.sensor.image_sensor import CAMERAS, CameraSettings, NoiseStreams, expose

RIG = stereo_rig(Pinhole(320, 240, 300.0, 300.0, 159.5, 119.5), pitch_deg=0)


def test_runs_of_pictures_lie_apart_and_within_the_recording():
    for count in (2, 13, 14, 30, 42, 500):
        starts = window_starts(count)
        assert all(later - earlier >= WINDOW for earlier, later in pairwise(starts))
        assert starts[0] == 0
        assert starts[-1] + WINDOW <= max(count, WINDOW)
    with pytest.raises(InputError, match="2 successive images"):
        window_starts(1)


def test_one_eye_has_no_statistics_of_a_pair_and_a_sentence():
    picture = as_grey(boards())
    found = measure([[FrameSample(picture, None)] * 3], RIG)
    expected = [s.name for s in STATISTICS if s.name not in ("row_error_px", "tracks_home", "track_life")]
    assert list(found.values) == expected  # the camera is at rest
    assert pair_sentences(found)[0].startswith("There is no stereo pair to judge")


def test_a_statistic_says_what_brings_it_into_its_band():
    burnt = STATISTICS[-1]
    assert burnt.knob("in") == ""
    assert burnt.knob("low").startswith("more exposure_gain")
    assert burnt.knob("high").startswith("less exposure_gain")


# --- The nine statistics ---


def run(*images: np.ndarray) -> list[FrameSample]:
    return [FrameSample(image, None) for image in images]


def flat(grey: int) -> np.ndarray:
    return np.full((240, 320), grey, np.uint8)


def test_statistics_of_images_are_means_over_the_images_of_all_runs() -> None:
    images = [as_grey(boards()), as_grey(boards(sigma_px=2.0)), flat(255)]
    found = measure([run(images[0], images[1]), run(images[2])], RIG)
    of_images = [picture_statistics(image) for image in images]
    for name in ("gradient_p99", "gradient_kurtosis", "corner_unevenness", "grey_sd", "burnt"):
        assert found.values[name] == pytest.approx(np.mean([each[name] for each in of_images])), name
    for name in ("grey_mean", "noise_dn", "edge_px", "corners"):
        assert found.also[name] == pytest.approx(np.mean([each[name] for each in of_images])), name
    assert found.values["burnt"] == pytest.approx(100 / 3)
    assert found.pictures == 3


def panned(count: int) -> list[np.ndarray]:
    """Images of a camera that turns by a pixel from image to image."""
    texture = as_grey(boards())
    return [np.roll(texture, -shift, axis=1) for shift in range(count)]


def test_a_camera_at_rest_has_no_statistics_of_tracks() -> None:
    found = measure([run(*[as_grey(boards())] * WINDOW)], RIG)
    assert "tracks_home" not in found.values
    assert "track_life" not in found.values
    assert found.also["flow_px"] == pytest.approx(0, abs=0.01)
    moving = measure([run(*panned(WINDOW))], RIG)
    assert moving.values["tracks_home"] > 90
    assert moving.values["track_life"] > 9


def test_track_length_counts_the_images_until_the_view_is_blocked() -> None:
    found = measure([run(*panned(5), *[flat(128)] * (WINDOW - 5))], RIG)
    assert found.values["track_life"] == pytest.approx(4, abs=0.4)
    assert len(found.curves["alive"]) == WINDOW
    short = measure([run(*panned(5))], RIG)  # at most 4 images, where the range is for 13
    assert "track_life" not in short.values
    assert short.values["tracks_home"] > 90


def test_curves_count_every_pixel_of_every_image_once() -> None:
    images = [as_grey(boards()), flat(200)]
    curves = measure([run(*images)], RIG).curves
    assert curves["grey"].shape == (256,)
    assert curves["grey"].sum() == curves["gradient"].sum() == 2 * 240 * 320
    assert curves["grey"][200] == 240 * 320 + (images[0] == 200).sum()
    assert curves["gradient"].shape == (128,)
    assert curves["gradient"][0] == sum((gradients(image) < 1).sum() for image in images)
    assert curves["power"].shape == (128,)


# --- Runs of a recording ---


def test_long_recordings_have_six_runs_from_the_first_image_to_the_last() -> None:
    starts = window_starts(500)
    assert len(starts) == 6
    assert (starts[0], starts[-1]) == (0, 500 - WINDOW)
    assert window_starts(3 * WINDOW) == [0, WINDOW, 2 * WINDOW]
    assert window_starts(3 * WINDOW - 1) == [0, 2 * WINDOW - 1]
    assert window_starts(WINDOW) == window_starts(2) == [0]
    assert window_starts(500, windows=1) == [0]


def test_the_runs_of_a_recording_have_its_images_and_true_poses_in_order(recorded_case) -> None:
    recording = read_recording(recorded_case)
    runs = shots_of(recording)
    starts = window_starts(recording.frame_count)
    assert [len(shots) for shots in runs] == [min(WINDOW, recording.frame_count)] * len(starts)
    every_frame = list(recording.encoded_frames())
    truth = recording.truth
    for start, shots in zip(starts, runs, strict=True):
        for frame, shot in zip(every_frame[start:], shots, strict=False):
            row = np.flatnonzero(truth.t_ns == frame.t_ns)
            expected = truth.T_world_frame[row[0]] @ recording.rig.T_body_left
            np.testing.assert_allclose(shot.T_world_left, expected, atol=1e-9)
            assert shot.right is not None
            assert shot.left.shape == shot.right.shape == (160, 240)
    assert not np.array_equal(runs[0][0].left, runs[0][1].left)


def test_outside_of_the_ground_truth_no_pose_is_known(recorded_case) -> None:
    recording = read_recording(recorded_case)
    inner = replace(recording.truth, t_ns=recording.truth.t_ns[2:5], T_world_frame=recording.truth.T_world_frame[2:5])
    (shots, *_) = shots_of(replace(recording, truth=inner))
    stamps = [frame.t_ns for frame in recording.encoded_frames()][: len(shots)]
    known = [shot.T_world_left is not None for shot in shots]
    assert known == [bool(inner.t_ns[0] <= t_ns <= inner.t_ns[-1]) for t_ns in stamps]
    assert sum(known) == 3
    assert all(shot.T_world_left is None for shot in shots_of(replace(recording, truth=None))[0])


# --- Sentences ---


def fit(**changes) -> StereoFit:
    """The fit of a pair that is right, with some changes."""
    nothing = Uncertain(0.0, 0.01)
    empty = np.zeros(0)
    matches = Matches(np.zeros((0, 2)), empty, empty, np.zeros(0, np.int64))
    perfect = StereoFit(
        focal_px=300.0,
        baseline_m=0.2,
        matches=matches,
        row_mad_px=0.2,
        row_noise_px=0.1,
        coefficients=np.zeros(5),
        roll_deg=nothing,
        pitch_deg=nothing,
        xy_px=nothing,
        gain=1.0,
        disparity_px=(1.0, 2.0, 3.0),
        yaw_deg=nothing,
        yaw_from="rows and motion",
    )
    return replace(perfect, **changes)


def sentences(pair: StereoFit | None) -> list[str]:
    return pair_sentences(Realism({}, {}, {}, pair, 1))


def test_of_a_pair_that_is_right_nothing_significant_is_said() -> None:
    (sentence,) = sentences(fit())
    assert sentence == "The disparity has no significant offset: +0.00 ± 0.05 px."
    assert residual(fit()) == {}


def test_a_yaw_is_an_offset_of_disparity() -> None:
    (sentence,) = sentences(fit(yaw_deg=Uncertain(-0.1, 0.01), yaw_from="motion"))
    assert "offset of -0.52 ± 0.05 px" in sentence
    assert "yaw of -0.100 ± 0.010° (by motion)" in sentence
    # Significant, but too small to matter.
    assert "no significant offset" in sentences(fit(yaw_deg=Uncertain(0.009, 0.0001)))[0]
    assert "cannot be determined" in sentences(fit(yaw_deg=None, yaw_from=""))[0]


def test_roll_and_pitch_are_named_where_they_are_significant_and_not_tiny() -> None:
    roll, pitch = Uncertain(0.2, 0.01), Uncertain(-0.1, 0.01)
    (_, sentence) = sentences(fit(roll_deg=roll, pitch_deg=pitch))
    assert "roll +0.200 ± 0.010° and pitch -0.100 ± 0.010°" in sentence
    assert "0.20 px" in sentence
    assert "0.10 px are left" in sentence
    (_, sentence) = sentences(fit(pitch_deg=pitch))
    assert "roll" not in sentence
    assert len(sentences(fit(roll_deg=Uncertain(0.001, 0.0001)))) == 1
    assert len(sentences(fit(roll_deg=Uncertain(0.02, 0.01)))) == 1


@pytest.fixture(scope="module")
def lens_fit() -> StereoFit:
    """The fit of a right lens with a tangential term and a shifted centre."""
    error = CalibrationError(right=CameraError(tangential=(0.0, 0.01), center_px=(1.5, 0.0)), right_roll_deg=0.1)
    found = fit_pair([painted_shots(error, MOVING_SHOTS)], stereo_pair(PAINTED_RIG, "test"))
    assert found is not None
    return found


def test_rows_and_disparities_that_no_rotation_explains_are_the_lenss(lens_fit: StereoFit) -> None:
    (sentence,) = (each for each in sentences(lens_fit) if each.startswith("No rotation of a camera explains rows"))
    assert "px × xy" in sentence
    assert sentence.endswith("the lens model or the rectification is wrong.")


def test_a_rig_with_the_errors_that_were_found_has_the_rows_and_offsets_of_the_pair(lens_fit: StereoFit) -> None:
    settings = residual(lens_fit)
    assert set(settings) >= {"right_roll_deg", "right_pitch_deg", "right_yaw_deg", "right"}
    error = TypeAdapter(CalibrationError).validate_python(settings)
    true = true_rig(PAINTED_RIG, error)
    rays = np.array([[x, y, 1.0] for x in (-0.3, 0.0, 0.3) for y in (-0.2, 0.2)])
    R_true_nominal = true.T_body_right[:3, :3].T @ PAINTED_RIG.T_body_right[:3, :3]
    shift_px = true.right.project(rays @ R_true_nominal.T) - PAINTED_RIG.right.project(rays)
    x, y, _ = rays.T
    expected_x_px = 1.5 + 300 * 0.01 * (3 * x * x + y * y) + 300 * np.deg2rad(0.1) * y
    expected_y_px = 300 * 2 * 0.01 * x * y - 300 * np.deg2rad(0.1) * x
    np.testing.assert_allclose(shift_px[:, 0], expected_x_px, atol=0.25)
    np.testing.assert_allclose(shift_px[:, 1], expected_y_px, atol=0.05)


def test_drawn_errors_spread_about_the_fitted_ones_by_their_uncertainty(lens_fit: StereoFit) -> None:
    assert lens_fit.calibrated is not None
    value, sigma = lens_fit.calibrated.calibration.value(ROLL)
    rng = np.random.default_rng(3)
    drawn = np.array([all_errors(lens_fit, rng)[ROLL] for _ in range(200)])
    assert drawn.mean() == pytest.approx(value, abs=0.3 * sigma)
    assert drawn.std() == pytest.approx(sigma, rel=0.2)
    assert all_errors(lens_fit)[ROLL] == pytest.approx(value, abs=1e-6)
    assert set(all_errors(lens_fit)) >= set(residual(lens_fit))


def test_errors_are_not_drawn_if_motion_does_not_determine_the_offset(lens_fit: StereoFit) -> None:
    assert lens_fit.calibrated is not None
    at_rest = replace(lens_fit, calibrated=replace(lens_fit.calibrated, is_offset_determined=False))
    assert all_errors(at_rest, np.random.default_rng(3)) == residual(at_rest)


def test_nothing_is_said_of_an_offset_that_rows_alone_suggest() -> None:
    at_rest = fit(yaw_deg=Uncertain(0.1, 0.001), yaw_from="rows")
    assert sentences(at_rest)[0].startswith("The offset of disparity cannot be determined")
    assert residual(at_rest) == {}


@pytest.mark.parametrize(("gain", "word"), [(1.06, "brighter"), (0.94, "darker"), (1.04, None), (0.96, None)])
def test_a_gain_of_more_than_5_percent_is_said(gain: float, word: str | None) -> None:
    found = sentences(fit(gain=gain))
    assert len(found) == (2 if word else 1)
    if word:
        assert found[1] == f"The right image is {word}: {gain:.2f} of the left."


def test_the_residual_has_the_significant_angles_alone() -> None:
    pair = fit(yaw_deg=Uncertain(0.123456, 0.01), roll_deg=Uncertain(-0.2, 0.01), pitch_deg=Uncertain(0.02, 0.01))
    assert residual(pair) == {"right_yaw_deg": 0.1235, "right_roll_deg": -0.2}
    assert residual(replace(pair, yaw_deg=None)) == {"right_roll_deg": -0.2}


# --- Advice ---


def figures(*, level: float = 0.25, sigma_px: float = 0.8, gain_db: float = 0.0, gain: float = 1.0) -> dict[str, float]:
    """The statistics of an image of boards in light of some level, by a camera with these settings."""
    radiance = (boards(sigma_px=sigma_px) / 220) ** 2.2 * level
    camera = CameraSettings(chip=CAMERAS["mt9v034"], gain_db=gain_db, exposure_gain=gain)
    streams = NoiseStreams(np.random.default_rng(0), np.random.default_rng(1))
    image = expose(radiance.astype(np.float32), camera, streams, exposure=camera.exposure)
    return {**picture_statistics(image), "spectrum_slope": spectrum([image])[0]}


def advice(name: str) -> tuple[str, str]:
    """What raises and what lowers a statistic."""
    (statistic,) = (statistic for statistic in STATISTICS if statistic.name == name)
    return statistic.raised_by, statistic.lowered_by


def test_advice_on_exposure_holds_with_its_side_effects() -> None:
    before = figures(level=1.0)
    after = figures(level=1.0, gain=2.0)
    for name in ("gradient_p99", "burnt"):
        assert "exposure_gain" in advice(name)[0]
    for name in ("grey_sd", "burnt"):
        assert "less exposure_gain" in advice(name)[1]
    for name in ("gradient_p99", "burnt", "grey_sd"):
        assert after[name] > before[name], name
    (sentence,) = side_effects([advice("burnt")[0]])
    assert sentence.startswith("exposure_gain: more raises gradients, the standard deviation of grey and saturated")


def test_advice_on_blur_holds_with_its_side_effects() -> None:
    before = figures()
    after = figures(sigma_px=1.6)
    for name in ("gradient_p99", "spectrum_slope"):
        assert "less blur_sigma_px" in advice(name)[0]
        assert "more blur_sigma_px" in advice(name)[1]
    for name in ("gradient_p99", "spectrum_slope", "gradient_kurtosis"):
        assert after[name] < before[name], name


@pytest.mark.parametrize("gain_db", [10.0, 15.0])
def test_advice_on_gain_holds_where_the_light_is_reduced_as_much_and_not_otherwise(gain_db: float) -> None:
    before = figures()
    noisier = figures(gain_db=gain_db, gain=10 ** (-gain_db / 20))
    assert "more gain_db with less exposure_gain" in advice("gradient_kurtosis")[1]
    assert "more gain_db with less exposure_gain" in advice("spectrum_slope")[0]
    assert any("divide exposure_gain by 10^(dB / 20)" in each for each in side_effects([advice("spectrum_slope")[0]]))
    assert side_effects(["texture on plain surfaces", ""]) == []
    assert noisier["gradient_kurtosis"] < before["gradient_kurtosis"]
    assert noisier["spectrum_slope"] > before["spectrum_slope"]
    assert noisier["grey_mean"] == pytest.approx(before["grey_mean"], rel=0.03)
    brighter = figures(level=1.0, gain_db=gain_db)
    assert brighter["burnt"] > figures(level=1.0)["burnt"]
    assert brighter["grey_mean"] > 1.2 * figures(level=1.0)["grey_mean"]


def statistics(image: np.ndarray) -> dict[str, float]:
    """The statistics of one image."""
    return {**picture_statistics(as_grey(image)), "spectrum_slope": spectrum([as_grey(image)])[0]}


LEFT_HALF = (slice(None), slice(None, 160))


def fine_texture() -> np.ndarray:
    """A pattern of small squares around 0, of an image."""
    squares = np.random.default_rng(5).uniform(-40, 40, (60, 80))
    return np.kron(squares, np.ones((4, 4)))


def test_advice_on_sun_and_soft_light_holds() -> None:
    before = statistics(boards())
    sun = boards()
    sun[LEFT_HALF] *= 0.25  # in the shadow
    sun[:, 160:] *= 1.15
    softer = 128 + 0.6 * (boards() - 128)
    for name in ("gradient_p99", "grey_sd"):
        assert "sun" in advice(name)[0]
        assert "softer light" in advice(name)[1]
        assert statistics(softer)[name] < before[name], name
    assert statistics(sun)["grey_sd"] > before["grey_sd"]
    assert statistics(1.15 * (boards() - 128) + 128)["gradient_p99"] > before["gradient_p99"]


def test_advice_on_the_contrast_of_materials_holds() -> None:
    assert "darker and brighter materials" in advice("grey_sd")[0]
    stronger = 128 + 1.3 * (boards() - 128)
    assert statistics(stronger)["grey_sd"] > statistics(boards())["grey_sd"]


def test_advice_on_plain_and_textured_surfaces_holds() -> None:
    textured = boards() + fine_texture()
    half_plain = textured.copy()
    half_plain[LEFT_HALF] = 128
    assert advice("gradient_kurtosis")[0] == "plain surfaces beside detailed ones"
    assert advice("gradient_kurtosis")[1].startswith("texture on more surfaces")
    assert advice("corner_unevenness") == ("plain walls or sky beside texture", "texture on plain surfaces")
    for name in ("gradient_kurtosis", "corner_unevenness"):
        assert statistics(half_plain)[name] > statistics(textured)[name], name


def test_advice_on_fine_texture_and_large_shapes_holds() -> None:
    before = statistics(boards())
    assert advice("spectrum_slope")[0].startswith("fine texture")
    assert advice("spectrum_slope")[1].startswith("large shapes and shadows")
    assert statistics(boards() + fine_texture())["spectrum_slope"] > before["spectrum_slope"]
    squares = np.random.default_rng(6).uniform(-60, 60, (6, 8))
    shapes = cv2.GaussianBlur(np.kron(squares, np.ones((40, 40))), (0, 0), 8)
    assert statistics(boards() + shapes)["spectrum_slope"] < before["spectrum_slope"]


def test_advice_on_sky_and_windows_holds() -> None:
    window = boards()
    window[:60] = 255
    assert "sky or windows" in advice("burnt")[0]
    assert statistics(window)["burnt"] > statistics(boards())["burnt"]


def views(step_px: int, *, has_movers: bool = False) -> list[np.ndarray]:
    """Successive images of a camera that passes a wall, with a step between them; and of boards that move in front."""
    texture = np.tile(boards(size=(240, 700)), (1, 2))
    images = []
    for index in range(WINDOW):
        image = texture[:, index * step_px : index * step_px + 320].copy()
        for mover in range(6) if has_movers else ():
            column = (40 * mover + 37 * index) % 300
            image[30 * mover : 30 * mover + 30, column : column + 60] = 90 + 20 * mover
        images.append(as_grey(image))
    return images


def test_advice_on_the_size_of_steps_holds() -> None:
    small = track_statistics(views(4))
    large = track_statistics(views(24))
    for name in ("tracks_home", "track_life"):
        assert advice(name)[0] == "smaller steps: more rate_hz, less speed"
        assert advice(name)[1].startswith("larger steps: less rate_hz, more speed")
    assert small.consistent_share > large.consistent_share
    assert small.alive_share.sum() > large.alive_share.sum()


def test_advice_on_movers_holds() -> None:
    assert advice("track_life")[1].endswith("movers")
    still = track_statistics(views(4))
    crossed = track_statistics(views(4, has_movers=True))
    assert crossed.alive_share.sum() < still.alive_share.sum()


def row_error_px(*, roll_px: float = 0.0, pitch_px: float = 0.0) -> float:
    """The row error of a pair whose right image is lower by `pitch_px`, and by `roll_px` more at its left border."""
    left = boards()
    tilt = -2 * roll_px / 320
    matrix = np.array([[1.0, 0.0, -6.0], [tilt, 1.0, pitch_px - tilt * 160]])
    right = cv2.warpAffine(left, matrix, (320, 240), borderMode=cv2.BORDER_REFLECT)
    frames = [FrameSample(as_grey(left), as_grey(right)) for _ in range(2)]
    return measure([frames], RIG).values["row_error_px"]


def test_advice_on_calibration_errors_holds_for_roll_and_not_for_pitch() -> None:
    more, less = advice("row_error_px")
    assert more.startswith("more calibration_error (right_roll_deg;")
    assert less.startswith("less calibration_error (right_roll_deg;")
    right = row_error_px()
    assert row_error_px(roll_px=1.0) > right + 0.2
    assert row_error_px(pitch_px=1.0) == pytest.approx(right, abs=0.1)
