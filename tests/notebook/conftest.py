"""A suite whose pictures cost nothing, run once in this process."""

import shutil
from pathlib import Path

import pytest

from tests.cli.conftest import call, lay_out


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a suite and a scene, and an empty cache."""
    lay_out(tmp_path, monkeypatch)
    return tmp_path


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
