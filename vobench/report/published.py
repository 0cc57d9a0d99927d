"""Leaderboards of published results: the bundles in a folder, with the runs of a user among them."""

import json
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from string import ascii_uppercase
from typing import Any

from vobench.errors import InputError, UnknownNameError, VobenchError, unknown_name_sentence
from vobench.report import page
from vobench.report.board_formats import FORMATS
from vobench.report.board_markdown import markdown
from vobench.report.board_records import json_content
from vobench.report.leaderboard import Board
from vobench.report.markdown_table import escaped
from vobench.report.run_tables import total_records
from vobench.runner.bundle import merged, separate_labels
from vobench.runner.environment import Environment, differences
from vobench.runner.folder import RunFolder, TrialScore
from vobench.runner.store import Tell
from vobench.runner.submission import (
    Submission,
    differing_recordings,
    opened_submission,
    why_not_comparable,
    why_outdated,
)
from vobench.suite.catalog import builtin_root
from vobench.suite.display_path import display_path

BUNDLES = "*.zip"
ONE_MACHINE = "Times of different processors, or taken in different ways, are not compared"


@dataclass(frozen=True, slots=True)
class ResultSource:
    """A bundle or run of a leaderboard.

    `file` is its path as it is shown.
    `estimators` are the labels of its estimators on the board.
    `environment` is that in which its results were computed.
    `machine` is a letter for the machine that took its times; empty if all times of the board are of one machine.
    `recordings` states how its recordings differ from those of the first source; empty if they do not.
    """

    file: str
    estimators: tuple[str, ...]
    environment: Environment
    machine: str = ""
    recordings: str = ""

    @property
    def sentence(self) -> str:
        """The estimators, and where their results come from."""
        letter = f"({self.machine}) " if self.machine else ""
        timed = f", timed {self.environment.timed}" if self.environment.timed else ""
        return f"{letter}{', '.join(self.estimators)}: {self.file}, {self.environment.line()}{timed}"

    def as_dict(self) -> dict[str, Any]:
        """The source as plain JSON values."""
        return {
            "file": self.file,
            "estimators": list(self.estimators),
            "machine": self.machine,
            "recordings": self.recordings,
            "environment": asdict(self.environment),
        }


@dataclass(frozen=True, slots=True)
class PublishedBoard:
    """A leaderboard of comparable results of one suite.

    `apart` is the reason why it is not part of the first board of the suite; empty for that one.
    `outdated` states how the suite of its results differs from the suite of that name here; empty if it does not.
    `folder` has the merged runs, while the bundles are open.
    """

    suite: str
    board: Board
    sources: tuple[ResultSource, ...]
    apart: str
    outdated: str
    folder: RunFolder
    scores: tuple[TrialScore, ...]

    @property
    def with_sources(self) -> Board:
        """The board, whose remarks begin with its sources."""
        remarks = [*self.introduction, *(source.sentence for source in self.sources), *self.board.remarks]
        return replace(self.board, remarks=tuple(remarks))

    @property
    def introduction(self) -> list[str]:
        """The sentences about what the board has in common with others."""
        sentences = [sentence for sentence in (self.apart, self.outdated) if sentence]
        sentences += [source.recordings for source in self.sources if source.recordings]
        if any(source.machine for source in self.sources):
            sentences.append(ONE_MACHINE)
        return sentences

    def as_dict(self) -> dict[str, Any]:
        """The board and its sources as plain JSON values."""
        sources = [source.as_dict() for source in self.sources]
        why = {"apart": self.apart, "outdated": self.outdated}
        return {"suite": self.suite, **why, "sources": sources, **json_content(self.board)}


@dataclass(frozen=True, slots=True)
class PublishedBoards:
    """The leaderboards of one or all suites. `refused` has a sentence for each bundle or run that is on none."""

    boards: tuple[PublishedBoard, ...]
    refused: tuple[str, ...]


def results_folder() -> Path:
    """The folder of the results that are published with vobench."""
    return builtin_root() / "results"


