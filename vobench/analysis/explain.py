"""Finds the nuisance that makes an estimator fail, by running the case again without each of them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.nuisance import Nuisance, without
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
SUSPECTS = 3  # nuisances that are removed in pairs
MIN_BLOCKS = 8  # blocks of segments in all repeats that a confidence interval takes
# If the interval leaves open whether a promising nuisance explains the failure, it gets this multiple of the repeats.
PROMISING_SHARE = 0.2
MORE_REPEATS = 3


@dataclass(frozen=True, slots=True)
class Change:
    """The remaining error without some nuisances, and the share by which it decreased, with a 95 % interval.

    `survived` is the number of successful trials out of `repeats`.
    """

    removed: tuple[str, ...]
    loss: float
    mended: float
    low: float
    high: float
    survived: int
    repeats: int

    @property
    def is_sure(self) -> bool:
        """Whether the error is significantly smaller without them."""
        return self.low > 0


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a case is hard: what removing single nuisances, pairs and all of them changes.

    `singles` and `pairs` have the largest improvement first. `alone` is the error with only that nuisance left; it
    is measured if no single nuisance explains the failure.
    """

    loss: float
    status: str
    repeats_differ: bool
    everything: Change
    singles: tuple[Change, ...]
    alone: Mapping[str, float]
    pairs: tuple[Change, ...]

    @property
    def named(self) -> tuple[str, ...]:
        """The nuisances that explain the failure: one or two; empty if none does."""
        if not self.everything.is_sure:
            return ()
        best = self.singles[0]
        has_sure_pair = bool(self.pairs) and self.pairs[0].is_sure
        if is_sufficient(best, self.everything) or not has_sure_pair:
            return best.removed if best.is_sure else ()
        return max(best, self.pairs[0], key=_improvement).removed


# Runs cases by their names, and returns the outcomes of each in the order of its repeats.
Measure = Callable[[Mapping[str, Case]], Mapping[str, Sequence[Outcome]]]
Outcomes = dict[tuple[str, ...], list[Outcome]]  # of repeats, by the removed nuisances


