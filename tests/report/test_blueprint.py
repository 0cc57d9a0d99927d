"""The colours of a recording are what they are called."""

import colorsys

import numpy as np
import pytest

from vobench.report import blueprint as bp
from vobench.report.figure_style import COLOURS


@pytest.mark.parametrize(
    ("name", "hue_deg"), [("orange", 32), ("blue", 212), ("violet", 285), ("yellow", 52), ("cyan", 180)]
)
def test_each_colour_is_what_it_is_called(name, hue_deg):
    red, green, blue = (value / 255 for value in bp.ESTIMATOR_COLORS[name])
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    assert 360 * hue == pytest.approx(hue_deg, abs=3)
    assert 0.5 < lightness < 0.75
    assert saturation > 0.55


def test_an_estimator_has_the_colour_of_its_position_also_when_it_is_shown_alone():
    names = list(bp.ESTIMATOR_COLORS)
    assert [bp.estimator_colors([position]) for position in range(len(names))] == [[name] for name in names]
    assert bp.estimator_colors([3, 1]) == [names[3], names[1]]


def test_two_estimators_never_share_a_colour():
    names = list(bp.ESTIMATOR_COLORS)
    count = len(names)
    assert bp.estimator_colors([0, count, 0]) == names[:3]
    assert bp.estimator_colors([count - 1, 2 * count - 1]) == [names[-1], names[0]]


def test_the_colours_are_like_those_of_the_figures_but_for_green():
    for position, (red, green, blue) in enumerate(bp.ESTIMATOR_COLORS.values()):
        in_rerun = colorsys.rgb_to_hls(red / 255, green / 255, blue / 255)
        figure_rgb = [int(COLOURS[position][at : at + 2], 16) / 255 for at in (1, 3, 5)]
        in_figure = colorsys.rgb_to_hls(*figure_rgb)
        hue_change_deg = 360 * abs(in_rerun[0] - in_figure[0])
        assert min(hue_change_deg, 360 - hue_change_deg) < 45, position


def test_more_estimators_than_colours_are_refused_and_none_is_left_out():
    path_m = np.zeros((3, 3))
    most = len(bp.ESTIMATOR_COLORS)
    with pytest.raises(ValueError, match="at most 5 estimators, got 6"):
        bp.estimator_colors(range(most + 1))
    labels = [f"estimator {index}" for index in range(most)]
    colors = bp.estimator_colors(range(most))
    bp.layout(path_m, path_m, bp.LayoutOptions(replayed_frames=None, labels=labels, colors=colors))
    with pytest.raises(ValueError, match="zip"):
        bp.layout(path_m, path_m, bp.LayoutOptions(replayed_frames=None, labels=labels, colors=colors[1:]))
