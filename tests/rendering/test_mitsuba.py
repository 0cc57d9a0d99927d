import os
import re
from pathlib import Path

import pytest

from vobench.errors import MissingDependencyError, SettingError
from vobench.rendering import mitsuba


@pytest.mark.parametrize(
    ("name", "major"),
    [("libLLVM-15.so.1", 15), ("libLLVM.so.19.1", 19), ("libLLVM-19.so", 19), ("libLLVM.so", 0), ("libLLVMCore.so", 0)],
)
def test_the_version_is_read_from_the_librarys_name(name, major):
    assert mitsuba.major(Path(name)) == major


def test_the_library_that_the_environment_names_is_tried_first_then_the_newest(monkeypatch, tmp_path):
    for name in ("libLLVM-14.so.1", "libLLVM-16.so.1", "libLLVM.so.19.1", "libLLVM-15.so.1"):
        (tmp_path / name).touch()
    monkeypatch.setattr(mitsuba, "FOLDERS", (str(tmp_path)[1:],))
    monkeypatch.delenv(mitsuba.VARIABLE, raising=False)
    newest_first = ["libLLVM.so.19.1", "libLLVM-16.so.1", "libLLVM-15.so.1"]
    assert [path.name for path in mitsuba.candidates()] == newest_first
    monkeypatch.setenv(mitsuba.VARIABLE, str(tmp_path / "libLLVM-15.so.1"))
    assert [path.name for path in mitsuba.candidates()] == ["libLLVM-15.so.1", "libLLVM.so.19.1", "libLLVM-16.so.1"]


def test_the_first_library_that_renders_is_taken(monkeypatch):
    pytest.importorskip("mitsuba", reason="Mitsuba is not installed")
    monkeypatch.setattr(mitsuba, "candidates", lambda: iter([Path("/bad"), Path("/good"), Path("/better")]))
    monkeypatch.setattr(mitsuba, "failure", lambda path: "" if path.name == "good" else "killed by SIGABRT")
    assert mitsuba.working_library() == Path("/good")


def test_where_no_library_renders_each_is_named_with_its_reason_and_a_remedy(monkeypatch):
    pytest.importorskip("mitsuba", reason="Mitsuba is not installed")
    monkeypatch.setattr(mitsuba, "candidates", lambda: iter([Path("/usr/lib/libLLVM-15.so.1")]))
    monkeypatch.setattr(mitsuba, "failure", lambda _: "killed by SIGABRT")
    expected = f"(libLLVM-15.so.1: killed by SIGABRT); run: {mitsuba.LLVM_REMEDY}"
    with pytest.raises(MissingDependencyError, match=re.escape(expected)):
        mitsuba.working_library()
    monkeypatch.setattr(mitsuba, "candidates", lambda: iter([]))
    with pytest.raises(MissingDependencyError, match="none found"):
        mitsuba.working_library()


def test_without_mitsuba_the_line_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(mitsuba, "find_spec", lambda _: None)
    with pytest.raises(MissingDependencyError, match=r"needs Mitsuba; run: .* -m pip install 'mitsuba"):
        mitsuba.working_library()


def test_a_file_that_is_no_library_is_refused_and_not_fatal(tmp_path):
    pytest.importorskip("mitsuba", reason="Mitsuba is not installed")
    torn = tmp_path / "libLLVM.so.99.1"
    torn.write_bytes(b"no library")
    assert mitsuba.failure(torn)


def test_a_process_that_dies_of_its_library_is_told_by_its_signal(monkeypatch):
    monkeypatch.setattr(mitsuba, "PROBE", "import os; os.abort()")
    assert mitsuba.failure(Path(os.devnull)) == "killed by SIGABRT"


def test_a_process_that_ends_without_a_word_is_told_by_its_code(monkeypatch):
    monkeypatch.setattr(mitsuba, "PROBE", "raise SystemExit(3)")
    assert mitsuba.failure(Path(os.devnull)) == "died with 3"


def test_the_environment_chooses_the_variant(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(mitsuba.VARIANT_VARIABLE, raising=False)
    assert mitsuba.wanted_variant() == mitsuba.CPU_VARIANT
    monkeypatch.setenv(mitsuba.VARIANT_VARIABLE, "cuda_ad_rgb")
    assert mitsuba.wanted_variant() == mitsuba.GPU_VARIANT


def test_another_variant_is_refused_with_those_that_are_possible(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(mitsuba.VARIANT_VARIABLE, "scalar_rgb")
    with pytest.raises(SettingError, match="should be llvm_ad_rgb or cuda_ad_rgb, got 'scalar_rgb'"):
        mitsuba.wanted_variant()
