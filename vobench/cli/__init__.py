"""The command line: a command parses, calls one function and prints."""


def main() -> None:
    """The entry point of the `vobench` command."""
    try:
        from vobench.cli.app import run

        run()
    except KeyboardInterrupt:  # before `run` listens to it
        raise SystemExit(130) from None
