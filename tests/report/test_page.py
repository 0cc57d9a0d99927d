"""The page is well-formed, needs no network, shows everybody, and stays small."""

import csv
import io
import json
import re
from html.parser import HTMLParser

import pandas as pd
import pytest

from vobench.report import page
from vobench.report.leaderboard import Board
from vobench.report.practice import PRACTICES, Practice
from vobench.report.thumbnail import Thumbnails
from vobench.runner.environment import ENVIRONMENT, ENVIRONMENTS, Environment, Processor
from vobench.runner.folder import CASE, SEQUENCE, SUITE, RunFolder
from vobench.runner.frames import COLUMNS, FRAMES, TIME_COLUMNS, TIMES, new_table

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
    return page.board_page(run, scores, page.run_board(run, scores), run.path)


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
    assert data["metrics"]["ate"]["text"][data["cases"].index("down")][0][0] == "0.200"
    assert len(data["details"]) == 6
    detail = data["details"][f"{data['cases'].index('down')}|0"]
    assert len(detail["path"]) == 3 == len(data["truths"]["down"])
    assert all((run.path / link).is_file() for _, link in detail["files"])


def test_what_an_estimator_says_is_text_and_no_markup(text, data):
    assert "<b>|x|</b>" not in text
    assert "<b>|x|</b> & °" in str(data["details"])


def test_it_is_called_after_its_suite_from_wherever_it_is_read(run, mixed, monkeypatch):
    monkeypatch.chdir(run.path)
    here = RunFolder(run.path.relative_to(run.path))
    assert "<title>vobench: suite</title>" in text_of(here, mixed)


def test_the_reports_of_a_run_are_written_beside_it(run, mixed):
    page.write_reports(run, mixed)
    assert {path.suffix for path in run.path.glob("leaderboard.*")} == {".md", ".json", ".csv", ".html"}
    assert json.loads((run.path / "leaderboard.json").read_text(encoding="utf-8"))


def test_no_time_stands_in_a_report_but_in_a_file_of_its_own_and_in_the_page(run, mixed):
    page.write_reports(run, mixed)
    said = {path.suffix: path.read_text(encoding="utf-8") for path in run.path.glob("leaderboard.*")}
    assert "CPU" in said.pop(".html")
    assert "CPU" not in said[".md"]
    assert {cell["cpu_ms"] for cell in json.loads(said[".json"])["cells"]} == {None}
    with (run.path / TIMES).open(encoding="utf-8") as file:
        assert {line.split(",")[3] for line in file} == {"cpu_ms", "2.000", ""}


@pytest.mark.parametrize("form", ["md", "html", "csv", "json"])
def test_every_report_says_the_drift_of_a_still_case_and_the_commonest_reason_of_frames(
    tmp_path, scored, write_run, form
):
    scores = [scored("still_one", drift_m=0.00234, ate_m=5.0), scored("moving_one", case="ahead")]
    folder = write_run(tmp_path / "suite" / "stamp", scores)
    with new_table(folder.estimate("down", "still_one", 0) / FRAMES, COLUMNS) as table:
        for k in (1, 2):
            table.writerow({"frame": k, "t_ns": k, "status": "lost", "reason": f"few <{9 - 2 * k}>"})
    page.write_reports(folder, scores)
    text = (folder.path / f"leaderboard.{form}").read_text(encoding="utf-8")
    if form == "md":
        assert "still_one: drift of 2.3 mm while the camera is stationary" in text
        assert 'still_one: 2 frames with "few &lt;7>", first in frame 1' in text
    elif form == "html":
        data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
        assert 'still_one: 2 frames with "few <7>", first in frame 1' in str(data["details"])
    elif form == "csv":
        (row,) = pd.read_csv(io.StringIO(text)).query("estimator == 'still_one' and case == 'down'").to_dict("records")
        assert (row["drift_mm"], row["frame_reason"], row["frame_reason_count"]) == (2.34, "few <7>", 2)
    else:
        (row,) = (c for c in json.loads(text)["cells"] if c["estimator"] == "still_one")
        assert (row["drift_mm"], row["ate_mm"], row["frame_reason_first"]) == (2.34, None, 1)


@pytest.fixture
def seen(tmp_path, scored, write_run):
    """A run of cases with pictures, each with the rig that its name begins with; those of `flipped` are upside down."""
    practice = PRACTICES["drive"].write(tmp_path / "practice")
    flipped = Practice(change=lambda _, picture: picture[::-1]).write(tmp_path / "flipped")

    def make(*cases):
        trials = [scored("a", case=case) for case in cases]
        folder = write_run(tmp_path / "suite" / "stamp", trials)
        for case in cases:
            rig = case.partition("_")[0]
            (folder.case(case) / CASE).write_text(json.dumps({"variant": {"rig": rig}}))
            recording = flipped if case.endswith("flipped") else practice
            (folder.case(case) / SEQUENCE).symlink_to(recording)
        return text_of(folder, trials)

    return make


