"""What became better or worse between two runs, and what only looks so."""

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.report.compare import (
    BETTER,
    FAILS,
    GONE,
    MENDED,
    NEW,
    NOT_MADE,
    SAME,
    UNDECIDED,
    WORSE,
    compare,
    environment_differences,
)
from vobench.report.leaderboard import board
from vobench.runner.environment import Environment, Processor


@pytest.fixture
def trials(scored):
    def make(name="a", *, factor=1.0, cases=8, repeats=1, noise=0.1, seed=0):
        rng = np.random.default_rng(seed)
        return board(
            [
                scored(name, case=f"c{c}", repeat=r, ate_m=0.01 * factor * np.exp(rng.normal(0, noise)))
                for c in range(cases)
                for r in range(repeats)
            ],
            {},
        )

    return make


def verdicts(old, new, **options):
    changes = compare(old, new, **options)
    return {change.estimator: change for change in changes if not change.case}, [c for c in changes if c.case]


def test_a_run_is_the_same_as_itself(trials):
    totals, cells = verdicts(trials(), trials())
    assert {change.verdict for change in (*totals.values(), *cells)} == {SAME}


def test_twice_the_error_is_worse_and_half_of_it_better_within_an_interval_that_holds_it(trials):
    for factor, verdict in ((2.0, WORSE), (0.5, BETTER)):
        (change,) = verdicts(trials(), trials(factor=factor, seed=1))[0].values()
        assert change.verdict == verdict
        low, high = change.interval
        assert low < factor < high


def test_noise_alone_is_not_decided_in_most_runs(trials):
    found = [verdicts(trials(seed=k), trials(seed=100 + k))[0]["a"].verdict for k in range(30)]
    assert found.count(UNDECIDED) >= 28


def test_one_trial_a_cell_decides_nothing_of_a_cell_but_a_limit_does(trials):
    old, new = trials(), trials(factor=3.0, seed=1)
    assert {change.verdict for change in verdicts(old, new)[1]} == {UNDECIDED}
    assert {change.verdict for change in verdicts(old, new, at_most=1.5)[1]} == {WORSE}


def test_many_trials_decide_a_cell(trials):
    old, new = (trials(cases=2, repeats=8, factor=f, seed=s) for f, s in ((1.0, 0), (2.0, 1)))
    assert {change.verdict for change in verdicts(old, new)[1]} == {WORSE}


def test_what_fails_now_and_what_no_longer_does(scored):
    well, ill = board([scored("a")], {}), board([scored("a", "crashed", ate_m=None)], {})
    assert [verdicts(*pair)[1][0].verdict for pair in ((well, ill), (ill, well))] == [FAILS, MENDED]


def test_cells_of_one_run_alone_are_named(scored):
    old, new = board([scored("a"), scored("b")], {}), board([scored("a"), scored("a", case="ahead")], {})
    assert {(c.case, c.estimator): c.verdict for c in verdicts(old, new)[1]} == {
        ("down", "a"): SAME,
        ("down", "b"): GONE,
        ("ahead", "a"): NEW,
    }


def test_a_case_that_one_run_could_not_make_is_neither_gone_nor_worse(scored):
    whole = board([scored("a"), scored("a", case="flat")], {})
    partial = board([scored("a"), scored("a", "no_sequence", case="flat", ate_m=None)], {})
    for pair in ((whole, partial), (partial, whole)):
        totals, cells = verdicts(*pair)
        assert totals["a"].verdict == SAME
        assert {change.case: change.verdict for change in cells} == {"down": SAME, "flat": NOT_MADE}


def test_another_processor_is_named_and_runs_that_do_not_state_theirs_differ_in_nothing(scored):
    boards = [
        board([scored("a")], {}, environment=Environment(processors=(Processor("cpu", simd),))) for simd in ("v3", "v4")
    ]
    assert environment_differences(*boards) == ["processor cpu (v3) → cpu (v4)"]
    assert environment_differences(boards[0], boards[0]) == []
    assert environment_differences(board([scored("a")], {}), boards[1]) == []


def test_runs_of_different_suites_are_a_sentence(scored):
    with pytest.raises(
        InputError,
        match="the two runs have no estimator on the same case: the old run has a on down, the new run has a on ahead",
    ):
        compare(board([scored("a")], {}), board([scored("a", case="ahead")], {}))
