"""Attackers beside an honest estimator in one suite: none has a better error or rank, and none changes its results.

What each trial could see stands on every form of the board. The file runs again as an ordinary user, and where the
kernel gives no namespaces. Single attacks, in more languages, and as other users
and on poorer machines, are in tests/estimator/test_sandbox.py; answers of all kinds are in tests/estimator/test_zoo.py.
"""

import csv
import html
import io
import shutil
import subprocess
import sys
from math import inf
from pathlib import Path

import pytest

from tests.elsewhere import first_time, on_poorer_kernels, refusing, rerun, rerun_as_ordinary_user
from vobench.cli import report as cli_report
from vobench.estimator.isolation import FILES
from vobench.estimator.program import sandbox_here
from vobench.estimator.readable_folders import SWITCH_VARIABLE
from vobench.report import page
from vobench.report.board_formats import FORMATS
from vobench.report.verify import verify_run
from vobench.runner.bundle import bundle, opened
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import SCORE, TRUTH_COPY, seen_by
from vobench.runner.frames import FRAMES, GROUND_TRUTH

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform != "linux", reason="the sandbox is Linux's")]

NEEDED = "cv2, embreex, mcap, numba, numpy, OpenGL, PIL, pydantic, pytest, scipy, trimesh, vobench.runner.run"
NOTHING_ELSE = ("only its own files", "only their own files")  # in a row of a trial, and in a sentence

ONE_CASE = ("lightings: {full: {}, dim: {lamp: {power_lm: 150}}}", "lightings: {full: {}}")
ESTIMATORS = "estimators: [wheel_odometry, stand_still]"
CASE = "short"
HONEST = "lk_epipolar"
PATIENT = "{start_s: 1200, frame_s: 1200}"  # on a busy machine
ENTRY = f"{{name: {HONEST}, limits: {PATIENT}}}"
STAGES_OF_ESTIMATORS = ("estimates", "scores")

# A class that answers with the trajectory that its function `found` returns, and never looks at a picture.
CLASS = """
import gc, glob, os, signal, sys
from contextlib import suppress
import numpy as np
from scipy.spatial.transform import Rotation
from vobench.estimator import Result

PLACES = {places!r}

def read(path):
    with suppress(OSError, ValueError):
        return np.loadtxt(path).reshape(-1, 8)

{attack}

class Bad:
    def start(self, rig, params, seed):
        self.rows = found()

    def process(self, frame):
        T = np.eye(4)
        if self.rows is not None and frame.index < len(self.rows):
            row = self.rows[frame.index]
            T[:3, 3] = row[1:4]
            T[:3, :3] = Rotation.from_quat(row[4:]).as_matrix()
        return Result(T)
"""
OPENS = """
def found():
    return read(PLACES["truth"])
"""
SEARCHES = """
def found():
    for wanted in ("ground_truth.tum", "estimate.tum"):
        for place in (PLACES["store"], PLACES["runs"], "/tmp", "/proc/1/root" + PLACES["runs"], PLACES["honest"]):
            for folder, _, names in os.walk(place):
                if wanted in names:
                    rows = read(os.path.join(folder, wanted))
                    if rows is not None:
                        return rows
"""
ASKS_ITS_PROCESS = """
def found():
    call = sys._getframe()
    values = []
    while call:
        values += [*call.f_globals.values(), *call.f_locals.values()]
        call = call.f_back
    values += [value for kept in gc.get_objects() if isinstance(kept, dict) for value in list(kept.values())]
    for value in values:
        if type(value).__name__ in ("Trajectory", "SequenceTruth", "Sequence"):
            T = getattr(value, "T", getattr(value, "T_world_frame", None))
            if T is not None:
                quaternions = Rotation.from_matrix(T[:, :3, :3]).as_quat()
                return np.column_stack([np.arange(len(T)), T[:, :3, 3], quaternions])
"""
SABOTAGES = """
def found():
    own_packages = [place for place in sys.path if place]
    for place in (PLACES["store"], PLACES["runs"], PLACES["honest"], PLACES["temporary"]):
        for folder, _, names in os.walk(place):
            for name in names:
                with suppress(OSError), open(os.path.join(folder, name), "ab") as file:
                    file.write(b"evil")
    for place in [*own_packages, os.path.expanduser("~"), "/tmp", "/dev/shm"]:
        for name in ("vobench_test_evil.pth", "usercustomize.py"):
            with suppress(OSError), open(os.path.join(place, name), "x") as file:
                file.write("raise SystemExit(9)")
    if os.fork() == 0:
        os.setsid()
        if os.fork():
            os._exit(0)
        while True:
            for path in glob.glob("/proc/[0-9]*/cwd/*") + glob.glob("/tmp/*/*/home/*"):
                with suppress(OSError), open(path, "ab") as file:
                    file.write(b"evil")
"""
# It opens nothing but its own folder, which has a copy of the settings of the case.
CARRIES = """
from pathlib import Path
def found():
    from vobench.runner.rescore import _case, _true_path
    T = _true_path(_case(Path(__file__).with_name("case.json"))).T_world_frame
    quaternions = Rotation.from_matrix(T[:, :3, :3]).as_quat()
    return np.column_stack([np.arange(len(T)), T[:, :3, 3], quaternions])
"""
CLASSES = {"opens": OPENS, "searches": SEARCHES, "asks": ASKS_ITS_PROCESS, "sabotages": SABOTAGES}
# Commands that put something else in the place of their answers. The first word after `-c` or `-e` is the truth.
COMMANDS = {
    "symlinks": ["perl", "-e", "symlink($ARGV[0], $ARGV[1]) or die"],
    "hardlinks": ["sh", "-c", 'ln "$0" "$1" || cp "$0" "$1"'],
    "races": ["sh", "-c", '(while :; do ln -sfn "$0" "$1"; rm -f "$1"; echo > "$1"; done) & sleep 1'],
    "pipes": ["sh", "-c", 'mkfifo "$1"; (cat "$0" > "$1") &'],
    "huge": ["awk", "BEGIN { for (k = 0; k < 30; ++k) print k / 5, 1e308 * 10, -log(0), \"nan\", 0, 0, 0, 1 > ARGV[2] }"],  # noqa: E501
    "sparse": ["perl", "-e", "open(my $f, '>', $ARGV[1]); truncate($f, 1 << 30)"],
    "nothing": ["true"],
}  # fmt: skip
COPIES_IN_C = """
#include <stdio.h>
int main(int count, char **words) {
  FILE *from = fopen(words[1], "r"), *to = fopen(words[2], "w"); int letter;
  if (!from || !to) return 1;
  while ((letter = getc(from)) != EOF) putc(letter, to);
  return 0;
}
"""


