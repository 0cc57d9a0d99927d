"""A number's identity: the metric and every setting that shaped it, as text that reads back.

Such as `ate.trans.rmse[align=se3; assoc=nearest<=10ms; n=785/798]`. Equal ids may be compared.
"""

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
