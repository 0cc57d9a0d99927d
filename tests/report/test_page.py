"""The page is well-formed, needs no network and shows everybody."""

from html.parser import HTMLParser

import pytest

from vobench.report import page
from vobench.report import page as files
from vobench.run.folder import RunFolder

VOID = {"meta", "br", "polyline", "path"}


class Outline(HTMLParser):
    """Tags that are open, text of table cells, and everything that would be fetched."""

    def __init__(self):
        super().__init__()
        self.open, self.cells, self.fetched, self.lines = [], [], [], 0

    def handle_starttag(self, tag, attrs):
        self.fetched += [value for name, value in attrs if name in ("src", "href")]
        self.lines += tag == "polyline"
        if tag not in VOID:
            self.open.append(tag)
        if tag == "td":
            self.cells.append("")

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] == ["td"]:
            self.cells[-1] += data


@pytest.fixture
def outline(run, mixed):
    parser = Outline()
    parser.feed(page.html(run, mixed, files.boards_of(run, mixed)))
    return parser


def test_every_tag_is_closed(outline):
    assert outline.open == []


def test_nothing_is_fetched(outline):
    assert outline.fetched == []


def test_every_estimator_has_its_cells_in_every_board(outline):
    assert [outline.cells.count(name) for name in ("good_one", "mad", "dead")] == [3, 3, 3]


def test_each_case_shows_the_truth_and_every_estimate_that_has_a_score(outline):
    assert outline.lines == 2 * (1 + 2)


def test_what_an_estimator_says_is_text_and_no_markup(run, mixed):
    text = page.html(run, mixed, files.boards_of(run, mixed))
    assert "<b>|x|</b>" not in text
    assert "&lt;b&gt;|x|&lt;/b&gt; &amp; °" in text


def test_it_is_called_after_its_suite_from_wherever_it_is_read(run, mixed, monkeypatch):
    monkeypatch.chdir(run.path)
    here = RunFolder(run.path.relative_to(run.path))
    assert "<title>vobench: suite</title>" in page.html(here, mixed, files.boards_of(here, mixed))
