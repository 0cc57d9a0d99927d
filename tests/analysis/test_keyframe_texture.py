"""The noise of keyframes is removed, and faint textures are not."""

import numpy as np

from tests.analysis.pictures import HEIGHT_PX, NOISE_DN, STEP_PX, WALL, WIDTH_PX, pair, view
from tests.analysis.test_keyframe_depth import shots_along_the_wall
from vobench.analysis.image_noise import denoised
from vobench.analysis.keyframe_depth import keyframes_of, view_geometry
from vobench.analysis.keyframe_texture import without_noise


def rms(difference: np.ndarray) -> float:
    return float(np.sqrt(np.mean(difference**2)))


def test_the_mean_of_keyframes_has_less_noise_than_one_and_no_less_texture() -> None:
    keyframes = keyframes_of(shots_along_the_wall(7), pair(), view_geometry(pair()), most_disparity_px=30)
    middle = without_noise(keyframes, view_geometry(pair()))[3]
    column_px = 20 + 3 * STEP_PX
    inner = np.s_[10:-10, 40:-40]  # where most keyframes see the wall
    true = WALL[:, column_px : column_px + WIDTH_PX][inner]
    assert middle.image.shape == (HEIGHT_PX, WIDTH_PX)
    error = middle.image[inner] - true
    is_flat = np.hypot(*np.gradient(true)) < 0.5
    assert rms(error[is_flat]) < 0.65 * NOISE_DN
    assert rms(error) < 1.5 * NOISE_DN


def test_noise_is_removed_within_an_image() -> None:
    noisy = view(40, 0)
    true = WALL[:, 40 : 40 + WIDTH_PX]
    assert rms(denoised(noisy, NOISE_DN) - true) < 0.7 * rms(noisy - true)
    assert denoised(noisy, 0.0) is noisy
