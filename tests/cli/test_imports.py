"""What a command imports in a fresh process: only what it uses, so that it answers at once."""

import subprocess
import sys

import numpy as np
import pytest

from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

# Each costs a tenth of a second or more, and is for pictures, recordings, tables of others or the viewer.
HEAVY = {
    *("scipy.signal", "scipy.stats", "scipy.optimize", "scipy.interpolate", "scipy.spatial", "scipy.ndimage"),
    *("pandas", "matplotlib", "jinja2", "rerun", "cv2", "rosbags", "mcap", "mitsuba"),
    *("pyrender", "trimesh", "OpenGL", "rich.progress", "xatlas"),
}
# `check` builds the scenes of a suite, whose meshes are trimesh's; trimesh imports these.
MESHES = {"trimesh", "scipy.optimize", "scipy.spatial"}
COMMAND = "from vobench.cli import main; main()"


def imported(code, *words, at):
    """The modules that a process imports, and what it printed."""
    command = [sys.executable, "-X", "importtime", "-c", code, *map(str, words)]
    ended = subprocess.run(command, cwd=at, capture_output=True, text=True, check=True)
    return {line.rpartition("|")[2].strip() for line in ended.stderr.splitlines()}, ended.stdout


@pytest.fixture
def walk(here):
    """A trajectory's file, beside a suite and a scene that say what they are."""
    for file in (here / "suites" / "tiny.yaml", here / "scenes" / "closet.yaml"):
        file.write_text(file.read_text() + "summary: 'Small: for tests'\n")
    poses = np.tile(np.eye(4), (50, 1, 1))
    poses[:, 0, 3] = np.linspace(0, 3, 50)
    (here / "walk.tum").write_text(format_tum(Trajectory(np.arange(50, dtype=np.int64) * 10**8, poses)))
    return "walk.tum"


@pytest.mark.parametrize(
    ("words", "unused"),
    [
        (["list"], ("numpy", "scipy", "embreex", "ruamel.yaml", "vobench.suite.suite")),
        (["list", "--json"], ("numpy", "scipy", "ruamel.yaml", "vobench.suite.suite", "rich")),
        (["check", "tiny"], ("vobench.sequence", "vobench.dataset", "vobench.report")),
        (["check", "tiny", "--json"], ("vobench.sequence", "vobench.dataset", "vobench.report", "rich")),
        (["score", "walk.tum", "walk.tum"], ("scipy", "embreex", "ruamel.yaml", "vobench.suite", "vobench.sequence")),
        (["score", "walk.tum", "walk.tum", "--json"], ("scipy", "ruamel.yaml", "vobench.suite", "rich")),
        (["diagnose", "walk.tum", "walk.tum", "--json"], ("scipy", "ruamel.yaml", "vobench.suite", "rich")),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, list) else "",
)
def test_a_command_imports_nothing_that_it_does_not_use(here, walk, words, unused):
    modules, printed = imported(COMMAND, *words, at=here)
    assert printed
    assert "vobench.cli.app" in modules
    used = MESHES if words[0] == "check" else set()
    assert sorted(modules & HEAVY.union(unused) - used) == []


def test_importing_the_package_imports_nothing_else(tmp_path):
    modules, version = imported("import vobench; print(vobench.__version__)", at=tmp_path)
    assert version.strip()
    assert not modules & {*HEAVY, "numpy", "pydantic", "typer", "vobench.notebook", "vobench.metric"}


def test_scoring_from_python_imports_no_command_line(here, walk):
    modules, printed = imported(f"import vobench; print(vobench.score('{walk}', '{walk}'))", at=here)
    assert printed.startswith("Score(ate_trans 0 m")
    assert not modules & {*HEAVY, "typer", "pydantic", "rich", "ruamel.yaml", "vobench.cli"}
