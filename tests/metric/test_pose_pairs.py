"""Pairs of poses follow the rules word for word, and gaps are spanned."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.metric import pose_pairs
from vobench.metric.pose_pairs import select_pairs

SEEDS = st.integers(0, 2**32 - 1)
UNITS = ["f", "m", "s", "d", "r"]


def walk(rng, n=40, *, still=0.3):
    """Poses that move and turn by random steps, or stand still, and stamps with a random pace."""
    moving = rng.random((n, 1)) > still
    positions = np.cumsum(rng.normal(size=(n, 3)) * moving, axis=0)
    R = se3.rotation_z(np.cumsum(rng.normal(scale=0.2, size=n)))
    return se3.transform(R, positions), np.cumsum(rng.integers(1, 10**9, n))


def as_list(pairs):
    return list(zip(*(side.tolist() for side in pairs), strict=True))


def way(T):
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1))])


def slow_all_pairs(along, delta):
    """Of every pose the first of the later ones that miss delta least, if within a tenth."""
    found = []
    for i in range(len(along) - 1):
        miss = np.abs(along[i + 1 :] - along[i] - delta)
        if miss.min() <= 0.1 * delta:
            found.append((i, i + 1 + int(np.argmin(miss))))
    return found


def slow_chain(steps, delta):
    ends, total = [0], 0.0
    for k, step in enumerate(steps, 1):
        total += step
        if total >= delta:
            ends.append(k)
            total = 0.0
    return list(pairwise(ends))


@given(SEEDS, st.floats(0.1, 20))
def test_all_pairs_by_metres_are_those_of_the_rule_word_for_word(seed, delta):
    T, t_ns = walk(np.random.default_rng(seed))
    found = select_pairs(T, t_ns, delta=delta, unit="m", all_pairs=True, spanning=False)
    assert as_list(found) == slow_all_pairs(way(T), delta)


@given(SEEDS, st.integers(1, 8))
def test_where_poses_lie_on_a_grid_ties_are_the_rules_too(seed, delta):
    steps = np.random.default_rng(seed).integers(0, 3, 40) * 1.0
    T = se3.transform(np.eye(3), np.cumsum(steps)[:, None] * [1.0, 0.0, 0.0])
    found = select_pairs(T, np.arange(40), delta=float(delta), unit="m", all_pairs=True, spanning=False)
    assert as_list(found) == slow_all_pairs(way(T), delta)
    chained = select_pairs(T, np.arange(40), delta=float(delta), unit="m", all_pairs=False)
    assert as_list(chained) == slow_chain(steps[1:], delta)


@given(SEEDS, st.floats(0.2, 10))
def test_all_pairs_by_seconds_are_those_of_the_same_rule(seed, delta):
    T, t_ns = walk(np.random.default_rng(seed))
    found = select_pairs(T, t_ns, delta=delta, unit="s", all_pairs=True, spanning=False)
    assert as_list(found) == slow_all_pairs((t_ns - t_ns[0]) / 1e9, delta)


@given(SEEDS, st.floats(1, 170))
def test_all_pairs_by_angle_look_at_every_two_poses(seed, delta_deg):
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(25, 4))
    R = se3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    T = se3.transform(R, np.zeros((25, 3)))
    apart = np.rad2deg(se3.rotation_angle(np.swapaxes(R, -1, -2)[:, None] @ R[None]))
    expected = [(i, j) for i in range(25) for j in range(i + 1, 25) if abs(apart[i, j] - delta_deg) <= 0.1 * delta_deg]
    assert as_list(select_pairs(T, np.arange(25), delta=delta_deg, unit="d", all_pairs=True)) == expected
    in_rad = select_pairs(T, np.arange(25), delta=np.deg2rad(delta_deg), unit="r", all_pairs=True)
    assert as_list(in_rad) == expected


@given(SEEDS, st.sampled_from(UNITS), st.integers(1, 5))
def test_consecutive_pairs_lie_end_to_end_and_none_is_short(seed, unit, delta):
    T, t_ns = walk(np.random.default_rng(seed))
    first, last = select_pairs(T, t_ns, delta=delta, unit=unit, all_pairs=False)
    assert (first[1:] == last[:-1]).all()
    assert not first.size or first[0] == 0
    turned = np.concatenate([[0.0], np.cumsum(se3.rotation_angle(np.swapaxes(T[:-1, :3, :3], 1, 2) @ T[1:, :3, :3]))])
    along = {"f": np.arange(40), "m": way(T), "s": t_ns / 1e9, "d": np.rad2deg(turned), "r": turned}[unit]
    assert (along[last] - along[first] > delta - 1e-9).all()
    assert (along[last - 1] - along[first] < delta + 1e-9).all()


@pytest.mark.parametrize("all_pairs", [False, True])
@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("n", [0, 1, 2])
def test_few_poses_have_few_pairs_and_raise_nothing(n, unit, all_pairs):
    T, t_ns = walk(np.random.default_rng(1), n=2, still=0.0)
    first, last = select_pairs(T[:n], t_ns[:n], delta=1, unit=unit, all_pairs=all_pairs)
    assert len(first) == len(last) <= max(n - 1, 0)


def straight_with_gap():
    """Steps of 0.1 m at 10 Hz; frames 5 to 14 are lost, a metre of path."""
    frames = np.r_[0:5, 15:30]
    return se3.transform(np.eye(3), frames[:, None] * [0.1, 0.0, 0.0]), frames * 10**8, frames


@pytest.mark.parametrize("unit", ["m", "s"])
@pytest.mark.parametrize("all_pairs", [False, True])
def test_the_motion_across_a_gap_is_always_in_some_pair(unit, all_pairs):
    T, t_ns, frames = straight_with_gap()
    first, last = select_pairs(T, t_ns, delta=0.5, unit=unit, all_pairs=all_pairs)
    assert ((frames[first] < 5) & (frames[last] >= 15)).any()
    if all_pairs:
        spanning = dict(zip(frames[first].tolist(), frames[last].tolist(), strict=True))
        assert [spanning[frame] for frame in range(5)] == [15] * 5
        short = select_pairs(T, t_ns, delta=0.5, unit=unit, all_pairs=True, spanning=False)
        assert not ((frames[short[0]] < 5) & (frames[short[1]] >= 15)).any()


@given(SEEDS, st.floats(0.1, 20))
def test_without_gaps_there_is_nothing_to_span(seed, delta):
    T, _ = walk(np.random.default_rng(seed))
    t_ns = np.arange(40) * 10**8
    plain, spanned = (select_pairs(T, t_ns, delta=delta, unit="m", all_pairs=True, spanning=s) for s in (False, True))
    assert as_list(plain) == as_list(spanned)


def test_more_pairs_by_angle_than_memory_holds_are_refused(monkeypatch):
    monkeypatch.setattr(pose_pairs, "MAX_PAIRS", 10)
    T = se3.transform(se3.rotation_z(np.arange(30) * 0.1), np.zeros((30, 3)))
    with pytest.raises(AlignmentError, match="take consecutive pairs"):
        select_pairs(T, np.arange(30), delta=0.5, unit="r", all_pairs=True)


@pytest.mark.parametrize("chunk", [1, 40, 10**6])
def test_pairs_by_angle_do_not_depend_on_the_size_of_the_chunks(monkeypatch, chunk):
    T, t_ns = walk(np.random.default_rng(2))
    expected = as_list(select_pairs(T, t_ns, delta=20, unit="d", all_pairs=True))
    monkeypatch.setattr(pose_pairs, "CHUNK", chunk)
    assert expected
    assert as_list(select_pairs(T, t_ns, delta=20, unit="d", all_pairs=True)) == expected


def test_of_many_poses_as_many_pairs_are_drawn_as_the_most_that_are_all_taken(monkeypatch):
    monkeypatch.setattr(pose_pairs, "MAX_POSES", 30)
    every = as_list(pose_pairs.every_pair(30))
    assert sorted(every) == [(first, last) for first in range(30) for last in range(30)]
    first, last = pose_pairs.every_pair(31)
    assert len(first) == len(last) == len(every)
    assert set(first) | set(last) == set(range(31))
    assert np.corrcoef(first, last)[0, 1] == pytest.approx(0, abs=0.15)
    assert as_list(pose_pairs.every_pair(31)) == as_list((first, last))
