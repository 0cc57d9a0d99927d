"""All metrics, and the identity of a number: the metric and every setting that shaped it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from vobench.metric import ate, coverage, nees, rpe, segment
from vobench.metric.comparison import DEFAULTS, MetricDefinition
from vobench.metric.settings import ScoreSettings

ROOM = (ate, rpe, segment, nees, coverage)
DEFINITIONS: dict[str, MetricDefinition] = {metric.id: metric for family in ROOM for metric in family.METRICS}

NS_PER_MS = 10**6
_PAIRS = {False: "consecutive", True: "all"}


@dataclass(frozen=True, slots=True)
class Part:
    """One `key=value` of an identity, said where one of its settings changes the metric; none for every metric.

    `write` gives None where there is nothing to say.
    """

    key: str
    settings: tuple[str, ...]
    write: Callable[[ScoreSettings], str | None]


def identity(metric: MetricDefinition, settings: ScoreSettings, *, n: int, of: int) -> str:
    """The id of a metric's number, such as `ate.trans.rmse[align=se3; ...]`."""
    concern = [part for part in PARTS if not part.settings or set(part.settings) & set(metric.settings)]
    said = [f"{part.key}={value}" for part in concern if (value := part.write(settings)) is not None]
    return f"{metric.identity}.{metric.headline}[{'; '.join([*said, f'n={n}/{of}'])}]"


def _number(value: float) -> str:
    return repr(float(value)).removesuffix(".0")


def _ms(t_ns: int) -> str:
    """Nanoseconds as milliseconds, exactly."""
    whole, part = divmod(abs(t_ns), NS_PER_MS)
    return f"{'-' if t_ns < 0 else ''}{whole}.{part:06d}".rstrip("0").rstrip(".") + "ms"


def _align(s: ScoreSettings) -> str:
    return s.alignment if s.align_n is None else f"{s.alignment}/first{s.align_n}"


def _stated(key: str, setting: str, write: Callable[[Any], str] = str, *, always: bool = False) -> Part:
    """The part of one setting, said where it differs from the default, or always."""

    def written(s: ScoreSettings) -> str | None:
        value = getattr(s, setting)
        return write(value) if always or value != getattr(DEFAULTS, setting) else None

    return Part(key, (setting,), written)


PARTS = (
    Part(
        "delta", ("rpe_delta",), lambda s: None if s.rpe_rule == "tartanair" else f"{_number(s.rpe_delta)}{s.rpe_unit}"
    ),
    Part("pairs", ("rpe_all_pairs",), lambda s: f"{_PAIRS[s.rpe_all_pairs]}/{s.rpe_pairs_from}"),
    _stated("rule", "rpe_rule"),
    Part("lengths", ("segment_lengths_m",), lambda s: f"{','.join(map(_number, s.segment_lengths_m or ()))}m"),
    _stated("step", "segment_step_frames", always=True),
    _stated("precision", "segment_precision"),
    _stated("mean", "segment_mean"),
    Part("lengths", ("relative_rule",), lambda s: s.relative_rule),
    _stated("fail", "fail_ratio", _number, always=True),
    _stated("slots", "coverage_of", always=True),
    Part("align", ("alignment",), _align),
    _stated("scale", "scale_rule"),
    _stated("project", "project"),
    Part("assoc", ("association",), lambda s: f"{s.association}<={_ms(s.max_diff_ns)}"),
    _stated("offset", "offset_ns", _ms),
    Part("ddof", (), lambda s: str(s.std_ddof) if s.std_ddof else None),
)
