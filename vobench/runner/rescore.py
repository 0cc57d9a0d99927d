"""Scores computed again from estimates and true paths, for results that somebody else hands over."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import ValidationError

from vobench import stop
from vobench.errors import InputError, VobenchError
from vobench.metric.score import Score
from vobench.runner.consistency import COVARIANCE, Consistency, trial_consistency
from vobench.runner.estimate import DROPPED, ESTIMATE, FINISHED, REVISED, Outcome
from vobench.runner.folder import CASE, SURVIVED, RunFolder, TrialScore, read_tum
from vobench.runner.frames import FRAMES, GROUND_TRUTH, read_table
from vobench.runner.ground_truth import scored_truth
from vobench.runner.motion import body_motion
from vobench.runner.score import extent_m, score_estimate, stands_still, status_of, status_of_handed
from vobench.runner.simulate import frames_of
from vobench.suite.suite import Case
from vobench.suite.yaml_file import checked
from vobench.trajectory.formats import format_tum, parse_tum
from vobench.trajectory.trajectory import Trajectory

# Another machine's arithmetic may differ in the last digits.
RELATIVE = 1e-6
ABSOLUTE = 1e-9
SAME_TRUTH_M = 1e-6
# Outcomes that follow from the estimate; why a program crashed is in no trajectory.
OF_ESTIMATE = (*SURVIVED, "lost", "diverged")


@dataclass(frozen=True, slots=True)
class Rescored:
    """A trial with its score computed again.

    `differs` names the first thing that the run stated otherwise, empty if all agrees. `claimed` says why the trial
    cannot be scored again; its `score` is then what the run states, and should not be ranked.
    """

    score: TrialScore
    differs: str = ""
    claimed: str = ""


@dataclass(frozen=True, slots=True)
class Checked:
    """The trials of a run that may be ranked, scored again, those that only claim a score, and what differs."""

    scores: list[TrialScore]
    claimed: list[Rescored]
    notes: list[str]


def check(folder: RunFolder, wrong_truths: Mapping[str, str] = MappingProxyType({})) -> Checked:
    """Score a run again, as `rescored` does. Raises InputError if the folder is not a run, or nothing can be scored."""
    trials = list(rescored(folder, wrong_truths))
    claimed = [trial for trial in trials if trial.claimed]
    ranked = [trial.score for trial in trials if not trial.claimed]
    if not ranked:
        first = claimed[0]
        raise InputError(
            f"none of its scores can be computed again: {_named(first.score)}: {first.claimed}: {folder.path}"
        )
    notes = [
        f"{_named(each.score)}: another score than its run states: {each.differs}" for each in trials if each.differs
    ]
    notes += [f"{_named(each.score)}: claimed, not ranked: {each.claimed}" for each in claimed]
    return Checked(ranked, claimed, notes)


def _named(score: TrialScore) -> str:
    return f"{score.estimator} on {score.case}, {score.repeat}"


def rescored(folder: RunFolder, wrong_truths: Mapping[str, str] = MappingProxyType({})) -> Iterator[Rescored]:
    """Score every trial of a run again.

    `wrong_truths` says of cases, by name, why their true path cannot be trusted. A failure that is none of the
    estimate's stays one. Raises InputError if the folder is not a run.
    """
    for held in folder.scores():
        stop.check()
        if wrong := wrong_truths.get(held.case):
            yield Rescored(held, claimed=wrong)
            continue
        try:
            yield _rescored(folder, held)
        except (VobenchError, OSError, ValueError, LookupError) as error:
            yield Rescored(held, claimed=" ".join(str(error).split()))


def _rescored(folder: RunFolder, held: TrialScore) -> Rescored:
    place = folder.estimate(held.case, held.estimator, held.repeat)
    truth = folder.case(held.case) / GROUND_TRUTH
    missing = next((path.name for path in (truth, place / ESTIMATE) if not path.is_file()), "")
    if missing or not held.frames:
        states_more = held.score is not None or held.status in OF_ESTIMATE
        why = f"there is no {missing}" if missing else "its run counts no frames"
        return Rescored(held, claimed=why if states_more else "")

    gt = read_tum(truth)
    est = read_tum(place / ESTIMATE)
    scored = score_estimate(est, gt, held.claims)
    later = score_estimate(read_tum(place / REVISED), gt, held.claims) if (place / REVISED).is_file() else None
    rows = read_table(place / FRAMES)
    status, reason = _status(held, est, gt, scored, rows)
    again = held.model_copy(
        update={
            "status": status,
            "reason": reason,
            "coverage": scored.coverage.ratio if scored else 0.0,
            "frames": len(gt),
            "path_m": float(gt.distances_m()[-1]),
            "score": _as_json(scored),
            "drift_m": extent_m(est) if scored and stands_still(gt) else None,
            "consistency": _consistency(place, gt, est, scored, rows),
            "revised": _as_json(later),
        }
    )
    differs = _difference(held.model_dump(mode="json"), again.model_dump(mode="json"))
    return Rescored(again, differs or _errors_differ(rows, scored))


def _as_json(scored: Score | None) -> dict[str, Any] | None:
    found: dict[str, Any] | None = json.loads(json.dumps(scored.as_dict())) if scored else None
    return found


def _status(
    held: TrialScore, est: Trajectory, gt: Trajectory, scored: Score | None, rows: list[dict[str, str]]
) -> tuple[str, str]:
    """How the trial ended, by its estimate if that can tell."""
    if held.status not in OF_ESTIMATE:
        return held.status, held.reason
    dropped = [int(row["t_ns"]) for row in rows if row.get("status") == DROPPED]
    if dropped:
        return status_of_handed(est, gt, held.claims, dropped)
    return status_of(Outcome(kind=FINISHED, reason=""), scored, gt)


def _consistency(
    place: Path, gt: Trajectory, est: Trajectory, scored: Score | None, rows: list[dict[str, str]]
) -> Consistency | None:
    """What the covariances are worth; the start is that of the frames, which a bundle has."""
    if not (place / COVARIANCE).is_file():
        return None
    start_ns = min((int(row["t_ns"]) for row in rows), default=int(gt.t_ns[0]))
    scale = scored.alignment.scale if scored else 1.0
    return trial_consistency(place, gt, est, start_ns=start_ns, scale=scale)


def _errors_differ(rows: list[dict[str, str]], scored: Score | None) -> str:
    """Whether the table of frames states other errors than those of the estimate."""
    stated = {int(row["t_ns"]): float(row["position_error_m"]) for row in rows if row.get("position_error_m")}
    if not stated or scored is None:
        return ""
    errors_m = dict(zip(scored.gt_t_ns.tolist(), scored.ate_trans_m.tolist(), strict=True))
    for t_ns, error_m in stated.items():
        if not isclose(errors_m.get(t_ns, np.inf), error_m, rel_tol=RELATIVE, abs_tol=SAME_TRUTH_M):
            return f"{FRAMES}: position error {error_m:.6g} m at {t_ns} ns, not that of the estimate"
    return ""


def _difference(stated: Any, again: Any, place: str = "") -> str:
    """Where two JSON values differ first by more than rounding; empty if nowhere."""
    if isinstance(stated, dict) and isinstance(again, dict):
        for key in [*stated, *(key for key in again if key not in stated)]:
            if found := _difference(stated.get(key), again.get(key), f"{place} {key}".strip()):
                return found
        return ""
    if isinstance(stated, list) and isinstance(again, list) and len(stated) == len(again):
        for index, pair in enumerate(zip(stated, again, strict=True)):
            named = pair[1].get("name", index) if isinstance(pair[1], dict) else index
            if found := _difference(*pair, f"{place} {named}".strip()):
                return found
        return ""
    are_numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in (stated, again))
    if are_numbers and isclose(stated, again, rel_tol=RELATIVE, abs_tol=ABSOLUTE):
        return ""
    return (
        ""
        if stated == again
        else f"{place or 'all of it'}: {brief_value(stated)} is stated, {brief_value(again)} computed"
    )


def brief_value(value: Any) -> str:
    """A JSON value in a few characters."""
    if isinstance(value, dict | list):
        return f"{len(value)} entries"
    if isinstance(value, float):
        return f"{value:.9g}"
    return "nothing" if value is None else repr(value)[:60]


def wrong_truths(folder: RunFolder) -> dict[str, str]:
    """The simulated cases of a run, by name, whose true path is not the one that their settings give, and why.

    Nothing is drawn for it, and nothing of a scene is executed. The truth of recordings cannot be checked, nor that of
    cases that another version of vobench wrote.
    """
    wrong = {}
    paths: dict[str, Trajectory] = {}
    for place in sorted((folder.path / "cases").iterdir()):
        stop.check()
        case = _case(place / CASE)
        truth = place / GROUND_TRUTH
        if case is None or not truth.is_file():
            continue
        try:
            held = read_tum(truth)
        except VobenchError as error:
            wrong[place.name] = " ".join(str(error).split())
            continue
        try:
            key = json.dumps(_settings_of_path(place / CASE), sort_keys=True)
            if key not in paths:
                paths[key] = _true_path(case)
            if not _is_same(held, paths[key]):
                wrong[place.name] = f"its {GROUND_TRUTH} is not the path that its {CASE} gives"
        except (VobenchError, OSError, ValueError, LookupError, AssertionError):
            continue  # such as a camera file of another machine
    return wrong


def _case(path: Path) -> Case | None:
    try:
        return checked(Case, json.loads(path.read_bytes()))
    except (OSError, ValueError, RecursionError, ValidationError, VobenchError):
        return None


def _settings_of_path(path: Path) -> dict[str, Any]:
    """The settings of a case but for those that differ between cases of one path: pictures do not change it."""
    settings: dict[str, Any] = json.loads(path.read_bytes())
    return {key: value for key, value in settings.items() if key not in ("name", "variant", "scene", "lighting")}


def _true_path(case: Case) -> Trajectory:
    """The left camera's true path that a case is scored against."""
    travel = body_motion(case)
    frames = frames_of(case, travel)
    body = Trajectory(frames.t_ns, travel.at_frames().T_world_body[frames.index])
    exact = format_tum(body.of_mounted(case.build_rig().T_body_left))
    return parse_tum(scored_truth(exact, case), name=GROUND_TRUTH)


def _is_same(held: Trajectory, true: Trajectory) -> bool:
    if not np.array_equal(held.t_ns, true.t_ns):
        return False
    return bool(np.allclose(held.T_world_frame, true.T_world_frame, rtol=0, atol=SAME_TRUTH_M))
