"""The eye sees the whole path, whatever its shape, and stands where a path looks long."""

import numpy as np
import pytest

from vobench.report import blueprint as bp

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
    eye, target = bp.eye_and_target(points)
    ahead = (target - eye) / np.linalg.norm(target - eye)
    rays = points - eye
    cosines = rays @ ahead / np.linalg.norm(rays, axis=1)
    assert cosines.min() > np.cos(np.deg2rad(40))


def test_eye_is_above_the_path_and_not_on_it(points):
    eye, target = bp.eye_and_target(points)
    assert eye[2] > points[:, 2].max()
    assert np.linalg.norm(eye - target) > 0.3


def test_eye_looks_across_a_straight_path():
    for name in ("straight", "across"):
        eye, target = bp.eye_and_target(PATHS[name])
        along = PATHS[name][-1] - PATHS[name][0]
        assert abs((target - eye) @ along) < 1e-9 * np.linalg.norm(along)


def test_eye_moves_with_the_scene(points):
    eye, target = bp.eye_and_target(points)
    shifted_eye, shifted_target = bp.eye_and_target(points + np.array([5, -7, 1]))
    np.testing.assert_allclose(shifted_eye - eye, [5, -7, 1])
    np.testing.assert_allclose(shifted_target - target, [5, -7, 1])


def test_estimate_that_flies_off_does_not_change_the_view():
    truth = PATHS["circle"]
    near = truth + np.array([0.1, 0, 0])
    flown = np.concatenate([near, [[1e6, 0, 0]]])
    np.testing.assert_array_equal(bp._near_truth(truth, flown), bp._near_truth(truth, near))


@pytest.mark.parametrize("extent_m", [0.5, 1.0, 7.0, 20.0, 300.0])
def test_grid_has_three_to_thirty_lines(extent_m):
    spacing_m = bp.grid_spacing_m(extent_m)
    assert 3 <= extent_m / spacing_m <= 30 + 1e-9
    assert np.log10(spacing_m) == pytest.approx(round(np.log10(spacing_m)))
