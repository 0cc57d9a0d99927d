"""A key changes with all that a result depends on, and with nothing else: not with words about the code."""

import shutil
import sys
from pathlib import Path

import pytest

from vobench.estimator.readable_folders import READ_VARIABLE, SWITCH_VARIABLE
from vobench.runner import key
from vobench.runner.key import PACKAGE, closure, code_digest, folder_digest, imported_by
from vobench.runner.task import ENTRIES
from vobench.suite.catalog import builtin_root


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """A copy of the package's source."""
    folder = tmp_path_factory.mktemp("tree") / "vobench"
    shutil.copytree(PACKAGE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


@pytest.fixture
def digest_after(tree):
    """Digests of the code of a stage, or of modules, before and after a text in a file is replaced by another."""

    def change(stage: str | list[str], file: str, old: str, new: str) -> tuple[str, str]:
        path = tree / file
        entries = ENTRIES[stage] if isinstance(stage, str) else stage
        before, text = code_digest(*entries, package=tree), path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))
        code_digest.cache_clear()
        after = code_digest(*entries, package=tree)
        path.write_text(text)
        code_digest.cache_clear()
        return before, after

    return change


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"""', '"""More words. '),
        ("import numpy as np\n", "# A comment.\n\n\nimport numpy as np  # and another\n"),
        ("\ndef inverse", "\n# A comment moves every line below.\ndef inverse"),
    ],
)
def test_words_about_the_code_change_no_key(digest_after, old, new):
    before, after = digest_after("sequence", "geometry/se3.py", old, new)
    assert before == after == code_digest(*ENTRIES["sequence"])


@pytest.mark.parametrize("stage", ["bake", "sequence", "import", "estimate", "score"])
def test_an_operator_in_a_module_that_all_reach_changes_every_key(digest_after, stage):
    before, after = digest_after(stage, "geometry/se3.py", " @ ", " * ")
    assert before != after


@pytest.mark.parametrize(
    ("stage", "file", "is_of_it"),
    [
        ("sequence", "report/verify.py", False),
        ("sequence", "runner/score.py", False),
        ("sequence", "metric/ate.py", False),
        ("sequence", "rendering/raster.py", True),  # which is imported when the first picture is drawn
        ("sequence", "runner/stereo_camera.py", True),
        ("bake", "motion/drive.py", False),
        ("bake", "rendering/indirect_light.py", True),
        ("bake", "rendering/wet_ground.py", True),
        ("bake", "rendering/rain_streaks.py", False),
        ("estimate", "motion/drive.py", False),
        ("estimate", "rendering/draw.py", False),
        ("estimate", "suite/suite.py", False),
        ("estimate", "estimator/worker.py", True),  # which runs in the estimator's process
        ("import", "dataset/kitti.py", True),
        ("import", "rendering/draw.py", False),
        ("score", "metric/ate.py", True),
        ("score", "rendering/draw.py", False),
    ],
)
def test_code_counts_where_the_stage_reaches_it_and_nowhere_else(digest_after, stage, file, is_of_it):
    before, after = digest_after(stage, file, "\nfrom ", "\nADDED = 1\nfrom ")
    assert (before != after) is is_of_it


def test_a_shader_counts_as_code_of_what_draws(tree, digest_after):
    shader = next((tree / "rendering" / "shaders").glob("surface.frag")).relative_to(tree)
    assert len(set(digest_after("sequence", str(shader), ";", "; "))) == 2
    assert len(set(digest_after("estimate", str(shader), ";", "; "))) == 1


def test_what_only_a_type_checker_imports_is_not_reached(tmp_path):
    (tmp_path / "runner").mkdir()
    (tmp_path / "runner" / "a.py").write_text(
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from vobench.runner import b\n\n    X = 1\n\n"
        "def f():\n    from vobench.runner.c import g\n"
    )
    (tmp_path / "runner" / "b.py").write_text("")
    (tmp_path / "runner" / "c.py").write_text("import vobench.runner.a\n")
    assert set(closure(["vobench.runner.a"], package=tmp_path)) == {"vobench.runner.a", "vobench.runner.c"}


def test_an_estimators_imports_are_found_and_one_that_is_no_python_has_none(tmp_path):
    (tmp_path / "estimator.py").write_text("from vobench.geometry import se3\nimport vobench.motion.motor\n")
    (tmp_path / "broken.py").write_text("def (")
    assert {"vobench.geometry.se3", "vobench.motion.motor"} <= set(imported_by(tmp_path))
    assert not any("vobench.rendering" in name for name in imported_by(tmp_path))
    assert imported_by(Path(tmp_path / "nowhere")) == []


def test_the_code_of_a_module_is_read_once_in_a_process(monkeypatch):
    digest = code_digest(*ENTRIES["score"])
    monkeypatch.setattr(key, "closure", None)
    assert code_digest(*ENTRIES["score"]) == digest


