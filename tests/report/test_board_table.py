"""Every form of a board says what the estimators could see."""

import csv
import io
import json

import pytest

from vobench.cli import report as cli_report
from vobench.estimator.sandbox import Sandbox
from vobench.report.board_formats import FORMATS
from vobench.report.board_records import as_csv, as_json
from vobench.report.leaderboard import Board, board
from vobench.runner.folder import TrialScore

OPEN = Sandbox("none", ("the user's files", "the network"))
CLOSED = Sandbox("full")


def trial(estimator: str, sandbox: Sandbox | None) -> TrialScore:
    return TrialScore(
        case="room",
        variant={},
        estimator=estimator,
        repeat=0,
        status="ok",
        reason="",
        coverage=1.0,
        frames=9,
        path_m=100.0,
        score={"metrics": [{"name": "ate_trans", "rmse": 1.0}]},
        sandbox=sandbox,
    )


def board_of(**sandboxes: Sandbox | None) -> Board:
    return board([trial(name, sandbox) for name, sandbox in sandboxes.items()], {})


@pytest.mark.parametrize("form", ["md", "json", "csv", "latex", "terminal"])
def test_every_form_names_the_estimators_that_saw_more_than_their_own_files(form, capsys):
    made = board_of(honest=CLOSED, watched=OPEN)
    if form == "terminal":
        cli_report.print_board(made)
        text = capsys.readouterr().out
    else:
        text = FORMATS[form](made, "ate")
    assert "not sandboxed: it could see the user" in " ".join(text.split())


@pytest.mark.parametrize("form", ["md", "json", "latex"])
def test_a_board_of_sandboxed_estimators_says_so(form):
    text = FORMATS[form](board_of(honest=CLOSED), "ate")
    assert "Estimators saw only their own files." in text


def test_each_row_says_what_its_own_trials_saw():
    made = board_of(honest=CLOSED, watched=OPEN, older=None)
    rows = list(csv.DictReader(io.StringIO(as_csv(made))))
    saw = {row["estimator"]: row["saw"] for row in rows if row["case"] == "room"}
    assert saw == {
        "honest": "only its own files",
        "watched": "not sandboxed: it could see the user's files and the network",
        "older": "what it could see is not recorded",
    }
    cells = json.loads(as_json(made))["cells"]
    assert {cell["estimator"]: cell["saw"] for cell in cells} == saw
