"""The commands of `vobench`, each imported only when it is called."""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from vobench.cli.error_report import error_line

# The module and function of each command. The first line of the function's docstring is the summary of the command.
COMMANDS = {
    "run": "vobench.cli.run:run_command",
    "check": "vobench.cli.check:check_command",
    "drive": "vobench.cli.drive:drive_command",
    "identify": "vobench.cli.identify:identify_command",
    "render": "vobench.cli.render:render_command",
    "scene": "vobench.cli.scene:scene_command",
    "list": "vobench.cli.list:list_command",
    "schema": "vobench.cli.schema:schema_command",
    "score": "vobench.cli.score:score_command",
    "diagnose": "vobench.cli.diagnose:diagnose_command",
    "convert": "vobench.cli.convert:convert_command",
    "new": "vobench.cli.new:new_command",
    "try": "vobench.cli.try_estimator:try_command",
    "metrics": "vobench.cli.metrics:metrics_command",
    "import": "vobench.cli.import_export:import_command",
    "export": "vobench.cli.import_export:export_command",
    "info": "vobench.cli.info:info_command",
    "realism": "vobench.cli.realism:realism_command",
    "twin": "vobench.cli.twin:twin_command",
    "verify": "vobench.cli.verify:verify_command",
    "report": "vobench.cli.report:report_command",
    "leaderboard": "vobench.cli.leaderboard:leaderboard_command",
    "compare": "vobench.cli.compare:compare_command",
    "plot": "vobench.cli.plot:plot_command",
    "bundle": "vobench.cli.bundle:bundle_command",
    "view": "vobench.cli.view:view_command",
    "causes": "vobench.cli.causes:causes_command",
    "explain": "vobench.cli.failure:explain_command",
    "shrink": "vobench.cli.failure:shrink_command",
    "cache": "vobench.cli.cache:cache_command",
    "doctor": "vobench.cli.doctor:doctor_command",
}
ENTRY_POINT_GROUP = "vobench.commands"  # installed distributions can add commands as entry points of this group


class CommandGroup(TyperGroup):
    """The group of all commands. A command's module is imported only when the command is called."""

    def list_commands(self, _: Any) -> list[str]:
        """The names of vobench's commands, followed by those of installed commands."""
        return list(_targets())

    def get_command(self, _: Any, cmd_name: str) -> Any:
        """The command with the given name; None if there is none."""
        target = COMMANDS.get(cmd_name)
        if target is None:  # installed distributions are only searched if vobench has no command with this name
            target = _installed_commands().get(cmd_name)
        if target is None:
            return None
        module_name, _, function_name = target.partition(":")
        module = import_module(module_name)
        function = getattr(module, function_name)
        command_class = getattr(module, "COMMAND_CLASS", None)
        command_app = typer.Typer(add_completion=False, rich_markup_mode=None)
        command_app.command(cmd_name, cls=command_class)(function)
        return typer.main.get_command(command_app)

    def format_commands(self, _: Any, formatter: Any) -> None:
        """Write the name and summary of every command."""
        with formatter.section("Commands"):
            rows = [(name, _summary(target)) for name, target in _targets().items()]
            formatter.write_dl(rows)


def _targets() -> dict[str, str]:
    """The target (module:function) of each command: first COMMANDS, then installed commands in alphabetical order."""
    installed = _installed_commands()
    targets = dict(COMMANDS)
    for name in sorted(installed.keys() - COMMANDS.keys()):
        targets[name] = installed[name]
    return targets


def _installed_commands() -> dict[str, str]:
    """The targets (module:function) of the commands of installed distributions."""
    from importlib.metadata import entry_points

    return {entry_point.name: entry_point.value for entry_point in entry_points(group=ENTRY_POINT_GROUP)}


def _summary(target: str) -> str:
    """The first line of a command's docstring; empty if it has none.

    It is read from the source, because importing all commands takes seconds.
    """
    module_name, _, function_name = target.partition(":")
    try:
        spec = find_spec(module_name)
    except Exception as error:  # find_spec imports the package of an installed command, which may raise anything
        return f"cannot be imported: {error_line(error)}"
    if spec is None:
        return f"cannot be imported: No module named '{module_name}'"
    if spec.origin is None:
        return ""

    module = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    for statement in module.body:
        if isinstance(statement, ast.FunctionDef) and statement.name == function_name:
            docstring = ast.get_docstring(statement) or ""
            return docstring.partition("\n")[0]
    return ""
