"""An error is one line wherever standard output goes, and a traceback with --debug alone."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from vobench.cli import main
from vobench.cli.error_report import error_line
from vobench.errors import InputError, SuiteError, UnknownNameError


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (InputError("two\n  lines"), "two lines"),
        (FileNotFoundError(2, "No such file or directory", "a.tum"), "No such file or directory: a.tum"),
        (SuiteError("first"), "first"),
        (SuiteError("first", "second"), "first (and 1 more mistake)"),
        (SuiteError("first", "second", "third"), "first (and 2 more mistakes)"),
    ],
)
def test_the_line_of_an_error_names_the_file_and_counts_further_mistakes(error, line):
    assert error_line(error) == line


@pytest.mark.parametrize("words", [("--debug", "run", "nope"), ("run", "nope", "--debug"), ("run", "--debug", "nope")])
def test_debug_lets_the_error_through_wherever_it_stands(here, monkeypatch, words):
    monkeypatch.setattr(sys, "argv", ["vobench", *words])
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(UnknownNameError, match="no suite named 'nope'"):
        main()


def run_in_bash(redirection, words, **variables):
    """vobench as a process whose output bash redirects."""
    script = f"import sys; from vobench.cli import main; sys.argv = ['vobench', *{words!r}]; main()"
    command = ["bash", "-c", f'"$0" -c "$1" {redirection}', sys.executable, script]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | variables)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
@pytest.mark.parametrize("words", [("list", "--json"), ("metrics",), ("--version",), ("--help",)], ids=" ".join)
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_that_a_full_disk_does_not_take_is_one_line_and_exit_code_1(words, unbuffered):
    done = run_in_bash("> /dev/full", words, PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == 1
    assert done.stderr.startswith("vobench: ")
    assert done.stderr.endswith("No space left on device\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("redirection", ["> /dev/full", ">&-"])
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_mistake_is_one_line_though_its_json_cannot_be_written(redirection, unbuffered):
    done = run_in_bash(redirection, ("run", "nope", "--json"), PYTHONUNBUFFERED=unbuffered)
    assert done.returncode == 1
    assert done.stderr.startswith("vobench: no suite named 'nope'")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("words", [("list", "--json"), ("metrics",), ("--version",), ("--help",)], ids=" ".join)
def test_a_command_without_a_standard_output_ends_well(words):
    done = run_in_bash(">&-", words)
    assert (done.returncode, done.stderr) == (0, "")
