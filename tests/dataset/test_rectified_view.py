"""Rectified views show each point in one row; what was not recorded is black."""

from collections.abc import Callable

import numpy as np
import pytest

from vobench.dataset.rectified_view import Views, rectified
from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import pixel_grid
from vobench.geometry.rig import PRESETS, Rig, mounted_rig


def test_a_rectified_pair_stays_as_it_was_recorded(rig_of: Callable[..., Rig]) -> None:
    views = rectified(rig_of())
    assert views.source_px is None
    assert views.rig.wheels is None
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
    assert views.show("left", picture) is picture
    assert views.dark_share("left", views.rig.left) == 0


def test_rectified_rows_are_those_of_one_point() -> None:
    pair = PRESETS["euroc"]
    rig = mounted_rig(pair.left, pair.right, pair.T_left_right, pitch_deg=10.0)
    views = rectified(rig)
    assert views.source_px is not None
    points_left = np.array([[0.3, -0.2, 4.0], [-1.0, 0.5, 6.0]])
    left = views.rig.left.project(points_left)
    right = views.rig.camera("right").project(se3.apply(se3.inverse(views.rig.T_left_right), points_left))
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=1e-9)
    assert (left[:, 0] > right[:, 0]).all()
    # A pixel of the view lies in the recorded picture where its ray does.
    grid = pixel_grid(views.rig.left)
    rays_body = views.rig.left.rays(grid) @ views.rig.T_body_left[:3, :3].T
    recorded = rig.left.project(rays_body @ rig.T_body_left[:3, :3])
    np.testing.assert_allclose(views.source_px["left"][100:110, 200], recorded[100:110, 200], atol=1e-6)


def test_what_lies_outside_the_recorded_picture_is_black_and_counted(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of()
    u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
    shifted = np.stack([u + 16.0, v], -1)
    shifted[0, 0] = np.nan
    views = Views(rig, {"left": shifted})
    picture = np.full((48, 64), 200, np.uint8)
    shown = views.show("left", picture)
    assert (shown[:, 48:] == 0).all()
    assert (shown[1:, :47] == 200).all()
    assert shown[0, 0] == 0
    np.testing.assert_allclose(views.dark_share("left", rig.left), (16 * 48 + 1) / (48 * 64))


def test_a_shift_by_half_a_pixel_is_the_mean_of_two(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of()
    u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
    picture = np.tile(np.arange(0, 128, 2, dtype=np.uint8), (48, 1))
    shown = Views(rig, {"left": np.stack([u + 0.5, v], -1)}).show("left", picture)
    np.testing.assert_array_equal(shown[:, :63], picture[:, :63] + 1)


def test_a_pair_above_each_other_is_refused(rig_of: Callable[..., Rig]) -> None:
    with pytest.raises(SequenceError, match="so the pair cannot be rectified"):
        rectified(rig_of(T_left_right=se3.transform(np.eye(3), [-0.1, 0.0, 0.0])))
