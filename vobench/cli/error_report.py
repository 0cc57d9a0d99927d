"""Errors that the user can correct: one line on standard error, JSON on standard output if asked, and exit code 1."""

import json
import os
import sys
from dataclasses import asdict
from typing import Any, NoReturn

from vobench.cli.terminal import warn
from vobench.errors import InputError, SuiteError, counted

DEBUG = "--debug"
JSON = "--json"


def report_and_exit(error: Exception) -> NoReturn:
    """Print an error and exit with code 1. With --debug, raise the error instead."""
    if DEBUG in sys.argv:
        raise error
    sentence = error_line(error)
    if JSON in sys.argv:
        content = {"error": sentence, **_mistakes(error)}
        _print_to_stdout(json.dumps(content, ensure_ascii=False))

    lines = [sentence]
    if isinstance(error, SuiteError):
        lines = str(error).splitlines()  # a line for each mistake in the file
    for line in lines:
        warn(line)
    raise SystemExit(1) from None


def error_line(error: Exception) -> str:
    """The message of an error as one line. An error of the operating system includes the file's name."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.strerror}: {error.filename}"
    if isinstance(error, SuiteError) and len(error.mistakes) > 1:
        more_count = len(error.mistakes) - 1
        return f"{error.mistakes[0]} (and {counted(more_count, 'more mistake')})"
    return " ".join(str(error).split())


def _mistakes(error: Exception) -> dict[str, Any]:
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
        referring_places = [str(outer) for outer in mistake.places[:-1]]
        rows.append({**place, "sentence": mistake.sentence, "asked_by": referring_places})
    return {"mistakes": rows}


def _print_to_stdout(text: str) -> None:
    """Print an error to standard output. A failure is ignored, because standard error gets the same error."""
    try:
        print(text, flush=True)
    except OSError:
        discard_output()


def flush_output() -> None:
    """Flush standard output now, because an error while the interpreter exits would print a traceback.

    Raises InputError if the output cannot be written, for example to a full disk. A closed pipe is not an error.
    """
    if sys.stdout is None:  # the shell closed it, as with >&-
        return
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        discard_output()
    except OSError as error:
        discard_output()
        raise InputError(f"standard output cannot be written: {error.strerror}") from error


def discard_output() -> None:
    """Redirect standard output to the null device, so that the rest of the output is discarded."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
