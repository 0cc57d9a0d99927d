"""The notebook runs from its first cell to its last, on suite and scenes of the same names that take seconds."""

from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI

NOTEBOOK = Path(__file__).parents[2] / "examples" / "notebook.ipynb"
SCENE = """
name: {name}
white_cd_m2: 60
materials:
  grain: {{pattern: terrazzo, albedo: 0.5, contrast: 0.7, resolution_px: 256}}
room: {{size_m: [3, 3, 2], floor: grain, wall: grain, ceiling: grain}}
lamps: [{{name: lamp, center_m: [0, 0, 1.9], size_m: [0.5, 0.5], power_lm: 1200}}]
"""
SUITE = """
name: quickstart
scenes: [room, car_park]
rigs:
  ahead: {lens: paper_blender, picture_scale: 0.5, pitch_deg: 10}
cameras: {noisy: {sensor: mt9v034, gain_db: 4}}
trajectories: {short: {targets_m: [[0.2, 0.05]], tolerance_m: 0.04, rate_hz: 10}}
scenarios: {unlike_eyes: [1]}
spread: {over: [scene], units: 2, each: 2}
estimators: [lk_epipolar, stereo_pnp]
"""


@pytest.fixture
def small_quickstart(tmp_path, monkeypatch):
    """A working folder whose suite hides the built-in one of that name."""
    for kind in ("suites", "scenes"):
        (tmp_path / kind).mkdir()
    (tmp_path / "suites" / "quickstart.yaml").write_text(SUITE)
    for name in ("room", "car_park"):
        (tmp_path / "scenes" / f"{name}.yaml").write_text(SCENE.format(name=name))
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("VOBENCH_JOBS", "2")
    return tmp_path


@pytest.mark.filterwarnings("default")  # Jupyter's own
def test_the_notebook_runs_to_its_end(small_quickstart):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(small_quickstart)}}
    ).execute()

    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    shown = [output.get("data", {}) for output in outputs]
    tables = [data["text/html"] for data in shown if "<table" in data.get("text/html", "")]
    assert any("frame_to_frame" in table for table in tables)
    assert any("image/png" in data for data in shown)
    assert any("tasks, " in data.get("text/html", "") for data in shown)  # what a bar leaves behind
    assert not [output for output in outputs if output.output_type == "error"]
    assert (small_quickstart / "estimators" / "frame_to_frame" / "estimator.py").is_file()
