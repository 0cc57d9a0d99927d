"""Figures of trajectories: aligned, interrupted where there is no pose, at the scale of the ground truth."""

import numpy as np
import pytest

from tests.report.paths import T_S, case_of, labels, line_of, path, without
from vobench.report.path_figure import axes_figure, path_figure, with_gaps
from vobench.trajectory.trajectory import Trajectory


def test_the_ground_truth_and_each_estimate_are_drawn_with_their_names():
    figure = path_figure(case_of(path(0.01), path(0.02)), 3.5)
    (axes,) = figure.axes
    assert labels(axes) == ["ground truth", "start", "e0", "e1"]
    assert figure.get_suptitle() == "bend"
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")


def test_an_estimate_is_drawn_where_its_alignment_puts_it():
    moved = Trajectory(path().t_ns, path().T_world_frame.copy())
    moved.T_world_frame[:, :2, 3] += (7.0, -3.0)
    (axes,) = path_figure(case_of(moved), 3.5).axes
    estimate = line_of(axes, "e0")
    np.testing.assert_allclose(estimate.get_xdata(), T_S, atol=1e-9)


def test_the_axes_are_a_square_around_the_ground_truth_even_if_an_estimate_leaves_it():
    (axes,) = path_figure(case_of(path(40.0)), 3.5).axes
    assert axes.get_xlim() == pytest.approx((1 - 1.5, 1 + 1.5))
    assert axes.get_ylim() == pytest.approx((0.5 - 1.5, 0.5 + 1.5))


def test_a_line_is_interrupted_where_frames_have_no_pose():
    (axes,) = path_figure(case_of(without(path(), [10, 11, 12])), 3.5).axes
    x_m = line_of(axes, "e0").get_xdata()
    assert np.flatnonzero(np.isnan(x_m)).tolist() == [10]


def test_the_last_pose_of_an_estimate_that_ends_early_is_marked():
    (axes,) = path_figure(case_of(without(path(), range(30, 50))), 3.5).axes
    (mark,) = [line for line in axes.get_lines() if line.get_marker() == "x"]
    assert mark.get_xdata()[0] == pytest.approx(T_S[29])
    (axes,) = path_figure(case_of(path()), 3.5).axes
    assert all(line.get_marker() != "x" for line in axes.get_lines())


def test_an_estimate_without_a_pose_is_in_the_legend_with_its_status():
    (axes,) = path_figure(case_of(path(), None, statuses=["lost", "crashed"]), 3.5).axes
    assert labels(axes)[2:] == ["e0 (lost)", "e1 (crashed)"]
    assert [line.get_linestyle() for line in axes.get_lines()[2:]] == ["-", "None"]


def test_the_legend_says_which_estimates_leave_the_view():
    case = case_of(path(40.0), path(0.01))
    (axes,) = path_figure(case, 3.5).axes
    assert labels(axes)[2:] == ["e0, leaves the view", "e1"]
    for axes in axes_figure(case, 3.5).axes:
        assert labels(axes)[1:] == ["e0, leaves the view", "e1"]


def test_three_axes_show_one_coordinate_each_over_seconds_since_the_start():
    start_ns = 1_700_000_000_000_000_000
    case = case_of(path(0.01, start_ns=start_ns), truth=path(start_ns=start_ns))
    x_axes, y_axes, z_axes = axes_figure(case, 3.5).axes
    assert [axes.get_ylabel() for axes in (x_axes, y_axes, z_axes)] == ["x (m)", "y (m)", "z (m)"]
    truth = line_of(y_axes, "ground truth")
    np.testing.assert_allclose(truth.get_xdata(), T_S, atol=1e-9)
    np.testing.assert_allclose(truth.get_ydata(), T_S**2 / 4, atol=1e-9)


def test_a_coordinate_that_hardly_changes_is_not_magnified_beyond_the_others():
    _, _, z_axes = axes_figure(case_of(path()), 3.5).axes
    low_m, high_m = z_axes.get_ylim()
    assert high_m - low_m == pytest.approx(2 * 0.05 * 2.0)


def test_gaps_are_rows_of_nan_before_the_frame_after_them():
    values = np.array([[1.0], [2.0], [3.0]])
    interrupted = with_gaps(values, np.array([0, 1, 5]))
    np.testing.assert_array_equal(interrupted[:, 0], [1, 2, np.nan, 3])


def test_a_coordinate_has_a_quarter_of_its_range_above_and_below_it():
    axes = axes_figure(case_of(path(0.01)), 3.5).axes[0]
    lowest_m, highest_m = 0.0, 2.0  # x of the ground truth
    assert axes.get_ylim() == pytest.approx((lowest_m - 0.5, highest_m + 0.5))
