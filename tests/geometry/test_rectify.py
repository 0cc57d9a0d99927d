"""In rectified views a point has one row, and its disparity tells its depth."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.rig import LENSES, PRESETS, Rig, mounted_rig, rectification, stereo_rig

RIGS = {name: mounted_rig(p.left, p.right, p.T_left_right, pitch_deg=20) for name, p in PRESETS.items()}
PLAIN = stereo_rig(LENSES["paper_literal"], pitch_deg=20)
POINTS = np.random.default_rng(1).uniform([-0.5, -0.4, 0.5], [0.5, 0.4, 4.0], (200, 3))


@pytest.mark.parametrize("rig", RIGS.values(), ids=list(RIGS))
def test_a_point_has_the_same_row_in_both_views_and_its_disparity_tells_its_depth(rig: Rig) -> None:
    views = rectification(rig)
    assert views is not None
    in_left, in_right = POINTS, se3.apply(se3.inverse(rig.T_left_right), POINTS)
    left, right = (
        (camera.rays(camera.project(points)) @ R.T) @ views.K.T
        for camera, points, R in (
            (rig.left, in_left, views.R_view_left),
            (rig.right, in_right, views.R_view_right),
        )
    )
    left, right = left[:, :2] / left[:, 2:], right[:, :2] / right[:, 2:]
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=1e-7)
    depth_m = views.K[0, 0] * views.baseline_m / (left - right)[:, 0]
    np.testing.assert_allclose(depth_m, (POINTS @ views.R_view_left.T)[:, 2], rtol=1e-7)
    P_point = np.c_[POINTS @ views.R_view_left.T, np.ones(len(POINTS))] @ views.P_right.T
    np.testing.assert_allclose(P_point[:, :2] / P_point[:, 2:], right, atol=1e-6)


@pytest.mark.parametrize("rig", RIGS.values(), ids=list(RIGS))
def test_the_views_turn_the_cameras_as_little_as_the_pair_is_crooked(rig: Rig) -> None:
    views = rectification(rig)
    crooked_rad = se3.rotation_angle(rig.T_left_right[:3, :3]) + np.arccos(rig.T_left_right[0, 3] / rig.baseline_m)
    for R in (views.R_view_left, views.R_view_right):
        assert se3.is_rotation(R, tolerance=1e-12)
        assert se3.rotation_angle(R) <= crooked_rad + 1e-6


def test_a_pair_that_is_rectified_stays_as_it_is() -> None:
    views = rectification(PLAIN)
    np.testing.assert_array_equal(views.R_view_left, np.eye(3))
    np.testing.assert_array_equal(views.R_view_right, np.eye(3))
    np.testing.assert_array_equal(views.P_left[:, :3], PLAIN.left.K)


@pytest.mark.parametrize(
    "T_left_right",
    [
        se3.transform(np.eye(3), [0, 0.12, 0]),  # one below the other
        se3.transform(np.eye(3), [-0.12, 0, 0]),  # exchanged
        se3.transform(np.eye(3), [0, 0, 0.12]),  # one before the other
        se3.transform(np.eye(3), [0, 0, 0]),
        se3.transform(np.diag([-1.0, 1.0, -1.0]), [0.12, 0, 0]),  # looking back
        se3.transform(se3.rotation_z(np.deg2rad(70)), [0.12, 0, 0]),
    ],
)
def test_what_is_no_pair_side_by_side_has_no_rectified_views(T_left_right: np.ndarray) -> None:
    assert rectification(replace(PLAIN, T_body_right=PLAIN.T_body_left @ T_left_right)) is None
