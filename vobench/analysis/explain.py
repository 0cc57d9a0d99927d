"""Finds the nuisance that makes an estimator fail, by running the case again without each of them.

Variants are screened with some seeds, and what is selected is confirmed with others.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.nuisance import Nuisance, without
from vobench.analysis.paired_change import SURE_P, compare_pairs
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.suite.case import Case
from vobench.trajectory.trajectory import Trajectory

# --- The error of a trial ---

SEGMENTS = 24
MIN_STEPS = 2  # frames per segment
MIN_LENGTH_M = 1e-3  # the smallest length of a segment; the body is stationary on a shorter one


@dataclass(frozen=True, slots=True)
class Outcome:
    """The status of a trial, and its error (S,) in each of its segments."""

    status: str
    survived: bool
    loss: Array


def segment_loss(gt: Trajectory, est: Trajectory, *, scale: float = 1.0) -> Array:
    """The error (S,) of up to SEGMENTS parts of equal duration, as `loss_between` defines it."""
    count = max(1, min(SEGMENTS, (len(gt) - 1) // MIN_STEPS))
    borders_ns = np.linspace(gt.t_ns[0], gt.t_ns[-1], count + 1)
    after = np.searchsorted(gt.t_ns, borders_ns).clip(1, len(gt) - 1)
    since_before_ns = borders_ns - gt.t_ns[after - 1]
    until_after_ns = gt.t_ns[after] - borders_ns
    nearest = np.where(since_before_ns < until_after_ns, after - 1, after)
    return loss_between(gt, est, nearest, scale=scale)


def loss_between(
    gt: Trajectory,
    est: Trajectory,
    at: NDArray[np.intp],
    *,
    scale: float = 1.0,
) -> Array:
    """The error (S,) from each of the frames `at` (S + 1,) to the next, relative to the path length, 0 to 1.

    It is the position error at the end of the segment relative to its length, plus the rotation error in rad, which
    is what the rotation costs per metre of the path that follows. The error is 1 without a pose at both ends. `scale`
    multiplies the positions of the estimate.
    """
    lengths_m = np.diff(gt.distances_m()[at])
    lengths_m = np.maximum(lengths_m, max(float(lengths_m.mean()), MIN_LENGTH_M))
    loss = np.ones(len(at) - 1)
    if not len(est):
        return loss

    rows = np.searchsorted(est.t_ns, gt.t_ns[at]).clip(max=len(est) - 1)
    has_pose = est.t_ns[rows] == gt.t_ns[at]
    has_both_poses = np.flatnonzero(has_pose[:-1] & has_pose[1:])
    estimated_motion = _motions(est.T_world_frame[rows])
    estimated_motion[:, :3, 3] *= scale
    true_motion = _motions(gt.T_world_frame[at])

    error = se3.inverse(estimated_motion[has_both_poses]) @ true_motion[has_both_poses]
    position_error_m = np.linalg.norm(error[:, :3, 3], axis=1)
    rotation_error_rad = se3.rotation_angle(error[:, :3, :3])
    total_error = position_error_m / lengths_m[has_both_poses] + rotation_error_rad
    loss[has_both_poses] = np.minimum(total_error, 1.0)
    return loss


def _motions(T: Array) -> Array:
    """The motions (N - 1, 4, 4) between successive poses (N, 4, 4)."""
    motions: Array = se3.inverse(T[:-1]) @ T[1:]
    return motions


# --- The variants of a case ---

SUFFICIENT_SHARE = 2 / 3  # of what removing all nuisances achieves: one that achieves it explains the failure
HALF = 0.5  # a single change that surely reduces the error by this share is named in any case
PROMISING = 0.2  # the reduction from which a variant is confirmed with other seeds
MATERIAL = 0.1  # a smaller change of the error is no difference
RULED_OUT = 0.25  # a nuisance that surely costs less than this share of the error is ruled out
MIN_GAIN_OF_PAIR = 0.15  # by which a pair must be better than the best of its two alone
SUSPECTS = 3  # nuisances that are removed in pairs, and single changes that are confirmed
MIN_REPEATS = 3
RANDOM_FACTOR = 2  # so many times the repeats for an estimator that is not deterministic
CONFIRMING_FACTOR = 2  # times the repeats of the screening
MIN_CONFIRMING = 6  # repeats: fewer cannot be significant

Removal = tuple[str, ...]
Relation = Literal["one", "either", "together", "none"]


@dataclass(frozen=True, slots=True)
class Change:
    """The remaining error without some nuisances, and the share by which it decreased, with a 95 % interval.

    `survived` is the number of successful trials out of `repeats`. `p_less` and `p_more` are the p-values of the
    error having decreased and increased. `is_confirmed` states that its seeds are other than those that it was
    selected with.
    """

    removed: Removal
    loss: float
    mended: float
    low: float
    high: float
    survived: int
    repeats: int
    p_less: float
    p_more: float
    is_confirmed: bool

    @property
    def is_sure(self) -> bool:
        """Whether the error is significantly smaller without them."""
        return self.is_confirmed and self.p_less <= SURE_P and self.low > 0

    @property
    def is_harmful(self) -> bool:
        """Whether the error is significantly larger without them."""
        return self.is_confirmed and self.p_more <= SURE_P and self.mended <= -MATERIAL

    @property
    def is_ruled_out(self) -> bool:
        """Whether removing them cannot reduce the error by much."""
        return self.high < RULED_OUT


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a case is hard: what removing single nuisances, pairs and all of them changes.

    `singles` and `pairs` have the largest improvement first. `everything` is the removal of all nuisances; None if the
    case has none. `alone` is the error with only that nuisance left; it is measured if no single one explains the
    failure. `trials` is the number of trials that were run.
    """

    loss: float
    status: str
    repeats_differ: bool
    everything: Change | None
    singles: tuple[Change, ...]
    alone: Mapping[str, float]
    pairs: tuple[Change, ...]
    trials: int

    @property
    def sufficient(self) -> tuple[Change, ...]:
        """The single changes each of which explains the failure, the best first."""
        return tuple(change for change in self.singles if is_sufficient(change, self.everything))

    @property
    def relation(self) -> Relation:
        """How the named causes act: one alone, either of several, only both together, or none is named."""
        if self._best_pair is not None:
            return "together"
        if len(self.sufficient) > 1:
            return "either"
        return "one" if self._best_single is not None else "none"

    @property
    def named(self) -> Removal:
        """The nuisances that explain the failure: one, or two that act together; empty if none does."""
        if self._best_pair is not None:
            return self._best_pair.removed
        return self._best_single.removed if self._best_single is not None else ()

    @property
    def alternatives(self) -> tuple[Removal, ...]:
        """What could be removed instead of the named nuisance, with nearly the same result."""
        if self.relation != "either":
            return ()
        return tuple(change.removed for change in self.sufficient[1:])

    @property
    def contributing(self) -> tuple[Change, ...]:
        """The single changes that surely help, but are not named."""
        named = {self.named, *self.alternatives}
        in_pair = set(self.named) if self.relation == "together" else set()
        helping = []
        for change in self.singles:
            is_named = change.removed in named or bool(in_pair & set(change.removed))
            if change.is_sure and change.mended >= MATERIAL and not is_named:
                helping.append(change)
        return tuple(helping)

    @property
    def harmful(self) -> tuple[Change, ...]:
        """The single changes that surely make the error larger."""
        return tuple(change for change in self.singles if change.is_harmful)

    @property
    def ruled_out(self) -> tuple[Change, ...]:
        """The single changes that cannot reduce the error by much."""
        named = set(self.named).union(*self.alternatives)
        return tuple(change for change in self.singles if change.is_ruled_out and not named & set(change.removed))

    @property
    def _best_single(self) -> Change | None:
        """The best sufficient single change, or else the best one that surely halves the error."""
        if self.sufficient:
            return self.sufficient[0]
        halving = [change for change in self.singles if change.is_sure and change.mended >= HALF]
        return halving[0] if halving else None

    @property
    def _best_pair(self) -> Change | None:
        """The best pair if it explains the failure better than its best single nuisance does."""
        if not self.pairs or self.sufficient:
            return None
        pair = self.pairs[0]
        best_mended = 0.0
        for change in self.singles:
            if set(change.removed) < set(pair.removed):
                best_mended = max(best_mended, change.mended)
        gains = pair.mended >= best_mended + MIN_GAIN_OF_PAIR
        return pair if gains and _explains(pair, self.everything) else None


