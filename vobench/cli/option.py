"""Options and arguments that several commands share, and groups of options.

An option group is a dataclass whose fields are options. A command that is decorated with `with_option_groups` takes
the group as one parameter:

    @option_group
    class TrialLimits:
        timeout: Annotated[float | None, typer.Option(help="...")] = None

    @with_option_groups
    def run_command(suite: SuiteName, *, limits: TrialLimits) -> None: ...
"""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, TypeVar, dataclass_transform, get_type_hints

import typer

Group = TypeVar("Group")

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
SuiteName = Annotated[str, typer.Argument(metavar="SUITE", help="The name of a suite, or the path of its YAML.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, envvar="VOBENCH_JOBS", help="The number of parallel tasks.")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="The folder of a run, or runs/<suite> for its latest.")]


def _trust_new_makers(is_given: bool) -> bool:
    if is_given:
        from vobench.trust import trust_new

        trust_new()
    return is_given


Trust = Annotated[
    bool,
    typer.Option(
        "--trust",
        help="Run scene makers from outside the working folder, and trust these versions of them from now on.",
        callback=_trust_new_makers,
    ),
]


@dataclass_transform(frozen_default=True, kw_only_default=True)
def option_group(cls: type[Group]) -> type[Group]:
    """Turn a class of options into a frozen dataclass."""
    return dataclass(frozen=True, slots=True, kw_only=True)(cls)


def with_option_groups(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command take option groups, although Typer knows only single options.

    Returns a function whose signature lists each option of the command's groups as a parameter of its own, for Typer to
    read. When called, it builds the groups from the values of these options and calls the command with them.
    """
    hints = get_type_hints(command, include_extras=True)
    group_classes = dict[str, type]()
    parameters = list[inspect.Parameter]()
    for parameter in inspect.signature(command).parameters.values():
        annotation = hints[parameter.name]
        if is_dataclass(annotation) and isinstance(annotation, type):
            group_classes[parameter.name] = annotation
            parameters += _option_parameters(annotation)
        else:
            parameters.append(parameter.replace(annotation=annotation))

    @wraps(command)
    def with_flat_options(**values: Any) -> None:
        for name, group_class in group_classes.items():
            options = {field.name: values.pop(field.name) for field in fields(group_class)}
            values[name] = group_class(**options)
        command(**values)

    with_flat_options.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    with_flat_options.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return with_flat_options


def _option_parameters(group_class: type) -> list[inspect.Parameter]:
    hints = get_type_hints(group_class, include_extras=True)
    parameters = list[inspect.Parameter]()
    for field in fields(group_class):
        parameters.append(
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=field.default,
                annotation=hints[field.name],
            )
        )
    return parameters


@option_group
class RerunOptions:
    """The options for running variants of a trial again."""

    estimator: Annotated[
        Path | None,
        typer.Option("--estimator", help="The folder of the estimator, if it cannot be found by its name."),
    ] = None
    out: Annotated[Path, typer.Option(help="The folder for the runs.")] = Path("runs")
    jobs: Jobs = 1
