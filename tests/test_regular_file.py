"""Only regular files are read, and nothing else is waited for."""

import os

import pytest

from vobench.regular_file import open_regular, read_regular


def test_the_first_bytes_of_a_file_are_read(tmp_path):
    (tmp_path / "file").write_bytes(b"abcdef")
    assert read_regular(tmp_path / "file", most_bytes=4) == b"abcd"
    with open_regular(tmp_path / "file") as file:
        assert file.read() == b"abcdef"


def test_a_pipe_a_device_and_a_link_to_one_are_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to("/dev/zero")
    for name in ("pipe", "link"):
        with pytest.raises(OSError, match="not a regular file"):
            open_regular(tmp_path / name)