def is_sufficient(change: Change, everything: Change | None) -> bool:
    """Whether a change achieves most of what removing all nuisances does or, if that does not help, half."""
    if not change.is_sure:
        return False
    if everything is not None and everything.is_sure and everything.mended > 0:
        return change.mended >= max(SUFFICIENT_SHARE * everything.mended, MATERIAL)
    return change.mended >= HALF


def _explains(pair: Change, everything: Change | None) -> bool:
    """Whether a pair explains a failure: like a single change, or by half of the error."""
    return is_sufficient(pair, everything) or (pair.is_sure and pair.mended >= HALF)


# Runs cases by their names, and returns the outcomes of each.
Measure = Callable[[Mapping[str, Case]], Mapping[str, Sequence[Outcome]]]
Remove = Callable[[Case, Removal], Case]  # the case without some nuisances
Outcomes = dict[Removal, list[Outcome]]  # of repeats, by the removed nuisances


@dataclass(frozen=True, slots=True)
class Effort:
    """How many seeds each variant is run with, first in the screening and then to confirm what was selected."""

    screening: int
    confirming: int

    def screening_trials(self, nuisances: int) -> int:
        """The number of trials of the screening of some number of nuisances: as it is, each removed, and all."""
        return self.screening * (nuisances + 2)

    def most_trials(self, nuisances: int) -> int:
        """The largest number of trials: with each nuisance alone, pairs, and the confirmation of all that may be."""
        pairs = SUSPECTS * (SUSPECTS - 1) // 2
        confirmed = 2 + SUSPECTS + 2 + 1 + 1  # as it is, all, suspects, both of the best pair, the pair, the harmful
        return self.screening * (2 * nuisances + 2 + pairs) + self.confirming * confirmed


