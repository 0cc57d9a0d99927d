"""Matches of painted walls lie where the walls are, and gains are those that images were made with."""

import numpy as np
import pytest

from tests.analysis.test_stereo_fit import LENS, RIG, WALLS, shots, turned
from vobench.analysis.patch_refinement import SLANT, refined
from vobench.analysis.stereo_matches import (
    MatchedShot,
    PairShot,
    all_matches,
    gain_of,
    match_shots,
    row_errors,
)
from vobench.estimator.stereo import stereo_pair
from vobench.geometry.rig import CalibrationError

PAIR = stereo_pair(RIG, "test")


@pytest.fixture(scope="module")
def shot() -> PairShot:
    return shots(CalibrationError())[0]


@pytest.fixture(scope="module")
def matched(shot: PairShot) -> MatchedShot:
    return match_shots([shot], PAIR)[0]


def true_disparity_px(points: np.ndarray) -> np.ndarray:
    rays = LENS.rays(points)
    z_m = np.min([np.where(rays @ n > 0, m / (rays @ n), np.inf) for n, m in WALLS], axis=0) * rays[:, 2]
    return 300 * 0.2 / z_m


def test_places_on_slanted_walls_are_found_between_pixels(shot: PairShot) -> None:
    points = np.float32([[x, y] for x in range(80, 290, 15) for y in range(40, 210, 15)]) + 0.3
    there = points - np.c_[true_disparity_px(points), np.zeros(len(points))]
    found, settled = refined(shot.left, shot.right, points, np.float32(there + 0.5), shape=SLANT)
    assert settled.mean() > 0.8
    assert np.median(np.abs(found - there)[settled], axis=0) == pytest.approx([0, 0], abs=0.04)
    assert not refined(shot.left, shot.right, points, np.float32(there + 9), shape=SLANT)[1].all()


def test_disparities_are_those_of_the_walls_on_the_same_rows(matched: MatchedShot) -> None:
    assert len(matched.disparity_px) > 300
    error_px = matched.disparity_px - true_disparity_px(matched.left_px)
    assert abs(np.median(error_px)) < 0.02
    assert np.median(np.abs(error_px)) < 0.05
    assert np.median(np.abs((matched.right_px - matched.left_px)[:, 1])) < 0.05


def test_matches_lie_evenly_between_pixels(matched: MatchedShot) -> None:
    fractions = np.modf(matched.left_px.astype(float))[0]
    assert fractions.mean(0) == pytest.approx([0.5, 0.5], abs=0.03)
    assert fractions.std(0) == pytest.approx([12**-0.5] * 2, rel=0.05)


def test_matches_of_all_shots_are_joined_with_the_number_of_their_run(matched: MatchedShot) -> None:
    joined = all_matches([[matched, matched], [matched]], PAIR)
    count = len(matched.disparity_px)
    assert joined.window.tolist() == [0] * (2 * count) + [1] * count
    assert len(joined.place) == len(joined.row_px) == len(joined.disparity_px) == 3 * count
    np.testing.assert_allclose(joined.place[:count], (matched.right_px - [159.5, 119.5]) / 300, atol=1e-6)
    np.testing.assert_allclose(joined.row_px[:count], (matched.right_px - matched.left_px)[:, 1], atol=1e-4)


def test_rows_are_right_minus_left_and_follow_the_pitch(shot: PairShot) -> None:
    assert np.median(row_errors(shot, PAIR)) == pytest.approx(0, abs=0.05)
    for pitch_deg in (0.2, -0.2):
        pitched = shots(turned(0.0, pitch_deg, 0.0))[0]
        assert np.median(row_errors(pitched, PAIR)) == pytest.approx(300 * np.deg2rad(pitch_deg), abs=0.15)


# --- Gain ---


def shot_with_matches(left: float, right: float, *, count: int = 20) -> MatchedShot:
    images = [np.full((240, 320), value, np.uint8) for value in (left, right)]
    places = np.random.default_rng(0).uniform(30, 200, (count, 2)).astype(np.float32)
    return MatchedShot(PairShot(*images), places, places - np.float32([5, 0]), np.full(count, 5.0))


@pytest.mark.parametrize(("left", "right"), [(100, 50), (100, 120), (200, 200), (6, 3)])
def test_the_gain_is_right_over_left(left: float, right: float) -> None:
    assert gain_of(shot_with_matches(left, right)) == pytest.approx(right / left)


@pytest.mark.parametrize(("left", "right"), [(5, 5), (3, 100), (240, 100), (100, 240), (255, 255)])
def test_dark_or_saturated_places_have_no_gain(left: float, right: float) -> None:
    assert np.isnan(gain_of(shot_with_matches(left, right)))
    assert np.isnan(gain_of(shot_with_matches(100, 100, count=0)))


def test_the_gain_is_taken_around_each_match_and_is_the_median(shot: PairShot) -> None:
    matches = shot_with_matches(100, 80)
    left = matches.shot.left.copy()
    left[:, 200:] = 200  # beyond all matches but for their surroundings
    changed = MatchedShot(PairShot(left, matches.shot.right), matches.left_px, matches.right_px, matches.disparity_px)
    assert gain_of(changed) == pytest.approx(0.8)
