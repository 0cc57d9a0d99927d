"""The manifest of an estimator: all of its mistakes at once, and who may be an oracle. More: tests/estimator."""

import shutil

import pytest

from vobench.errors import SuiteError
from vobench.suite.catalog import builtin_root
from vobench.suite.manifest import read_manifest

GOOD = "name: mine\nversion: '1'\nclass: estimator:Mine\npose_of: body\nsummary: Mine.\n"


@pytest.fixture
def write(tmp_path):
    """Writes an estimator's manifest and returns its folder."""

    def write(text):
        folder = tmp_path / "estimators" / "mine"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "estimator.yaml").write_text(text)
        return folder

    return write


def test_a_folder_without_a_manifest_is_named(tmp_path):
    with pytest.raises(SuiteError, match=str(tmp_path / "estimator.yaml")):
        read_manifest(tmp_path)


def test_all_mistakes_of_a_manifest_are_said_at_once_each_with_its_line(write):
    folder = write(GOOD.replace("version:", "verson:").replace("pose_of: body", "pose_of: head"))
    with pytest.raises(SuiteError) as refused:
        read_manifest(folder)
    lines = [str(mistake) for mistake in refused.value.mistakes]
    assert [line.split(" ")[0] for line in lines] == [
        f"{folder}/estimator.yaml:2:",
        f"{folder}/estimator.yaml:4:",
    ]
    assert "Did you mean 'version'?" in lines[0]


def test_only_an_estimator_of_the_house_may_use_the_ground_truth(write):
    folder = write(GOOD)
    assert not read_manifest(folder).oracle
    oracle = builtin_root() / "estimators" / "noisy_truth"
    assert read_manifest(oracle).oracle

    copied = folder.parent / "noisy_truth"
    shutil.copytree(oracle, copied)
    with pytest.raises(SuiteError, match="oracle: only estimators included with vobench may use the ground truth"):
        read_manifest(copied)


def test_a_link_to_an_estimator_of_the_house_is_that_estimator(tmp_path):
    link = tmp_path / "noisy_truth"
    link.symlink_to(builtin_root() / "estimators" / "noisy_truth")
    assert read_manifest(link).oracle
