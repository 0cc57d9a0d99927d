"""What became better or worse between two runs, and what only looks so."""

from math import comb

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.metric.significance import PairedDifference
from vobench.report.compare import (
    ALIKE,
    BETTER,
    FAILS,
    GONE,
    NEW,
    NOT_MADE,
    OTHER_MACHINE,
    RECOVERED,
    SAME,
    UNDECIDED,
    WORSE,
    CellPair,
    _difference_on_these_cases,
    compare,
    environment_differences,
)
from vobench.report.leaderboard import make_board
from vobench.runner.environment import Environment, Processor

RANDOM = ("not deterministic",)


@pytest.fixture
def trials(scored):
    def make(name="a", *, factor=1.0, cases=8, repeats=1, noise=0.1, seed=0):
        rng = np.random.default_rng(seed)
        return make_board(
            [
                scored(name, case=f"c{c}", repeat=r, ate_m=0.01 * factor * np.exp(rng.normal(0, noise)), claims=RANDOM)
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


def test_one_trial_a_cell_decides_nothing_of_a_cell_but_several_cases_do_of_the_estimator(trials):
    old, new = trials(), trials(factor=3.0, seed=1)
    totals, cells = verdicts(old, new)
    assert {change.verdict for change in cells} == {UNDECIDED}
    assert totals["a"].verdict == WORSE


def test_a_limit_turns_a_significant_but_small_change_into_none(trials):
    old, new = trials(noise=0.01), trials(factor=1.3, noise=0.01, seed=1)
    assert verdicts(old, new)[0]["a"].verdict == WORSE
    assert verdicts(old, new, at_most=1.5)[0]["a"].verdict == ALIKE
    assert verdicts(old, new, at_most=1.2)[0]["a"].verdict == WORSE


def test_few_cases_with_repeats_decide_by_the_chance_within_them(trials):
    old = trials(cases=2, repeats=8)
    assert verdicts(old, trials(cases=2, repeats=8, factor=2.0, seed=1))[0]["a"].verdict == WORSE
    assert verdicts(old, trials(cases=2, repeats=8, seed=1))[0]["a"].verdict == UNDECIDED
    assert verdicts(trials(cases=2), trials(cases=2, factor=9.0, seed=1))[0]["a"].verdict == UNDECIDED


@pytest.mark.parametrize(
    ("factor", "verdict"), [(30.0, WORSE), (1.1, WORSE), (1.03, ALIKE), (0.97, ALIKE), (0.5, BETTER)]
)
def test_a_change_of_a_deterministic_estimator_is_one_of_the_code_however_few_the_cases(scored, factor, verdict):
    old = make_board([scored("a", case=case, ate_m=0.002) for case in ("x", "y")], {})
    new = make_board([scored("a", case=case, ate_m=0.002 * factor) for case in ("x", "y")], {})
    totals, cells = verdicts(old, new)
    assert {change.verdict for change in (*totals.values(), *cells)} == {verdict}
    assert totals["a"].p is None


def test_one_case_of_twelve_that_got_worse_is_found(scored):
    old = make_board([scored("a", case=f"c{k}", ate_m=0.01) for k in range(12)], {})
    new = make_board([scored("a", case=f"c{k}", ate_m=0.03 if k == 5 else 0.01) for k in range(12)], {})
    assert [change.case for change in verdicts(old, new)[1] if change.verdict == WORSE] == ["c5"]


def test_what_another_machine_may_change_is_told_from_what_the_code_does(scored):
    def board(ate_m, simd):
        environment = Environment(processors=(Processor("cpu", simd),))
        return make_board([scored("a", ate_m=ate_m)], {}, environment=environment)

    old = board(0.01, "v3")
    assert verdicts(old, board(0.02, "v4"))[0]["a"].verdict == OTHER_MACHINE
    assert verdicts(old, board(0.02, "v3"))[0]["a"].verdict == WORSE
    assert verdicts(old, board(0.04, "v4"))[0]["a"].verdict == WORSE
    assert verdicts(old, board(0.0101, "v4"))[0]["a"].verdict == ALIKE


def test_failures_by_chance_are_no_regression_and_many_are(scored):
    def board(failed):
        return make_board(
            [scored("a", "lost" if k < failed else "ok", case=f"c{k}", claims=RANDOM, coverage=0.4) for k in range(20)],
            {},
        )

    assert verdicts(board(0), board(2))[0]["a"].verdict == UNDECIDED
    assert verdicts(board(0), board(12))[0]["a"].verdict == FAILS


@pytest.mark.parametrize("failed", [3, 4])
def test_new_failures_count_from_the_number_that_chance_rarely_puts_into_one_run(scored, failed):
    def board(failed, trials=10):
        statuses = ["lost"] * failed + ["ok"] * (trials - failed)
        return make_board(
            [scored("a", status, case=f"c{k}", claims=RANDOM, coverage=0.4) for k, status in enumerate(statuses)], {}
        )

    # Of all ways to spread the failures over both runs, these have all of them in the new one.
    chance = comb(10, failed) / comb(20, failed)
    verdict = FAILS if chance < 0.05 else UNDECIDED
    assert verdicts(board(0), board(failed))[0]["a"].verdict == verdict


def test_many_trials_decide_a_cell(trials):
    old, new = (trials(cases=2, repeats=8, factor=f, seed=s) for f, s in ((1.0, 0), (2.0, 1)))
    assert {change.verdict for change in verdicts(old, new)[1]} == {WORSE}


def test_what_fails_now_and_what_no_longer_does(scored):
    well, ill = make_board([scored("a")], {}), make_board([scored("a", "crashed", ate_m=None)], {})
    assert [verdicts(*pair)[1][0].verdict for pair in ((well, ill), (ill, well))] == [FAILS, RECOVERED]


def test_cells_of_one_run_alone_are_named(scored):
    old, new = make_board([scored("a"), scored("b")], {}), make_board([scored("a"), scored("a", case="ahead")], {})
    assert {(c.case, c.estimator): c.verdict for c in verdicts(old, new)[1]} == {
        ("down", "a"): SAME,
        ("down", "b"): GONE,
        ("ahead", "a"): NEW,
    }


def test_a_case_that_one_run_could_not_make_is_neither_gone_nor_worse(scored):
    whole = make_board([scored("a"), scored("a", case="flat")], {})
    partial = make_board([scored("a"), scored("a", "no_sequence", case="flat", ate_m=None)], {})
    for pair in ((whole, partial), (partial, whole)):
        totals, cells = verdicts(*pair)
        assert totals["a"].verdict == SAME
        assert {change.case: change.verdict for change in cells} == {"down": SAME, "flat": NOT_MADE}


def test_another_processor_is_named_and_runs_that_do_not_state_theirs_differ_in_nothing(scored):
    boards = [
        make_board([scored("a")], {}, environment=Environment(processors=(Processor("cpu", simd),)))
        for simd in ("v3", "v4")
    ]
    assert environment_differences(*boards) == ["processor cpu (v3) → cpu (v4)"]
    assert environment_differences(boards[0], boards[0]) == []
    assert environment_differences(make_board([scored("a")], {}), boards[1]) == []


def test_runs_of_different_suites_are_a_sentence(scored):
    with pytest.raises(
        InputError,
        match="the two runs have no estimator on the same case: the old run has a on down, the new run has a on ahead",
    ):
        compare(make_board([scored("a")], {}), make_board([scored("a", case="ahead")], {}))


def one_cell(scored, errors, statuses=None):
    statuses = statuses or ["ok"] * len(errors)
    return make_board(
        [
            scored("a", status, repeat=n, ate_m=ate)
            for n, (status, ate) in enumerate(zip(statuses, errors, strict=True))
        ],
        {},
    )


def cell_change(scored, old, new, **options):
    ((change,),) = [verdicts(one_cell(scored, *old), one_cell(scored, *new), **options)[1]]
    return change


def test_a_cell_is_described_by_its_error_and_its_failures(scored):
    change = cell_change(scored, ([0.02, 0.04, 0.03],), ([0.05, 0.05], ["ok", "lost"]))
    assert (change.old, change.new) == ("3 %", "5 %, 1/2 lost")
    failed = cell_change(scored, ([None], ["crashed"]), ([0.02],))
    assert (failed.old, failed.new) == ("1/1 crashed", "2 %")
    stationary = make_board([scored("a", drift_m=0.1)], {})
    assert verdicts(stationary, stationary)[1][0].old == "ok"


def test_a_cell_of_one_run_alone_has_a_dash_for_the_other(scored):
    old, new = make_board([scored("a"), scored("b")], {}), make_board([scored("a")], {})
    gone = next(change for change in verdicts(old, new)[1] if change.verdict == GONE)
    assert (gone.old, gone.new, gone.ratio, gone.p) == ("10 %", "–", None, None)


def test_a_ratio_is_that_of_the_geometric_means_of_the_losses(scored):
    change = cell_change(scored, ([0.01, 0.04],), ([0.02, 0.02],))
    assert change.ratio == pytest.approx(1.0)
    assert cell_change(scored, ([0.01],), ([0.03],)).ratio == pytest.approx(3.0)
    assert cell_change(scored, ([None], ["crashed"]), ([0.03],)).ratio < 0.2


@pytest.mark.parametrize(("trials", "has_interval"), [(3, False), (4, True)])
def test_an_interval_takes_four_trials_of_both(scored, trials, has_interval):
    old = [0.010, 0.011, 0.012, 0.013, 0.014][:trials]
    new = [2 * ate for ate in [0.010, 0.011, 0.012, 0.013, 0.014]]
    for pair in ((old, new), (new, old)):
        change = cell_change(scored, (pair[0],), (pair[1],))
        assert (change.interval is not None) == has_interval
    if has_interval:
        low, high = cell_change(scored, (old,), (new,)).interval
        assert 1.6 < low < 2.0 < high < 2.6


def test_trials_that_are_all_alike_have_no_interval(scored):
    assert cell_change(scored, ([0.01] * 4,), ([0.02] * 4,)).interval is None


def test_a_deterministic_cell_that_fails_more_often_fails_now_and_one_that_fails_less_is_mended(scored):
    partly = ([0.01, 0.01], ["ok", "lost"])
    assert cell_change(scored, ([0.01, 0.02],), partly).verdict == FAILS
    assert cell_change(scored, ([0.01, 0.02], ["lost", "lost"]), partly).verdict == RECOVERED
    assert cell_change(scored, ([0.01, 0.01], ["lost", "lost"]), ([0.01, 0.01],)).verdict == RECOVERED


def test_a_limit_is_exceeded_by_more_than_itself_only(scored):
    limit = cell_change(scored, ([0.01],), ([0.02],)).ratio
    assert cell_change(scored, ([0.01],), ([0.02],), at_most=limit).verdict == ALIKE
    assert cell_change(scored, ([0.01],), ([0.02],), at_most=0.999 * limit).verdict == WORSE


def test_a_total_has_both_scores_and_their_ratio(scored):
    def board(factor):
        return make_board([scored("a", case=case, ate_m=0.01 * factor) for case in ("x", "y")], {})

    old, new = board(1.0), board(2.0)
    (change,) = verdicts(old, new)[0].values()
    assert (change.case, change.verdict) == ("", WORSE)
    assert float(change.old) == pytest.approx(old.totals[0].score, abs=6e-5)
    assert float(change.new) == pytest.approx(new.totals[0].score, abs=6e-5)
    assert change.ratio == pytest.approx((1 - new.totals[0].score) / (1 - old.totals[0].score), rel=1e-6)
    (better,) = verdicts(new, old)[0].values()
    assert better.ratio == pytest.approx(1 / change.ratio)


def test_totals_come_first_by_name_and_then_every_cell(trials, scored):
    made = make_board([scored(name, case=case) for name in ("b", "a") for case in ("x", "y")], {})
    changes = compare(made, made)
    assert [(change.estimator, change.case) for change in changes] == [
        ("a", ""),
        ("b", ""),
        ("a", "x"),
        ("b", "x"),
        ("a", "y"),
        ("b", "y"),
    ]


def test_the_chance_in_a_mean_over_equal_cells_falls_with_the_root_of_their_number(trials):
    (old,) = trials(cases=1, repeats=8).cells
    (new,) = trials(cases=1, repeats=8, seed=1).cells
    pair = CellPair(old, new)
    unknown = PairedDifference(1, 0.0, np.nan)  # over cases

    def standard_error(count):
        difference = _difference_on_these_cases([pair] * count, unknown)
        return difference.std / np.sqrt(difference.units)

    log_losses = [np.log(cell.losses) for cell in (old, new)]
    assert standard_error(1) == pytest.approx(np.sqrt(sum(np.var(losses, ddof=1) / 8 for losses in log_losses)))
    assert standard_error(4) == pytest.approx(standard_error(1) / 2)
