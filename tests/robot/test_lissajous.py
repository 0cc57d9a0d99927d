"""Lissajous curves: the right shape, passed at even speed, and those that cannot be driven."""

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.robot.lissajous import lissajous_curve

SHAPES = [
    ((4.0, 2.0), (1, 2), 0.0),
    ((3.0, 3.0), (1, 1), np.pi / 2),
    ((5.0, 3.0), (3, 2), 0.4),
    ((2.0, 4.0), (4, 5), 0.1),
]


@pytest.mark.parametrize(("size_m", "ratio", "phase_rad"), SHAPES)
def test_its_points_satisfy_its_equation(size_m, ratio, phase_rad):
    curve = lissajous_curve(size_m, ratio=ratio, phase_rad=phase_rad)
    s = np.linspace(0, curve.arc.length, 2000)
    phi = curve.arc.parameter(s)
    x = size_m[0] / 2 * (np.sin(ratio[0] * phi + phase_rad) - np.sin(phase_rad))
    y = size_m[1] / 2 * np.sin(ratio[1] * phi)
    found = curve.at(s).T_world_body[:, :2, 3]
    np.testing.assert_allclose(np.hypot(*found.T), np.hypot(x, y), atol=1e-12)
    np.testing.assert_allclose([np.ptp(x), np.ptp(y)], size_m, rtol=1e-5)


@pytest.mark.parametrize(("size_m", "ratio", "phase_rad"), SHAPES)
def test_arc_length_is_even_to_twelve_digits(size_m, ratio, phase_rad):
    curve = lissajous_curve(size_m, ratio=ratio, phase_rad=phase_rad)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    phi = np.linspace(0, 2 * np.pi, 2001)
    half = np.diff(phi) / 2
    at = (phi[:-1] + half)[:, None] + half[:, None] * nodes
    dx = size_m[0] / 2 * ratio[0] * np.cos(ratio[0] * at + phase_rad)
    dy = size_m[1] / 2 * ratio[1] * np.cos(ratio[1] * at)
    s = np.concatenate([[0], np.cumsum(np.hypot(dx, dy) @ weights * half)])
    assert curve.arc.length == pytest.approx(s[-1], rel=1e-12)
    np.testing.assert_allclose(curve.arc.parameter(s), phi, atol=1e-11)


def test_a_circle_is_one_of_them():
    curve = lissajous_curve((6.0, 6.0), ratio=(1, 1), phase_rad=np.pi / 2)
    k = curve.at(np.linspace(0, curve.arc.length, 100))
    assert curve.arc.length == pytest.approx(6 * np.pi, rel=1e-13)
    np.testing.assert_allclose(k.turn_radps[:, 2], 1 / 3, rtol=1e-12)
    np.testing.assert_allclose(k.turn_rate_radps2, 0, atol=1e-12)


def test_it_begins_at_the_origin_along_x_and_every_lap_again():
    curve = lissajous_curve((5.0, 3.0), ratio=(3, 2), phase_rad=0.4)
    k = curve.at(np.array([0.0, 1.0, curve.arc.length + 1.0, 7 * curve.arc.length + 1.0]))
    np.testing.assert_allclose(k.T_world_body[0], np.eye(4), atol=1e-15)
    np.testing.assert_allclose(k.T_world_body[2:], k.T_world_body[[1, 1]], atol=1e-11)


@pytest.mark.parametrize(
    ("size_m", "ratio", "phase_rad", "sentence"),
    [
        ((0.0, 1.0), (1, 2), 0.0, "of 0.0 m by 1.0 m, phase 0 rad, cannot be driven; both sizes should be above 0"),
        ((1.0, np.nan), (1, 2), 0.0, "both sizes should be above 0"),
        ((1.0, 1.0), (1, 2), np.inf, "phase inf rad"),
        ((1.0, 1.0), (2, 4), 0.0, "2:4; it should be two whole numbers from 1 to 20 without a common divisor"),
        ((1.0, 1.0), (0, 1), 0.0, "0:1"),
        ((1.0, 1.0), (1.5, 2), 0.0, r"1\.5:2"),
        ((1.0,), (1, 2), 0.0, "cannot be driven"),
        ((1.0, 1.0), (1, 1), 0.0, "comes to a point where it turns back; choose another phase"),
        ((1.0, 1.0), (1, 2), np.pi / 4, "comes to a point"),
    ],
)
def test_a_curve_that_cannot_be_driven_is_a_sentence(size_m, ratio, phase_rad, sentence):
    with pytest.raises(MotionError, match=sentence):
        lissajous_curve(size_m, ratio=ratio, phase_rad=phase_rad)


@pytest.mark.parametrize("ratio", [(1, 1), (1, 2), (2, 1), (1, 3), (3, 2), (3, 5), (5, 4), (7, 9)])
def test_the_phase_that_the_sentence_names_can_be_driven(ratio):
    with pytest.raises(MotionError, match="0 where one number of the ratio is even, a quarter turn where both are odd"):
        lissajous_curve(
            (1.0, 1.0), ratio=ratio, phase_rad=0.0 if ratio[0] % 2 and ratio[1] % 2 else np.pi / 2 / ratio[1]
        )
    both_odd = ratio[0] % 2 and ratio[1] % 2
    assert lissajous_curve((1.0, 1.0), ratio=ratio, phase_rad=np.pi / 2 if both_odd else 0.0).arc.length > 1
