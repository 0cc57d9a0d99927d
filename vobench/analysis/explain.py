"""Finds the nuisance that makes an estimator fail, by running the case again without each of them.

Variants are screened with some seeds, and what is selected is confirmed with others.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from types import MappingProxyType
from typing import Any, ClassVar, Generic, Protocol, TypeVar

import numpy as np

from vobench.analysis.explanation import SUFFICIENT_SHARE, Change, Explanation, Removal
from vobench.analysis.nuisance import Nuisance
from vobench.analysis.paired_change import compare_pairs
from vobench.analysis.segment_bootstrap import block_interval
from vobench.analysis.segment_loss import Outcome
from vobench.geometry.se3 import Array

PROMISING = 0.2  # the reduction from which a variant is confirmed with other seeds
SUSPECTS = 3  # nuisances that are removed in pairs, and single changes that are confirmed
FEWEST_IN_PAIRS = 3  # nuisances: two are a pair anyway, and are removed together as all of them
MIN_REPEATS = 3
RANDOM_FACTOR = 2  # so many times the repeats for an estimator that is not deterministic
CONFIRMING_FACTOR = 2  # times the repeats of the screening
MIN_CONFIRMING = 6  # repeats: fewer cannot be significant
MIN_COST = 1e-9  # of all nuisances together, by which the cost of one is divided

AS_IT_IS: Removal = ()  # nothing is removed


class Repeatable(Protocol):
    """What is explained, such as a case: a dataclass whose repeats differ in their seed."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def seed(self) -> int:
        """The seed of the first repeat."""


C = TypeVar("C", bound=Repeatable)

# Runs cases by their names, and returns the outcomes of each.
Measure = Callable[[Mapping[str, C]], Mapping[str, Sequence[Outcome]]]
Remove = Callable[[C, Removal], C]  # the case without some nuisances
Outcomes = dict[Removal, list[Outcome]]  # of repeats, by the removed nuisances


@dataclass(frozen=True, slots=True)
class Effort:
    """How many seeds each variant is run with, first in the screening and then to confirm what was selected."""

    screening: int
    confirming: int

    @property
    def screening_seeds(self) -> range:
        """The numbers of the seeds of the screening. Number 0 is the seed of the trial that failed."""
        return range(1, self.screening + 1)

    @property
    def confirming_seeds(self) -> range:
        """The numbers of the seeds that follow those of the screening."""
        first = self.screening + 1
        return range(first, first + self.confirming)

    def screening_trials(self, nuisances: int) -> int:
        """The number of trials of the screening of some number of nuisances: as it is, each removed, and all."""
        return self.screening * (nuisances + 2)

    def most_trials(self, nuisances: int, parts: int = 0) -> int:
        """The largest number of trials: with each nuisance alone, pairs, and the confirmation of all that may be.

        `parts` is the largest number of parts of a nuisance.
        """
        of_parts = self.confirming * parts
        if nuisances < FEWEST_IN_PAIRS:
            # Each set of them is a variant, and all variants may be confirmed.
            variants = int(2**nuisances)
            return (self.screening + self.confirming) * variants + of_parts

        each_alone = nuisances
        pairs = SUSPECTS * (SUSPECTS - 1) // 2
        further_screening = self.screening * (each_alone + pairs)

        as_it_is_and_without_all = 2
        best_pair_and_its_two = 3
        most_harmful = 1
        confirmed_variants = as_it_is_and_without_all + SUSPECTS + best_pair_and_its_two + most_harmful
        confirmation = self.confirming * confirmed_variants
        return self.screening_trials(nuisances) + further_screening + confirmation + of_parts


def effort(repeats: int, *, is_deterministic: bool) -> Effort:
    """The seeds for a number of repeats that is asked for, and for an estimator that is deterministic or not."""
    factor = 1 if is_deterministic else RANDOM_FACTOR
    screening = factor * max(repeats, MIN_REPEATS)
    return Effort(screening, max(CONFIRMING_FACTOR * screening, MIN_CONFIRMING))


