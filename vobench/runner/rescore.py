"""Recomputes scores from estimates and ground truths, for results of other people."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import ValidationError

from vobench import stop
from vobench.errors import InputError, MotionError, VobenchError
from vobench.metric.score import Score
from vobench.regular_file import read_regular
from vobench.runner.consistency import COVARIANCE, CovarianceConsistency, trial_consistency
from vobench.runner.estimate import DROPPED, ESTIMATE, FINISHED, EstimatorOutcome
from vobench.runner.folder import CASE, SURVIVED, RunFolder, TrialScore, read_tum
from vobench.runner.frames import FRAMES, GROUND_TRUTH, read_table
from vobench.runner.ground_truth import scored_truth
from vobench.runner.motion import body_motion
from vobench.runner.score import (
    drift_m,
    judged_claims,
    scale_of,
    score_estimate,
    score_revised,
    senses_exactly,
    status_of,
    status_with_dropped_frames,
)
from vobench.runner.simulate import frames_of
from vobench.suite.case import Case
from vobench.suite.trajectory import depends_on_place
from vobench.suite.yaml_file import checked
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum, parse_tum

# The last digits can differ between machines.
RELATIVE = 1e-6
ABSOLUTE = 1e-9
SAME_TRUTH_M = 1e-6
MOTION_SENSORS = ("encoders", "imu")  # those that can be exact
# The statuses that follow from the estimate. The cause of a crash does not.
OF_ESTIMATE = (*SURVIVED, "lost", "diverged")
# The settings of a case on which its path does not depend.
NOT_OF_PATH = ("name", "variant", "scene", "lighting")
VALUE_LETTERS = 60
TOO_LONG = "too_long"  # pydantic's name of the error
MOST_CASE_BYTES = 32 << 20  # of a case's settings, which can contain a recorded path of 200,000 poses


@dataclass(frozen=True, slots=True)
class Rescored:
    """A trial with its recomputed score.

    `differs` names the first value that differs from the stored one; empty if all agree. `claimed` is the reason why
    the score cannot be recomputed. `score` is the stored score then, and should not be ranked.
    """

    score: TrialScore
    differs: str = ""
    claimed: str = ""


@dataclass(frozen=True, slots=True)
class RescoredRun:
    """The rescored trials of a run, the trials whose score cannot be recomputed, and notes on differences."""

    scores: list[TrialScore]
    claimed: list[Rescored]
    notes: list[str]


def check(folder: RunFolder, wrong_truths: Mapping[str, str] = MappingProxyType({})) -> RescoredRun:
    """Score a run again with `rescored`. Raises InputError if the folder is not a run, or if nothing can be scored."""
    trials = list(rescored(folder, wrong_truths))
    claimed = [trial for trial in trials if trial.claimed]
    ranked = [trial.score for trial in trials if not trial.claimed]
    if not ranked:
        first = claimed[0]
        raise InputError(
            f"none of its scores can be computed again: {_named(first.score)}: {first.claimed}: {folder.path}"
        )
    different = [trial for trial in trials if trial.differs]
    notes = [f"{_named(trial.score)}: another score than its run states: {trial.differs}" for trial in different]
    notes += [f"{_named(trial.score)}: claimed, not ranked: {trial.claimed}" for trial in claimed]
    return RescoredRun(ranked, claimed, notes)


def _named(score: TrialScore) -> str:
    return f"{score.estimator} on {score.case}, {score.repeat}"


def rescored(folder: RunFolder, wrong_truths: Mapping[str, str] = MappingProxyType({})) -> Iterator[Rescored]:
    """Score every trial of a run again.

    `wrong_truths` maps the names of cases to the reason why their ground truth cannot be trusted. A failure that does
    not follow from the estimate is kept. Raises InputError if the folder is not a run.
    """
    for stated in folder.scores():
        stop.check()
        reason = wrong_truths.get(stated.case)
        if reason:
            yield Rescored(stated, claimed=reason)
            continue
        try:
            yield _rescored(folder, stated)
        except (VobenchError, OSError, ValueError, LookupError) as error:
            yield Rescored(stated, claimed=_one_line(error))


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _rescored(folder: RunFolder, stated: TrialScore) -> Rescored:
    trial = folder.estimate(stated.case, stated.estimator, stated.repeat)
    truth = folder.case(stated.case) / GROUND_TRUTH
    obstacle = _why_not_scored(stated, truth, trial / ESTIMATE)
    if obstacle:
        follows_from_estimate = stated.score is not None or stated.status in OF_ESTIMATE
        return Rescored(stated, claimed=obstacle if follows_from_estimate else "")

    gt = read_tum(truth)
    est = read_tum(trial / ESTIMATE)
    scored = score_estimate(est, gt, stated.claims)
    rows = read_table(trial / FRAMES)
    status, reason = _status(stated, est, gt, scored, rows)
    computed = stated.model_copy(
        update={
            "status": status,
            "reason": reason,
            "coverage": scored.coverage.ratio if scored else 0.0,
            "frames": len(gt),
            "path_m": float(gt.distances_m()[-1]),
            "score": _as_json(scored),
            "drift_m": drift_m(est, gt, scored),
            "claims": judged_claims(
                stated.claims, est, gt, is_exactly_sensed=_is_exactly_sensed(folder.case(stated.case), stated.sensors)
            ),
            "consistency": _consistency(trial, gt, est, scored, rows),
            "revised": _as_json(score_revised(trial, gt, stated.claims)),
        }
    )
    difference = _difference(stated.model_dump(mode="json"), computed.model_dump(mode="json"))
    return Rescored(computed, difference or _frame_difference(rows, scored))


def _is_exactly_sensed(place: Path, sensors: Sequence[str]) -> bool:
    """Whether the sensors of an estimator measure the case in a folder exactly; False if the case cannot be read."""
    if not set(sensors) & set(MOTION_SENSORS):
        return False
    return senses_exactly(_case(place / CASE), sensors)


def _why_not_scored(stated: TrialScore, truth: Path, estimate: Path) -> str:
    """The reason why a trial cannot be rescored; empty if it can."""
    for path in (truth, estimate):
        if not path.is_file():
            return f"there is no {path.name}"
    return "" if stated.frames else "its run counts no frames"


def _as_json(scored: Score | None) -> dict[str, Any] | None:
    """A score as plain JSON values."""
    if scored is None:
        return None
    content: dict[str, Any] = json.loads(json.dumps(scored.as_dict()))
    return content


def _status(
    stated: TrialScore, est: Trajectory, gt: Trajectory, scored: Score | None, rows: list[dict[str, str]]
) -> tuple[str, str]:
    """The status and the reason of a trial, which are recomputed if they follow from the estimate."""
    if stated.status not in OF_ESTIMATE:
        return stated.status, stated.reason
    dropped = [int(row["t_ns"]) for row in rows if row.get("status") == DROPPED]
    if dropped:
        return status_with_dropped_frames(est, gt, stated.claims, dropped)
    return status_of(EstimatorOutcome(kind=FINISHED, reason=""), scored, gt)


def _consistency(
    trial: Path, gt: Trajectory, est: Trajectory, scored: Score | None, rows: list[dict[str, str]]
) -> CovarianceConsistency | None:
    """The consistency of the covariances. The start is taken from the table of frames, which a bundle contains."""
    if not (trial / COVARIANCE).is_file():
        return None
    stamps = [int(row["t_ns"]) for row in rows]
    start_ns = min(stamps, default=int(gt.t_ns[0]))
    return trial_consistency(trial, gt, est, start_ns=start_ns, scale=scale_of(scored))


def _frame_difference(rows: list[dict[str, str]], scored: Score | None) -> str:
    """The first error in the table of frames that differs from that of the estimate; empty if there is none."""
    if scored is None:
        return ""
    errors_m = dict(zip(scored.gt_t_ns.tolist(), scored.ate_trans_m.tolist(), strict=True))
    for row in rows:
        if not row.get("position_error_m"):
            continue
        t_ns = int(row["t_ns"])
        error_m = float(row["position_error_m"])
        if not isclose(errors_m.get(t_ns, np.inf), error_m, rel_tol=RELATIVE, abs_tol=SAME_TRUTH_M):
            return f"{FRAMES}: position error {error_m:.6g} m at {t_ns} ns, not that of the estimate"
    return ""


def _difference(stated: Any, computed: Any, place: str = "") -> str:
    """The first place at which two JSON values differ by more than rounding errors; empty if there is none."""
    for name, stated_part, computed_part in _parts(stated, computed):
        difference = _difference(stated_part, computed_part, f"{place} {name}".strip())
        if difference:
            return difference
    if _are_containers(stated, computed) or _are_equal(stated, computed):
        return ""
    return f"{place or 'all of it'}: {brief_value(stated)} is stated, {brief_value(computed)} computed"


def _are_containers(stated: Any, computed: Any) -> bool:
    """Whether two values are both objects, or both lists of the same length, so that their parts are compared."""
    if isinstance(stated, dict) and isinstance(computed, dict):
        return True
    return isinstance(stated, list) and isinstance(computed, list) and len(stated) == len(computed)


def _parts(stated: Any, computed: Any) -> Iterator[tuple[Any, Any, Any]]:
    """The names and values of the parts of two containers. List entries with a name are identified by it."""
    if not _are_containers(stated, computed):
        return
    if isinstance(stated, dict):
        for key in dict.fromkeys([*stated, *computed]):
            yield key, stated.get(key), computed.get(key)
        return
    for index, (stated_entry, entry) in enumerate(zip(stated, computed, strict=True)):
        name = entry.get("name", index) if isinstance(entry, dict) else index
        yield name, stated_entry, entry


def _are_equal(stated: Any, computed: Any) -> bool:
    if _is_number(stated) and _is_number(computed):
        return isclose(stated, computed, rel_tol=RELATIVE, abs_tol=ABSOLUTE)
    return bool(stated == computed)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def brief_value(value: Any) -> str:
    """A JSON value as a short text."""
    if isinstance(value, dict | list):
        return f"{len(value)} entries"
    if isinstance(value, float):
        return f"{value:.9g}"
    return "nothing" if value is None else repr(value)[:VALUE_LETTERS]


def wrong_truths(folder: RunFolder) -> dict[str, str]:
    """The simulated cases of a run whose ground truth does not follow from their settings, and the reasons, by name.

    Nothing is rendered, and no code of a scene is executed. The truth of recordings, of paths that depend on
    their scene, and of cases that another version of vobench wrote, cannot be checked.
    """
    truth_check = _TruthCheck()
    reasons = {}
    for place in sorted((folder.path / "cases").iterdir()):
        stop.check()
        reason = truth_check.reason(place)
        if reason is not None:
            reasons[place.name] = reason
    return reasons


class _TruthCheck:
    """Compares ground truths with the paths that follow from their cases. Each path is computed once."""

    def __init__(self) -> None:
        self._paths: dict[str, Trajectory] = {}  # by the settings that determine them, as JSON

    def reason(self, place: Path) -> str | None:
        """Why the ground truth in the folder of a case is wrong; None if it is right or cannot be checked."""
        truth = place / GROUND_TRUTH
        try:
            case = _case(place / CASE)
        except InputError as error:
            return _one_line(error)
        if case is None or not truth.is_file():
            return None
        if depends_on_place(case.trajectory):
            return None  # the code of the scene is not executed
        try:
            stated = read_tum(truth)
        except VobenchError as error:
            return _one_line(error)
        return self._difference(stated, case, place / CASE)

    def _difference(self, stated: Trajectory, case: Case, case_file: Path) -> str | None:
        """Why a stated truth is not the path of a case; None if it is, or if that path cannot be computed here."""
        try:
            settings = json.dumps(_settings_of_path(case_file), sort_keys=True)
            if settings not in self._paths:
                self._paths[settings] = _true_path(case)
        except MotionError as error:
            return f"its {CASE} gives no path ({_one_line(error)})"
        except (VobenchError, OSError, ValueError, LookupError, AssertionError):
            return None  # for example, a camera file is on another machine
        if _is_same(stated, self._paths[settings]):
            return None
        return f"its {GROUND_TRUTH} is not the path that its {CASE} gives"


def _case(path: Path) -> Case | None:
    """The case in a file; None if it is not one that this version of vobench can simulate.

    Raises InputError if the file or one of its lists is too long, so that its path is not computed.
    """
    try:
        content = read_regular(path, most_bytes=MOST_CASE_BYTES + 1)
    except OSError:
        return None
    if len(content) > MOST_CASE_BYTES:
        raise InputError(f"its {CASE} is larger than {MOST_CASE_BYTES >> 20} MiB")
    try:
        return checked(Case, json.loads(content))
    except ValidationError as error:
        for complaint in error.errors(include_input=False, include_url=False):
            if complaint["type"] == TOO_LONG:
                place = ".".join(map(str, complaint["loc"]))
                raise InputError(f"its {CASE} is too long ({place}: {complaint['msg']})") from None
        return None
    except (ValueError, RecursionError, VobenchError):
        return None


def _settings_of_path(path: Path) -> dict[str, Any]:
    """The settings of a case, without those that do not change its path, such as the scene."""
    settings: dict[str, Any] = json.loads(path.read_bytes())
    for key in NOT_OF_PATH:
        settings.pop(key, None)
    return settings


def _true_path(case: Case) -> Trajectory:
    """The true path of the left camera against which a case is scored."""
    motion = body_motion(case)
    frames = frames_of(case, motion)
    T_world_body = motion.at_frames().T_world_body[frames.index]
    body = Trajectory(frames.t_ns, T_world_body)
    exact = format_tum(body.of_mounted(case.build_rig().T_body_left))
    return parse_tum(scored_truth(exact, case), name=GROUND_TRUTH)


def _is_same(stated: Trajectory, true: Trajectory) -> bool:
    if not np.array_equal(stated.t_ns, true.t_ns):
        return False
    is_close = np.allclose(stated.T_world_frame, true.T_world_frame, rtol=0, atol=SAME_TRUTH_M)
    return bool(is_close)
