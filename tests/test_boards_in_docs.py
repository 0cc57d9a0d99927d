"""The boards in the documentation are printed by a script, and each figure stands once."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def boards():
    specification = importlib.util.spec_from_file_location("boards", ROOT / "docs" / "boards.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_only_the_blocks_of_the_suite_are_rewritten(boards):
    page = "a\n<!-- board: one -->\nold\n<!-- end -->\nb\n<!-- board: two -->\nold\n<!-- end -->\n"
    assert boards.shown(page) == ["one", "two"]
    after = boards.rewritten(page, "two", "new")
    assert after == "a\n<!-- board: one -->\nold\n<!-- end -->\nb\n<!-- board: two -->\n```\nnew\n```\n<!-- end -->\n"
    assert boards.rewritten(after, "two", "new") == after


def test_the_documentation_shows_a_board_once_and_says_where_it_comes_from(boards):
    texts = [page.read_text(encoding="utf-8") for page in boards.pages(ROOT)]
    suites = [suite for text in texts for suite in boards.shown(text)]
    assert suites == ["quickstart"]
    (block,) = [block[0] for text in texts for block in boards.BLOCK.finditer(text)]
    assert "Made on " in block
    figures = [
        line.strip() for line in block.splitlines() if line.strip().startswith("unlike_eyes-") and ":" not in line
    ]
    assert len(figures) == 6
    everything = "".join(texts)
    for line in figures:
        assert everything.count(line) == 1
