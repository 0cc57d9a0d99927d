"""The command line: a command parses, calls one function and prints."""


def main() -> None:
    """The entry point of the `vobench` command."""
    from vobench.cli.app import run

    run()
