"""A Python program builds no stranger's scene where there is no sandbox, before it trusts the maker."""

from pathlib import Path

import pytest

import vobench
from vobench import trust
from vobench.errors import InputError, SuiteError
from vobench.suite import maker as maker_file
from vobench.suite.maker import create_scene

MAKER = """
import trimesh
from vobench.plugin import Thing

def make(seed):
    open({mark!r}, "w").write("ran")
    return [], {{}}
"""


@pytest.fixture
def strange(tmp_path, monkeypatch):
    """The maker of somebody else, on a machine without a sandbox, for a program in another folder."""
    python_gate = trust.Gate(trust._announce_nothing, trusted_folders=lambda: (Path.cwd(),), hash_folder=lambda: None)
    monkeypatch.setattr(trust, "_gates", [python_gate])
    monkeypatch.setattr(maker_file, "_is_contained", lambda: False)
    (tmp_path / "mine").mkdir()
    (tmp_path / "theirs").mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    maker = tmp_path / "theirs" / "maker.py"
    maker.write_text(MAKER.format(mark=str(tmp_path / "theirs" / "mark")))
    return maker


def build(maker):
    """What is said of a scene that cannot be built, because its maker is refused or makes nothing."""
    with pytest.raises(SuiteError) as raised:
        create_scene(maker, seed=1, scene_name="hall")
    return str(raised.value)


def test_a_maker_that_is_not_trusted_does_not_run(strange):
    assert "vobench.trust_maker" in build(strange)


def test_a_trusted_maker_runs_until_its_code_changes(strange):
    vobench.trust_maker(strange)
    assert "vobench.trust_maker" not in build(strange)
    strange.with_name("beside.py").write_text("x = 1")
    assert "vobench.trust_maker" in build(strange)


def test_a_maker_that_does_not_exist_is_no_maker(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        vobench.trust_maker(tmp_path / "maker.py")
