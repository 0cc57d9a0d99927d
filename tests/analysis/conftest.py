"""A case that has some of everything, and a run in which an estimator fails for a known reason."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import CLOSET, make_cheap
from tests.runner.conftest import CLOSET as TEXTURED_CLOSET
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import custom_stereo_pair, stereo_rig
from vobench.runner.executor import Serial
from vobench.runner.folder import RunFolder, TrialScore
from vobench.runner.run import run_suite
from vobench.suite.axis import RigSettings
from vobench.suite.case import Case
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan
from vobench.suite.yaml_file import plain

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
        dirt: 0.1, lens_drops: 0.1, flare: 0.1, jpeg_quality: 50, exposure_gain: 2,
        unlike: {right: {gain: 0.5}}, timing: {drop_share: 0.2, jitter_ms: 1, imu_delay_ms: 1}}
estimators: [stand_still]
"""


@pytest.fixture
def hard(tmp_path: Path) -> Case:
    (tmp_path / "hall.yaml").write_text(SCENE)
    (tmp_path / "suite.yaml").write_text(SUITE)
    return read_plan(str(tmp_path / "suite.yaml")).simulated[0]


BLIND = '''
import numpy as np
from vobench.estimator import Result, Status

class Blind:
    def start(self, rig, params, seed):
        self._metres_per_tick = 2 * np.pi * rig.wheels.radius_m / rig.wheels.ticks_per_revolution

    def process(self, frame):
        """The path of the wheels straight ahead, unless neighbouring pixels differ."""
        if np.abs(np.diff(frame.left.astype(float), axis=1)).mean() > 0.5:
            return Result(None, Status.LOST, "noise")
        T = np.eye(4)
        T[0, 3] = frame.encoders.ticks[-1].mean() * self._metres_per_tick
        return Result(T)
'''
MANIFEST = "name: blind\nversion: '1'\nclass: estimator:Blind\nneeds: [mono, encoders]\npose_of: body\nsummary: Blind\n"
NOISY = """
name: noisy
scenes: [closet]
rigs: {down: {pitch_deg: 90}}
trajectories: {short: {targets_m: [[0.25, 0]], tolerance_m: 0.04, rate_hz: 5}}
cameras: {noisy: {sensor: mt9v034, vignetting: 0.1, timing: {drop_share: 0.2}}}
estimators: [./blind, wheel_odometry]
"""


@dataclass(frozen=True, slots=True)
class NoisyRun:
    """A run in which the estimator `blind` is lost because the camera is noisy, on one case called `short`."""

    root: Path
    folder: RunFolder

    @property
    def estimator(self) -> Path:
        """The folder of `blind`, which is not found by its name."""
        return self.root / "blind"

    def trial(self, estimator: str) -> Path:
        """A trial as the command line names it."""
        return self.folder.path / "short" / estimator

    def score(self, estimator: str) -> TrialScore:
        """The score of a trial."""
        return next(score for score in self.folder.scores() if score.estimator == estimator)

    def run_plan(self, plan: Plan, /) -> RunFolder:
        """Run a plan in this process, in silence."""
        return run_suite(
            plan, {}, root=self.root / "runs", store=self.root / "cache", executor=Serial(), finish=lambda *_: None
        )


@pytest.fixture(scope="session")
def noisy_run(tmp_path_factory: pytest.TempPathFactory) -> NoisyRun:
    """The run, made once, with pictures that are grey but for the camera's noise."""
    root = tmp_path_factory.mktemp("noisy")
    (root / "closet.yaml").write_text(CLOSET)
    (root / "noisy.yaml").write_text(NOISY)
    (root / "blind").mkdir()
    (root / "blind" / "estimator.yaml").write_text(MANIFEST)
    (root / "blind" / "estimator.py").write_text(BLIND)
    with pytest.MonkeyPatch.context() as patch:
        make_cheap(patch)
        run = NoisyRun(root, RunFolder(root))
        return replace(run, folder=run.run_plan(read_plan(str(root / "noisy.yaml"))))


@pytest.fixture
def cheap_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures that are grey but for the camera's effects, for a test that runs variants of `noisy_run`."""
    make_cheap(monkeypatch)


LENS = Pinhole(240, 160, 200.0, 200.0, 119.5, 79.5)


@pytest.fixture(scope="session")
def recorded_case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a case of some twenty small pictures from a textured closet, with a right eye that is rolled."""
    root = tmp_path_factory.mktemp("recorded")
    (root / "closet.yaml").write_text(TEXTURED_CLOSET)
    rig: Any = plain(
        RigSettings(own=custom_stereo_pair(stereo_rig(LENS, pitch_deg=0)), pitch_deg=30, forward_m=0, height_m=0.3)
    )
    stated = {key: rig[key] for key in ("own", "pitch_deg", "forward_m", "height_m")}
    suite = {
        "name": "recorded",
        "scenes": ["closet"],
        "rigs": {"it": {**stated, "calibration_error": {"right_roll_deg": 0.5}}},
        "trajectories": {"legs": {"targets_m": [[0.3, 0.2]], "tolerance_m": 0.02, "slip": "none", "rate_hz": 10}},
        "estimators": ["stand_still"],
    }
    (root / "recorded.yaml").write_text(json.dumps(suite))
    run = run_suite(
        read_plan(str(root / "recorded.yaml")),
        {},
        root=root / "runs",
        store=root / "cache",
        executor=Serial(),
        finish=lambda *_: None,
    )
    return run.case("legs")
