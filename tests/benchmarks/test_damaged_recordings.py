"""Short form of the benchmark of damaged recordings: blur is named, and nothing is named without damage."""

from pathlib import Path

import pytest

from tests.benchmarks.loading import load
from vobench.rendering import bake

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI


def test_blur_of_a_recording_is_named_and_nothing_without_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VOBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(bake, "bake", bake.bake)  # so that it is restored
    damaged = load("damaged_recordings")
    damaged.coarse_light()
    run_plan = damaged.plan_runner(tmp_path / "runs")
    base = damaged.simulate(tmp_path, "hall", run_plan)
    place = damaged.write_place(tmp_path, damaged.TWIN_PLACE)

    unharmed = damaged.judge("nothing", base, place, run_plan)
    assert unharmed.is_right, unharmed.line
    blurred = damaged.judge("defocus", base, place, run_plan)
    assert blurred.is_right, blurred.line
    assert blurred.is_alike, blurred.line
