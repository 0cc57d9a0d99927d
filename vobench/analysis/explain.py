"""Which nuisance makes an estimator fail: the case again without each, and how much of the error goes with it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from vobench.analysis.nuisance import Nuisance, without
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.suite.suite import Case
from vobench.trajectory.trajectory import Trajectory

SEGMENTS = 24
FEWEST_STEPS = 2
LEAST_M = 1e-3  # of way, for what stands still
# A nuisance mends a case alone where as much of what all of them cost together goes with it.
MENDS = 2 / 3
TRIED_IN_PAIRS = 3
# Fewer blocks of segments than these, in all repeats, draw no interval that could be believed.
FEWEST_BLOCKS = 8
# Where chance leaves open whether so much of the error goes, the best one is tried under so many times the seeds.
WORTH_SEEDS = 0.2
MORE_SEEDS = 3
DRAWS = 2000
BLOCK = 3
LOW_HIGH = (2.5, 97.5)


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a trial ended, and its error (S,) in each of its segments."""

    status: str
    survived: bool
    loss: Array


def segment_loss(gt: Trajectory, est: Trajectory, *, scale: float = 1.0) -> Array:
    """The error (S,) of up to SEGMENTS parts that are equally long in time, as `loss_between`."""
    count = max(1, min(SEGMENTS, (len(gt) - 1) // FEWEST_STEPS))
    borders_ns = np.linspace(gt.t_ns[0], gt.t_ns[-1], count + 1)
    after = np.searchsorted(gt.t_ns, borders_ns).clip(1, len(gt) - 1)
    is_before = borders_ns - gt.t_ns[after - 1] < gt.t_ns[after] - borders_ns
    return loss_between(gt, est, np.where(is_before, after - 1, after), scale=scale)


def loss_between(gt: Trajectory, est: Trajectory, at: NDArray[np.intp], *, scale: float = 1.0) -> Array:
    """The error (S,) from each of some frames (S + 1,) to the next, as a share of the way: 0 is perfect, 1 the most.

    What the end is off, seen from the start, over the way's length, and the radians that it is turned wrongly by: what
    they cost of every metre that follows. Without a pose at both ends it is 1. `scale` is put on the estimate.
    """
    lengths_m = np.diff(gt.distances_m()[at])
    lengths_m = np.maximum(lengths_m, max(float(lengths_m.mean()), LEAST_M))
    place = np.searchsorted(est.t_ns, gt.t_ns[at]).clip(max=max(len(est) - 1, 0))
    loss = np.ones(len(at) - 1)
    if not len(est):
        return loss
    known = est.t_ns[place] == gt.t_ns[at]
    both = np.flatnonzero(known[:-1] & known[1:])
    moved, true = (
        se3.inverse(T[index[:-1]]) @ T[index[1:]] for T, index in ((est.T_world_frame, place), (gt.T_world_frame, at))
    )
    moved[:, :3, 3] *= scale
    wrong = se3.inverse(moved[both]) @ true[both]
    off = np.linalg.norm(wrong[:, :3, 3], axis=1) / lengths_m[both] + se3.rotation_angle(wrong[:, :3, :3])
    loss[both] = np.minimum(off, 1.0)
    return loss


@dataclass(frozen=True, slots=True)
class Change:
    """What is left of the error without these nuisances, and how much of it went, with a 95 % interval.

    `survived` of `repeats` trials ended well.
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
        """Whether less error without them is more than chance."""
        return self.low > 0


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a case is hard: `singles` and `pairs` with the most mended first, `everything` is all removed at once.

    `alone` is the error where all but that nuisance is removed; it is measured where no single one mends the case.
    `named` mend it, surely; none where nothing of ours does.
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
        """The nuisances that explain the failure, fewest first."""
        if not self.everything.is_sure:
            return ()
        best, *_ = self.singles
        if mends(best, self.everything) or not (self.pairs and self.pairs[0].is_sure):
            return best.removed if best.is_sure else ()
        return max(best, self.pairs[0], key=lambda change: change.mended).removed


# Makes every trial of the cases by their names: their outcomes, in order of repeats.
Measure = Callable[[Mapping[str, Case]], Mapping[str, Sequence[Outcome]]]


def explain(case: Case, nuisances: Sequence[Nuisance], measure: Measure, *, repeats: int = 3) -> Explanation:
    """Try a case without each nuisance and without all; where none mends it alone, with each alone and in pairs.

    A repeat is the case under another seed, the same for all variants. A short case is given more of them, and the
    best single one where they leave it open.
    """
    names = [nuisance.name for nuisance in nuisances]

    def tried(sets: Sequence[tuple[str, ...]], repeats: int) -> dict[tuple[str, ...], list[Outcome]]:
        cases = {
            f"{folder_name(removed, names)}.{nth}": replace(without(case, removed), seed=case.seed + nth)
            for removed in sets
            for nth in range(repeats)
        }
        found = measure(cases)
        return {
            removed: [found[f"{folder_name(removed, names)}.{nth}"][0] for nth in range(repeats)] for removed in sets
        }

    whole = tuple(names)
    (once,) = tried([()], 1)[()]
    repeats = max(repeats, -(-FEWEST_BLOCKS // _blocks(once)))
    first = tried([(), *((name,) for name in names), *([whole] if len(names) > 1 else [])], repeats)
    base = first[()]
    everything = _change(whole, base, first[whole])
    singles = _ranked(_change((name,), base, first[name,]) for name in names)
    if _is_open(singles[0], everything):
        best = singles[0].removed
        again = tried([(), best, whole], repeats * MORE_SEEDS)
        everything = _change(whole, again[()], again[whole])
        singles = _ranked([_change(best, again[()], again[best]), *singles[1:]])
    alone = dict[str, float]()
    pairs = tuple[Change, ...]()
    if len(names) > 2 and everything.is_sure and not mends(singles[0], everything):
        rests = {name: tuple(other for other in names if other != name) for name in names}
        alone = {
            name: _mean(outcomes)
            for name, outcomes in zip(names, tried([*rests.values()], repeats).values(), strict=True)
        }
        chosen = _suspects(singles, alone, everything)
        found = tried([pair for pair in combinations(names, 2) if set(pair) <= chosen], repeats)
        pairs = _ranked(_change(pair, base, outcomes) for pair, outcomes in found.items())
    differ = any(not np.array_equal(base[0].loss, other.loss) for other in base[1:])
    return Explanation(_mean(base), _status(base), differ, everything, singles, alone, pairs)


def folder_name(removed: Sequence[str], names: Sequence[str]) -> str:
    """A variant as cases are called, by what is removed or, where that is most, by what is left."""
    left = [name for name in names if name not in removed]
    if removed and len(left) < 2 < len(names):
        return f"with_{_word(left[0])}_alone" if left else "without_all"
    return "without_" + "_and_".join(map(_word, removed)) if removed else "as_it_is"


def _word(name: str) -> str:
    return name.lower().replace(" ", "_").replace("-", "_")


def mends(change: Change, everything: Change) -> bool:
    """Whether a change does most of what removing everything does."""
    return change.is_sure and change.mended >= MENDS * everything.mended


def _is_open(best: Change, everything: Change) -> bool:
    """Whether a single one may well mend the case, but not surely."""
    is_sure = best.is_sure and everything.is_sure
    return not is_sure and best.mended >= WORTH_SEEDS and best.high >= MENDS * everything.mended


def _suspects(singles: Sequence[Change], alone: Mapping[str, float], everything: Change) -> set[str]:
    """Those that cost most, be it as the only one removed or as the only one left."""
    total = everything.mended or 1.0
    left = everything.loss / (1 - everything.mended) - everything.loss if everything.mended < 1 else 1.0
    cost = {
        change.removed[0]: max(change.mended / total, (alone[change.removed[0]] - everything.loss) / max(left, 1e-9))
        for change in singles
    }
    return set(sorted(cost, key=cost.__getitem__, reverse=True)[:TRIED_IN_PAIRS])


def _ranked(changes: Iterable[Change]) -> tuple[Change, ...]:
    return tuple(sorted(changes, key=lambda change: change.mended, reverse=True))


def _mean(outcomes: Sequence[Outcome]) -> float:
    return float(np.mean([outcome.loss.mean() for outcome in outcomes]))


def _status(outcomes: Sequence[Outcome]) -> str:
    statuses = [outcome.status for outcome in outcomes]
    return max(statuses, key=statuses.count)


def _blocks(outcome: Outcome) -> int:
    return -(-len(outcome.loss) // BLOCK)


def _change(removed: tuple[str, ...], base: Sequence[Outcome], changed: Sequence[Outcome]) -> Change:
    """How much of the error went: repeats and blocks of segments are drawn again, in pairs of before and after."""
    before, after = (_means(outcomes, np.random.default_rng(0)) for outcomes in (base, changed))
    low, high = np.percentile(1 - after / before, LOW_HIGH).tolist()
    loss = _mean(changed)
    survived = sum(outcome.survived for outcome in changed)
    return Change(removed, loss, 1 - loss / max(_mean(base), 1e-12), low, high, survived, len(changed))


def _means(outcomes: Sequence[Outcome], rng: np.random.Generator) -> Array:
    """Mean errors (DRAWS,) of repeats and blocks of segments drawn with replacement; the same draws for equal rng."""
    sums = np.zeros(DRAWS)
    chosen = rng.integers(len(outcomes), size=(DRAWS, len(outcomes)))
    places = rng.random((DRAWS, len(outcomes), SEGMENTS // BLOCK + 1))
    for nth in range(len(outcomes)):
        for draw_of, outcome in enumerate(outcomes):
            these = np.flatnonzero(chosen[:, nth] == draw_of)
            count = len(outcome.loss)
            starts = (places[these, nth, : _blocks(outcome)] * count).astype(int)
            index = (starts[..., None] + np.arange(BLOCK)).reshape(len(these), -1)[:, :count] % count
            sums[these] += outcome.loss[index].mean(1)
    return np.maximum(sums / len(outcomes), 1e-12)
