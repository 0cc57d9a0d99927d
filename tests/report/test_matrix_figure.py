"""The heat map of cases and estimators: medians, and statuses where all trials failed."""

import pytest

from vobench.errors import InputError
from vobench.report.leaderboard import make_board
from vobench.report.matrix_figure import _number_text, matrix_figure


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
    assert texts_of(figure) == ["2.0", "diverged"]
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
    assert colours == {"0.10": "black", "10": "white"}


def test_a_score_of_zero_is_legible_beside_others(scored):
    trials = [scored("a", "lost", case="x", ate_m=None), scored("b", case="x", ate_m=0.01)]
    figure = matrix_figure(make_board(trials, {}), "score", 3.5)
    colours = {text.get_text(): text.get_color() for text in figure.axes[0].texts}
    assert colours["0"] == "black"


def visible_texts(figure):
    return [text.get_text() for text in figure.axes[0].texts if text.get_visible()]


def test_numbers_that_do_not_fit_their_cells_are_omitted(scored):
    trials = [scored(f"estimator_{number}", case="x", ate_m=0.0123) for number in range(20)]
    board = make_board(trials, {})
    assert visible_texts(matrix_figure(board, "ate", 3.5)) == []
    assert visible_texts(matrix_figure(board, "ate", 14.0)) == ["1.2"] * 20


def test_a_status_that_does_not_fit_its_cell_is_omitted_and_numbers_stay(scored):
    trials = [scored(f"e{number}", case="x", ate_m=0.0123) for number in range(6)]
    trials.append(scored("out", "out_of_memory", case="x", ate_m=None))
    assert visible_texts(matrix_figure(make_board(trials, {}), "ate", 3.5)) == ["1.2"] * 6


@pytest.mark.parametrize(
    ("value", "text"),
    [(123.4, "123"), (9.96, "10"), (9.94, "9.9"), (1.0, "1.0"), (0.5, "0.50"), (0.0712, "0.07"), (0.0042, "0.004")],
)
def test_numbers_have_two_digits_and_at_most_two_decimals_unless_they_are_tiny(value, text):
    assert _number_text(value) == text


def test_a_case_that_lacks_a_sensor_is_left_blank(scored):
    trials = [scored("a", case="x", ate_m=0.01), scored("imu", "not_applicable", case="x", ate_m=None)]
    figure = matrix_figure(make_board(trials, {}), "ate", 3.5)
    assert texts_of(figure) == ["1.0"]
    assert not figure.axes[0].patches


def test_a_missing_cell_is_left_blank_and_a_matrix_without_values_is_an_error(scored):
    trials = [scored("a", case="x", ate_m=0.01), scored("a", case="y", ate_m=0.01), scored("b", case="x", ate_m=0.02)]
    assert len(texts_of(matrix_figure(make_board(trials, {}), "ate", 3.5))) == 3
    with pytest.raises(InputError, match="no cell of this run has a value of ate"):
        matrix_figure(make_board([scored("a", "crashed", ate_m=None)], {}), "ate", 3.5)


@pytest.mark.parametrize("count", [2, 100])
def test_the_colour_bar_is_near_the_matrix_and_its_label_whole_however_many_cases_there_are(scored, count):
    trials = [scored("a", case=f"case_{number}", ate_m=0.01) for number in range(count)]
    figure = matrix_figure(make_board(trials, {}), "ate", 7.0)
    figure.draw_without_rendering()
    cells, bar = figure.axes
    gap_inches = (cells.get_window_extent().y0 - bar.get_window_extent().y1) / figure.dpi
    assert 0 < gap_inches < 0.2
    assert bar.xaxis.label.get_window_extent().y0 > 0