@contextmanager
def published_boards(
    suite: str | None = None,
    *,
    runs: Sequence[Path] = (),
    results: Path | None = None,
    tell: Tell = lambda _: None,
) -> Iterator[PublishedBoards]:
    """The leaderboards of the bundles in `results`/<suite>, with `runs` among them, for the duration of the block.

    Everything is scored again. Results that may not be compared are on different boards. `suite` is the name of the
    only suite that is shown; by default all are. `results` is `results_folder` by default.
    Raises InputError if there is no such folder, or if a run is of another suite, and UnknownNameError.
    """
    root = results_folder() if results is None else results
    with ExitStack() as stack:
        opening = _Opening(stack, tell)
        for name in _suites(root, suite, has_runs=bool(runs)):
            for path in sorted((root / name).glob(BUNDLES)):
                opening.add(path, suite=name)
        for run in runs:
            opening.add(run, suite=suite)
        boards = [_board(group, stack) for group in _groups(opening.submissions)]
        yield PublishedBoards(tuple(boards), tuple(opening.refused))


def _suites(root: Path, suite: str | None, *, has_runs: bool) -> list[str]:
    """The names of the suites in a folder of results, or the one that is asked for."""
    if not root.is_dir():
        raise InputError(f"no such folder of results: {root}")
    known = sorted({bundle.parent.name for bundle in root.glob(f"*/{BUNDLES}")})
    if suite is None:
        return known
    if suite not in known and not has_runs:
        raise UnknownNameError(unknown_name_sentence("published suite", suite, known))
    return [name for name in known if name == suite]


class _Opening:
    """Opens bundles and runs, and keeps a sentence about each one that is refused."""

    def __init__(self, stack: ExitStack, tell: Tell) -> None:
        self.submissions: list[Submission] = []
        self.refused: list[str] = []
        self._stack = stack
        self._tell = tell

    def add(self, path: Path, *, suite: str | None) -> None:
        """Open a bundle or a run, and check that it is of a suite if one is given."""
        try:
            submission = self._stack.enter_context(opened_submission(path, self._tell))
            if suite is not None and submission.suite != suite:
                raise InputError(f"is of the suite {submission.suite!r}, not {suite!r}: {path}")
        except (VobenchError, OSError) as error:
            self.refused.append(f"refused: {' '.join(str(error).split())}")
            return
        self.submissions.append(submission)


@dataclass(slots=True)
class _Group:
    """Submissions that may be ranked on one board, the first of which all others were compared with."""

    apart: str
    submissions: list[Submission] = field(default_factory=list)


def _groups(submissions: Sequence[Submission]) -> list[_Group]:
    """The groups of submissions that may be ranked on one board, suite by suite.

    A submission belongs to the first group to which it is comparable. The first submission of a further group of the
    same suite states why it is not in the first one.
    """
    by_suite: dict[str, list[_Group]] = {}
    for submission in submissions:
        groups = by_suite.setdefault(submission.suite, [])
        reasons = [why_not_comparable(group.submissions[0], submission) for group in groups]
        if "" in reasons:
            groups[reasons.index("")].submissions.append(submission)
            continue
        groups.append(_Group(apart=_apart(groups, reasons, submission), submissions=[submission]))
    return [group for groups in by_suite.values() for group in groups]


def _apart(groups: Sequence[_Group], reasons: Sequence[str], submission: Submission) -> str:
    """Why a submission is not in the first group of its suite; empty if there is none."""
    if not groups:
        return ""
    first = groups[0].submissions[0]
    return f"{_shown_path(submission.path)} is not compared with {_shown_path(first.path)}: {reasons[0]}"


def _board(group: _Group, stack: ExitStack) -> PublishedBoard:
    """The leaderboard of a group of submissions."""
    submissions = group.submissions
    folders = [submission.folder for submission in submissions]
    names = [submission.path.stem for submission in submissions]
    labels = separate_labels(folders, names)
    folder = stack.enter_context(merged(folders, names, labels))
    scores = folder.scores() if len(submissions) > 1 else list(submissions[0].scores)
    board = page.run_board(folder, scores)

    sources = _sources(submissions, [tuple(table.values()) for table in labels])
    has_several_machines = any(source.machine for source in sources)
    if has_several_machines:
        board = _without_ranks_of_times(board, sources)
    board = replace(board, title=submissions[0].suite, environment=None)
    return PublishedBoard(
        suite=submissions[0].suite,
        board=board,
        sources=sources,
        apart=group.apart,
        outdated=_outdated(submissions[0]),
        folder=folder,
        scores=tuple(scores),
    )


