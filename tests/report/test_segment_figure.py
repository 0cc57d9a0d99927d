"""Box plots of segment errors: the quartiles of what the score measured, pooled over cases."""

import numpy as np
import pytest

from tests.report.paths import case_of, path
from vobench.errors import InputError
from vobench.report.scored_case import ScoredCase, ScoredEstimate
from vobench.report.segment_figure import segment_figure


def samples_of(case, metric="kitti_t_rel"):
    (score,) = [score for _, score in case.scores]
    return next(samples for samples in score.samples if samples.of.id == metric)


def medians_of(axes):
    """The heights of the horizontal lines in the middle of the boxes."""
    return sorted(line.get_ydata()[0] for line in axes.get_lines() if line.get_color() == "black")


def test_the_line_in_a_box_is_the_median_of_all_segments_of_a_length():
    case = case_of(path(0.02))
    translation_axes, rotation_axes = segment_figure([case], 3.5).axes
    samples = samples_of(case)
    lengths_m = np.unique(samples.over.length_m)
    expected = [100 * np.median(samples.errors[samples.over.length_m == length]) for length in lengths_m]
    assert medians_of(translation_axes) == pytest.approx(sorted(expected))
    assert [text.get_text() for text in rotation_axes.get_xticklabels()] == [f"{length:g}" for length in lengths_m]


def test_segments_of_several_cases_are_pooled():
    small = case_of(path(0.01))
    large = case_of(path(0.03))
    figure = segment_figure([small, large], 3.5)
    errors = np.concatenate([samples_of(small).errors, samples_of(large).errors])
    lengths_m = np.concatenate([samples_of(small).over.length_m, samples_of(large).over.length_m])
    expected = [100 * np.median(errors[lengths_m == length]) for length in np.unique(lengths_m)]
    assert medians_of(figure.axes[0]) == pytest.approx(sorted(expected))
    assert figure.get_suptitle() == "2 cases"


def test_estimators_stand_side_by_side_in_their_colours():
    figure = segment_figure([case_of(path(0.01), path(0.02))], 3.5)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["e0", "e1"]
    assert len({patch.get_facecolor() for patch in legend.get_patches()}) == 2
    lengths = len(np.unique(samples_of(case_of(path(0.01))).over.length_m))
    assert len(medians_of(figure.axes[0])) == 2 * lengths


def test_without_a_segment_there_is_an_error():
    empty = ScoredCase("bend", path(), (ScoredEstimate("e0", 0, None, "lost"),))
    with pytest.raises(InputError, match="no estimate has a segment"):
        segment_figure([empty], 3.5)
