"""The eye sees the whole path, whatever its shape, and stands where a path looks long."""

import numpy as np
import pytest

from vobench.report.viewpoint import eye_and_target, frustum_m, grid_spacing_m, near_truth

PATHS = {
    "straight": np.linspace([0, 0, 0.4], [10, 0, 0.4], 50),
    "across": np.linspace([0, -3, 0.4], [0, 3, 0.4], 50),
    "circle": np.array([[2 * np.cos(a), 2 * np.sin(a), 0.4] for a in np.linspace(0, 6, 50)]),
    "at rest": np.tile([1.0, 2.0, 0.4], (20, 1)),
    "single": np.array([[1.0, 2.0, 0.4]]),
}


@pytest.fixture(params=PATHS.values(), ids=PATHS.keys())
def points(request):
    return request.param


def test_whole_path_lies_within_forty_degrees_of_the_line_of_sight(points):
    eye, target = eye_and_target(points)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    rays = points - eye
    cosines = rays @ ahead / np.linalg.norm(rays, axis=1)
    assert cosines.min() > np.cos(np.deg2rad(40))


def test_eye_is_above_the_path_and_not_on_it(points):
    eye, target = eye_and_target(points)
    assert eye[2] > points[:, 2].max()
    assert np.linalg.norm(eye - target) > 0.3


def test_eye_looks_across_a_straight_path():
    for name in ("straight", "across"):
        eye, target = eye_and_target(PATHS[name])
        along = PATHS[name][-1] - PATHS[name][0]
        assert abs((target - eye) @ along) < 1e-9 * np.linalg.norm(along)


def test_eye_moves_with_the_scene(points):
    eye, target = eye_and_target(points)
    shifted_eye, shifted_target = eye_and_target(points + np.array([5, -7, 1]))
    np.testing.assert_allclose(shifted_eye - eye, [5, -7, 1])
    np.testing.assert_allclose(shifted_target - target, [5, -7, 1])


def test_estimate_that_flies_off_does_not_change_the_view():
    truth = PATHS["circle"]
    near = truth + np.array([0.1, 0, 0])
    flown = np.concatenate([near, [[1e6, 0, 0]]])
    np.testing.assert_array_equal(near_truth(truth, flown), near_truth(truth, near))


@pytest.mark.parametrize("extent_m", [0.5, 1.0, 7.0, 20.0, 300.0])
def test_grid_has_three_to_thirty_lines(extent_m):
    spacing_m = grid_spacing_m(extent_m)
    assert 3 <= extent_m / spacing_m <= 30 + 1e-9
    assert np.log10(spacing_m) == pytest.approx(round(np.log10(spacing_m)))


def test_a_camera_is_drawn_in_proportion_to_its_path():
    assert frustum_m(2 * PATHS["circle"]) == pytest.approx(2 * frustum_m(PATHS["circle"]))
    assert frustum_m(PATHS["straight"]) == pytest.approx(0.8)
    assert frustum_m(PATHS["at rest"]) == pytest.approx(0.04)


def test_the_eye_is_as_far_away_as_the_path_is_large():
    for path in (PATHS["straight"], PATHS["circle"]):
        eye, target = eye_and_target(path)
        radius_m = np.linalg.norm(np.ptp(path, axis=0)) / 2
        assert np.linalg.norm(eye - target) == pytest.approx(1.6 * radius_m)
        assert np.rad2deg(np.arcsin((eye - target)[2] / (1.6 * radius_m))) == pytest.approx(38.0)
        assert eye[1] < target[1]


def test_an_estimate_counts_up_to_twice_the_radius_from_the_middle():
    truth = PATHS["straight"]  # of 10 m around (5, 0)
    near, far = np.array([[14.9, 0, 0.4]]), np.array([[15.1, 0, 0.4]])
    assert len(near_truth(truth, near)) == len(truth) + 1
    assert len(near_truth(truth, far)) == len(truth)
