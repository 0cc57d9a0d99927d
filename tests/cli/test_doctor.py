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


def test_a_machine_that_cannot_trace_paths_is_well_and_told_how_it_could(vobench, without_mitsuba):
    said = vobench("doctor", "--json")
    row = path_tracing(said)
    assert (said.code, row["well"], row["optional"]) == (0, False, True)
    assert row["remedy"] == "python -m pip install mitsuba"
    table = vobench("doctor")
    assert table.code == 0
    assert "optional" in table.out
    assert "MISSING" not in table.out


def test_where_paths_can_be_traced_doctor_names_the_library(vobench, monkeypatch):
    monkeypatch.setattr(doctor.mitsuba, "working_library", lambda: "/opt/libLLVM.so.99")
    row = path_tracing(vobench("doctor", "--json"))
    assert (row["well"], row["result"]) == (True, "works with /opt/libLLVM.so.99")


def test_no_file_of_the_working_folder_is_imported_where_drawing_is_tried(vobench, without_mitsuba, here):
    (here / "ctypes.py").write_text("raise SystemExit('imported from the working folder')\n")
    (drawing,) = (c for c in vobench("doctor", "--json").json["checks"] if c["check"].startswith("drawing"))
    assert "working folder" not in drawing["result"]