def captions(text):
    return re.findall(r'<img src="data:image/jpeg;base64,[^"]+" alt="First picture of (\w+)">', text)


def test_each_rig_is_shown_once_by_its_first_picture(seen):
    assert captions(seen("ahead_1", "ahead_2", "down_1", "down_2")) == ["ahead", "down"]


def test_the_picture_of_a_rig_is_the_first_frame_of_its_first_case(seen, tmp_path):
    text = seen("down_1", "down_flipped")
    pictures = Thumbnails(RunFolder(tmp_path / "suite" / "stamp"))
    first, second = (pictures.get("down_1", frame, page.RIG_WIDTH_PX) for frame in (0, 1))
    assert first in text
    assert second not in text
    assert pictures.get("down_flipped", 0, page.RIG_WIDTH_PX) not in text


def test_a_case_that_names_no_rig_has_pictures_but_shows_none(seen):
    assert "First picture of" not in seen("_1")


def test_at_most_four_rigs_are_shown(seen):
    assert captions(seen(*(f"{letter}_1" for letter in "abcdef"))) == ["a", "b", "c", "d"]


def test_a_case_without_pictures_or_a_rig_shows_none(run, mixed):
    assert captions(text_of(run, mixed)) == []


def facts_of(text):
    return dict(re.findall(r"<dt>([^<]*)</dt><dd>([^<]*)</dd>", text))


def test_the_header_states_what_was_run_and_leaves_out_what_is_not_known(run, mixed):
    assert facts_of(text_of(run, mixed)) == {
        "trials": "6, 3 failed",
        "estimators": "dead, good_one, mad: what it could see is not recorded.",
    }
    (run.path / SUITE).write_text(json.dumps({"seed": 3, "repeats": 4, "summary": "Two rooms"}))
    text = text_of(run, mixed)
    assert facts_of(text)["seed"] == "3"
    assert facts_of(text)["repeats"] == "4"
    assert "<p>Two rooms</p>" in text
    assert "<details" not in text


def test_the_header_states_the_machine(run, mixed):
    environment = Environment(
        vobench="1.0",
        python="3.12.1",
        platform="Linux",
        processors=(Processor("Some CPU", "x86-64-v3"),),
        cores=2,
        cores_total=8,
        drawn_by=("llvmpipe",),
        portable=True,
        libraries={"numpy": "2.4"},
        timed="alone",
    )
    (run.path / ENVIRONMENT).write_bytes(ENVIRONMENTS.dump_json(environment))
    text = text_of(run, mixed)
    facts = facts_of(text)
    assert facts["processor"] == "Some CPU (x86-64-v3)"
    assert (facts["cores"], facts["driver"], facts["portable"]) == ("2 of 8", "llvmpipe", "yes")
    assert (facts["vobench"], facts["system"], facts["CPU time"]) == ("vobench 1.0", "Linux", "taken alone")
    assert "Python 3.12.1, numpy 2.4</details>" in text


def test_costs_are_means_and_memory_a_maximum(scored, write_run, tmp_path):
    trials = [scored("a", repeat=repeat, ate_m=0.1 + repeat) for repeat in (0, 1)]
    folder = write_run(tmp_path / "suite" / "stamp", trials)
    with new_table(folder.estimate("down", "a", 1) / TIMES, TIME_COLUMNS) as table:
        table.writerow({"frame": 0, "wall_ms": 4.0, "cpu_ms": 8.0, "memory_mib": 1.0})
    page.write_reports(folder, trials)
    (row,) = csv.DictReader(io.StringIO((folder.path / TIMES).read_text()))
    assert row == {"case": "down", "estimator": "a", "wall_ms": "2.500", "cpu_ms": "5.000", "memory_mib": "3.000"}


def test_a_run_without_any_number_has_a_page(tmp_path, scored, write_run):
    trials = [scored("a", "crashed", ate_m=None, drift_m=0.0, coverage=0.0)]
    folder = write_run(tmp_path / "suite" / "stamp", trials)
    made = page.run_board(folder, [])
    assert '<option value="ate" selected>ATE % of path</option>' in page.board_page(folder, [], made, tmp_path)


def test_a_page_without_the_ate_begins_with_its_first_metric(run, mixed, monkeypatch):
    board = page.run_board(run, mixed)
    others = [name for name in board.metrics if name != "ate"]
    monkeypatch.setattr(Board, "metrics", others)
    assert f'<option value="{others[0]}" selected>' in page.board_page(run, mixed, board, run.path)


def test_trials_that_lack_a_sensor_are_counted_apart_from_failures(scored, write_run, tmp_path):
    trials = [scored("a"), scored("b", "lost"), scored("c", "not_applicable")]
    folder = write_run(tmp_path / "suite" / "stamp", trials)
    text = page.board_page(folder, trials, page.run_board(folder, trials), tmp_path)
    assert "3, 1 failed, 1 not applicable" in text
    assert text.count('class="cell failed"') == 1
