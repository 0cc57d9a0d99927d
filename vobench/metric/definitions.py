"""Definitions of the metrics, and the identity of a number: the metric and every setting that shaped it."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from vobench.errors import InputError
from vobench.metric.settings import ScoreSettings

NS_PER_MS = 10**6
_FORM = re.compile(r"(?P<metric>[a-z0-9_.]+)\[(?P<parts>[^\[\]]*)\]")
_PAIRS = {False: "consecutive", True: "all"}
_DEFAULTS = ScoreSettings()


@dataclass(frozen=True, slots=True)
class Identity:
    """What an id says: the metric and statistic, its settings (the others default), and n of how many."""

    metric: str
    settings: ScoreSettings
    n: int
    of: int


def identity(metric: str, settings: ScoreSettings, *, n: int, of: int) -> str:
    """The id of a metric such as `rpe.trans.rmse`; its first word says which settings concern it."""
    parts = [*_own_parts(metric, settings), *_shared_parts(settings), f"n={n}/{of}"]
    return f"{metric}[{'; '.join(parts)}]"


def parse_identity(text: str) -> Identity:
    """Read an id back. Raises InputError naming what it can't read."""
    form = _FORM.fullmatch(text.strip())
    if form is None:
        raise InputError(f"an identity reads name[key=value; ...], but this is {text!r}")
    stated = dict(part.strip().partition("=")[::2] for part in form["parts"].split(";"))
    n, of = _whole_numbers(stated.pop("n", ""), text)
    fields: dict[str, Any] = {}
    for key, value in stated.items():
        if key not in _READERS:
            raise InputError(f"an identity has no {key!r}; known: {', '.join(_READERS)}: {text}")
        try:
            fields |= _READERS[key](value)
        except (ValueError, KeyError):
            raise InputError(f"an identity's {key} can't be {value!r}: {text}") from None
    return Identity(form["metric"], ScoreSettings(**fields), n, of)


def _own_parts(metric: str, s: ScoreSettings) -> list[str]:
    """What concerns this kind of metric only."""
    family = metric.partition(".")[0]
    if family == "rpe" and s.rpe_rule == "tartanair":
        return ["pairs=all/gt", "rule=tartanair"]
    if family == "rpe":
        rule = [] if s.rpe_rule == _DEFAULTS.rpe_rule else [f"rule={s.rpe_rule}"]
        pairs = f"pairs={_PAIRS[s.rpe_all_pairs]}/{s.rpe_pairs_from}"
        return [f"delta={_number(s.rpe_delta)}{s.rpe_unit}", pairs, *rule]
    if family in ("kitti", "scale"):
        lengths = ",".join(map(_number, s.segment_lengths_m or ()))
        precision = [] if s.segment_precision == _DEFAULTS.segment_precision else [f"precision={s.segment_precision}"]
        mean = [] if s.segment_mean == _DEFAULTS.segment_mean else [f"mean={s.segment_mean}"]
        return [f"lengths={lengths}m", f"step={s.segment_step_frames}", *precision, *mean]
    if family == "rel":
        return [f"lengths={s.relative_rule}"]
    if family == "lost":
        return [f"fail={_number(s.fail_ratio)}", f"slots={s.coverage_of}"]
    return []


def _shared_parts(s: ScoreSettings) -> list[str]:
    first = "" if s.align_n is None else f"/first{s.align_n}"
    offset = [f"offset={_ms(s.offset_ns)}ms"] if s.offset_ns else []
    scale = [] if s.scale_rule == _DEFAULTS.scale_rule else [f"scale={s.scale_rule}"]
    project = [f"project={s.project}"] if s.project else []
    ddof = [f"ddof={s.std_ddof}"] if s.std_ddof else []
    assoc = f"assoc={s.association}<={_ms(s.max_diff_ns)}ms"
    return [f"align={s.alignment}{first}", *scale, *project, assoc, *offset, *ddof]


