"""The plot of a case in a notebook: paths beside position errors."""

from tests.report.paths import case_of, labels, path
from vobench.report.figure_style import COLOURS, LINES
from vobench.report.trial_plot import plot_case


def test_each_estimate_has_one_colour_in_both_panels_and_its_name():
    paths, errors = plot_case(case_of(path(0.01), path(0.02))).axes
    assert labels(paths) == ["ground truth", "start", "e0", "e1"]
    assert labels(errors) == ["e0", "e1"]
    assert [line.get_color() for line in errors.get_lines()] == list(COLOURS[:2])
    assert [line.get_color() for line in paths.get_lines()[2:]] == list(COLOURS[:2])


def test_an_eighth_estimate_has_another_kind_of_line():
    _, errors = plot_case(case_of(*[path(0.01)] * 8)).axes
    lines = errors.get_lines()
    assert (lines[7].get_color(), lines[7].get_linestyle()) == (COLOURS[0], LINES[1])
    assert lines[6].get_linestyle() == LINES[0]


def test_a_status_other_than_ok_stands_behind_the_name_and_an_empty_estimate_is_only_named():
    paths, errors = plot_case(case_of(path(0.01), None, statuses=["lost", "crashed"])).axes
    assert labels(paths) == ["ground truth", "start", "e0 (lost)", "e1 (crashed)"]
    assert labels(errors) == ["e0 (lost)"]


def test_a_trial_that_ended_well_but_has_no_score_is_named_with_its_status():
    paths, errors = plot_case(case_of(path(0.01), None)).axes
    assert labels(paths) == ["ground truth", "start", "e0", "e1 (ok)"]
    assert labels(errors) == ["e0"]


def test_the_ground_truth_is_a_wide_pale_line_and_estimates_are_thin():
    figure = plot_case(case_of(path(0.01)))
    paths, errors = figure.axes
    truth, start, estimate = paths.get_lines()
    assert (truth.get_color(), truth.get_linewidth(), truth.get_alpha()) == ("black", 2.2, 0.45)
    assert (start.get_marker(), start.get_markersize(), len(start.get_xdata())) == ("o", 4, 1)
    assert estimate.get_linewidth() == errors.get_lines()[0].get_linewidth() == 1.2
    assert figure.get_size_inches().tolist() == [9.0, 3.6]
    figure.canvas.draw()
    ratio = errors.get_gridspec().get_width_ratios()
    assert ratio[1] == 1.25 * ratio[0]
