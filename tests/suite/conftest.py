"""A small suite whose text can be bent, read in its own folder."""

from collections.abc import Callable

import pytest

from vobench.suite.suite import Plan, read_plan

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
