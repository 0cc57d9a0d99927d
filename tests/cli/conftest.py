"""The command line in this process, in a folder of its own, with pictures that cost nothing."""

import atexit
import json
import os
import shutil
import signal
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vobench import cli, stop
from vobench.cli import main
from vobench.rendering import bake, raster
from vobench.rendering.baked_scene import BakeSettings

SUITE = """name: tiny
scenes: [closet]
rigs: {down: {pitch_deg: 90}}
trajectories: {short: {targets_m: [[0.25, 0]], tolerance_m: 0.04, rate_hz: 5}}
estimators: [wheel_odometry, stand_still]
"""
CLOSET = """name: closet
white_cd_m2: 50
materials: {grain: {pattern: plain, albedo: 0.5, resolution_px: 8}}
room: {size_m: [2, 2, 1.5], floor: grain, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""


@dataclass(frozen=True, slots=True)
class Said:
    """What a command wrote, and how it ended."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as the one JSON object that it should be."""
        content = json.loads(self.out)
        assert isinstance(content, dict)
        return content


class FlatRenderer:
    """Draws grey."""

    def __init__(self, baked: object, *, samples: int) -> None:
        pass

    def radiance(self, camera: Any, T_world_camera: object, *, weights: Any = (1, 0, 0)) -> np.ndarray:
        shape = (camera.height_px, camera.width_px)
        return np.full(shape if weights else (*shape, 3), 20.0, np.float32)

    def close(self) -> None:
        pass


def lay_out(folder: Path, patch: pytest.MonkeyPatch) -> None:
    """Make a folder the working directory, with a suite and a scene, an empty cache and free pictures."""
    for kind, name, text in (("suites", "tiny", SUITE), ("scenes", "closet", CLOSET)):
        (folder / kind).mkdir()
        (folder / kind / f"{name}.yaml").write_text(text)
    patch.chdir(folder)
    patch.setenv("VOBENCH_CACHE", str(folder / "cache"))
    patch.setenv("VOBENCH_JOBS", "1")  # what a test patches is patched in this process
    patch.delenv("VOBENCH_PATH", raising=False)
    make_cheap(patch)


def make_cheap(patch: pytest.MonkeyPatch) -> None:
    """Pictures and light that cost nothing."""
    patch.setattr(raster, "RasterRenderer", FlatRenderer)
    whole = bake.bake
    patch.setattr(bake, "bake", lambda scene, _, tell: whole(scene, BakeSettings(0.5, 1, 0.5, 1, 0), tell))


def call(words: tuple[object, ...], patch: pytest.MonkeyPatch) -> int:
    """The exit code of a command, run in this process."""
    patch.setattr(sys, "argv", ["vobench", *map(str, words)])
    patch.setattr(cli, "GRACE_S", 3600)  # a slow machine's frame should not end the process of the tests
    listens = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        with pytest.raises(SystemExit) as ended:
            main()
    finally:
        atexit.unregister(os._exit)  # a command that was stopped ends its process so
        stop.withdraw_requests()
        for number, listener in listens.items():
            signal.signal(number, listener)
    return int(ended.value.code or 0)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a suite and a scene, and an empty cache."""
    lay_out(tmp_path, monkeypatch)
    return tmp_path


@pytest.fixture
def vobench(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Said]:
    """Runs a command."""

    def run(*words: object) -> Said:
        code = call(words, monkeypatch)
        said = capsys.readouterr()
        return Said(code, said.out, said.err)

    return run


@pytest.fixture(scope="session")
def one_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the suite has been run."""
    folder = tmp_path_factory.mktemp("ran")
    with pytest.MonkeyPatch.context() as patch:
        lay_out(folder, patch)
        assert call(("run", "tiny"), patch) == 0
    return folder


@pytest.fixture
def ran(one_run: Path, here: Path) -> Path:
    """The suite's folder in the working directory, with one run in it."""
    shutil.copytree(one_run / "runs", here / "runs", symlinks=True)
    return here / "runs" / "tiny"


GENERATOR = '''"""Closets by seed."""

import trimesh

from vobench.plugin import GeneratedPlace, Material, Thing

GREY = (0.5, 0.5, 0.5)


def generate(seed, lighting):
    """A plain floor with a wall whose distance depends on the seed, and a lamp that shines."""
    floor = trimesh.creation.box((6.0, 6.0, 0.1))
    floor.apply_translation((0.0, 0.0, -0.05))
    wall = trimesh.creation.box((0.1, 6.0, 2.0))
    wall.apply_translation((2.5 + 0.01 * (seed % 10), 0.0, 1.0))
    lamp = trimesh.creation.box((0.5, 0.5, 0.02))
    lamp.apply_translation((0.0, 0.0, 2.0))
    materials = {"grey": Material(colour=GREY), "lamp": Material(colour=GREY, emission_cd_m2=(500.0, 500.0, 500.0))}
    things = [Thing("floor", floor, "grey"), Thing("wall", wall, "grey"), Thing("lamp", lamp, "lamp")]
    return GeneratedPlace(things, materials)
'''
DRAWN = """name: drawn
scenes: [{name: cells, seeds: 4}]
rigs: {down: {pitch_deg: 90}}
trajectories: {tour: {kind: wander, body: pioneer, length_m: 0.5, rate_hz: 4, seed: 1}}
estimators: [wheel_odometry, {name: wheel_odometry, label: twin}]
"""


@pytest.fixture
def drawn(here):
    """A suite with places by seed."""
    folder = here / "scenes" / "cells"
    folder.mkdir()
    (folder / "scene.yaml").write_text("name: cells\nwhite_cd_m2: 50\ngenerator: generator.py\n")
    (folder / "generator.py").write_text(GENERATOR)
    (here / "suites" / "drawn.yaml").write_text(DRAWN)
    return here / "runs" / "drawn"
