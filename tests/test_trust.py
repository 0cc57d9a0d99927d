"""Without a sandbox strange makers run once they are trusted; on the command line all are named."""

import pickle
from pathlib import Path

import pytest

from vobench import trust
from vobench.errors import SuiteError
from vobench.suite.catalog import builtin_root


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Asks for a maker as a command does that stands in a folder of its own; returns what it says."""
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path / "mine")

    def ask(maker: Path, *sources: bytes, trusts_new: bool = False, is_contained: bool = False) -> list[str]:
        told = []
        with trust.gate(
            told.append, trusted_folders=lambda: (builtin_root(), Path.cwd()), hash_folder=lambda: tmp_path / "trusted"
        ):
            if trusts_new:
                trust.trust_new()
            for _ in range(2):
                trust.admit(maker, sources or (b"code",), "hall", is_contained=is_contained)
        return told

    return ask


def test_ours_and_those_below_the_working_folder_run_and_are_named_once(asked, tmp_path):
    for maker in (builtin_root() / "scenes" / "hall" / "maker.py", tmp_path / "mine" / "sub" / "maker.py"):
        assert asked(maker) == [f"scene hall runs the program {maker}"]


def test_a_strange_one_is_refused_until_it_is_trusted_and_again_when_it_changes(asked, tmp_path):
    maker = tmp_path / "strangers" / "maker.py"
    with pytest.raises(SuiteError, match=r"--trust, .* once for each version of it"):
        asked(maker)
    assert asked(maker, trusts_new=True) == [f"scene hall runs the program {maker}"]
    assert asked(maker) == [f"scene hall runs the program {maker}"]
    with pytest.raises(SuiteError, match="--trust"):
        asked(maker, b"other code")
    with pytest.raises(SuiteError, match="--trust"):
        asked(maker, b"co", b"de")  # two files that are one in a row


def test_one_in_a_sandbox_needs_no_trust_and_is_named_all_the_same(asked, tmp_path):
    maker = tmp_path / "strangers" / "maker.py"
    assert asked(maker, is_contained=True) == [f"scene hall runs the program {maker}"]
    assert not (tmp_path / "trusted").exists()


def test_a_link_in_the_working_folder_does_not_make_a_strange_one_ours(asked, tmp_path):
    strange = tmp_path / "maker.py"
    strange.write_text("")
    link = tmp_path / "mine" / "maker.py"
    link.symlink_to(strange)
    with pytest.raises(SuiteError, match="--trust"):
        asked(link)


@pytest.fixture
def python(tmp_path, monkeypatch):
    """A program that has imported vobench, in a folder of its own."""
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    python_gate = trust.Gate(trust._announce_nothing, trusted_folders=lambda: (Path.cwd(),), hash_folder=lambda: None)
    monkeypatch.setattr(trust, "_gates", [python_gate])


def test_from_python_a_strange_one_is_refused_and_the_function_named_that_trusts_it(python, tmp_path):
    with pytest.raises(SuiteError, match=r"vobench\.trust_maker"):
        trust.admit(tmp_path / "maker.py", [b"code"], "hall", is_contained=False)


def test_from_python_those_below_the_working_folder_and_those_in_a_sandbox_run(python, tmp_path):
    trust.admit(tmp_path / "mine" / "maker.py", [b"code"], "hall", is_contained=False)
    trust.admit(tmp_path / "maker.py", [b"code"], "hall", is_contained=True)


def test_a_version_that_a_program_trusts_runs_and_no_other(python, tmp_path):
    trust.trust_version([b"co", b"de"])
    trust.admit(tmp_path / "maker.py", [b"co", b"de"], "hall", is_contained=False)
    with pytest.raises(SuiteError, match="trust_maker"):
        trust.admit(tmp_path / "maker.py", [b"code"], "hall", is_contained=False)


def test_a_process_that_works_for_another_trusts_whom_that_one_trusts(python, tmp_path, monkeypatch):
    (tmp_path / "trusted").mkdir()
    with trust.gate(
        lambda _: None, trusted_folders=lambda: [tmp_path / "ours"], hash_folder=lambda: tmp_path / "trusted"
    ):
        trust.trust_version([b"by a program"])
        sent = pickle.dumps(trust.policy())
    monkeypatch.chdir(tmp_path)  # of another process
    trust.adopt(pickle.loads(sent))
    trust.admit(tmp_path / "ours" / "maker.py", [b"code"], "hall", is_contained=False)
    trust.admit(tmp_path / "strangers" / "maker.py", [b"by a program"], "hall", is_contained=False)
    with pytest.raises(SuiteError, match="--trust"):
        trust.admit(tmp_path / "strangers" / "maker.py", [b"code"], "hall", is_contained=False)
