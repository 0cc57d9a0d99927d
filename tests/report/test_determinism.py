"""A statement of determinism is believed after two equal answers to one sequence, and refuted by different ones."""

import pytest

from vobench.report import page
from vobench.report.determinism import determinism_remarks, repeated_answers
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import CASE, NOT_DETERMINISTIC
from vobench.runner.store import write_json


@pytest.fixture
def run_of(scored, write_run, tmp_path):
    """A run of estimator a with repeats on two cases, after some answers have changed, and its scores."""

    def make(*, repeats=2, changed=(), **facts):
        cases = ("down", "ahead")
        scores = [scored("a", case=case, repeat=repeat, **facts) for case in cases for repeat in range(repeats)]
        folder = write_run(tmp_path / "runs" / "run", scores)
        for case in changed:
            path = folder.estimate(case, "a", 1) / ESTIMATE
            path.write_text(path.read_text() + " ")
        return folder, scores

    return make


def remarks_of(run):
    found = determinism_remarks(repeated_answers(*run))
    assert set(found) <= set(page.run_board(*run).remarks)
    return found


def test_an_estimator_with_equal_answers_is_believed_and_they_count_once(run_of):
    run = run_of()
    assert remarks_of(run) == ["Deterministic by two answers that are equal in every byte is a"]
    assert [cell.trials for cell in page.run_board(*run).cells] == [1, 1]


def test_an_estimator_with_different_answers_counts_as_not_deterministic(run_of):
    run = run_of(changed=("ahead",))
    assert remarks_of(run) == [
        "a states that it is deterministic, but gave different answers to ahead; it counts as not deterministic"
    ]
    assert all(NOT_DETERMINISTIC in cell.claims for cell in page.run_board(*run).cells)


def test_nothing_is_said_without_repeats(run_of):
    assert remarks_of(run_of(repeats=1)) == []


def test_the_answers_of_an_estimator_that_states_chance_may_differ_and_all_count(run_of):
    run = run_of(changed=("ahead",), claims=(NOT_DETERMINISTIC,))
    assert remarks_of(run) == []
    assert [cell.trials for cell in page.run_board(*run).cells] == [2, 2]


def test_trials_that_did_not_finish_have_no_answer_to_compare(run_of):
    assert remarks_of(run_of(status="crashed", ate_m=None)) == []


def test_the_repeats_of_a_case_with_new_noise_are_one_cell_with_the_range_of_all(scored, write_run, tmp_path):
    errors_m = {"down": 0.001, "down-repeat2": 0.003, "down-repeat3": 0.002}
    scores = [scored("a", case=case, repeat=k, ate_m=ate_m) for k, (case, ate_m) in enumerate(errors_m.items())]
    folder = write_run(tmp_path / "runs" / "run", scores)
    for case in errors_m:
        write_json(folder.case(case) / CASE, {"seed": 1, "repeat_of": None if case == "down" else "down"})
    board = page.run_board(folder, scores)
    assert board.cases == ["down"]
    assert board.cell("down", "a").spread("ate_mm") == pytest.approx((2, 1, 3))
    assert "down-repeat2" in page.board_page(folder, scores, board, folder.path)  # the worst trial can be opened