@pytest.fixture(scope="module")
def alone(bench):
    """A run of the honest estimator alone, in a store of its own."""
    return bench.run(ONE_CASE, (ESTIMATORS, f"estimators: [{ENTRY}]"), cache="alone")


@pytest.fixture
def beside(bench, alone, tmp_path):
    """Runs the honest estimator again, beside attackers that know where everything is."""

    def run(names):
        store = bench.folder / tmp_path.name
        shutil.copytree(
            bench.folder / "alone", store, symlinks=True, ignore=shutil.ignore_patterns(*STAGES_OF_ESTIMATORS)
        )
        places = {
            "truth": str(alone.case(CASE) / GROUND_TRUTH),
            "store": str(bench.folder / "alone"),
            "runs": str(alone.path.parent),
            "honest": str(alone.estimate(CASE, HONEST, 0)),
            "temporary": str(tmp_path),
        }
        assert all(Path(place).exists() for place in places.values())
        folders = [attacker(name, tmp_path / name, places) for name in names]
        listed = ", ".join(map(str, [*folders, ENTRY]))
        return bench.run(ONE_CASE, (ESTIMATORS, f"estimators: [{listed}]"), cache=store.name)

    return run


def attacker(name, folder, places):
    """The folder of an attacker."""
    folder.mkdir(exist_ok=True)
    keys = {"name": name, "version": "'1'", "pose_of": "left_camera", "needs": "[stereo]", "limits": PATIENT}
    if name in CLASSES:
        keys["class"] = "estimator:Bad"
        (folder / "estimator.py").write_text(CLASS.format(places=places, attack=CLASSES[name]))
    elif name == "carries":
        keys["class"] = "estimator:Bad"
        (folder / "estimator.py").write_text(CLASS.format(places={}, attack=CARRIES))
    else:
        words = ["./copies"] if name == "copies" else COMMANDS[name]
        keys["command"] = [*words, places["truth"], "{out}"]
    if name == "copies":
        subprocess.run(["cc", "-x", "c", "-o", folder / "copies", "-"], input=COPIES_IN_C.encode(), check=True)
    text = "".join(f"{key}: {quoted(value)}\n" for key, value in keys.items())
    (folder / "estimator.yaml").write_text(text)
    return folder


def quoted(value):
    """A value for YAML, where words of programs have quotes of their own."""
    if isinstance(value, str):
        return value
    words = ["'" + word.replace("'", "''") + "'" for word in value]
    return f"[{', '.join(words)}]"


@pytest.fixture
def forms(tmp_path, capsys, monkeypatch):
    """The board of a run in every form, and that of its bundle, by name, without escapes and line breaks."""
    monkeypatch.setenv("COLUMNS", "4000")

    def read(run):
        board = page.run_board(run, run.scores())
        texts = {name: form(board, "ate") for name, form in FORMATS.items()}
        texts["html"] = (run.path / "leaderboard.html").read_text()
        capsys.readouterr()
        cli_report.print_board(board)
        texts["terminal"] = capsys.readouterr().out
        bundle(run, tmp_path / "run.zip")
        with opened(tmp_path / "run.zip") as unpacked:
            texts["bundle"] = FORMATS["md"](page.run_board(unpacked, unpacked.scores()), "ate")
        return {name: plain(text) for name, text in texts.items()}

    return read


