"""A figure that notebooks display by themselves."""

import matplotlib as mpl

from vobench.report.inline_figure import new_figure


def test_jupyter_shows_a_png_of_the_size():
    with new_figure(2, 1) as figure:
        figure.subplots().plot([1, 2])
    png = figure._repr_png_()
    assert png.startswith(b"\x89PNG")
    width_px = int.from_bytes(png[16:20])
    assert width_px == 220


def test_the_style_ends_with_the_context():
    before = mpl.rcParams["font.size"]
    with new_figure(2, 1):
        assert mpl.rcParams["font.size"] == 8
    assert mpl.rcParams["font.size"] == before