def _outdated(submission: Submission) -> str:
    """How the suite of a submission differs from the suite of that name here, as a sentence; empty if it does not."""
    difference = why_outdated(submission)
    if not difference:
        return ""
    return f"The suite {submission.suite} is not that of {_shown_path(submission.path)}: {difference}"


def _sources(submissions: Sequence[Submission], labels: Sequence[tuple[str, ...]]) -> tuple[ResultSource, ...]:
    """Where the results of a board come from. `labels` are those of the estimators of each submission."""
    machines = [_machine(submission.environment) for submission in submissions]
    distinct = list(dict.fromkeys(machines))
    sources = []
    for submission, names, machine in zip(submissions, labels, machines, strict=True):
        letter = ascii_uppercase[distinct.index(machine) % len(ascii_uppercase)] if len(distinct) > 1 else ""
        source = ResultSource(
            file=_shown_path(submission.path),
            estimators=names,
            environment=submission.environment,
            machine=letter,
            recordings=_recordings_sentence(submissions[0], submission),
        )
        sources.append(source)
    return tuple(sources)


def _shown_path(path: Path) -> str:
    """The path of a bundle or run as a user would type it; that of a published one starts at `results`."""
    absolute = path.resolve()
    root = builtin_root()
    is_published = absolute.is_relative_to(results_folder())
    return absolute.relative_to(root).as_posix() if is_published else display_path(path)


def _machine(environment: Environment) -> tuple[str, str, bool]:
    """What CPU times depend on: processors, whether other tasks ran beside the estimators, and portable code."""
    return " and ".join(map(str, environment.processors)), environment.timed, environment.portable


def _recordings_sentence(first: Submission, other: Submission) -> str:
    """How the recordings of a submission differ from those of the first one; empty if they do not."""
    changed = differing_recordings(first, other)
    if not changed:
        return ""
    reasons = "; ".join(differences(first.environment, other.environment))
    return (
        f"{_shown_path(other.path)}: {len(changed)} of {len(other.cases)} recordings differ in bytes from those of "
        f"{_shown_path(first.path)}, which can change an error by a factor of 3: {reasons}"
    )


def _without_ranks_of_times(board: Board, sources: Sequence[ResultSource]) -> Board:
    """The board, whose totals name the machine that took their times, and of which none counts as the cheapest."""
    machine_of = {label: source.machine for source in sources for label in source.estimators}
    totals = [replace(total, machine=machine_of[total.estimator], is_efficient=False) for total in board.totals]
    return replace(board, totals=tuple(totals))


def boards_text(published: PublishedBoards, format_name: str, metric: str) -> str:
    """The leaderboards in a format: Markdown and JSON have all of them, the others only one.

    Raises InputError if there are several for a format that has one.
    """
    if format_name == "json":
        content = {"boards": [shown.as_dict() for shown in published.boards], "refused": list(published.refused)}
        return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    if format_name == "md":
        parts = [f"# {escaped(shown.suite)}\n\n{markdown(shown.with_sources, metric)}" for shown in published.boards]
        return "\n".join(parts)
    if len(published.boards) != 1:
        names = ", ".join(shown.suite for shown in published.boards) or "none"
        count = len(published.boards)
        raise InputError(
            f"the format {format_name} has one board, and these are {count}: {names}; name one suite, or use md or json"
        )
    (shown,) = published.boards
    if format_name == "html":
        return page.board_page(shown.folder, list(shown.scores), shown.with_sources, None)
    return FORMATS[format_name](shown.with_sources, metric)


def board_rows(published: PublishedBoards) -> list[dict[str, Any]]:
    """One row for each estimator of each board: the suite, the number of the board, its total, and its source."""
    rows = []
    for number, shown in enumerate(published.boards, start=1):
        source_of = {label: source for source in shown.sources for label in source.estimators}
        for record in total_records(shown.board):
            source = source_of[record["estimator"]]
            origin = {
                "file": source.file,
                "processor": source.environment.processor,
                "date": source.environment.date,
            }
            rows.append({"suite": shown.suite, "board": number, **record, **origin})
    return rows
