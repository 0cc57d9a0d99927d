"""Association: nearest in time, one to one."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vobench.trajectory.associate import associate

MS = 1_000_000
STAMPS = st.lists(st.integers(0, 200), max_size=30, unique=True).map(lambda t: np.array(sorted(t), np.int64))


def pairs(gt, est, max_diff):
    matched = associate(np.array(gt, np.int64), np.array(est, np.int64), max_diff_ns=max_diff)
    return list(zip(matched.gt.tolist(), matched.est.tolist(), strict=True))


def slow_pairs(gt, est, max_diff):
    """The rule word for word: the shorter asks, the longer takes the nearest, the earlier of equals."""
    swap = len(est) > len(gt)
    asking, asked = (gt, est) if swap else (est, gt)
    wanted: dict[int, list[tuple[int, int]]] = {}
    for i, t in enumerate(asking):
        diff, j = min(((abs(int(t) - int(s)), j) for j, s in enumerate(asked)), default=(max_diff + 1, -1))
        if diff <= max_diff:
            wanted.setdefault(j, []).append((diff, i))
    matched = [(min(bids)[1], j) for j, bids in wanted.items()]
    return sorted((i, j) if swap else (j, i) for i, j in matched)


@given(STAMPS, STAMPS, st.integers(0, 30))
def test_pairs_are_those_of_the_rule_word_for_word(gt, est, max_diff):
    assert pairs(gt, est, max_diff) == slow_pairs(gt, est, max_diff)


@given(STAMPS, STAMPS, st.integers(0, 30))
def test_no_pose_is_used_twice_and_pairs_are_in_order(gt, est, max_diff):
    matched = associate(gt, est, max_diff_ns=max_diff)
    assert (np.diff(matched.gt) > 0).all()
    assert (np.diff(matched.est) > 0).all()
    assert (np.abs(gt[matched.gt] - est[matched.est]) <= max_diff).all()


@given(STAMPS)
def test_a_trajectory_is_associated_with_itself(t):
    assert pairs(t, t, 0) == [(i, i) for i in range(len(t))]


def test_of_two_equally_near_the_earlier_is_taken():
    assert pairs([0, 10, 20], [5, 15], 5) == [(0, 0), (1, 1)]


def test_where_several_want_one_the_nearest_gets_it():
    assert pairs([0, 100, 200], [97, 101, 104], 10) == [(1, 1)]
    assert pairs([0, 100, 200], [98, 102], 10) == [(1, 0)]


def test_nanoseconds_of_today_are_not_rounded():
    t = 1_763_730_000_000_000_001
    assert pairs([t, t + 10 * MS], [t + 10 * MS - 1], 0) == []
    assert pairs([t, t + 10 * MS], [t + 10 * MS - 1], 1) == [(1, 0)]


def test_nothing_is_associated_with_nothing():
    assert pairs([], [], 10) == pairs([1], [], 10) == pairs([], [1], 10) == []
