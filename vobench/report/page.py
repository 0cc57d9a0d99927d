"""The leaderboard as one HTML page that needs no network, and the reports in a run's folder."""

import base64
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from math import inf
from pathlib import Path
from statistics import fmean
from typing import Any
from urllib.parse import quote

import numpy as np

from vobench import stop
from vobench.errors import VobenchError
from vobench.geometry.se3 import Array
from vobench.report import board_table as table
from vobench.report.leaderboard import COSTS, METRICS, Answered, Board, CaseFacts, Cell, answers, board, notes
from vobench.runner.environment import Environment, read_environment
from vobench.runner.estimate import ESTIMATE, LOG
from vobench.runner.folder import (
    CASE,
    PAGE,
    SCORE,
    SEQUENCE,
    SUITE,
    SURVIVED,
    RunFolder,
    TrialScore,
    read_tum,
    visible_to,
    with_sequence,
)
from vobench.runner.frames import FRAMES, GROUND_TRUTH, TIMES, FrameRow, new_table, read_frames
from vobench.trajectory.align import Alignment

TEMPLATES = Path(__file__).parent / "templates"
STEM = "leaderboard"
COST_COLUMNS = ("case", "estimator", "wall_ms", "cpu_ms", "memory_mib")
MOST_DETAILS = 200  # cells, the worst of them, that a page can open
MOST_POINTS = 160  # of a curve or a path in it
THUMB_PX = 176
RIG_PX = 256
JPEG_QUALITY = 55
MOST_PICTURE_BYTES = 2_200_000  # of all pictures in it, before they are written as text
UNCALIBRATED = "none"  # the group of cases without a calibration error, as recordings are
APART = 5  # frames between two of the worst moments
MOST_RIGS = 4
FILES = (SCORE, FRAMES, ESTIMATE, LOG, "run.rrd")


def board_of(folder: RunFolder, scores: list[TrialScore]) -> Board:
    """The board of a run, with what each frame cost and was said of it."""
    return _board(folder, scores, {key: found for key, found, _ in _answers(folder, scores)})


def _board(folder: RunFolder, scores: list[TrialScore], answered: Answered) -> Board:
    facts = {case: case_facts(folder, case) for case in {score.case for score in scores}}
    title = folder.path.resolve().parent.name
    return board(scores, answered, facts, title=title, environment=read_environment(folder))


def case_facts(folder: RunFolder, case: str) -> CaseFacts:
    """What a case says of itself; nothing where its file is missing or says nothing."""
    stated = _json(folder.case(case) / CASE)
    severity = stated.get("severity")
    level = ((stated.get("rig") or {}).get("calibration_error") or {}).get("level")
    return CaseFacts(
        group=level if isinstance(level, str) and level != UNCALIBRATED else "",
        scenario=str(stated.get("scenario") or ""),
        severity=severity if isinstance(severity, int) else None,
        truth_noise=_noise(stated.get("truth_noise") or {}),
    )


def _noise(stated: Mapping[str, float]) -> str:
    """How far each pose of a truth is off, in words; nothing where it is exact."""
    sizes = [(1e3 * stated.get("position_m", 0), "mm on each axis"), (stated.get("rotation_deg", 0), "° about each")]
    return " and ".join(f"{size:g} {unit}" for size, unit in sizes if size)


