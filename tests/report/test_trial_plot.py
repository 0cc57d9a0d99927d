"""The plot of a case: paths that can be compared, and errors on a sensible scale."""

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.report.trial_plot import COLOURS, LINES, plot_case
from vobench.runner.estimate import ESTIMATE
from vobench.runner.frames import GROUND_TRUTH
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

COUNT = 50
T_S = np.linspace(0, 2, COUNT)


def path(error_m):
    """A curved path of 2 m, with an error that grows to `error_m` and cannot be aligned away."""
    T = np.tile(np.eye(4), (COUNT, 1, 1))
    T[:, 0, 3] = T_S
    T[:, 1, 3] = T_S**2 / 4 + error_m * np.sin(9 * T_S)
    return Trajectory((T_S * 1e9).astype(np.int64), T)


@pytest.fixture
def plot(scored, write_run, tmp_path):
    def make(*errors_m, statuses=None):
        statuses = statuses or ["ok"] * len(errors_m)
        trials = [scored(f"e{n}", status) for n, status in enumerate(statuses)]
        folder = write_run(tmp_path / "run", trials)
        (folder.case("down") / GROUND_TRUTH).write_text(format_tum(path(0.0)))
        for trial, error_m in zip(trials, errors_m, strict=True):
            text = "" if error_m is None else format_tum(path(error_m))
            (folder.estimate("down", trial.estimator, 0) / ESTIMATE).write_text(text)
        return plot_case(folder, trials)

    return make


def labels(axes):
    return [line.get_label() for line in axes.get_lines()]


def test_each_estimate_has_one_colour_in_both_panels_and_its_name(plot):
    paths, errors = plot(0.01, 0.02).axes
    assert labels(paths) == ["ground truth", "start", "e0", "e1"]
    assert labels(errors) == ["e0", "e1"]
    assert [line.get_color() for line in errors.get_lines()] == list(COLOURS[:2])
    assert [line.get_color() for line in paths.get_lines()[2:]] == list(COLOURS[:2])


def test_an_eighth_estimate_has_another_kind_of_line(plot):
    _, errors = plot(*[0.01] * 8).axes
    lines = errors.get_lines()
    assert (lines[7].get_color(), lines[7].get_linestyle()) == (COLOURS[0], LINES[1])
    assert lines[6].get_linestyle() == LINES[0]


def test_a_status_other_than_ok_stands_behind_the_name_and_an_empty_estimate_is_only_named(plot):
    paths, errors = plot(0.01, None, statuses=["lost", "crashed"]).axes
    assert labels(paths) == ["ground truth", "start", "e0 (lost)", "e1 (crashed)"]
    assert labels(errors) == ["e0 (lost)"]


def test_errors_are_in_millimetres_over_seconds(plot):
    _, errors = plot(0.02).axes
    (line,) = errors.get_lines()
    np.testing.assert_allclose(line.get_xdata(), T_S, atol=1e-9)
    assert 5 < np.max(line.get_ydata()) < 40
    assert errors.get_ylim()[0] == 0
    assert (errors.get_xlabel(), errors.get_ylabel()) == ("time (s)", "position error (mm)")


@pytest.mark.parametrize(("ratio", "scale"), [(10.0, "linear"), (60.0, "log")])
def test_errors_that_differ_too_much_are_on_a_logarithmic_axis(plot, ratio, scale):
    _, errors = plot(0.001, 0.001 * ratio).axes
    assert errors.get_yscale() == scale


def test_the_plot_of_paths_is_a_square_around_the_ground_truth(plot):
    paths, _ = plot(0.01).axes
    x_m, y_m = paths.get_xlim(), paths.get_ylim()
    assert x_m == pytest.approx((1 - 1.5, 1 + 1.5))
    assert y_m == pytest.approx((0.5 - 1.5, 0.5 + 1.5))


def test_a_stationary_case_is_shown_at_a_sensible_scale(scored, write_run, tmp_path):
    folder = write_run(tmp_path / "run", [scored("a")])
    still = Trajectory(np.arange(3, dtype=np.int64), np.tile(np.eye(4), (3, 1, 1)))
    (folder.case("down") / GROUND_TRUTH).write_text(format_tum(still))
    paths, _ = plot_case(folder, [scored("a")]).axes
    assert paths.get_xlim() == pytest.approx((-0.05, 0.05))


def test_jupyter_shows_a_png_and_no_trial_is_an_error(plot, run):
    assert plot(0.01)._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(InputError, match="there is no trial to plot"):
        plot_case(run, [])


def test_the_ground_truth_is_a_wide_pale_line_and_estimates_are_thin(plot):
    figure = plot(0.01)
    paths, errors = figure.axes
    truth, start, estimate = paths.get_lines()
    assert (truth.get_color(), truth.get_linewidth(), truth.get_alpha()) == ("black", 2.2, 0.45)
    assert (start.get_marker(), start.get_markersize(), len(start.get_xdata())) == ("o", 4, 1)
    assert estimate.get_linewidth() == errors.get_lines()[0].get_linewidth() == 1.2
    assert figure.get_size_inches().tolist() == [9.0, 3.6]
    figure.canvas.draw()
    ratio = errors.get_gridspec().get_width_ratios()
    assert ratio[1] == 1.25 * ratio[0]


def test_a_trial_that_ended_well_but_has_no_score_is_named_with_its_status(plot):
    paths, errors = plot(0.01, None).axes
    assert labels(paths) == ["ground truth", "start", "e0", "e1 (ok)"]
    assert labels(errors) == ["e0"]
