"""Short forms of the benchmarks that plant causes, and the cases with pictures can be read."""

from pathlib import Path

import pytest

from tests.benchmarks.loading import BENCHMARKS, load


def test_explain_names_planted_weaknesses_and_abstains_where_there_is_none() -> None:
    planted = load("planted_outcomes")
    verdicts = list(planted.draw_verdicts(42, 11))
    summary = planted.summarize(verdicts)
    assert {verdict.kind for verdict in verdicts} == {*planted.NAMEABLE, *planted.UNNAMEABLE}
    assert summary.precision >= 0.9
    assert summary.recall >= 0.8
    assert summary.abstention >= 0.95
    assert 0.9 < summary.confirmed_coverage <= 1
    assert 0.93 < summary.screened_coverage <= 1


@pytest.mark.parametrize("weakness", ["coin", "bursts", "clock", "after N frames"])
def test_causes_names_nothing_false_where_none_of_its_conditions_is_the_cause(weakness: str) -> None:
    planted = load("planted_conditions")
    verdicts = [planted.judge(weakness, planted.attribute_weakness(weakness, seed)) for seed in range(4)]
    assert sum(verdict.is_false for verdict in verdicts) <= 1


@pytest.mark.parametrize("weakness", ["calibration", "left eye", "moving"])
def test_causes_names_a_condition_that_is_the_cause(weakness: str) -> None:
    planted = load("planted_conditions")
    verdicts = [planted.judge(weakness, planted.attribute_weakness(weakness, seed)) for seed in range(3)]
    assert sum(verdict.is_found for verdict in verdicts) >= 2


@pytest.mark.parametrize("world", ["planted.yaml", "held_out.yaml"])
def test_worlds_with_pictures_are_read_and_plan_a_case_for_each_cause(world: str, tmp_path: Path) -> None:
    planted = load("planted")
    found = planted.read_world(BENCHMARKS / world)
    for name, change in found.planted.items():
        suite = found.write(tmp_path, name, [change], [change["estimator"]])
        assert suite.is_file()
        assert change["cause"] in planted.SHOWN
