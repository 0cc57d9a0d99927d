"""evo's flags of alignment are replaced, and nothing else is."""

import pytest
import typer

from vobench.cli.evo_align import without_evo_flags


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    """Files gt and est in the working directory."""
    monkeypatch.chdir(tmp_path)
    for name in ("gt", "est", "sim3"):
        (tmp_path / name).touch()


@pytest.mark.parametrize(
    ("words", "kind"),
    [
        ("gt est -a", "se3"),
        ("-a gt est", "se3"),
        ("gt est -va", "se3"),
        ("gt est -s", "scale"),
        ("gt est -as", "sim3"),
        ("gt est -sa", "sim3"),
        ("gt est -vas", "sim3"),
        ("gt -a est -s", "sim3"),
        ("gt est -a --like evo", "se3"),
    ],
)
def test_flags_of_evo_become_a_kind_of_alignment(words, kind):
    replaced = without_evo_flags(words.split())
    assert replaced[:2] == ["-a", kind]
    others = [word for word in words.split() if word in ("gt", "est", "--like", "evo")]
    assert replaced[2:] == others


@pytest.mark.parametrize(
    "words",
    [
        "gt est",
        "gt est -a se3",
        "gt est -a sim3",  # also if a file has this name
        "gt est -a se4",  # refused later as an unknown kind
        "gt est --align sim3",
        "gt est -u s -d 1",
        "gt -- -as",
        "-v gt est",
    ],
)
def test_other_words_stay_as_they_are(words):
    assert without_evo_flags(words.split()) == words.split()


def test_a_kind_and_flags_together_are_refused():
    with pytest.raises(typer.BadParameter, match="either -a with a kind of alignment, or evo's flags"):
        without_evo_flags(["gt", "est", "-a", "se3", "-s"])
