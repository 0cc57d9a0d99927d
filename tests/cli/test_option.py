"""An option group is one parameter of a command, and its options are those of the command line."""

from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from vobench.cli.command_group import CommandGroup
from vobench.cli.option import RerunOptions, option_group, with_option_groups


@option_group
class Size:
    """How large something is."""

    width: Annotated[int, typer.Option("--width", "-w", min=1, help="The width.")] = 3
    names: Annotated[list[str] | None, typer.Option("--name", help="A name.")] = None

    def area(self, height: int) -> int:
        """The area."""
        return self.width * height


@pytest.fixture
def run():
    """Runs a command with a group of options, and returns the result and what it printed."""
    app = typer.Typer()

    @app.command()
    @with_option_groups
    def draw(
        height: Annotated[int, typer.Argument()],
        *,
        loud: Annotated[bool, typer.Option("--loud")] = False,
        size: Size,
    ) -> None:
        """Draw something."""
        print(size.area(height), size.names, loud)

    return lambda *words: CliRunner().invoke(app, [*map(str, words)])


@pytest.mark.parametrize(
    ("words", "printed"),
    [
        ((2,), "6 None False"),
        ((2, "--width", 5), "10 None False"),
        ((2, "-w", 5, "--loud"), "10 None True"),
        ((2, "--name", "a", "--name", "b"), "6 ['a', 'b'] False"),
    ],
)
def test_options_of_a_group_are_options_of_the_command(run, words, printed):
    result = run(*words)
    assert (result.exit_code, result.output) == (0, f"{printed}\n")


def test_a_bound_of_an_option_in_a_group_holds(run):
    assert run(2, "--width", 0).exit_code == 2


def test_help_lists_the_options_and_the_commands_sentence(run):
    text = run("--help").output
    for part in ("--width", "The width.", "--name", "--loud", "Draw something."):
        assert part in text
    assert "--size" not in text


def test_a_group_is_frozen_and_takes_keywords():
    options = RerunOptions(jobs=2)
    assert (options.jobs, options.estimator, str(options.out)) == (2, None, "runs")
    with pytest.raises(AttributeError):
        options.jobs = 3
    with pytest.raises(TypeError):
        RerunOptions(None)


def test_a_command_without_groups_is_unchanged():
    @with_option_groups
    def plain(name: str, *, count: int = 2) -> None:
        print(name * count)

    assert plain.__name__ == "plain"
    plain(name="a")


def test_a_shared_option_is_the_same_in_every_command_that_has_it():
    def helps(name, *commands):
        options = [option for command in commands for option in CommandGroup().get_command(None, command).params]
        return [(option.help, option.opts) for option in options if option.name == name]

    for name, commands in (
        ("jobs", ("explain", "shrink", "twin")),
        ("truth", ("info", "import", "twin", "realism")),
        ("est_topic", ("score", "diagnose")),
        ("trust", ("check", "run", "scene", "render", "drive")),
        ("json", ("check", "run", "score", "info", "cache")),
    ):
        first, *others = helps(name, *commands)
        assert others == [first] * (len(commands) - 1)
