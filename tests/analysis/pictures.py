"""Images of a camera that moves along a wall of rectangles, for tests."""

import cv2
import numpy as np

from vobench.analysis.picture_evidence import RecordingPart
from vobench.analysis.stereo_matches import PairShot
from vobench.estimator.stereo import StereoPair, stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig, stereo_rig

HEIGHT_PX = 120
WIDTH_PX = 180
STEP_PX = 7  # from frame to frame
DISPARITY_PX = 12
NOISE_DN = 1.0
PERIOD_NS = 10**8


def wall() -> np.ndarray:
    """A wide image of rectangles of even grey."""
    rng = np.random.default_rng(0)
    size = (HEIGHT_PX, 2400)
    picture = np.full(size, 128.0)
    for _ in range(900):
        x = rng.integers(0, size[1])
        y = rng.integers(0, size[0])
        picture[y : y + rng.integers(8, 40), x : x + rng.integers(8, 50)] = rng.uniform(40, 210)
    return cv2.GaussianBlur(picture, (0, 0), 0.8)


WALL = wall()


def rig() -> Rig:
    lens = Pinhole(WIDTH_PX, HEIGHT_PX, 200.0, 200.0, WIDTH_PX / 2 - 0.5, HEIGHT_PX / 2 - 0.5)
    return stereo_rig(lens, pitch_deg=0)


def pair() -> StereoPair:
    return stereo_pair(rig(), "a test")


def view(column_px: int, seed: int) -> np.ndarray:
    """The image of the wall from a column on, with noise."""
    rng = np.random.default_rng(seed)
    noisy = WALL[:, column_px : column_px + WIDTH_PX] + rng.normal(0, NOISE_DN, (HEIGHT_PX, WIDTH_PX))
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def part(first: int, count: int) -> RecordingPart:
    """Successive frames of the recording."""
    shots = []
    for frame in range(first, first + count):
        column_px = 20 + STEP_PX * frame
        T_world_left = se3.transform(np.eye(3), np.array([0.05 * frame, 0.0, 0.0]))
        shots.append(PairShot(view(column_px, 2 * frame), view(column_px + DISPARITY_PX, 2 * frame + 1), T_world_left))
    t_ns = (np.arange(first, first + count) * PERIOD_NS).astype(np.int64)
    return RecordingPart(t_ns, tuple(shots))
