"""Which frames come, and when their pictures were taken."""

import numpy as np
import pytest

from vobench.sensor.timing import STREAMS, Schedule, Timing, schedule

T_NS = np.arange(200, dtype=np.int64) * 50_000_000


def made(*, before: int = 0, **settings: float) -> Schedule:
    rngs = {name: np.random.default_rng([7, n]) for n, name in enumerate(STREAMS)}
    return schedule(Timing(**settings), T_NS[before:], rngs, before=before)


def test_by_itself_every_picture_is_taken_at_its_stamp():
    plan = made()
    for stamps in (plan.t_ns, plan.left_ns, plan.right_ns):
        np.testing.assert_array_equal(stamps, T_NS)
    assert not plan.repeats.any()


@pytest.mark.parametrize("burst", [1, 4])
def test_more_drops_lose_the_frames_of_fewer_and_others_and_neither_end(burst):
    few, many = (made(drop_share=share, drop_burst=burst) for share in (0.1, 0.4))
    assert set(many.index) < set(few.index)
    assert {0, 199} <= set(many.index)
    assert len(many.index) == pytest.approx(200 * (0.6 if burst == 1 else 0.9**4), abs=20)
    np.testing.assert_array_equal(many.t_ns, T_NS[many.index])


def test_a_part_of_a_way_loses_what_the_whole_loses_but_its_first_frame():
    whole = made(drop_share=0.4, drop_burst=9)
    amid = next(n for n in range(50, 200) if not {n - 1, n, n + 1} & {*whole.index})  # of a burst
    part = made(drop_share=0.4, drop_burst=9, before=amid)
    assert part.t_ns.tolist() == [T_NS[amid], *whole.t_ns[whole.t_ns > T_NS[amid]]]


def test_a_repeated_frame_shows_what_was_taken_before():
    plan = made(repeat_share=0.3, drop_share=0.2)
    again = np.flatnonzero(plan.repeats)
    assert len(again) > 30
    np.testing.assert_array_equal(plan.left_ns[again], plan.left_ns[again - 1])
    fresh = np.flatnonzero(~plan.repeats)
    np.testing.assert_array_equal(plan.left_ns[fresh], plan.t_ns[fresh])


def test_the_first_frame_never_shows_another_and_any_later_one_may():
    plans = [made(repeat_share=0.8, before=before) for before in range(40)]
    repeats = np.array([plan.repeats[:4] for plan in plans])
    assert not repeats[:, 0].any()
    assert repeats[:, 1:].any(axis=0).all()


def test_jitter_has_its_size_and_the_right_eye_its_delay():
    plan = made(jitter_ms=2, right_delay_ms=-3)
    off_ms = (plan.left_ns - T_NS) / 1e6
    assert off_ms.std() == pytest.approx(2, rel=0.2)
    assert abs(off_ms).max() <= 6
    np.testing.assert_array_equal(plan.right_ns - plan.left_ns, -3_000_000)
