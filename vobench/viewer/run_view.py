"""From a run's folder to what the viewer shows of it."""

from collections.abc import Sequence as Rows
from pathlib import Path
from statistics import fmean

import numpy as np

from vobench.errors import InputError, UnknownNameError
from vobench.metric.score import score
from vobench.results import estimate_file
from vobench.results.run_folder import GROUND_TRUTH, SEQUENCE, STATUSES, SURVIVED, RunFolder, RunScore
from vobench.sequence import Sequence, read_truth_frames, read_truth_names, truth_channels
from vobench.trajectory.trajectory import Trajectory
from vobench.viewer.recording import RunView
from vobench.viewer.truth import TruthView


def pick(scores: Rows[RunScore], *, case: str | None, estimator: str | None) -> RunScore:
    """The run most worth a look among those asked for: the gravest failure, else the best estimator's worst case.

    Raises UnknownNameError where no run is of that case or estimator.
    """
    for kind, name, known in (
        ("case", case, {s.case for s in scores}),
        ("estimator", estimator, {s.estimator for s in scores}),
    ):
        if name is not None and name not in known:
            raise UnknownNameError(f"no {kind} '{name}' in this run. Known: {', '.join(sorted(known))}")
    wanted = [s for s in scores if case in (None, s.case) and estimator in (None, s.estimator)]
    failed = [s for s in wanted if s.status not in SURVIVED]
    if failed:
        return max(failed, key=lambda s: STATUSES.index(s.status))
    best = min(
        {s.estimator for s in wanted}, key=lambda name: (_mean_error([s for s in wanted if s.estimator == name]), name)
    )
    return max((s for s in wanted if s.estimator == best), key=_error)


def run_view(folder: RunFolder, run: RunScore) -> RunView:
    """All that is shown of one run. Raises InputError where its sequence is no longer in the cache."""
    link = folder.case(run.case) / SEQUENCE
    if not link.exists():
        raise InputError(f"the sequence is gone from the cache; run the suite again to make it anew: {link}")
    sequence = Sequence.open(link)
    place = folder.estimate(run.case, run.estimator, run.repeat)
    gt = estimate_file.read_tum(folder.case(run.case) / GROUND_TRUTH)
    est = estimate_file.read_tum(place / estimate_file.ESTIMATE)
    scored = score(gt, est) if len(est) else None
    return RunView(
        title=f"{run.estimator} on {run.case}",
        rig=sequence.rig,
        frames=sequence.encoded_frames,
        ground_truth=gt,
        estimate=Trajectory(est.t_ns, scored.alignment.apply(est.T_world_frame)) if scored else est,
        error_t_ns=scored.gt_t_ns if scored else est.t_ns,
        error_m=scored.ate_trans_m if scored else np.zeros(0),
        statuses=[row.status for row in estimate_file.read_frames(place)],
        tracks={i: (table[:, 2:4].astype(float), table[:, 4] > 0) for i, table in estimate_file.read_tracks(place)},
        summary_md=_summary(run),
        truth=_truth(link),
    )


def _truth(sequence: Path) -> TruthView | None:
    """What was recorded of the pixels, None for most sequences."""
    channels = truth_channels(sequence)
    if not channels:
        return None
    return TruthView(channels, read_truth_names(sequence), lambda: read_truth_frames(sequence))


def _error(run: RunScore) -> float:
    value = run.value("ate_trans", "rmse")
    return float("inf") if value is None else value


def _mean_error(runs: Rows[RunScore]) -> float:
    return fmean(_error(run) for run in runs)


def _summary(run: RunScore) -> str:
    """The run's score in Markdown."""
    lines = [f"# {run.estimator} on {run.case}", "", f"**{run.status}**{f' — {run.reason}' if run.reason else ''}", ""]
    lines += [f"{run.frames} frames, {run.path_m:.2f} m, coverage {run.coverage:.1%}", ""]
    if run.score:
        lines += ["| metric | rmse | mean | max |", "|---|---|---|---|"]
        for m in run.score["metrics"]:
            lines.append(f"| {m['name']} ({m['unit']}) | {m['rmse']:.4g} | {m['mean']:.4g} | {m['max']:.4g} |")
    return "\n".join(lines)
