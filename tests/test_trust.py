"""Without a sandbox strange makers run once they are trusted; on the command line all are named."""

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
        with trust.gate(told.append, ours=lambda: (builtin_root(), Path.cwd()), folder=lambda: tmp_path / "trusted"):
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
    with pytest.raises(SuiteError, match="--trust, once for each version of it"):
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


def test_from_python_nobody_is_asked(tmp_path):
    trust.admit(tmp_path / "maker.py", [b"code"], "hall", is_contained=False)
