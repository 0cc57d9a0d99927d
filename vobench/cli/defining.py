"""vobench metrics."""

from dataclasses import asdict

from vobench.catalog.catalog import unknown
from vobench.cli import terminal
from vobench.errors import UnknownNameError
from vobench.metric.definitions import DEFINITIONS, MetricDefinition


def show(metric: str | None, *, as_json: bool) -> None:
    """Print every metric in a line, or all there is to say of one; ids of scores are taken as well."""
    if metric is None:
        _show_all(as_json=as_json)
        return
    found = _find(metric)
    if as_json:
        terminal.print_json(asdict(found))
        return
    out = terminal.console()
    for name, value in asdict(found).items():
        stated = ", ".join(value) if isinstance(value, tuple) else str(value)
        out.print(f"{name:9}  {stated}", soft_wrap=True)


def _show_all(*, as_json: bool) -> None:
    definitions = list(DEFINITIONS.values())
    if as_json:
        terminal.print_json({"metrics": [asdict(definition) for definition in definitions]})
        return
    rows = [[d.id, d.unit, d.headline, d.title, "--full" if d.full else ""] for d in definitions]
    terminal.console().print(terminal.table("", ["metric", "unit", "headline", "is", "with"], rows))


def _find(metric: str) -> MetricDefinition:
    """The definition of a metric's name, or of the start of an id such as ate.trans.rmse[…]."""
    if metric.lower() in DEFINITIONS:
        return DEFINITIONS[metric.lower()]
    stem = metric.partition("[")[0]
    for definition in DEFINITIONS.values():
        if definition.identity in (stem, stem.rpartition(".")[0]):
            return definition
    raise UnknownNameError(unknown("metric", metric, list(DEFINITIONS)))
