import json
from subprocess import CompletedProcess
from types import SimpleNamespace

import pytest

from vobench.cli import doctor
from vobench.errors import MissingDependencyError


@pytest.fixture
def without_mitsuba(monkeypatch):
    def missing():
        raise MissingDependencyError("path tracing needs Mitsuba; run: python -m pip install mitsuba")

    monkeypatch.setattr(doctor.mitsuba, "working_library", missing)


def path_tracing(said) -> dict:
    return next(c for c in said.json["checks"] if c["check"] == "path tracing (Mitsuba)")


@pytest.mark.slow
def test_a_machine_that_cannot_trace_paths_is_well_and_told_how_it_could(vobench, without_mitsuba):
    said = vobench("doctor", "--json")
    row = path_tracing(said)
    assert (said.code, row["well"], row["optional"]) == (0, False, True)
    assert row["remedy"] == "python -m pip install mitsuba"
    table = vobench("doctor")
    assert table.code == 0
    assert "optional" in table.out
    assert "MISSING" not in table.out


@pytest.mark.slow
def test_where_paths_can_be_traced_doctor_names_the_library(vobench, monkeypatch):
    monkeypatch.setattr(doctor.mitsuba, "working_library", lambda: "/opt/libLLVM.so.99")
    row = path_tracing(vobench("doctor", "--json"))
    assert (row["well"], row["result"]) == (True, "works with /opt/libLLVM.so.99")


@pytest.mark.slow
def test_no_file_of_the_working_folder_is_imported_where_drawing_is_tried(vobench, without_mitsuba, here):
    (here / "ctypes.py").write_text("raise SystemExit('imported from the working folder')\n")
    (drawing,) = rows(vobench("doctor", "--json"), "drawing without a display (EGL)")
    assert drawing["well"]
    assert "working folder" not in drawing["result"]


def rows(said, name: str) -> list[dict]:
    return [check for check in said.json["checks"] if check["check"] == name]


def drawing_says(monkeypatch, content=None, *, code: int = 0, err: str = "") -> None:
    """Let the process that draws end with a code, having said something."""
    out = json.dumps(content) if content else ""
    monkeypatch.setattr(doctor.stop, "run", lambda command: CompletedProcess(command, code, out, err))


DRIVER = {"renderer": "llvmpipe", "version": "4.5", "vendor": "Mesa", "device": "1: Mesa software driver (CPU)"}
RIGHT = {"well": True, "largest_error": 2e-4, "stray_cd_m2": 0.0, "driver": DRIVER, "devices": ["0: a", "1: b"]}


def test_doctor_draws_a_picture_and_says_which_driver_and_device_drew(vobench, without_mitsuba):
    said = vobench("doctor", "--json")
    (drawing,) = rows(said, "drawing without a display (EGL)")
    assert (said.code, drawing["well"]) == (0, True)
    assert "a test image is correct, with " in drawing["result"]
    assert "OpenGL 4" in drawing["result"]
    assert "device 0: " in drawing["result"]
    (devices,) = rows(said, "drawing devices")
    assert devices["result"].endswith("VOBENCH_EGL_DEVICE selects one")


def test_a_wrong_picture_is_not_well_and_its_figures_are_said(vobench, without_mitsuba, monkeypatch):
    drawing_says(monkeypatch, {**RIGHT, "well": False, "largest_error": 0.123})
    said = vobench("doctor", "--json")
    (drawing,) = rows(said, "drawing without a display (EGL)")
    assert (said.code, drawing["well"]) == (1, False)
    assert "wrong by up to 12.3 %" in drawing["result"]
    assert "VOBENCH_EGL_DEVICE" in drawing["remedy"]


def test_a_driver_that_lacks_something_is_named_with_the_remedy_and_ends_with_1(vobench, without_mitsuba, monkeypatch):
    sentence = "cannot draw: PyOpenGL 3.1.0 has no glClipControl; run: python -m pip install 'PyOpenGL>=3.1.10'"
    drawing_says(monkeypatch, {"error": sentence})
    said = vobench("doctor")
    assert said.code == 1
    assert "cannot draw: PyOpenGL 3.1.0 has no glClipControl" in said.out
    assert said.err.strip().endswith("run: python -m pip install 'PyOpenGL>=3.1.10'")
    assert len(said.err.splitlines()) == 1


def test_a_driver_that_kills_the_process_is_not_well(vobench, without_mitsuba, monkeypatch):
    drawing_says(monkeypatch, code=-11)
    said = vobench("doctor", "--json")
    (drawing,) = rows(said, "drawing without a display (EGL)")
    assert (said.code, drawing["result"]) == (1, "the test process died with -11")


@pytest.mark.parametrize(
    ("user_id", "has_apt", "installs"), [(0, True, True), (0, False, False), (1000, True, False), (1000, False, False)]
)
def test_fix_installs_with_apt_as_root_alone(monkeypatch, user_id, has_apt, installs):
    commands = []
    monkeypatch.setattr(doctor.os, "geteuid", lambda: user_id)
    monkeypatch.setattr(doctor.shutil, "which", lambda _: "/usr/bin/apt-get" if has_apt else None)
    monkeypatch.setattr(doctor.subprocess, "run", lambda command, **_: commands.append(command[:3]))
    monkeypatch.setattr(doctor, "_check_drawing", lambda: ["checked again"])
    assert doctor._install_drawing() == ["checked again"]
    assert commands == ([["apt-get", "-qq", "update"], ["apt-get", "-qq", "install"]] if installs else [])


@pytest.mark.parametrize(("user_id", "command"), [(0, "apt-get install x"), (1000, "sudo apt-get install x")])
def test_a_remedy_is_a_command_that_this_user_can_run(monkeypatch, user_id, command):
    monkeypatch.setattr(doctor.os, "geteuid", lambda: user_id)
    assert doctor._with_sudo("apt-get install x") == command


def test_a_missing_library_is_named_with_the_command_that_installs_it(monkeypatch):
    needed = ["numpy>=2", "no_such_library>=1 ; python_version > '3'", "mitsuba ; extra == 'path'"]
    monkeypatch.setattr(doctor, "requires", lambda _: needed)
    check = doctor._check_libraries()
    assert (check.well, check.result) == (False, "missing: no_such_library")
    assert check.remedy.endswith("-m pip install no_such_library")
    monkeypatch.setattr(doctor, "requires", lambda _: needed[:1])
    assert (doctor._check_libraries().well, doctor._check_libraries().result) == (True, "all installed")


@pytest.mark.parametrize(
    ("level", "why", "result"),
    [
        ("full", "", "estimators see their own files and nothing else"),
        ("files", "no namespaces", "estimators can see the network (no namespaces); every trial records this"),
        ("files", "", "estimators can see the network; every trial records this"),
    ],
)
def test_the_sandbox_is_optional_and_what_estimators_can_see_is_named(monkeypatch, level, why, result):
    monkeypatch.setattr(doctor, "sandbox_here", lambda: SimpleNamespace(level=level, why=why, sees=("the network",)))
    check = doctor._check_sandbox()
    assert (check.well, check.result, check.optional) == (level == "full", result, True)
    assert bool(check.remedy) is not check.well