def _json(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def write_reports(folder: RunFolder, scores: list[TrialScore]) -> None:
    """Put leaderboard.md, .json and .csv into a run's folder, without costs: these go to times.csv and the page."""
    found = list(_answers(folder, scores))
    without_costs = {key: replace(each, ms_per_frame=None, memory_mib=None) for key, each, _ in found}
    made = _board(folder, scores, without_costs)
    if made.environment:
        made = replace(made, environment=replace(made.environment, date=""))
    for suffix in ("md", "json", "csv"):
        stop.check()
        text = table.FORMATS[suffix](made, table.DEFAULT_METRIC)
        (folder.path / f"{STEM}.{suffix}").write_text(text, encoding="utf-8")
    with new_table(folder.path / TIMES, COST_COLUMNS) as costs:
        for (case, estimator), _, cost in found:
            costs.writerow({"case": case, "estimator": estimator, **cost})
    made = _board(folder, scores, {key: each for key, each, _ in found})
    (folder.path / PAGE).write_text(html(folder, scores, made, folder.path), encoding="utf-8")


def _answers(folder: RunFolder, scores: list[TrialScore]) -> Iterator[tuple[tuple[str, str], Any, dict[str, str]]]:
    """What the frames of each case and estimator come to, and the mean cost of one; a cell in memory at a time."""

    def key(score: TrialScore) -> tuple[str, str]:
        return score.case, score.estimator

    for each, trials in groupby(sorted(with_sequence(scores), key=key), key=key):
        stop.check()
        frames = [read_frames(folder.estimate(trial.case, trial.estimator, trial.repeat)) for trial in trials]
        yield each, answers(frames), _costs([row for rows in frames for row in rows])


def _costs(rows: list[FrameRow]) -> dict[str, str]:
    """The mean cost of a frame and the most memory; empty where none was answered."""
    found = dict[str, str]()
    for column in COST_COLUMNS[2:]:
        values = [value for row in rows if (value := getattr(row, column)) is not None]
        summary = max if column == "memory_mib" else fmean
        found[column] = f"{summary(values):.3f}" if values else ""
    return found


def html(folder: RunFolder, scores: list[TrialScore], made: Board, beside: Path) -> str:
    """The page, whose links lead from the folder that it is put in."""
    from jinja2 import Environment, FileSystemLoader

    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True, lstrip_blocks=True)
    shown = {name: table.matrix(made, name) for name in made.metrics} or {table.DEFAULT_METRIC: []}
    metric = table.DEFAULT_METRIC if table.DEFAULT_METRIC in shown else next(iter(shown))
    pictures = Pictures(folder)
    rigs = _rigs(folder, made, pictures)
    return environment.get_template("leaderboard.html").render(
        title=made.title,
        header=_header(folder, scores),
        rigs=rigs,
        made=made,
        metric=metric,
        headings={name: METRICS[name].heading for name in shown},
        rows=shown[metric],
        named=table.named,
        claims={cell.estimator: cell.claims for cell in made.cells},
        totals=table.totals(made),
        remarks=table.remarks(made),
        legend=table.LEGEND,
        data=_safe(_data(folder, scores, made, shown, pictures=pictures, beside=beside)),
    )


def _safe(data: Any) -> str:
    """JSON that may stand in a script: nothing in it ends the script or begins a comment."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _header(folder: RunFolder, scores: list[TrialScore]) -> dict[str, Any]:
    """What was run, when, with what and on what, as far as the run's files say it."""
    suite = _json(folder.path / SUITE)
    environment = read_environment(folder) or Environment()
    trials = with_sequence(scores)
    failed = sum(score.status not in SURVIVED for score in trials)
    facts = {
        "trials": f"{len(trials)}, {failed} failed",
        "seed": suite.get("seed"),
        "repeats": suite.get("repeats"),
        "date": environment.date,
        "vobench": environment.release if environment.vobench else None,
        "processor": " and ".join(map(str, environment.processors)),
        "cores": f"{environment.cores} of {environment.cores_total}" if environment.cores else None,
        "drawn by": environment.driver,
        "portable": "yes" if environment.portable else None,
        "estimators": visible_to(trials).removeprefix("Estimators "),
        "system": environment.platform,
        "CPU time": f"taken {environment.timed}" if environment.timed else None,
    }
    versions = {"Python": environment.python} if environment.python else {}
    return {
        "summary": suite.get("summary", ""),
        "facts": {name: value for name, value in facts.items() if value not in (None, "")},
        "libraries": {**versions, **environment.libraries},
    }


@dataclass(frozen=True, slots=True)
class Moment:
    """A frame worth a look, and why."""

    frame: int
    t_s: float
    why: str


