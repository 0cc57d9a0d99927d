"""Finds in which properties the images of a part of a recording differ from those of the rest.

The rest is the reference: a property has changed in a frame if its value is far outside of the reference's spread.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.analysis.image_noise import noise_dn
from vobench.analysis.image_statistics import edge_px, evenly_spaced, gradients
from vobench.analysis.picture_change import (
    Blur,
    Dirt,
    ExposureJumps,
    MissingFrames,
    Noise,
    PictureChange,
    TurnedCamera,
    blurred,
)
from vobench.analysis.robust_sigma import robust_sigma
from vobench.analysis.stereo_fit import StereoFit, Uncertain, fit_pair
from vobench.analysis.stereo_matches import PairShot
from vobench.estimator.stereo import StereoPair
from vobench.geometry import se3
from vobench.geometry.rig import SIDES
from vobench.geometry.se3 import Array
from vobench.sequence.picture import Image
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

Frames = NDArray[np.bool_]

SIGMAS = 5.0  # a value is far outside of the reference's spread if it is so many standard deviations from its median
MIN_CHANGED_FRAMES = 3
SMOOTHED_FRAMES = 3  # a median over so many frames removes single ones and fills gaps


@dataclass(frozen=True, slots=True)
class RecordingPart:
    """F frames of a recording at `t_ns` (F,), with their images and true poses."""

    t_ns: Stamps
    shots: tuple[PairShot, ...]

    def __len__(self) -> int:
        return len(self.shots)

    def images(self, side: int) -> list[Image]:
        """The images of the left (0) or right (1) camera."""
        return [shot.right if side else shot.left for shot in self.shots]


@dataclass(frozen=True, slots=True)
class ImageEvidence:
    """How the images of a part of a recording differ from the reference, and the noise and pair fit of the latter.

    `noise_dn` is the standard deviation of the noise of the reference.
    """

    changes: tuple[PictureChange, ...]
    noise_dn: float
    fit: StereoFit | None


def find_changes(
    part: RecordingPart, reference: Sequence[RecordingPart], pair: StereoPair, *, period_ns: int
) -> ImageEvidence:
    """Find the changes of a part of a recording relative to runs of successive frames from the rest of it.

    `period_ns` is the usual time between two frames.
    """
    jumps = _exposure_jumps(part, reference)
    is_exposed_alike = np.ones((len(part), len(SIDES)), bool)
    if jumps is not None:
        is_exposed_alike = jumps.stops == 0

    looks = _looks(part)
    reference_looks = np.concatenate([_looks(run) for run in reference])
    reference_fit = fit_pair([run.shots for run in reference], pair)
    blur = _blur(looks[..., EDGE], reference_looks[..., EDGE], is_exposed_alike, reference)
    noise = _noise(looks[..., NOISE], reference_looks[..., NOISE], is_exposed_alike)
    dirt = _dirt(part, reference)

    # Matches of images that differ otherwise are biased, so the pair is fitted to the other images.
    is_unchanged = np.asarray(is_exposed_alike.all(1))
    if blur is not None:
        is_unchanged &= (blur.sigma_px == 0).all(1)
    if noise is not None:
        is_unchanged &= (noise.sigma_dn == 0).all(1)
    if dirt is not None:
        is_unchanged &= ~dirt.is_dirty.any(1)
    turned = _turned_camera(part, pair, reference_fit, is_unchanged)

    found = (blur, noise, jumps, _missing_frames(part, period_ns), dirt, turned)
    changes = tuple(change for change in found if change is not None)
    return ImageEvidence(changes, float(np.median(reference_looks[..., NOISE])), reference_fit)


def _steady(is_changed: Frames) -> Frames:
    """Changed frames (F, 2) without single ones; none of a side that has too few."""
    smooth = scipy.ndimage.median_filter(is_changed, size=(SMOOTHED_FRAMES, 1), mode="nearest")
    has_enough = smooth.sum(0) >= MIN_CHANGED_FRAMES
    return np.asarray(smooth & has_enough)


def _share(is_changed: Frames) -> str:
    """In how many frames, and in which images, a property has changed."""
    has_changed = np.asarray(is_changed.any(0))
    sides = [side for side, changed in zip(SIDES, has_changed.tolist(), strict=True) if changed]
    where = "both images" if len(sides) == len(SIDES) else f"the {sides[0]} image"
    return f"in {where} of {int(is_changed.any(1).sum())} of {len(is_changed)} frames"


# --- Blur and noise ---

NOISE, EDGE = range(2)  # columns of looks
MIN_EDGE_RATIO = 1.3  # of widths of edges
MIN_NOISE_RATIO = 1.5
MIN_NOISE_DN = 1.0
SIGMAS_PX = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0])  # of blur, that are tried on the reference
BLURRED_IMAGES = 4


def _looks(part: RecordingPart) -> Array:
    """Noise in grey values and the width of edges in px (F, 2, 2), by frame and side."""
    rows = [[_look(shot.left), _look(shot.right)] for shot in part.shots]
    return np.array(rows, float)


def _look(image: Image) -> tuple[float, float]:
    return noise_dn(image)[0], edge_px(image, gradients(image))


def _blur(
    width_px: Array, reference_px: Array, is_comparable: Frames, reference: Sequence[RecordingPart]
) -> Blur | None:
    """Blur by the widths of edges (F, 2), and those (R, 2) of the reference."""
    usual_px = float(np.median(reference_px))
    limit_px = max(usual_px + SIGMAS * robust_sigma(reference_px), MIN_EDGE_RATIO * usual_px)
    is_blurred = _steady((width_px > limit_px) & is_comparable)
    if not is_blurred.any():
        return None

    images = evenly_spaced([shot.left for run in reference for shot in run.shots], BLURRED_IMAGES)
    widths_px = [_mean_edge_px(images, sigma_px) for sigma_px in SIGMAS_PX.tolist()]
    increasing_px = np.maximum.accumulate(widths_px)
    ratio = width_px / usual_px * increasing_px[0]
    sigma_px = np.interp(ratio, increasing_px, SIGMAS_PX)
    width_there_px = float(np.median(width_px[is_blurred]))
    evidence = f"edges are {width_there_px:.1f} px wide {_share(is_blurred)}, and {usual_px:.1f} px elsewhere"
    return Blur(evidence, np.where(is_blurred, sigma_px, 0.0))


def _mean_edge_px(images: Iterable[Image], sigma_px: float) -> float:
    """The mean width of edges in images after they are blurred."""
    widths_px = []
    for image in images:
        softer = np.rint(blurred(image.astype(np.float32), sigma_px)).astype(np.uint8)
        widths_px.append(edge_px(softer, gradients(softer)))
    return float(np.mean(widths_px))


def _noise(sigma_dn: Array, reference_dn: Array, is_comparable: Frames) -> Noise | None:
    """Noise by its standard deviations (F, 2), and those (R, 2) of the reference."""
    usual_dn = float(np.median(reference_dn))
    limit_dn = max(usual_dn + SIGMAS * robust_sigma(reference_dn), MIN_NOISE_RATIO * usual_dn, usual_dn + MIN_NOISE_DN)
    is_noisy = _steady((sigma_dn > limit_dn) & is_comparable)
    if not is_noisy.any():
        return None
    additional_dn = np.sqrt(np.maximum(sigma_dn**2 - usual_dn**2, 0.0))
    there_dn = float(np.median(sigma_dn[is_noisy]))
    evidence = f"noise is {there_dn:.1f} grey values {_share(is_noisy)}, and {usual_dn:.1f} elsewhere"
    return Noise(evidence, np.where(is_noisy, additional_dn, 0.0))


# --- Exposure ---

MIN_JUMP_STOPS = 0.3
BLOCK_SHARE = 12  # blocks along the shorter side of an image
DARKEST_DN = 4.0  # of blocks whose ratio is measured
BRIGHTEST_DN = 235.0
FEW_BLOCKS = 0.15  # the share of blocks that may change the other way


def _exposure_jumps(part: RecordingPart, reference: Sequence[RecordingPart]) -> ExposureJumps | None:
    """Sudden changes of brightness between successive frames, larger than those of the reference."""
    stops = np.zeros((len(part), len(SIDES)))
    jump_count = 0
    for side in range(len(SIDES)):
        reference_steps = np.concatenate([_brightness_steps(run.images(side)) for run in reference])
        limit = max(MIN_JUMP_STOPS, SIGMAS * robust_sigma(reference_steps))
        steps = _brightness_steps(part.images(side))
        jumps = np.where(np.abs(steps) > limit, steps, 0.0)
        jump_count = max(jump_count, int((jumps != 0).sum()))
        total = np.concatenate([[0.0], np.cumsum(jumps)])
        total -= _most_frequent(total)
        stops[:, side] = np.where(np.abs(total) > limit, total, 0.0)
    if not stops.any():
        return None
    largest = float(np.abs(stops).max())
    evidence = f"brightness jumps {jump_count} times, by up to {largest:.1f} stops from the usual exposure"
    return ExposureJumps(evidence, stops)


def _brightness_steps(images: Sequence[Image]) -> Array:
    """The brightness (F - 1,) of each image relative to the one before, in stops: the median over blocks.

    It is 0 unless nearly all blocks become brighter, or nearly all darker, since dirt darkens only some.
    """
    means = [_block_means(image) for image in images]
    steps = []
    for before, after in pairwise(means):
        is_exposed = (np.minimum(before, after) > DARKEST_DN) & (np.maximum(before, after) < BRIGHTEST_DN)
        is_usable = is_exposed if is_exposed.any() else np.ones_like(is_exposed)
        stops = np.log2((after[is_usable] + 1) / (before[is_usable] + 1))
        low, median, high = np.quantile(stops, (FEW_BLOCKS, 0.5, 1 - FEW_BLOCKS)).tolist()
        has_one_sign = low * high > 0
        steps.append(median if has_one_sign else 0.0)
    return np.array(steps)


def _block_means(image: Image) -> Array:
    """The means of square blocks of an image."""
    block_px = max(min(image.shape) // BLOCK_SHARE, 1)
    size_px = (max(image.shape[1] // block_px, 1), max(image.shape[0] // block_px, 1))
    return cv2.resize(image, size_px, interpolation=cv2.INTER_AREA).astype(float)


def _most_frequent(stops: Array) -> float:
    """The level at which most frames are."""
    levels = np.round(stops / MIN_JUMP_STOPS).astype(int)
    values, counts = np.unique(levels, return_counts=True)
    usual = values[np.argmax(counts)]
    return float(np.median(stops[levels == usual]))


# --- Missing frames ---

MIN_GAP = 1.5  # in periods


def _missing_frames(part: RecordingPart, period_ns: int) -> MissingFrames | None:
    """Frames that are missing according to the stamps."""
    gaps = np.diff(part.t_ns) / period_ns
    missing = int(np.maximum(np.rint(gaps[gaps > MIN_GAP]) - 1, 0).sum())
    if missing == 0:
        return None
    return MissingFrames(f"{missing} of {len(part) + missing} frames are missing by their stamps")


# --- Dirt ---

DETAIL_SHARE = 0.08  # of the width: larger shapes are taken for the scene's light
LOG_OFFSET_DN = 8.0
LAG_S = 1.0  # after which a moving camera sees something else
MIN_RELATIVE_MOTION = 0.5  # of the reference's median: pairs of frames with less motion are not compared
MIN_CORRELATION = 0.2  # by which images 1 s apart are more alike than in the reference
MIN_PATTERN = 0.15  # of the logarithm of grey values
COVERED_SIGMAS = 2.0
CLEAR = 0.85  # a transmission from which a lens counts as clean in what is told
SMOOTHING_PX = 2.0
MIN_CONTRAST_DN = 2.0


def _dirt(part: RecordingPart, reference: Sequence[RecordingPart]) -> Dirt | None:
    """A pattern that stays where it is in images while the camera moves."""
    is_dirty = np.zeros((len(part), len(SIDES)), bool)
    for side in range(len(SIDES)):
        is_dirty[:, side] = _has_fixed_pattern(part, reference, side)
    is_dirty = _steady(is_dirty)
    if not is_dirty.any():
        return None

    shape = part.shots[0].left.shape
    transmission = np.ones((len(SIDES), *shape))
    veil_dn = np.zeros((len(SIDES), *shape))
    covered = []
    for side in np.flatnonzero(is_dirty.any(0)).tolist():
        dirty = [image for image, dirty in zip(part.images(side), is_dirty[:, side], strict=True) if dirty]
        clean = [image for run in reference for image in run.images(side)]
        transmission[side], veil_dn[side], share = _dirt_maps(dirty, clean)
        covered.append(share)
    evidence = f"a fixed pattern covers {max(covered):.0%} of the image {_share(is_dirty)}"
    return Dirt(evidence, is_dirty, transmission, veil_dn)


def _has_fixed_pattern(part: RecordingPart, reference: Sequence[RecordingPart], side: int) -> Frames:
    """Whether images (F,) resemble those one second before or after, although the camera moves."""
    usual = [_correlations(run, side) for run in reference]
    usual_correlation = np.concatenate([correlation for correlation, _, _ in usual])
    usual_motion = np.concatenate([motion for _, motion, _ in usual])
    has_pattern = np.zeros(len(part), bool)
    if not len(usual_correlation):
        return has_pattern

    correlation, motion, pairs = _correlations(part, side)
    median = float(np.median(usual_correlation))
    limit = max(median + SIGMAS * robust_sigma(usual_correlation), median + MIN_CORRELATION)
    is_alike = (correlation > limit) & (motion > MIN_RELATIVE_MOTION * np.median(usual_motion))
    has_pattern[pairs[is_alike].ravel()] = True
    return has_pattern


def _correlations(part: RecordingPart, side: int) -> tuple[Array, Array, NDArray[np.intp]]:
    """The correlations (P,) of the details of images one second apart, the motions (P,) between, and frames (P, 2)."""
    lag_ns = round(LAG_S * NS_PER_S)
    later = np.searchsorted(part.t_ns, part.t_ns + lag_ns)
    first = np.flatnonzero(later < len(part))
    pairs = np.stack([first, later[first]], -1)
    details = [_detail(image) for image in part.images(side)]
    correlation = [float(np.corrcoef(details[a].ravel(), details[b].ravel())[0, 1]) for a, b in pairs]
    motion = [_motion(part.shots[a], part.shots[b]) for a, b in pairs]
    return np.array(correlation), np.array(motion), pairs


def _motion(first: PairShot, last: PairShot) -> float:
    """The translation in m plus the rotation in rad between two true poses; 0 if they are unknown."""
    if first.T_world_left is None or last.T_world_left is None:
        return 0.0
    T = se3.inverse(first.T_world_left) @ last.T_world_left
    rotation_rad = float(se3.rotation_angle(T[None, :3, :3])[0])
    return float(np.linalg.norm(T[:3, 3])) + rotation_rad


def _detail(image: Image) -> NDArray[np.float32]:
    """The logarithm of an image without its large shapes."""
    logarithm = np.log(image.astype(np.float32) + np.float32(LOG_OFFSET_DN))
    large: NDArray[np.float32] = cv2.GaussianBlur(logarithm, (0, 0), DETAIL_SHARE * image.shape[1])
    return np.asarray(logarithm - large, np.float32)


def _dirt_maps(dirty: Sequence[Image], clean: Sequence[Image]) -> tuple[Array, Array, float]:
    """The transmission and the veil (H, W) of dirt, and the share of the image that it covers."""
    pattern = _pattern(dirty, clean)
    # Means of few images of a scene differ by chance too, as two halves of the reference show.
    half = len(clean) // 2
    by_chance = robust_sigma(_pattern(clean[:half], clean[half:]))
    is_covered = np.abs(pattern) > max(MIN_PATTERN, COVERED_SIGMAS * by_chance)

    dirty_mean_dn, dirty_contrast_dn = _moments(dirty)
    clean_mean_dn, clean_contrast_dn = _moments(clean)
    scene_contrast = np.median(dirty_contrast_dn[~is_covered] / clean_contrast_dn[~is_covered])
    transmission = np.clip(dirty_contrast_dn / (scene_contrast * clean_contrast_dn), 0.0, 1.0)
    scene_level = np.median(dirty_mean_dn[~is_covered] / clean_mean_dn[~is_covered])
    veil_dn = dirty_mean_dn - transmission * scene_level * clean_mean_dn
    share = float((is_covered & (transmission < CLEAR)).mean())
    return np.where(is_covered, transmission, 1.0), np.where(is_covered, veil_dn, 0.0), share


def _pattern(images: Sequence[Image], others: Sequence[Image]) -> Array:
    """The smoothed difference (H, W) between the mean details of images and of others."""
    difference = np.mean([_detail(image) for image in images], 0) - np.mean([_detail(image) for image in others], 0)
    return _smoothed(difference)


def _moments(images: Sequence[Image]) -> tuple[Array, Array]:
    """The mean and the standard deviation (H, W) over images, smoothed."""
    stack = np.stack(images).astype(np.float32)
    mean_dn = np.maximum(_smoothed(stack.mean(0)), 1.0)
    contrast_dn = np.maximum(_smoothed(stack.std(0)), MIN_CONTRAST_DN)
    return mean_dn, contrast_dn


def _smoothed(values: Array) -> Array:
    return np.asarray(scipy.ndimage.gaussian_filter(values.astype(float), SMOOTHING_PX), float)


# --- Rotation of the right camera ---

CHUNK_FRAMES = 10  # to which the pair is fitted
CHUNK_STEP = 5
CHUNKS_PER_FRAME = CHUNK_FRAMES / CHUNK_STEP  # chunks overlap, so that each frame's matches count so many times
MIN_ANGLE_DEG = 0.015
AXES = ("roll", "pitch", "yaw")


@dataclass(frozen=True, slots=True)
class _TurnedChunk:
    """Successive frames, and by how much roll, pitch and yaw (3,) of the right camera differ there in degrees.

    `sigma_deg` (3,) are the standard deviations; infinite for an angle that is unknown.
    """

    first: int
    end: int
    difference_deg: Array
    sigma_deg: Array

    @property
    def significant(self) -> Frames:
        """Which angles (3,) differ significantly."""
        limit_deg = np.maximum(MIN_ANGLE_DEG, SIGMAS * self.sigma_deg)
        return np.asarray(np.abs(self.difference_deg) > limit_deg)


def _turned_camera(
    part: RecordingPart,
    pair: StereoPair,
    reference: StereoFit | None,
    is_unchanged: Frames,
) -> TurnedCamera | None:
    """A rotation of the right camera, by fits of the pair to successive unchanged frames and to the reference."""
    if reference is None or len(part) < CHUNK_FRAMES:
        return None
    chunks = _turned_chunks(part, pair, reference, is_unchanged)
    axes = _turned_axes(chunks, len(part))
    if not axes.any():
        return None

    stretch = _turned_stretch(chunks, axes, len(part))
    first = stretch.first
    end = stretch.end
    angle_deg = stretch.angle_deg
    angles_deg = np.zeros((len(part), len(AXES)))
    angles_deg[first:end] = angle_deg
    named_axes = zip(AXES, angle_deg.tolist(), strict=True)
    rotation = ", ".join(f"{name} {angle_deg:+.3f}°" for name, angle_deg in named_axes if angle_deg)
    evidence = f"matches of the pair shift as if the right camera were turned by {rotation} in {end - first} frames"
    return TurnedCamera(evidence, angles_deg, pair)


def _turned_chunks(
    part: RecordingPart, pair: StereoPair, reference: StereoFit, is_unchanged: Frames
) -> list[_TurnedChunk]:
    """The rotation in chunks of unchanged frames that have enough matches."""
    chunks = []
    last_first = len(part) - CHUNK_FRAMES
    for first in (*range(0, last_first, CHUNK_STEP), last_first):
        end = first + CHUNK_FRAMES
        fit = fit_pair([part.shots[first:end]], pair) if is_unchanged[first:end].all() else None
        if fit is None:
            continue
        differences = [
            _difference(fit.roll_deg, reference.roll_deg),
            _difference(fit.pitch_deg, reference.pitch_deg),
            _difference(fit.yaw_deg, reference.yaw_deg),
        ]
        difference_deg = np.array([difference.value for difference in differences])
        sigma_deg = np.array([difference.sigma for difference in differences])
        chunks.append(_TurnedChunk(first, end, difference_deg, sigma_deg))
    return chunks


def _difference(angle: Uncertain | None, usual: Uncertain | None) -> Uncertain:
    """By how much an angle differs from the usual one."""
    if angle is None or usual is None:
        return Uncertain(0.0, np.inf)
    return Uncertain(angle.value - usual.value, float(np.hypot(angle.sigma, usual.sigma)))


@dataclass(frozen=True, slots=True)
class _TurnedStretch:
    """Successive frames in which the right camera is rotated by angles (3,) in degrees, with standard deviations."""

    first: int
    end: int
    angle_deg: Array
    sigma_deg: Array


def _turned_axes(chunks: Sequence[_TurnedChunk], frame_count: int) -> Frames:
    """The axes (3,) about which the rotation of a chunk or of a stretch of chunks is significant.

    A small rotation that is within the uncertainty of each chunk can be significant in all of them together.
    """
    is_turned = np.zeros(len(AXES), bool)
    if not chunks:
        return is_turned
    is_turned |= np.any([chunk.significant for chunk in chunks], axis=0)
    for axis in range(len(AXES)):
        only_axis = np.arange(len(AXES)) == axis
        stretch = _turned_stretch(chunks, only_axis, frame_count)
        limit_deg = max(MIN_ANGLE_DEG, SIGMAS * float(stretch.sigma_deg[axis]))
        is_turned[axis] |= abs(stretch.angle_deg[axis]) > limit_deg
    return is_turned


def _turned_stretch(chunks: Sequence[_TurnedChunk], axes: Frames, frame_count: int) -> _TurnedStretch:
    """The stretch of frames that is rotated about some axes.

    A chunk that is rotated in part of its frames measures that share of the rotation. The stretch and its constant
    rotation fit the chunks best in the sense of weighted least squares, so that its ends are finer than the chunks.
    """
    firsts = np.array([chunk.first for chunk in chunks])
    ends = np.array([chunk.end for chunk in chunks])
    measured_deg = np.array([chunk.difference_deg for chunk in chunks])  # (chunks, 3)
    weights = np.array([chunk.sigma_deg for chunk in chunks]) ** -2.0 * axes

    # Each stretch of frames is a row, the shorter ones before the longer ones of the same first frame.
    stretch_firsts, stretch_lasts = np.triu_indices(frame_count)
    stretch_ends = stretch_lasts + 1
    overlap_frames = np.minimum(ends, stretch_ends[:, None]) - np.maximum(firsts, stretch_firsts[:, None])
    shares = (overlap_frames.clip(0) / (ends - firsts))[..., None]  # (stretches, chunks, 1)
    information = (weights * shares**2).sum(1)  # (stretches, 3)
    projection = (weights * shares * measured_deg).sum(1)
    is_measured = information > 0
    angle_deg = np.divide(projection, information, out=np.zeros_like(information), where=is_measured)
    if not is_measured.any():
        return _TurnedStretch(0, frame_count, np.zeros(len(AXES)), np.full(len(AXES), np.inf))

    # The decrease of the squared residuals relative to no rotation.
    gains = (angle_deg * projection).sum(1)
    best = int(np.where(is_measured.any(1), gains, -np.inf).argmax())
    unknown = np.full(len(AXES), np.inf)
    variance = np.divide(CHUNKS_PER_FRAME, information[best], out=unknown, where=is_measured[best])
    return _TurnedStretch(int(stretch_firsts[best]), int(stretch_ends[best]), angle_deg[best], np.sqrt(variance))
