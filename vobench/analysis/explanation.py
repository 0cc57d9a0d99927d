"""Why a case is hard: what removing its nuisances changes, and which of them explain the failure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from vobench.analysis.paired_change import SURE_P

SUFFICIENT_SHARE = 2 / 3  # of what removing all nuisances achieves: one that achieves it explains the failure
HALF = 0.5  # a single change that surely reduces the error by this share is named in any case
MATERIAL = 0.1  # a smaller change of the error is no difference
RULED_OUT = 0.25  # a nuisance that surely costs less than this share of the error is ruled out
MIN_GAIN_OF_PAIR = 0.15  # by which a pair must be better than the best of its two alone

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
    reduction: float
    low: float
    high: float
    survived: int
    repeats: int
    p_less: float
    p_more: float
    is_confirmed: bool

    @property
    def loss_before(self) -> float | None:
        """The error of the same seeds with all nuisances; None if there is none left without these."""
        return self.loss / (1 - self.reduction) if self.reduction < 1 else None

    @property
    def is_sure(self) -> bool:
        """Whether the error is significantly smaller without them."""
        return self.is_confirmed and self.p_less <= SURE_P and self.low > 0

    @property
    def is_harmful(self) -> bool:
        """Whether the error is significantly larger without them."""
        return self.is_confirmed and self.p_more <= SURE_P and self.reduction <= -MATERIAL

    @property
    def is_ruled_out(self) -> bool:
        """Whether removing them cannot reduce the error by much."""
        return self.high < RULED_OUT


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why a case is hard: what removing single nuisances, pairs and all of them changes.

    `singles` and `pairs` have the largest improvement first. `everything` is the removal of all nuisances; None if the
    case has none. `alone` is the error with only that nuisance left; it is measured if no single one explains the
    failure. `parts` are the changes by the parts of a named nuisance, such as the brightness of unlike eyes, the best
    first; empty if it has none. `trials` is the number of trials that were run.
    """

    loss: float
    status: str
    repeats_differ: bool
    everything: Change | None
    singles: tuple[Change, ...]
    alone: Mapping[str, float]
    pairs: tuple[Change, ...]
    trials: int
    parts: tuple[Change, ...] = ()

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
            if change.is_sure and change.reduction >= MATERIAL and not is_named:
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
        halving = [change for change in self.singles if change.is_sure and change.reduction >= HALF]
        return halving[0] if halving else None

    @property
    def _best_pair(self) -> Change | None:
        """The best pair if it explains the failure better than its best single nuisance does."""
        if not self.pairs or self.sufficient:
            return None
        pair = self.pairs[0]
        best_reduction = 0.0
        for change in self.singles:
            if set(change.removed) < set(pair.removed):
                best_reduction = max(best_reduction, change.reduction)
        gains = pair.reduction >= best_reduction + MIN_GAIN_OF_PAIR
        return pair if gains and _explains(pair, self.everything) else None


def is_sufficient(change: Change, everything: Change | None) -> bool:
    """Whether a change achieves most of what removing all nuisances does or, if that does not help, half."""
    if not change.is_sure:
        return False
    if everything is not None and everything.is_sure and everything.reduction > 0:
        return change.reduction >= max(SUFFICIENT_SHARE * everything.reduction, MATERIAL)
    return change.reduction >= HALF


def _explains(pair: Change, everything: Change | None) -> bool:
    """Whether a pair explains a failure: like a single change, or by half of the error."""
    return is_sufficient(pair, everything) or (pair.is_sure and pair.reduction >= HALF)