def plain(text):
    """A text on one line, without the escapes of HTML, LaTeX and Markdown."""
    unescaped = html.unescape(text).replace("\\", "")
    return " ".join(unescaped.split())


def ate_m(score):
    """The translational error of a trial, infinite without an estimate."""
    value = score.value("ate_trans", "rmse") if score.score else None
    return inf if value is None else value


def test_no_attacker_is_better_than_an_honest_estimator_or_changes_its_results(alone, beside, forms):
    are_files_closed = FILES not in sandbox_here().sees
    names = [*CLASSES, *COMMANDS]
    if shutil.which("cc"):
        names.append("copies")
    if not are_files_closed:
        names.remove("sabotages")  # it would succeed, on this machine
    before = {path: path.read_bytes() for path in alone.path.rglob("*") if path.is_file()}
    run = beside(names)
    scores = {score.estimator: score for score in run.scores()}
    assert set(scores) == {*names, HONEST}
    assert ate_m(scores[HONEST]) < inf

    totals = {total.estimator: total for total in page.run_board(run, run.scores()).totals}
    for name in names if are_files_closed else ():
        assert ate_m(scores[name]) > ate_m(scores[HONEST]), (name, scores[name])
        is_rival = totals[name].group == totals[HONEST].group and totals[name].rank is not None
        assert not is_rival or totals[name].rank > totals[HONEST].rank, (name, totals[name])

    for form, text in forms(run).items():
        for name, score in scores.items():
            seen = seen_by(score)
            sentences = [seen] if seen else NOTHING_ELSE
            assert name in text, (form, name)
            assert any(sentence in text for sentence in sentences), (form, name, seen)

    for name in (ESTIMATE, FRAMES, SCORE):
        files = [folder.estimate(CASE, HONEST, 0) / name for folder in (alone, run)]
        assert files[0].read_bytes() == files[1].read_bytes(), name
    assert {path: path.read_bytes() for path in before} == before
    assert not [finding for finding in verify_run(run) if finding.wrong]


def test_every_row_of_the_csv_says_what_its_trial_saw(alone):
    rows = list(csv.DictReader(io.StringIO((alone.path / "leaderboard.csv").read_text())))
    (trial,) = alone.scores()
    expected = seen_by(trial) or NOTHING_ELSE[0]
    assert {row["saw"] for row in rows if row["case"] == CASE} == {expected}


def test_where_nothing_is_closed_an_attacker_wins_and_every_form_of_the_board_names_it(beside, forms, monkeypatch):
    monkeypatch.setenv(SWITCH_VARIABLE, "off")
    winners = ["opens", "searches"]
    if shutil.which("cc"):
        winners.append("copies")
    run = beside([*winners, "symlinks"])
    scores = {score.estimator: score for score in run.scores()}
    for name in winners:  # so the attacks themselves work
        assert ate_m(scores[name]) < 1e-4 * ate_m(scores[HONEST]), scores[name]
    assert scores["symlinks"].status == "invalid_output"  # whatever it sees, links are not followed
    for name, text in forms(run).items():
        assert "opens" in text, name
        assert "not sandboxed: it could see the user's files" in text, name


def test_who_computes_the_truth_from_a_copy_of_the_suite_has_no_rank(alone, beside, forms, tmp_path):
    folder = tmp_path / "carries"
    folder.mkdir()
    shutil.copy(alone.case(CASE) / "case.json", folder / "case.json")

    run = beside(["carries"])
    scores = {score.estimator: score for score in run.scores()}
    assert ate_m(scores["carries"]) < 1e-9, scores["carries"]
    assert scores["carries"].claims == (TRUTH_COPY,)
    assert scores[HONEST].claims == ()

    totals = {total.estimator: total for total in page.run_board(run, run.scores()).totals}
    (total_alone,) = page.run_board(alone, alone.scores()).totals
    assert totals["carries"].rank is None
    assert (totals[HONEST].rank, totals[HONEST].error_ratio) == (1, 1.0)
    assert totals[HONEST].score == total_alone.score

    for form, text in forms(run).items():
        shown = "equals_truth" if form == "csv" else TRUTH_COPY
        assert shown in text or "equals the ground truth" in text, form
    for name in (ESTIMATE, FRAMES, SCORE):
        assert (alone.estimate(CASE, HONEST, 0) / name).read_bytes() == (
            run.estimate(CASE, HONEST, 0) / name
        ).read_bytes()


@first_time
def test_the_same_as_an_ordinary_user():
    rerun_as_ordinary_user(__file__, needed=NEEDED)


@first_time
@on_poorer_kernels
def test_the_same_where_the_kernel_refuses(refused):
    rerun(__file__, refusing(refused))
