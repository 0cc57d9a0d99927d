"""Reads and writes the folder of a run and the hashes of its files."""

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from typing import Any, Final, Literal, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, field_validator

from vobench.errors import InputError, TrajectoryError, enumerated
from vobench.estimator.sandbox import Sandbox
from vobench.runner.consistency import CovarianceConsistency
from vobench.runner.entry import file_hash
from vobench.runner.frames import TIMES
from vobench.runner.store import sweep, unfinished, write_json
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import parse_tum

CASE = "case.json"
SCORE = "score.json"
SEQUENCE = "sequence"
STAMP = "%Y%m%dT%H%M%S"  # the date in the name of a run's folder
ESTIMATES = "estimates"
PAGE = "leaderboard.html"
ENVIRONMENT = "environment.json"
SUITE = "suite.json"
UNTIL = "until.json"  # only in runs whose units were drawn until decided
ESTIMATORS = "estimators.json"

# The best status comes first. Those from `lost` to `not_applicable` are failures, which rank after all others. The last
# one is not a failure of an estimator, because its case is excluded for all estimators.
TrialStatus = Literal[
    "ok",
    "partial",
    "lost",
    "diverged",
    "invalid_output",
    "timeout",
    "out_of_memory",
    "crashed",
    "refused",
    "not_applicable",
    "no_sequence",
]
STATUSES: tuple[TrialStatus, ...] = get_args(TrialStatus)
SURVIVED = ("ok", "partial")
FINISHED_TRIAL = (*SURVIVED, "lost", "diverged")  # the estimator answered to the end, well or not
NOT_APPLICABLE = "not_applicable"  # the recording lacks a sensor that the estimator needs
NO_SEQUENCE: Final = "no_sequence"  # the case could not be simulated or imported
MOST_NAMED = 3  # the largest number of cases that a sentence names; the others are counted


class _Metric(BaseModel):
    """The fields of a metric in JSON that are always read."""

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)

    name: str


class _ScoreShape(BaseModel):
    """The fields that every score in JSON has."""

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)

    metrics: list[_Metric]
    alignment: dict[str, Any] = {}
    failure: dict[str, Any] | None = None


