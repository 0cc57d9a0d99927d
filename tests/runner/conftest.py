"""A suite that takes seconds: a dozen frames in a closet, under two lightings."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from vobench.report import page
from vobench.runner.executor import Serial
from vobench.runner.folder import RunFolder
from vobench.runner.import_recording import read_all
from vobench.runner.run import run_suite
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan

CLOSET = """
name: closet
white_cd_m2: 50
materials:
  grain: {pattern: terrazzo, albedo: 0.5, contrast: 0.6, resolution_px: 64}
room: {size_m: [2, 2, 1.5], floor: grain, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""
SUITE = """
name: tiny
seed: 1
scenes: [SCENE]
lightings: {full: {}, dim: {lamp: {power_lm: 150}}}
rigs: {down: {pitch_deg: 90}}
trajectories: {short: {targets_m: [[0.3, 0]], tolerance_m: 0.03, rate_hz: 5}}
estimators: [wheel_odometry, stand_still]
"""


@dataclass(frozen=True, slots=True)
class Bench:
    """The suite, and a place for caches and runs."""

    folder: Path

    def suite(self, *changes: tuple[str, str]) -> Path:
        """The suite's file, some of its text replaced."""
        (self.folder / "closet.yaml").write_text(CLOSET)
        text = SUITE.replace("SCENE", str(self.folder / "closet.yaml"))
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = self.folder / f"suite{abs(hash(changes))}.yaml"
        path.write_text(text)
        return path

    def plan(self, *changes: tuple[str, str]) -> Plan:
        return read_plan(str(self.suite(*changes)))

    def run(self, *changes: tuple[str, str], cache: str = "cache") -> RunFolder:
        """Run the suite as the command line does."""
        return self.run_plan(self.plan(*changes), root=self.folder / "runs", cache=cache)

    def run_plan(self, plan: Plan, *, root: Path, cache: str) -> RunFolder:
        """Run a plan, in silence."""
        recordings, store = read_all(plan), self.folder / cache
        return run_suite(plan, recordings, root=root, store=store, executor=Serial(), finish=page.write_reports)


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return Bench(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="session")
def first(bench: Bench) -> RunFolder:
    """The suite, run once on an empty cache."""
    return bench.run()


@pytest.fixture
def plugin(tmp_path: Path) -> Callable[[str], Path]:
    """Makes an estimator's folder from the body of its process()."""

    def make(body: str, *, head: str = "", needs: str = "[]") -> Path:
        folder = tmp_path / "mine"
        folder.mkdir()
        (folder / "estimator.yaml").write_text(
            f"name: mine\nversion: '1'\nclass: estimator:Mine\nneeds: {needs}\npose_of: left_camera\nsummary: Mine\n"
        )
        (folder / "estimator.py").write_text(
            f"import numpy as np\nfrom vobench.estimator import Result, Status\n{head}\n"
            f"class Mine:\n    def start(self, rig, params, seed): ...\n    def process(self, frame):\n        {body}\n"
        )
        return folder

    return make
