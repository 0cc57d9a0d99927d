"""Measures how realistic images are by nine statistics, and the settings that change them."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from vobench.analysis.image_statistics import (
    TrackStatistics,
    gradients,
    picture_statistics,
    spectrum,
    track_statistics,
)
from vobench.analysis.pair_calibration import PairCalibration
from vobench.analysis.pair_parameter import PITCH, RIGHT_FOCAL, ROLL, YAW
from vobench.analysis.stereo_fit import StereoFit, Uncertain, fit_pair
from vobench.analysis.stereo_matches import PairShot
from vobench.dataset.recording import Recording
from vobench.errors import InputError
from vobench.estimator.stereo import stereo_pair
from vobench.geometry.rig import Rig, Side, rectification
from vobench.geometry.se3 import Array
from vobench.sequence import EncodedFrame
from vobench.sequence.picture import Image, decode, grey
from vobench.trajectory.trajectory import poses_at

# --- The statistics ---


@dataclass(frozen=True, slots=True)
class Statistic:
    """One statistic, and the settings of a suite that raise and lower it."""

    name: str
    title: str
    unit: str
    raised_by: str
    lowered_by: str

    def knob(self, verdict: str) -> str:
        """The settings that bring a value with a verdict of `StatisticBand` into the band; empty if it is in it."""
        settings = {"in": "", "low": self.raised_by, "high": self.lowered_by}
        return settings[verdict]


ERRORS = "calibration_error (right_roll_deg; a pitch shifts all rows alike)"
MORE_NOISE = "more gain_db with less exposure_gain"
# What else the settings of the advice move, besides the statistic that they are advised for.
SIDE_EFFECTS = {
    "exposure_gain": "more raises gradients, the standard deviation of grey and saturated pixels together",
    "gain_db": "divide exposure_gain by 10^(dB / 20), or gain also brightens: wider grey, more saturated pixels",
    "blur_sigma_px": "more lowers gradients, their kurtosis and the slope of the spectrum together",
    "rate_hz": "more makes tracks longer and more of them consistent, and costs as many more images",
}
STATISTICS = (
    Statistic("row_error_px", "row error of the pair", "px", f"more {ERRORS}", f"less {ERRORS}"),
    Statistic("gradient_p99", "gradient, 99th percentile", "DN",
              "contrast: sun, exposure_gain, less blur_sigma_px", "softer light, more blur_sigma_px"),
    Statistic("gradient_kurtosis", "gradient, kurtosis", "",
              "plain surfaces beside detailed ones", f"texture on more surfaces, {MORE_NOISE}"),
    Statistic("spectrum_slope", "slope of the power spectrum", "",
              f"fine texture, less blur_sigma_px, {MORE_NOISE}", "large shapes and shadows, more blur_sigma_px"),
    Statistic("corner_unevenness", "unevenness of corners", "",
              "plain walls or sky beside texture", "texture on plain surfaces"),
    Statistic("tracks_home", "consistent tracks", "%",
              "smaller steps: more rate_hz, less speed",
              "larger steps: less rate_hz, more speed"),
    Statistic("track_life", "track length, of 13", "images",
              "smaller steps: more rate_hz, less speed",
              "larger steps: less rate_hz, more speed, movers"),
    Statistic("grey_sd", "standard deviation of grey", "DN",
              "sun and shadow, darker and brighter materials", "softer light, less exposure_gain"),
    Statistic("burnt", "pixels at 254 or more", "%", "more exposure_gain, sky or windows", "less exposure_gain"),
)  # fmt: skip


def side_effects(advice: Iterable[str]) -> list[str]:
    """What else each setting in some advice moves, a sentence for each setting."""
    text = " ".join(advice)
    return [f"{setting}: {effect}" for setting, effect in SIDE_EFFECTS.items() if setting in text]


FIGURES_WITHOUT_RANGE = ("grey_mean", "noise_dn", "edge_px", "corners", "flow_px")


@dataclass(frozen=True, slots=True)
class Realism:
    """The nine statistics by name, other figures of the images by name, and the fit of the stereo pair if there is one.

    A camera at rest has no statistics of tracks, and runs of fewer than 14 images have no track length.
    `curves` are for plots: log10 of power by cycles per tile (K,), share of tracks alive by image (14,), counts of
    grey values (256,) and of gradients in DN (128,).
    """

    values: Mapping[str, float]
    also: Mapping[str, float]
    curves: Mapping[str, Array]
    pair: StereoFit | None
    pictures: int


@dataclass(frozen=True, slots=True)
class FrameSample:
    """The grey images of one frame, and the true pose of the left camera in the world, None if it is unknown."""

    left: Image
    right: Image | None
    T_world_left: Array | None = None


# --- Measurement ---

WINDOW = 14  # successive images of a run
MIN_MOVED_PX = 2.0  # by which tracks of a moving camera are displaced in a run
WINDOWS = 6  # runs that are spread over a recording
GREY_VALUES = 256
GRADIENT_BINS = 128  # of 1 DN


def window_starts(count: int, *, windows: int = WINDOWS) -> list[int]:
    """The first frames of runs of WINDOW images that are spread over `count` images; one run for a short recording."""
    if count < 2:
        raise InputError(f"statistics need 2 successive images or more, and this recording has {count}")
    fitting = max(1, min(windows, count // WINDOW))
    starts = np.linspace(0, max(count - WINDOW, 0), fitting).tolist()
    return sorted({round(start) for start in starts})


def measure(runs: Sequence[Sequence[FrameSample]], rig: Rig) -> Realism:
    """Compute the statistics of runs of successive grey images of a rig."""
    images = [image for run in runs for image in _left_images(run)]
    tracks_of_runs = [track_statistics(_left_images(run)) for run in runs]
    alive_share = np.mean([_padded(tracks.alive_share) for tracks in tracks_of_runs], axis=0)  # (WINDOW,)
    slope, power = spectrum(images)
    pair = _fit_stereo(runs, rig)

    figures = _means([picture_statistics(image) for image in images])
    figures |= _track_means(tracks_of_runs)
    is_moving = any(tracks.moved_px > MIN_MOVED_PX for tracks in tracks_of_runs)
    if not is_moving:
        del figures["tracks_home"]
    if is_moving and all(len(run) == WINDOW for run in runs):
        figures["track_life"] = float(alive_share[1:].sum())
    figures["spectrum_slope"] = slope
    if pair:
        figures["row_error_px"] = pair.row_mad_px
    measured = [statistic.name for statistic in STATISTICS if statistic.name in figures]
    return Realism(
        values={name: figures[name] for name in measured},
        also={name: figures[name] for name in FIGURES_WITHOUT_RANGE},
        curves={
            "power": power,
            "alive": alive_share,
            "grey": _grey_counts(images),
            "gradient": _gradient_counts(images),
        },
        pair=pair,
        pictures=len(images),
    )


def _left_images(run: Sequence[FrameSample]) -> list[Image]:
    return [shot.left for shot in run]


def _padded(alive_share: Array) -> Array:
    """The share of tracks alive (WINDOW,), 0 after the end of a shorter run."""
    return np.pad(alive_share, (0, WINDOW - len(alive_share)))


def _means(of_images: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """The mean of each statistic over images."""
    means = {}
    for name in of_images[0]:
        means[name] = float(np.mean([statistics[name] for statistics in of_images]))
    return means


def _track_means(tracks_of_runs: Sequence[TrackStatistics]) -> dict[str, float]:
    """The mean of each statistic of tracks from one image to the next."""
    consistent_shares = [tracks.consistent_share for tracks in tracks_of_runs]
    flows_px = [tracks.flow_px for tracks in tracks_of_runs]
    return {"tracks_home": 100 * float(np.mean(consistent_shares)), "flow_px": float(np.mean(flows_px))}


def _fit_stereo(runs: Sequence[Sequence[FrameSample]], rig: Rig) -> StereoFit | None:
    """The fit of the stereo pair; None if the rig or the first run has only one camera."""
    pairs_of_runs = [_pairs(run) for run in runs]
    if not rectification(rig) or not pairs_of_runs[0]:
        return None
    return fit_pair(pairs_of_runs, stereo_pair(rig, "the pair's fit"))


def _pairs(run: Sequence[FrameSample]) -> list[PairShot]:
    return [PairShot(shot.left, shot.right, shot.T_world_left) for shot in run if shot.right is not None]


def _grey_counts(images: Iterable[Image]) -> Array:
    counts = np.zeros(GREY_VALUES)
    for image in images:
        counts += np.bincount(image.ravel(), minlength=GREY_VALUES)
    return counts


def _gradient_counts(images: Iterable[Image]) -> Array:
    counts = np.zeros(GRADIENT_BINS)
    for image in images:
        counts += np.histogram(gradients(image), GRADIENT_BINS, (0, GRADIENT_BINS))[0]
    return counts


# --- The images of a recording ---


def shots_of(recording: Recording) -> list[list[FrameSample]]:
    """The runs of images by which a recording is measured."""
    starts = window_starts(recording.frame_count)
    frames_end = starts[-1] + WINDOW
    runs: list[list[FrameSample]] = [[] for _ in starts]
    for frame in islice(recording.encoded_frames(), frames_end):
        run = int(np.searchsorted(starts, frame.index, side="right")) - 1
        if starts[run] <= frame.index < starts[run] + WINDOW:
            runs[run].append(_shot(frame, recording))
    return runs


def _shot(frame: EncodedFrame, recording: Recording) -> FrameSample:
    left = _decoded(frame, recording, "left", frame.left)
    right = None if frame.right is None else _decoded(frame, recording, "right", frame.right)
    return FrameSample(left, right, _true_pose(frame.t_ns, recording))


def _decoded(frame: EncodedFrame, recording: Recording, side: Side, encoded: bytes) -> Image:
    camera = recording.rig.camera(side)
    picture = decode(encoded, camera, f"the {side} image {frame.index}", colour=frame.colour)
    return grey(picture, frame.colour)


def _true_pose(t_ns: int, recording: Recording) -> Array | None:
    """The pose T_world_left at a time; None outside of the ground truth."""
    truth = recording.truth
    if truth is None or len(truth) < 2:
        return None
    if not truth.t_ns[0] <= t_ns <= truth.t_ns[-1]:
        return None
    (T_world_body,) = poses_at(truth, np.array([t_ns]))
    T_world_left: Array = T_world_body @ recording.rig.T_body_left
    return T_world_left


# --- The stereo pair, in sentences ---

# Smaller values are not mentioned.
MIN_ANGLE_DEG = 0.002
MIN_GAIN_DIFFERENCE = 0.05
MIN_OFFSET_PX = 0.05
QUARTERS = (0.25, 0.75)  # of the width


def pair_sentences(found: Realism) -> list[str]:
    """Sentences about the errors of the stereo pair and their most likely causes."""
    pair = found.pair
    if pair is None:
        return ["There is no stereo pair to judge: one camera, cameras with different directions, or too few matches."]
    sentences = [_offset_sentence(pair), *_row_sentences(pair)]
    if abs(pair.gain - 1) > MIN_GAIN_DIFFERENCE:
        comparison = "brighter" if pair.gain > 1 else "darker"
        sentences.append(f"The right image is {comparison}: {pair.gain:.2f} of the left.")
    return sentences


def _offset_sentence(pair: StereoFit) -> str:
    offset_px = pair.offset_px
    yaw_deg = pair.yaw_deg
    if offset_px is None or yaw_deg is None:
        return "The offset of disparity cannot be determined: that takes motion, and points near and far."
    offset = f"{offset_px.value:+.2f} ± {offset_px.sigma:.2f} px"
    if not offset_px.is_plain or abs(offset_px.value) < MIN_OFFSET_PX:
        return f"The disparity has no significant offset: {offset}."
    return (
        f"The disparity has an offset of {offset}, most likely from the right camera's yaw of "
        f"{_degrees_text(yaw_deg)} (by {pair.yaw_from})."
    )


def _row_sentences(pair: StereoFit) -> Iterator[str]:
    """Yield sentences about the differences between the rows of matched points."""
    angles = []
    for name, angle_deg in (("roll", pair.roll_deg), ("pitch", pair.pitch_deg)):
        if angle_deg.is_plain and abs(angle_deg.value) > MIN_ANGLE_DEG:
            angles.append(f"{name} {_degrees_text(angle_deg)}")
    if angles:
        yield (
            f"Rows differ by {pair.row_mad_px:.2f} px, most likely from the right camera's {' and '.join(angles)}; "
            f"{pair.row_noise_px:.2f} px are left without them."
        )
    if pair.has_lens_error:
        left_px, right_px = pair.offsets_px(QUARTERS)
        yield (
            f"No rotation of a camera explains rows ({pair.xy_px.value:+.2f} ± {pair.xy_px.sigma:.2f} px × xy) and "
            f"disparities (offset at the left and right quarter {left_px.value:+.2f} ± {left_px.sigma:.2f} and "
            f"{right_px.value:+.2f} ± {right_px.sigma:.2f} px): the lens model or the rectification is wrong."
        )


def _degrees_text(angle_deg: Uncertain) -> str:
    return f"{angle_deg.value:+.3f} ± {angle_deg.sigma:.3f}°"


SETTING_DIGITS = 6
# Settings that are a pair of numbers, and the place in it.
VECTOR_KEYS = {
    "center_x_px": ("center_px", 0),
    "center_y_px": ("center_px", 1),
    "tangential_1": ("tangential", 0),
    "tangential_2": ("tangential", 1),
}


def residual(pair: StereoFit) -> dict[str, Any]:
    """The errors of a stereo pair as the `calibration_error` of a suite's rig: those that are significant.

    If no rotation explains the pair, all errors of the right camera, as they are only right together.
    """
    if pair.calibrated is not None and pair.has_lens_error:
        calibration = pair.calibrated.calibration
        return _settings(calibration, calibration.right_names) | _settings(calibration, _significant(calibration))

    angles = {YAW: None if pair.offset_px is None else pair.yaw_deg, ROLL: pair.roll_deg, PITCH: pair.pitch_deg}
    error: dict[str, Any] = {}
    for name, angle_deg in angles.items():
        if angle_deg is not None and angle_deg.is_plain:
            error[name] = round(angle_deg.value, 4)
    if pair.calibrated is not None and pair.calibrated.is_offset_determined:
        calibration = pair.calibrated.calibration
        names = [name for name in _significant(calibration) if name not in angles]
        error |= _settings(calibration, names)
    return error


def all_errors(pair: StereoFit, rng: np.random.Generator | None = None) -> dict[str, Any]:
    """All fitted errors in the form of `residual`, significant or not; with `rng`, drawn from their distribution.

    They are those of `residual` if motion does not determine the offset of disparities: then most errors are unknown.
    """
    if pair.calibrated is None or not pair.calibrated.is_offset_determined:
        return residual(pair)
    fitted = pair.calibrated.calibration
    calibration = fitted if rng is None else fitted.drawn(rng)
    return _settings(calibration, [parameter.name for parameter in calibration.parameters])


def _significant(calibration: PairCalibration) -> list[str]:
    """The names of significant errors of both cameras and of the right camera's focal length."""
    names = []
    for parameter in calibration.parameters:
        is_chosen = parameter.is_common or parameter.name == RIGHT_FOCAL
        if is_chosen and Uncertain(*calibration.value(parameter.name)).is_plain:
            names.append(parameter.name)
    return names


def _settings(calibration: PairCalibration, names: Sequence[str]) -> dict[str, Any]:
    """Errors as the keys of `CalibrationError`, those of the right camera's lens below `right`."""
    values = {name: calibration.value(name)[0] for name in names}
    right: dict[str, Any] = {}
    error: dict[str, Any] = {}
    for name, value in values.items():
        eye, _, key = name.rpartition(" ")
        keys = right if eye else error
        vector, axis = VECTOR_KEYS.get(key, ("", 0))
        if vector:
            keys.setdefault(vector, [0.0, 0.0])[axis] = round(value, SETTING_DIGITS)
        else:
            keys[key] = round(value, SETTING_DIGITS)
    return error | ({"right": right} if right else {})
