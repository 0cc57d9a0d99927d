"""How real pictures are: nine statistics beside the bands that real ones have, and what moves each of them.

The bands are of 14 pictures each of KITTI 00, 01, 06 and EuRoC V1_01: a first guess, to be widened with others.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import islice, pairwise
from typing import Any

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.analysis.stereo_fit import PairShot, StereoFit, fit_pair
from vobench.dataset.recording import Recording
from vobench.errors import InputError
from vobench.estimator.tools import Points, follow, inside, stereo_pair
from vobench.geometry.rig import Rig, Side, rectification
from vobench.geometry.se3 import Array
from vobench.sequence import EncodedFrame
from vobench.sequence.picture import Image, decode, grey
from vobench.trajectory.trajectory import poses_at

# successive pictures, and how often over a recording
WINDOW = 14
WINDOWS = 6
MOST_CORNERS = 2000
CORNER_QUALITY = 0.01
CORNER_DISTANCE_PX = 8
CELLS = (8, 6)
TILE_PX = 256
CYCLES = (4, 100)
BURNT_DN = 254
DARK_DN = 2
PATCH_PX = 7
PATCH_STEP_PX = 3
FEWEST_PATCHES = 300
NOISE_ROUNDS = 8
FLAT_SHARES = np.arange(0.05, 1.0, 0.1)
# the strongest gradients, and the window that has the whole of an edge
EDGE_SHARE = 0.01
EDGE_PX = 9


@dataclass(frozen=True, slots=True)
class Statistic:
    """One statistic: its band in real pictures, and the knobs of a suite that raise and lower it."""

    name: str
    title: str
    unit: str
    low: float
    high: float
    raised_by: str
    lowered_by: str

    def verdict(self, value: float) -> str:
        """in, low or high."""
        if value < self.low:
            return "low"
        return "high" if value > self.high else "in"

    def knob(self, value: float) -> str:
        """What would bring it into its band; nothing where it is there."""
        return {"in": "", "low": self.raised_by, "high": self.lowered_by}[self.verdict(value)]


ERRORS = "calibration_error (right_roll_deg, right_pitch_deg)"
STATISTICS = (
    Statistic("row_error_px", "row error of the pair", "px", 0.15, 0.5, f"more {ERRORS}", f"less {ERRORS}"),
    Statistic("gradient_p99", "gradient, 99th percentile", "DN", 55, 75,
              "contrast: sun, exposure_gain, less blur_sigma_px", "softer light, more blur_sigma_px"),
    Statistic("gradient_kurtosis", "gradient, kurtosis", "", 15, 35,
              "plain surfaces beside detailed ones", "texture on more surfaces, more gain_db"),
    Statistic("spectrum_slope", "slope of the power spectrum", "", -3.2, -2.5,
              "fine texture, less blur_sigma_px, more gain_db", "large shapes and shadows, more blur_sigma_px"),
    Statistic("corner_unevenness", "unevenness of corners", "", 0.35, 0.7,
              "plain walls or sky beside texture", "texture on plain surfaces"),
    Statistic("tracks_home", "tracks that come home", "%", 50, 75,
              "smaller steps: more rate_hz, less speed", "larger steps: less rate_hz, more speed"),
    Statistic("track_life", "life of a track, of 13", "pictures", 3, 5,
              "smaller steps: more rate_hz, less speed", "larger steps: less rate_hz, more speed, movers"),
    Statistic("grey_sd", "standard deviation of grey", "DN", 50, 75,
              "sun and shadow, darker and brighter materials", "softer light, less exposure_gain"),
    Statistic("burnt", "pixels at 254 or more", "%", 4, 10, "more exposure_gain, sky or windows", "less exposure_gain"),
)  # fmt: skip
OFFSET_BAND_PX = (0.0, 0.9)


@dataclass(frozen=True, slots=True)
class Realism:
    """The nine statistics by name, what else is measured of the pictures by name, and the pair, None of one eye.

    `curves` are for plots: log10 of power per cycle (K,), share of tracks alive per picture (14,), counts of
    grey values (256,) and of gradients in DN (128,).
    """

    values: Mapping[str, float]
    also: Mapping[str, float]
    curves: Mapping[str, Array]
    pair: StereoFit | None
    pictures: int

    @property
    def inside(self) -> int:
        """How many of the nine lie in their bands."""
        return sum(s.name in self.values and s.verdict(self.values[s.name]) == "in" for s in STATISTICS)


@dataclass(frozen=True, slots=True)
class Shot:
    """The grey pictures of one instant, and the left camera's true pose in the world where it is known."""

    left: Image
    right: Image | None
    T_world_left: Array | None = None


