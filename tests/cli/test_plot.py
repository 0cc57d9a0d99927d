"""vobench plot: files for papers from runs, bundles and trajectories."""

import pytest

from tests.report.paths import path
from vobench.cli.plot import FigureForm
from vobench.errors import InputError
from vobench.report.figure_style import COLUMN_INCHES, PAGE_INCHES
from vobench.trajectory.tum import format_tum

DRAWN = ["path", "axes", "error", "cumulative", "matrix", "strip"]


@pytest.fixture
def files(here):
    for name, error_m in {"gt": 0.0, "mine": 0.01, "yours": 0.03}.items():
        (here / f"{name}.txt").write_text(format_tum(path(error_m)))
    return here


def test_all_figures_of_a_run_are_drawn_and_those_without_data_are_named(vobench, ran, here):
    said = vobench("plot", ran, "--format", "png", "--json")
    assert said.code == 0
    names = [path.rpartition("/")[2] for path in said.json["files"]]
    assert set(DRAWN) <= {name.removesuffix(".png") for name in names}
    assert "no figure 'breakdown': no scenario of this run has two severities" in said.err
    assert sorted(names) == sorted(path.name for path in (here / "figures").iterdir())


def test_one_figure_is_one_file_and_equal_calls_give_equal_files(vobench, ran, here):
    for name in ("a.pdf", "b.pdf"):
        assert vobench("plot", ran, "-k", "error", "-c", "short", "-o", name).code == 0
    assert (here / "a.pdf").read_bytes() == (here / "b.pdf").read_bytes()


def test_a_bundle_has_all_figures_but_pictures(vobench, ran, here):
    assert vobench("bundle", ran, "run.zip").code == 0
    assert vobench("plot", "run.zip", "-k", "error", "-o", "error.svg").code == 0
    said = vobench("plot", "run.zip", "-k", "strip", "-o", "strip.svg")
    assert said.code == 1
    assert "no longer in the cache" in said.err


def test_files_are_drawn_with_their_ground_truth(vobench, files):
    said = vobench("plot", "gt.txt", "mine.txt", "yours.txt", "--format", "svg")
    assert (said.code, said.err) == (0, "")
    assert sorted(path.stem for path in (files / "figures").iterdir()) == sorted(
        ["path", "axes", "error", "segments", "cumulative"]
    )


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("-o", "all.pdf"), "one file holds one figure; name its --kind, or a folder instead of all.pdf"),
        (("-k", "matrix"), "no kind of figure for files named 'matrix'"),
        (("-k", "pth"), "Did you mean 'path'?"),
        (("-e", "mine"), "--case and --estimator choose from a run"),
        (("--format", "jpg"), "no format of figures named 'jpg'"),
        (("--over", "distance"), "no abscissa named 'distance'"),
        (("--width", "wide"), "--width should be column, page, or 1 to 40 inches, got 'wide'"),
        (("--align", "affine"), "affine"),
    ],
)
def test_a_mistake_is_one_line(vobench, files, words, sentence):
    said = vobench("plot", "gt.txt", "mine.txt", *words)
    assert said.code == 1
    assert sentence in said.err
    assert not (files / "figures").exists()


def test_a_name_that_the_run_does_not_have_is_refused(vobench, ran):
    said = vobench("plot", ran, "-e", "stand_stil")
    assert said.code == 1
    assert "Did you mean 'stand_still'?" in said.err


@pytest.mark.parametrize(
    ("width", "inches"), [(None, None), ("column", COLUMN_INCHES), ("page", PAGE_INCHES), ("5.5", 5.5)]
)
def test_a_width_is_a_word_or_a_number_of_inches(width, inches):
    assert FigureForm(width=width).width_inches == inches


@pytest.mark.parametrize("width", ["0", "-1", "nan", "99", ""])
def test_a_width_that_no_paper_has_is_refused(width):
    with pytest.raises(InputError, match="--width should be"):
        FigureForm(width=width).options()
