"""The reports that lie in a run's folder."""

from statistics import fmean

from vobench import stop
from vobench.report import page, table
from vobench.report.leaderboard import Board, boards
from vobench.results import estimate_file
from vobench.results.run_folder import RunFolder, RunScore

STEM = "leaderboard"


def boards_of(folder: RunFolder, scores: list[RunScore]) -> list[Board]:
    """All boards of a run, with what each frame cost."""
    return boards(scores, _costs(folder, scores))


def write_reports(folder: RunFolder, scores: list[RunScore]) -> None:
    """Put leaderboard.md, .json, .csv and .html into a run's folder."""
    made = boards_of(folder, scores)
    for suffix in ("md", "json", "csv"):
        stop.check()
        (folder.path / f"{STEM}.{suffix}").write_text(table.FORMATS[suffix](made), encoding="utf-8")
    (folder.path / f"{STEM}.html").write_text(page.html(folder, scores, made), encoding="utf-8")


def _costs(folder: RunFolder, scores: list[RunScore]) -> dict[tuple[str, str], float]:
    """Mean CPU milliseconds per frame of each case and estimator that answered at all."""
    spent: dict[tuple[str, str], list[float]] = {}
    for score in scores:
        rows = estimate_file.read_frames(folder.estimate(score.case, score.estimator, score.repeat))
        spent.setdefault((score.case, score.estimator), []).extend(row.cpu_ms for row in rows)
    return {key: fmean(values) for key, values in spent.items() if values}
