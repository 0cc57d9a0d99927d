"""The verbs of vobench, each loaded when it is called; what goes wrong is said in one line."""

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
from vobench.errors import SuiteError, VobenchError, printable
from vobench.trust import gate

# Where each verb is: module and function; its first sentence is the verb's summary. Others are installed as entry
# points of the group below.
VERBS = {
    "run": "vobench.cli.run:run_command",
    "check": "vobench.cli.run:check_command",
    "drive": "vobench.cli.drive:drive_command",
    "identify": "vobench.cli.identify:identify_command",
    "render": "vobench.cli.render:render_command",
    "scene": "vobench.cli.scene:scene_command",
    "list": "vobench.cli.list:list_command",
    "schema": "vobench.cli.run:schema_command",
    "score": "vobench.cli.score:score_command",
    "diagnose": "vobench.cli.score:diagnose_command",
    "new": "vobench.cli.estimator:new_command",
    "try": "vobench.cli.estimator:try_command",
    "metrics": "vobench.cli.score:metrics_command",
    "import": "vobench.cli.sequence:import_command",
    "export": "vobench.cli.sequence:export_command",
    "info": "vobench.cli.sequence:info_command",
    "realism": "vobench.cli.realism:realism_command",
    "twin": "vobench.cli.twin:twin_command",
    "verify": "vobench.cli.report:verify_command",
    "report": "vobench.cli.report:report_command",
    "compare": "vobench.cli.report:compare_command",
    "bundle": "vobench.cli.report:bundle_command",
    "view": "vobench.cli.view:view_command",
    "causes": "vobench.cli.failure:causes_command",
    "explain": "vobench.cli.failure:explain_command",
    "shrink": "vobench.cli.failure:shrink_command",
    "cache": "vobench.cli.cache:cache_command",
    "doctor": "vobench.cli.doctor:doctor_command",
}
GROUP = "vobench.commands"


class Verbs(TyperGroup):
    """The verbs, of which only the one that is called is imported."""

    def list_commands(self, _: Any) -> list[str]:
        """Names of our own verbs, and of installed ones."""
        return [*VERBS, *sorted(_installed().keys() - VERBS.keys())]

    def get_command(self, _: Any, cmd_name: str) -> Any:
        """The verb of that name, None where there is none."""
        target = VERBS.get(cmd_name) or _installed().get(cmd_name)
        if target is None:
            return None
        module, _, function = target.partition(":")
        verb = typer.Typer(add_completion=False, rich_markup_mode=None)
        family = import_module(module)
        verb.command(cmd_name, cls=getattr(family, "COMMAND_CLASS", None))(getattr(family, function))
        return typer.main.get_command(verb)

    def format_commands(self, _: Any, formatter: Any) -> None:
        """Every verb with its summary."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, _summary(target)) for name, target in {**_installed(), **VERBS}.items()])


def _installed() -> dict[str, str]:
    from importlib.metadata import entry_points

    return {point.name: point.value for point in entry_points(group=GROUP)}


def _summary(target: str) -> str:
    """The first line about a verb, read off its source: importing them all would take seconds."""
    module, _, function = target.partition(":")
    spec = find_spec(module)
    source = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
    found = re.search(rf'^def {function}\(.*?"""(.+?)(?:\n|""")', source, re.MULTILINE | re.DOTALL)
    return found[1] if found else ""


app = typer.Typer(
    name="vobench",
    cls=Verbs,
    help="Simulate, run and score visual odometry, and see where it breaks.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

DEBUG = "--debug"


def run() -> None:
    """Run a command; a user's mistake or machine is one line and exit code 1."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.reconfigure(errors="replace")  # a terminal without ° gets a ? for it
    try:
        with gate(warn, ours=_ours, folder=_trusted):
            # Nobody remembers whether --debug goes before the command or after it.
            app([word for word in sys.argv[1:] if word != DEBUG], prog_name=app.info.name)
    except SystemExit as end:
        if not isinstance(end.__context__, BrokenPipeError):
            raise
        _hang_up()  # a reader that has seen enough is no failure
    except (VobenchError, OSError) as error:
        stop.check()  # then it may come of that
        _fail(_sentence(error), error)
    finally:
        try:  # now, not at exit, where a reader that has seen enough would make a traceback
            sys.stdout.flush()
        except BrokenPipeError:
            _hang_up()


def _ours() -> tuple[Path, ...]:
    """Below which folders makers run unasked."""
    from vobench.suite.catalog import builtin_root

    return builtin_root(), Path.cwd()


def _trusted() -> Path:
    """Where the hashes of makers are kept that the user trusts."""
    from vobench.runner.key import cache_folder

    return cache_folder() / "state" / "trusted"


def _hang_up() -> None:
    """Let what is still to be printed go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sentence(error: BaseException) -> str:
    """One line; the system's errors with what it is about in front."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.strerror}: {error.filename}"
    if isinstance(error, SuiteError) and (more := len(error.mistakes) - 1):
        return f"{error.mistakes[0]} (and {more} more mistake{'s' if more > 1 else ''})"
    return " ".join(str(error).split())


def _fail(sentence: str, error: BaseException) -> None:
    if DEBUG in sys.argv:
        raise error
    if "--json" in sys.argv:
        print(json_module.dumps({"error": sentence, **_mistakes(error)}, ensure_ascii=False))
    for line in str(error).splitlines() if isinstance(error, SuiteError) else [sentence]:
        print(f"vobench: {printable(line)}", file=sys.stderr)
    raise SystemExit(1) from None


def _mistakes(error: BaseException) -> dict[str, Any]:
    """Of a file that is wrong: every mistake with its file, line, key and value; `asked_by` is what named the file."""
    if not isinstance(error, SuiteError):
        return {}
    said = list[dict[str, Any]]()
    for mistake in error.mistakes:
        place = {"file": None, "line": None, "column": None, "key": None, "value": None}
        if mistake.places:
            place = asdict(mistake.places[-1])
        asked_by = [str(outer) for outer in mistake.places[:-1]]
        said.append({**place, "sentence": mistake.sentence, "asked_by": asked_by})
    return {"mistakes": said}


def _print_version(asked: bool) -> None:
    if asked:
        from vobench import __version__

        print(__version__)
        raise typer.Exit


@app.callback()
def common(
    *,
    debug: Annotated[bool, typer.Option(DEBUG, help="Show a traceback where there would be one line.")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Simulate, run and score visual odometry, and see where it breaks."""
    del debug, version  # the one is read by _fail, the other done by its callback
