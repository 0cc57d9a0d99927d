"""Commands are imported when they are called; the help lists vobench's, then those of installed packages."""

import re

import pytest

from vobench.cli.command_group import COMMANDS, CommandGroup


def install(site, entry_points):
    """Make a distribution with these commands findable in a folder."""
    information = site / "outside-1.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 1\n")
    (information / "entry_points.txt").write_text(f"[vobench.commands]\n{entry_points}")


def test_installed_commands_come_after_vobench_s_in_the_help_and_in_lists(vobench, tmp_path, monkeypatch):
    install(tmp_path / "site", "zebra = vobench.cli.list:list_command\napple = vobench.cli.list:list_command\n")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    names = [*COMMANDS, "apple", "zebra"]
    assert CommandGroup().list_commands(None) == names
    _, _, commands = vobench("--help").out.partition("Commands:\n")
    assert re.findall(r"^  (\w+)", commands, re.MULTILINE) == names


def test_the_help_says_which_installed_commands_cannot_be_imported(vobench, tmp_path, monkeypatch):
    site = tmp_path / "site"
    broken = site / "broken_package"
    broken.mkdir(parents=True)
    (broken / "__init__.py").write_text("raise RuntimeError('no licence')\n")
    install(site, "top = no_package:go\ninner = no_package.cli:go\nraising = broken_package.cli:go\n")
    monkeypatch.syspath_prepend(str(site))
    said = vobench("--help")
    assert (said.code, said.err) == (0, "")
    lines = [line.split(maxsplit=1) for line in said.out.splitlines()[-3:]]
    assert lines == [
        ["inner", "cannot be imported: No module named 'no_package'"],
        ["raising", "cannot be imported: no licence"],
        ["top", "cannot be imported: No module named 'no_package'"],
    ]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_json_and_help(vobench, command):
    said = vobench(command, "--help")
    assert said.code == 0
    assert "--json" in said.out
