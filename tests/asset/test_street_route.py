"""Routes of streets: connected segments, and side streets and crossings that are clear of bends."""

from itertools import pairwise

import numpy as np

from vobench.asset.street_route import (
    BENDS_DEG,
    CLEAR_OF_BEND_M,
    STREET_M,
    crossing_of,
    segments_of_street,
    side_streets_of,
)

SEEDS = range(60)


def test_segments_are_connected_and_centred_and_turn_by_their_bends() -> None:
    for seed in SEEDS:
        segments = segments_of_street(np.random.default_rng(seed))
        assert STREET_M[0] <= sum(segment.length_m for segment in segments) <= STREET_M[1]
        for one, other in pairwise(segments):
            np.testing.assert_allclose(one.frame.point(one.length_m, 0), other.frame.point(0, 0), atol=1e-9)
            bend_deg = other.frame.heading_deg - one.frame.heading_deg
            np.testing.assert_allclose([one.turn_deg[1], other.turn_deg[0]], bend_deg, atol=1e-9)
            assert BENDS_DEG[0] <= abs(bend_deg) <= BENDS_DEG[1]
        ends_m = segments[0].frame.point(0, 0) + segments[-1].frame.point(segments[-1].length_m, 0)
        np.testing.assert_allclose(ends_m, 0, atol=1e-9)


def test_side_streets_are_clear_of_bends_and_two_are_opposite() -> None:
    counts = set()
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        segments = segments_of_street(rng)
        side_streets = tuple(side_streets_of(rng, segments))
        counts.add(len(side_streets))
        assert len({street.side for street in side_streets}) == len(side_streets)
        for street in side_streets:
            assert street.x_m >= CLEAR_OF_BEND_M
            assert street.x_m <= segments[street.segment].length_m - CLEAR_OF_BEND_M
    assert counts == {0, 1, 2}


def test_crossings_are_clear_of_side_streets_and_ends() -> None:
    found = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        segments = segments_of_street(rng)
        side_streets = tuple(side_streets_of(rng, segments))
        crossing = crossing_of(rng, segments, side_streets)
        if crossing is not None:
            found += 1
            assert 7 <= crossing.x_m <= segments[crossing.segment].length_m - 6
            for street in side_streets:
                assert street.segment != crossing.segment or abs(street.x_m - crossing.x_m) >= street.half_m
    assert len(SEEDS) // 3 < found < len(SEEDS)
