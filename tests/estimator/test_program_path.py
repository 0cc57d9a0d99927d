"""A program is looked for where an estimator may read; what it may not read is named."""

from vobench.estimator.program_path import hint_on_modules, is_unreadable_program, program_path
from vobench.estimator.readable_folders import READ_VARIABLE


def test_a_program_is_the_first_on_path_that_an_estimator_may_read(tmp_path, monkeypatch):
    shim = tmp_path / "shims" / "sh"
    shim.parent.mkdir()
    shim.write_text("#!/bin/sh\n")
    shim.chmod(0o755)
    monkeypatch.setenv("PATH", f"{shim.parent}:/usr/bin:/bin")
    assert program_path("sh", None) in ("/usr/bin/sh", "/bin/sh")
    assert program_path("sh", shim.parent) == str(shim)  # its own folder
    assert program_path(str(shim), None) == str(shim)
    monkeypatch.setenv("PATH", str(shim.parent))
    assert program_path("sh", None) == str(shim)
    assert is_unreadable_program("sh", None)


def test_a_program_that_is_nowhere_keeps_its_name(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert program_path("no_such_program", None) == "no_such_program"
    assert not is_unreadable_program("no_such_program", None)


def test_only_module_folders_that_exist_and_are_out_of_reach_are_named(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:/usr/lib:{tmp_path / 'missing'}")
    assert hint_on_modules(None) == (
        f"; PYTHONPATH has {tmp_path}, which an estimator may not read: name it in {READ_VARIABLE}"
    )
    assert hint_on_modules(tmp_path) == ""
