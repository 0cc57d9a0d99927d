"""Statistics of pictures that were made with known ones."""

from itertools import pairwise

import cv2
import numpy as np
import pytest

from vobench.analysis.image_noise import noise_dn
from vobench.analysis.image_statistics import edge_px, gradients, spectrum
from vobench.analysis.realism import STATISTICS, WINDOW, Shot, measure, says, window_starts
from vobench.errors import InputError
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig

RIG = stereo_rig(Pinhole(320, 240, 300.0, 300.0, 159.5, 119.5), pitch_deg=0)


def boards(sigma_px: float = 0.8) -> np.ndarray:
    """A picture (240, 320) of rectangles of even grey, blurred."""
    rng, picture = np.random.default_rng(0), np.full((240, 320), 128.0)
    for _ in range(40):
        x, y, grey = rng.integers(0, 320), rng.integers(0, 240), rng.uniform(40, 220)
        picture[y : y + rng.integers(10, 60), x : x + rng.integers(10, 80)] = grey
    return cv2.GaussianBlur(picture, (0, 0), sigma_px)


def as_grey(picture: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("sigma", [1.0, 2.0, 5.0])
def test_noise_is_found_beside_texture(sigma):
    noisy = boards() + np.random.default_rng(1).normal(0, sigma, (240, 320))
    assert noise_dn(as_grey(noisy))[0] == pytest.approx(sigma, rel=0.1)


def test_a_picture_without_noise_has_little():
    assert noise_dn(as_grey(boards()))[0] < 0.4


def test_a_power_law_has_its_slope():
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(512), np.fft.fftfreq(512)))
    frequency[0, 0] = np.inf
    white = np.fft.fft2(np.random.default_rng(2).standard_normal((512, 512)))
    picture = np.fft.ifft2(white * frequency**-1.4).real
    assert spectrum([as_grey(128 + 40 * picture / picture.std())])[0] == pytest.approx(-2.8, abs=0.1)


def test_more_blur_makes_edges_wider():
    widths = [edge_px(as_grey(boards(s)), gradients(as_grey(boards(s)))) for s in (0.6, 0.9, 1.3)]
    assert widths == sorted(widths)
    assert widths[2] > 1.4 * widths[0]


def test_runs_of_pictures_lie_apart_and_within_the_recording():
    for count in (2, 13, 14, 30, 42, 500):
        starts = window_starts(count)
        assert all(later - earlier >= WINDOW for earlier, later in pairwise(starts))
        assert starts[0] == 0
        assert starts[-1] + WINDOW <= max(count, WINDOW)
    with pytest.raises(InputError, match="2 successive pictures"):
        window_starts(1)


def test_one_eye_has_eight_statistics_and_a_sentence():
    picture = as_grey(boards())
    found = measure([[Shot(picture, None)] * 3], RIG)
    assert list(found.values) == [s.name for s in STATISTICS][1:]
    assert found.values["tracks_home"] == 100
    assert says(found)[0].startswith("There is no stereo pair to judge")


def test_a_statistic_says_what_brings_it_into_its_band():
    burnt = STATISTICS[-1]
    assert burnt.knob(5.0) == ""
    assert burnt.knob(0.0).startswith("more exposure_gain")
    assert burnt.verdict(20.0) == "high"
