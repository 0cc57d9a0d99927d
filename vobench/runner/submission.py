"""A run or a bundle as a submission to a leaderboard: what is checked, and what may share a board with it."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from pydantic import ValidationError

from vobench.errors import InputError, VobenchError, enumerated
from vobench.runner.bundle import is_same_path, opened, sequence_hashes
from vobench.runner.environment import Environment, differences, read_environment
from vobench.runner.folder import CASE, MOST_NAMED, SUITE, RunFolder, TrialScore
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.rescore import check, wrong_truths
from vobench.runner.store import Tell
from vobench.suite.case import Case
from vobench.suite.suite import read_plan
from vobench.suite.yaml_file import checked, plain

Settings = dict[str, Any]
# The settings of a case in which its repeats differ from it.
OF_REPEAT = ("name", "seed", "repeat", "repeat_of")
# The settings of a recorded case that depend on the machine that imported it. Its true path identifies it.
OF_IMPORT = ("source", "import")
# Paths of files differ between machines; their last parts count.
PATH_KEYS = ("maker", "generator", "file", "calib", "camchain")
PATH_PARTS = 2


@dataclass(frozen=True, slots=True)
class Submission:
    """A run whose hashes, true paths and scores are right.

    `path` is the folder or bundle as its user named it, and `folder` the run in it.
    `scores` are the scores of its trials, computed again.
    `suite` is the name of its suite.
    `cases` are the settings of its cases by name, without the repeats of a case with other noise.
    `recordings` are the hashes of its recordings by file. A case that could not be simulated has none.
    """

    path: Path
    folder: RunFolder
    scores: tuple[TrialScore, ...]
    suite: str
    environment: Environment
    cases: Mapping[str, Settings]
    recordings: Mapping[str, str]


@contextmanager
def opened_submission(path: Path, tell: Tell = lambda _: None) -> Iterator[Submission]:
    """A run or a bundle, for the duration of the block. `tell` is that of `opened`.

    Raises InputError for a bundle whose files do not have the stated hashes, for a true path that does not follow from
    the settings of its case, and for a score that is not that of its estimate.
    """
    with opened(path, tell) as folder:
        yield Submission(
            path=path,
            folder=folder,
            scores=tuple(_verified_scores(folder, path)),
            suite=_suite_name(folder, path),
            environment=read_environment(folder) or Environment(),
            cases=_distinct_cases(folder),
            recordings=sequence_hashes(folder),
        )


def _verified_scores(folder: RunFolder, path: Path) -> list[TrialScore]:
    """The scores of a run, computed again. Raises InputError if a true path or a score is wrong."""
    for case, reason in wrong_truths(folder).items():
        raise InputError(f"{case}: {reason}: {path}")
    rescored = check(folder)
    if rescored.notes:
        raise InputError(f"{rescored.notes[0]}: {path}")
    return rescored.scores


def _suite_name(folder: RunFolder, path: Path) -> str:
    try:
        return str(json.loads((folder.path / SUITE).read_bytes())["name"])
    except (OSError, ValueError, LookupError, TypeError):
        raise InputError(f"does not state the name of its suite ({SUITE}): {path}") from None


def _distinct_cases(folder: RunFolder) -> dict[str, Settings]:
    """The settings of the cases of a run by name, without the repeats of a case with other noise."""
    settings = {}
    for case in sorted({score.case for score in folder.scores()}):
        settings[case] = _settings(folder.case(case) / CASE)
    return {name: each for name, each in settings.items() if not _is_repeat(each, settings)}


def _settings(path: Path) -> Settings:
    """The settings of a case, with the defaults of settings that an older vobench did not have."""
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    if not isinstance(content, dict):
        return {}
    with suppress(ValidationError, VobenchError, ValueError, RecursionError):  # a recording, or of another version
        content = plain(checked(Case, content))
    return _comparable(content)


def _comparable(content: Settings) -> Settings:
    """The settings of a case without those that depend on the machine."""
    kept = {key: value for key, value in content.items() if key not in OF_IMPORT}
    portable: Settings = _with_short_paths(kept)
    return portable


def _with_short_paths(value: Any) -> Any:
    """The same settings, in which the paths of files have their last parts only."""
    if isinstance(value, list):
        return [_with_short_paths(entry) for entry in value]
    if not isinstance(value, dict):
        return value
    shortened = {}
    for key, entry in value.items():
        is_path = key in PATH_KEYS and isinstance(entry, str)
        shortened[key] = PurePosixPath(*PurePosixPath(entry).parts[-PATH_PARTS:]).as_posix() if is_path else entry
    return {key: _with_short_paths(entry) for key, entry in shortened.items()}


def _is_repeat(settings: Settings, settings_by_case: Mapping[str, Settings]) -> bool:
    """Whether a case repeats another one of the same run with other noise, and agrees with it in all else."""
    first = settings_by_case.get(str(settings.get("repeat_of")))
    if first is None:
        return False
    return not [key for key in _differing_keys(first, settings) if key not in OF_REPEAT]


def why_not_comparable(one: Submission, other: Submission) -> str:
    """Why the estimators of two submissions may not be ranked on one board; empty if they may.

    They may if version of vobench, cases and true paths are the same, and the recordings are equal in every byte, or
    differ in a way that processors, drivers and libraries explain.
    """
    if one.environment.vobench != other.environment.vobench:
        return f"it was made by vobench {other.environment.vobench or 'unknown'}, not {one.environment.vobench}"
    for difference in (_difference_of_cases(one.cases, other.cases), _difference_of_paths(one, other)):
        if difference:
            return difference
    changed = differing_recordings(one, other)
    if changed and not differences(one.environment, other.environment):
        return (
            f"its recordings of {enumerated(changed, MOST_NAMED)} differ on the same processor, driver and libraries, "
            f"so the scenes or the simulator have changed ({_commits(one, other)})"
        )
    return ""


def why_outdated(submission: Submission) -> str:
    """How the suite of a submission differs from the suite of that name here; empty if it does not, or is unknown."""
    try:
        plan = read_plan(submission.suite)
    except VobenchError:
        return ""
    cases = {case.name: _comparable(plain(case)) for case in plan.cases}
    distinct = {name: settings for name, settings in cases.items() if not _is_repeat(settings, cases)}
    return _difference_of_cases(submission.cases, distinct)


def _difference_of_cases(one: Mapping[str, Settings], other: Mapping[str, Settings]) -> str:
    """The first difference of other cases from those of one submission in words; empty if there is none."""
    missing = sorted(one.keys() - other.keys())
    if missing:
        return f"it lacks {enumerated(missing, MOST_NAMED)}"
    added = sorted(other.keys() - one.keys())
    if added:
        return f"it has other cases too: {enumerated(added, MOST_NAMED)}"
    for case, settings in one.items():
        keys = _differing_keys(settings, other[case])
        if keys:
            return f"its {case} is another case, of other settings: {', '.join(keys)}"
    return ""


def _differing_keys(one: Settings, other: Settings) -> list[str]:
    keys = dict.fromkeys([*one, *other])
    return [key for key in keys if one.get(key) != other.get(key)]


def _difference_of_paths(one: Submission, other: Submission) -> str:
    cases = {score.case for score in one.scores} & {score.case for score in other.scores}
    for case in sorted(cases):
        path = one.folder.case(case) / GROUND_TRUTH
        other_path = other.folder.case(case) / GROUND_TRUTH
        have_both = path.is_file() and other_path.is_file()
        if have_both and not is_same_path(path, other_path):
            return f"its {case} has another true path"
    return ""


def differing_recordings(one: Submission, other: Submission) -> list[str]:
    """The cases whose recordings differ in a byte, of those that both submissions have recordings of."""
    changed = set[str]()
    for name in one.recordings.keys() & other.recordings.keys():
        if one.recordings[name] != other.recordings[name]:
            _, case, *_ = PurePosixPath(name).parts
            changed.add(case)
    return sorted(changed & one.cases.keys())


def _commits(one: Submission, other: Submission) -> str:
    return f"commits {one.environment.commit or 'unknown'} and {other.environment.commit or 'unknown'}"
