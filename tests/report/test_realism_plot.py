"""The plot of realism: bands, and what is outside of them."""

import numpy as np
import pytest

from vobench.analysis.realism import STATISTICS, Realism
from vobench.analysis.realism_band import CAR_BANDS
from vobench.analysis.stereo_fit import Matches, StereoFit, Uncertain
from vobench.errors import InputError
from vobench.report import realism_plot
from vobench.report.realism_plot import COLOURS, SCALE_HIGH, SCALE_LOW, save_realism_plot


def pair(row_mad_px=0.2):
    rng = np.random.default_rng(0)
    place = rng.uniform(-0.6, 0.6, (5000, 2))
    coefficients = np.array([0.5, 0.2, 0.0, 0.0, 0.0])
    row_px = 0.5 + 0.2 * place[:, 0] + rng.normal(0, 0.1, 5000)
    matches = Matches(place, row_px, np.full(5000, 9.0), np.zeros(5000, np.int64))
    zero = Uncertain(0.0, 0.1)
    return StereoFit(400.0, 0.1, matches, row_mad_px, 0.1, coefficients, zero, zero, zero, 1.0, (9.0,), None, "")


def realism(place=0.5, fit=None):
    """Statistics that all lie at one place of their bands: 0 is the low end, 1 the high end."""
    values = {name: band.low + place * (band.high - band.low) for name, band in CAR_BANDS.items()}
    curves = {
        "power": np.linspace(4, 1, 100),
        "gradient": np.linspace(100, 1, 128),
        "alive": np.linspace(1, 0.4, 14),
        "grey": np.ones(256),
    }
    return Realism(values, {}, curves, fit, 9)


@pytest.fixture
def axes():
    from matplotlib.figure import Figure

    return Figure().add_subplot()


def words(path):
    return [line.strip()[5:-4] for line in path.read_text().splitlines() if line.strip().startswith("<!-- ")]


def test_recordings_are_named_and_the_same_file_twice(tmp_path):
    found = {"street": realism(fit=pair()), "twin": realism(0.2)}
    for name in ("a.svg", "b.svg"):
        save_realism_plot(tmp_path / name, found)
    assert {"street", "twin", "low end", "high end", "grey values"} <= set(words(tmp_path / "a.svg"))
    assert words(tmp_path / "a.svg") == words(tmp_path / "b.svg")


def test_another_ending_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"should end in \.svg, \.png, \.pdf"):
        save_realism_plot(tmp_path / "a.gif", {"street": realism()})


@pytest.mark.parametrize(
    ("place", "shown", "marker"),
    [(0.5, 0.5, "o"), (-1.9, -1.9, "o"), (2.9, 2.9, "o"), (-5.0, SCALE_LOW, "<"), (9.0, SCALE_HIGH, ">")],
)
def test_a_value_is_a_dot_in_its_band_or_an_arrow_at_the_edge(axes, place, shown, marker):
    realism_plot._bands(axes, {"street": realism(place)})
    dots = axes.get_lines()[1:]
    assert [line.get_marker() for line in dots] == [marker] * len(STATISTICS)
    np.testing.assert_allclose([line.get_xdata()[0] for line in dots], shown)
    assert [line.get_ydata()[0] for line in dots] == list(range(len(STATISTICS)))
    text = axes.texts[0].get_text()
    first = CAR_BANDS[STATISTICS[0].name]
    assert text == f"{first.low + place * (first.high - first.low):.2f}"


def test_a_number_is_below_its_dot_and_does_not_touch_it(axes):
    axes.figure.set_size_inches(*realism_plot.SIZE_INCHES)
    axes.figure.set_dpi(72)  # a pixel is a point
    realism_plot._bands(axes, {"street": realism()})
    axes.figure.draw_without_rendering()
    dots = axes.get_lines()[1:]
    for dot, number in zip(dots, axes.texts, strict=True):
        _, centre_px = axes.transData.transform(dot.get_xydata()[0])
        assert number.get_window_extent().y1 < centre_px - dot.get_markersize() / 2


def test_several_recordings_are_side_by_side_and_a_missing_value_has_no_dot(axes):
    partial = realism()
    del partial.values[STATISTICS[0].name]
    realism_plot._bands(axes, {"a": realism(), "b": partial})
    rows = [line.get_ydata()[0] for line in axes.get_lines() if len(line.get_ydata())]
    assert len(rows) == 2 * len(STATISTICS) - 1
    assert rows[:2] == pytest.approx([-0.14, 0.86])
    assert rows[len(STATISTICS)] == pytest.approx(1.14)


