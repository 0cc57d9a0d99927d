"""Names of an earlier release work for one more, or say what replaces them in one sentence, in every kind of plugin."""

import importlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vobench import retired

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI


@pytest.mark.parametrize(("module", "name"), [(m, name) for m, names in retired.MOVED.items() for name in names])
def test_every_name_that_moved_works_and_warns(module: str, name: str) -> None:
    new_place = retired.MOVED[module][name]
    home, _, new_name = new_place.rpartition(".")
    with pytest.warns(
        DeprecationWarning, match=f"{module}.{name} is now {new_place}; the old name will be removed"
    ) as caught:
        value = getattr(importlib.import_module(module), name)
    assert value is getattr(importlib.import_module(home), new_name)
    assert caught[0].filename == __file__


@pytest.mark.parametrize(("module", "name"), [(m, name) for m, names in retired.GONE.items() for name in names])
def test_every_name_that_has_gone_says_what_replaces_it(module: str, name: str) -> None:
    with pytest.raises(ImportError, match=f"{module}.{name} was removed: ") as raised:
        getattr(importlib.import_module(module), name)
    for word in str(raised.value).split(": ", 1)[1].split():
        place, _, offered = word.strip(",`").rpartition(".")
        if place.startswith("vobench"):
            assert hasattr(importlib.import_module(place), offered) or offered == "open", word


def test_a_name_that_a_retired_module_never_had_is_one_sentence() -> None:
    with pytest.raises(ImportError, match=r"^vobench\.geometry\.rectify was removed, with warp; import from"):
        from vobench.geometry.rectify import warp  # noqa: F401


@pytest.mark.parametrize("module", ["vobench.render", "vobench.run.folder", "vobench.robot.drive"])
def test_a_renamed_room_says_its_new_name(module: str) -> None:
    room = ".".join(module.split(".")[:2])
    with pytest.raises(
        ModuleNotFoundError,
        match=f"{room} is now {retired.ROOMS[room]}; import from vobench.plugin what plugins may use",
    ):
        importlib.import_module(module)


def test_a_module_that_never_was_is_missing_as_ever() -> None:
    with pytest.raises(ModuleNotFoundError, match=r"^No module named 'vobench\.nothing'$"):
        importlib.import_module("vobench.nothing")


# Plugins of an earlier release: an estimator, a maker, a layout and a metric as they were written then.
ESTIMATOR = """
import numpy as np
from vobench.estimator import Result, Status
from vobench.geometry.rectify import NAME

class Old:
    def start(self, rig, params, seed):
        self.views = NAME(rig)

    def process(self, frame):
        return Result(np.eye(4), Status.OK if self.views else Status.DEGRADED)
"""
MANIFEST = "name: old\nversion: '1'\nclass: estimator:Old\nneeds: [stereo]\npose_of: left_camera\nsummary: Old\n"
MAKER = """
from vobench.scene.material import Material
from vobench.scene.surface import box

def make(seed):
    return box((0, 0, 0.5), (1, 1, 1), "stone"), {"stone": Material()}
"""
LAYOUT = """
from vobench.dataset.layout import Layout
from vobench.dataset.options import Options
from vobench.dataset.recording import assemble
IMPORT

LAYOUT = Layout("old", "old.txt", lambda path: (path / "old.txt").is_file(), lambda path, options: None)
"""
METRIC = """
from vobench.metric.comparison import POSES, MetricDefinition
from vobench.metric.pose_error import angle_rad
IMPORT

METRIC = MetricDefinition("ate_old", "", "rad", "", "", POSES, "", measure=lambda of: angle_rad(of.T_aligned))
"""

Said = subprocess.CompletedProcess[str]


@pytest.fixture
def vobench(tmp_path: Path) -> Callable[..., Said]:
    """Run vobench in a process of its own, in a folder whose `site` is on the path."""

    def run(*words: str) -> Said:
        code = f"import sys; sys.path.insert(0, {str(tmp_path / 'site')!r}); from vobench.cli import main; main()"
        command = [sys.executable, "-c", code, *words]
        return subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)

    return run


