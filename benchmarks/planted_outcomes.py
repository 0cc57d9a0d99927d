"""How often `explain` is right, on weaknesses that are drawn by seed and whose effect is known, without pictures.

    python benchmarks/planted_outcomes.py [--draws 600] [--seed 1]

An estimator with a planted weakness fails in some segments of the path as long as certain nuisances are left, or by
chance, or always. The errors of every variant of a case are drawn from that, with noise of seeds and of variants, so
that the true cause and the true reduction of each variant are known. Half of the draws, of another seed, are held out:
the rules were made with the other half.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from vobench.analysis.explain import effort, explain
from vobench.analysis.explanation import Change, Explanation, Removal
from vobench.analysis.nuisance import Nuisance
from vobench.analysis.segment_loss import Outcome
from vobench.geometry.se3 import Array
from vobench.suite.case import Case
from vobench.suite.suite import read_plan

NAMES = ("mirrors", "gloss", "shadows", "moving things", "low light", "blur", "noise", "calibration", "JPEG")
CIRCUMSTANCES = ("speed", "fast turns", "short baseline")
SEGMENTS = 24
TRUTH_DRAWS = 400  # trials of each variant from which its true mean error is computed

Kind = Literal[
    "one",
    "one, some chance",
    "one, lost by chance",
    "one, a removal harms",
    "circumstance",
    "either of two",
    "two together",
    "none",
    "clock",
    "after N frames",
    "coin",
    "rare",
    "bursts",
    "lost by chance",
]
NAMEABLE_SHARE = 0.5  # of the error, that the causes must be
UNNAMEABLE: tuple[Kind, ...] = ("none", "clock", "after N frames", "coin", "rare", "bursts", "lost by chance")
NAMEABLE: tuple[Kind, ...] = tuple(kind for kind in get_args(Kind) if kind not in UNNAMEABLE)
RANDOM: tuple[Kind, ...] = ("one, some chance", "one, lost by chance", "coin", "rare", "bursts", "lost by chance")


@dataclass(frozen=True, slots=True)
class Weakness:
    """A planted weakness.

    fails_in (SEGMENTS,) are the segments in which the estimator fails while the `causes` are left: any of them, or all
    of them if `needs_all`. fault is the error of such a segment, and usual that of any other. The removal of `harmful`
    adds `harm` to all segments. chance is the rate of failures by chance of its kind. noise is the standard deviation
    of the logarithm of the error from one trial to another.
    """

    kind: Kind
    causes: tuple[str, ...]
    needs_all: bool
    fails_in: NDArray[np.bool_]
    fault: float
    usual: float
    harmful: str
    harm: float
    chance: float
    noise: float

    @property
    def is_deterministic(self) -> bool:
        """What the manifest of the estimator says."""
        return self.kind not in RANDOM

    def losses(self, left: set[str], seed: int, rng: Generator) -> Array:
        """The errors (SEGMENTS,) of a trial with these nuisances left."""
        of_seed = np.random.default_rng(seed).lognormal(0, self.noise)
        loss = self.usual * rng.lognormal(0, 0.3, SEGMENTS)
        if self._is_triggered(left):
            loss = np.where(self.fails_in, self.fault * rng.lognormal(0, 0.2, SEGMENTS), loss)
        if self.harmful and self.harmful not in left:
            loss = loss + self.harm
        loss = loss * of_seed * rng.lognormal(0, self.noise)
        fails_by_chance = self._chance_failures(rng)
        loss = np.where(fails_by_chance, np.maximum(loss, self.fault), loss)
        return np.minimum(loss, 1.0)

    def _is_triggered(self, left: set[str]) -> bool:
        if not self.causes:
            return bool(self.fails_in.any())
        causes_left = left & set(self.causes)
        return len(causes_left) == len(self.causes) if self.needs_all else bool(causes_left)

    def _chance_failures(self, rng: Generator) -> NDArray[np.bool_]:
        """The segments (SEGMENTS,) that fail by chance."""
        fails = np.zeros(SEGMENTS, bool)
        if self.chance == 0:
            return fails
        if self.kind in ("lost by chance", "one, lost by chance"):
            if rng.random() < self.chance:
                fails[rng.integers(SEGMENTS) :] = True
            return fails
        fails = rng.random(SEGMENTS) < self.chance
        if self.kind == "bursts":
            for segment in np.flatnonzero(fails):
                fails[segment : segment + 6] = True
        return fails


def draw_weakness(kind: Kind, rng: Generator) -> Weakness:
    """A weakness of a kind, with random causes, strength and place on the path."""
    names = rng.permutation(NAMES)
    causes: tuple[str, ...] = ()
    if kind in ("one", "one, some chance", "one, lost by chance", "one, a removal harms"):
        causes = (str(names[0]),)
    elif kind == "circumstance":
        causes = (str(rng.choice(CIRCUMSTANCES)),)
    elif kind in ("either of two", "two together"):
        causes = (str(names[0]), str(names[1]))

    fails_in = rng.random(SEGMENTS) < rng.uniform(0.3, 0.9)
    position = np.arange(SEGMENTS) / SEGMENTS
    if kind == "clock":
        start = rng.uniform(0, 0.7)
        fails_in = (position >= start) & (position < start + 0.3)
    elif kind == "after N frames":
        fails_in = position > rng.uniform(0.3, 0.8)
    elif kind in ("coin", "rare", "bursts", "lost by chance"):
        fails_in = np.zeros(SEGMENTS, bool)
    elif not fails_in.any():
        fails_in[0] = True

    chances = {
        "one, some chance": 0.05,
        "one, lost by chance": 0.1,
        "coin": 0.25,
        "rare": 0.03,
        "bursts": 0.05,
        "lost by chance": 0.3,
    }
    return Weakness(
        kind=kind,
        causes=causes,
        needs_all=kind == "either of two",
        fails_in=fails_in,
        fault=rng.uniform(0.04, 0.5),
        usual=rng.uniform(0.005, 0.02),
        harmful=str(names[2]) if kind == "one, a removal harms" else "",
        harm=rng.uniform(0.05, 0.3),
        chance=chances.get(kind, 0.0),
        noise=rng.uniform(0.02, 0.3),
    )


def nuisances() -> list[Nuisance]:
    """The nuisances of all cases, by name alone."""
    removable = [Nuisance(name, "", lambda case: case) for name in NAMES]
    return removable + [Nuisance(name, "", lambda case: case, is_circumstance=True) for name in CIRCUMSTANCES]


def mark_removed(case: Case, removed: Removal) -> Case:
    """A case that says what was removed from it."""
    return replace(case, variant={"removed": ",".join(removed)})


def explain_weakness(weakness: Weakness, case: Case, rng: Generator) -> Explanation:
    """What `explain` says of an estimator with a weakness."""

    def measure(cases: Mapping[str, Case]) -> dict[str, list[Outcome]]:
        outcomes = {}
        for name, variant in cases.items():
            left = everything_but(variant.variant["removed"].split(","))
            loss = weakness.losses(left, variant.seed, rng)
            outcomes[name] = [Outcome("ok", True, loss)]
        return outcomes

    seeds = effort(3, is_deterministic=weakness.is_deterministic)
    return explain(case, nuisances(), measure, seeds=seeds, remove=mark_removed)


def everything_but(removed: Sequence[str]) -> set[str]:
    """What is left of all nuisances and circumstances."""
    return {*NAMES, *CIRCUMSTANCES} - set(removed)


def true_reduction(weakness: Weakness, removed: Removal, rng: Generator) -> float:
    """The true share by which the mean error is reduced without some nuisances."""
    if not {*weakness.causes, weakness.harmful} & set(removed):
        return 0.0  # what has no effect on the estimator reduces nothing
    before = _true_loss(weakness, everything_but(()), rng)
    after = _true_loss(weakness, everything_but(removed), rng)
    return 1 - after / before


def _true_loss(weakness: Weakness, left: set[str], rng: Generator) -> float:
    seeds = rng.integers(2**31, size=TRUTH_DRAWS)
    return float(np.mean([weakness.losses(left, int(seed), rng).mean() for seed in seeds]))


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was said of a weakness, and whether that is right.

    A weakness is nameable if its causes are half of the error or more. `covered` are, for each variant, whether it was
    confirmed, and whether its interval covers the truth.
    """

    kind: Kind
    is_nameable: bool
    is_named: bool
    is_right: bool
    is_relation_right: bool
    trials: int
    covered: tuple[tuple[bool, bool], ...]