def explain(
    case: Case,
    nuisances: Sequence[Nuisance],
    measure: Measure,
    *,
    repeats: int = 3,
) -> Explanation:
    """Run a case without each nuisance and without all; if none explains the failure, with each alone and in pairs.

    Each repeat has its own seed, which all variants share. Short cases get more repeats, and so does the best single
    nuisance if the confidence intervals leave it open.
    """
    variants = _Variants(case, tuple(nuisance.name for nuisance in nuisances), measure)
    names = variants.names
    (first_outcome,) = variants.run([()], 1)[()]
    repeats = max(repeats, -(-MIN_BLOCKS // _block_count(first_outcome)))

    singly = [(name,) for name in names]
    removals = dict.fromkeys([(), *singly, names])  # a single nuisance is all nuisances, too
    outcomes = variants.run(list(removals), repeats)
    baseline = outcomes[()]
    everything = _change(names, baseline, outcomes[names])
    singles = _ranked(_change(removed, baseline, outcomes[removed]) for removed in singly)

    if _needs_more_repeats(singles[0], everything):
        best = singles[0].removed
        more = variants.run([(), best, names], repeats * MORE_REPEATS)
        everything = _change(names, more[()], more[names])
        singles = _ranked([_change(best, more[()], more[best]), *singles[1:]])

    alone: dict[str, float] = {}
    pairs: tuple[Change, ...] = ()
    is_explained = not everything.is_sure or is_sufficient(singles[0], everything)
    if len(names) > 2 and not is_explained:
        alone = variants.loss_with_only_one_left(repeats)
        suspects = _suspects(singles, alone, everything)
        suspected_pairs = [pair for pair in combinations(names, 2) if suspects.issuperset(pair)]
        outcomes_of_pairs = variants.run(suspected_pairs, repeats)
        pairs = _ranked(_change(pair, baseline, of_pair) for pair, of_pair in outcomes_of_pairs.items())

    return Explanation(
        loss=_mean_loss(baseline),
        status=_most_frequent_status(baseline),
        repeats_differ=_differ(baseline),
        everything=everything,
        singles=singles,
        alone=alone,
        pairs=pairs,
    )


@dataclass(frozen=True, slots=True)
class _Variants:
    """Runs variants of a case from which some of its nuisances are removed."""

    case: Case
    names: tuple[str, ...]
    measure: Measure

    def run(self, removals: Sequence[tuple[str, ...]], repeats: int) -> Outcomes:
        """Run the case without each of these sets of nuisances, under as many seeds."""
        cases = {}
        for removed in removals:
            variant = without(self.case, removed)
            for repeat in range(repeats):
                name = self._name(removed, repeat)
                cases[name] = replace(variant, seed=self.case.seed + repeat)
        measured = self.measure(cases)

        outcomes = {}
        for removed in removals:
            outcomes[removed] = [measured[self._name(removed, repeat)][0] for repeat in range(repeats)]
        return outcomes

    def loss_with_only_one_left(self, repeats: int) -> dict[str, float]:
        """The mean error with only one nuisance left, for each of them."""
        others = {}
        for name in self.names:
            others[name] = tuple(other for other in self.names if other != name)
        outcomes = self.run(list(others.values()), repeats)
        return {name: _mean_loss(outcomes[removed]) for name, removed in others.items()}

    def _name(self, removed: Sequence[str], repeat: int) -> str:
        return f"{folder_name(removed, self.names)}.{repeat}"


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


def is_sufficient(change: Change, everything: Change) -> bool:
    """Whether a change achieves most of what removing all nuisances does."""
    return change.is_sure and change.mended >= SUFFICIENT_SHARE * everything.mended


def _needs_more_repeats(best: Change, everything: Change) -> bool:
    """Whether the best single nuisance may well explain the failure, but not significantly yet."""
    is_sure = best.is_sure and everything.is_sure
    may_suffice = best.high >= SUFFICIENT_SHARE * everything.mended
    return not is_sure and best.mended >= PROMISING_SHARE and may_suffice


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


def _mean_loss(outcomes: Sequence[Outcome]) -> float:
    return float(np.mean([outcome.loss.mean() for outcome in outcomes]))


def _most_frequent_status(outcomes: Sequence[Outcome]) -> str:
    statuses = [outcome.status for outcome in outcomes]
    return max(statuses, key=statuses.count)


# --- Confidence intervals ---

RESAMPLES = 2000
BLOCK_SEGMENTS = 3  # neighbouring segments are not independent, so blocks of them are resampled
INTERVAL_PERCENT = (2.5, 97.5)
MIN_MEAN_LOSS = 1e-12


def _block_count(outcome: Outcome) -> int:
    return -(-len(outcome.loss) // BLOCK_SEGMENTS)


def _change(
    removed: tuple[str, ...],
    baseline: Sequence[Outcome],
    changed: Sequence[Outcome],
) -> Change:
    """The decrease of the error, with a bootstrap interval over repeats and blocks of segments of both variants."""
    # Equal generators draw the same repeats and blocks for both variants.
    loss_before = _resampled_means(baseline, np.random.default_rng(0))
    loss_after = _resampled_means(changed, np.random.default_rng(0))
    low, high = np.percentile(1 - loss_after / loss_before, INTERVAL_PERCENT).tolist()

    loss = _mean_loss(changed)
    mended = 1 - loss / max(_mean_loss(baseline), MIN_MEAN_LOSS)
    survived = sum(outcome.survived for outcome in changed)
    return Change(removed, loss, mended, low, high, survived, len(changed))


def _resampled_means(outcomes: Sequence[Outcome], rng: np.random.Generator) -> Array:
    """Mean errors (RESAMPLES,) of repeats, and of blocks of segments in them, drawn with replacement."""
    repeats = len(outcomes)
    chosen = rng.integers(repeats, size=(RESAMPLES, repeats))
    starts = rng.random((RESAMPLES, repeats, SEGMENTS // BLOCK_SEGMENTS + 1))  # of blocks, as shares of the trial

    sums = np.zeros(RESAMPLES)
    for slot in range(repeats):
        for repeat, outcome in enumerate(outcomes):
            samples = np.flatnonzero(chosen[:, slot] == repeat)
            sums[samples] += _block_means(outcome, starts[samples, slot])
    return np.maximum(sums / repeats, MIN_MEAN_LOSS)


def _block_means(outcome: Outcome, starts: Array) -> Array:
    """Mean errors (R,) of a trial whose segments are put together from blocks that begin at these shares (R, B)."""
    segments = len(outcome.loss)
    first = (starts[:, : _block_count(outcome)] * segments).astype(int)
    blocks = first[..., None] + np.arange(BLOCK_SEGMENTS)  # (R, blocks, BLOCK_SEGMENTS), round the end to the start
    rows = blocks.reshape(len(starts), -1)[:, :segments] % segments
    means: Array = outcome.loss[rows].mean(1)
    return means
