"""A bundle that states what its files do not give is reported, and does not rank by what it states."""

import json
import shutil
import stat
import subprocess
import time
import warnings
from hashlib import sha256
from zipfile import ZipFile, ZipInfo

import pytest

from vobench.errors import InputError
from vobench.report import board_records, page
from vobench.runner.bundle import bundle, merged, opened
from vobench.runner.folder import HASHES, TRUTH_COPY
from vobench.runner.rescore import check, wrong_truths
from vobench.runner.signature import sign, signature_sentence

TRIAL = "cases/full/estimates/stand_still/0"
OTHER = "cases/full/estimates/wheel_odometry/0"
TRUTH = "cases/full/ground_truth.tum"


@pytest.fixture(scope="session")
def honest(first, tmp_path_factory):
    """The files of an honest bundle."""
    path = tmp_path_factory.mktemp("honest") / "honest.zip"
    bundle(first, path)
    with ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist()}


def packed(files, path, *, fresh=True):
    """A bundle of these files; `fresh` hashes them again, as a forger would."""
    if fresh:
        hashed = json.loads(files[HASHES])
        names = [name for name in files if name in hashed or name.startswith("cases/")]
        files = files | {HASHES: json.dumps({name: sha256(files[name]).hexdigest() for name in names}).encode()}
    with ZipFile(path, "w") as file:
        for name, content in files.items():
            file.writestr(name, content)
    return path


def reported(path):
    """What is said of a bundle: its refusal, or the notes beside its board."""
    told = []
    try:
        with opened(path, told.append) as folder:
            return [*told, *check(folder, wrong_truths(folder)).notes]
    except InputError as error:
        return [str(error)]


def edited(files, name, **changes):
    """The files with some keys of an object in JSON changed."""
    return files | {name: json.dumps(json.loads(files[name]) | changes).encode()}


def renamed(files, label):
    """The files with another label of one estimator, in its folder and in its score."""
    moved = edited(files, f"{TRIAL}/score.json", estimator=label)
    return {name.replace("estimates/stand_still/", f"estimates/{label}/"): content for name, content in moved.items()}


def with_score(files, **changes):
    held = json.loads(files[f"{TRIAL}/score.json"])["score"]
    return edited(files, f"{TRIAL}/score.json", score=held | changes)


def first_rank(files):
    held = json.loads(files[f"{TRIAL}/score.json"])["score"]
    metrics = [metric | {"rmse": 1e-9, "mean": 1e-9} for metric in held["metrics"]]
    return with_score(files, metrics=metrics, failure=held["failure"] | {"lost_aware": 1.0})


def not_a_number(files):
    text = files[f"{TRIAL}/score.json"].decode().replace('"coverage": 1.0', '"coverage": NaN', 1)
    assert "NaN" in text
    return files | {f"{TRIAL}/score.json": text.encode()}


FORGERIES = {
    "rank": (first_rank, "another score than its run states"),
    "hash": (lambda files: files | {f"{TRIAL}/estimate.tum": files[f"{OTHER}/estimate.tum"]}, "is not the file that"),
    "label": (lambda files: renamed(files, "Best\u202eever"), "the name of its estimator should match"),
    "escape in a label": (lambda files: renamed(files, "a\x1b[31m"), "the name of its estimator should match"),
    "formula": (lambda files: renamed(files, "=cmd|' calc'!A0"), "the name of its estimator should match"),
    "shape": (lambda files: with_score(files, metrics="x"), "not a score as vobench writes it"),
    "not a number": (not_a_number, "not a score as vobench writes it"),
    "other truth": (lambda files: files | {TRUTH: files[f"{TRIAL}/estimate.tum"]}, "not the path that its case.json"),
    "other case": (lambda files: edited(files, f"{TRIAL}/score.json", case="dim"), "should be the score of its folder"),
    "edited estimate": (
        lambda files: files | {f"{TRIAL}/estimate.tum": files[TRUTH]}, "another score than its run states"
    ),
    "length of the path": (
        lambda files: edited(files, f"{TRIAL}/score.json", path_m=1e6), "path_m: 1000000 is stated"
    ),
    "status": (lambda files: edited(files, f"{TRIAL}/score.json", status="lost"), "status: 'lost' is stated"),
    "no truth": (lambda files: {k: v for k, v in files.items() if k != TRUTH}, "claimed, not ranked"),
    "estimate of no numbers": (
        lambda files: files | {f"{TRIAL}/estimate.tum": b"0 nan 0 0 0 0 0 1\n"}, "claimed, not ranked"
    ),
    "escape in a reason": (
        lambda files: edited(files, "environment.json", platform="\x1b]0;owned\x07"), "control characters were removed"
    ),
    "table of frames": (
        lambda files: files | {f"{TRIAL}/frames.csv": files[f"{OTHER}/frames.csv"]}, "not that of the estimate"
    ),
}  # fmt: skip


