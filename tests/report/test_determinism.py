"""Determinism is believed after two equal answers, and repeats that say nothing new are named."""

import pytest

from vobench.report import page
from vobench.report.determinism import determinism_remarks
from vobench.runner.estimate import ESTIMATE


@pytest.fixture
def remarks_of(scored, write_run, tmp_path):
    """The remarks on a run of estimator a with repeats on two cases, after some answers have changed."""

    def remarks(*, repeats=2, changed=(), **facts):
        cases = ("down", "ahead")
        scores = [scored("a", case=case, repeat=repeat, **facts) for case in cases for repeat in range(repeats)]
        folder = write_run(tmp_path / "runs" / "run", scores)
        for case in changed:
            path = folder.estimate(case, "a", 1) / ESTIMATE
            path.write_text(path.read_text() + " ")
        found = determinism_remarks(folder, scores)
        assert set(found) <= set(page.run_board(folder, scores).remarks)
        return found

    return remarks


def test_equal_repeats_count_once_and_the_board_says_what_to_do_instead(remarks_of):
    expected = "Repeats of a are equal in every byte and count once; noise_seeds draws new noise instead"
    assert remarks_of() == [expected]


def test_an_estimator_whose_repeats_differ_is_not_believed(remarks_of):
    expected = "a states that it is deterministic, but its repeats differ in 1 of 2 cases"
    assert remarks_of(changed=("ahead",)) == [expected]


def test_nothing_is_said_without_repeats_or_of_estimators_that_state_chance(remarks_of):
    assert remarks_of(repeats=1) == []


def test_an_estimator_that_states_chance_may_differ(remarks_of):
    assert remarks_of(changed=("ahead",), claims=("not deterministic",)) == []


def test_trials_that_did_not_finish_have_no_answer_to_compare(remarks_of):
    assert remarks_of(status="crashed", ate_m=None) == []