class TrialScore(BaseModel):
    """The status of an estimator on a case and, if there is an estimate, its score.

    `drift_m` is the largest distance of the estimate from its start, in a case that stands still; else None.
    `claims` are the manifest's, such as Sim(3), and TRUTH_COPY if the estimate equals the truth. `sensors` are those
    that the estimator needs. `consistency` is of the covariances that were stated, and `revised` the score of the poses
    that came after the last frame, where there were some.
    `sandbox` is what the estimator could see; None where none was started, and in runs of an older vobench.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    schema_version: int = 1
    case: str
    variant: dict[str, str]
    estimator: str
    repeat: int
    status: TrialStatus
    reason: str
    coverage: float
    frames: int
    path_m: float
    score: dict[str, Any] | None
    drift_m: float | None = None
    claims: tuple[str, ...] = ()
    sensors: tuple[str, ...] = ()
    consistency: CovarianceConsistency | None = None
    revised: dict[str, Any] | None = None
    sandbox: Sandbox | None = None

    @field_validator("score", "revised")
    @classmethod
    def _has_shape(cls, score: dict[str, Any] | None) -> dict[str, Any] | None:
        if score is not None:
            _ScoreShape.model_validate(score)
        return score

    def value(self, metric: str, statistic: str) -> float | None:
        """A statistic of a metric; None if the trial does not have it."""
        return value_of(self.score, metric, statistic)


@dataclass(frozen=True, slots=True)
class UnavailableCases:
    """Cases that could not be simulated or imported for the same cause. The cause may include a remedy."""

    cause: str
    cases: tuple[str, ...]

    @property
    def names(self) -> str:
        """The names of the first cases, and the number of the others."""
        return enumerated(self.cases, MOST_NAMED)


def unavailable_cases(scores: Iterable[TrialScore]) -> tuple[UnavailableCases, ...]:
    """The cases without a sequence, grouped by cause, in the order of their first case.

    If several runs are merged, a case that one of them has simulated is not included.
    """
    causes = dict[str, str]()
    made = set[str]()
    for score in scores:
        if score.status == NO_SEQUENCE:
            causes.setdefault(score.case, score.reason)
        else:
            made.add(score.case)
    by_cause = dict[str, list[str]]()
    for case in sorted(causes.keys() - made):
        by_cause.setdefault(causes[case], []).append(case)
    return tuple(UnavailableCases(cause, tuple(cases)) for cause, cases in by_cause.items())


def with_sequence(scores: Iterable[TrialScore]) -> list[TrialScore]:
    """The trials whose case could be simulated or imported. Other trials say nothing about an estimator."""
    return [score for score in scores if score.status != NO_SEQUENCE]


def total_failure(scores: Iterable[TrialScore]) -> str:
    """A sentence about the numbers of failures and the first one if no trial finished; empty otherwise."""
    trials = with_sequence(scores)
    if not trials or any(trial.status in FINISHED_TRIAL for trial in trials):
        return ""
    counts = Counter(trial.status for trial in trials)
    kinds = ", ".join(f"{count} {status}" for status, count in counts.most_common())
    first = trials[0]
    return f"no estimator finished a trial: {kinds}; {first.estimator} on {first.case}: {first.reason}"


def value_of(score: Mapping[str, Any] | None, metric: str, statistic: str) -> float | None:
    """A statistic of a metric of a score in JSON; None if there is no such metric."""
    metrics = score["metrics"] if score else []
    for entry in metrics:
        if entry["name"] == metric:
            return float(entry[statistic])
    return None


ONLY_THEIR_OWN = "Estimators saw only their own files."
ORACLE = "oracle"  # the claim of estimators that are part of vobench and use the ground truth
NOT_DETERMINISTIC = "not deterministic"  # the claim of estimators whose answers to one sequence may differ
TRUTH_COPY = "equals the truth"  # not a claim of a manifest: scoring adds it to a trial whose estimate is the truth


def visible_to(trials: Iterable[TrialScore]) -> str:
    """Sentences about what the estimators of trials could see, for every form of the leaderboard.

    They name estimators that saw more than their own files, and those of older runs, for which nothing is recorded.
    """
    estimators = dict[str, set[str]]()
    for trial in trials:
        sentence = seen_by(trial)
        if sentence:
            estimators.setdefault(sentence, set()).add(trial.estimator)
    named = [f"{', '.join(sorted(labels))}: {sentence}." for sentence, labels in sorted(estimators.items())]
    return " ".join(named) or ONLY_THEIR_OWN


def seen_by(trial: TrialScore) -> str:
    """What the estimator of a trial saw besides its own files; empty if nothing."""
    sandbox = trial.sandbox
    if sandbox is not None:
        is_strict = sandbox.level == "full" and not sandbox.read
        return "" if is_strict else sandbox.sentence
    is_program = ORACLE not in trial.claims
    was_started = is_program and trial.status not in ("refused", NOT_APPLICABLE)
    return "what it could see is not recorded" if was_started else ""


@dataclass(frozen=True, slots=True)
class RunFolder:
    """A finished run of a suite."""

    path: Path

    def case(self, case: str) -> Path:
        """The folder of a case."""
        return self.path / "cases" / case

    def unmade(self) -> tuple[UnavailableCases, ...]:
        """The cases that could not be simulated or imported, by cause; empty if the run is complete.

        Raises InputError for an invalid folder or score.
        """
        return unavailable_cases(self.scores())

    def estimate(self, case: str, estimator: str, repeat: int) -> Path:
        """The folder of a trial."""
        return self.case(case) / ESTIMATES / estimator / str(repeat)

    def score_files(self) -> list[Path]:
        """The paths of the scores of all trials, in the order of folders. Raises InputError if it is not a run."""
        cases = self.path / "cases"
        files = sorted(cases.glob(f"*/{ESTIMATES}/*/*/{SCORE}"))
        if files:
            return files
        if not self.path.is_dir():
            raise InputError(f"no such folder: {self.path}")
        if any(cases.glob(f"*/*/*/{SCORE}")):
            raise InputError(
                f"a run of an older vobench, whose estimates are not in cases/*/{ESTIMATES}; "
                f"run the suite again: {self.path}"
            )
        raise InputError(f"not the folder of a run (no cases/*/{ESTIMATES}/*/*/{SCORE} in it): {self.path}")

    def scores(self) -> list[TrialScore]:
        """The scores of all trials, in the order of folders. Raises InputError for an invalid folder or score."""
        scores = []
        for file in self.score_files():
            score = read_score(file)
            folder = self.estimate(score.case, score.estimator, score.repeat)
            if folder / SCORE != file:
                trial = f"{score.estimator!r} on {score.case!r}, {score.repeat}"
                raise InputError(f"should be the score of its folder, but is that of {trial}: {file}")
            scores.append(score)
        return scores

    def estimator_labels(self) -> list[str]:
        """The labels of the estimators of the run, in the order of its suite; empty if the run does not list them.

        Raises InputError if the list is invalid.
        """
        path = self.path / ESTIMATORS
        if not path.exists():
            return []
        try:
            return [entry["label"] for entry in json.loads(path.read_bytes())]
        except (ValueError, TypeError, KeyError):
            raise InputError(f"not a list of estimators as vobench writes it: {path}") from None


def read_score(path: Path) -> TrialScore:
    """The score of a trial. Raises InputError if the file is not a score."""
    try:
        return TrialScore.model_validate_json(path.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise InputError(
            f"not a score as vobench writes it ({f'{place}: ' if place else ''}{first['msg']}): {path}"
        ) from None


def open_run(path: Path) -> RunFolder:
    """The run at a path. The folder of a suite stands for its latest run."""
    return RunFolder((path / "latest") if (path / "latest").exists() else path)


def make_run(root: Path, suite: str, key: str, fill: Callable[[RunFolder], None]) -> RunFolder:
    """Create the folder of a run. It gets its final name when `fill` has returned without an error."""
    parent = root / suite
    sweep(parent)
    with unfinished(parent) as folder:
        fill(RunFolder(folder))
        final = _published(folder, parent / f"{datetime.now(UTC):{STAMP}}_{key[:8]}")
        fresh = parent / f".latest-{os.getpid()}"
        fresh.symlink_to(final.name)
        fresh.replace(parent / "latest")  # atomic
    return RunFolder(final)


def _published(folder: Path, name: Path) -> Path:
    """The folder with its final name, followed by a number if two runs ended in the same second."""
    for number in count(1):
        final = name if number == 1 else name.with_name(f"{name.name}.{number}")
        try:
            return folder.rename(final)
        except OSError:
            if not final.is_dir():
                raise
    raise AssertionError


def run_date(folder: RunFolder) -> str:
    """The date in UTC on which a run ended, as in 2026-11-24, from the name of its folder; empty for another name."""
    stamp = folder.path.resolve().name.partition("_")[0]
    try:
        ended = datetime.strptime(stamp, STAMP).replace(tzinfo=UTC)
    except ValueError:
        return ""
    return f"{ended:%Y-%m-%d}"


def read_tum(path: Path) -> Trajectory:
    """The trajectory in a TUM file of a run; empty if an estimator gave no pose.

    Raises TrajectoryError if the file is not a trajectory.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"not a text file in UTF-8 (byte {error.start}): {path}") from None
    return parse_tum(text, name=str(path))


