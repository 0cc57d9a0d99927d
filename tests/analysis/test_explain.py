"""Which nuisance an estimator fails for, on errors that are made up."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

from tests.analysis.changes import change
from vobench.analysis.explain import Effort, _change, _suspects, effort, explain, folder_name
from vobench.analysis.explanation import Change, Explanation
from vobench.analysis.nuisance import Nuisance, without
from vobench.analysis.segment_loss import Outcome
from vobench.suite.case import Case

Error = Callable[[set[str]], float]
NAMES = ("mirrors", "gloss", "blur", "noise", "calibration", "moving things")
CIRCUMSTANCES = ("speed", "low frame rate")
SEEDS = Effort(screening=3, confirming=6)


def nuisances() -> list[Nuisance]:
    """Nuisances by name alone: what is removed is kept in the variant of the case."""
    removable = [Nuisance(name, "", lambda case: case) for name in NAMES]
    return removable + [Nuisance(name, "", lambda case: case, is_circumstance=True) for name in CIRCUMSTANCES]


def remove(case: Case, removed: Sequence[str]) -> Case:
    return replace(case, variant={"removed": ",".join(removed)})


def explained(
    hard: Case,
    error: Error,
    *,
    spread: float = 0.1,
    seed: int = 1,
    seeds: Effort = SEEDS,
    present: Sequence[Nuisance] | None = None,
    parts: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> Explanation:
    """The explanation where a case with these nuisances, and parts of them, left has that mean error."""
    chosen = nuisances() if present is None else present
    names = {nuisance.name for nuisance in chosen}.union(*parts.values())
    rng = np.random.default_rng(seed)

    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        return {name: [outcome(case)] for name, case in cases.items()}

    def outcome(case: Case) -> Outcome:
        of_seed = np.random.default_rng(case.seed).lognormal(0, 0.1)
        left = names - set(case.variant["removed"].split(","))
        mean = error(left)
        loss = mean * of_seed * rng.lognormal(0, spread) * rng.lognormal(0, 0.3, 24)
        return Outcome("lost" if mean > 0.5 else "ok", mean <= 0.5, np.minimum(loss, 1.0))

    return explain(hard, chosen, measure, seeds=seeds, remove=remove, parts=parts)


def test_the_one_cause_is_named_and_no_pair_is_tried(hard: Case) -> None:
    found = explained(hard, lambda left: 0.3 if "blur" in left else 0.02)
    assert (found.relation, found.named) == ("one", ("blur",))
    assert found.singles[0].low > 0.8
    assert not found.pairs
    assert not found.alone


PARTS = MappingProxyType({"blur": ("motion blur", "defocus"), "noise": ("shot noise", "read noise")})


def test_of_the_one_cause_each_part_is_removed_by_itself(hard: Case) -> None:
    def error(left: set[str]) -> float:
        return 0.4 if left >= {"blur", "defocus"} else 0.02

    found = explained(hard, error, parts=PARTS)
    assert found.named == ("blur",)
    assert [change.removed for change in found.parts] == [("defocus",), ("motion blur",)]
    defocus, motion_blur = found.parts
    assert defocus.is_sure
    assert defocus.reduction > 0.8
    assert abs(motion_blur.reduction) < 0.3
    assert found.trials <= SEEDS.most_trials(len(NAMES) + len(CIRCUMSTANCES), parts=2)


def test_parts_of_what_is_not_the_only_cause_are_left_in(hard: Case) -> None:
    assert explained(hard, lambda left: 0.4 if left & {"blur", "noise"} else 0.02, parts=PARTS).parts == ()
    assert explained(hard, lambda _: 0.3, parts=PARTS).parts == ()


def test_two_causes_of_which_each_alone_is_enough_are_named_together(hard: Case) -> None:
    found = explained(hard, lambda left: 0.4 if left & {"noise", "calibration"} else 0.02)
    assert found.relation == "together"
    assert set(found.named) == {"noise", "calibration"}
    assert min(found.alone["noise"], found.alone["calibration"]) > 4 * found.alone["blur"]


def test_two_causes_that_only_fail_together_are_named_as_alternatives(hard: Case) -> None:
    found = explained(hard, lambda left: 0.4 if left >= {"noise", "calibration"} else 0.02)
    assert found.relation == "either"
    assert {found.named, *found.alternatives} == {("noise",), ("calibration",)}


def test_two_causes_that_add_up_are_named_together(hard: Case) -> None:
    found = explained(hard, lambda left: 0.02 + 0.2 * len(left & {"gloss", "moving things"}))
    assert found.relation == "together"
    assert set(found.named) == {"gloss", "moving things"}


def test_a_cause_that_fixes_half_is_named_although_removing_all_harms(hard: Case) -> None:
    def error(left: set[str]) -> float:
        return 0.1 + 0.2 * ("blur" in left) + 0.3 * ("noise" not in left)

    found = explained(hard, error)
    assert found.named == ("blur",)
    assert [change.removed for change in found.harmful] == [("noise",)]
    assert found.everything is not None
    assert not found.everything.is_sure


def test_a_lesser_cause_is_a_contribution(hard: Case) -> None:
    found = explained(hard, lambda left: 0.02 + 0.24 * ("blur" in left) + 0.1 * ("noise" in left), spread=0.03)
    assert found.named == ("blur",)
    assert [change.removed for change in found.contributing] == [("noise",)]


def test_a_circumstance_is_named_and_is_not_among_all_nuisances(hard: Case) -> None:
    found = explained(hard, lambda left: 0.3 if "speed" in left else 0.05)
    assert found.named == ("speed",)
    assert found.everything is not None
    assert found.everything.removed == NAMES


def test_nothing_is_named_where_nothing_helps_and_it_is_said_what_was_ruled_out(hard: Case) -> None:
    found = explained(hard, lambda _: 0.3, spread=0.02)
    assert (found.relation, found.named) == ("none", ())
    assert len(found.ruled_out) >= 6
    assert all(change.high < 0.25 for change in found.ruled_out)


def test_of_two_nuisances_that_are_enough_by_themselves_both_are_named(hard: Case) -> None:
    found = explained(hard, lambda left: 0.4 if left else 0.02, present=nuisances()[:2])
    assert found.relation == "together"
    assert set(found.named) == set(NAMES[:2])


def test_without_nuisances_a_circumstance_is_judged_by_half_of_the_error(hard: Case) -> None:
    circumstances = nuisances()[-2:]
    found = explained(hard, lambda left: 0.3 if "speed" in left else 0.1, present=circumstances)
    assert found.everything is None
    assert found.named == ("speed",)
    assert explained(hard, lambda left: 0.3 if "speed" in left else 0.2, present=circumstances).named == ()


# --- Chance ---


def lost_by_chance(share: float, rng: np.random.Generator) -> np.ndarray:
    """The errors of a trial that loses track for good at some time, in a share of the trials."""
    loss = 0.02 * rng.lognormal(0, 0.3, 24)
    if rng.random() < share:
        loss[rng.integers(24) :] = 1.0
    return loss


def coin(share: float, rng: np.random.Generator) -> np.ndarray:
    return np.where(rng.random(24) < share, 0.4, 0.02)


@pytest.mark.parametrize(("draw", "share"), [(lost_by_chance, 0.3), (coin, 0.25)])
def test_failures_by_chance_have_no_cause_however_the_trial_was_picked(hard: Case, draw, share: float) -> None:
    rng = np.random.default_rng(0)

    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        return {name: [Outcome("ok", True, draw(share, rng))] for name in cases}

    random_effort = effort(3, is_deterministic=False)
    named = [explain(hard, nuisances(), measure, seeds=random_effort, remove=remove).named for _ in range(25)]
    assert sum(bool(names) for names in named) <= 2


def test_the_seed_of_the_failed_trial_is_not_run_and_confirming_seeds_are_new(hard: Case) -> None:
    ran: list[tuple[str, int]] = []

    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        ran.extend((case.variant["removed"], case.seed - hard.seed) for case in cases.values())
        outcomes = {}
        for name in cases:
            loss = np.full(24, 0.1 if "blur" in name else 0.5)
            outcomes[name] = [Outcome("ok", True, loss)]
        return outcomes

    found = explain(hard, nuisances(), measure, seeds=SEEDS, remove=remove)
    assert found.trials == len(ran)
    assert {number for _, number in ran} == set(range(1, 10))
    blur = [number for removed, number in ran if removed == "blur"]
    untried = [number for removed, number in ran if removed == "gloss"]
    assert blur == list(range(1, 10))
    assert untried == [1, 2, 3]
    # All variants of a seed are run before the next seed.
    first_seeds = [number for _, number in ran[: 3 * (len(NAMES) + len(CIRCUMSTANCES) + 2)]]
    assert first_seeds == sorted(first_seeds)


@pytest.mark.parametrize(
    ("repeats", "is_deterministic", "expected"),
    [(1, True, Effort(3, 6)), (3, True, Effort(3, 6)), (5, True, Effort(5, 10)), (3, False, Effort(6, 12))],
)
def test_a_random_estimator_is_run_with_twice_the_seeds(repeats, is_deterministic, expected) -> None:
    assert effort(repeats, is_deterministic=is_deterministic) == expected


def test_no_explanation_takes_more_trials_than_were_announced(hard: Case) -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        effects = dict(zip((*NAMES, *CIRCUMSTANCES), rng.uniform(-0.1, 0.2, 8), strict=True))
        found = explained(hard, lambda left, effects=effects: 0.2 + max(-0.15, sum(effects[name] for name in left)))
        assert SEEDS.screening_trials(8) <= found.trials <= SEEDS.most_trials(8)


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("share", [0.0, 1.0])
def test_of_one_or_two_nuisances_no_more_trials_are_run_than_were_announced(
    hard: Case, count: int, share: float
) -> None:
    """`share` is that of the nuisances' errors in the error."""
    few = nuisances()[:count]
    ran: list[str] = []

    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        ran.extend(cases)
        outcomes = {}
        for name, case in cases.items():
            removed = [name for name in case.variant["removed"].split(",") if name]
            left = count - len(removed)
            outcomes[name] = [Outcome("ok", True, np.full(24, 0.01 + share * 0.4 * left / count))]
        return outcomes

    explain(hard, few, measure, seeds=SEEDS, remove=remove)
    assert len(ran) <= SEEDS.most_trials(count)
    if share:
        assert len(ran) == SEEDS.most_trials(count)


