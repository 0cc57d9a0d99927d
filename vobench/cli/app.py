"""The entry point of the command line: it imports the command that is called, and reports errors."""

import json as json_module
import os
import re
import sys
from dataclasses import asdict
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from vobench import stop
from vobench.cli.terminal import warn
from vobench.errors import InputError, SuiteError, VobenchError
from vobench.trust import gate

# The module and function of each command. The first line of the function's docstring is the summary of the command.
# Installed distributions can add commands as entry points of GROUP.
VERBS = {
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
    "new": "vobench.cli.new:new_command",
    "try": "vobench.cli.try_estimator:try_command",
    "metrics": "vobench.cli.metrics:metrics_command",
    "import": "vobench.cli.sequence:import_command",
    "export": "vobench.cli.sequence:export_command",
    "info": "vobench.cli.info:info_command",
    "realism": "vobench.cli.realism:realism_command",
    "twin": "vobench.cli.twin:twin_command",
    "verify": "vobench.cli.verify:verify_command",
    "report": "vobench.cli.report:report_command",
    "compare": "vobench.cli.compare:compare_command",
    "bundle": "vobench.cli.bundle:bundle_command",
    "view": "vobench.cli.view:view_command",
    "causes": "vobench.cli.causes:causes_command",
    "explain": "vobench.cli.failure:explain_command",
    "shrink": "vobench.cli.failure:shrink_command",
    "cache": "vobench.cli.cache:cache_command",
    "doctor": "vobench.cli.doctor:doctor_command",
}
GROUP = "vobench.commands"


class Verbs(TyperGroup):
    """The group of all commands. A command's module is imported only when the command is called."""

    def list_commands(self, _: Any) -> list[str]:
        """The names of vobench's commands, followed by those of installed commands."""
        return list(_targets())

    def get_command(self, _: Any, cmd_name: str) -> Any:
        """The command with the given name; None if there is none."""
        target = VERBS.get(cmd_name) or _installed_commands().get(cmd_name)
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
            formatter.write_dl([(name, _summary(target)) for name, target in _targets().items()])


def _targets() -> dict[str, str]:
    """The targets (module:function) of all commands: those of VERBS, then those of installed commands, sorted."""
    installed = _installed_commands()
    names = sorted(installed.keys() - VERBS.keys())
    return {**VERBS, **{name: installed[name] for name in names}}


def _installed_commands() -> dict[str, str]:
    """The targets (module:function) of the commands of installed distributions."""
    from importlib.metadata import entry_points

    return {point.name: point.value for point in entry_points(group=GROUP)}


def _summary(target: str) -> str:
    """The first line of a command's docstring.

    It is read from the source, because importing all commands takes seconds.
    """
    module_name, _, function_name = target.partition(":")
    try:
        spec = find_spec(module_name)
    except Exception as error:  # find_spec imports the package of an installed command, which may raise anything
        return f"cannot be imported: {_sentence(error)}"
    if spec is None:
        return f"cannot be imported: No module named '{module_name}'"
    source = Path(spec.origin).read_text(encoding="utf-8") if spec.origin else ""
    first_line_of_docstring = rf'^def {function_name}\(.*?"""(.+?)(?:\n|""")'
    match = re.search(first_line_of_docstring, source, re.MULTILINE | re.DOTALL)
    return match[1] if match else ""


SUMMARY = "Simulate, run and score visual odometry, and find out why it fails."
app = typer.Typer(
    name="vobench",
    cls=Verbs,
    help=SUMMARY,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

DEBUG = "--debug"


def run() -> None:
    """Run a command. An error that the user can correct is printed as one line, and the exit code is 1."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.reconfigure(errors="replace")  # a terminal that cannot show ° shows ?
    try:
        _call_command()
    except SystemExit as end:
        if not isinstance(end.__context__, BrokenPipeError):
            raise
        _discard_output()  # a reader that stops early, such as `head`, is not an error
    except (VobenchError, OSError) as error:
        stop.check()  # a request to stop may have caused the error
        _fail(_sentence(error), error)


def _call_command() -> None:
    """Call the command that the arguments name, and flush its output. Always raises SystemExit or an error."""
    try:
        with gate(warn, ours=_trusted_folders, folder=_trusted_hashes):
            # --debug is accepted before and after the command.
            words = [word for word in sys.argv[1:] if word != DEBUG]
            app(words, prog_name=app.info.name)
    finally:
        _flush_output()


def _flush_output() -> None:
    """Flush standard output now, because an error while the interpreter exits would print a traceback.

    Raises InputError if the output cannot be written, for example to a full disk. A closed pipe is not an error.
    """
    if sys.stdout is None:  # the shell closed it, as with >&-
        return
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _discard_output()
    except OSError as error:
        _discard_output()
        raise InputError(f"standard output cannot be written: {error.strerror}") from error


def _trusted_folders() -> tuple[Path, ...]:
    """The folders in which scene makers may run without --trust."""
    from vobench.suite.catalog import builtin_root

    return builtin_root(), Path.cwd()


def _trusted_hashes() -> Path:
    """The folder that holds the hashes of the scene makers that the user trusts."""
    from vobench.runner.key import cache_folder

    return cache_folder() / "state" / "trusted"


def _discard_output() -> None:
    """Redirect standard output to the null device, so that the rest of the output is discarded."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sentence(error: BaseException) -> str:
    """The message of an error as one line. An error of the operating system includes the file's name."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.strerror}: {error.filename}"
    if isinstance(error, SuiteError) and len(error.mistakes) > 1:
        more_count = len(error.mistakes) - 1
        noun = "mistake" if more_count == 1 else "mistakes"
        return f"{error.mistakes[0]} (and {more_count} more {noun})"
    return " ".join(str(error).split())


def _fail(sentence: str, error: BaseException) -> None:
    """Print an error and exit with code 1. With --debug, raise the error instead."""
    if DEBUG in sys.argv:
        raise error
    if "--json" in sys.argv:
        content = {"error": sentence, **_mistakes(error)}
        _print_error(json_module.dumps(content, ensure_ascii=False))
    lines = str(error).splitlines() if isinstance(error, SuiteError) else [sentence]
    for line in lines:
        warn(line)
    raise SystemExit(1) from None


def _print_error(text: str) -> None:
    """Print an error to standard output. A failure is ignored, because standard error gets the same error."""
    try:
        print(text, flush=True)
    except OSError:
        _discard_output()


def _mistakes(error: BaseException) -> dict[str, Any]:
    """The mistakes in a YAML file for the JSON output: for each, its place, the value there, and a sentence.

    `asked_by` lists the places in other files that refer to the file.
    """
    if not isinstance(error, SuiteError):
        return {}
    rows: list[dict[str, Any]] = []
    for mistake in error.mistakes:
        place: dict[str, Any] = dict.fromkeys(("file", "line", "column", "key", "value"))
        if mistake.places:
            place = asdict(mistake.places[-1])
        naming_places = [str(outer) for outer in mistake.places[:-1]]
        rows.append({**place, "sentence": mistake.sentence, "asked_by": naming_places})
    return {"mistakes": rows}


def _print_version(is_requested: bool) -> None:
    if is_requested:
        from vobench import __version__

        print(__version__)
        raise typer.Exit


@app.callback()
def common(
    *,
    debug: Annotated[bool, typer.Option(DEBUG, help="Show a traceback instead of one line.")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Define the options that every command has."""
    del debug, version  # _fail looks for --debug in sys.argv, and _print_version handles --version
