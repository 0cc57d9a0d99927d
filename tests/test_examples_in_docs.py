"""Every command and code block of the documentation is one that vobench accepts.

Commands are parsed here; tests/cli/test_commands_in_docs.py runs them. Blocks of YAML are read as
suites or scenes, and blocks of Python are executed.
"""

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
import yaml

from tests.documented import PAGES, Block, block_of, blocks_of, commands_of_page
from vobench.cli.command_group import CommandGroup
from vobench.dataset import layout
from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.suite.plan import Plan
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene
from vobench.suite.suite import read_plan

OPTIONS_OF_VOBENCH = ("--version", "--help", "--install-completion")
USAGE_ERROR = 2  # click's exit code
BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def blocks_in(language: str) -> list[Block]:
    return [block for block in BLOCKS if block.language == language]


@cache
def command_named(name: str) -> click.Command | None:
    group = CommandGroup(name="vobench")
    return group.get_command(click.Context(group, info_name="vobench"), name)


def mistake_in(arguments: list[str]) -> str:
    """The kind of mistake in the arguments of vobench; empty if it accepts them."""
    name, *rest = arguments
    if name in OPTIONS_OF_VOBENCH:
        return ""
    command = command_named(name)
    if command is None:
        return "NoSuchCommand"
    try:
        command.make_context(name, rest)
    except Exception as error:  # typer has its own copy of click's exceptions
        if getattr(error, "exit_code", None) != USAGE_ERROR:
            raise
        return type(error).__name__
    return ""


COMMANDS = [command for page in PAGES for command in commands_of_page(page) if command.is_vobench]
IN_PROSE = [(command.page, command.arguments) for command in COMMANDS if command.place == "prose"]
IN_BLOCKS = [(command.place, command.arguments) for command in COMMANDS if command.place != "prose"]


@pytest.mark.parametrize(("page", "arguments"), IN_BLOCKS, ids=lambda value: str(value)[:60])
def test_every_command_of_a_block_is_accepted(page, arguments):
    assert mistake_in(arguments) == ""


@pytest.mark.parametrize(("page", "arguments"), IN_PROSE, ids=lambda value: str(value)[:60])
def test_every_command_in_prose_is_accepted_or_shortened(page, arguments):
    """Prose may leave out arguments, and the value of the last option."""
    assert mistake_in(arguments) in ("", "MissingParameter", "BadOptionUsage")


def test_the_commands_of_blocks_prompts_and_prose_are_found():
    assert ("README.md:1", ["run", "quickstart"]) in IN_BLOCKS
    assert ("docs/getting-started.md:1", ["run", "lighting"]) in IN_BLOCKS
    assert ("docs/boards.md", ["compare", "OLD", "NEW"]) in IN_PROSE


@pytest.mark.parametrize(
    ("arguments", "mistake"),
    [
        (["runn", "quickstart"], "NoSuchCommand"),
        (["run", "quickstart", "--jib"], "NoSuchOption"),
        (["plot", "runs/tiny", "--width"], "BadOptionUsage"),
        (["compare", "OLD"], "MissingParameter"),
        (["try", "mine", "again"], "UsageError"),
        (["run", "quickstart", "--jobs", "many"], "BadParameter"),
    ],
)
def test_a_command_that_vobench_refuses_is_found(arguments, mistake):
    assert mistake_in(arguments) == mistake


# --- Blocks of YAML and Python ---

SUITE = {
    "name": "tiny",
    "scenes": ["room"],
    "rigs": {"down": {"pitch_deg": 90}},
    "trajectories": {"short": {"targets_m": [[0.6, 0.3]]}},
    "estimators": ["stand_still"],
}


def planned(folder: Path, changes: dict[str, Any]) -> Plan:
    """The plan of the small suite with changes, written to a folder."""
    path = folder / "tiny.yaml"
    path.write_text(yaml.safe_dump(SUITE | changes), encoding="utf-8")
    return read_plan(str(path))


PARTS_OF_SUITES = [
    ("docs/rigs.md", 0),
    ("docs/rigs.md", 1),
    ("docs/rigs.md", 2),
    ("docs/sensors.md", 0),
    ("docs/cameras.md", 0),
    ("docs/suites.md", 1),
    ("docs/suites.md", 2),
]


@pytest.mark.parametrize(("page", "number"), PARTS_OF_SUITES)
def test_a_part_of_a_suite_is_accepted(tmp_path, page, number):
    part = yaml.safe_load(block_of(page, "yaml", number))
    (key, values), *others = part.items()
    assert others == []
    assert len(planned(tmp_path, part).cases) == (1 if key == "estimators" else len(values))


