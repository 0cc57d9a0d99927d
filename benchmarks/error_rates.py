"""How often the conclusions of a board are wrong, on boards whose truth is known.

    python benchmarks/error_rates.py [--boards 1000] [--seed 1] [--table false_decisions]

The logarithm of a trial's loss is drawn as: case + estimator + estimator × place + estimator × drive + repeat, with
the standard deviations that a row names. Over the ten built-in places, the logarithm of the ratio of two real
estimators has a standard deviation of 0.62 between places, so that 0.3 for each of two is a mild assumption. Promised:
false decisions in 2 % of boards, intervals that hold in 95 %, rows of a matrix with a false mark in 5 %.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from scipy import stats
from scipy.spatial.transform import Rotation

from vobench.geometry.se3 import Array
from vobench.metric.ranking import DECIDED, MIN_DRIVES, TrialTable, rank
from vobench.metric.repeat_test import worse_than_best
from vobench.metric.sequential import log_wealths
from vobench.metric.significance import PairedDifference
from vobench.metric.unit import make_design
from vobench.report.cell import CaseFacts
from vobench.report.compare import REGRESSIONS, compare
from vobench.report.leaderboard import Board, make_board
from vobench.runner.estimate import FINISHED, EstimatorOutcome
from vobench.runner.folder import NOT_DETERMINISTIC, TrialScore
from vobench.runner.score import score_estimate, status_of
from vobench.trajectory.trajectory import Trajectory

CASE_STD = 1.5
NOISE = 0.3
MIDDLE = -5.0  # the logarithm of a loss of 0.7 %
FAILED_LOSS = (0.5, 1.0)


@dataclass(frozen=True, slots=True)
class Model:
    """How the losses of a board come about: numbers of places, drives, cases and repeats, and standard deviations.

    drives in each place, cases on each drive. tail: the degrees of freedom of Student's t distribution that the
    interaction with the place follows, None for a normal one. failures: the share of failed trials, by repeat or, if
    `by_case`, all repeats of a case at once. fewer: repeats of every other case.
    """

    places: int
    drives: int = 1
    cases: int = 1
    repeats: int = 4
    place_std: float = 0.0
    drive_std: float = 0.0
    noise: float = NOISE
    tail: float | None = None
    failures: float = 0.0
    by_case: bool = False
    fewer: int | None = None

    @property
    def name(self) -> str:
        """The model in one cell of a table."""
        parts = [f"{self.places} places × {self.drives} drives × {self.cases} cases × {self.repeats}"]
        if self.place_std:
            parts.append(f"place {self.place_std:g}")
        if self.drive_std:
            parts.append(f"drive {self.drive_std:g}")
        if self.tail:
            parts.append(f"t{self.tail:g} tails")
        if self.failures:
            unit = "case" if self.by_case else "trial"
            parts.append(f"{self.failures:.0%} of {unit}s fail")
        if self.fewer:
            parts.append(f"half of the cases {self.fewer} repeats")
        return ", ".join(parts)


def board(model: Model, ratios: Array, rng: Generator) -> TrialTable:
    """The trials of estimators whose losses have these true ratios (E,)."""
    place = np.repeat(np.arange(model.places), model.drives * model.cases)
    drive = np.repeat(np.arange(model.places * model.drives), model.cases)
    estimators = len(ratios)
    case_count = len(place)
    case = rng.normal(MIDDLE, CASE_STD, case_count)
    of_place = _interaction(model, estimators, rng)[:, place]
    of_drive = model.drive_std * rng.standard_normal((estimators, model.places * model.drives))[:, drive]
    by_case = np.log(ratios)[:, None] + case + of_place + of_drive
    repeats = model.noise * rng.standard_normal((estimators, case_count, model.repeats))
    loss = np.exp(np.minimum(by_case[..., None] + repeats, np.log(0.5)))
    error = 2 * loss

    fails = rng.random((estimators, case_count, 1 if model.by_case else model.repeats)) < model.failures
    fails = np.broadcast_to(fails, loss.shape)
    loss = np.where(fails, rng.uniform(*FAILED_LOSS, loss.shape), loss)
    error = np.where(fails, np.nan, error)
    if model.fewer:
        loss[:, ::2, model.fewer :] = np.nan
        error[:, ::2, model.fewer :] = np.nan
    return TrialTable(loss, error, make_design(place.tolist(), drive.tolist()))


def _interaction(model: Model, estimators: int, rng: Generator) -> Array:
    """What each place adds to the logarithm of each estimator's loss (E, P)."""
    shape = estimators, model.places
    draws = rng.standard_t(model.tail, shape) if model.tail else rng.standard_normal(shape)
    return model.place_std * draws


