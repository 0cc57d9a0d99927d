"""Vignetting and exposures that are put into keyframes are found again."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.pictures import pair
from tests.analysis.test_keyframe_depth import shots_along_the_wall
from vobench.analysis.keyframe_depth import Keyframe, keyframes_of, view_geometry
from vobench.analysis.vignetting_fit import corrected, cosines, fit_photometry
from vobench.geometry.se3 import Array

COUNT = 8


@pytest.fixture(scope="module")
def keyframes() -> list[Keyframe]:
    return keyframes_of(shots_along_the_wall(COUNT), pair(), view_geometry(pair()), most_disparity_px=30)


@pytest.fixture(scope="module")
def cosine() -> Array:
    return cosines(pair(), view_geometry(pair()))


def shaded(keyframes: list[Keyframe], falloff: Array, relative_grey: Array) -> list[Keyframe]:
    """The keyframes with another falloff and other exposures."""
    images = []
    for keyframe, relative in zip(keyframes, relative_grey, strict=True):
        image = np.clip(np.rint(keyframe.image * falloff * relative), 0, 255).astype(np.uint8)
        images.append(replace(keyframe, image=image))
    return images


def test_cosines_are_one_on_the_axis_and_smallest_in_the_corners(cosine: Array) -> None:
    assert cosine.max() == pytest.approx(1, abs=1e-4)
    assert cosine.min() == pytest.approx(cosine[0, 0])
    K = pair().K
    corner = np.array([K[0, 2] / K[0, 0], K[1, 2] / K[1, 1], 1])
    assert cosine[0, 0] == pytest.approx(1 / np.linalg.norm(corner))


@pytest.mark.parametrize("exponent", [0.0, 1.0, 3.0])
def test_the_exponent_is_found(keyframes: list[Keyframe], cosine: Array, exponent: float) -> None:
    dimmed = shaded(keyframes, cosine**exponent, np.ones(COUNT))
    found = fit_photometry(dimmed, cosine, view_geometry(pair()))
    assert found.exponent == pytest.approx(exponent, abs=0.15)
    assert found.relative_grey == pytest.approx(np.ones(COUNT), abs=0.01)


def test_exposures_are_found_and_corrected(keyframes: list[Keyframe], cosine: Array) -> None:
    relative_grey = np.geomspace(0.8, 1.1, COUNT)
    dimmed = shaded(keyframes, cosine**1.0, relative_grey)
    found = fit_photometry(dimmed, cosine, view_geometry(pair()))
    geometric_mean = np.exp(np.log(relative_grey).mean())
    assert found.relative_grey == pytest.approx(relative_grey / geometric_mean, rel=0.02)

    even = corrected(dimmed, found, cosine)
    ratios = [
        image.image.astype(float).mean() / keyframe.image.mean()
        for image, keyframe in zip(even, keyframes, strict=True)
    ]
    assert np.ptp(ratios) < 0.02 * np.mean(ratios)
    assert all(image.image.max() <= 255 for image in even)


def test_a_single_keyframe_says_nothing(keyframes: list[Keyframe], cosine: Array) -> None:
    found = fit_photometry(keyframes[:1], cosine, view_geometry(pair()))
    assert found.exponent == 0
    assert found.relative_grey.tolist() == [1.0]
