"""Turn rates of moving axes and quaternions, against rotations whose turn is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.motion.spline import Jet, of_axes, of_quaternion, pose_spline, quintic, turned

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
def test_a_direction_and_a_cross_product_differentiate_as_they_should(seed):
    p, q, r, s = np.random.default_rng(seed).normal(size=(4, 3))

    def a(t):
        return p + np.array([0, 0, 5]) + q * t + r * t**2

    def b(t):
        return s * np.cos(t) + p * np.sin(t)

    for found, expected in (
        (jet(a).direction(), jet(lambda t: a(t) / np.linalg.norm(a(t)))),
        (jet(a).cross(jet(b)), jet(lambda t: np.cross(a(t), b(t)))),
    ):
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_turned_is_each_vector_by_its_own_rotation():
    R = Rotation.random(5, random_state=1)
    vectors = np.random.default_rng(2).normal(size=(5, 3))
    assert turned(R.as_matrix(), vectors) == pytest.approx(R.apply(vectors))


NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def poses(count=8, seed=0):
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(np.cumsum(0.5 * rng.normal(size=(count, 3)), 0)).as_matrix()
    return np.cumsum(rng.uniform(0.5, 1.5, count)), se3.transform(R, rng.normal(size=(count, 3)))


@pytest.mark.parametrize("count", [3, 4, 20])
def test_it_passes_through_every_pose_at_its_time(count):
    t_s, T = poses(count)
    motion = pose_spline(t_s, T)
    assert (motion.start_ns, motion.end_ns) == (round(t_s[0] * 1e9), round(t_s[-1] * 1e9))
    np.testing.assert_allclose(motion.at(t_s * 1e9).T_world_body, T, atol=1e-12)


def test_another_world_frame_gives_the_same_motion_in_it():
    t_s, T = poses()
    T_other = se3.transform(Rotation.random(random_state=4).as_matrix(), [1, 2, 3])
    t_ns = np.linspace(t_s[0], t_s[-1], 50) * 1e9
    there, here = pose_spline(t_s, T_other @ T).at(t_ns), pose_spline(t_s, T).at(t_ns)
    np.testing.assert_allclose(there.T_world_body, T_other @ here.T_world_body, atol=1e-11)
    np.testing.assert_allclose(there.acceleration_mps2, here.acceleration_mps2, atol=1e-9)


def test_poses_on_an_even_line_give_even_motion():
    t_s = np.array([0.0, 1.0, 2.5, 4.0])
    T = se3.transform(se3.rotation_z(0.3 * t_s), np.outer(t_s, [1.0, 2.0, 0.0]))
    k = pose_spline(t_s, T).at(np.linspace(0, 4e9, 30))
    np.testing.assert_allclose(k.angular_velocity_radps, np.broadcast_to([0, 0, 0.3], (30, 3)), atol=1e-12)
    np.testing.assert_allclose(k.acceleration_mps2, 0, atol=1e-11)


@pytest.mark.parametrize("seed", range(5))
def test_no_other_way_through_the_positions_has_less_jerk(seed):
    """The integral of jerk² is quadratic, so least where its first variation along any detour is zero."""
    rng, t = np.random.default_rng(seed), np.arange(6.0)
    best = quintic(t, rng.normal(size=(6, 1)))
    detour = np.polynomial.Polynomial.fromroots(t) * np.polynomial.Polynomial(rng.normal(size=3))
    at = (np.arange(5)[:, None] + (NODES + 1) / 2).ravel()
    jerk, extra = best(at, 3)[:, 0], detour.deriv(3)(at)
    weights = np.tile(WEIGHTS, 5)
    assert abs(np.sum(jerk * extra * weights)) < 1e-9 * np.sqrt(np.sum(jerk**2 * weights) * np.sum(extra**2 * weights))


def test_eased_it_starts_and_ends_at_rest_on_the_same_way():
    t_s, T = poses()
    motion, plain = pose_spline(t_s, T, ease_s=1.0), pose_spline(t_s, T)
    assert motion.end_ns - plain.end_ns == pytest.approx(1e9, abs=2)
    ends = motion.at(np.array([motion.start_ns, motion.end_ns]))
    np.testing.assert_allclose(ends.twist, 0, atol=1e-9)
    np.testing.assert_allclose(ends.T_world_body, T[[0, -1]], atol=1e-12)
    passed = motion.at(t_s[1:-1] * 1e9 + 0.5e9)
    np.testing.assert_allclose(passed.T_world_body, T[1:-1], atol=1e-9)


def broken(k, value):
    t_s, T = poses()
    T[k, 0, 3] = value
    return t_s, T


def at_times(**changes):
    t_s, T = poses()
    t_s = np.arange(8.0)
    for k, value in changes.items():
        t_s[int(k[1:])] = value
    return t_s, T


def turned_half_round():
    T = np.stack([np.eye(4)] * 3)
    T[1, :3, :3] = se3.rotation_z(np.pi - 1e-3)
    return np.arange(3.0), T


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        (at_times(p3=2.0), "pose 3 is at 2 s, the same time as pose 2 at 2 s; times should increase"),
        (at_times(p3=1.5), "pose 3 is at 1.5 s, earlier than pose 2 at 2 s"),
        (at_times(p4=np.nan), "the time of pose 4 is nan"),
        (broken(5, np.nan), "pose 5 at .* s is not finite"),
        ((np.arange(2.0), np.stack([np.eye(4)] * 2)), "needs 3 poses or more, but there are 2"),
        ((np.arange(1.0), np.eye(4)[None]), "needs 3 poses or more, but there is 1"),
        ((np.arange(4.0), np.stack([np.eye(4)] * 3)), "4 times need as many poses"),
        ((np.arange(3.0), np.stack([np.eye(4), 2 * np.eye(4), np.eye(4)])), "the rotation of pose 1 at 1 s is invalid"),
        (turned_half_round(), "pose 1 is turned by 180 deg from the one before"),
    ],
)
def test_poses_that_make_no_spline_are_named(given, sentence):
    with pytest.raises(MotionError, match=sentence):
        pose_spline(*given)


@pytest.mark.parametrize("ease_s", [-1.0, np.nan, 1e3])
def test_an_ease_longer_than_the_way_is_a_sentence(ease_s):
    with pytest.raises(MotionError, match="ease_s is"):
        pose_spline(*poses(), ease_s=ease_s)
