"""Temporary folders are removed at the end of their block, and by the next process if theirs was killed."""

import signal
import subprocess
import sys

import pytest

from vobench import temporary as temporary_folders
from vobench.temporary import remove_abandoned_folders, temporary_folder


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A TMPDIR of its own."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    temporary_folders._sweep_once.cache_clear()
    yield folder
    temporary_folders._sweep_once.cache_clear()


def test_it_is_there_for_the_block_alone(place) -> None:
    with temporary_folder() as folder:
        (folder / "deep" / "deeper").mkdir(parents=True)
        (folder / "link").symlink_to(place)
        assert folder.is_relative_to(place)
        assert folder.parent.stat().st_mode & 0o077 == 0
    assert list(place.iterdir()) == []


def _fail_in_a_folder() -> None:
    with temporary_folder() as folder:
        (folder / "file").write_text("x")
        raise ZeroDivisionError


def test_an_error_in_the_block_removes_it_too(place) -> None:
    with pytest.raises(ZeroDivisionError):
        _fail_in_a_folder()
    assert list(place.iterdir()) == []


KILLED = """
import os, signal, sys, tempfile
tempfile.tempdir = sys.argv[1]
from vobench.temporary import temporary_folder
with temporary_folder() as folder:
    (folder / "file").write_text("x")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_process_has_left_is_removed_by_the_next(place) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, str(place)], check=False)
    assert killed.returncode == -signal.SIGKILL
    (left,) = next(place.iterdir()).iterdir()
    with temporary_folder():
        assert not left.exists()
    assert list(place.iterdir()) == []


def test_what_a_process_has_left_that_was_killed_later_is_removed_on_request(place) -> None:
    with temporary_folder():
        pass
    killed = subprocess.run([sys.executable, "-c", KILLED, str(place)], check=False)
    assert killed.returncode == -signal.SIGKILL
    with temporary_folder() as folder:  # the sweep of this process is over
        (left,) = (path for path in folder.parent.iterdir() if path != folder)
        remove_abandoned_folders()
        assert not left.exists()
        assert folder.is_dir()
    remove_abandoned_folders()
    assert list(place.iterdir()) == []


def test_folders_of_somebody_else_are_not_swept(place) -> None:
    with temporary_folder() as folder:
        base = folder.parent
    (base / "1-other").mkdir(parents=True)
    base.chmod(0o777)
    remove_abandoned_folders()
    assert (base / "1-other").is_dir()


def test_one_that_is_in_use_is_not_removed(place) -> None:
    with temporary_folder() as first:
        temporary_folders._sweep_once.cache_clear()
        with temporary_folder() as second:
            assert first.is_dir()
            assert first != second
