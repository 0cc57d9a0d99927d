"""The heat map of cases and estimators: medians, and statuses where all trials failed."""

import pytest

from vobench.errors import InputError
from vobench.report.leaderboard import make_board
from vobench.report.matrix_figure import matrix_figure


def texts_of(figure):
    return [text.get_text() for text in figure.axes[0].texts]


def test_a_cell_has_the_median_of_its_trials_and_a_failed_one_its_status(scored):
    trials = [
        scored("a", case="x", ate_m=0.01),
        scored("a", case="x", ate_m=0.03, repeat=1),
        scored("a", case="x", ate_m=0.02, repeat=2),
        scored("a", "diverged", case="y", ate_m=7.0),
    ]
    figure = matrix_figure(make_board(trials, {}), "ate", 3.5)
    assert texts_of(figure) == ["2", "diverged"]
    (patch,) = figure.axes[0].patches
    assert patch.get_hatch() == "////"


def test_colours_are_on_a_logarithmic_scale_around_the_values(scored):
    trials = [scored("a", case="x", ate_m=0.001), scored("b", case="x", ate_m=0.1)]
    figure = matrix_figure(make_board(trials, {}), "ate", 3.5)
    (image,) = figure.axes[0].get_images()
    shares = [float(image.norm(value)) for value in (0.1, 1.0, 10.0)]
    assert shares == pytest.approx([0.04, 0.5, 0.96], abs=0.03)


def test_text_is_white_on_dark_colours_and_black_on_pale_ones(scored):
    trials = [scored("a", case="x", ate_m=0.001), scored("b", case="x", ate_m=0.1)]
    figure = matrix_figure(make_board(trials, {}), "ate", 3.5)
    colours = {text.get_text(): text.get_color() for text in figure.axes[0].texts}
    assert colours == {"0.1": "black", "10": "white"}


def test_a_missing_cell_is_left_blank_and_a_matrix_without_values_is_an_error(scored):
    trials = [scored("a", case="x", ate_m=0.01), scored("a", case="y", ate_m=0.01), scored("b", case="x", ate_m=0.02)]
    assert len(texts_of(matrix_figure(make_board(trials, {}), "ate", 3.5))) == 3
    with pytest.raises(InputError, match="no cell of this run has a value of ate"):
        matrix_figure(make_board([scored("a", "crashed", ate_m=None)], {}), "ate", 3.5)
