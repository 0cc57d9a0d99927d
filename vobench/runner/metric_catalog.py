"""The metrics of vobench and of installed distributions."""

from importlib.metadata import EntryPoint, entry_points

from vobench.errors import InputError, UnknownNameError, unknown_name_sentence
from vobench.metric.comparison import MetricDefinition
from vobench.metric.definitions import DEFINITIONS

GROUP = "vobench.metrics"  # the group of entry points, each of which is a MetricDefinition


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
    stem = name.partition("[")[0]
    without_statistic = stem.rpartition(".")[0]
    known = all_metrics()
    for definition in known:
        if definition.id == name.lower() or definition.identity in (stem, without_statistic):
            return definition
    raise UnknownNameError(unknown_name_sentence("metric", name, [definition.id for definition in known]))
