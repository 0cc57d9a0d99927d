"""Kernels of values on a chart of four points in a row, whose ends are their own neighbours."""

import numpy as np

from vobench.rendering.level_kernels import (
    KNOWN,
    UNKNOWN,
    fill_between,
    find_extremes,
    mark_bends,
    nearest_known,
    next_to_marked,
    smooth_along,
)

BEFORE = np.array([0, 0, 1, 2], np.int32)
AFTER = np.array([1, 2, 3, 3], np.int32)
ITSELF = np.arange(4, dtype=np.int32)
NEIGHBOURS = np.stack([BEFORE, AFTER, ITSELF, ITSELF])
ROWS = np.arange(4)
ENDS_KNOWN = np.array([KNOWN, UNKNOWN, UNKNOWN, KNOWN], np.uint8)


def test_the_nearest_known_point_is_looked_for_up_to_the_end_of_the_chart() -> None:
    assert nearest_known(1, AFTER, 2, ENDS_KNOWN) == (3, 2)
    assert nearest_known(1, AFTER, 1, ENDS_KNOWN) == (-1, 0)
    assert nearest_known(1, BEFORE, 5, ENDS_KNOWN) == (0, 1)
    assert nearest_known(0, BEFORE, 5, ENDS_KNOWN) == (-1, 0)


def test_values_between_known_ones_are_weighted_by_distance_and_marked_where_these_differ() -> None:
    for tolerance, is_relative, is_marked in ((2.0, False, True), (4.0, False, False), (0.6, True, True)):
        state = ENDS_KNOWN.copy()
        values = np.array([1, 0, 0, 4], np.float32)
        is_steep = np.zeros(4, bool)
        fill_between(ROWS, BEFORE, AFTER, 2, tolerance, is_relative, state, values, is_steep)
        np.testing.assert_allclose(values, [1, 2, 3, 4])
        assert (state == KNOWN).all()
        np.testing.assert_array_equal(is_steep, [False, is_marked, is_marked, False])


def test_a_value_with_a_known_one_on_one_side_alone_stays_unknown() -> None:
    state = np.array([KNOWN, UNKNOWN, UNKNOWN, UNKNOWN], np.uint8)
    values = np.array([1, 0, 0, 0], np.float32)
    fill_between(ROWS, BEFORE, AFTER, 4, 1.0, False, state, values, np.zeros(4, bool))
    np.testing.assert_array_equal(state[1:], UNKNOWN)
    np.testing.assert_array_equal(values, [1, 0, 0, 0])


def test_the_mark_of_a_source_is_passed_on() -> None:
    state = ENDS_KNOWN.copy()
    is_steep = np.array([True, False, False, False])
    fill_between(ROWS, BEFORE, AFTER, 2, 1.0, False, state, np.ones(4, np.float32), is_steep)
    assert is_steep.tolist() == [True, True, True, False]


def test_points_next_to_marked_ones_are_told() -> None:
    result = np.empty(4, bool)
    next_to_marked(ROWS, NEIGHBOURS, np.array([True, False, False, False]), result)
    assert result.tolist() == [True, True, False, False]


def test_extremes_ignore_unknown_neighbours() -> None:
    values = np.array([5, 2, -7, 1], np.float32)
    low = np.empty(4, np.float32)
    high = np.empty(4, np.float32)
    state = np.array([KNOWN, KNOWN, UNKNOWN, KNOWN], np.uint8)
    find_extremes(ROWS, NEIGHBOURS, 2, state, values, low, high)
    assert low.tolist() == [2, 1, -7, 1]
    assert high.tolist() == [5, 5, 2, 2]


def test_means_give_half_the_weight_to_the_point_itself() -> None:
    result = np.empty(4, np.float32)
    smooth_along(ROWS, BEFORE, AFTER, 1, np.full(4, KNOWN, np.uint8), np.array([0, 4, 0, 8], np.float32), result)
    assert result.tolist() == [1, 2, 3, 6]


def test_a_point_off_the_line_between_its_neighbours_is_marked_and_one_on_it_is_not() -> None:
    known = np.full(4, KNOWN, np.uint8)
    for peak, is_marked in ((2.0, False), (2.2, True)):
        result = np.zeros(4, bool)
        mark_bends(ROWS, BEFORE, AFTER, 1, 0.05, known, np.array([1, peak, 3, 4], np.float32), result)
        assert result.tolist() == [False, is_marked, False, False]
