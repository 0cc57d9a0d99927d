"""The folders of Python, its own and those that the user opens are readable; some are never opened."""

from pathlib import Path

import pytest

from vobench.estimator import isolation
from vobench.estimator.readable_folders import (
    READ_VARIABLE,
    SWITCH_VARIABLE,
    folders_opened_by_user,
    folders_readable_by_all,
    granted_folders,
    note_on_unopened,
    readable_folders,
)


@pytest.mark.parametrize(
    ("named", "unopened", "read"),
    [
        ("", "", ()),
        ("/opt/ros:/tmp/slam", "", ("/opt/ros", "/tmp/slam")),
        ("/opt/ros:/tmp", "/tmp", ("/opt/ros",)),
        ("/proc:/opt/..:/dev/", "/proc, / and /dev", ()),
    ],
)
def test_a_folder_that_is_never_opened_is_named_with_the_reason(monkeypatch, named, unopened, read):
    monkeypatch.delenv(SWITCH_VARIABLE, raising=False)
    monkeypatch.setenv(READ_VARIABLE, named)
    assert folders_opened_by_user() == read
    note = note_on_unopened()
    assert (
        note.startswith(f"{READ_VARIABLE} does not open {unopened}: estimators have their own /dev")
        if unopened
        else not note
    )


def test_without_a_sandbox_no_folder_stays_closed(monkeypatch):
    monkeypatch.setenv(READ_VARIABLE, "/tmp")
    monkeypatch.setenv(SWITCH_VARIABLE, "off")
    assert note_on_unopened() == ""


def test_the_own_folder_and_those_of_the_system_are_readable_besides_those_granted(tmp_path, monkeypatch):
    monkeypatch.setenv(READ_VARIABLE, "/opt/ros")
    granted = granted_folders(tmp_path)
    assert {"/opt/ros", str(tmp_path)} <= set(granted)
    assert set(granted_folders(None)) == set(granted) - {str(tmp_path)}
    expected = {Path(path).resolve() for path in (*isolation.SYSTEM, *granted)}
    assert set(readable_folders(tmp_path)) == expected


def test_without_a_sandbox_every_estimator_reads_everything(monkeypatch):
    monkeypatch.setenv(SWITCH_VARIABLE, "OFF")
    assert folders_readable_by_all() == [Path("/")]
    monkeypatch.delenv(SWITCH_VARIABLE)
    monkeypatch.setattr("sys.platform", "linux")
    assert Path("/") not in folders_readable_by_all()
    assert folders_readable_by_all() == readable_folders(None)