@dataclass(frozen=True, slots=True)
class Rates:
    """Shares of boards: any neighbours decided, best first, decided by a t test; and of intervals: that hold."""

    decided: float
    covered: float
    is_first: float
    t_test: float


def rates(model: Model, ratios: Array, boards: int, rng: Generator) -> Rates:
    """How often the conclusions of boards under a model are what they should be."""
    decided = 0
    first = 0
    by_t_test = 0
    covered = []
    for _ in range(boards):
        trials = board(model, ratios, rng)
        standings = rank(trials)
        decided += any(standing.decided_above for standing in standings)
        best = standings[0].index
        first += ratios[best] == ratios.min()
        by_t_test += model.places > 1 and _t_test(trials) < DECIDED
        for standing in standings[1:]:
            if standing.error_interval:
                low, high = standing.error_interval
                covered.append(low <= ratios[standing.index] / ratios[best] <= high)
    return Rates(
        decided=decided / boards,
        covered=float(np.mean(covered)) if covered else np.nan,
        is_first=first / boards,
        t_test=by_t_test / boards,
    )


def _t_test(trials: TrialTable) -> float:
    """The p-value of a plain t test over places, of the first two estimators."""
    first, second = trials.log_losses()[:2]
    return float(stats.ttest_rel(first, second).pvalue)


ALIKE = np.ones(2)
FIVE_ALIKE = np.ones(5)
NULL_MODELS = [
    Model(1, repeats=10),
    Model(1, repeats=20, place_std=0.3),
    Model(2, repeats=20, place_std=0.3),
    Model(4, repeats=10, place_std=0.3),
    Model(6, repeats=4, place_std=0.3),
    Model(7, repeats=1),
    Model(7, repeats=1, place_std=0.3),
    Model(7, repeats=4, place_std=0.3),
    Model(7, repeats=20, place_std=0.3),
    Model(12, repeats=1),
    Model(12, repeats=4),
    Model(12, repeats=4, place_std=0.3),
    Model(20, repeats=4, place_std=0.3),
    Model(3, cases=4, place_std=0.3),
    Model(2, cases=6, place_std=0.3),
    Model(3, cases=8, place_std=0.3),
    Model(5, cases=4, place_std=0.3),
    Model(4, drives=3, place_std=0.3, drive_std=0.2),
    Model(8, drives=3, cases=4, place_std=0.3, drive_std=0.2),
    Model(12, repeats=4, place_std=0.3, tail=2),
    Model(12, repeats=4, place_std=0.3, failures=0.1),
    Model(12, repeats=4, place_std=0.3, failures=0.1, by_case=True),
    Model(7, repeats=20, place_std=0.3, failures=0.2, by_case=True),
    Model(12, repeats=20, place_std=0.3, fewer=1),
]
POWER_MODELS = [
    Model(7, place_std=0.3),
    Model(12, place_std=0.3),
    Model(20, place_std=0.3),
    Model(12, drives=3, place_std=0.3, drive_std=0.2),
    Model(50, repeats=1, place_std=0.3),
]


