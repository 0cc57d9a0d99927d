"""The suite of the command line's tests, whose pictures cost nothing, run once in this process."""

from tests.cli.conftest import drawn, here, one_run, ran

__all__ = ["drawn", "here", "one_run", "ran"]