def effort(repeats: int, *, is_deterministic: bool) -> Effort:
    """The seeds for a number of repeats that is asked for, and for an estimator that is deterministic or not."""
    factor = 1 if is_deterministic else RANDOM_FACTOR
    screening = factor * max(repeats, MIN_REPEATS)
    return Effort(screening, max(CONFIRMING_FACTOR * screening, MIN_CONFIRMING))


def explain(
    case: Case,
    nuisances: Sequence[Nuisance],
    measure: Measure,
    *,
    seeds: Effort,
    remove: Remove = without,
) -> Explanation:
    """Run a case without each nuisance and without all, and run what seems to explain the failure with other seeds.

    The trial that failed is not among those that are compared, since it was chosen because it failed: all seeds are
    new. Nothing is concluded from the seeds by which a variant was selected. Each repeat has its own seed, which all
    variants share, and the variants of a repeat are run one after the other.

    If no single nuisance explains the failure, it is run with each alone and without pairs of them. Circumstances,
    such as speed, are changed one at a time.
    """
    removable = tuple(nuisance.name for nuisance in nuisances if not nuisance.is_circumstance)
    variants = _Variants(case, removable, measure, remove)
    singly = [(nuisance.name,) for nuisance in nuisances]
    all_removed = [removable] if removable else []

    screening = variants.run(list(dict.fromkeys([(), *singly, *all_removed])), range(1, seeds.screening + 1))
    trials = _count(screening)
    baseline = screening[()]
    screened = _changes(screening, is_confirmed=False)
    singles: dict[Removal, Change] = {removed: screened[removed] for removed in singly}
    everything = screened.get(removable)

    alone: dict[str, float] = {}
    pairs: dict[Removal, Change] = {}
    if everything is not None and len(removable) == 2:
        pairs = {removable: everything}
    if _needs_pairs(singles.values(), everything, removable):
        assert everything is not None
        only_left = variants.run(variants.with_only_one_left(), range(1, seeds.screening + 1))
        alone = variants.loss_of_the_one_left(only_left)
        suspects = _suspects([singles[(name,)] for name in removable], alone, everything)
        suspected_pairs = [pair for pair in combinations(removable, 2) if suspects.issuperset(pair)]
        of_pairs = variants.run(suspected_pairs, range(1, seeds.screening + 1))
        trials += _count(only_left) + _count(of_pairs)
        pairs = _changes({(): baseline, **of_pairs}, is_confirmed=False)

    selected = _selected(singles, pairs)
    if selected:
        wanted = dict.fromkeys([(), *all_removed, *selected])
        first = seeds.screening + 1
        confirming = variants.run(list(wanted), range(first, first + seeds.confirming))
        trials += _count(confirming)
        baseline = confirming[()]
        for removed, change in _changes(confirming, is_confirmed=True).items():
            if removed in singles:
                singles[removed] = change
            if removed in pairs:
                pairs[removed] = change
            if removed == removable:
                everything = change

    return Explanation(
        loss=_mean_loss(baseline),
        status=_most_frequent_status(baseline),
        repeats_differ=_differ(baseline),
        everything=everything,
        singles=_ranked(singles.values()),
        alone=alone,
        pairs=_ranked(pairs.values()),
        trials=trials,
    )


