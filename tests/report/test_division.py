"""Estimators are ranked among their like: with the same sensors, calibration and alignment."""

import math

import pytest

from vobench.report.cell import CaseFacts, Cell
from vobench.report.division import METRIC, Division, divisions, is_ranked
from vobench.report.frame_statistics import EstimatorStatistics
from vobench.runner.folder import ORACLE, TRUTH_COPY
from vobench.runner.score import NO_SCALE

BASELINE = ("baseline",)


def cell(estimator, *, sensors=("stereo",), claims=(), group="", case="a"):
    """A cell with what divisions depend on."""
    return Cell(
        case=case,
        estimator=estimator,
        facts=CaseFacts(group=group),
        failures=(False,),
        status="ok",
        reason="",
        values={},
        losses=(math.nan,),
        errors=(math.nan,),
        answered=EstimatorStatistics(),
        claims=claims,
        sensors=sensors,
    )


def members(cells):
    """The names of the estimators of each division, in the order of the divisions."""
    return {division: [cell.estimator for cell in of_it] for division, of_it in divisions(cells).items()}


def test_baselines_and_oracles_have_no_rank_whatever_else_they_claim():
    assert is_ranked(cell("p"))
    assert is_ranked(cell("p", claims=(NO_SCALE, "not causal")))
    assert not is_ranked(cell("b", claims=("not causal", *BASELINE)))
    assert not is_ranked(cell("o", claims=(ORACLE,)))
    assert not is_ranked(cell("c", claims=(TRUTH_COPY,)))


def test_every_ranked_cell_is_in_exactly_one_division():
    cells = [
        cell(name, sensors=sensors, claims=claims, group=group, case=case)
        for name, sensors, claims in [
            ("p", ("stereo",), ()),
            ("q", ("stereo", "imu"), ()),
            ("r", ("stereo",), (NO_SCALE,)),
            ("s", (), ()),
        ]
        for group in ("", "worn")
        for case in ("a", "b")
    ]
    found = divisions(cells)
    assert len(found) == 4 * 2
    gathered = [id(member) for of_it in found.values() for member in of_it]
    assert sorted(gathered) == sorted(map(id, cells))


def test_a_difference_in_sensors_calibration_or_alignment_alone_parts_two_estimators():
    one = cell("p")
    for other in (cell("q", sensors=("mono",)), cell("q", group="worn"), cell("q", claims=(NO_SCALE,))):
        assert len(divisions([one, other])) == 2
    assert len(divisions([one, cell("q", claims=("not causal",)), cell("q", case="b")])) == 1


def test_an_unranked_estimator_stands_beside_every_division_of_its_calibration_and_of_no_other():
    cells = [
        cell("b", claims=BASELINE, sensors=()),
        cell("p"),
        cell("q", sensors=("stereo", "imu")),
        cell("r", group="worn"),
    ]
    assert members(cells) == {
        Division("", "stereo", METRIC): ["p", "b"],
        Division("", "stereo + imu", METRIC): ["q", "b"],
        Division("worn", "stereo", METRIC): ["r"],
    }


def test_unranked_estimators_alone_are_a_division_of_their_own():
    cells = [cell("b", claims=BASELINE), cell("o", claims=(ORACLE,)), cell("p", group="worn")]
    assert members(cells) == {Division("", "", METRIC): ["b", "o"], Division("worn", "stereo", METRIC): ["p"]}


def test_divisions_come_in_the_order_of_their_names_whatever_that_of_the_cells():
    cells = [cell("p", group="worn"), cell("q", sensors=("mono",)), cell("r", sensors=("imu",))]
    expected = [Division("", "imu", METRIC), Division("", "mono", METRIC), Division("worn", "stereo", METRIC)]
    assert list(divisions(cells)) == list(divisions(cells[::-1])) == expected


@pytest.mark.parametrize(
    ("others", "label"),
    [
        ([], ""),
        ([Division("", "mono", METRIC)], "stereo"),
        ([Division("", "stereo", NO_SCALE)], METRIC),
        ([Division("worn", "stereo", METRIC)], "calibration none"),
        ([Division("worn", "mono", NO_SCALE)], f"stereo, {METRIC}, calibration none"),
    ],
)
def test_a_division_is_called_by_what_sets_it_apart(others, label):
    one = Division("", "stereo", METRIC)
    assert one.label([one, *others]) == label


def test_a_division_without_sensors_says_so():
    blind = Division("worn", "", METRIC)
    assert blind.label([blind, Division("worn", "stereo", METRIC)]) == "no sensors"
    assert blind.label([blind, Division("", "", METRIC)]) == "calibration worn"
