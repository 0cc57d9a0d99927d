"""Compiled functions agree with Python's, and run where no file can be written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vobench.rendering.ray_kernels import fresnel_of, tangents_of
from vobench.scene.material import fresnel

CALL = "from vobench.rendering.ray_kernels import fresnel_of; print(fresnel_of(1.0, 1.5))"


@pytest.mark.parametrize("cosine", [0.05, 0.4, 1.0])
def test_a_compiled_function_gives_what_the_formula_in_numpy_gives(cosine: float) -> None:
    assert fresnel_of(cosine, 1.5) == pytest.approx(float(fresnel(cosine, 1.5)), rel=1e-12)
    assert fresnel_of(cosine, 1.5) == pytest.approx(fresnel_of.py_func(cosine, 1.5), rel=1e-12)  # type: ignore[attr-defined]


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.6, 0.0, 0.8), (0.0, -0.28, 0.96)])
def test_tangents_are_at_right_angles_to_the_normal_and_to_each_other(normal: tuple[float, float, float]) -> None:
    tangents = tangents_of(*normal)
    u, v = tangents[:3], tangents[3:]
    for first, second, expected in [(u, u, 1), (v, v, 1), (u, v, 0), (u, normal, 0), (v, normal, 0)]:
        product = sum(one * other for one, other in zip(first, second, strict=True))
        assert product == pytest.approx(expected, abs=1e-12)


def called(cache: Path, **variables: str) -> str:
    environment = {name: text for name, text in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"VOBENCH_CACHE": str(cache), **variables}
    done = subprocess.run([sys.executable, "-c", CALL], env=environment, check=True, capture_output=True, text=True)
    return done.stdout


def kept_files(folder: Path) -> list[Path]:
    return list(folder.rglob("*fresnel_of*.nbc"))


def test_machine_code_is_kept_in_the_cache_folder(tmp_path: Path) -> None:
    called(tmp_path)
    (kept,) = kept_files(tmp_path / "kernels")
    written_ns = kept.stat().st_mtime_ns
    called(tmp_path)
    assert kept.stat().st_mtime_ns == written_ns


def test_machine_code_is_kept_in_the_folder_that_numbas_own_variable_names(tmp_path: Path) -> None:
    called(tmp_path / "cache", NUMBA_CACHE_DIR=str(tmp_path / "other"))
    assert len(kept_files(tmp_path / "other")) == 1
    assert kept_files(tmp_path / "cache") == []


def test_functions_run_where_the_cache_folder_cannot_be_created(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert float(called(blocked)) == pytest.approx(0.04)
