"""Twelve ways to forge a bundle: `vobench report` and `vobench compare` name each of them, and rank none of them."""

import json
import stat
from zipfile import ZipInfo

import pytest

from tests.forgery import forger_of
from vobench.runner.bundle import MOST_JSON_BYTES

TRIAL = "cases/short/estimates/stand_still/0"
OTHER = "cases/short/estimates/wheel_odometry/0"
TRUTH = "cases/short/ground_truth.tum"
SCORE = f"{TRIAL}/score.json"


def rank(forger):
    score = json.loads(forger.files[SCORE])["score"]
    metrics = [metric | {"rmse": 1e-9, "mean": 1e-9} for metric in score["metrics"]]
    forger.edit(SCORE, score=score | {"metrics": metrics, "failure": score["failure"] | {"lost_aware": 1.0}})


def hash_of_a_file(forger):
    forger.files[f"{TRIAL}/estimate.tum"] = forger.files[TRUTH]
    forger.hashes_fit = False


def label(forger):
    forger.edit(SCORE, estimator="Best\u202eever\x1b[31m")
    for name in [name for name in forger.files if name.startswith(TRIAL)]:
        forger.files[name.replace("stand_still", "Best\u202eever\x1b[31m")] = forger.files.pop(name)


def link(forger):
    entry = ZipInfo("cases/short/estimates/link")
    entry.external_attr = (stat.S_IFLNK | 0o777) << 16
    forger.appended.append((entry, b"/etc/shadow"))


def shape(forger):
    forger.edit(SCORE, score=json.loads(forger.files[SCORE])["score"] | {"metrics": "x"})


def size(forger):
    forger.files["suite.json"] = b" " * MOST_JSON_BYTES + forger.files["suite.json"]


def duplicate(forger):
    forger.appended.append((TRUTH, b"0 0 0 0 0 0 0 1\n"))


def path_outside(forger):
    forger.appended.append(("../outside.txt", b"x"))


def trial_without_a_hash(forger):
    forger.appended.append((SCORE.replace("/0/", "/1/"), forger.files[SCORE]))


def truth(forger):
    forger.files[TRUTH] = forger.files[f"{TRIAL}/estimate.tum"]


def estimate(forger):
    forger.files[f"{TRIAL}/estimate.tum"] = forger.files[TRUTH]


def table_of_frames(forger):
    forger.files[f"{TRIAL}/frames.csv"] = forger.files[f"{OTHER}/frames.csv"]


# What a forger does, what is said of it, and whether the bundle is refused as a whole.
FORGERIES = {
    rank: ("stand_still on short, 0: another score than its run states", False),
    hash_of_a_file: ("estimate.tum is not the file that was bundled", True),
    label: ("the name of its estimator should match", True),
    link: ("contains a file whose path is outside of it", True),
    shape: ("not a score as vobench writes it", True),
    size: ("bytes, more than 67108864", True),
    duplicate: ("holds a file twice", True),
    path_outside: ("contains a file whose path is outside of it", True),
    trial_without_a_hash: ("contains a file that its hashes do not name", True),
    truth: ("its ground_truth.tum is not the path that its case.json gives", True),
    estimate: ("stand_still on short, 0: another score than its run states", False),
    table_of_frames: ("frames.csv: position error", False),
}
# What `vobench compare` says instead.
COMPARED = {truth: "its true path differs"}


@pytest.mark.parametrize("forge", FORGERIES, ids=lambda forge: forge.__name__)
def test_report_and_compare_name_the_forgery_in_one_line(vobench, ran, here, forge):
    sentence, is_refused = FORGERIES[forge]
    assert vobench("bundle", ran, "honest.zip").code == 0
    honest = vobench("report", "honest.zip", "--json")
    assert (honest.code, honest.err) == (0, "")
    forger = forger_of(here / "honest.zip")
    forge(forger)
    forger.write(here / "forged.zip")

    reported = vobench("report", "forged.zip")
    compared = vobench("compare", "honest.zip", "forged.zip")
    assert bool(reported.code) == is_refused, reported
    for said, expected in ((reported, sentence), (compared, COMPARED.get(forge, sentence))):
        assert any(expected in line for line in said.err.splitlines()), said
        assert "Traceback" not in said.err
        assert not {"\x1b", "\u202e"} & set(said.out + said.err)

    if forge in (rank, table_of_frames):
        assert vobench("report", "forged.zip", "--json").json["totals"] == honest.json["totals"]


def test_a_bundle_of_too_many_files_or_bytes_is_refused_before_it_is_unpacked(vobench, ran, here, monkeypatch):
    assert vobench("bundle", ran, "honest.zip").code == 0
    monkeypatch.setattr("vobench.runner.bundle.MOST_FILES", 3)
    said = vobench("report", "honest.zip")
    assert said.code == 1
    assert "files, more than 3: honest.zip" in said.err
    monkeypatch.setattr("vobench.runner.bundle.MOST_FILES", 500)
    monkeypatch.setattr("vobench.runner.bundle.MOST_BYTES", 1000)
    assert "GB, more than 1e-06: honest.zip" in vobench("report", "honest.zip").err