def window_starts(count: int, *, windows: int = WINDOWS) -> list[int]:
    """Where runs of WINDOW pictures begin, spread over a recording of `count`; one for a short one."""
    if count < 2:
        raise InputError(f"statistics need 2 successive pictures or more, and this recording has {count}")
    most = max(1, min(windows, count // WINDOW))
    return sorted({round(each) for each in np.linspace(0, max(count - WINDOW, 0), most).tolist()})


def measure(runs: Sequence[Sequence[Shot]], rig: Rig) -> Realism:
    """The statistics of runs of successive grey pictures of a rig."""
    lefts = [shot.left for run in runs for shot in run]
    photographic = [picture_statistics(left) for left in lefts]
    tracking = [_tracking([shot.left for shot in run]) for run in runs]
    lives = np.mean([np.pad(life, (0, WINDOW - len(life))) for _, _, life in tracking], axis=0)
    slope, power = spectrum(lefts)
    values = {name: float(np.mean([each[name] for each in photographic])) for name in BAND_NAMES}
    values |= {"spectrum_slope": slope, "tracks_home": 100 * _mean([t[0] for t in tracking])}
    values |= {"track_life": float(lives[1:].sum())}
    also = {name: float(np.mean([each[name] for each in photographic])) for name in PHOTO_NAMES}
    also |= {"flow_px": _mean([t[1] for t in tracking])}
    both = [[PairShot(s.left, s.right, s.T_world_left) for s in run if s.right is not None] for run in runs]
    pair = fit_pair(both, stereo_pair(rig, "the pair's fit")) if rectification(rig) and both[0] else None
    if pair:
        values["row_error_px"] = pair.row_mad_px
    return Realism(
        {s.name: values[s.name] for s in STATISTICS if s.name in values},
        also,
        {"power": power, "alive": lives, "grey": _counts(lefts), "gradient": _gradient_counts(lefts)},
        pair,
        len(lefts),
    )


BAND_NAMES = ("gradient_p99", "gradient_kurtosis", "corner_unevenness", "grey_sd", "burnt")
PHOTO_NAMES = ("grey_mean", "noise_dn", "edge_px", "corners")


def picture_statistics(picture: Image) -> dict[str, float]:
    """What one grey picture says by itself."""
    gradient = gradients(picture)
    spread = gradient - gradient.mean()
    points = corners(picture)
    across, down = points.T
    borders = [np.linspace(0, size, count + 1) for size, count in zip(picture.shape[::-1], CELLS, strict=True)]
    cells = np.histogram2d(across, down, bins=borders)[0]
    return {
        "gradient_p99": float(np.percentile(gradient, 99)),
        "gradient_kurtosis": float(np.mean(spread**4) / max(float(np.mean(spread**2)) ** 2, 1e-12)),
        "corner_unevenness": float(cells.std() / max(float(cells.mean()), 1e-12)),
        "grey_sd": float(picture.std()),
        "burnt": 100 * float((picture >= BURNT_DN).mean()),
        "grey_mean": float(picture.mean()),
        "noise_dn": noise_dn(picture)[0],
        "edge_px": edge_px(picture, gradient),
        "corners": float(len(points)),
    }


def gradients(picture: Image) -> Array:
    """Magnitudes (H, W) of the gradient in grey values a pixel: Sobel's 3 x 3 over 8."""
    across, down = (cv2.Sobel(picture, cv2.CV_32F, dx, 1 - dx, ksize=3) / 8 for dx in (1, 0))
    return np.asarray(cv2.magnitude(across, down), float)


def corners(picture: Image) -> Points:
    """The best corners (N, 2) of a whole picture. Source: Shi and Tomasi (1994)."""
    found = cv2.goodFeaturesToTrack(picture, MOST_CORNERS, CORNER_QUALITY, CORNER_DISTANCE_PX)
    return np.zeros((0, 2), np.float32) if found is None else found.reshape(-1, 2).astype(np.float32)


def noise_dn(picture: Image) -> tuple[float, Array]:
    """Standard deviation of the noise in grey values where the picture is flat, and ten of the grey values there.

    Neither black nor burnt ones are looked at.

    The smallest principal variance of patches is the noise's, if some have no texture: those are kept whose gradients
    noise explains, again and again. Source: Liu, Tanaka and Okutomi (2013).
    """
    patches = _patches(picture)
    kept = patches[(patches.min(1) > DARK_DN) & (patches.max(1) < BURNT_DN - DARK_DN)]
    steps = _patch_differences()
    strength = ((kept @ steps.T) ** 2).sum(1)
    sigma = 0.0
    most = np.inf
    flat_dn = np.zeros(0)
    for _ in range(NOISE_ROUNDS):
        kept = kept[strength <= most]
        strength = strength[strength <= most]
        if len(kept) < FEWEST_PATCHES:
            break
        variance = _smallest_variance(kept) / _smallest_of_noise(int(np.log2(len(kept))))
        sigma = variance**0.5
        most = variance * _noise_strength()
        flat_dn = np.quantile(kept.mean(1), FLAT_SHARES)
    return sigma, flat_dn


def _patches(picture: NDArray[Any]) -> NDArray[np.float32]:
    """Square patches (N, PATCH_PX²) that overlap."""
    views = np.lib.stride_tricks.sliding_window_view(picture, (PATCH_PX, PATCH_PX))[::PATCH_STEP_PX, ::PATCH_STEP_PX]
    return views.reshape(-1, PATCH_PX**2).astype(np.float32)


def _smallest_variance(patches: NDArray[np.float32]) -> float:
    """The mean of the smallest principal variances of patches."""
    return float(max(np.linalg.eigvalsh(np.cov(patches, rowvar=False))[:PATCH_PX].mean(), 0.0))


@cache
def _smallest_of_noise(magnitude: int) -> float:
    """What 2 ** magnitude patches of noise of variance 1 come to: the fewer, the less."""
    side = round(PATCH_STEP_PX * 2 ** (magnitude / 2 + 0.25)) + PATCH_PX
    return _smallest_variance(_patches(np.random.default_rng(0).standard_normal((side, side))))


@cache
def _patch_differences() -> NDArray[np.float32]:
    """What takes a patch to the differences between neighbours in it."""
    pixels = np.eye(PATCH_PX**2, dtype=np.float32).reshape(-1, PATCH_PX, PATCH_PX)
    return np.vstack([np.diff(pixels, axis=axis).reshape(PATCH_PX**2, -1).T for axis in (1, 2)])


@cache
def _noise_strength() -> float:
    """The sum of squared differences in a patch of noise of variance 1 that one in a thousand exceeds (a gamma's)."""
    of_noise = _patch_differences().T @ _patch_differences()
    mean = float(np.trace(of_noise))
    variance = 2 * float(np.sum(of_noise**2))
    return float(scipy.stats.gamma.ppf(0.999, mean**2 / variance, scale=variance / mean))


def edge_px(picture: Image, gradient: Array) -> float:
    """How many pixels the sharpest edges take from dark to bright: height over steepness, lower quartile."""
    kernel = np.ones((EDGE_PX, EDGE_PX), np.uint8)
    bright = cv2.dilate(picture, kernel)
    dark = cv2.erode(picture, kernel)
    usable = (bright < BURNT_DN) & (dark > DARK_DN)
    if not usable.any():
        return 0.0
    strong = usable & (gradient >= max(float(np.quantile(gradient[usable], 1 - EDGE_SHARE)), 1.0))
    return float(np.quantile((bright.astype(float) - dark)[strong] / gradient[strong], 0.25)) if strong.any() else 0.0


def spectrum(pictures: Sequence[Image]) -> tuple[float, Array]:
    """Slope of log power over log frequency, and log10 of power by cycles a tile, of Hann windows all over pictures."""
    hann = np.outer(*[np.hanning(TILE_PX)] * 2)
    frequency = np.fft.fftfreq(TILE_PX, 1 / TILE_PX)
    ring = np.rint(np.hypot(frequency[:, None], frequency[None])).astype(int).ravel()
    total = np.zeros(TILE_PX * TILE_PX)
    tiles = 0
    for picture in pictures:
        for tile in _tiles(picture):
            total += np.abs(np.fft.fft2((tile - tile.mean()) * hann)).ravel() ** 2
            tiles += 1
    power = np.bincount(ring, total) / np.maximum(np.bincount(ring), 1) / max(tiles, 1)
    low, high = CYCLES
    logs = np.log10(np.maximum(power[: TILE_PX // 2], 1e-12))
    return float(np.polyfit(np.log10(np.arange(low, high + 1)), logs[low : high + 1], 1)[0]), logs


def _tiles(picture: Image) -> Iterator[Array]:
    """Tiles over a picture, the outer ones at its borders; a smaller picture is mirrored."""
    missing = [max(0, TILE_PX - size) for size in picture.shape]
    padded = np.pad(picture, [(0, more) for more in missing], mode="symmetric").astype(float)
    starts = [np.unique(np.linspace(0, n - TILE_PX, -(-n // TILE_PX)).astype(int)) for n in padded.shape]
    for row in starts[0]:
        for column in starts[1]:
            yield padded[row : row + TILE_PX, column : column + TILE_PX]


def _tracking(pictures: Sequence[Image]) -> tuple[float, float, Array]:
    """Share of corners that come home from the next picture, median flow in px, and the share alive by picture."""
    home = []
    flows = []
    alive = [1.0]
    living = corners(pictures[0])
    first = max(len(living), 1)
    for picture, later in pairwise(pictures):
        points = corners(picture)
        there, found = follow(picture, later, points)
        home.append(float(found.mean()) if len(points) else 0.0)
        flows.append(float(np.median(np.linalg.norm(there[found] - points[found], axis=1))) if found.any() else 0.0)
        there, found = follow(picture, later, living)
        living = there[found & inside(there, later, 0)] if len(living) else living
        alive.append(len(living) / first)
    return _mean(home), _mean(flows), np.array(alive)


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else 0.0


def _counts(pictures: Sequence[Image]) -> Array:
    return np.asarray(sum(np.bincount(picture.ravel(), minlength=256) for picture in pictures), float)


def _gradient_counts(pictures: Sequence[Image]) -> Array:
    return np.asarray(sum(np.histogram(gradients(picture), 128, (0, 128))[0] for picture in pictures), float)


def shots_of(recording: Recording) -> list[list[Shot]]:
    """The runs of pictures that a recording is measured by."""
    starts = window_starts(recording.frame_count)
    wanted = {index for start in starts for index in range(start, start + WINDOW)}
    runs: list[list[Shot]] = [[] for _ in starts]
    for frame in islice(recording.encoded_frames(), max(wanted) + 1):
        if frame.index in wanted:
            runs[int(np.searchsorted(starts, frame.index, side="right")) - 1].append(_shot(frame, recording))
    return runs


def _shot(frame: EncodedFrame, recording: Recording) -> Shot:
    eyes: tuple[tuple[Side, bytes | None], ...] = (("left", frame.left), ("right", frame.right))
    pictures = [
        grey(
            decode(held, recording.rig.camera(side), f"the {side} picture {frame.index}", colour=frame.colour),
            frame.colour,
        )
        for side, held in eyes
        if held is not None
    ]
    return Shot(pictures[0], pictures[1] if len(pictures) > 1 else None, _true_pose(frame.t_ns, recording))


def _true_pose(t_ns: int, recording: Recording) -> Array | None:
    truth = recording.truth
    if truth is None or not len(truth) > 1 or not truth.t_ns[0] <= t_ns <= truth.t_ns[-1]:
        return None
    pose: Array = poses_at(truth, np.array([t_ns]))[0] @ recording.rig.T_body_left
    return pose


# what nobody needs to be told
NO_TURN_DEG = 0.002
UNLIKE_GAIN = 0.05
NO_OFFSET_PX = 0.05


def says(found: Realism) -> list[str]:
    """What is off in a pair, and what of: sentences."""
    pair = found.pair
    if pair is None:
        return ["There is no pair to judge: one eye, eyes that do not look the same way, or too few matches."]
    sentences = [_offset_sentence(pair), *_row_sentences(pair)]
    if abs(pair.gain - 1) > UNLIKE_GAIN:
        sentences.append(f"The right eye is {'brighter' if pair.gain > 1 else 'darker'}: {pair.gain:.2f} of the left.")
    return sentences


def _offset_sentence(pair: StereoFit) -> str:
    offset_px = pair.offset_px
    yaw_deg = pair.yaw_deg
    if offset_px is None or yaw_deg is None:
        return "The offset of disparity cannot be told: it takes motion, and points near and far."
    if not offset_px.is_plain or abs(offset_px.value) < NO_OFFSET_PX:
        return f"No offset of disparity is seen: {offset_px.value:+.2f} ± {offset_px.sigma:.2f} px."
    return (
        f"Your pair is off by {offset_px.value:+.2f} ± {offset_px.sigma:.2f} px of disparity, most likely the right "
        f"eye's yaw of {yaw_deg.value:+.3f} ± {yaw_deg.sigma:.3f}° (by {pair.yaw_from})."
    )


def _row_sentences(pair: StereoFit) -> Iterator[str]:
    turns = {"roll": pair.roll_deg, "pitch": pair.pitch_deg}
    plain = [
        f"{n} {t.value:+.3f} ± {t.sigma:.3f}°" for n, t in turns.items() if t.is_plain and abs(t.value) > NO_TURN_DEG
    ]
    if plain:
        yield (
            f"Rows differ by {pair.row_mad_px:.2f} px, most likely the right eye's {' and '.join(plain)}; "
            f"{pair.row_noise_px:.2f} px are left without them."
        )
    if pair.xy_px.is_plain and "rows" not in pair.yaw_from:
        yield (
            f"Rows differ by {pair.xy_px.value:+.2f} px × xy, which no turn of an eye explains: "
            "a lens or the rectification is off."
        )


def residual(pair: StereoFit) -> dict[str, float]:
    """The pair's error as a rig of a suite says it under `calibration_error`; only what is plain."""
    turns = {"right_yaw_deg": pair.yaw_deg, "right_roll_deg": pair.roll_deg, "right_pitch_deg": pair.pitch_deg}
    return {name: round(turn.value, 4) for name, turn in turns.items() if turn is not None and turn.is_plain}
