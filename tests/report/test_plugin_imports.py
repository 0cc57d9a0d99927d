"""Imports of a plugin from the inside of vobench, and the public names to use instead."""

import pytest

from vobench.report.plugin_imports import foreign_imports

# ruff: noqa: E501 - a message is one line

IMPORTS = [
    ("from vobench.geometry import se3", "vobench.geometry.se3: from vobench.plugin import se3"),
    ("import vobench.geometry.se3", "vobench.geometry.se3: from vobench.plugin import se3"),
    ("from vobench.estimator import Result", "vobench.estimator.Result: from vobench.plugin import Result"),
    ("from vobench.asset.shape import block", "vobench.asset.shape.block: from vobench.plugin import block"),
    (
        "from vobench.dataset.picture import EncodedPicture",
        "vobench.dataset.picture.EncodedPicture: from vobench.plugin import RecordedPicture",
    ),
    (
        "from vobench.scene.material import Picture",
        "vobench.scene.material.Picture: from vobench.plugin import Picture",
    ),
    (
        "from vobench.dataset.picture import inside",
        "vobench.dataset.picture.inside: vobench.plugin does not offer it, so it may change or be removed without notice",
    ),
    (
        "from vobench.metric.scale import ate_scale",
        "vobench.metric.scale.ate_scale: it is vobench.metric.comparison.ate_scale now, which vobench.plugin does not offer",
    ),
    ("from vobench.scene.surface import box", "vobench.scene.surface.box: vobench.plugin.block makes a box"),
    (
        "from vobench import geometry",
        "vobench.geometry: vobench.plugin does not offer it, so it may change or be removed without notice",
    ),
]


@pytest.mark.parametrize(("line", "seen"), IMPORTS, ids=[line for line, _ in IMPORTS])
def test_an_import_from_inside_of_vobench_is_an_advice_with_its_line_and_the_public_name(tmp_path, line, seen):
    (tmp_path / "estimator.py").write_text(f"import numpy\n\ndef f():\n    {line}\n")
    ((path, foreign),) = foreign_imports(tmp_path)
    assert (str(path), foreign.line) == ("estimator.py", 4)
    assert f"{foreign.full_name}: {foreign.remedy}" == seen


@pytest.mark.parametrize(
    "line",
    [
        "from vobench.plugin import Result, se3",
        "import vobench.plugin as vp",
        "from vobench import plugin, score",
        "import vobench",
        "import numpy",
        "from . import other",
        "from .vobench import inner",
    ],
)
def test_public_imports_are_no_advice(tmp_path, line):
    (tmp_path / "estimator.py").write_text(f"{line}\n")
    assert list(foreign_imports(tmp_path)) == []


def test_files_below_the_folder_are_read_too_and_one_that_is_no_python_is_left_to_the_run(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "tracking.py").write_text("from vobench.geometry.rig import Rig\n")
    (tmp_path / "broken.py").write_text("def (")
    assert [(str(path), foreign.line) for path, foreign in foreign_imports(tmp_path)] == [("inner/tracking.py", 1)]