@dataclass(frozen=True, slots=True)
class _Variants:
    """Runs variants of a case from which some of its nuisances are removed."""

    case: Case
    names: Removal
    measure: Measure
    remove: Remove

    def run(self, removals: Sequence[Removal], seeds: Iterable[int]) -> Outcomes:
        """Run the case without each of these sets of nuisances, with each of the seeds, which count from the case's."""
        cases = {}
        for number in seeds:
            repeat = replace(self.case, seed=self.case.seed + number)
            for removed in removals:
                cases[self._name(removed, number)] = self.remove(repeat, removed)
        measured = self.measure(cases) if cases else {}

        outcomes = {}
        for removed in removals:
            outcomes[removed] = [measured[self._name(removed, number)][0] for number in seeds]
        return outcomes

    def with_only_one_left(self) -> list[Removal]:
        """For each nuisance, the removal of all others."""
        return [self._others(name) for name in self.names]

    def loss_of_the_one_left(self, outcomes: Outcomes) -> dict[str, float]:
        """The mean error with only one nuisance left, for each of them."""
        return {name: _mean_loss(outcomes[self._others(name)]) for name in self.names}

    def _others(self, name: str) -> Removal:
        return tuple(other for other in self.names if other != name)

    def _name(self, removed: Sequence[str], number: int) -> str:
        return f"{folder_name(removed, self.names)}.{number}"


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
    baseline = outcomes[()]
    changes = {}
    for removed, changed in outcomes.items():
        if removed:
            changes[removed] = _change(removed, baseline, changed, is_confirmed=is_confirmed)
    return changes


def _needs_pairs(singles: Iterable[Change], everything: Change | None, removable: Removal) -> bool:
    """Whether removing all nuisances seems to help, but no single one explains it."""
    if everything is None or len(removable) < 3 or everything.mended < PROMISING:
        return False
    best = max(change.mended for change in singles if change.removed[0] in removable)
    return best < SUFFICIENT_SHARE * everything.mended


def _selected(singles: Mapping[Removal, Change], pairs: Mapping[Removal, Change]) -> list[Removal]:
    """What is run again with other seeds: the promising changes, and the one that seems to harm most."""
    ranked = _ranked(singles.values())
    selected = [change.removed for change in ranked[:SUSPECTS] if change.mended >= PROMISING]
    if pairs:
        best = _ranked(pairs.values())[0]
        if best.mended >= PROMISING:
            first, second = best.removed
            selected += [best.removed, (first,), (second,)]
    worst = ranked[-1]
    if worst.mended <= -PROMISING:
        selected.append(worst.removed)
    return list(dict.fromkeys(selected))


def _suspects(
    singles: Sequence[Change],
    alone: Mapping[str, float],
    everything: Change,
) -> set[str]:
    """The nuisances that cost most, either as the only one removed or as the only one left."""
    total_mended = everything.mended or 1.0
    total_cost = 1.0
    if everything.mended < 1:
        loss_before = everything.loss / (1 - everything.mended)
        total_cost = loss_before - everything.loss

    costs = {}
    for change in singles:
        name = change.removed[0]
        cost_if_removed = change.mended / total_mended
        cost_if_left = (alone[name] - everything.loss) / max(total_cost, 1e-9)
        costs[name] = max(cost_if_removed, cost_if_left)
    return set(sorted(costs, key=costs.__getitem__, reverse=True)[:SUSPECTS])


def _ranked(changes: Iterable[Change]) -> tuple[Change, ...]:
    return tuple(sorted(changes, key=_improvement, reverse=True))


def _improvement(change: Change) -> float:
    return change.mended


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
        low, high = _interval_over_segments(baseline[0], changed[0])
    survived = sum(outcome.survived for outcome in changed)
    return Change(
        removed,
        loss=_mean_loss(changed),
        mended=pairs.reduction,
        low=low,
        high=high,
        survived=survived,
        repeats=len(changed),
        p_less=pairs.p_less,
        p_more=pairs.p_more,
        is_confirmed=is_confirmed,
    )


# --- Intervals where nothing is random ---

RESAMPLES = 2000
BLOCK_SEGMENTS = 3  # neighbouring segments are not independent, so blocks of them are resampled
INTERVAL_PERCENT = (2.5, 97.5)
MIN_MEAN_LOSS = 1e-12


def _interval_over_segments(before: Outcome, after: Outcome) -> tuple[float, float]:
    """The 95 % interval of the decrease of the error, by a bootstrap of blocks of segments."""
    blocks = -(-len(before.loss) // BLOCK_SEGMENTS)
    starts = np.random.default_rng(0).random((RESAMPLES, blocks))  # as shares of the trial
    loss_before = np.maximum(_block_means(before, starts), MIN_MEAN_LOSS)
    loss_after = np.maximum(_block_means(after, starts), MIN_MEAN_LOSS)
    low, high = np.percentile(1 - loss_after / loss_before, INTERVAL_PERCENT).tolist()
    return low, high


def _block_means(outcome: Outcome, starts: Array) -> Array:
    """Mean errors (R,) of a trial whose segments are put together from blocks that begin at these shares (R, B)."""
    segments = len(outcome.loss)
    first = (starts * segments).astype(int)
    blocks = first[..., None] + np.arange(BLOCK_SEGMENTS)  # (R, blocks, BLOCK_SEGMENTS), round the end to the start
    rows = blocks.reshape(len(starts), -1)[:, :segments] % segments
    means: Array = outcome.loss[rows].mean(1)
    return means