def judge(weakness: Weakness, found: Explanation, truths: Mapping[Removal, float]) -> Verdict:
    """Compare an explanation with the truth."""
    named = set(found.named).union(*found.alternatives)
    relation = {"either of two": "either", "two together": "together"}.get(weakness.kind, "one")
    if not weakness.causes:
        relation = "none"
    is_relation_right = found.relation == relation
    if weakness.harmful:
        is_relation_right = is_relation_right and [change.removed for change in found.harmful] == [(weakness.harmful,)]
    covered = []
    for change in _changes(found):
        is_covered = change.low <= truths[change.removed] <= change.high
        covered.append((change.is_confirmed, is_covered))
    return Verdict(
        weakness.kind,
        is_nameable=bool(weakness.causes) and truths[weakness.causes] >= NAMEABLE_SHARE,
        is_named=bool(named),
        is_right=named == set(weakness.causes),
        is_relation_right=is_relation_right,
        trials=found.trials,
        covered=tuple(covered),
    )


def _changes(found: Explanation) -> list[Change]:
    everything = [] if found.everything is None else [found.everything]
    return [*found.singles, *found.pairs, *everything]


def draw_verdicts(draws: int, seed: int) -> Iterator[Verdict]:
    """Verdicts on weaknesses of all kinds in turn."""
    (case, *_) = read_plan("quickstart").simulated
    kinds = (*NAMEABLE, *UNNAMEABLE)
    for number in range(draws):
        rng = np.random.default_rng([seed, number])
        weakness = draw_weakness(kinds[number % len(kinds)], rng)
        found = explain_weakness(weakness, replace(case, seed=1000 * number), rng)
        removals = {change.removed for change in _changes(found)} | {weakness.causes}
        truths = {removed: true_reduction(weakness, removed, rng) for removed in removals}
        yield judge(weakness, found, truths)


