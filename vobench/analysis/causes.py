"""What an estimator's error hangs on: a regression on the conditions of frames, and where each trial went wrong."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array

SEGMENT_FRAMES = 5
# Logarithms of smaller errors are those of this one: below it nothing is learned of causes.
LEAST_LOSS = 1e-4
COLLINEAR = 0.9
RIDGE = 0.02  # of the number of segments, on standardised conditions: as if a few segments more showed nothing
DRAWS = 400
LOW_HIGH = (2.5, 97.5)
USUAL = (5.0, 95.0)  # percentiles: from little of a condition to much
LEAP = 8.0  # times a trial's middle error between two frames: where it went wrong
FEWEST = 8  # segments that anything can be learned from


@dataclass(frozen=True, slots=True)
class Course:
    """One trial: its frames' conditions (N,) by name, and the error (N,) from the frame before; the first is 0."""

    case: str
    repeat: int
    conditions: Mapping[str, Array]
    loss: Array

    @property
    def first_divergence(self) -> int | None:
        """The first frame whose error leaps out of the trial's others, or that has no pose; None where none does."""
        leaps = np.flatnonzero(self.loss > np.clip(LEAP * np.median(self.loss[1:]), LEAST_LOSS, 0.5))
        return int(leaps[0]) if len(leaps) else None


@dataclass(frozen=True, slots=True)
class Cause:
    """Conditions that no segment tells apart, one or several, and by what the error is multiplied by much of them.

    The factor is between the 5th and the 95th percentile of all segments, with a 95 % interval over segments.
    """

    conditions: tuple[str, ...]
    factor: float
    low: float
    high: float

    @property
    def is_sure(self) -> bool:
        """Whether the interval leaves out that it makes no difference."""
        return self.low > 1 or self.high < 1


@dataclass(frozen=True, slots=True)
class Segment:
    """A few frames of a trial: their error, and what the conditions there multiply it by, the largest first."""

    case: str
    repeat: int
    first: int
    end: int
    loss: float
    factors: tuple[tuple[Cause, float], ...]


@dataclass(frozen=True, slots=True)
class Attribution:
    """An estimator's causes, the strongest first, and its segments, the worst first; of cases, the mean factors."""

    causes: tuple[Cause, ...]
    segments: tuple[Segment, ...]
    cases: Mapping[str, tuple[tuple[Cause, float], ...]]
    constant: tuple[str, ...]
    explained: float


def attribute(courses: Sequence[Course]) -> Attribution | None:
    """Regress the logarithm of the error on all conditions that vary; None where there is too little of either.

    Conditions that go together (|r| of COLLINEAR or more) count as one. Each trial's segments are drawn again for the
    intervals: they say what other frames would have changed, not other scenes.
    """
    parts = [(course, first) for course in courses for first in range(1, len(course.loss), SEGMENT_FRAMES)]
    if len(parts) < FEWEST:
        return None
    names = tuple(courses[0].conditions)
    means = [[c.conditions[name][f : f + SEGMENT_FRAMES].mean() for name in names] for c, f in parts]
    X = np.sqrt(np.array(means))
    loss = np.array([c.loss[f : f + SEGMENT_FRAMES].mean() for c, f in parts])
    varies = X.std(0) > 1e-6 * np.maximum(X.max(0), 1e-6)
    if not varies.any():
        return None
    groups, Z = _merged([name for name, is_one in zip(names, varies, strict=True) if is_one], X[:, varies])
    y = np.log(np.maximum(loss, LEAST_LOSS))
    beta = _slopes(Z, y)
    drawn = np.array([_slopes(Z[rows], y[rows]) for rows in _redrawn([c for c, _ in parts])])
    low, high = np.percentile(Z, USUAL, axis=0)
    reach = np.where(high > low, high - low, np.ptp(Z, axis=0))
    causes = [
        Cause(group, *np.exp([beta[k] * reach[k], *np.percentile(drawn[:, k] * reach[k], LOW_HIGH)]).tolist())
        for k, group in enumerate(groups)
    ]
    shares = (Z - np.median(Z, axis=0)) * beta
    residual = y - y.mean() - (Z - Z.mean(0)) @ beta
    segments = tuple(
        Segment(c.case, c.repeat, f, min(f + SEGMENT_FRAMES, len(c.loss)), float(loss[row]), _ordered(causes, share))
        for row, ((c, f), share) in enumerate(zip(parts, shares, strict=True))
    )
    of = np.array([c.case for c, _ in parts])
    return Attribution(
        causes=tuple(sorted(causes, key=lambda cause: abs(np.log(cause.factor)), reverse=True)),
        segments=tuple(sorted(segments, key=lambda segment: segment.loss, reverse=True)),
        cases={case: _ordered(causes, shares[of == case].mean(0)) for case in dict.fromkeys(of.tolist())},
        constant=tuple(name for name, is_one in zip(names, varies, strict=True) if not is_one),
        explained=float(1 - residual.var() / max(y.var(), 1e-12)),
    )


def _ordered(causes: Sequence[Cause], share: Array) -> tuple[tuple[Cause, float], ...]:
    """Each cause with its factor, the one that adds most to the error first."""
    return tuple((causes[k], float(np.exp(share[k]))) for k in np.argsort(-share))


def _merged(names: Sequence[str], X: Array) -> tuple[list[tuple[str, ...]], Array]:
    """Standardised conditions (M, K), those that go together as their mean, each turned as the first of its group."""
    Z = (X - X.mean(0)) / X.std(0)
    r = Z.T @ Z / len(Z)
    group = np.arange(len(names))
    for i, j in np.argwhere(np.triu(np.abs(r) >= COLLINEAR, 1)).tolist():
        group[group == group[j]] = group[i]
    firsts = sorted(set(group.tolist()), key=lambda g: int(np.flatnonzero(group == g)[0]))
    members = [np.flatnonzero(group == g) for g in firsts]
    columns = [(Z[:, these] * np.sign(r[these[0], these])).mean(1) for these in members]
    return [tuple(names[i] for i in these.tolist()) for these in members], np.stack(columns, 1)


def _slopes(Z: Array, y: Array) -> Array:
    """Ridge regression of y (M,) on Z (M, K)."""
    centred = Z - Z.mean(0)
    normal = centred.T @ centred + RIDGE * len(Z) * np.eye(Z.shape[1])
    return np.asarray(np.linalg.solve(normal, centred.T @ (y - y.mean())))


def _redrawn(owners: Sequence[Course]) -> list[NDArray[np.intp]]:
    """Rows drawn with replacement, each trial's among its own."""
    rng = np.random.default_rng(0)
    of = np.array([id(owner) for owner in owners])
    own = [np.flatnonzero(of == owner) for owner in dict.fromkeys(of.tolist())]
    return [np.concatenate([rng.choice(rows, len(rows)) for rows in own]) for _ in range(DRAWS)]