def false_decisions(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Of estimators that are equally good: how often an order is decided, and how often intervals hold."""
    yield ["model", "two alike: decided", "interval holds", "five alike: any decided", "an interval holds"]
    for model in NULL_MODELS:
        two = rates(model, ALIKE, boards, rng)
        five = rates(model, FIVE_ALIKE, boards, rng)
        yield [
            model.name,
            f"{two.decided:.3f}",
            _share(two.covered),
            f"{five.decided:.3f}",
            _share(five.covered),
        ]


def power(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Of two estimators that differ: how often the order is decided, and by a plain t test, and intervals hold."""
    yield ["model", "true ratio", "decided", "t test over places", "interval holds", "better one first"]
    for model in POWER_MODELS:
        for ratio in (1.3, 1.5, 2.0):
            found = rates(model, np.array([1.0, ratio]), boards, rng)
            yield [
                model.name,
                f"{ratio:g}",
                f"{found.decided:.3f}",
                f"{found.t_test:.3f}",
                _share(found.covered),
                f"{found.is_first:.3f}",
            ]


def advice(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Of boards that name a number of places for a ratio: how often that many places decide it, for the better one."""
    yield ["model", "ratio", "places named: 10 %, median, 90 %", "found when done", "for the worse one"]
    for model in (Model(7, place_std=0.3), Model(12, place_std=0.3), Model(20, place_std=0.2)):
        for ratio in (1.5, 1.2):
            ratios = np.array([1.0, ratio])
            named = []
            found = 0
            wrong = 0
            tried = 0
            for _ in range(boards):
                second = rank(board(model, ratios, rng))[1]
                places = second.places_needed(ratio)
                if places is None:
                    continue
                named.append(places)
                best, other = rank(board(replace(model, places=max(places, 7)), ratios, rng))
                tried += 1
                found += bool(other.decided_above and best.index == 0)
                wrong += bool(other.decided_above and best.index == 1)
            low, middle, high = np.percentile(named, [10, 50, 90])
            counts = f"{low:.0f}, {middle:.0f}, {high:.0f}"
            yield [model.name, f"{ratio:g}", counts, f"{found / tried:.3f}", f"{wrong / tried:.3f}"]


def false_marks(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Of estimators that are alike on one case: how often any of them is marked as worse than the best."""
    yield ["estimators", "trials of each", "rows with a false mark"]
    for estimators in (2, 5, 10):
        for trials in (4, 5, 10, 20):
            marked = 0
            for _ in range(boards):
                values = {str(name): rng.random(trials) for name in range(estimators)}
                best = min(values, key=lambda name: float(np.median(values[name])))
                marked += bool(worse_than_best(values, best))
            yield [str(estimators), str(trials), f"{marked / boards:.3f}"]


@dataclass(frozen=True, slots=True)
class Looks:
    """What each look at differences of log losses (B, N) of B boards states, after every place, at the level alpha."""

    differences: Array
    alpha: float
    ratio: float

    def claims(self) -> tuple[Array, Array, Array]:
        """Whether each look states that the first is better, that the second is, and that they are alike (B, N)."""
        threshold = np.log(2 / self.alpha)
        limit = np.log(self.ratio)
        first_better = log_wealths(self.differences, 0.0) >= threshold
        second_better = log_wealths(-self.differences, 0.0) >= threshold
        is_less = log_wealths(-self.differences, -limit) >= threshold
        is_more = log_wealths(self.differences, -limit) >= threshold
        return first_better, second_better, is_less & is_more

    def places_until_settled(self) -> Array:
        """The number of places (B,) after which a board ends; infinite for one that never does."""
        is_settled = np.logical_or.reduce(self.claims())
        return np.where(is_settled.any(axis=1), is_settled.argmax(axis=1) + 1.0, np.inf)

    def falsehoods(self, mean: float) -> float:
        """The share of boards of which any look states what a true mean contradicts."""
        first_better, second_better, alike = self.claims()
        is_false = second_better & (mean >= 0) | first_better & (mean <= 0) | alike & (abs(mean) >= np.log(self.ratio))
        return float(is_false.any(axis=1).mean())


MOST_PLACES = 400
RATIO = 1.5
REAL_STD = 0.62  # of lk_epipolar against stereo_pnp, over the ten built-in places
FAILURE = 4.0  # how much larger the logarithm of the loss of a failed trial is


def _failing(shape: tuple[int, int], rng: Generator, *, both: bool, share: float = 0.1) -> Array:
    """Differences of mean 0 where one estimator, or each of the two, fails in a share of places."""
    differences = 0.4 * rng.standard_normal(shape) + FAILURE * (rng.random(shape) < share)
    other = FAILURE * (rng.random(shape) < share) if both else FAILURE * share
    return np.asarray(differences - other)


def until_decided(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Of boards that are looked at after each of 400 places: how often any look states a falsehood at 2 %."""
    yield ["differences of log loss", "true ratio 1", "true ratio 1.5", "a t test at 2 % at every look"]
    shape = (boards, MOST_PLACES)
    kinds: dict[str, Callable[[], Array]] = {
        "normal, standard deviation 0.62": lambda: REAL_STD * rng.standard_normal(shape),
        "heavy tails, t with 2 degrees of freedom": lambda: 0.3 * rng.standard_t(2, shape),
        "two in three are ties": lambda: REAL_STD * rng.standard_normal(shape) * (rng.random(shape) < 1 / 3),
        "each fails in a tenth of places": lambda: _failing(shape, rng, both=True),
        "skewed, exponential": lambda: REAL_STD * (rng.exponential(size=shape) - 1),
        "skewed to the other side": lambda: REAL_STD * (1 - rng.exponential(size=shape)),
        "one fails in a tenth of places, and is better elsewhere": lambda: _failing(shape, rng, both=False),
        "one fails in 1 of 30 places, and is better elsewhere": lambda: _failing(shape, rng, both=False, share=1 / 30),
    }
    for name, draw in kinds.items():
        log_ratio = float(np.log(RATIO))
        at_1 = Looks(draw(), DECIDED, RATIO).falsehoods(0.0)
        at_ratio = Looks(draw() + log_ratio, DECIDED, RATIO).falsehoods(log_ratio)
        yield [name, f"{at_1:.3f}", f"{at_ratio:.3f}", f"{_repeated_t_test(draw()):.3f}"]


def _repeated_t_test(differences: Array) -> float:
    """The share of boards (B, N) that a t test at 2 % decides at any look from the seventh place on."""
    numbers = np.arange(1, differences.shape[1] + 1)
    means = differences.cumsum(axis=1) / numbers
    squares = (differences**2).cumsum(axis=1) - numbers * means**2
    variances = np.maximum(squares, 1e-300) / np.maximum(numbers - 1, 1)
    t = np.abs(means) / np.sqrt(variances / numbers)
    threshold = stats.t.isf(DECIDED / 2, np.maximum(numbers - 1, 1))
    return float((t > threshold)[:, MIN_DRIVES - 1 :].any(axis=1).mean())


def places_until_decided(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Places that a pair takes until it is decided, or alike within 1.5; a t test's number has to be chosen before."""
    quantiles = "places: 10 %, median, 90 %"
    yield ["standard deviation", "true ratio", quantiles, "the same, one of three pairs", "t test, power .95"]
    for std in (0.3, REAL_STD):
        for ratio in (1.0, 1.3, 1.5, 2.0, 3.0):
            row = [f"{std:g}", f"{ratio:g}"]
            for pairs in (1, 3):
                differences = np.log(ratio) + std * rng.standard_normal((boards, MOST_PLACES))
                needed = Looks(differences, DECIDED / pairs, RATIO).places_until_settled()
                shown = np.quantile(needed, [0.1, 0.5, 0.9], method="higher")
                row.append(", ".join(_count(value) for value in shown))
            fixed = PairedDifference(MOST_PLACES, 0.0, std).units_needed(np.log(ratio), DECIDED) if ratio > 1 else None
            yield [*row, str(fixed or "never")]


def _count(places: float) -> str:
    return f"over {MOST_PLACES}" if np.isinf(places) else f"{places:.0f}"


FRAMES = 60
FRAME_NS = 100_000_000
STEP_M = 0.1
DRIFT_M = 0.002  # the standard deviation of the error that an oracle adds in each frame, along each axis
DRIFT_RAD = 0.001


def _drive(rng: Generator) -> Trajectory:
    """A planar drive of FRAMES poses whose curvature wanders."""
    heading_rad = np.cumsum(0.1 * np.cumsum(0.2 * rng.standard_normal(FRAMES)))
    steps_m = STEP_M * np.stack([np.cos(heading_rad), np.sin(heading_rad), np.zeros(FRAMES)], axis=1)
    rotation_vectors = np.zeros((FRAMES, 3))
    rotation_vectors[:, 2] = heading_rad
    T_world_body = np.tile(np.eye(4), (FRAMES, 1, 1))
    T_world_body[:, :3, :3] = Rotation.from_rotvec(rotation_vectors).as_matrix()
    T_world_body[:, :3, 3] = np.cumsum(steps_m, axis=0)
    return Trajectory(FRAME_NS * np.arange(FRAMES, dtype=np.int64), T_world_body)


def _noisy_oracle(truth: Trajectory, factor: float, rng: Generator) -> Trajectory:
    """The true drive with an error that adds up from frame to frame, as that of odometry does."""
    T_previous_next = np.linalg.inv(truth.T_world_frame[:-1]) @ truth.T_world_frame[1:]
    T_estimated = [truth.T_world_frame[0]]
    for T_step in T_previous_next:
        error = np.eye(4)
        error[:3, :3] = Rotation.from_rotvec(factor * DRIFT_RAD * rng.standard_normal(3)).as_matrix()
        error[:3, 3] = factor * DRIFT_M * rng.standard_normal(3)
        T_estimated.append(T_estimated[-1] @ T_step @ error)
    return Trajectory(truth.t_ns, np.array(T_estimated))


def _oracle_trial(truth: Trajectory, estimate: Trajectory, case: str, estimator: str, repeat: int) -> TrialScore:
    """The trial of an oracle, scored as a run scores it."""
    scored = score_estimate(estimate, truth, ())
    status, reason = status_of(EstimatorOutcome(kind=FINISHED, reason=""), scored, truth)
    return TrialScore(
        case=case,
        variant={},
        estimator=estimator,
        repeat=repeat,
        status=status,
        reason=reason,
        coverage=1.0,
        frames=FRAMES,
        path_m=float(truth.distances_m()[-1]),
        score=scored.as_dict() if scored else None,
    )


def _oracle_board(places: int, repeats: int, ratio: float, place_std: float, rng: Generator) -> Board:
    """The board of two noisy oracles whose errors have this ratio, and differ from place to place besides."""
    trials = []
    facts = {}
    for place in range(places):
        truth = _drive(rng)
        case = f"case{place}"
        facts[case] = CaseFacts(place=f"place{place}", drive="drive")
        for estimator, of_estimator in (("good", 1.0), ("poor", ratio)):
            factor = of_estimator * np.exp(place_std * rng.standard_normal())
            for repeat in range(repeats):
                estimate = _noisy_oracle(truth, factor, rng)
                trials.append(_oracle_trial(truth, estimate, case, estimator, repeat))
    return make_board(trials, {}, facts)


def real_boards(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Of boards of noisy oracles, scored from their trajectories: how often the order is decided, and intervals hold.

    A tenth of the boards, for each takes a second. The errors of oracles differ from place to place by a standard
    deviation of 0.3 of their logarithm.
    """
    yield ["places × repeats", "true ratio", "decided", "for the worse one", "interval holds"]
    for places, repeats in ((7, 1), (7, 4), (12, 2)):
        for ratio in (1.0, 1.5, 2.0):
            made = [_oracle_board(places, repeats, ratio, 0.3, rng) for _ in range(boards // 10)]
            decided = [bool(board.totals[1].decided_above) for board in made]
            wrong = [board.totals[1].decided_above and board.totals[0].estimator == "poor" for board in made]
            covered = [_holds(board, ratio) for board in made]
            yield [
                f"{places} × {repeats}",
                f"{ratio:g}",
                f"{np.mean(decided):.3f}",
                f"{np.mean(wrong):.3f}" if ratio > 1 else "",
                f"{np.mean(covered):.3f}",
            ]


def _holds(board: Board, ratio: float) -> bool:
    """Whether the interval of a board's second estimator contains its true ratio to the first."""
    second = board.totals[1]
    if second.error_interval is None:
        return False
    low, high = second.error_interval
    true_ratio = ratio if second.estimator == "poor" else 1.0 / ratio
    return bool(low <= true_ratio <= high)


@dataclass(frozen=True, slots=True)
class Change:
    """What differs between two runs of four estimators: the factor on the loss of each trial, and failures by chance.

    everywhere: the factor on every case; once: that on one case. estimators: how many of the four change.
    """

    name: str
    everywhere: float = 1.0
    once: float = 1.0
    estimators: int = 4
    failures: float = 0.0

    def factor(self, estimator: int, case: int) -> float:
        """The factor on the loss of an estimator on a case in the new run."""
        if estimator >= self.estimators:
            return 1.0
        return self.everywhere * (self.once if case == 0 else 1.0)


CHANGES = [
    Change("nothing"),
    Change("nothing, 5 % of trials fail by chance", failures=0.05),
    Change("10 % worse everywhere", everywhere=1.1),
    Change("50 % worse everywhere", everywhere=1.5),
    Change("one estimator 3 × worse on one case", once=3.0, estimators=1),
    Change("3 × worse on every case", everywhere=3.0),
    Change("30 × worse on every case", everywhere=30.0),
]


def regressions(boards: int, rng: Generator) -> Iterator[list[str]]:
    """Of two runs of four estimators: how often `vobench compare` ends with a regression."""
    yield ["change", "estimators", "4 cases × 1", "12 cases × 1", "12 cases × 5", "12 cases × 10"]
    for change in CHANGES:
        for is_random in (False, True):
            if change.failures and not is_random:
                continue  # a deterministic estimator does not fail by chance
            row = [change.name, "random" if is_random else "deterministic"]
            for cases, repeats in ((4, 1), (12, 1), (12, 5), (12, 10)):
                rate = _regression_rate(change, cases, repeats, boards // 10, rng, is_random=is_random)
                row.append(f"{rate:.2f}")
            yield row


def _regression_rate(
    change: Change, cases: int, repeats: int, boards: int, rng: Generator, *, is_random: bool
) -> float:
    regressed = 0
    for _ in range(boards):
        case_log_losses = rng.normal(MIDDLE, CASE_STD, cases)
        noise = NOISE * rng.standard_normal((2, 4, cases, repeats))
        if not is_random:
            noise[1] = noise[0]
        old = _board_of_run(case_log_losses, noise[0], Change("", failures=change.failures), rng, is_random=is_random)
        new = _board_of_run(case_log_losses, noise[1], change, rng, is_random=is_random)
        regressed += any(found.verdict in REGRESSIONS for found in compare(old, new))
    return regressed / boards


def _board_of_run(case_log_losses: Array, noise: Array, change: Change, rng: Generator, *, is_random: bool) -> Board:
    """The board of trials with this noise (4, C, R) of the logarithm of the loss."""
    scores = []
    for (estimator, case, repeat), deviation in np.ndenumerate(noise):
        loss = change.factor(estimator, case) * np.exp(case_log_losses[case] + deviation)
        has_failed = bool(rng.random() < change.failures)
        lost_aware = 0.3 if has_failed else 1 - min(float(loss), 0.5)
        scores.append(
            TrialScore(
                case=f"case {case}",
                variant={},
                estimator=f"estimator {estimator}",
                repeat=repeat,
                status="lost" if has_failed else "ok",
                reason="",
                coverage=1.0,
                frames=100,
                path_m=1e3,
                score={"metrics": [], "failure": {"lost_aware": lost_aware}},
                claims=(NOT_DETERMINISTIC,) if is_random else (),
            )
        )
    return make_board(scores, {})


def _share(value: float) -> str:
    return "not tested" if np.isnan(value) else f"{value:.3f}"


TABLES: list[Callable[[int, Generator], Iterator[list[str]]]] = [
    false_decisions,
    power,
    advice,
    until_decided,
    places_until_decided,
    real_boards,
    false_marks,
    regressions,
]


def main() -> None:
    """Print the tables in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--boards", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--table", choices=[table.__name__ for table in TABLES], help="print this one alone")
    arguments = parser.parse_args()
    for number, table in enumerate(TABLES):
        if arguments.table not in (None, table.__name__):
            continue
        rng = np.random.default_rng([arguments.seed, number])
        print(f"\n{table.__doc__}\n")
        for row, cells in enumerate(table(arguments.boards, rng)):
            print("| " + " | ".join(cells) + " |", flush=True)
            if row == 0:
                print("|" + "---|" * len(cells))


if __name__ == "__main__":
    main()
