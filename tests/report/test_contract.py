"""The quick test of an estimator names what is broken, and passes what is whole."""

from pathlib import Path

import pytest

from vobench.report.contract import Verdict, assert_contract, contract
from vobench.suite.catalog import builtin_root

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI

# ruff: noqa: E501 - one way to break it is one line

HEAD = """
import numpy as np
from vobench.plugin import Result, Status
class Mine:
    def start(self, rig, params, seed):
        {start}
    def process(self, frame):
        {body}
"""


@pytest.fixture
def plugin(tmp_path):
    def make(body, *, start="self.n = 0", more=""):
        (tmp_path / "estimator.yaml").write_text(
            "name: mine\nversion: '1'\nclass: estimator:Mine\nneeds: [stereo, imu]\npose_of: body\nsummary: Mine\n"
            + more
        )
        (tmp_path / "estimator.py").write_text(HEAD.format(start=start, body=body))
        return tmp_path

    return make


BROKEN = {
    "rigid poses in time": ("return Result(2 * np.eye(4))", {}, "invalid_output after 0 frames: frame 0: the pose is no"),
    "determinism": ("T = np.eye(4); T[0, 3] = 1e-3 * np.random.default_rng().normal(); return Result(T)", {}, "two runs are not the same, declared deterministic: true"),
    "frames unchanged, restart": ("frame.left[0] = 0; return Result(np.eye(4))", {}, "invalid_output: frame 0: process() changed the frame it was given"),
    "restart": ("self.n += 1; T = np.eye(4); T[0, 3] = 1e-4 * self.n; return Result(T)", {"start": "self.n = getattr(self, 'n', 0)"}, "a second start() gives other poses"),
    "black frames": ("return Result(np.eye(4) / bool(frame.left.max()))", {}, "invalid_output after 10 frames"),
    "missing frames": ("assert frame.t_ns == self.n * 50_000_000, 'late'; self.n += 1; return Result(np.eye(4))", {}, "crashed after 10 frames: AssertionError: late"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "body", "keys", "seen"), [(name, *rest) for name, rest in BROKEN.items()], ids=BROKEN)
def test_what_is_broken_is_named(plugin, name, body, keys, seen):
    folder = plugin(body, **keys)
    broken = {clause.name: clause.seen for clause in contract(folder) if clause.verdict is Verdict.BROKEN}
    assert broken.get(name, "").startswith(seen), broken


def test_one_that_hangs_on_the_clock_cannot_be_told_from_one_that_looks_ahead(plugin):
    body = "import time; T = np.eye(4); T[0, 3] = 1e-9 * time.time(); return Result(T)"
    broken = {clause.name: clause.verdict for clause in contract(plugin(body))}
    assert broken["causality"] is broken["determinism"] is Verdict.BROKEN
    told = {clause.name: clause.verdict for clause in contract(plugin(body, more="deterministic: false\n"))}
    assert told["causality"] is Verdict.NOT_TESTED
    assert told["determinism"] is Verdict.KEPT


def test_a_poor_standstill_says_the_limit_and_breaks_no_contract(plugin):
    folder = plugin("T = np.eye(4); self.n += 1; T[0, 3] = 1e-3 * self.n; return Result(T)")
    clauses = {clause.name: clause for clause in contract(folder)}
    assert clauses["standstill"].verdict is Verdict.POOR
    assert clauses["standstill"].seen == "moves by up to 19.00 mm within a second; up to 10 mm is good"
    assert_contract(folder)


@pytest.mark.parametrize("name", ["stand_still", "wheel_odometry", "lk_epipolar"])
def test_those_of_the_house_keep_it(name):
    assert_contract(builtin_root() / "estimators" / name)


def test_a_restart_has_the_seed_of_the_run(plugin):
    assert_contract(plugin("return Result(np.eye(4))", start="assert seed == 0; self.n = 0"))


def test_a_plugins_own_test_says_all_that_is_broken(plugin):
    folder = plugin("frame.left[0] = 0; return Result(np.eye(4))")
    with pytest.raises(AssertionError, match=r"does not keep the contract: frames unchanged, restart: invalid_output"):
        assert_contract(Path(folder))