def _number(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def _ms(t_ns: int) -> str:
    """Nanoseconds as milliseconds, exactly."""
    whole, part = divmod(abs(t_ns), NS_PER_MS)
    return f"{'-' if t_ns < 0 else ''}{whole}.{part:06d}".rstrip("0").rstrip(".")


def _ns(ms: str) -> int:
    sign = -1 if ms.startswith("-") else 1
    whole, _, part = ms.removesuffix("ms").lstrip("-").partition(".")
    return sign * (int(whole) * NS_PER_MS + int(part.ljust(6, "0")))


def _whole_numbers(value: str, text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)/(\d+)", value)
    if found is None:
        raise InputError(f"an identity ends in n=<matched>/<poses>, but this is {text!r}")
    return int(found[1]), int(found[2])


def _read_align(value: str) -> dict[str, Any]:
    kind, _, first = value.partition("/first")
    return {"alignment": kind, "align_n": int(first) if first else None}


def _read_assoc(value: str) -> dict[str, Any]:
    method, _, window = value.partition("<=")
    return {"association": method, "max_diff_ns": _ns(window)}


def _read_pairs(value: str) -> dict[str, Any]:
    how, _, side = value.partition("/")
    all_pairs = {name: flag for flag, name in _PAIRS.items()}[how]
    return {"rpe_all_pairs": all_pairs, "rpe_pairs_from": side}


def _read_lengths(value: str) -> dict[str, Any]:
    if not value.endswith("m"):
        return {"relative_rule": value}
    return {"segment_lengths_m": tuple(float(length) for length in value.removesuffix("m").split(","))}


_READERS: Mapping[str, Callable[[str], dict[str, Any]]] = {
    "align": _read_align,
    "assoc": _read_assoc,
    "offset": lambda value: {"offset_ns": _ns(value)},
    "scale": lambda value: {"scale_rule": value},
    "project": lambda value: {"project": value},
    "ddof": lambda value: {"std_ddof": int(value)},
    "delta": lambda value: {"rpe_delta": float(value[:-1]), "rpe_unit": value[-1:]},
    "pairs": _read_pairs,
    "rule": lambda value: {"rpe_rule": value},
    "lengths": _read_lengths,
    "step": lambda value: {"segment_step_frames": int(value)},
    "precision": lambda value: {"segment_precision": value},
    "mean": lambda value: {"segment_mean": value},
    "fail": lambda value: {"fail_ratio": float(value)},
    "slots": lambda value: {"coverage_of": value},
}


POSES = ("alignment", "align_n", "scale_rule", "project", "association", "max_diff_ns", "offset_ns")
MOTIONS = ("rpe_delta", "rpe_unit", "rpe_all_pairs", "rpe_pairs_from", "rpe_rule", *POSES)
SEGMENTS = ("segment_lengths_m", "segment_step_frames", "segment_precision", "segment_mean", *POSES)
RELATIVE = ("relative_rule", *POSES)
TIMES = ("coverage_of", "association", "max_diff_ns", "offset_ns")

STURM_ATE, STURM_RPE = "Sturm et al. (2012), section V-B", "Sturm et al. (2012), section V-A"
ZHANG = "Zhang and Scaramuzza (2018), section IV"
GEIGER = "Geiger et al. (2012), section 3.2, and its development kit"
OURS = "this project"

HARTLEY = "Hartley et al. (2013), section 4.3; evo's rot_part"
STRASDAT = "Strasdat et al. (2010), section II, as a ratio of distances"
DRIFT = "where along the path an error was made: one early turn moves everything after it"
LOST = "frames without a pose: read coverage beside it"
ALL_PAIRS = "; like tartanair over all ordered pairs i, j, of which its own script draws 10,000 at random"
GLOBAL = "a slow drift that stays below the size of a step"


@dataclass(frozen=True, slots=True)
class MetricDefinition:
    """One metric: the settings that change it, what it is blind to, the statistic to quote, if only --full has it."""

    id: str
    title: str
    unit: str
    formula: str
    source: str
    settings: tuple[str, ...]
    blind: str
    headline: str = "rmse"
    full: bool = True

    @property
    def identity(self) -> str:
        """How the ids of its numbers begin: family.rest."""
        return self.id.replace("_", ".", 1)


_ALL = (
    MetricDefinition(
        "ate_trans",
        "absolute trajectory error, position",
        "m",
        "‖p_est − p_gt‖ of each aligned pose",
        STURM_ATE,
        POSES,
        f"{DRIFT}; {LOST}",
        full=False,
    ),
    MetricDefinition(
        "ate_rot",
        "absolute trajectory error, angle",
        "deg",
        "angle of R_est⁻¹ R_gt of each aligned pose",
        STURM_ATE,
        POSES,
        f"a roll that the alignment had to guess: read alignment.unobservable; {LOST}",
        full=False,
    ),
    MetricDefinition(
        "ate_rot_chordal",
        "absolute trajectory error, rotation as a matrix",
        "1",
        "‖R_est⁻¹ R_gt − I‖_F = 2√2 sin(angle / 2)",
        HARTLEY,
        POSES,
        f"the same as ate_rot on another scale; {LOST}",
    ),
    MetricDefinition(
        "ate_full",
        "absolute trajectory error, whole pose",
        "1",
        "‖T_est⁻¹ T_gt − I‖_F",
        "evo's full",
        POSES,
        f"metres and rotations are added: it changes with the unit of length; {LOST}",
    ),
    *(
        MetricDefinition(
            f"ate_{axis}",
            f"absolute trajectory error along the truth's {axis}",
            "m",
            f"{axis} of p_est − p_gt, with its sign",
            OURS,
            POSES,
            f"errors along the other axes; {LOST}",
        )
        for axis in ("x", "y", "z")
    ),
    *(
        MetricDefinition(
            f"ate_{axis}",
            f"absolute trajectory error in {axis}",
            "deg",
            f"{axis} of R_est R_gt⁻¹ = Rz(yaw) Ry(pitch) Rx(roll), with its sign",
            ZHANG,
            POSES,
            f"the angles of rotations near 90° of pitch, where roll and yaw are one; {LOST}",
        )
        for axis in ("roll", "pitch", "yaw")
    ),
    MetricDefinition(
        "rpe_trans",
        "relative pose error, translation",
        "m",
        f"‖t‖ of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        STURM_RPE,
        MOTIONS,
        GLOBAL,
        full=False,
    ),
    MetricDefinition(
        "rpe_rot",
        "relative pose error, angle",
        "deg",
        f"angle of (Q_i⁻¹ Q_j)⁻¹ (P_i⁻¹ P_j), Q true and P estimated{ALL_PAIRS}",
        STURM_RPE,
        MOTIONS,
        GLOBAL,
        full=False,
    ),
    MetricDefinition(
        "rpe_rot_chordal",
        "relative pose error, rotation as a matrix",
        "1",
        "‖R − I‖_F of the same E as rpe_rot",
        HARTLEY,
        MOTIONS,
        GLOBAL,
    ),
    MetricDefinition(
        "rpe_full",
        "relative pose error, whole motion",
        "1",
        "‖E − I‖_F",
        "evo's full",
        MOTIONS,
        f"metres and rotations are added: it changes with the unit of length; {GLOBAL}",
    ),
    MetricDefinition(
        "rpe_point",
        "difference of the distances moved",
        "m",
        "| ‖q_j − q_i‖ − ‖p_j − p_i‖ |",
        "evo's point_distance",
        MOTIONS,
        "every direction: a motion of the right length to the wrong side has no error",
    ),
    MetricDefinition(
        "rpe_point_percent",
        "difference of the distances moved, of the true one",
        "%",
        "100 | ‖q_j − q_i‖ − ‖p_j − p_i‖ | / ‖q_j − q_i‖, pairs where the truth stood still left out",
        "evo's point_distance_error_ratio",
        MOTIONS,
        "every direction, and drift while the truth stands still",
    ),
    MetricDefinition(
        "kitti_t_rel",
        "translation drift per metre of path",
        "1",
        "‖t‖ of (T_est,ij)⁻¹ T_gt,ij / length, j the first frame further than the length along the true path",
        GEIGER,
        SEGMENTS,
        "jitter: it is small against segments of a hundred metres",
        headline="mean",
        full=False,
    ),
    MetricDefinition(
        "kitti_r_rel",
        "rotation drift per metre of path",
        "deg/m",
        "angle of (T_est,ij)⁻¹ T_gt,ij / length, segments as of kitti_t_rel",
        GEIGER,
        SEGMENTS,
        "jitter, and errors that turn back within a segment",
        headline="mean",
        full=False,
    ),
    MetricDefinition(
        "rel_trans",
        "translation error over parts of the path",
        "m",
        "‖t‖ of (T_gt,ij)⁻¹ T_est,ij, j nearest to the length along the true path",
        ZHANG,
        RELATIVE,
        "lengths are mixed: the longest decide",
    ),
    MetricDefinition(
        "rel_trans_percent",
        "translation error over parts of the path, of their length",
        "%",
        "100 ‖t‖ / length of the same parts",
        ZHANG,
        RELATIVE,
        "jitter on long parts",
        headline="mean",
    ),
    MetricDefinition(
        "rel_rot",
        "angle error over parts of the path",
        "deg",
        "angle of (T_gt,ij)⁻¹ T_est,ij",
        ZHANG,
        RELATIVE,
        "lengths are mixed: the longest decide",
    ),
    MetricDefinition(
        "rel_rot_per_m",
        "angle error over parts of the path, per metre",
        "deg/m",
        "angle / length of the same parts",
        ZHANG,
        RELATIVE,
        "jitter on long parts",
        headline="mean",
    ),
    MetricDefinition(
        "rel_yaw",
        "yaw error over parts of the path: the turn about gravity that inertia can't see",
        "deg",
        "|yaw| of the error turned into the world: R_est,j R_E R_est,j⁻¹ = Rz(yaw) Ry(pitch) Rx(roll); "
        "rpg's is the estimate's own world, openvins' the truth's",
        ZHANG,
        RELATIVE,
        "gravity is the z of the world: another vertical mixes it with rel_gravity",
    ),
    MetricDefinition(
        "rel_gravity",
        "tilt error over parts of the path: the turn against gravity that inertia sees",
        "deg",
        "√(pitch² + roll²) of the same rotation as rel_yaw",
        ZHANG,
        RELATIVE,
        "gravity is the z of the world: another vertical mixes it with rel_yaw",
    ),
    MetricDefinition(
        "scale_error",
        "scale error of the segments",
        "1",
        "‖p_j − p_i‖ / ‖q_j − q_i‖ − 1 of the segments of kitti_t_rel, with its sign",
        STRASDAT,
        SEGMENTS,
        "scale where a segment ends near where it began; an alignment with scale has taken the mean out",
        headline="mean",
    ),
    MetricDefinition(
        "scale_drift",
        "drift of the scale per metre of path",
        "1/m",
        "slope by least squares of log(1 + scale_error) over the true path, one number",
        STRASDAT,
        SEGMENTS,
        "a scale that goes up and comes down again",
        headline="mean",
    ),
    *(
        MetricDefinition(
            name,
            title,
            "1",
            f"{error}ᵀ P⁻¹ {error} of each pose, P the covariance that the estimator states",
            "Bar-Shalom et al. (2001), section 5.4",
            POSES,
            f"the size of the error: a large one that was announced is consistent; honest ones give {dof} on average",
            headline="mean",
        )
        for name, title, error, dof in (
            ("nees_pose", "consistency of the stated covariance", "e", "6"),
            ("nees_trans", "consistency of the stated covariance, position", "e_p", "3"),
            ("nees_rot", "consistency of the stated covariance, orientation", "e_R", "3"),
        )
    ),
    MetricDefinition(
        "coverage",
        "share of the recording with a pose",
        "1",
        "slots with a pose / slots; a slot is a true pose, or 0.2 s of truth with more than 33 poses a second",
        OURS,
        TIMES,
        "whether the poses are right",
        headline="ratio",
        full=False,
    ),
    MetricDefinition(
        "lost_aware",
        "accuracy with lost counted as failed, 1 best and 0 worst",
        "1",
        "A/2 of a failed run, 1/2 + A/2 of a survivor; A: mean of 1 − e / (fail_ratio · path), cut at 0, lost slots 0",
        OURS,
        ("fail_ratio", *TIMES, *POSES),
        "differences beyond fail_ratio of the path: all of them are failures",
        headline="score",
        full=False,
    ),
)
DEFINITIONS: dict[str, MetricDefinition] = {definition.id: definition for definition in _ALL}
