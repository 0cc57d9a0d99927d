"""All metrics, and the identity of a number: the metric and every setting that shaped it."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from vobench.errors import InputError
from vobench.metric import ate, coverage, nees, rpe, scale, segment
from vobench.metric.comparison import DEFAULTS, MetricDefinition
from vobench.metric.settings import ScoreSettings

ROOM = (ate, rpe, segment, scale, nees, coverage)
DEFINITIONS: dict[str, MetricDefinition] = {metric.id: metric for family in ROOM for metric in family.METRICS}

NS_PER_MS = 10**6
_FORM = re.compile(r"(?P<metric>[a-z0-9_.]+)\[(?P<parts>[^\[\]]*)\]")
_PAIRS = {False: "consecutive", True: "all"}


@dataclass(frozen=True, slots=True)
class Part:
    """One `key=value` of an identity, said where one of its settings changes the metric; none for every metric.

    `write` gives None where there is nothing to say, `read` the settings back.
    """

    key: str
    settings: tuple[str, ...]
    write: Callable[[ScoreSettings], str | None]
    read: Callable[[str], dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Identity:
    """What an id says: the metric and statistic, its settings (the others default), and n of how many."""

    metric: str
    settings: ScoreSettings
    n: int
    of: int


def identity(metric: MetricDefinition, settings: ScoreSettings, *, n: int, of: int) -> str:
    """The id of a metric's number, such as `ate.trans.rmse[align=se3; ...]`."""
    concern = [part for part in PARTS if not part.settings or set(part.settings) & set(metric.settings)]
    said = [f"{part.key}={value}" for part in concern if (value := part.write(settings)) is not None]
    return f"{metric.identity}.{metric.headline}[{'; '.join([*said, f'n={n}/{of}'])}]"


def parse_identity(text: str) -> Identity:
    """Read an id back. Raises InputError naming what it can't read."""
    form = _FORM.fullmatch(text.strip())
    if form is None:
        raise InputError(f"an identity reads name[key=value; ...], but this is {text!r}")
    stated = dict(part.strip().partition("=")[::2] for part in form["parts"].split(";"))
    count = re.fullmatch(r"(\d+)/(\d+)", stated.pop("n", ""))
    if count is None:
        raise InputError(f"an identity ends in n=<matched>/<poses>, but this is {text!r}")
    fields: dict[str, Any] = {}
    for key, value in stated.items():
        if key not in READERS:
            raise InputError(f"an identity has no {key!r}; known: {', '.join(READERS)}: {text}")
        try:
            fields |= READERS[key](value)
        except (ValueError, KeyError):
            raise InputError(f"an identity's {key} can't be {value!r}: {text}") from None
    return Identity(form["metric"], ScoreSettings(**fields), int(count[1]), int(count[2]))


def _number(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def _ms(t_ns: int) -> str:
    """Nanoseconds as milliseconds, exactly."""
    whole, part = divmod(abs(t_ns), NS_PER_MS)
    return f"{'-' if t_ns < 0 else ''}{whole}.{part:06d}".rstrip("0").rstrip(".") + "ms"


def _ns(ms: str) -> int:
    sign = -1 if ms.startswith("-") else 1
    whole, _, part = ms.removesuffix("ms").lstrip("-").partition(".")
    return sign * (int(whole) * NS_PER_MS + int(part.ljust(6, "0")))


def _align(s: ScoreSettings) -> str:
    return s.alignment if s.align_n is None else f"{s.alignment}/first{s.align_n}"


def _read_align(value: str) -> dict[str, Any]:
    kind, _, first = value.partition("/first")
    return {"alignment": kind, "align_n": int(first) if first else None}


def _read_assoc(value: str) -> dict[str, Any]:
    method, _, window = value.partition("<=")
    return {"association": method, "max_diff_ns": _ns(window)}


def _read_offset(value: str) -> dict[str, Any]:
    return {"offset_ns": _ns(value)}


def _read_pairs(value: str) -> dict[str, Any]:
    how, _, side = value.partition("/")
    all_pairs = {name: flag for flag, name in _PAIRS.items()}[how]
    return {"rpe_all_pairs": all_pairs, "rpe_pairs_from": side}


def _read_lengths(value: str) -> dict[str, Any]:
    if not value.endswith("m"):
        return {"relative_rule": value}
    return {"segment_lengths_m": tuple(float(length) for length in value.removesuffix("m").split(","))}


def _unless_default(key: str, setting: str) -> Part:
    def write(s: ScoreSettings) -> str | None:
        value = getattr(s, setting)
        return None if value == getattr(DEFAULTS, setting) else str(value)

    return Part(key, (setting,), write, lambda value: {setting: value})


PARTS = (
    Part(
        "delta",
        ("rpe_delta",),
        lambda s: None if s.rpe_rule == "tartanair" else f"{_number(s.rpe_delta)}{s.rpe_unit}",
        lambda value: {"rpe_delta": float(value[:-1]), "rpe_unit": value[-1:]},
    ),
    Part("pairs", ("rpe_all_pairs",), lambda s: f"{_PAIRS[s.rpe_all_pairs]}/{s.rpe_pairs_from}", _read_pairs),
    _unless_default("rule", "rpe_rule"),
    Part(
        "lengths",
        ("segment_lengths_m",),
        lambda s: f"{','.join(map(_number, s.segment_lengths_m or ()))}m",
        _read_lengths,
    ),
    Part(
        "step",
        ("segment_step_frames",),
        lambda s: str(s.segment_step_frames),
        lambda value: {"segment_step_frames": int(value)},
    ),
    _unless_default("precision", "segment_precision"),
    _unless_default("mean", "segment_mean"),
    Part("lengths", ("relative_rule",), lambda s: s.relative_rule, _read_lengths),
    Part("fail", ("fail_ratio",), lambda s: _number(s.fail_ratio), lambda value: {"fail_ratio": float(value)}),
    Part("slots", ("coverage_of",), lambda s: s.coverage_of, lambda value: {"coverage_of": value}),
    Part("align", ("alignment",), _align, _read_align),
    _unless_default("scale", "scale_rule"),
    _unless_default("project", "project"),
    Part("assoc", ("association",), lambda s: f"{s.association}<={_ms(s.max_diff_ns)}", _read_assoc),
    Part(
        "offset", ("offset_ns",), lambda s: _ms(s.offset_ns) if s.offset_ns else None, lambda v: {"offset_ns": _ns(v)}
    ),
    Part("ddof", (), lambda s: str(s.std_ddof) if s.std_ddof else None, lambda value: {"std_ddof": int(value)}),
)
READERS = {part.key: part.read for part in PARTS}