def test_the_announced_screening_is_all_that_is_run_where_nothing_helps(hard: Case) -> None:
    assert explained(hard, lambda _: 0.3, spread=0.02).trials == SEEDS.screening_trials(len(nuisances()))


# --- Sentences about variants ---


@pytest.mark.parametrize(
    ("removed", "name"),
    [
        ((), "as_it_is"),
        (("late IMU",), "without_late_imu"),
        (("late IMU", "blur"), "with_auto_exposure_alone"),
        (("blur",), "without_blur"),
        (("late IMU", "blur", "auto-exposure"), "without_all"),
    ],
)
def test_variants_are_named_by_what_is_removed_or_left(removed, name) -> None:
    assert folder_name(removed, ("late IMU", "blur", "auto-exposure")) == name


def test_of_two_nuisances_variants_are_named_by_what_is_removed() -> None:
    assert folder_name(("blur",), ("blur", "noise")) == "without_blur"
    assert folder_name(("blur", "noise"), ("blur", "noise")) == "without_blur_and_noise"
    assert folder_name(("blur",), ("blur",)) == "without_blur"


# --- Decisions ---


def test_suspects_are_the_three_that_cost_most_as_the_only_one_removed_or_left() -> None:
    everything = change("all", reduction=0.8, loss=0.1)  # 0.5 before, so 0.4 to gain
    singles = [
        change(name, reduction=reduction) for name, reduction in zip("abcde", (0.4, 0.08, 0.0, 0.0, 0.24), strict=True)
    ]
    alone = {"a": 0.1, "b": 0.1, "c": 0.26, "d": 0.18, "e": 0.1}
    # As the only one removed: a 0.5, b 0.1, e 0.3; as the only one left: c 0.4, d 0.2.
    assert _suspects(singles, alone, everything) == {"a", "c", "e"}
    assert _suspects(singles, {**alone, "d": 0.24}, everything) == {"a", "c", "d"}
    nothing_left = change("all", reduction=1.0, loss=0.0)
    assert _suspects(singles, {**dict.fromkeys("abcde", 0.0), "d": 0.45, "b": 0.3}, nothing_left) == {"a", "d", "b"}