def install(folder: Path, group: str, module: str, source: str, name: str) -> None:
    """Make `site` the home of a distribution with one entry point."""
    site = folder / "site"
    metadata = site / f"{module}-1.dist-info"
    metadata.mkdir(parents=True)
    (site / f"{module}.py").write_text(source)
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(f"[{group}]\nold = {module}:{name}\n")


def write_estimator(folder: Path, name: str) -> None:
    (folder / "old").mkdir()
    (folder / "old" / "estimator.yaml").write_text(MANIFEST)
    (folder / "old" / "estimator.py").write_text(ESTIMATOR.replace("NAME", name))


def test_an_old_estimators_trial_ends_with_the_sentence_that_names_the_new_place(
    vobench: Callable[..., Said], tmp_path: Path
) -> None:
    write_estimator(tmp_path, "rectify")
    done = vobench("try", "./old")
    assert done.returncode == 1
    sentence = (
        "ImportError: vobench.geometry.rectify.rectify was removed: vobench.plugin.rectification gives the rectified"
    )
    assert sentence in done.stdout
    # Before it is run, the line that has to change is named.
    assert "estimator.py:4: vobench.geometry.rectify.rectify: vobench.plugin.rectification gives" in done.stdout


def test_an_old_estimator_whose_name_moved_still_runs_and_is_told(vobench: Callable[..., Said], tmp_path: Path) -> None:
    write_estimator(tmp_path, "rectification")
    done = vobench("try", "./old")
    assert done.returncode == 0, done.stdout + done.stderr
    advice = "estimator.py:4: vobench.geometry.rectify.rectification: from vobench.plugin import rectification"
    assert advice in done.stdout


def test_an_old_maker_ends_with_the_sentence_that_names_the_new_place(
    vobench: Callable[..., Said], tmp_path: Path
) -> None:
    (tmp_path / "maker.py").write_text(MAKER)
    (tmp_path / "old.yaml").write_text("name: old\nwhite_cd_m2: 50\nmaker: maker.py\n")
    done = vobench("scene", "./old.yaml")
    assert done.returncode == 1
    assert "ImportError: vobench.scene.surface.box was removed: vobench.plugin.block makes a box" in done.stderr


def test_an_old_layout_ends_with_the_sentence_that_names_the_new_place(
    vobench: Callable[..., Said], tmp_path: Path
) -> None:
    source = LAYOUT.replace("IMPORT", "from vobench.dataset.yaml_values import read_yaml")
    install(tmp_path, "vobench.datasets", "old_layout", source, "LAYOUT")
    done = vobench("info", ".")
    assert done.returncode == 1
    assert (
        "the layout old_layout:LAYOUT does not load (ImportError: vobench.dataset.yaml_values.read_yaml" in done.stderr
    )
    assert "was removed: vobench.plugin.chain_rig reads Kalibr's files" in done.stderr


def test_an_old_metric_ends_with_the_sentence_that_names_the_new_place(
    vobench: Callable[..., Said], tmp_path: Path
) -> None:
    source = METRIC.replace("IMPORT", "from vobench.metric.measure import Metric, Samples")
    install(tmp_path, "vobench.metrics", "old_metric", source, "METRIC")
    done = vobench("metrics")
    assert done.returncode == 1
    sentence = "the metric old_metric:METRIC does not load (ImportError: vobench.metric.measure.Metric was removed: "
    assert f"{sentence}vobench.plugin.MetricDefinition is a metric)" in done.stderr


def test_an_old_layout_and_metric_whose_names_moved_still_work_and_warn(
    vobench: Callable[..., Said], tmp_path: Path
) -> None:
    install(tmp_path, "vobench.datasets", "old_layout", LAYOUT.replace("IMPORT", ""), "LAYOUT")
    install(tmp_path, "vobench.metrics", "old_metric", METRIC.replace("IMPORT", ""), "METRIC")
    done = vobench("metrics", "ate_old")
    assert done.returncode == 0
    assert (
        "old_metric.py:3: DeprecationWarning: vobench.metric.pose_error.angle_rad is now vobench.metric" in done.stderr
    )
    done = vobench("info", ".")
    assert "DeprecationWarning: vobench.dataset.options.Options is now vobench.plugin.ReadOptions; the" in done.stderr
