"""Planar kinds: the length and shape that they say, and what cannot be driven."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import MotionError
from vobench.robot.planar import circle, figure_8, lissajous, pure_rotation, reverse, square, stop_and_go


def states(motion, count=4001):
    k = motion.at(np.linspace(motion.start_ns, motion.end_ns, count))
    return k, k.T_world_body[:, :2, 3]


@given(st.floats(0.2, 10), st.floats(0.1, 5), st.floats(0.1, 3))
def test_a_circle_is_laps_times_its_circumference_on_its_circle(radius_m, laps, speed_mps):
    motion = circle(radius_m, speed_mps=speed_mps, laps=laps)
    assert motion.law.length == pytest.approx(2 * np.pi * radius_m * laps)
    k, p = states(motion, 101)
    np.testing.assert_allclose(np.hypot(p[:, 0], p[:, 1] - radius_m), radius_m, rtol=1e-10)
    np.testing.assert_allclose(k.turn_radps[:, 2] * radius_m, k.velocity_mps[:, 0], atol=1e-12)
    assert k.velocity_mps[:, 0].max() <= speed_mps * (1 + 1e-12)


@pytest.mark.parametrize(
    "kind",
    [
        lambda clockwise: circle(2, speed_mps=1, clockwise=clockwise),
        lambda clockwise: square(2, speed_mps=1, clockwise=clockwise),
        lambda clockwise: square(2, speed_mps=1, corner_radius_m=0.2, clockwise=clockwise),
        lambda clockwise: pure_rotation(-2.0 if clockwise else 2.0, rate_radps=1),
        lambda clockwise: reverse(2, speed_mps=1, radius_m=-3 if clockwise else 3),
    ],
)
def test_clockwise_is_the_mirror_image(kind):
    (left, p_left), (right, p_right) = states(kind(False), 200), states(kind(True), 200)
    np.testing.assert_allclose(p_right, p_left * [1, -1], atol=1e-12)
    np.testing.assert_allclose(right.turn_radps, -left.turn_radps, atol=1e-12)
    np.testing.assert_allclose(right.velocity_mps, left.velocity_mps, atol=1e-12)
    assert p_left[:, 1].max() >= 0


def test_a_square_with_stops_has_its_four_corners_and_no_others():
    motion = square(2.0, speed_mps=1, laps=2, turn_radps=1.5)
    k, p = states(motion)
    turning = np.abs(k.turn_radps[:, 2]) > 1e-6
    assert not np.abs(k.velocity_mps[turning]).max() > 1e-9
    corners = np.unique(np.round(p[turning], 9) + 0.0, axis=0)
    np.testing.assert_allclose(corners, [[0, 0], [0, 2], [2, 0], [2, 2]], atol=1e-9)
    assert np.diff(motion.breaks_ns).min() > 1e7  # where it stops, the way's break and the law's are one
    assert k.turn_radps[:, 2].max() == pytest.approx(1.2944, rel=1e-3)  # sqrt(8/15 pi/2 2): too short for 1.5


@pytest.mark.parametrize("radius_m", [0.05, 0.3])
def test_a_rounded_square_stays_within_its_sides_and_never_turns_tighter(radius_m):
    motion = square(3.0, speed_mps=1, corner_radius_m=radius_m)
    k, p = states(motion)
    assert np.ptp(p, axis=0) == pytest.approx([3, 3], abs=1e-6)
    moving = k.velocity_mps[:, 0] > 1e-3
    bend = k.turn_radps[moving, 2] / k.velocity_mps[moving, 0]
    assert bend.max() == pytest.approx(1 / radius_m, rel=0.02)
    assert bend.min() > -1e-12
    np.testing.assert_allclose(motion.law.length, np.linalg.norm(np.diff(p, axis=0), axis=1).sum(), rtol=1e-5)


def test_a_figure_8_turns_as_much_to_either_side_and_has_its_size():
    motion = figure_8(4, speed_mps=1, laps=3)
    k, p = states(motion)
    assert k.turn_radps[:, 2].max() == pytest.approx(-k.turn_radps[:, 2].min(), rel=1e-4)
    assert np.hypot(*p.T).max() == pytest.approx(2.0, abs=0.02)
    assert motion.law.length == pytest.approx(3 * figure_8(4, speed_mps=1).law.length)


def test_stop_and_go_rests_for_its_pause_between_its_legs():
    k, p = states(stop_and_go([1.0, 2.0, 0.5], speed_mps=1, pause_s=2.0), 10_001)
    rests = np.abs(k.velocity_mps[:, 0]) < 1e-12
    inner = p[rests & (p[:, 0] > 1e-6) & (p[:, 0] < 3.5 - 1e-6), 0]
    np.testing.assert_allclose(np.unique(np.round(inner, 6)), [1, 3])
    assert not p[:, 1].any()


def test_a_pure_rotation_turns_by_its_angle_and_goes_nowhere():
    motion = pure_rotation(9.0, rate_radps=0.7)
    k, p = states(motion)
    assert np.trapezoid(k.turn_radps[:, 2], dx=motion.end_ns / 1e9 / 4000) == pytest.approx(9.0, rel=1e-6)
    assert k.turn_radps[:, 2].max() == pytest.approx(0.7)
    assert not p.any()


@pytest.mark.parametrize("radius_m", [None, 2.0])
def test_reverse_goes_back_over_the_same_poses(radius_m):
    motion = reverse(3.0, speed_mps=1, radius_m=radius_m, pause_s=1.0)
    t_ns = np.linspace(0, motion.end_ns / 2, 100)
    there, back = motion.at(t_ns), motion.at(motion.end_ns - t_ns)
    np.testing.assert_allclose(back.T_world_body, there.T_world_body, atol=1e-8)
    assert there.velocity_mps[:, 0].min() > -1e-9
    assert back.velocity_mps[:, 0].max() < 1e-9


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: circle(0, speed_mps=1), "radius_m is 0; it should be a finite number of metres above 0"),
        (lambda: circle(np.nan, speed_mps=1), "radius_m is nan"),
        (lambda: circle(1, speed_mps=0), "the speed on it is 0"),
        (lambda: circle(1, speed_mps=1e-9), "from a nanosecond to a day"),
        (lambda: circle(1, speed_mps=1, accel_mps2=0), "the acceleration on it is 0"),
        (lambda: circle(1e-300, speed_mps=1), "it should be from a nanosecond to a day"),
        (lambda: circle(1, speed_mps=1, laps=0), "laps is 0; it should be above 0 and at most 1000"),
        (lambda: circle(1, speed_mps=1, laps=np.nan), "laps is nan"),
        (lambda: circle(1, speed_mps=1, start=(0, np.inf, 0)), "start is .* three finite numbers"),
        (lambda: circle(1, speed_mps=1, start=(0, 0)), "start is .* three finite numbers"),
        (lambda: square(-1, speed_mps=1), "side_m is -1"),
        (lambda: square(1, speed_mps=1, laps=1.5), "laps is 1.5; it should be a whole number from 1 to 1000"),
        (lambda: square(1, speed_mps=1, laps=0.5), "laps is 0.5; it should be a whole number"),
        (
            lambda: square(1, speed_mps=1, corner_radius_m=0.3),
            r"too wide for a side of 1 m: .* it should be below 0\.267",
        ),
        (lambda: square(1, speed_mps=1, corner_radius_m=-0.1), "corner_radius_m is -0.1"),
        (lambda: square(1, speed_mps=1, turn_radps=0), "the speed on it is 0"),
        (lambda: figure_8(0, speed_mps=1), "cannot be driven"),
        (lambda: lissajous((1, 1), ratio=(1, 1), speed_mps=1), "comes to a point"),
        (lambda: stop_and_go([], speed_mps=1, pause_s=1), "legs_m is empty"),
        (lambda: stop_and_go([1, 0], speed_mps=1, pause_s=1), "the length of the way is 0"),
        (lambda: stop_and_go([1], speed_mps=1, pause_s=-1), "pause_s is -1"),
        (lambda: pure_rotation(0, rate_radps=1), "the angle is 0 rad; it should be finite and other than 0"),
        (lambda: pure_rotation(np.nan, rate_radps=1), "the angle is nan rad"),
        (lambda: reverse(1, speed_mps=1, radius_m=0), "radius_m is 0"),
        (lambda: reverse(np.inf, speed_mps=1), "length_m is inf"),
    ],
)
def test_what_cannot_be_driven_is_a_sentence(call, sentence):
    with pytest.raises(MotionError, match=sentence):
        call()
