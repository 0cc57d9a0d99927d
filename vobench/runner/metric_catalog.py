"""The metrics of vobench and of installed distributions."""

from importlib.metadata import EntryPoint, entry_points

from vobench.errors import InputError, UnknownNameError, unknown_name_sentence
from vobench.metric.comparison import MetricDefinition
from vobench.metric.definitions import DEFINITIONS

GROUP = "vobench.metrics"  # the group of entry points that are MetricDefinitions


def all_metrics() -> tuple[MetricDefinition, ...]:
    """The definitions of vobench's metrics, then those of installed metrics with other ids.

    Raises InputError for an installed metric that does not load or is not a metric.
    """
    installed = [_load(point) for point in entry_points(group=GROUP)]
    others = [metric for metric in installed if metric.id not in DEFINITIONS]
    return (*DEFINITIONS.values(), *others)


def _load(point: EntryPoint) -> MetricDefinition:
    try:
        metric = point.load()
    except Exception as error:  # the code of a plugin may raise anything
        raise InputError(f"the metric {point.value} does not load ({type(error).__name__}: {error})") from error
    if not isinstance(metric, MetricDefinition):
        raise InputError(f"{point.value} should be a MetricDefinition, but is {type(metric).__name__}")
    return metric


def find_metric(name: str) -> MetricDefinition:
    """Find a metric by its name, or by the identity of a score, such as ate.trans.rmse[align=se3; ...].

    Raises UnknownNameError with the nearest name if there is none.
    """
    # ate.trans.rmse[align=se3] is the statistic rmse of the metric ate.trans with settings.
    identity, _, _ = name.partition("[")
    without_statistic, _, _ = identity.rpartition(".")
    known = all_metrics()
    for definition in known:
        has_id = definition.id == name.lower()
        has_identity = definition.identity in (identity, without_statistic)
        if has_id or has_identity:
            return definition
    raise UnknownNameError(unknown_name_sentence("metric", name, [definition.id for definition in known]))
