"""Estimators have the positions of the suite's list."""

from vobench.report.estimator_order import estimator_positions


def test_positions_follow_the_list_and_not_the_alphabet():
    assert estimator_positions(["b", "a", "c"], ["c", "b"]) == {"b": 0, "c": 1}


def test_an_estimator_that_is_not_listed_comes_after_all_that_are():
    assert estimator_positions(["m"], {"z", "a", "m"}) == {"m": 0, "a": 1, "z": 2}


def test_a_further_estimator_at_the_end_of_the_list_changes_no_position():
    before = estimator_positions(["b", "a"], ["a", "b"])
    after = estimator_positions(["b", "a", "0"], ["a", "b", "0"])
    assert {name: after[name] for name in before} == before
