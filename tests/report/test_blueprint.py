"""The colours of a recording are what they are called."""

import colorsys

import numpy as np
import pytest

from vobench.report import blueprint as bp


@pytest.mark.parametrize(
    ("name", "hue_deg"), [("orange", 32), ("blue", 212), ("violet", 285), ("yellow", 52), ("cyan", 180)]
)
def test_each_colour_is_what_it_is_called(name, hue_deg):
    red, green, blue = (value / 255 for value in bp.ESTIMATOR_COLORS[name])
    hue, lightness, saturation = colorsys.rgb_to_hls(red, green, blue)
    assert 360 * hue == pytest.approx(hue_deg, abs=3)
    assert 0.5 < lightness < 0.75
    assert saturation > 0.55


def test_an_estimator_without_a_colour_is_refused_and_not_left_out():
    path_m = np.zeros((3, 3))
    most = len(bp.ESTIMATOR_COLORS)
    labels = [f"estimator {index}" for index in range(most + 1)]
    bp.layout(path_m, path_m, bp.LayoutOptions(replayed_frames=None, labels=labels[:most]))
    with pytest.raises(ValueError, match="zip"):
        bp.layout(path_m, path_m, bp.LayoutOptions(replayed_frames=None, labels=labels))
