"""Every lane in which a path is free is found, and no other one."""

import numpy as np
import pytest

from vobench.analysis.free_lanes import _free_starts, free_lanes
from vobench.suite.free_space import FloorMap

CELL_M = 0.1


def floor(free: np.ndarray) -> FloorMap:
    """The map of a floor whose cell (0, 0) is at the origin."""
    rows, columns = free.shape
    return FloorMap(np.arange(columns) * CELL_M, np.arange(rows) * CELL_M, free, 0.0, CELL_M)


def straight(length_m: float) -> np.ndarray:
    return np.array([[5.0, 7.0], [5.0 + length_m, 7.0]])


def test_a_long_path_fits_only_along_a_narrow_lane_in_both_directions() -> None:
    free = np.zeros((200, 200), bool)
    free[80:100, 5:195] = True  # 19 m long and 2 m wide
    lanes = free_lanes(floor(free), straight(16.0), clearance_m=0.3, most=50)
    assert len(lanes) == 50
    headings = np.array([lane.heading_rad for lane in lanes])
    assert np.abs(np.sin(headings)).max() < 0.1
    assert {round(float(np.cos(heading))) for heading in headings} == {-1, 1}
    for lane in lanes:
        end_m = lane.xy_m + 16 * np.array([np.cos(lane.heading_rad), np.sin(lane.heading_rad)])
        for x_m, y_m in (lane.xy_m, end_m):
            assert 0.7 < x_m < 19.3
            assert 8.15 < y_m < 9.75


def test_what_does_not_fit_is_not_found() -> None:
    free = np.zeros((200, 200), bool)
    free[80:100, 5:195] = True
    assert free_lanes(floor(free), straight(19.5), clearance_m=0.3, most=50) == []
    free[:, 100] = False  # a wall across
    assert free_lanes(floor(free), straight(10.0), clearance_m=0.3, most=50) == []
    assert free_lanes(floor(free), straight(8.0), clearance_m=0.3, most=50)
    assert free_lanes(floor(free), straight(8.0), clearance_m=1.2, most=50) == []


def test_a_bent_path_is_turned_as_a_whole() -> None:
    free = np.zeros((120, 120), bool)
    free[10:30, 10:110] = True
    free[10:110, 90:110] = True  # a corner, to the left for who comes along the first arm
    bent = np.array([[0.0, 0.0], [7.0, 0.0], [7.0, 7.0]])
    found = free_lanes(floor(free), bent, clearance_m=0.3, most=40)
    assert found
    assert max(abs(lane.heading_rad - 2 * np.pi * round(lane.heading_rad / 2 / np.pi)) for lane in found) < 0.3
    mirrored = bent * [1.0, -1.0]
    for lane in free_lanes(floor(free), mirrored, clearance_m=0.3, most=40):
        assert np.sin(lane.heading_rad) < -0.7  # down the second arm, and then right


@pytest.mark.parametrize("seed", range(5))
def test_starts_are_those_of_which_all_cells_are_clear(seed: int) -> None:
    rng = np.random.default_rng(seed)
    is_clear = rng.random((12, 17)) < 0.8
    cells = rng.integers(-4, 5, (6, 2))
    expected = []
    for row in range(12):
        for column in range(17):
            at = cells + np.array([row, column])
            is_inside = ((at >= 0) & (at < is_clear.shape)).all()
            if is_inside and is_clear[at[:, 0], at[:, 1]].all():
                expected.append(row * 17 + column)
    assert [start for start in _free_starts(is_clear, cells).tolist() if start in expected] == expected
    # The start itself is a cell of every path; without it, starts outside of the map are left out too.
    with_start = np.vstack([cells, [[0, 0]]])
    clear_starts = [start for start in expected if is_clear.ravel()[start]]
    assert _free_starts(is_clear, with_start).tolist() == clear_starts