def test_an_honest_bundle_is_reported_for_nothing(honest, tmp_path):
    assert reported(packed(honest, tmp_path / "a.zip")) == []


@pytest.mark.parametrize("name", FORGERIES)
def test_a_forged_bundle_is_reported(honest, tmp_path, name):
    forge, sentence = FORGERIES[name]
    told = reported(packed(forge(dict(honest)), tmp_path / "a.zip", fresh=name != "hash"))
    assert told
    assert any(sentence in each for each in told), told
    assert all("\x1b" not in each and "\u202e" not in each for each in told)


def test_links_and_files_that_are_there_twice_are_reported(honest, tmp_path):
    path = packed(honest, tmp_path / "a.zip")
    with ZipFile(path, "a") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file.writestr(TRUTH, "0 0 0 0 0 0 0 1\n")
    assert "holds a file twice" in reported(path)[0]
    path = packed(honest, tmp_path / "b.zip")
    link = ZipInfo("cases/full/estimates/link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with ZipFile(path, "a") as file:
        file.writestr(link, "/etc/shadow")
    assert "whose path is outside" in reported(path)[0]


def test_a_trial_that_the_hashes_do_not_name_is_reported(honest, tmp_path):
    path = packed(honest, tmp_path / "a.zip")
    with ZipFile(path, "a") as file:
        file.writestr(TRIAL.replace("/0", "/1") + "/score.json", honest[f"{TRIAL}/score.json"])
    assert "contains a file that its hashes do not name" in reported(path)[0]


def test_a_forged_rank_is_not_the_rank_of_the_board(honest, tmp_path):
    with opened(packed(first_rank(dict(honest)), tmp_path / "a.zip")) as folder:
        board = page.run_board(folder, check(folder).scores)
    assert [total.estimator for total in board.totals] == ["wheel_odometry", "stand_still"]


def test_what_cannot_be_scored_again_does_not_rank(honest, tmp_path):
    files = {name: content for name, content in honest.items() if name != f"{TRIAL}/estimate.tum"}
    with opened(packed(files, tmp_path / "a.zip")) as folder:
        found = check(folder)
    assert [(trial.score.case, trial.score.estimator) for trial in found.claimed] == [("full", "stand_still")]
    assert ("full", "stand_still") not in [(score.case, score.estimator) for score in found.scores]


def test_a_bundle_follows_no_link(first, tmp_path):
    copy = tmp_path / "runs" / "copy"
    shutil.copytree(first.path, copy, symlinks=True)
    secret = tmp_path / "shadow"
    secret.write_text("root:*:")
    for link, target in ((copy / TRUTH, secret), (copy / "cases" / "full" / "estimates", tmp_path)):
        keep = link.with_name("kept")
        link.rename(keep)
        shutil.copytree(keep, target / "estimates") if keep.is_dir() else None
        link.symlink_to(target / "estimates" if keep.is_dir() else target)
        with pytest.raises(InputError, match="a link is on its path, which a bundle does not follow"):
            bundle(type(first)(copy), tmp_path / "a.zip")
        link.unlink()
        keep.rename(link)
    assert bundle(type(first)(copy), tmp_path / "a.zip")


def test_the_name_of_a_runs_file_gets_into_no_label_as_it_is(honest, tmp_path):
    files = honest
    stated = json.loads(files["estimators.json"])
    other = files | {"estimators.json": json.dumps([each | {"code": "another"} for each in stated]).encode()}
    paths = [packed(files, tmp_path / "a.zip"), packed(other, tmp_path / "=cmd|\x1b.zip")]
    with opened(paths[0]) as one, opened(paths[1]) as two, merged([one, two], [path.stem for path in paths]) as both:
        labels = {score.estimator for score in check(both).scores}
    assert labels == {"stand_still", "wheel_odometry", "stand_still of _cmd__", "wheel_odometry of _cmd__"}


def test_a_text_that_a_spreadsheet_would_execute_is_a_text(first):
    scores = first.scores()
    scores[0] = scores[0].model_copy(update={"reason": "=cmd|' /C calc'!A0", "status": "crashed"})
    text = board_records.as_csv(page.run_board(first, scores))
    assert "'=cmd|" in text
    assert ",=cmd|" not in text


@pytest.mark.skipif(shutil.which("ssh-keygen") is None, reason="no OpenSSH")
def test_a_signature_names_who_signed_and_whether_that_is_verified(honest, tmp_path):
    path, keys = packed(honest, tmp_path / "a.zip"), [tmp_path / "mine", tmp_path / "theirs"]
    for key in keys:
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", key], check=True)
    allowed = tmp_path / "allowed"
    allowed.write_text(f"ada@example.org {keys[0].with_suffix('.pub').read_text()}")
    assert signature_sentence(path, allowed) == ""
    assert sign(path, keys[0]) == tmp_path / "a.zip.sig"
    assert signature_sentence(path, allowed) == "signed by ada@example.org, verified"
    assert "signed by SHA256:" in signature_sentence(path, None)
    assert "not verified" in signature_sentence(path, None)
    sign(path, keys[1])
    assert "NOT verified" in signature_sentence(path, allowed)
    sign(path, keys[0])
    packed(edited(honest, f"{TRIAL}/score.json", repeat=0, path_m=1.0), path)
    assert "NOT verified" in signature_sentence(path, allowed)
    assert "NOT" in signature_sentence(path, None)
    with pytest.raises(InputError, match="the bundle could not be signed"):
        sign(path, tmp_path / "no_key")


def with_targets(files, count, **options):
    """The files with a case of that many targets."""
    case = json.loads(files["cases/full/case.json"])
    trajectory = case["trajectory"] | {"kind": "waypoints", "targets_m": [[0.3, 0.0]] * count, **options}
    return files | {"cases/full/case.json": json.dumps(case | {"trajectory": trajectory}).encode()}


@pytest.mark.parametrize(
    ("forge", "sentence"),
    [
        (lambda files: with_targets(files, 100_000), "its case.json is too long (trajectory.waypoints.targets_m"),
        (lambda files: with_targets(files, 9_000, max_time_s=3600.0), "frames; at most 20000000 are possible"),
        (
            lambda files: files | {"cases/full/case.json": b" " * (33 << 20) + files["cases/full/case.json"]},
            "its case.json is larger than 32 MiB",
        ),
    ],
    ids=["many targets", "much time", "many bytes"],
)
def test_a_case_whose_path_would_take_minutes_is_refused_in_one_line_at_once(honest, tmp_path, forge, sentence):
    path = packed(forge(dict(honest)), tmp_path / "a.zip")
    began_s = time.process_time()
    told = reported(path)
    assert told
    assert all(sentence in each and "\n" not in each for each in told), told
    assert time.process_time() - began_s < 5


def test_who_hides_that_its_estimate_is_the_truth_is_not_ranked(honest, tmp_path):
    forged = honest | {f"{OTHER}/estimate.tum": honest[TRUTH]}
    with opened(packed(forged, tmp_path / "forged.zip")) as folder:
        scores = check(folder).scores
        board = page.run_board(folder, scores)
    claims = {score.case: score.claims for score in scores if score.estimator == "wheel_odometry"}
    assert claims == {"full": (TRUTH_COPY,), "dim": ()}
    assert {total.estimator: total.rank for total in board.totals} == {"wheel_odometry": None, "stand_still": None}
