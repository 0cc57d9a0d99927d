"""A case that has some of everything."""

from pathlib import Path

import pytest

from vobench.suite.suite import Case, read_plan

SCENE = """
name: hall
white_cd_m2: 50
materials:
  floor: {kind: polished, pattern: terrazzo, albedo: 0.5, contrast: 0.6, resolution_px: 8}
  wall: {pattern: plain, albedo: 0.5, resolution_px: 8}
  glass: {kind: mirror}
room: {size_m: [4, 4, 2.5], floor: floor, wall: wall, ceiling: white_plaster}
boards: [{name: mirror, center_m: [1.9, 0, 1], size_m: [1, 1], yaw_deg: 180, material: glass}]
lamps:
  - {name: lamp, center_m: [0, 0, 2.4], size_m: [0.4, 0.4], power_lm: 600, level: {flicker: {depth: 0.5}}}
  - {name: spot, kind: point, center_m: [1, 1, 2], power_lm: 100}
movers: [{name: cart, size_m: [0.2, 0.2, 0.2], material: wall,
          path: [{t_s: 0, position_m: [1, 0, 0.1]}, {t_s: 1, position_m: [1, 1, 0.1]}]}]
"""
SUITE = """
name: hard
scenes: [hall]
lightings: {dimmed: {lamp: {power_lm: 300, level: {dimmer: [[0, 1], [1, 0.1]]}}}}
rigs: {ahead: {pitch_deg: 10, calibration_error: {right_yaw_deg: 0.1}}}
trajectories: {short: {targets_m: [[0.3, 0]], tolerance_m: 0.03, rate_hz: 5}}
cameras:
  bad: {sensor: mt9v034, auto_exposure: {}, shutter: rolling, readout_ms: 20, motion_blur: true, vignetting: 1,
        dirt: 0.1, flare: 0.1, jpeg_quality: 50, exposure_gain: 2,
        unlike: {right: {gain: 0.5}}, timing: {drop_share: 0.2, jitter_ms: 1, imu_delay_ms: 1}}
estimators: [stand_still]
"""


@pytest.fixture
def hard(tmp_path: Path) -> Case:
    (tmp_path / "hall.yaml").write_text(SCENE)
    (tmp_path / "suite.yaml").write_text(SUITE)
    return read_plan(str(tmp_path / "suite.yaml")).simulated[0]