@pytest.mark.parametrize("broken", [None, b"", b"{", b'{"digest": 1, "imports": []}', b"\0" * 100])
def test_what_is_kept_of_modules_spares_time_and_changes_nothing(tmp_path, monkeypatch, broken):
    compiled, read = key._compiled, []
    monkeypatch.setattr(key, "_compiled", lambda source: read.append(source) or compiled(source))

    def anew(cache: Path) -> set[str]:
        monkeypatch.setenv("VOBENCH_CACHE", str(cache))
        for each in (key._module, code_digest):
            each.cache_clear()
        read.clear()
        return {code_digest("vobench.trajectory.associate")}

    digest = anew(tmp_path / "cache")
    assert read
    assert anew(tmp_path / "cache") == digest
    assert not read
    kept = list((tmp_path / "cache" / "modules").iterdir())
    for path in kept:
        path.unlink() if broken is None else path.write_bytes(broken)
    assert anew(tmp_path / "cache") == digest
    assert len(read) == len(kept)
    (tmp_path / "file").touch()
    assert anew(tmp_path / "file") == digest


def modules_behind(tmp_path, source: str) -> set[str]:
    """The modules that an estimator with this source depends on, itself and those that these import."""
    (tmp_path / "estimator.py").write_text(source)
    return set(closure(imported_by(tmp_path)))


def test_a_name_of_the_plugin_module_stands_for_the_module_it_lives_in(tmp_path):
    modules = modules_behind(tmp_path, "from vobench.plugin import Result, StereoTracker, se3\n")
    assert {"vobench.estimator.stereo_tracker", "vobench.estimator.stereo", "vobench.geometry.se3"} <= modules
    assert not {"vobench.asset.shape", "vobench.metric.comparison", "vobench.dataset.layout"} & modules


def test_an_estimator_that_takes_little_from_the_plugin_module_depends_on_little(tmp_path):
    modules = modules_behind(tmp_path, "from vobench.plugin import Result\n")
    assert "vobench.estimator.protocol" in modules
    assert "vobench.estimator.tracking" not in modules


@pytest.mark.parametrize(
    "source",
    [
        "import vobench.plugin\n\ndef f(rig):\n    return vobench.plugin.stereo_pair(rig, 'mine')\n",
        "import vobench.plugin as vp\n\nclass A:\n    def f(self, rig):\n        return vp.stereo_pair(rig, 'mine')\n",
        "from vobench import plugin\n\ndef f(rig):\n    return plugin.stereo_pair(rig, 'mine')\n",
        "from vobench.plugin import *\n\ndef f(rig):\n    return stereo_pair(rig, 'mine')\n",
        "def f(rig):\n    from vobench.plugin import stereo_pair as pair\n    return pair(rig, 'mine')\n",
    ],
)
def test_a_name_is_found_however_the_plugin_module_is_imported(tmp_path, source):
    modules = modules_behind(tmp_path, source)
    assert "vobench.estimator.stereo" in modules
    assert "vobench.asset.shape" not in modules


def test_a_retired_name_stands_for_the_module_it_lives_in_now(tmp_path):
    assert "vobench.geometry.rig" in modules_behind(tmp_path, "from vobench.geometry.rectify import rectification\n")


def test_what_an_estimators_test_imports_does_not_count(tmp_path):
    (tmp_path / "test_contract.py").write_text("from vobench.plugin import assert_contract\n")
    assert modules_behind(tmp_path, "from vobench.plugin import Result\n").isdisjoint({"vobench.report.contract"})


@pytest.mark.parametrize(
    ("estimator", "file", "is_of_it"),
    [
        ("stereo_pnp", "estimator/stereo_tracker.py", True),
        ("stereo_pnp", "asset/shape.py", False),
        ("stand_still", "estimator/stereo_tracker.py", False),
        ("stand_still", "plugin.py", False),
    ],
)
def test_a_built_in_estimators_key_changes_with_the_code_behind_its_names(
    tree, digest_after, estimator, file, is_of_it
):
    folder = builtin_root() / "estimators" / estimator
    before, after = digest_after(imported_by(folder, package=tree), file, "\nfrom ", "\nADDED = 1\nfrom ")
    assert (before != after) is is_of_it


@pytest.mark.skipif(sys.platform != "linux", reason="the sandbox is Linux's")
def test_links_that_lead_out_of_a_folder_or_in_circles_do_not_count_and_are_not_walked(tmp_path, monkeypatch):
    monkeypatch.delenv(READ_VARIABLE, raising=False)
    monkeypatch.delenv(SWITCH_VARIABLE, raising=False)
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "weights").write_text("1")
    own = tmp_path / "own"
    own.mkdir()
    (own / "estimator.py").write_text("pass")
    alone = folder_digest(own)
    (own / "processes").symlink_to("/proc")
    (own / "outside").symlink_to(outside)
    (own / "itself").symlink_to("itself")
    assert folder_digest(own) == alone
    (own / "a").symlink_to(".")
    (own / "b").symlink_to(".")
    in_circles = folder_digest(own)
    assert folder_digest(own) == in_circles


@pytest.mark.skipif(sys.platform != "linux", reason="the sandbox is Linux's")
def test_what_a_link_leads_to_counts_where_the_folder_is_opened_to_estimators(tmp_path, monkeypatch):
    monkeypatch.delenv(SWITCH_VARIABLE, raising=False)
    monkeypatch.setenv(READ_VARIABLE, str(tmp_path / "outside"))
    outside = tmp_path / "outside"
    outside.mkdir()
    own = tmp_path / "own"
    own.mkdir()
    (own / "outside").symlink_to(outside)
    digests = set()
    for weights in ("1", "2"):
        (outside / "weights").write_text(weights)
        digests.add(folder_digest(own))
    assert len(digests) == 2
