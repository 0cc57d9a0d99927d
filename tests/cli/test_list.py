"""A summary read off its line is what a YAML parser makes of it."""

import pytest

from tests.generated import SCENE
from vobench.cli import list as listing
from vobench.suite.catalog import KINDS, CatalogEntry, entries

MANIFEST = "name: mine\nversion: '1'\nclass: mine:Mine\npose_of: body\n"
FORMS = [
    "summary: Two words",
    "summary: Two words, and more; (both) quite plain.",
    "summary: Two words   ",
    "summary: Two words # and a comment",
    "summary: It's 5 m wide",
    "summary: Ärger über zwei Wörter",
    'summary: "In quotes: 12 × 9 m, #1"',
    "summary: 'In single ones: \"so\"'",
    "summary: 'It''s doubled'",
    r'summary: "An escape \u00e9 and a \"quote\""',
    "summary: Two words\n  and a second line",
    "summary: Two words\n\n  and a line after an empty one",
    "summary: Two words\n# a comment below",
    "summary: Two words\n\n# a comment further below",
    "summary: >-\n  Folded\n  text",
    "summary:   Three spaces before",
    '"summary": A quoted key',
    "paper: |\n  summary: not this one\nsummary: But this one",
    "summary: True enough",
    "summary: 2001 was a year",
    "summary: yes",
]
WRONG = [
    "summary: [Two words, as a list]",
    "summary: 12",
    "summary: Two words: and a colon",
    "summary: Two words\nsummary: Two others",
    "summary: Two words\n'summary': Two others",
]


@pytest.fixture
def entry(tmp_path):
    return CatalogEntry("estimator", "mine", tmp_path, "path")


@pytest.mark.parametrize("line", FORMS)
def test_a_summary_is_what_the_checked_model_says(entry, line):
    (entry.path / "estimator.yaml").write_text(f"{line}\n{MANIFEST}")
    above = listing._summary(entry), listing._parsed_summary(entry)
    (entry.path / "estimator.yaml").write_text(f"{MANIFEST}{line}")
    below = listing._summary(entry), listing._parsed_summary(entry)
    assert above[0] == above[1] == below[0] == below[1]
    assert above[0]


@pytest.mark.parametrize("line", WRONG)
def test_a_summary_that_is_none_is_said_to_be_wrong(entry, line):
    (entry.path / "estimator.yaml").write_text(f"{line}\n{MANIFEST}")
    assert listing._summary(entry).startswith("unreadable: ")


def test_a_plain_summary_is_read_without_the_models(entry, monkeypatch):
    monkeypatch.setattr(listing, "_parsed_summary", lambda _: pytest.fail("read whole"))
    for line in FORMS[:3]:
        (entry.path / "estimator.yaml").write_text(f"{line}\n{MANIFEST}")
        assert listing._summary(entry).startswith("Two words")


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_of_every_kind_that_is_read_whole_has_the_summary_that_is_read_off(kind):
    for entry in entries(kind)[:2]:
        summary = listing._parsed_summary(entry)
        assert summary
        assert listing._summary(entry) == summary


def test_scenes_with_a_generator_have_seeds_and_others_and_other_kinds_have_not(vobench, here):
    (here / "scenes" / "cell.yaml").write_text(SCENE)
    (here / "scenes" / "plain.yaml").write_text(SCENE.replace("generator:", "# generator:"))
    rows = vobench("list", "--json").json["entries"]
    with_seeds = [row["name"] for row in rows if row["seeds"]]
    assert with_seeds == ["cell", "flat", "office", "park", "room", "street", "warehouse"]
    table = vobench("list", "scenes").out
    line = next(line for line in table.splitlines() if " flat " in line)
    assert " yes " in line
    assert " yes " not in next(line for line in table.splitlines() if " closet " in line)
