"""Changes of images are found where they are, and none where there is none."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.analysis.pictures import HEIGHT_PX, PERIOD_NS, WIDTH_PX, pair, part
from vobench.analysis.picture_change import BLUR, DIRT, DROPPED, EXPOSURE, NOISE, TURNED, turned
from vobench.analysis.picture_evidence import (
    ImageEvidence,
    RecordingPart,
    _turned_axes,
    _turned_stretch,
    _TurnedChunk,
    find_changes,
)
from vobench.analysis.stereo_matches import PairShot

COUNT = 40
CHANGED = slice(12, 30)
Change = Callable[[np.ndarray, int], np.ndarray]


def found(change: Change | None = None, *, only_right: bool = False, dropped: tuple[int, ...] = ()) -> ImageEvidence:
    """What is found if some frames are changed."""
    original = part(100, COUNT)
    shots = list(original.shots)
    for index in range(COUNT)[CHANGED] if change else ():
        shot = shots[index]
        left = shot.left if only_right else change(shot.left, index)
        shots[index] = PairShot(left, change(shot.right, index), shot.T_world_left)
    kept = [index for index in range(COUNT) if index not in dropped]
    changed = RecordingPart(original.t_ns[kept], tuple(shots[index] for index in kept))
    return find_changes(changed, [part(10, 14), part(40, 14), part(200, 14)], pair(), period_ns=PERIOD_NS)


def only(evidence: ImageEvidence, name: str):
    """The only change that was found."""
    assert [change.name for change in evidence.changes] == [name]
    return evidence.changes[0]


def where(strength: np.ndarray) -> tuple[int, int]:
    """The first changed frame, and the one after the last."""
    frames = np.flatnonzero(strength.any(1))
    return int(frames[0]), int(frames[-1]) + 1


def test_nothing_is_found_where_nothing_has_changed() -> None:
    evidence = found()
    assert evidence.changes == ()
    assert evidence.noise_dn == pytest.approx(1.0, rel=0.2)


def test_blur_is_found_in_its_frames_with_its_size() -> None:
    blur = only(found(lambda image, _: cv2.GaussianBlur(image, (0, 0), 2.0)), BLUR)
    assert where(blur.sigma_px) == (12, 30)
    assert blur.sigma_px[CHANGED] == pytest.approx(2.0, abs=0.7)


@pytest.mark.slow
def test_blur_of_one_eye_is_found_in_that_eye() -> None:
    blur = only(found(lambda image, _: cv2.GaussianBlur(image, (0, 0), 2.0), only_right=True), BLUR)
    assert not blur.sigma_px[:, 0].any()
    assert "in the right image of 18 of 40 frames" in blur.evidence


@pytest.mark.slow
def test_noise_is_found_in_its_frames_with_its_size() -> None:
    def noisy(image: np.ndarray, index: int) -> np.ndarray:
        values = image + np.random.default_rng(index).normal(0, 8, image.shape)
        return np.clip(np.rint(values), 0, 255).astype(np.uint8)

    noise = only(found(noisy), NOISE)
    assert where(noise.sigma_dn) == (12, 30)
    assert noise.sigma_dn[CHANGED] == pytest.approx(8, rel=0.25)


@pytest.mark.slow
def test_exposure_jumps_are_found_with_their_stops() -> None:
    jumps = only(found(lambda image, index: (image * (0.25 if index % 4 < 2 else 1.0)).astype(np.uint8)), EXPOSURE)
    is_dark = np.zeros(COUNT, bool)
    is_dark[CHANGED] = np.arange(12, 30) % 4 < 2
    assert jumps.stops[is_dark] == pytest.approx(-2, abs=0.15)
    assert not jumps.stops[~is_dark].any()


def test_missing_frames_are_counted_by_their_stamps() -> None:
    missing = only(found(dropped=(14, 15, 16, 20)), DROPPED)
    assert missing.evidence.startswith("4 of 40 frames are missing")


@pytest.mark.slow
def test_dirt_is_found_with_what_it_lets_through() -> None:
    rng = np.random.default_rng(3)
    loss = np.zeros((HEIGHT_PX, WIDTH_PX))
    for _ in range(25):
        center = (int(rng.integers(0, WIDTH_PX)), int(rng.integers(0, HEIGHT_PX)))
        cv2.circle(loss, center, int(rng.integers(4, 9)), 0.9, -1)

    dirt = only(found(lambda image, _: np.rint(image * (1 - loss)).astype(np.uint8)), DIRT)
    assert where(dirt.is_dirty)[0] == pytest.approx(12, abs=2)
    assert where(dirt.is_dirty)[1] == pytest.approx(30, abs=2)
    is_clear = loss == 0
    inner = cv2.erode(loss, np.ones((5, 5))) > 0
    assert dirt.transmission[:, inner].mean() < 0.5
    assert dirt.transmission[:, is_clear].mean() > 0.85


@pytest.mark.slow
def test_a_turned_camera_is_found_with_its_angles() -> None:
    angles_deg = np.array([0.0, 0.2, 0.0])

    def turn(image: np.ndarray, _: int) -> np.ndarray:
        return np.clip(np.rint(turned(image.astype(np.float32), angles_deg, pair())), 0, 255).astype(np.uint8)

    evidence = found(turn, only_right=True)
    camera = only(evidence, TURNED)
    first, end = where(camera.angles_deg)
    assert (first, end) == (pytest.approx(12, abs=3), pytest.approx(30, abs=3))
    assert camera.angles_deg[18:24, 1] == pytest.approx(0.2, abs=0.02)


@pytest.mark.parametrize(("first", "end"), [(0, 28), (3, 31), (12, 33), (22, 50), (0, 50)])
def test_the_ends_of_a_turned_stretch_are_finer_than_the_chunks_that_measure_it(first: int, end: int) -> None:
    rng = np.random.default_rng(0)
    sigma_deg = 0.003
    chunks = []
    for chunk_first in range(0, 41, 5):
        chunk_end = chunk_first + 10
        turned_frames = max(min(end, chunk_end) - max(first, chunk_first), 0)
        measured_deg = np.array([0.0, 0.0, 0.05 * turned_frames / 10]) + rng.normal(0, sigma_deg, 3)
        chunks.append(_TurnedChunk(chunk_first, chunk_end, measured_deg, np.full(3, sigma_deg)))
    is_yaw = np.array([False, False, True])
    stretch = _turned_stretch(chunks, is_yaw, 50)
    assert (stretch.first, stretch.end) == (pytest.approx(first, abs=1), pytest.approx(end, abs=1))
    assert stretch.angle_deg == pytest.approx([0, 0, 0.05], abs=0.003)


def measured_chunks(yaw_deg: float, seed: int, sigma_deg: float = 0.015) -> list[_TurnedChunk]:
    """Overlapping chunks of 50 frames, rotated by a yaw from frame 10 to 40, with the noise of their frames."""
    rng = np.random.default_rng(seed)
    by_frame_deg = rng.normal(0, sigma_deg * np.sqrt(10), (50, 3))
    by_frame_deg[10:40, 2] += yaw_deg
    chunks = []
    for first in range(0, 41, 5):
        difference_deg = by_frame_deg[first : first + 10].mean(0)
        chunks.append(_TurnedChunk(first, first + 10, difference_deg, np.full(3, sigma_deg)))
    return chunks


def test_a_yaw_within_the_uncertainty_of_each_chunk_is_found_in_all_of_them_together() -> None:
    right = 0
    for seed in range(50):
        chunks = measured_chunks(0.07, seed)
        right += _turned_axes(chunks, 50).tolist() == [False, False, True]
    assert right >= 40
    alike = [_TurnedChunk(chunk.first, chunk.end, chunk.sigma_deg * 3, chunk.sigma_deg) for chunk in chunks]
    assert not any(chunk.significant.any() for chunk in alike)
    assert _turned_axes(alike, 50).all()


def test_no_axis_is_found_turned_in_noise_alone() -> None:
    for seed in range(50):
        assert not _turned_axes(measured_chunks(0.0, seed), 50).any()


@pytest.mark.slow
def test_a_camera_that_stands_still_is_not_taken_for_dirt() -> None:
    standing = part(100, 1)
    shots = tuple(replace(standing.shots[0]) for _ in range(COUNT))
    still = RecordingPart((np.arange(COUNT) * PERIOD_NS).astype(np.int64), shots)
    evidence = find_changes(still, [part(10, 14), part(40, 14), part(200, 14)], pair(), period_ns=PERIOD_NS)
    assert DIRT not in {change.name for change in evidence.changes}
