"""Every example does what its first line says."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from vobench.suite.suite import read_plan
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("suite", sorted(EXAMPLES.glob("*.yaml")), ids=lambda path: path.stem)
def test_an_example_suite_is_valid_and_named_as_its_file(suite):
    planned = read_plan(str(suite))
    assert planned.suite.name == suite.stem
    assert len(planned.cases) > 1


def test_files_are_scored_from_python(tmp_path):
    t_ns = np.arange(50, dtype=np.int64) * 100_000_000
    poses = np.tile(np.eye(4), (50, 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = np.linspace(0, 3, 50), np.sin(np.linspace(0, 3, 50))
    file = tmp_path / "path.tum"
    file.write_text(format_tum(Trajectory(t_ns, poses)))
    command = [sys.executable, str(EXAMPLES / "score_files.py"), str(file), str(file)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert said[0].startswith("ate.trans.rmse[")
    assert all(float(line.split()[-2]) < 1e-6 for line in said)
