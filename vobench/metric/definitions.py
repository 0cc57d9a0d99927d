"""All metrics, and the identity of a number: its metric and all settings that influenced it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from vobench.metric import ate, coverage, lost_aware, nees, part_error, rpe, segment
from vobench.metric.comparison import DEFAULTS, MetricDefinition
from vobench.metric.settings import ScoreSettings

FAMILIES = (ate, rpe, part_error, segment, nees, coverage, lost_aware)
METRICS = [metric for family in FAMILIES for metric in family.METRICS]
DEFINITIONS: dict[str, MetricDefinition] = {metric.id: metric for metric in METRICS}

NS_PER_MS = 10**6
_PAIRS = {False: "consecutive", True: "all"}


@dataclass(frozen=True, slots=True)
class IdentityPart:
    """One `key=value` of an identity. It is written for the metrics that depend on its settings, or for all metrics.

    `write` returns None if the part is omitted.
    """

    key: str
    settings: tuple[str, ...]
    write: Callable[[ScoreSettings], str | None]


def identity(
    metric: MetricDefinition,
    settings: ScoreSettings,
    *,
    n: int,
    of: int,
) -> str:
    """The id of a number, such as `ate.trans.rmse[align=se3; ...]`, with the number of poses that it is based on."""
    items = []
    for part in PARTS:
        is_relevant = not part.settings or set(part.settings) & set(metric.settings)
        value = part.write(settings) if is_relevant else None
        if value is not None:
            items.append(f"{part.key}={value}")
    items.append(f"n={n}/{of}")
    return f"{metric.identity}.{metric.headline}[{'; '.join(items)}]"


def _number(value: float) -> str:
    """The shortest text of a number. An integer has no decimal point."""
    return repr(float(value)).removesuffix(".0")


def _ms(t_ns: int) -> str:
    """Nanoseconds as milliseconds, exactly."""
    whole, fraction = divmod(abs(t_ns), NS_PER_MS)
    sign = "-" if t_ns < 0 else ""
    digits = f"{whole}.{fraction:06d}".rstrip("0").rstrip(".")
    return f"{sign}{digits}ms"


def _align(settings: ScoreSettings) -> str:
    if settings.align_n is None:
        return settings.alignment
    return f"{settings.alignment}/first{settings.align_n}"


def _delta(settings: ScoreSettings) -> str | None:
    if settings.rpe_rule == "tartanair":
        return None
    return f"{_number(settings.rpe_delta)}{settings.rpe_unit}"


def _pairs(settings: ScoreSettings) -> str:
    return f"{_PAIRS[settings.rpe_all_pairs]}/{settings.rpe_pairs_from}"


def _lengths(settings: ScoreSettings) -> str:
    lengths_m = settings.segment_lengths_m or ()
    return f"{','.join(map(_number, lengths_m))}m"


def _association(settings: ScoreSettings) -> str:
    return f"{settings.association}<={_ms(settings.max_diff_ns)}"


def _ddof(settings: ScoreSettings) -> str | None:
    return str(settings.std_ddof) if settings.std_ddof else None


def _setting_part(
    key: str,
    setting: str,
    write: Callable[[Any], str] = str,
    *,
    always: bool = False,
) -> IdentityPart:
    """The part of one setting. It is written if the value is not the default, or always."""

    def written(settings: ScoreSettings) -> str | None:
        value = getattr(settings, setting)
        is_default = value == getattr(DEFAULTS, setting)
        return None if is_default and not always else write(value)

    return IdentityPart(key, (setting,), written)


PARTS = (
    IdentityPart("delta", ("rpe_delta",), _delta),
    IdentityPart("pairs", ("rpe_all_pairs",), _pairs),
    _setting_part("rule", "rpe_rule"),
    IdentityPart("lengths", ("segment_lengths_m",), _lengths),
    _setting_part("step", "segment_step_frames", always=True),
    _setting_part("precision", "segment_precision"),
    _setting_part("mean", "segment_mean"),
    _setting_part("lengths", "relative_rule", always=True),
    _setting_part("fail", "fail_ratio", _number, always=True),
    _setting_part("slots", "coverage_of", always=True),
    IdentityPart("align", ("alignment",), _align),
    _setting_part("scale", "scale_rule"),
    _setting_part("project", "project"),
    IdentityPart("assoc", ("association",), _association),
    _setting_part("offset", "offset_ns", _ms),
    IdentityPart("ddof", (), _ddof),
)
