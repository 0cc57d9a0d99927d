"""vobench score."""

from pathlib import Path
from typing import cast, get_args

from vobench.catalog.catalog import unknown
from vobench.cli import terminal
from vobench.errors import InputError, TrajectoryError, UnknownNameError
from vobench.metric.score import Score, ScoreSettings, score
from vobench.trajectory.align import Kind
from vobench.trajectory.text import parse_tum
from vobench.trajectory.trajectory import Trajectory

MCAP_MAGIC = b"\x89MCAP"
MAX_DIFF_S = 1e6


def show(gt: Path, est: Path, *, align: str, delta: int, t_max_diff_s: float, as_json: bool) -> None:
    """Score two trajectories and print every metric with its identity."""
    if align not in get_args(Kind):
        raise UnknownNameError(unknown("alignment", align, list(get_args(Kind))))
    if not 0 <= t_max_diff_s <= MAX_DIFF_S:
        raise InputError(f"--t-max-diff should be 0 to {MAX_DIFF_S:g} seconds, got {t_max_diff_s:g}")
    kind = cast("Kind", align)
    settings = ScoreSettings(alignment=kind, max_diff_ns=round(t_max_diff_s * 1e9), rpe_delta_frames=delta)
    scored = score(read_trajectory(gt), read_trajectory(est), settings=settings)
    if as_json:
        terminal.print_json(scored.as_dict())
    else:
        _print(scored)


def read_trajectory(path: Path) -> Trajectory:
    """A TUM file, or the left camera's true path of a sequence's folder. Raises InputError."""
    if path.is_dir() or path.name == "truth.mcap":
        from vobench.pipeline.run import left_truth

        return left_truth(path if path.is_dir() else path.parent)
    try:
        content = path.read_bytes()
        return parse_tum(content.decode("utf-8"), name=str(path))
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        hint = "an MCAP file; give its sequence's folder" if content.startswith(MCAP_MAGIC) else "no text"
        raise TrajectoryError(f"not a TUM trajectory but {hint}: {path}") from None


def _print(scored: Score) -> None:
    columns = ("rmse", "mean", "median", "std", "min", "max", "p95")
    rows = [
        [m.id, m.unit, str(m.statistics.n), *(f"{getattr(m.statistics, c):.6g}" for c in columns)]
        for m in scored.metrics
    ]
    out = terminal.console()
    out.print(terminal.table("", ["metric", "unit", "n", *columns], rows))
    a = scored.association
    out.print(
        f"{a.pairs} pairs of {a.gt_poses} true and {a.est_poses} estimated poses, coverage {scored.coverage.ratio:.3f}"
    )
    for warning in scored.warnings:
        out.print(f"warning: {warning}", style="yellow")
