"""The leaderboard as one HTML page, and the reports in a run's folder."""

from dataclasses import dataclass, replace
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from vobench import stop
from vobench.geometry.se3 import Array
from vobench.report import leaderboard as table
from vobench.report.leaderboard import Board, answers, boards
from vobench.run.estimate import ESTIMATE
from vobench.run.folder import RunFolder, TrialScore, read_tum
from vobench.run.frames import TIMES, FrameRow, new_table, read_frames
from vobench.run.ground_truth import GROUND_TRUTH
from vobench.trajectory.align import Alignment

TEMPLATES = Path(__file__).parent / "templates"
PLOT_PX = 420
MARGIN_PX = 24
# Okabe and Ito (2008): eight colours that colour-blind readers tell apart; black is the truth's.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#7f7f7f")


@dataclass(frozen=True, slots=True)
class Line:
    """One path in a plot: its points as SVG wants them."""

    name: str
    colour: str
    points: str


@dataclass(frozen=True, slots=True)
class Plot:
    """The paths of one case from above; `bar_m` metres are `bar_px` long."""

    case: str
    lines: tuple[Line, ...]
    bar_m: float
    bar_px: float


def html(folder: RunFolder, scores: list[TrialScore], boards: list[Board]) -> str:
    """The page."""
    from jinja2 import Environment, FileSystemLoader

    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True)
    names = sorted({score.estimator for score in scores})
    colours = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
    shown: dict[str, list[TrialScore]] = {score.case: [] for score in sorted(scores, key=lambda score: score.case)}
    for score in scores:
        if score.repeat == 0:
            shown[score.case].append(score)
    return environment.get_template("leaderboard.html").render(
        title=folder.path.resolve().parent.name,
        boards=boards,
        lines_of=table.lines_of,
        notes=table.notes,
        legend=table.LEGEND,
        plots=[
            _plot(folder, case, of_case, colours)
            for case, of_case in shown.items()
            if (folder.case(case) / GROUND_TRUTH).is_file()
        ],
        size=PLOT_PX,
    )


def _plot(folder: RunFolder, case: str, scores: list[TrialScore], colours: dict[str, str]) -> Plot:
    stop.check()
    truth = read_tum(folder.case(case) / GROUND_TRUTH).positions_m[:, :2]
    low, span = truth.min(0), max(float(np.ptp(truth, axis=0).max()), 1e-3)
    px_per_m = (PLOT_PX - 2 * MARGIN_PX) / span
    middle = low + np.ptp(truth, axis=0) / 2

    def line(name: str, colour: str, path: Array) -> Line:
        # North up: y grows upwards on the floor and downwards on the page.
        points = PLOT_PX / 2 + (path - middle) * (px_per_m, -px_per_m)
        return Line(name, colour, " ".join(f"{x:.1f},{y:.1f}" for x, y in points))

    estimates = [
        line(s.estimator, colours[s.estimator], _aligned(folder, s, s.score["alignment"])) for s in scores if s.score
    ]
    bar_m = 10.0 ** np.floor(np.log10(span))
    return Plot(case, (line("ground truth", "#000000", truth), *estimates), bar_m, bar_m * px_per_m)


def _aligned(folder: RunFolder, score: TrialScore, stated: dict[str, Any]) -> Array:
    """An estimate's positions (N, 2) from above, after the alignment that its score states."""
    est = read_tum(folder.estimate(score.case, score.estimator, score.repeat) / ESTIMATE)
    return Alignment.from_dict(stated).apply(est.T_world_frame)[:, :2, 3]


STEM = "leaderboard"
COST_COLUMNS = ("case", "estimator", "wall_ms", "cpu_ms", "memory_mib")


def boards_of(folder: RunFolder, scores: list[TrialScore]) -> list[Board]:
    """All boards of a run, with what each frame cost and was said of it."""
    return boards(scores, {key: answers(trials) for key, trials in _frames(folder, scores).items()})


def write_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    """Put leaderboard.md, .json, .csv and .html into a run's folder, without costs: these go to times.csv."""
    frames = _frames(folder, scores)
    said = {key: replace(answers(trials), ms_per_frame=None, memory_mib=None) for key, trials in frames.items()}
    made = boards(scores, said)
    for suffix in ("md", "json", "csv"):
        stop.check()
        (folder.path / f"{STEM}.{suffix}").write_text(table.FORMATS[suffix](made), encoding="utf-8")
    (folder.path / f"{STEM}.html").write_text(html(folder, scores, made), encoding="utf-8")
    _write_costs(folder, frames)


def _frames(folder: RunFolder, scores: list[TrialScore]) -> dict[tuple[str, str], list[list[FrameRow]]]:
    """The frames of each trial, by case and estimator."""
    frames = dict[tuple[str, str], list[list[FrameRow]]]()
    for score in scores:
        rows = read_frames(folder.estimate(score.case, score.estimator, score.repeat))
        frames.setdefault((score.case, score.estimator), []).append(rows)
    return frames


def _write_costs(folder: RunFolder, frames: dict[tuple[str, str], list[list[FrameRow]]]) -> None:
    """The mean cost of a frame and the most memory, a row for each case and estimator; empty where it answered none."""
    with new_table(folder.path / TIMES, COST_COLUMNS) as costs:
        for (case, estimator), trials in frames.items():
            named = {"case": case, "estimator": estimator}
            rows = [row for trial in trials for row in trial]
            for column in COST_COLUMNS[2:]:
                values = [value for row in rows if (value := getattr(row, column)) is not None]
                of_all = max if column == "memory_mib" else fmean
                named[column] = f"{of_all(values):.3f}" if values else ""
            costs.writerow(named)
