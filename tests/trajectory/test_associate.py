"""Association: nearest in time, one to one."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import AlignmentError
from vobench.trajectory import associate as associate_module
from vobench.trajectory.associate import Method, associate

METHODS = get_args(Method)
EXACT = [method for method in METHODS if method not in ("evo", "interpolate")]

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


def slow_greedy(gt, est, max_diff):
    """The rule word for word: of all pairs within the window the closest first, the earlier of equals."""
    close = sorted((abs(int(t) - int(s)), i, j) for i, t in enumerate(gt) for j, s in enumerate(est))
    pairs, seen_gt, seen_est = [], set(), set()
    for diff, i, j in close:
        if diff < max_diff and i not in seen_gt and j not in seen_est:
            pairs.append((i, j))
            seen_gt.add(i)
            seen_est.add(j)
    return sorted(pairs)


def pairs_by(method, gt, est, max_diff, offset=0):
    stamps = (np.array(side, np.int64) for side in (gt, est))
    matched = associate(*stamps, max_diff_ns=max_diff, offset_ns=offset, method=method)
    return list(zip(matched.gt.tolist(), matched.est.tolist(), strict=True))


@given(STAMPS, STAMPS, st.integers(0, 30))
def test_greedy_pairs_are_those_of_the_rule_word_for_word(gt, est, max_diff):
    assert pairs_by("greedy", gt, est, max_diff) == slow_greedy(gt, est, max_diff)


def slow_evo(gt, est, max_diff, offset):
    """evo's rule word for word, in its float64 seconds: the longer side is the one that moves."""
    is_est_longer = len(est) > len(gt)
    asking, asked = (gt, est) if is_est_longer else (est, gt)
    asked = np.asarray(asked) / 1e9 + (offset / 1e9 if is_est_longer else -offset / 1e9)
    pairs, limit = [], max_diff / 1e9
    for i, t in enumerate(np.asarray(asking) / 1e9):
        if not len(asked) or t < asked[0] - limit or t > asked[-1] + limit:
            continue
        above = min(int(np.searchsorted(asked, t, side="right")), len(asked) - 1)
        to_above, to_below = asked[above] - t, t - asked[above - 1] if above else np.inf
        if to_above <= limit and to_above < to_below:
            pairs.append((i, above))
        elif to_below <= limit:
            pairs.append((i, above - 1))
    return pairs if is_est_longer else [(j, i) for i, j in pairs]


@pytest.mark.parametrize("method", ["evo", "interpolate"])
@given(STAMPS, STAMPS, st.integers(0, 30), st.integers(-30, 30))
def test_evos_pairs_are_evos_to_the_rounding_of_its_seconds(method, gt, est, max_diff_ms, offset_ms):
    given_ns = gt * MS, est * MS, max_diff_ms * MS, offset_ms * MS
    assert pairs_by(method, *given_ns) == slow_evo(*given_ns)


def test_a_limit_that_evo_misses_by_rounding_is_met_exactly_by_ours():
    gt, est = [1305031000_018 * MS, 1305031000_048 * MS], [1305031000_028 * MS, 1305031000_059 * MS]
    assert pairs_by("nearest", gt, est, 10 * MS) == [(0, 0)]
    assert pairs_by("evo", gt, est, 10 * MS) == slow_evo(gt, est, 10 * MS, 0) == []


@given(STAMPS, STAMPS, st.integers(0, 30))
def test_without_ties_evos_pairs_are_ours_and_those_that_several_share(gt, est, max_diff):
    gt, est = 4 * gt, 4 * est + 1  # no two are equally near, none at a limit that is even
    shared, once = (pairs_by(method, gt, est, 2 * max_diff) for method in ("evo", "nearest"))
    assert set(once) <= set(shared)
    asking, asked = (gt, est) if len(est) > len(gt) else (est, gt)
    near = [any(abs(int(t) - int(s)) <= 2 * max_diff for s in asked) for t in asking]
    assert len(shared) == sum(near)


@given(STAMPS, STAMPS, st.integers(0, 30))
def test_in_order_each_takes_the_nearest_that_is_left(gt, est, max_diff):
    expected, left = [], 0
    for j, t in enumerate(est):
        within = [(abs(int(s) - int(t)), i) for i, s in enumerate(gt) if i >= left and abs(int(s) - int(t)) <= max_diff]
        if within:
            expected.append((min(within)[1], j))
            left = min(within)[1] + 1
    assert pairs_by("in_order", gt, est, max_diff) == expected


@pytest.mark.parametrize("method", EXACT)
@given(gt=STAMPS, est=STAMPS, offset=st.integers(-300, 300))
def test_an_offset_moves_the_stamps_of_the_estimate(method, gt, est, offset):
    assert pairs_by(method, gt, est - offset, 10, offset) == pairs_by(method, gt, est, 10)


@pytest.mark.parametrize("method", METHODS)
@given(gt=STAMPS, est=STAMPS)
def test_no_pair_is_further_apart_than_the_window(method, gt, est):
    for i, j in pairs_by(method, gt, est, 7):
        assert abs(int(gt[i]) - int(est[j])) <= 7


@pytest.mark.parametrize("method", METHODS)
def test_nothing_is_paired_with_nothing_whatever_the_rule(method):
    assert pairs_by(method, [], [], 10) == pairs_by(method, [1], [], 10) == pairs_by(method, [], [1], 10) == []


def test_a_window_that_leaves_everything_to_weigh_is_refused(monkeypatch):
    monkeypatch.setattr(associate_module, "MAX_CANDIDATES", 50)
    with pytest.raises(AlignmentError, match="leaves 100 pairs"):
        pairs_by("greedy", range(10), range(10), 10**9)
