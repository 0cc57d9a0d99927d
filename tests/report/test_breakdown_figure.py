"""Breakdown curves: medians with the range of all trials, one panel for each scenario."""

import numpy as np
import pytest

from tests.report.paths import line_of
from vobench.errors import InputError
from vobench.report.breakdown_figure import breakdown_figure
from vobench.report.cell import CaseFacts
from vobench.report.leaderboard import make_board


def cells_of(scored, *, scenarios=("blur",), scores=((0.9, 0.8, 0.95), (0.6, 0.5, 0.7))):
    """Cells of one estimator: the scores of its trials at each severity of each scenario."""
    facts = {}
    trials = []
    for scenario in scenarios:
        for severity, values in enumerate(scores):
            case = f"{scenario}-{severity}"
            facts[case] = CaseFacts(scenario=scenario, severity=severity)
            for repeat, value in enumerate(values):
                content = {"metrics": [], "failure": {"lost_aware": value}}
                trials.append(scored("a", case=case, score=content, repeat=repeat))
    return make_board(trials, {}, facts).cells


def test_the_line_is_the_median_and_the_band_the_range_of_the_trials(scored):
    figure = breakdown_figure(cells_of(scored), {"a": 0}, 3.5)
    axes = figure.axes[0]
    line = line_of(axes, "a")
    assert line.get_xdata().tolist() == [0, 1]
    assert line.get_ydata() == pytest.approx([0.9, 0.6])
    (band,) = axes.collections
    heights = band.get_paths()[0].vertices[:, 1]
    assert (heights.min(), heights.max()) == pytest.approx((0.5, 0.95))


def test_each_scenario_has_a_panel_and_unused_ones_are_blank(scored):
    figure = breakdown_figure(cells_of(scored, scenarios=("blur", "fog", "noise")), {"a": 0}, 3.5)
    titles = [axes.get_title() for axes in figure.axes if axes.axison]
    assert titles == ["blur", "fog", "noise"]
    assert len(figure.axes) == 4
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["a"]


def test_one_severity_is_no_curve(scored):
    with pytest.raises(InputError, match="no scenario of this run has two severities"):
        breakdown_figure(cells_of(scored, scores=((0.9,),)), {"a": 0}, 3.5)


def test_scores_are_on_a_scale_from_zero_to_one(scored):
    axes = breakdown_figure(cells_of(scored), {"a": 0}, 3.5).axes[0]
    np.testing.assert_allclose(axes.get_ylim(), (-0.05, 1.05))
