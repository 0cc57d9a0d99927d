"""The folder of a program: what it puts there is never followed, and all of it is removed."""

import fcntl
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from vobench import temporary as temporary_folders
from vobench.estimator import home as home_file
from vobench.estimator.home import Home, UnreadableFileError, held_bytes, read_below
from vobench.temporary import BASE, remove_below


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """A folder of temporary files of its own."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    temporary_folders._sweep_once.cache_clear()
    return folder


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "folder"
    place.mkdir()
    descriptor = os.open(place, os.O_RDONLY)
    yield place, descriptor
    os.close(descriptor)


def read(descriptor, name="out", most_bytes=1000):
    return read_below(descriptor, name, most_bytes=most_bytes, check=lambda: None)


def test_a_file_is_read_also_in_a_folder(folder):
    place, descriptor = folder
    (place / "a").mkdir()
    (place / "a" / "out").write_bytes(b"x")
    (place / "out").write_bytes(b"y" * 1000)
    assert read(descriptor, "a/out") == b"x"
    assert read(descriptor) == b"y" * 1000
    with pytest.raises(FileNotFoundError):
        read(descriptor, "b/out")


def to_truth(place, truth):
    (place / "out").symlink_to(truth)


def to_nothing(place, truth):
    (place / "out").symlink_to(place / "nothing")


def linked(place, truth):
    os.link(truth, place / "out")


def linked_folder(place, truth):
    (place / "out").symlink_to(truth.parent)


def fifo(place, truth):
    os.mkfifo(place / "out")


def directory(place, truth):
    (place / "out").mkdir()


def named_socket(place, truth):
    before = Path.cwd()
    os.chdir(place)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as server:
        server.bind("out")
    os.chdir(before)


def kernel_log(place, truth):
    (place / "out").symlink_to("/proc/kmsg")


def own_memory(place, truth):
    (place / "out").symlink_to("/proc/self/mem")


def too_large(place, truth):
    with (place / "out").open("wb") as file:
        file.truncate(1 << 40)


def without_permission(place, truth):
    (place / "out").write_text("x")
    (place / "out").chmod(0)
    if os.getuid() == 0:
        pytest.skip("root may read it")


def device(place, truth):
    try:
        os.mknod(place / "out", 0o600 | 0o020000, os.makedev(1, 5))
    except PermissionError:
        pytest.skip("devices are made by root alone")


TRICKS = {
    to_truth: "is a symbolic link",
    to_nothing: "is a symbolic link",
    linked: "hard link",
    linked_folder: "is a symbolic link",
    fifo: "is no regular file",
    directory: "is no regular file",
    named_socket: "cannot be read",
    kernel_log: "is a symbolic link",
    own_memory: "is a symbolic link",
    too_large: "is larger than 1000 bytes",
    without_permission: "cannot be read",
    device: "is no regular file",
}


@pytest.mark.parametrize("trick", TRICKS, ids=lambda trick: trick.__name__)
def test_what_is_no_file_of_its_own_is_not_read_and_does_not_block(folder, tmp_path, trick):
    place, descriptor = folder
    truth = tmp_path / "truth"
    truth.write_text("truth")
    trick(place, truth)
    began = time.monotonic()
    with pytest.raises(UnreadableFileError, match=TRICKS[trick]):
        read(descriptor)
    assert time.monotonic() - began < 60


@pytest.mark.parametrize("name", ["../truth", "a/../../truth", "/etc/hosts"])
def test_nothing_outside_is_read(folder, tmp_path, name):
    place, descriptor = folder
    (place / "a").mkdir()
    (tmp_path / "truth").write_text("truth")
    with pytest.raises(UnreadableFileError, match="outside"):
        read(descriptor, name)


def test_a_linked_folder_on_the_way_is_not_entered(folder, tmp_path):
    place, descriptor = folder
    (tmp_path / "out").write_text("truth")
    (place / "a").symlink_to(tmp_path)
    with pytest.raises(UnreadableFileError, match="symbolic link"):
        read(descriptor, "a/out")


def test_a_file_that_grows_while_it_is_read_is_too_large(folder):
    place, descriptor = folder
    (place / "out").write_bytes(b"x" * 900)

    def grow():
        with (place / "out").open("ab") as file:
            file.write(b"x" * 900)

    with pytest.raises(UnreadableFileError, match="larger"):
        read_below(descriptor, "out", most_bytes=1000, check=grow)


def deepen(place, depth):
    """Nest folders, each with a file; the path is longer than any system call takes."""
    before = os.getcwd()
    os.chdir(place)
    for _ in range(depth):
        Path("file").write_text("x")
        Path("a" * 20).mkdir()
        os.chdir("a" * 20)
    os.chdir(before)


@pytest.mark.slow
def test_three_thousand_nested_folders_are_removed(folder):
    place, descriptor = folder
    deepen(place, 3000)
    assert remove_below(descriptor) == []
    assert list(place.iterdir()) == []


@pytest.mark.slow
def test_three_thousand_nested_folders_are_more_than_any_limit(folder):
    place, descriptor = folder
    deepen(place, 3000)
    before = len(os.listdir("/proc/self/fd"))
    assert held_bytes(descriptor, most=1 << 40) == (1 << 40) + 1
    assert len(os.listdir("/proc/self/fd")) == before
    remove_below(descriptor)


def test_what_lies_in_a_folder_is_added_up_and_links_are_not_followed(folder, tmp_path):
    place, descriptor = folder
    (tmp_path / "large").write_bytes(bytes(10 << 20))
    (place / "a" / "b").mkdir(parents=True)
    (place / "a" / "b" / "file").write_bytes(b"x" * (1 << 20))
    (place / "link").symlink_to(tmp_path / "large")
    held = held_bytes(descriptor, most=1 << 30)
    assert (1 << 20) <= held < (1 << 20) + 5 * 8192


def test_files_without_permissions_are_removed_and_what_links_name_stays(folder, tmp_path):
    place, descriptor = folder
    (tmp_path / "kept").mkdir()
    (tmp_path / "kept" / "file").write_text("x")
    (place / "a" / "b").mkdir(parents=True)
    (place / "a" / "b" / "link").symlink_to(tmp_path / "kept")
    (place / "link").symlink_to(tmp_path / "kept")
    (place / "a" / "b").chmod(0)
    (place / "a").chmod(0)
    assert remove_below(descriptor) == []
    assert (tmp_path / "kept" / "file").read_text() == "x"


def test_an_immutable_file_is_removed_or_named(folder):
    place, descriptor = folder
    (place / "a").mkdir()
    for name in ("file", "a/file"):
        (place / name).write_text("x")
    try:
        subprocess.run(
            ["chattr", "+i", place / "file", place / "a" / "file", place / "a"], check=True, capture_output=True
        )
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no immutable files here")
    assert remove_below(descriptor) == []
    assert list(place.iterdir()) == []


def test_a_home_is_private_locked_and_gone_afterwards(temporary, tmp_path):
    with Home(tmp_path / "log") as home:
        assert home.base.parent == temporary
        assert home.base.stat().st_mode & 0o777 == 0o700
        (home.path / "a").mkdir()
        lock = os.open(home.path.parent, os.O_RDONLY)
        with pytest.raises(BlockingIOError):
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.close(lock)
    assert list(temporary.iterdir()) == []
    assert not (tmp_path / "log").exists()


def test_a_home_that_was_renamed_is_gone_too_and_so_is_what_took_its_place(temporary, tmp_path):
    (tmp_path / "kept").write_text("x")
    with Home(tmp_path / "log") as home:
        (home.path / "file").write_text("x")
        home.path.rename(tmp_path / "elsewhere")
        home.path.symlink_to(tmp_path)
    assert not (tmp_path / "elsewhere").exists()
    assert list(temporary.iterdir()) == []
    assert (tmp_path / "kept").read_text() == "x"


def test_what_cannot_be_removed_is_noted_in_the_log(temporary, tmp_path, monkeypatch):
    monkeypatch.setattr(home_file, "remove_below", lambda _: ["stubborn"])
    home = Home(tmp_path / "log")
    home.close()
    assert "could not be removed: 'stubborn'" in (tmp_path / "log").read_text()


def test_a_folder_that_somebody_else_has_laid_out_is_not_used(temporary, tmp_path):
    (tmp_path / "trap").mkdir()
    (temporary / f"{BASE}-{os.getuid()}").symlink_to(tmp_path / "trap")
    with Home(tmp_path / "log") as home:
        assert home.path.is_relative_to(temporary)
        assert list((tmp_path / "trap").iterdir()) == []


KILLED = """
import os, signal, sys, tempfile
from pathlib import Path
tempfile.tempdir = sys.argv[1]
from vobench.estimator.home import Home
home = Home(Path(sys.argv[1], "log"))
(home.path / "a").mkdir()
(home.path / "a" / "file").write_text("x")
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_vobench_has_left_is_swept_by_the_next_and_what_is_in_use_is_not(temporary, tmp_path):
    killed = subprocess.run([sys.executable, "-c", KILLED, str(temporary)], check=False)
    assert killed.returncode == -signal.SIGKILL
    base = temporary / f"{BASE}-{os.getuid()}"
    (left,) = base.iterdir()
    with Home(tmp_path / "log") as first:
        assert not left.exists()
        temporary_folders._sweep_once.cache_clear()
        with Home(tmp_path / "log"):
            assert first.path.is_dir()
    assert list(temporary.iterdir()) == []


def test_a_hundred_homes_at_once_do_not_disturb_each_other(temporary, tmp_path):
    homes = [Home(tmp_path / "log") for _ in range(100)]
    assert len({home.path for home in homes}) == 100
    for home in homes:
        home.close()
        with suppress(OSError):
            home.close()
    assert list(temporary.iterdir()) == []
