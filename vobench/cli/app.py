"""The entry point of the command line: it calls the command that the arguments name, and reports errors."""

import faulthandler
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated

import typer

from vobench import stop, trust
from vobench.cli.command_group import CommandGroup
from vobench.cli.error_report import DEBUG, discard_output, flush_output, report_and_exit
from vobench.cli.terminal import warn
from vobench.errors import VobenchError

SUMMARY = "Simulate, run and score visual odometry, and find out why it fails."
app = typer.Typer(
    name="vobench",
    cls=CommandGroup,
    help=SUMMARY,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def run() -> None:
    """Run a command. An error that the user can correct is printed as one line, and the exit code is 1."""
    _print_stacks_on_crash()
    _replace_unprintable_characters()
    try:
        _call_command()
    except SystemExit as exit_request:
        if not isinstance(exit_request.__context__, BrokenPipeError):
            raise
        discard_output()  # a reader that stops early, such as `head`, is not an error
    except (VobenchError, OSError) as error:
        stop.check()  # a request to stop may have caused the error
        report_and_exit(error)


def _print_stacks_on_crash() -> None:
    """Make Python print the call stacks of all threads if a library crashes."""
    # Standard error can be closed, missing, or an object that is not a file; each raises another error.
    with suppress(OSError, ValueError, AttributeError, RuntimeError):
        faulthandler.enable()


def _replace_unprintable_characters() -> None:
    """Print a question mark for each character that the encoding of the terminal lacks, such as °."""
    open_streams = filter(None, (sys.stdout, sys.stderr))  # the shell can close either
    for stream in open_streams:
        stream.reconfigure(errors="replace")


def _call_command() -> None:
    """Call the command that the arguments name, and flush its output. This always raises SystemExit or an error."""
    try:
        with trust.gate(warn, trusted_folders=_trusted_folders, hash_folder=_hash_folder):
            # --debug is accepted before and after the command; `report_and_exit` looks for it in sys.argv. An argument
            # of a command can therefore not have the value "--debug".
            arguments = [argument for argument in sys.argv[1:] if argument != DEBUG]
            app(arguments, prog_name=app.info.name)
    finally:
        flush_output()


def _trusted_folders() -> tuple[Path, ...]:
    """The folders in which scene makers may run without --trust."""
    from vobench.suite.catalog import builtin_root

    return builtin_root(), Path.cwd()


def _hash_folder() -> Path:
    """The folder that holds the hashes of the scene makers that the user trusts."""
    from vobench.runner.key import cache_folder

    return cache_folder() / "state" / "trusted"


def _print_version(is_requested: bool) -> None:
    if is_requested:
        from vobench import __version__

        print(__version__)
        raise typer.Exit


@app.callback()
def shared_options(
    *,
    debug: Annotated[bool, typer.Option(DEBUG, help="Show a traceback instead of one line.")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Define the options that every command has."""
    del debug, version  # `report_and_exit` looks for --debug in sys.argv, and _print_version handles --version
