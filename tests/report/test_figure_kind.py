"""The kinds of figures, and of which case and estimators they are."""

import json

import pytest

from tests.report.paths import case_of, labels, path
from vobench.errors import InputError, UnknownNameError
from vobench.report.figure_kind import FILE_KINDS, FigureOptions, FileFigures, RunFigures
from vobench.report.figure_style import COLUMN_INCHES, PAGE_INCHES, line_style
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import ESTIMATORS
from vobench.runner.frames import GROUND_TRUTH
from vobench.trajectory.tum import format_tum


@pytest.fixture
def folder(scored, write_run, tmp_path):
    """A run of three estimators on two cases, of which `bad` fails in the second."""
    trials = []
    for case in ("room-a", "room-b"):
        trials += [scored("apt", case=case, ate_m=0.01), scored("zen", case=case, ate_m=0.02)]
        trials.append(scored("bad", "lost" if case == "room-b" else "ok", case=case, ate_m=0.05))
    return written(write_run(tmp_path / "run", trials), trials)


def written(run, trials):
    """A run with the ground truth of its cases and the estimates of its trials."""
    for trial in trials:
        (run.case(trial.case) / GROUND_TRUTH).write_text(format_tum(path()))
        (run.estimate(trial.case, trial.estimator, 0) / ESTIMATE).write_text(format_tum(path(0.01)))
    return run


@pytest.mark.parametrize("kind", FILE_KINDS)
def test_files_have_a_figure_of_each_kind_in_the_width_of_a_column(kind):
    figure = FileFigures(case_of(path(0.01))).draw(kind)
    assert figure.get_size_inches()[0] == COLUMN_INCHES


def test_a_figure_of_one_case_is_of_the_trial_most_worth_a_look_or_of_the_case_that_is_named(folder):
    assert RunFigures(folder).case().name == "room-b"
    assert RunFigures(folder, cases=["room-a"]).case().name == "room-a"
    (axes,) = RunFigures(folder, cases=["*-a"]).draw("path").axes
    assert labels(axes)[2:] == ["apt", "bad", "zen"]


def test_an_estimator_keeps_its_colour_if_others_are_left_out(folder):
    (whole,) = RunFigures(folder, cases=["room-a"]).draw("path").axes
    (part,) = RunFigures(folder, cases=["room-a"], estimators=["zen"]).draw("path").axes
    colour_of = {line.get_label(): line.get_color() for line in whole.get_lines()}
    assert labels(part)[2:] == ["zen"]
    assert part.get_lines()[2].get_color() == colour_of["zen"]


def test_colours_follow_the_list_of_estimators_of_the_run(folder):
    listed = [{"label": label} for label in ("zen", "gone", "apt")]
    (folder.path / ESTIMATORS).write_text(json.dumps(listed))
    (axes,) = RunFigures(folder, cases=["room-a"]).draw("path").axes
    assert labels(axes)[2:] == ["zen", "apt", "bad"]
    colours = [line.get_color() for line in axes.get_lines()[2:]]
    assert colours == [line_style(index)["color"] for index in range(3)]


def test_segments_are_of_the_cases_that_the_estimators_are_for(scored, write_run, tmp_path):
    trials = [scored("imu", case="with_imu", ate_m=0.01), scored("imu", "not_applicable", case="without")]
    run = written(write_run(tmp_path / "run", trials), trials)
    assert RunFigures(run).draw("segments").axes
    with pytest.raises(InputError, match="none of these estimators is for one of these cases"):
        RunFigures(run, cases=["without"]).draw("segments")


def test_a_wide_matrix_is_as_wide_as_a_page(scored, write_run, tmp_path):
    trials = [scored(f"e{number}", ate_m=0.01) for number in range(6)]
    figures = RunFigures(write_run(tmp_path / "run", trials))
    assert figures.draw("matrix").get_size_inches()[0] == PAGE_INCHES


def test_figures_of_all_cases_leave_out_those_that_were_not_chosen(folder):
    everything = RunFigures(folder).draw("matrix").axes[0]
    assert [text.get_text() for text in everything.get_yticklabels()] == ["room-a", "room-b"]
    chosen = RunFigures(folder, cases=["room-b"], estimators=["apt", "bad"]).draw("matrix").axes[0]
    assert [text.get_text() for text in chosen.get_yticklabels()] == ["room-b"]
    assert [text.get_text() for text in chosen.get_xticklabels()] == ["apt", "bad"]
    assert [text.get_text() for text in chosen.texts] == ["1.0", "lost"]


def test_wide_kinds_are_as_wide_as_a_page_unless_a_width_is_given():
    assert FigureOptions().width_of("breakdown") == PAGE_INCHES
    assert FigureOptions().width_of("path") == COLUMN_INCHES
    assert FigureOptions(width_inches=5.0).width_of("breakdown") == 5.0


def test_unknown_kinds_and_names_are_refused(folder):
    with pytest.raises(UnknownNameError, match="Did you mean 'error'"):
        RunFigures(folder).draw("eror")
    with pytest.raises(UnknownNameError, match="no case named 'hall-\\*'"):
        RunFigures(folder, cases=["hall-*"])
    with pytest.raises(InputError, match="sequence is no longer in the cache"):
        RunFigures(folder).draw("strip")


@pytest.mark.parametrize(
    ("kind", "labels_of_axes"),
    [
        ("path", ["y (m)"]),
        ("axes", ["x (m)", "y (m)", "z (m)"]),
        ("error", ["position error (mm)", "rotation error (°)"]),
    ],
)
def test_a_kind_of_figure_has_the_axes_that_it_is_named_for(kind, labels_of_axes):
    figure = FileFigures(case_of(path(0.01))).draw(kind)
    assert [axes.get_ylabel() for axes in figure.axes] == labels_of_axes
