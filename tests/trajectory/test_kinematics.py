"""Laws of time: rest to rest, within speed and acceleration, over exactly the length asked."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PPoly

from vobench.errors import MotionError
from vobench.trajectory.kinematics import TimeLaw, evenly, in_stages, rest_to_rest

SIZES = st.floats(1e-2, 1e2)


@given(SIZES, SIZES, SIZES)
def test_it_covers_its_length_within_its_speed_and_acceleration(length, speed, acceleration):
    law = rest_to_rest(length, speed=speed, acceleration=acceleration)
    s, rate, change = law.at(np.linspace(0, law.end_s, 2001))
    np.testing.assert_allclose([s[0], s[-1]], [0, length], rtol=1e-12, atol=1e-12 * length)
    np.testing.assert_allclose(rate[[0, -1]] / speed, 0, atol=1e-10)
    assert rate.min() >= -1e-10 * speed
    assert rate.max() <= speed * (1 + 1e-12)
    assert np.abs(change).max() <= acceleration * (1 + 1e-12)


@given(SIZES, SIZES, SIZES)
def test_it_goes_back_as_it_came(length, speed, acceleration):
    law = rest_to_rest(length, speed=speed, acceleration=acceleration)
    t_s = np.linspace(0, law.end_s, 101)
    forth, back = law.at(t_s)[0], length - law.at(law.end_s - t_s)[0]
    np.testing.assert_allclose(forth, back, atol=1e-11 * length)


def test_a_long_way_reaches_its_speed_and_its_acceleration():
    law = rest_to_rest(10, speed=1, acceleration=0.5)
    _, rate, change = law.at(np.linspace(0, law.end_s, 10_001))
    np.testing.assert_allclose([rate.max(), np.abs(change).max()], [1, 0.5], rtol=1e-6)
    assert len(law.progress.x[1:-1]) == 2


def test_a_short_way_is_never_that_fast():
    law = rest_to_rest(0.1, speed=1, acceleration=0.5)
    _, rate, change = law.at(np.linspace(0, law.end_s, 10_001))
    assert rate.max() < 0.5
    np.testing.assert_allclose(np.abs(change).max(), 0.5, rtol=1e-6)


def test_stages_follow_each_other_with_rests_between():
    a, b = (rest_to_rest(length, speed=1, acceleration=1) for length in (2, 3))
    law = in_stages([a, b], pause_s=1.5)
    assert law.end_s == pytest.approx(a.end_s + 1.5 + b.end_s)
    assert law.length == pytest.approx(5)
    s, rate, change = law.at(a.end_s + np.linspace(0, 1.5, 7))
    np.testing.assert_allclose(s, 2)
    np.testing.assert_allclose([rate, change], 0, atol=1e-12)
    np.testing.assert_allclose(law.at(a.end_s + 1.5 + np.array([0.7]))[0], 2 + b.at(np.array([0.7]))[0])


@given(st.floats(0.01, 0.99))
def test_when_finds_the_time_of_a_progress(share):
    law = in_stages([rest_to_rest(2, speed=1, acceleration=1), rest_to_rest(3, speed=2, acceleration=1)], pause_s=1)
    np.testing.assert_allclose(law.at(law.when(np.array([share * 5])))[0], share * 5, atol=1e-12)


def test_evenly_is_even_within_its_time_and_without():
    law = evenly(2.0, 5.0, begin=1.0, rate=3.0)
    s, rate, change = law.at(np.array([1.0, 2.0, 4.0, 6.0]))
    np.testing.assert_allclose(s, [-2, 1, 7, 13])
    np.testing.assert_array_equal([rate, change], [[3] * 4, [0] * 4])


def test_a_law_that_ends_while_it_speeds_up_goes_on_evenly():
    law = TimeLaw(PPoly(np.array([[1.0], [0.0], [0.0]]), np.array([0.0, 2.0])))
    np.testing.assert_array_equal(np.array(law.at(np.array([-1.0, 1.0, 3.0]))), [[0, 1, 8], [0, 2, 4], [0, 2, 0]])


@pytest.mark.parametrize(
    ("figures", "sentence"),
    [
        ((0, 1, 1), "the length of the path is 0; it should be a finite number above 0"),
        ((1, np.nan, 1), "the speed on the path is nan"),
        ((1, 1, -2), "the acceleration on the path is -2"),
        ((1, np.inf, 1), "the speed on the path is inf"),
        ((1, 1e-9, 1), r"takes 1e\+09 s; it should be from a nanosecond to a day"),
    ],
)
def test_a_way_that_cannot_be_gone_is_a_sentence(figures, sentence):
    with pytest.raises(MotionError, match=sentence):
        rest_to_rest(figures[0], speed=figures[1], acceleration=figures[2])


@pytest.mark.parametrize("pause_s", [-1.0, np.nan])
def test_a_pause_that_is_none_is_a_sentence(pause_s):
    with pytest.raises(MotionError, match="pause_s is"):
        in_stages([rest_to_rest(1, speed=1, acceleration=1)], pause_s=pause_s)


def test_pauses_that_make_it_longer_than_a_day_are_a_sentence():
    with pytest.raises(MotionError, match=r"the motion would last 1e\+05 s; it should last at most a day"):
        in_stages([rest_to_rest(1, speed=1, acceleration=1)] * 2, pause_s=1e5)