def test_a_suite_that_includes_another_is_accepted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lighting.yaml").write_text(block_of("docs/suites.md", "yaml", 0), encoding="utf-8")
    (tmp_path / "tilted.yaml").write_text(block_of("docs/suites.md", "yaml", 3), encoding="utf-8")
    cases = read_plan("./tilted.yaml").cases
    assert {case.variant["rig"] for case in cases} == {"down", "tilted"}


def test_a_suite_of_recordings_names_the_first_one_that_is_missing(tmp_path):
    text = block_of("docs/suites.md", "yaml", 4)
    (tmp_path / "real.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(VobenchError, match="V1_01_easy"):
        read_plan(str(tmp_path / "real.yaml"))


def test_a_suite_of_generated_places_is_accepted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_generator(tmp_path / "scenes" / "mine")
    spread = yaml.safe_load(block_of("docs/suites.md", "yaml", 5))
    assert len(planned(tmp_path, spread).cases) == 12


def test_a_suite_of_scenarios_is_accepted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "my_estimator"
    folder.mkdir()
    manifest = block_of("docs/estimators.md", "yaml").replace("name: mine", "name: my_estimator")
    (folder / "estimator.yaml").write_text(manifest, encoding="utf-8")
    (folder / "estimator.py").write_text(block_of("docs/estimators.md", "python"), encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(block_of("docs/scenarios.md", "yaml", 0), encoding="utf-8")
    assert len(read_plan("./mine.yaml").cases) == 8


def test_a_scenario_of_ones_own_is_accepted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "dusk.yaml").write_text(block_of("docs/scenarios.md", "yaml", 1), encoding="utf-8")
    suite = {"name": "mine", "scenarios": {"dusk": [0, 5]}, "estimators": ["stand_still"]}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(suite), encoding="utf-8")
    assert len(read_plan("./mine.yaml").cases) == 2


def test_a_scene_is_built(tmp_path):
    (tmp_path / "cell.yaml").write_text(block_of("docs/scenes.md", "yaml", 0), encoding="utf-8")
    scene = build(read_scene(tmp_path / "cell.yaml"), {})
    assert {"floor", "crate", "pane"} <= set(scene.materials)


def test_a_scene_with_a_mover_is_built(tmp_path):
    scene = yaml.safe_load(block_of("docs/scenes.md", "yaml", 0))
    scene["room"]["size_m"] = [20, 20, 2.5]  # the mover's path is that of a larger place
    scene |= yaml.safe_load(block_of("docs/scenes.md", "yaml", 1))
    (tmp_path / "cell.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    built = build(read_scene(tmp_path / "cell.yaml"), {})
    assert {mover.name for mover in built.movers} == {"walker"}


def run_block(page: str, number: int, names: dict[str, Any]) -> dict[str, Any]:
    """The names after a block of Python."""
    exec(compile(block_of(page, "python", number), page, "exec"), names)
    return names


def write_generator(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "generator.py").write_text(block_of("docs/scenes.md", "python", 1), encoding="utf-8")
    (folder / "scene.yaml").write_text("name: mine\ngenerator: generator.py\n", encoding="utf-8")


def test_a_maker_returns_things_whose_materials_it_defines():
    things, materials = run_block("docs/scenes.md", 0, {})["make"](seed=1)
    assert len(things) == 7
    assert {thing.material for thing in things} == set(materials)


def test_a_generator_returns_other_places_for_other_seeds():
    generate = run_block("docs/scenes.md", 1, {})["generate"]
    first, second = (generate(seed, "day").things[0].mesh.bounds for seed in (1, 2))
    assert (first != second).any()


def test_poses_are_composed_as_in_the_conventions():
    T_world_body = se3.transform(se3.rotation_z(0.3), [1.0, 2.0, 3.0])
    T_body_camera = se3.transform(se3.rotation_z(-1.2), [0.1, 0.0, 0.2])
    names = run_block("docs/conventions.md", 0, {"T_world_body": T_world_body, "T_body_camera": T_body_camera})
    np.testing.assert_allclose(se3.inverse(T_world_body) @ names["T_world_camera"], T_body_camera, atol=1e-12)


IMPORT = re.compile(r"^(?:from [\w.]+ )?import .*$", re.MULTILINE)


@pytest.mark.parametrize("block", blocks_in("python"), ids=lambda block: block.name)
def test_a_block_of_python_compiles_and_its_imports_exist(block):
    compile(block.text, block.name, "exec")
    for line in IMPORT.findall(block.text):
        exec(line, {})


def test_an_entry_point_is_a_table_of_names():
    groups = tomllib.loads(block_of("docs/datasets.md", "toml"))["project"]["entry-points"]
    assert list(groups) == [layout.GROUP]


def test_no_block_has_a_language_without_tests():
    assert {block.language for block in BLOCKS} == {"", "python", "sh", "toml", "yaml"}
