"""A small suite whose text can be bent, read in its own folder."""

from collections.abc import Callable
from pathlib import Path

import pytest

from vobench.scene.scene import Scene
from vobench.suite.plan import Plan
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene
from vobench.suite.scene_spec import LightOverride
from vobench.suite.suite import read_plan

SUITE = """name: tiny
seed: 1
scenes: [closet]
lightings: {full: {}, dim: {lamp: {power_lm: 150}}}
rigs: {down: {pitch_deg: 90}}
trajectories: {short: {targets_m: [[0.5, 0]]}}
cameras: {clean: {sensor: clean}}
estimators: [stand_still, {name: constant_velocity, params: {measure_s: 0.1}}]
"""
CLOSET = """name: closet
white_cd_m2: 50
materials: {grain: {pattern: terrazzo, albedo: 0.5, resolution_px: 8}}
room: {size_m: [3, 3, 1.5], floor: grain, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""


@pytest.fixture
def bent(tmp_path, monkeypatch) -> Callable[..., Plan]:
    """Reads the plan of the suite with some text of it, or of its scene, replaced, and `more` at its end."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenes").mkdir()

    def read(
        *changes: tuple[str, str], scene: tuple[str, ...] = ("", ""), only: tuple[str, ...] = (), more: str = ""
    ) -> Plan:
        text = SUITE + more
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        (tmp_path / "tiny.yaml").write_text(text, encoding="utf-8")
        closet = CLOSET
        for old, new in zip(scene[::2], scene[1::2], strict=True):
            closet = closet.replace(old, new, 1)
        (tmp_path / "scenes" / "closet.yaml").write_text(closet, encoding="utf-8")
        return read_plan("./tiny.yaml", only_estimators=only)

    return read


# ruff: noqa: E501 - an entry stands in one line


HALL = """name: hall
white_cd_m2: 50
materials:
  grain: {pattern: terrazzo, albedo: 0.5, resolution_px: 8}
  stone: {kind: polished, pattern: plain, albedo: 0.4, eta: 1.4, roughness: 0.1}
  steel: {kind: mirror, tint: 0.6}
  pane: {kind: glass}
  glow: {kind: luminous, luminance_cd_m2: 100}
room:
  size_m: [6, 4, 3]
  floor: stone
  wall: grain
  ceiling: grain
  windows: [{wall: north, center_m: [1, 1.5], size_m: [1, 0.8], pane: pane, reveal: grain}]
boxes: [{name: crate, center_m: [1, 0, 0.5], size_m: [0.4, 0.4, 1], material: grain}, {center_m: [-1, 0, 2], size_m: [0.1, 0.1, 0.1], material: glow}]
boards: [{name: looking_glass, center_m: [-2.9, 0, 1.5], size_m: [1, 2], material: steel}]
lamps:
  - {name: panel, center_m: [0, 0, 2.9], size_m: [0.6, 0.6], power_lm: 800, level: {flicker: {depth: 0.3}}}
  - {name: bulb, kind: point, center_m: [2, 1, 2], power_lm: 500}
  - {name: spot, kind: spot, center_m: [2, -1, 2], target_m: [2, -1, 0], power_lm: 300}
sun: {illuminance_lx: 30000, azimuth_deg: 90, elevation_deg: 30}
sky: {illuminance_lx: 8000}
movers:
  - {name: cart, size_m: [0.5, 0.4, 0.6], material: grain, path: [{t_s: 0, position_m: [0, 0, 0.3]}, {t_s: 2, position_m: [1, 0, 0.3]}]}
"""


@pytest.fixture
def hall(tmp_path: Path):
    """Builds the hall with some text of it replaced, under some lighting."""

    def bent(old: str = "", new: str = "", lighting: dict[str, LightOverride] | None = None) -> Scene:
        assert old in HALL
        (tmp_path / "hall.yaml").write_text(HALL.replace(old, new, 1) if old else HALL, encoding="utf-8")
        return build(read_scene(tmp_path / "hall.yaml"), lighting or {})

    return bent
