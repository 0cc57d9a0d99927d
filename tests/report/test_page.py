"""The page is well-formed, needs no network, shows everybody, and stays small."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from vobench.report import page
from vobench.report.frame_moment import worst_moments
from vobench.report.plot_points import MOST_POINTS, path_points, peak_indices
from vobench.runner.folder import RunFolder
from vobench.runner.frames import FrameRow

VOID = {"meta", "img", "input", "wbr"}


class Outline(HTMLParser):
    """Tags that are open, text of table cells, and everything that would be fetched."""

    def __init__(self):
        super().__init__()
        self.open, self.cells, self.fetched = [], [], []

    def handle_starttag(self, tag, attrs):
        self.fetched += [value for name, value in attrs if name in ("src", "href") and not value.startswith("data:")]
        if tag not in VOID:
            self.open.append(tag)
        if tag == "td":
            self.cells.append("")

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if "td" in self.open:
            self.cells[-1] += data


def text_of(run, scores):
    return page.html(run, scores, page.board_of(run, scores), run.path)


@pytest.fixture
def text(run, mixed):
    return text_of(run, mixed)


@pytest.fixture
def outline(text):
    parser = Outline()
    parser.feed(text)
    return parser


@pytest.fixture
def data(text):
    return json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])


def test_every_tag_is_closed(outline):
    assert outline.open == []


def test_nothing_is_fetched(outline, text):
    assert outline.fetched == []
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)|@import|url\(", text)


def test_without_a_script_the_matrix_and_the_totals_can_be_read(outline):
    cells = [" ".join(cell.split()) for cell in outline.cells]
    assert cells.count("crashed") == cells.count("out_of_memory") == cells.count("diverged") == 1
    assert [cells.count(name) for name in ("good_one", "mad", "dead")] == [1, 1, 1]


def test_each_cell_has_its_number_its_path_and_files_that_exist(data, run):
    assert data["estimators"][0] == "good_one"
    assert data["metrics"]["ate"]["text"][data["cases"].index("down")][0][0] == "20.0"
    assert len(data["details"]) == 6
    detail = data["details"][f"{data['cases'].index('down')}|0"]
    assert len(detail["path"]) == 3 == len(data["truths"]["0"])
    assert all((run.path / link).is_file() for _, link in detail["files"])


def test_what_an_estimator_says_is_text_and_no_markup(text, data):
    assert "<b>|x|</b>" not in text
    assert "<b>|x|</b> & °" in str(data["details"])


def test_it_is_called_after_its_suite_from_wherever_it_is_read(run, mixed, monkeypatch):
    monkeypatch.chdir(run.path)
    here = RunFolder(run.path.relative_to(run.path))
    assert "<title>vobench: suite</title>" in text_of(here, mixed)


def test_the_details_of_a_hundred_cells_of_a_thousand_frames_are_small():
    """Each curve and each path has no more points than a plot can show."""
    errors = np.abs(np.random.default_rng(0).normal(size=5000))
    assert len(peak_indices(errors)) <= MOST_POINTS >= len(path_points(errors[:, None].repeat(2, 1)))
    assert np.argmax(errors) in peak_indices(errors)


def rows(errors, statuses):
    known = enumerate(zip(errors, statuses, strict=True))
    return [FrameRow(k, k * 10**9, s, "", e, None, None, None, None, None, "", None, None) for k, (e, s) in known]


def test_the_worst_moments_are_where_track_was_lost_the_largest_error_and_its_largest_jump_well_apart():
    errors = np.ones(60)
    errors[40], errors[20:30] = 9, np.inf
    errors[50:] = 5
    frames = rows(errors, ["lost" if np.isinf(e) else "ok" for e in errors])
    found = [(moment.frame, moment.why) for moment in worst_moments(frames, errors)]
    assert found == [(20, "lost"), (40, "large error"), (50, "jump")]
    assert worst_moments([], np.zeros(0)) == []
