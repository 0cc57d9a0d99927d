"""Figures of errors over time or path, on a scale that suits them."""

import numpy as np
import pytest

from tests.report.paths import T_S, case_of, labels, line_of, path, without
from vobench.report.error_figure import error_figure, scale_errors_axis
from vobench.report.inline_figure import new_figure


def test_position_errors_are_in_mm_or_in_m_if_they_are_that_large():
    case = case_of(path(0.02))
    position_axes, _ = error_figure(case, 3.5).axes
    assert position_axes.get_ylabel() == "position error (mm)"
    (score,) = [score for _, score in case.scores]
    np.testing.assert_allclose(line_of(position_axes, "e0").get_ydata(), 1e3 * score.ate_trans_m)
    position_axes, _ = error_figure(case_of(path(9.0)), 3.5).axes
    assert position_axes.get_ylabel() == "position error (m)"


def test_rotation_errors_are_in_degrees():
    case = case_of(path(0.02))
    _, rotation_axes = error_figure(case, 3.5).axes
    (score,) = [score for _, score in case.scores]
    np.testing.assert_allclose(line_of(rotation_axes, "e0").get_ydata(), score.ate_rot_deg)
    assert rotation_axes.get_ylabel() == "rotation error (°)"


def test_errors_are_drawn_over_seconds_or_over_the_length_of_the_true_path():
    case = case_of(path(0.02))
    _, over_time = error_figure(case, 3.5).axes
    np.testing.assert_allclose(line_of(over_time, "e0").get_xdata(), T_S, atol=1e-9)
    _, over_path = error_figure(case, 3.5, over="path").axes
    np.testing.assert_allclose(line_of(over_path, "e0").get_xdata(), case.truth.distances_m())
    assert over_path.get_xlabel() == "path length (m)"


def test_a_gap_in_an_estimate_interrupts_its_errors():
    position_axes, _ = error_figure(case_of(without(path(0.02), [20, 21])), 3.5).axes
    assert np.isnan(line_of(position_axes, "e0").get_ydata()).sum() == 1


def test_an_estimate_without_a_pose_is_in_the_legend_with_its_status():
    position_axes, rotation_axes = error_figure(case_of(path(0.02), None, statuses=["ok", "crashed"]), 3.5).axes
    assert labels(position_axes) == ["e0", "e1 (crashed)"]
    assert labels(rotation_axes) == ["e0"]


@pytest.mark.parametrize(("ratio", "scale"), [(10.0, "linear"), (60.0, "log")])
def test_errors_that_differ_too_much_are_on_a_logarithmic_axis(ratio, scale):
    position_axes, _ = error_figure(case_of(path(0.001), path(0.001 * ratio)), 3.5).axes
    assert position_axes.get_yscale() == scale


def test_an_error_that_is_only_rounding_does_not_stretch_the_axis():
    with new_figure(3, 3) as figure:
        axes = figure.subplots()
        scale_errors_axis(axes, [np.array([1.8e-45]), np.array([4.0, 5.0, 6.0]), np.array([0.0])])
        assert axes.get_yscale() == "linear"


def test_a_logarithmic_axis_does_not_follow_an_error_near_zero():
    with new_figure(3, 3) as figure:
        axes = figure.subplots()
        axes.plot([1e-30, 1.0, 1.0])
        scale_errors_axis(axes, [np.array([1e-30, 1.0, 1.0]), np.array([100.0, 100.0])])
    low, high = axes.get_ylim()
    assert low == pytest.approx(0.1)
    assert high > 100
