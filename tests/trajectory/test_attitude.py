"""Turn rates of moving axes and quaternions, against rotations whose turn is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.trajectory.attitude import Jet, cross, of_axes, of_quaternion, turned, unit

SEEDS = st.integers(0, 2**32 - 1)
STEP = 1e-3


def tumbling(rng):
    """R(t) = R0 Exp(a t) Exp(b t²/2), with its turn at t = 0 (a) and turn rate (b), in body axes."""
    R0, a, b = Rotation.random(random_state=rng), *rng.normal(size=(2, 3))

    def R(t):
        return (R0 * Rotation.from_rotvec(a * t) * Rotation.from_rotvec(b * t * t / 2)).as_matrix()

    return R, a, b


def jet(function):
    """Value, first and second derivative at 0 by central differences of the fourth order."""
    far2, far1, here, near1, near2 = (function(n * STEP) for n in (-2, -1, 0, 1, 2))
    rate = (far2 - 8 * far1 + 8 * near1 - near2) / (12 * STEP)
    change = (-far2 + 16 * far1 - 30 * here + 16 * near1 - near2) / (12 * STEP**2)
    return Jet(*(value[None] for value in (here, rate, change)))


@given(SEEDS)
def test_axes_that_tumble_give_their_turn_and_its_rate(seed):
    R, turn, turn_rate = tumbling(np.random.default_rng(seed))
    found = of_axes(*(jet(lambda t, axis=axis: R(t)[:, axis]) for axis in range(3)))
    np.testing.assert_allclose(found.R[0], R(0), atol=1e-14)
    np.testing.assert_allclose(found.turn[0], turn, atol=1e-8)
    np.testing.assert_allclose(found.turn_rate[0], turn_rate, atol=1e-6)


@given(SEEDS, st.floats(0.1, 10))
def test_a_quaternion_of_any_changing_length_gives_the_same(seed, growth):
    R, turn, turn_rate = tumbling(np.random.default_rng(seed))
    first = se3.to_quaternion(R(0))

    def quaternion(t):
        q = se3.to_quaternion(R(t))
        return q * np.sign(q @ first) * (1 + growth * t) * growth

    found = of_quaternion(jet(quaternion))
    np.testing.assert_allclose(found.R[0], R(0), atol=1e-12)
    np.testing.assert_allclose(found.turn[0], turn, atol=1e-6)
    np.testing.assert_allclose(found.turn_rate[0], turn_rate, atol=1e-4)


@given(SEEDS)
def test_unit_and_cross_differentiate_as_they_should(seed):
    p, q, r, s = np.random.default_rng(seed).normal(size=(4, 3))

    def a(t):
        return p + np.array([0, 0, 5]) + q * t + r * t**2

    def b(t):
        return s * np.cos(t) + p * np.sin(t)

    for found, expected in (
        (unit(jet(a)), jet(lambda t: a(t) / np.linalg.norm(a(t)))),
        (cross(jet(a), jet(b)), jet(lambda t: np.cross(a(t), b(t)))),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_turned_is_each_vector_by_its_own_rotation():
    R = Rotation.random(5, random_state=1)
    vectors = np.random.default_rng(2).normal(size=(5, 3))
    assert turned(R.as_matrix(), vectors) == pytest.approx(R.apply(vectors))