# The first file is equal for runs with equal inputs. The second has the hashes of durations and of the page with them.
HASHES = "hashes.json"
TIMES_HASHES = "times_hashes.json"


def write_hashes(folder: RunFolder) -> None:
    """Hash all files in the folder of a run and the sequences to which it links, and files of durations separately."""
    hashes: dict[str, str] = {}
    times_hashes: dict[str, str] = {}
    for name in _names(folder.path):
        of_times = Path(name).name in (TIMES, PAGE)
        chosen = times_hashes if of_times else hashes
        chosen[name] = file_hash(folder.path / name)
    write_json(folder.path / HASHES, hashes)
    write_json(folder.path / TIMES_HASHES, times_hashes)


def read_hashes(folder: RunFolder) -> dict[str, str]:
    """The hash of each file by its path in the folder. Raises InputError if the run has no hashes."""
    return {**hashes_in(folder.path / HASHES), **hashes_in(folder.path / TIMES_HASHES)}


def hashes_in(path: Path) -> dict[str, str]:
    """The hash of each file in a table of hashes. Raises InputError if there is no table, or if it is not valid."""
    try:
        hashes = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"this run kept no hashes (its vobench was older, or it is no run): {path}") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"not readable as JSON ({error}): {path}") from None
    is_table = isinstance(hashes, dict) and all(isinstance(value, str) for value in hashes.values())
    if not is_table:
        raise InputError(f"should hold one hash for each file: {path}")
    for name in hashes:
        file = Path(name)
        if file.is_absolute() or ".." in file.parts:
            raise InputError(f"names a file outside the run's folder ({name!r}): {path}")
    return dict(hashes)


def _names(root: Path) -> Iterator[str]:
    """The paths of all files below the folder of a run. A sequence is a link to a folder in the cache."""
    files = {path for path in root.rglob("*") if path.is_file()}
    for link in root.glob(f"cases/*/{SEQUENCE}"):
        files.update(link.glob("*.mcap"))
    for path in sorted(files):
        name = str(path.relative_to(root))
        if name not in (HASHES, TIMES_HASHES):
            yield name