@dataclass(frozen=True, slots=True)
class Summary:
    """The rates of a number of verdicts."""

    precision: float
    recall: float
    abstention: float
    confirmed_coverage: float
    screened_coverage: float
    mean_trials: float


def summarize(verdicts: Sequence[Verdict]) -> Summary:
    """Precision and recall of names, abstention where nothing can be named, and coverage of the intervals."""
    named = [verdict for verdict in verdicts if verdict.is_named]
    nameable = [verdict for verdict in verdicts if verdict.is_nameable]
    others = [verdict for verdict in verdicts if verdict.kind not in NAMEABLE]
    covered = [each for verdict in verdicts for each in verdict.covered]
    return Summary(
        precision=_mean([verdict.is_right for verdict in named]),
        recall=_mean([verdict.is_right for verdict in nameable]),
        abstention=_mean([not verdict.is_named for verdict in others]),
        confirmed_coverage=_mean([is_covered for is_confirmed, is_covered in covered if is_confirmed]),
        screened_coverage=_mean([is_covered for is_confirmed, is_covered in covered if not is_confirmed]),
        mean_trials=_mean([verdict.trials for verdict in verdicts]),
    )


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def main() -> None:
    """Print the rates of both halves, and each kind's."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    for title, seed in (("made with", arguments.seed), ("held out", arguments.seed + 1)):
        verdicts = list(draw_verdicts(arguments.draws // 2, seed))
        summary = summarize(verdicts)
        print(
            f"{title}: {len(verdicts)} weaknesses, precision {summary.precision:.3f}, recall {summary.recall:.3f}, "
            f"abstention {summary.abstention:.3f}, intervals cover {summary.confirmed_coverage:.3f} (confirmed) and "
            f"{summary.screened_coverage:.3f} (screened), {summary.mean_trials:.0f} trials"
        )
        for kind in (*NAMEABLE, *UNNAMEABLE):
            chosen = [verdict for verdict in verdicts if verdict.kind == kind]
            if kind in NAMEABLE:
                chosen = [verdict for verdict in chosen if verdict.is_nameable]
            right = sum(verdict.is_right for verdict in chosen)
            relation_right = sum(verdict.is_relation_right for verdict in chosen)
            covered = _mean([is_covered for verdict in chosen for is_confirmed, is_covered in verdict.covered])
            print(
                f"  {kind:22} {right:3} of {len(chosen):3} right, relation {relation_right:3}, "
                f"intervals {covered:.3f}, {_mean([verdict.trials for verdict in chosen]):.0f} trials",
                flush=True,
            )


if __name__ == "__main__":
    main()
