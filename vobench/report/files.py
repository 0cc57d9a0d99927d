"""The reports that lie in a run's folder."""

from vobench import stop
from vobench.report import page, table
from vobench.report.leaderboard import Answers, Board, answers, boards
from vobench.results import estimate_file
from vobench.results.run_folder import RunFolder, RunScore

STEM = "leaderboard"


def boards_of(folder: RunFolder, scores: list[RunScore]) -> list[Board]:
    """All boards of a run, with what each frame cost and was said of it."""
    return boards(scores, _answers(folder, scores))


def write_reports(folder: RunFolder, scores: list[RunScore]) -> None:
    """Put leaderboard.md, .json, .csv and .html into a run's folder."""
    made = boards_of(folder, scores)
    for suffix in ("md", "json", "csv"):
        stop.check()
        (folder.path / f"{STEM}.{suffix}").write_text(table.FORMATS[suffix](made), encoding="utf-8")
    (folder.path / f"{STEM}.html").write_text(page.html(folder, scores, made), encoding="utf-8")


def _answers(folder: RunFolder, scores: list[RunScore]) -> dict[tuple[str, str], Answers]:
    """What the frames of each case and estimator that answered at all come to."""
    runs: dict[tuple[str, str], list[list[estimate_file.FrameRow]]] = {}
    for score in scores:
        rows = estimate_file.read_frames(folder.estimate(score.case, score.estimator, score.repeat))
        runs.setdefault((score.case, score.estimator), []).append(rows)
    return {key: found for key, rows in runs.items() if (found := answers(rows))}