class Pictures:
    """Small JPEGs of frames of a run's sequences, each once, until there are enough bytes of them."""

    def __init__(self, folder: RunFolder) -> None:
        self._folder = folder
        self._bytes = 0
        self._made = dict[tuple[str, int, int], str]()
        self._open = dict[str, Any]()

    def get(self, case: str, frame: int, width_px: int) -> str | None:
        """A frame of a case as a data URI, None where there is none or no room is left."""
        key = case, frame, width_px
        if key not in self._made and self._bytes < MOST_PICTURE_BYTES:
            try:
                encoded = _jpeg(self._sequence(case).frame(frame).left, width_px)
            except (VobenchError, OSError):
                return None
            self._bytes += len(encoded)
            self._made[key] = f"data:image/jpeg;base64,{base64.b64encode(encoded).decode()}"
        return self._made.get(key)

    def _sequence(self, case: str) -> Any:
        from vobench.sequence import Sequence as Recording

        if case not in self._open:
            self._open = {case: Recording.open(self._folder.case(case) / SEQUENCE)}
        return self._open[case]


def _jpeg(picture: Any, width_px: int) -> bytes:
    import cv2

    size = width_px, max(1, round(picture.shape[0] * width_px / picture.shape[1]))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    small = small[..., ::-1] if small.ndim == 3 else small
    encoded: bytes = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
    return encoded


def _rigs(folder: RunFolder, made: Board, pictures: Pictures) -> list[tuple[str, str]]:
    """What the first case of each rig sees first, with the rig's name."""
    found = dict[str, str]()
    for case in made.cases:
        rig = (
            str((_json(folder.case(case) / CASE).get("variant") or {}).get("rig", "")) if len(found) < MOST_RIGS else ""
        )
        if rig and rig not in found and (picture := pictures.get(case, 0, RIG_PX)):
            found[rig] = picture
    return list(found.items())


def _data(
    folder: RunFolder,
    scores: list[TrialScore],
    made: Board,
    shown: dict[str, list[tuple[str, list[table.Shown]]]],
    *,
    pictures: Pictures,
    beside: Path,
) -> dict[str, Any]:
    """All that the page's script draws."""
    names = made.estimators
    cases = made.cases
    metrics = {
        name: {
            "higher": METRICS[name].higher_is_better,
            "cost": name in COSTS,
            "text": [[[c.text, c.range, c.mark, int(c.failed)] for c in cells] for _, cells in rows],
            "value": [[_middle(made.cell(case, e), name) for e in names] for case in cases],
        }
        for name, rows in shown.items()
    }
    details, truths = _details(folder, scores, made, pictures, beside)
    return {
        "cases": cases,
        "estimators": names,
        "metrics": metrics,
        "details": details,
        "truths": truths,
        "totals": [
            {"name": t.estimator, "group": t.group, "cpu": t.cpu_ms, "loss": 1 - t.score, "on": t.is_efficient}
            for t in made.totals
        ],
        "curves": [asdict(curve) for curve in made.curves],
    }


def _middle(cell: Cell | None, metric: str) -> float | None:
    spread = cell.spread(metric) if cell else None
    return None if spread is None or (cell and cell.failed == cell.trials and metric not in COSTS) else spread[0]


