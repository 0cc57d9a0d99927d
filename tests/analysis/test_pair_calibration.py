"""Errors of calibration that were put into matches and tracks are found, as certain as they are stated."""

from dataclasses import replace

import numpy as np
import pytest

from tests.benchmarks.loading import load
from vobench.analysis.pair_calibration import (
    REGIONS,
    _region_correlation,
    _regions,
    calibrate,
    center_px,
    fit_calibration,
)
from vobench.analysis.pair_parameter import BASELINE, FOCAL, LENS_TERMS, PITCH, RIGHT_FOCAL, ROLL, YAW
from vobench.analysis.stereo_matches import RowMatches
from vobench.estimator.stereo import stereo_pair
from vobench.geometry.rig import CalibrationError, CameraError

simulation = load("pair_calibration")
PAIR = stereo_pair(simulation.RIG, "test")
EXACT = simulation.Noise(each=1e-4, of_point=0, of_region=0, outliers=0)
WHITE = simulation.Noise(of_point=0, of_region=0, outliers=0)
ROTATED = CalibrationError(
    right_roll_deg=0.06, right_pitch_deg=-0.04, right_yaw_deg=0.05, right=CameraError(focal_ratio=4e-4)
)


def measured(error: CalibrationError, noise=EXACT, *, has_truth: bool = True, seed: int = 1):
    return simulation.measure_pair(error, np.random.default_rng(seed), has_truth=has_truth, noise=noise)


@pytest.mark.parametrize("has_truth", [True, False])
def test_rotations_and_focal_lengths_are_found_exactly_without_noise(has_truth: bool) -> None:
    given = measured(ROTATED, has_truth=has_truth)
    found = fit_calibration(given.rows, given.motions, PAIR, with_lens_terms=False)
    for name, value in {ROLL: 0.06, PITCH: -0.04, YAW: 0.05, RIGHT_FOCAL: 4e-4}.items():
        assert found.value(name)[0] == pytest.approx(value, rel=0.02), name
    assert found.value("unknown") == (0.0, 0.0)
    (offset_px,), _ = found.disparity_error(center_px(PAIR))
    assert offset_px == pytest.approx(359 * np.deg2rad(0.05), rel=0.02)
    (shift_px,), _ = found.row_error(center_px(PAIR))
    assert shift_px == pytest.approx(-359 * np.deg2rad(0.04), rel=0.02)
    assert found.row_twist()[0] == pytest.approx(-359 * np.deg2rad(0.05), rel=0.03)


def test_noise_is_not_taken_for_an_error_of_both_cameras() -> None:
    given = measured(CalibrationError(), WHITE)
    found = fit_calibration(given.rows, given.motions, PAIR, with_lens_terms=False)
    for name in (FOCAL, BASELINE):
        assert abs(found.value(name)[0]) < 0.004, name


def test_an_error_of_the_lens_is_told_from_rotations_by_rows_and_motion() -> None:
    error = CalibrationError(right=CameraError(tangential=(0.0, -0.005), center_px=(1.0, 0.0)))
    given = measured(error, simulation.Noise())
    found = calibrate(given.rows, given.motions, PAIR)
    assert found.has_lens_error
    assert found.is_offset_determined
    places_px = np.array([[0.25, 0.5], [0.5, 0.5], [0.75, 0.5]]) * [620, 188]
    truth_px = -simulation.true_right_shift_px(error, places_px)[:, 0]
    assert truth_px[0] - truth_px[1] > 0.9
    offsets_px, sigmas_px = found.calibration.disparity_error(places_px)
    assert (np.abs(offsets_px - truth_px) < 3 * sigmas_px).all()
    assert sigmas_px.max() < 0.2
    assert found.calibration.row_twist()[0] == pytest.approx(2 * 359 * -0.005, rel=0.1)
    assert not calibrate(*_parts(measured(ROTATED, simulation.Noise())), PAIR).has_lens_error


def _parts(given) -> tuple:
    return given.rows, given.motions


def test_without_motion_the_offset_is_not_determined_and_the_roll_is() -> None:
    given = measured(ROTATED, simulation.Noise())
    found = calibrate(given.rows, (), PAIR)
    assert not found.is_offset_determined
    assert not found.has_lens_error
    assert found.calibration.value(ROLL)[0] == pytest.approx(0.06, abs=0.01)
    assert found.with_lens_terms.wald_p_value(LENS_TERMS) > 0.01


def test_noise_that_neighbours_share_makes_errors_less_certain() -> None:
    sigmas = []
    for of_region in (0.0, 0.1):
        noise = replace(simulation.Noise(of_point=0, outliers=0), of_region=of_region)
        given = measured(ROTATED, noise)
        found = fit_calibration(given.rows, given.motions, PAIR, with_lens_terms=False)
        sigmas.append(found.value(ROLL)[1])
    assert sigmas[1] > 1.5 * sigmas[0]


def test_matches_in_few_regions_say_nothing() -> None:
    rng = np.random.default_rng(0)
    left_px = rng.uniform([10, 10], [60, 30], (100, 2))
    rows = RowMatches(left_px, left_px - [4, 0], rng.normal(0, 0.1, 100), np.zeros(100, np.int64))
    assert calibrate(rows, (), PAIR) is None


def test_regions_are_numbered_by_place_and_run_and_near_ones_are_correlated() -> None:
    left_px = np.array([[0.0, 0.0], [619.0, 187.0], [0.0, 0.0]])
    assert _regions(left_px, np.array([0, 0, 2]), PAIR).tolist() == [0, REGIONS - 1, 2 * REGIONS]
    correlation = _region_correlation()
    np.testing.assert_array_equal(np.diag(correlation), 1)
    np.testing.assert_array_equal(correlation, correlation.T)
    assert np.linalg.eigvalsh(correlation).min() > 0
    assert correlation[0, 1] > correlation[0, 2] > correlation[0, REGIONS - 1]
