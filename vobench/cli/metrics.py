"""vobench metrics."""

from typing import Annotated, Any

import typer

from vobench.cli import terminal
from vobench.cli.option import Json

NAME_WIDTH = 9  # columns


def metrics_command(
    metric: Annotated[
        str | None, typer.Argument(metavar="[ID]", help="The id of a metric; all metrics if omitted.")
    ] = None,
    *,
    json: Json = False,
) -> None:
    """Define a metric: formula, source, settings, and what it does not measure."""
    from vobench.runner.metric_catalog import all_metrics, find_metric

    if metric is not None:
        _print_definition(find_metric(metric).as_dict(), as_json=json)
        return
    metrics = all_metrics()
    if json:
        terminal.print_json({"metrics": [definition.as_dict() for definition in metrics]})
        return
    rows = list[list[str]]()
    for definition in metrics:
        option = "--full" if definition.full else ""
        rows.append([definition.id, definition.unit, definition.headline, definition.title, option])
    terminal.console().print(terminal.table("", ["metric", "unit", "headline", "description", "option"], rows))


def _print_definition(definition: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        terminal.print_json(definition)
        return
    console = terminal.console()
    for name, value in definition.items():
        text = ", ".join(value) if isinstance(value, tuple) else str(value)
        console.print(f"{name:{NAME_WIDTH}}  {text}", soft_wrap=True)