def _details(
    folder: RunFolder, scores: list[TrialScore], made: Board, pictures: Pictures, beside: Path
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a page tells of its worst cells, by 'case|estimator' in numbers, and the true paths of their cases."""
    trials = dict[tuple[str, str], list[TrialScore]]()
    for score in scores:
        trials.setdefault((score.case, score.estimator), []).append(score)
    cells = sorted(made.cells, key=lambda cell: (-cell.failed / cell.trials, -float(np.nanmax([0.0, *cell.losses]))))
    rows, columns = ({name: k for k, name in enumerate(names)} for names in (made.cases, made.estimators))
    details = dict[str, Any]()
    truths = dict[str, Any]()
    for cell in sorted(cells[:MOST_DETAILS], key=lambda cell: rows[cell.case]):
        stop.check()
        row = str(rows[cell.case])
        truth = folder.case(cell.case) / GROUND_TRUTH
        if row not in truths and truth.is_file():
            truths[row] = points(read_tum(truth).positions_m[:, :2])
        detail = _detail(folder, cell, trials[cell.case, cell.estimator], pictures, beside)
        details[f"{row}|{columns[cell.estimator]}"] = detail
    return details, truths


def _detail(
    folder: RunFolder, cell: Cell, trials: list[TrialScore], pictures: Pictures, beside: Path
) -> dict[str, Any]:
    """The worst trial of a cell: its error over time, its path, its worst moments and its files."""
    losses = dict(zip((trial.repeat for trial in trials), cell.losses, strict=True))
    worst = max(trials, key=lambda trial: (trial.status not in SURVIVED, np.nan_to_num(losses[trial.repeat])))
    place = folder.estimate(worst.case, worst.estimator, worst.repeat)
    frames = read_frames(place)
    errors_m = np.array([inf if row.position_error_m is None else row.position_error_m for row in frames])
    t_s = np.array([row.t_ns for row in frames]) / 1e9
    keep = peaks(np.where(np.isinf(errors_m), -1.0, errors_m))
    thumbs = [(asdict(m), pictures.get(cell.case, m.frame, THUMB_PX)) for m in moments(frames, errors_m)]
    path = _aligned(place, worst)
    of_pose = errors_m[np.isfinite(errors_m)]
    same = len(of_pose) == len(path)
    at = _spread(len(path))
    link = quote(os.path.relpath(place, beside))
    return {
        "trial": worst.repeat,
        "notes": notes(cell),
        "t": [round(float(t_s[k] - t_s[0]), 3) for k in keep],
        "e": [None if np.isinf(errors_m[k]) else _digits(1e3 * errors_m[k]) for k in keep],
        "path": points(path),
        "pathe": [_digits(1e3 * of_pose[k]) for k in at] if same else [],
        "thumbs": [{**moment, "src": picture} for moment, picture in thumbs if picture],
        "files": [[name, f"{link}/{name}"] for name in FILES if (place / name).is_file()],
        "view": ["--case", cell.case, "--estimator", cell.estimator],
    }


def _digits(value: float) -> float:
    return float(f"{value:.4g}")


def _aligned(place: Path, trial: TrialScore) -> Array:
    """An estimate's positions (N, 2) from above, after the alignment that its score states."""
    if not trial.score or not (place / ESTIMATE).is_file():
        return np.zeros((0, 2))
    T = Alignment.from_dict(trial.score["alignment"]).apply(read_tum(place / ESTIMATE).T_world_frame)
    positions_m: Array = T[:, :2, 3]
    return positions_m


def _spread(n: int) -> list[int]:
    """So many of n points as a plot needs, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, MOST_POINTS)).astype(int)).tolist() if n else []


def points(path_m: Array) -> list[list[float]]:
    """So many points of a path (N, 2) as a plot needs."""
    return [[round(float(x), 4), round(float(y), 4)] for x, y in path_m[_spread(len(path_m))]]


def peaks(errors: Array) -> list[int]:
    """The frames to draw of a curve: of each stretch that falls on one point the largest, so that no peak is lost."""
    parts = np.array_split(np.arange(len(errors)), min(len(errors), MOST_POINTS) or 1)
    return [int(part[np.argmax(errors[part])]) for part in parts if len(part)]


def moments(frames: Sequence[FrameRow], errors_m: Array) -> list[Moment]:
    """The frames of a trial that are worth a look: where track was lost, the largest error, its largest jump."""
    if not frames:
        return []
    known = np.where(np.isinf(errors_m), -1.0, errors_m)
    is_lost = np.array([row.status in ("lost", "") and k > 0 for k, row in enumerate(frames)], float)
    found = list[Moment]()
    at = np.arange(len(frames))
    for why, worth in (("lost", is_lost), ("large error", known), ("jump", np.diff(known, prepend=known[:1]))):
        far = np.min([np.abs(at - other.frame) for other in found], axis=0) >= APART if found else at >= 0
        k = int(np.argmax(np.where(far, worth, -np.inf)))
        if far[k] and worth[k] > 0:
            found.append(Moment(frames[k].frame, round((frames[k].t_ns - frames[0].t_ns) / 1e9, 2), why))
    return found
