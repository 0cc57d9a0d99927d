"""The style of figures: distinguishable lines, files without dates, plain numbers on logarithmic axes."""

import pytest

from vobench.errors import InputError
from vobench.report.figure_style import COLOURS, ENDINGS, label_plainly, line_style, marker_style, save_figure
from vobench.report.inline_figure import new_figure


def test_the_first_28_estimators_differ_in_colour_or_line():
    styles = {tuple(line_style(index).values()) for index in range(28)}
    assert len(styles) == 28
    markers = {tuple(marker_style(index).values()) for index in range(2 * len(COLOURS))}
    assert len(markers) == 2 * len(COLOURS)


@pytest.mark.parametrize("ending", ENDINGS)
def test_equal_figures_are_equal_files(ending, tmp_path):
    for name in ("a", "b"):
        with new_figure(2, 2) as figure:
            figure.subplots().plot([1, 2, 3], label="line")
        save_figure(figure, tmp_path / f"{name}{ending}")
    assert (tmp_path / f"a{ending}").read_bytes() == (tmp_path / f"b{ending}").read_bytes()


def test_another_ending_and_a_folder_that_is_missing_are_errors(tmp_path):
    with new_figure(2, 2) as figure:
        figure.subplots()
    with pytest.raises(InputError, match=r"should end in \.svg, \.png, \.pdf, got .*a\.jpg"):
        save_figure(figure, tmp_path / "a.jpg")
    with pytest.raises(InputError, match=r"cannot write .*: No such file or directory"):
        save_figure(figure, tmp_path / "none" / "a.pdf")


@pytest.mark.parametrize(
    ("ends", "shown"),
    [
        ((0.5, 20), ["1", "2", "5", "10", "20"]),
        ((0.01, 100), ["0.1", "1", "10"]),
        ((0.34, 0.55), ["0.36", "0.42", "0.48", "0.54"]),
    ],
)
def test_a_logarithmic_axis_has_plain_numbers(ends, shown):
    with new_figure(3, 3) as figure:
        axes = figure.subplots()
        axes.set(yscale="log", ylim=ends)
        label_plainly(axes.yaxis)
    figure.canvas.draw()
    texts = [text.get_text() for text in axes.get_yticklabels()]
    assert set(shown) <= set(texts)


def test_a_very_short_axis_is_not_crowded():
    with new_figure(3, 3) as figure:
        axes = figure.subplots()
        axes.set(yscale="log", ylim=(1.9, 4.5))
        label_plainly(axes.yaxis)
    figure.canvas.draw()
    assert len([tick for tick in axes.get_yticks() if 1.9 <= tick <= 4.5]) <= 5
    assert len(axes.yaxis.get_minorticklocs()) == 0
