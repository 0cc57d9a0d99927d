"""What the numbers of a cell do not show, in sentences."""

from dataclasses import replace

import pytest

from vobench.report.cell import CaseFacts, make_cell
from vobench.report.cell_notes import notes
from vobench.report.frame_statistics import EstimatorStatistics


@pytest.fixture
def cell(scored):
    return make_cell("case", [scored("a")], EstimatorStatistics(), CaseFacts())


def test_a_cell_without_peculiarities_has_no_note(cell):
    assert notes(cell) == []


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"status": "lost", "reason": "dark"}, "lost: dark"),
        ({"drift_mm": 2.34}, "drift of 2.3 mm while the camera is stationary"),
        ({"revised_ate_mm": 1.234, "revised_segment_percent": 0.5}, "revised estimate: ATE 1.23 mm, segments 0.500 %"),
        ({"revised_ate_mm": 1.234}, "revised estimate: ATE 1.23 mm, segments – %"),
        ({"scale_drift_percent_per_m": 0.123}, "aligned with scale, which drifts by +0.12 % per metre"),
        ({"scale_drift_percent_per_m": -0.123}, "aligned with scale, which drifts by -0.12 % per metre"),
        ({"consistency": "claims too much"}, "claims too much"),
    ],
)
def test_each_peculiarity_is_a_sentence_with_the_estimators_name(cell, changes, sentence):
    assert notes(replace(cell, **changes)) == [f"a: {sentence}"]


@pytest.mark.parametrize(
    ("answered", "sentence"),
    [
        ({"frames": 9, "dropped": 3, "late": 1}, "real time: 1 deadline missed, 3 of 9 frames dropped"),
        ({"frames": 9, "dropped": 3, "late": 2}, "real time: 2 deadlines missed, 3 of 9 frames dropped"),
        ({"reason": "few tracks", "count": 1, "first": 7}, '1 frame with "few tracks", first in frame 7'),
        ({"offset_px": 1.13}, "disparities of this stereo pair look off by +1.1 px: check its calibration"),
        ({"offset_px": -0.8}, "disparities of this stereo pair look off by -0.8 px: check its calibration"),
        ({"reason": "few tracks", "count": 4, "first": 7}, '4 frames with "few tracks", first in frame 7'),
    ],
)
def test_so_is_each_of_its_frames(cell, answered, sentence):
    assert notes(replace(cell, answered=EstimatorStatistics(**answered))) == [f"a: {sentence}"]


def test_the_frames_of_several_trials_are_counted_together(cell):
    several = replace(cell, failures=(False, False), answered=EstimatorStatistics(reason="dark", count=4, first=7))
    assert notes(several) == ['a: 4 frames in 2 trials with "dark", first in frame 7']


def test_an_offset_of_disparities_as_small_as_those_of_a_pair_without_an_error_is_none(cell):
    assert notes(replace(cell, answered=EstimatorStatistics(offset_px=0.04))) == []