# --- Figures of a change ---


def outcomes(*losses: np.ndarray) -> list[Outcome]:
    return [Outcome("ok", True, np.asarray(loss, float)) for loss in losses]


def changed(before: Sequence[Outcome], after: Sequence[Outcome]) -> Change:
    return _change(("blur",), before, after, is_confirmed=True)


def test_the_same_errors_before_and_after_are_surely_no_change() -> None:
    rng = np.random.default_rng(0)
    before = outcomes(*rng.lognormal(-3, 1, (6, 24)))
    found = changed(before, before)
    assert (found.reduction, found.low, found.high) == pytest.approx((0, 0, 0))
    assert not found.is_sure
    half = outcomes(*(outcome.loss / 2 for outcome in before))
    found = changed(before, half)
    assert (found.reduction, found.low, found.high) == pytest.approx((0.5, 0.5, 0.5))
    assert found.loss == pytest.approx(np.mean([outcome.loss for outcome in half]))
    assert found.is_sure
    worse = changed(half, before)
    assert (worse.reduction, worse.low, worse.high) == pytest.approx((-1, -1, -1))
    assert worse.is_harmful


def test_survivors_and_repeats_are_counted() -> None:
    after = [replace(outcome, survived=nth < 2) for nth, outcome in enumerate(outcomes([0.1], [0.2], [0.3]))]
    found = changed(outcomes([0.5], [0.5], [0.5]), after)
    assert (found.survived, found.repeats) == (2, 3)
    assert found.reduction == pytest.approx(0.6)