def explain(
    case: C,
    nuisances: Sequence[Nuisance],
    measure: Measure[C],
    *,
    seeds: Effort,
    remove: Remove[C],
    parts: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> Explanation:
    """Run a case without each nuisance and without all, and run what seems to explain the failure with other seeds.

    The trial that failed is not among those that are compared, since it was chosen because it failed: all seeds are
    new. Nothing is concluded from the seeds by which a variant was selected. Each repeat has its own seed, which all
    variants share, and the variants of a repeat are run one after the other.

    If no single nuisance explains the failure, it is run with each alone and without pairs of them. Circumstances,
    such as speed, are changed one at a time. If a single cause consists of `parts`, by its name, each is removed by
    itself.
    """
    removable = tuple(nuisance.name for nuisance in nuisances if not nuisance.is_circumstance)
    variants = _Variants(case, removable, measure, remove)

    findings = _screen(variants, [nuisance.name for nuisance in nuisances], seeds)
    selected = _selected(findings)
    if selected:
        findings = _confirm(variants, findings, selected, seeds)

    explanation = Explanation(
        loss=_mean_loss(findings.baseline),
        status=_most_frequent_status(findings.baseline),
        repeats_differ=findings.repeats_differ,
        everything=findings.everything,
        singles=_ranked(findings.singles.values()),
        alone=findings.alone,
        pairs=_ranked(findings.pairs.values()),
        trials=findings.trials,
    )
    if explanation.relation != "one":
        return explanation
    (cause,) = explanation.named
    parts_of_cause = [(part,) for part in parts.get(cause, ())]
    if not parts_of_cause:
        return explanation
    outcomes = variants.run(parts_of_cause, seeds.confirming_seeds)
    changes = _changes({AS_IT_IS: findings.baseline, **outcomes}, is_confirmed=True)
    return replace(explanation, parts=_ranked(changes.values()), trials=findings.trials + _count(outcomes))


@dataclass(frozen=True, slots=True)
class _Findings:
    """What has been measured so far: the case as it is, and the changes by what is removed.

    `everything` is the removal of all that is removable; None if nothing is. `alone` is the error with only one
    nuisance left. `trials` is the number of trials that were run. `repeats_differ` is whether the errors of some
    repeats of the case, as it is or changed, differ.
    """

    baseline: list[Outcome]
    singles: dict[Removal, Change]
    everything: Change | None
    pairs: dict[Removal, Change]
    alone: dict[str, float]
    trials: int
    repeats_differ: bool


def _screen(variants: "_Variants[C]", names: Sequence[str], seeds: Effort) -> _Findings:
    """Run the case as it is, without each nuisance and without all; then without pairs if no single one explains it."""
    removable = variants.removable
    singly = [(name,) for name in names]
    outcomes = variants.run([AS_IT_IS, *singly, *variants.all_removed], seeds.screening_seeds)
    changes = _changes(outcomes, is_confirmed=False)
    findings = _Findings(
        baseline=outcomes[AS_IT_IS],
        singles={removed: changes[removed] for removed in singly},
        everything=changes.get(removable),
        pairs={},
        alone={},
        trials=_count(outcomes),
        repeats_differ=any(map(_differ, outcomes.values())),
    )

    everything = findings.everything
    if everything is None:
        return findings
    if len(removable) == 2:
        return replace(findings, pairs={removable: everything})
    if not _needs_pairs(findings.singles, everything, removable):
        return findings
    return _screen_pairs(variants, findings, everything, seeds)


def _screen_pairs(variants: "_Variants[C]", findings: _Findings, everything: Change, seeds: Effort) -> _Findings:
    """Run the case with each nuisance alone, and without the pairs of those that cost most."""
    removable = variants.removable
    only_left = variants.run(variants.with_only_one_left(), seeds.screening_seeds)
    alone = variants.loss_of_the_one_left(only_left)
    suspects = _suspects([findings.singles[(name,)] for name in removable], alone, everything)
    suspected_pairs = [pair for pair in combinations(removable, 2) if suspects.issuperset(pair)]
    without_pair = variants.run(suspected_pairs, seeds.screening_seeds)
    return replace(
        findings,
        pairs=_changes({AS_IT_IS: findings.baseline, **without_pair}, is_confirmed=False),
        alone=alone,
        trials=findings.trials + _count(only_left) + _count(without_pair),
    )


def _confirm(variants: "_Variants[C]", findings: _Findings, selected: Sequence[Removal], seeds: Effort) -> _Findings:
    """Run selected variants with new seeds. Their changes replace those of the screening, as does the baseline."""
    outcomes = variants.run([AS_IT_IS, *variants.all_removed, *selected], seeds.confirming_seeds)
    confirmed = _changes(outcomes, is_confirmed=True)
    return replace(
        findings,
        baseline=outcomes[AS_IT_IS],
        singles={removed: confirmed.get(removed, change) for removed, change in findings.singles.items()},
        everything=confirmed.get(variants.removable, findings.everything),
        pairs={removed: confirmed.get(removed, change) for removed, change in findings.pairs.items()},
        trials=findings.trials + _count(outcomes),
        repeats_differ=findings.repeats_differ or any(map(_differ, outcomes.values())),
    )


@dataclass(frozen=True, slots=True)
class _Variants(Generic[C]):
    """Runs variants of a case from which some of its nuisances are removed."""

    case: C
    removable: Removal
    measure: Measure[C]
    remove: Remove[C]

    @property
    def all_removed(self) -> list[Removal]:
        """The removal of all nuisances; none if there are only circumstances."""
        return [self.removable] if self.removable else []

    def run(self, removals: Sequence[Removal], seeds: Iterable[int]) -> Outcomes:
        """Run the case without each of these sets of nuisances, with each of the seeds, which count from the case's."""
        distinct = list(dict.fromkeys(removals))
        cases = {}
        for number in seeds:
            repeat = replace(self.case, seed=self.case.seed + number)
            for removed in distinct:
                cases[self._name(removed, number)] = self.remove(repeat, removed)
        measured = self.measure(cases) if cases else {}

        outcomes = {}
        for removed in distinct:
            outcomes[removed] = [measured[self._name(removed, number)][0] for number in seeds]
        return outcomes

    def with_only_one_left(self) -> list[Removal]:
        """For each nuisance, the removal of all others."""
        return [self._others(name) for name in self.removable]

    def loss_of_the_one_left(self, outcomes: Outcomes) -> dict[str, float]:
        """The mean error with only one nuisance left, for each of them."""
        return {name: _mean_loss(outcomes[self._others(name)]) for name in self.removable}

    def _others(self, name: str) -> Removal:
        return tuple(other for other in self.removable if other != name)

    def _name(self, removed: Sequence[str], number: int) -> str:
        return f"{folder_name(removed, self.removable)}.{number}"


def folder_name(removed: Sequence[str], names: Sequence[str]) -> str:
    """The case name of a variant: the removed nuisances or, if only one is left, the name of that one."""
    if not removed:
        return "as_it_is"
    left = [name for name in names if name not in removed]
    if len(names) > 2 and len(left) < 2:
        return f"with_{_word(left[0])}_alone" if left else "without_all"
    return "without_" + "_and_".join(map(_word, removed))


def _word(name: str) -> str:
    return name.lower().replace(" ", "_").replace("-", "_")


def _count(outcomes: Outcomes) -> int:
    """The number of trials."""
    return sum(len(repeats) for repeats in outcomes.values())


def _changes(outcomes: Outcomes, *, is_confirmed: bool) -> dict[Removal, Change]:
    """The change from the case as it is to each variant."""
    baseline = outcomes[AS_IT_IS]
    changes = {}
    for removed, changed in outcomes.items():
        if removed:
            changes[removed] = _change(removed, baseline, changed, is_confirmed=is_confirmed)
    return changes


def _needs_pairs(singles: Mapping[Removal, Change], everything: Change, removable: Removal) -> bool:
    """Whether removing all nuisances seems to help, but no single one explains it."""
    if len(removable) < FEWEST_IN_PAIRS or everything.reduction < PROMISING:
        return False
    best = max(singles[(name,)].reduction for name in removable)
    return best < SUFFICIENT_SHARE * everything.reduction


def _selected(findings: _Findings) -> list[Removal]:
    """What is run again with other seeds: the promising changes, and the one that seems to harm most."""
    ranked = _ranked(findings.singles.values())
    selected = [change.removed for change in ranked[:SUSPECTS] if change.reduction >= PROMISING]
    if findings.pairs:
        best = _ranked(findings.pairs.values())[0]
        if best.reduction >= PROMISING:
            first, second = best.removed
            selected += [best.removed, (first,), (second,)]
    worst = ranked[-1]
    if worst.reduction <= -PROMISING:
        selected.append(worst.removed)
    return selected


def _suspects(
    singles: Sequence[Change],
    alone: Mapping[str, float],
    everything: Change,
) -> set[str]:
    """The nuisances that cost most, either as the only one removed or as the only one left.

    Costs are relative to that of all nuisances together.
    """
    # If removing all changes nothing, or leaves no error, the costs are not relative to anything.
    total_reduction = everything.reduction if everything.reduction != 0 else 1.0
    total_cost = 1.0
    if everything.reduction < 1:
        loss_before = everything.loss / (1 - everything.reduction)
        total_cost = loss_before - everything.loss

    costs = {}
    for change in singles:
        name = change.removed[0]
        cost_if_removed = change.reduction / total_reduction
        cost_if_left = (alone[name] - everything.loss) / max(total_cost, MIN_COST)
        costs[name] = max(cost_if_removed, cost_if_left)
    largest_first = sorted(costs, key=costs.__getitem__, reverse=True)
    return set(largest_first[:SUSPECTS])


def _ranked(changes: Iterable[Change]) -> tuple[Change, ...]:
    return tuple(sorted(changes, key=_improvement, reverse=True))


def _improvement(change: Change) -> float:
    return change.reduction


def _differ(outcomes: Sequence[Outcome]) -> bool:
    """Whether the errors of some repeats differ from those of the first one."""
    first, *others = outcomes
    return any(not np.array_equal(first.loss, other.loss) for other in others)


def _mean_losses(outcomes: Sequence[Outcome]) -> Array:
    """The mean error (n,) of each repeat."""
    return np.array([outcome.loss.mean() for outcome in outcomes])


def _mean_loss(outcomes: Sequence[Outcome]) -> float:
    return float(_mean_losses(outcomes).mean())


def _most_frequent_status(outcomes: Sequence[Outcome]) -> str:
    statuses = [outcome.status for outcome in outcomes]
    return max(statuses, key=statuses.count)


def _change(
    removed: Removal,
    baseline: Sequence[Outcome],
    changed: Sequence[Outcome],
    *,
    is_confirmed: bool,
) -> Change:
    """The decrease of the error between repeats with the same seeds.

    If nothing is random, all repeats are alike, and the interval is over parts of the path instead.
    """
    pairs = compare_pairs(_mean_losses(baseline), _mean_losses(changed))
    low = pairs.low
    high = pairs.high
    if not (_differ(baseline) or _differ(changed)):
        low, high = block_interval(baseline[0].loss, changed[0].loss)
    survived = sum(outcome.survived for outcome in changed)
    return Change(
        removed,
        loss=_mean_loss(changed),
        reduction=pairs.reduction,
        low=low,
        high=high,
        survived=survived,
        repeats=len(changed),
        p_less=pairs.p_less,
        p_more=pairs.p_more,
        is_confirmed=is_confirmed,
    )