def test_row_errors_are_dots_and_their_fit_is_a_line_within_a_symmetric_range(axes):
    realism_plot._row_errors(axes, pair(), 0, COLOURS[0])
    dots, fit = axes.get_lines()
    assert len(dots.get_xdata()) == realism_plot.MOST_DOTS
    ends = [0, -1]
    np.testing.assert_array_equal(dots.get_xdata()[ends], pair().matches.place[ends, 0])
    np.testing.assert_allclose(fit.get_ydata(), 0.5 + 0.2 * fit.get_xdata())
    assert -0.6 < fit.get_xdata()[0] < -0.59
    assert axes.get_ylim() == pytest.approx((-0.8, 0.8))


def test_the_range_is_that_of_the_recording_with_the_largest_errors(axes):
    for mad_px in (0.5, 0.2):
        realism_plot._row_errors(axes, pair(mad_px), 1, COLOURS[0])
    assert axes.get_ylim() == pytest.approx((-2.0, 2.0))
    realism_plot._row_errors(axes, pair(0.75), 1, COLOURS[0])
    assert axes.get_ylim() == pytest.approx((-3.0, 3.0))


def test_small_errors_are_not_blown_up(axes):
    realism_plot._row_errors(axes, pair(0.01), 0, COLOURS[0])
    assert axes.get_ylim() == pytest.approx((-0.3, 0.3))


def test_curves_are_in_the_units_of_their_axes():
    from matplotlib.figure import Figure

    panels = Figure().subplot_mosaic([["spectrum", "gradient", "tracks", "grey"]])
    given = realism()
    realism_plot._curves(panels, {"street": given})
    spectrum = panels["spectrum"].get_lines()[0]
    assert spectrum.get_xdata().tolist() == list(range(1, 100))
    np.testing.assert_allclose(spectrum.get_ydata(), 10 ** given.curves["power"][1:])
    assert panels["gradient"].get_lines()[0].get_ydata().sum() == pytest.approx(1.0)
    assert panels["tracks"].get_lines()[0].get_ydata()[0] == 100.0
    (area,) = panels["grey"].collections
    assert area.get_paths()[0].vertices[:, 1].max() == pytest.approx(100 / 256)


def test_limits_and_titles_tell_what_is_drawn(axes):
    from matplotlib.figure import Figure

    realism_plot._bands(axes, {"street": realism()})
    (band,) = axes.patches
    assert (band.get_x(), band.get_width(), band.get_facecolor()[:3]) == (
        0,
        1,
        pytest.approx((201 / 255, 228 / 255, 211 / 255)),
    )
    assert axes.get_xlim() == pytest.approx((-2.3, 3.3))
    assert axes.get_ylim() == pytest.approx((len(STATISTICS) - 0.4, -0.6))
    panels = Figure().subplot_mosaic([["spectrum", "gradient", "tracks", "grey"]])
    realism_plot._curves(panels, {"street": realism()})
    dotted = [line.get_xdata()[0] for line in panels["spectrum"].get_lines() if line.get_linestyle() == ":"]
    assert dotted == list(realism_plot.CYCLES)
    assert panels["tracks"].get_ylim() == (0, 103)
    assert [line.get_xdata()[0] for line in panels["grey"].get_lines()] == [realism_plot.SATURATED_DN]


def test_curves_are_thin_and_helping_lines_thinner():
    from matplotlib.figure import Figure

    panels = Figure().subplot_mosaic([["spectrum", "gradient", "tracks", "grey"]])
    realism_plot._curves(panels, {"street": realism()})
    for name in ("spectrum", "gradient", "tracks"):
        assert panels[name].get_lines()[0].get_linewidth() == 1.2
    helping = [*panels["spectrum"].get_lines()[1:], *panels["grey"].get_lines()]
    assert {line.get_linewidth() for line in helping} == {0.6}
    assert panels["tracks"].get_lines()[0].get_markersize() == 3


def test_dots_of_row_errors_are_faint_and_the_fit_is_not(axes):
    realism_plot._row_errors(axes, pair(), 0, COLOURS[0])
    dots, fit = axes.get_lines()
    assert (dots.get_markersize(), dots.get_alpha()) == (1.5, 0.3)
    assert (fit.get_linewidth(), len(fit.get_xdata())) == (2, 30)


def test_both_axes_of_the_picture_have_a_panel():
    from matplotlib.figure import Figure

    across, down = Figure().subplots(1, 2)
    realism_plot._rows(across, down, {"street": realism(fit=pair()), "mono": realism()})
    np.testing.assert_allclose(across.get_lines()[1].get_ydata(), 0.5 + 0.2 * across.get_lines()[1].get_xdata())
    np.testing.assert_allclose(down.get_lines()[1].get_ydata(), 0.5)
    assert (across.get_xlabel(), down.get_xlabel()) == ("x / f", "y / f")