def test_errors_of_nothing_are_no_division_by_zero() -> None:
    nothing = outcomes(np.zeros(24), np.zeros(24))
    assert changed(nothing, nothing).reduction == 1
    assert np.isfinite(changed(nothing, outcomes([0.1], [0.2])).low)


def test_where_nothing_is_random_the_interval_is_over_blocks_of_segments() -> None:
    rng = np.random.default_rng(0)
    before = 0.3 + 0.05 * np.repeat(rng.standard_normal(8), 3)
    after = 0.15 + 0.05 * np.repeat(rng.standard_normal(8), 3)
    found = changed(outcomes(*[before] * 6), outcomes(*[after] * 6))
    assert 0.01 < found.high - found.low < 0.4
    assert found.low < found.reduction < found.high
    assert found.is_sure
    same = changed(outcomes(*[before] * 6), outcomes(*[before[::-1]] * 6))
    assert same.low < 0 < same.high


def test_the_status_is_the_most_frequent_one_and_repeats_differ_if_one_does(hard: Case) -> None:
    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        made = {}
        for name in cases:
            is_last = name.endswith(".2")
            made[name] = [Outcome("ok" if is_last else "lost", is_last, np.full(24, 0.4 if is_last else 0.5))]
        return made

    found = explain(hard, nuisances()[:1], measure, seeds=SEEDS, remove=remove)
    assert found.status == "lost"
    assert found.repeats_differ
    assert found.loss == pytest.approx((0.5 + 0.4 + 0.5) / 3)


def test_repeats_differ_if_only_those_of_a_changed_case_do(hard: Case) -> None:
    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        made = {}
        for index, name in enumerate(cases):
            loss = 1.0 if name.startswith("as_it_is") else 0.1 + 0.01 * index
            made[name] = [Outcome("ok", True, np.full(24, loss))]
        return made

    assert explain(hard, nuisances()[:1], measure, seeds=SEEDS, remove=remove).repeats_differ


def test_each_variant_removes_what_its_name_says_from_the_case_itself(hard: Case) -> None:
    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        for name, case in cases.items():
            is_blurred = "blur" not in name and "all" not in name
            assert case.camera.motion_blur == is_blurred
        return {name: [Outcome("ok", True, np.full(24, 0.5))] for name in cases}

    explain(hard, nuisances()[2:4], measure, seeds=SEEDS, remove=without)
