"""The rail: through its points, along x alone, level, at its speed."""

import numpy as np
import pytest

from vobench.errors import MotionError, SettingError
from vobench.motion.rail import Rail

POINTS = np.array([[0, 0, 1], [2, 0, 1.5], [3, 2, 1], [1, 3, 2.0], [0, 2, 1]])


def test_it_passes_its_points_in_order():
    motion = Rail(points_m=POINTS.tolist(), speed_mps=1).motion()
    p = motion.at(np.linspace(0, motion.end_ns, 20_001)).T_world_body[:, :3, 3]
    nearest = [np.linalg.norm(p - point, axis=1).argmin() for point in POINTS]
    assert (np.diff(nearest) > 0).all()
    np.testing.assert_allclose(p[nearest], POINTS, atol=1e-3)
    np.testing.assert_allclose(p[[0, -1]], POINTS[[0, -1]], atol=1e-9)
    assert motion.law.length == pytest.approx(np.linalg.norm(np.diff(p, axis=0), axis=1).sum(), rel=1e-6)


def test_it_moves_along_x_alone_and_stays_level_from_side_to_side():
    motion = Rail(points_m=POINTS.tolist(), speed_mps=1.3).motion()
    k = motion.at(np.linspace(0, motion.end_ns, 1000))
    assert not k.velocity_mps[:, 1:].any()
    assert k.velocity_mps[:, 0].max() == pytest.approx(1.3)
    np.testing.assert_allclose(k.T_world_body[:, 2, 1], 0, atol=1e-15)
    assert (k.T_world_body[:, 2, 2] > 0).all()


def test_backwards_is_the_same_rail():
    there, back = (
        Rail(points_m=POINTS.tolist(), speed_mps=1).motion(),
        Rail(points_m=POINTS[::-1].tolist(), speed_mps=1).motion(),
    )
    t_ns = np.linspace(0, there.end_ns, 200)
    np.testing.assert_allclose(
        back.at(there.end_ns - t_ns).T_world_body[:, :3, 3], there.at(t_ns).T_world_body[:, :3, 3], atol=1e-7
    )


def test_two_points_are_a_straight_line():
    motion = Rail(points_m=[[0, 0, 0], [3, 4, 0]], speed_mps=1).motion()
    assert motion.law.length == pytest.approx(5)
    np.testing.assert_allclose(motion.at(np.linspace(0, motion.end_ns, 50)).angular_velocity_radps, 0, atol=1e-12)


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        ([[0, 0, 0], [1, 0, 0], [1, 0, 0]], "points 1 and 2 of the rail are the same"),
        ([[0, 0, 0], [0, 0, 1]], r"near \(0.00, 0.00, 0.00\) m the rail is steeper than 85 deg"),
        ([[0, 0, 0], [1, 0, 0], [0, 0, 0]], "turns back on itself"),
    ],
)
def test_points_that_make_no_rail_are_a_sentence(points, sentence):
    with pytest.raises(MotionError, match=sentence):
        Rail(points_m=points, speed_mps=1).motion()


@pytest.mark.parametrize(
    ("points", "sentence"),
    [
        ([[0, 0, 0]], "points_m: should have 2 or more entries, but has 1"),
        ([[0, 0], [1, 1]], r"points_m\.0\.2: this key is missing"),
        ([[0, 0, 0], [1, np.nan, 0]], r"points_m\.1\.1: should be a finite number"),
    ],
)
def test_points_that_are_none_are_a_sentence_with_their_place(points, sentence):
    with pytest.raises(SettingError, match=sentence):
        Rail(points_m=points)
