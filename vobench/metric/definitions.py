"""All metrics, and the identity of a number: the metric and every setting that shaped it."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from vobench.errors import InputError
from vobench.metric import ate, coverage, nees, rpe, segment
from vobench.metric.comparison import DEFAULTS, MetricDefinition
from vobench.metric.settings import ScoreSettings

ROOM = (ate, rpe, segment, nees, coverage)
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


def _read_pairs(value: str) -> dict[str, Any]:
    how, _, side = value.partition("/")
    all_pairs = {name: flag for flag, name in _PAIRS.items()}[how]
    return {"rpe_all_pairs": all_pairs, "rpe_pairs_from": side}


def _read_lengths(value: str) -> dict[str, Any]:
    if not value.endswith("m"):
        return {"relative_rule": value}
    return {"segment_lengths_m": tuple(float(length) for length in value.removesuffix("m").split(","))}


def _stated(
    key: str,
    setting: str,
    read: Callable[[str], Any] = str,
    write: Callable[[Any], str] = str,
    *,
    always: bool = False,
) -> Part:
    """The part of one setting, said where it differs from the default, or always."""

    def written(s: ScoreSettings) -> str | None:
        value = getattr(s, setting)
        return write(value) if always or value != getattr(DEFAULTS, setting) else None

    return Part(key, (setting,), written, lambda value: {setting: read(value)})


PARTS = (
    Part(
        "delta",
        ("rpe_delta",),
        lambda s: None if s.rpe_rule == "tartanair" else f"{_number(s.rpe_delta)}{s.rpe_unit}",
        lambda value: {"rpe_delta": float(value[:-1]), "rpe_unit": value[-1:]},
    ),
    Part("pairs", ("rpe_all_pairs",), lambda s: f"{_PAIRS[s.rpe_all_pairs]}/{s.rpe_pairs_from}", _read_pairs),
    _stated("rule", "rpe_rule"),
    Part(
        "lengths",
        ("segment_lengths_m",),
        lambda s: f"{','.join(map(_number, s.segment_lengths_m or ()))}m",
        _read_lengths,
    ),
    _stated("step", "segment_step_frames", int, always=True),
    _stated("precision", "segment_precision"),
    _stated("mean", "segment_mean"),
    Part("lengths", ("relative_rule",), lambda s: s.relative_rule, _read_lengths),
    _stated("fail", "fail_ratio", float, _number, always=True),
    _stated("slots", "coverage_of", always=True),
    Part("align", ("alignment",), _align, _read_align),
    _stated("scale", "scale_rule"),
    _stated("project", "project"),
    Part("assoc", ("association",), lambda s: f"{s.association}<={_ms(s.max_diff_ns)}", _read_assoc),
    _stated("offset", "offset_ns", _ns, _ms),
    Part("ddof", (), lambda s: str(s.std_ddof) if s.std_ddof else None, lambda value: {"std_ddof": int(value)}),
)
READERS = {part.key: part.read for part in PARTS}
