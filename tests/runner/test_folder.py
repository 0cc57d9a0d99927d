"""A run's hashes: one for each file, and only for files of the run."""

import hashlib
import json

import pytest
from pydantic import ValidationError

from vobench.errors import InputError
from vobench.estimator.sandbox import Sandbox
from vobench.runner.entry import file_hash
from vobench.runner.folder import (
    HASHES,
    ONLY_THEIR_OWN,
    SCORE,
    SEQUENCE,
    STATUSES,
    SURVIVED,
    RunFolder,
    TrialScore,
    make_run,
    open_run,
    read_hashes,
    read_score,
    visible_to,
    write_hashes,
)
from vobench.runner.store import write_json


@pytest.fixture
def run(tmp_path):
    """A run's folder with one case, whose sequence lies elsewhere."""
    cached, case = tmp_path / "cached", tmp_path / "run" / "cases" / "one"
    cached.mkdir()
    case.mkdir(parents=True)
    (cached / "sensors.mcap").write_bytes(b"pictures")
    (cached / "inputs.json").write_bytes(b"{}")
    (case / SEQUENCE).symlink_to(cached)
    (case / "case.json").write_bytes(b"[]")
    return RunFolder(tmp_path / "run")


def test_every_file_has_its_own_hash_and_recordings_are_followed(run):
    write_hashes(run)
    assert read_hashes(run) == {
        "cases/one/case.json": hashlib.sha256(b"[]").hexdigest(),
        "cases/one/sequence/sensors.mcap": hashlib.sha256(b"pictures").hexdigest(),
    }


def test_hashing_twice_says_the_same(run):
    write_hashes(run)
    before = (run.path / HASHES).read_bytes()
    write_hashes(run)
    assert (run.path / HASHES).read_bytes() == before


def test_a_file_longer_than_what_is_read_at_once_is_hashed_whole(tmp_path):
    content = bytes(range(256)) * 10_000
    (tmp_path / "long").write_bytes(content)
    assert file_hash(tmp_path / "long") == hashlib.sha256(content).hexdigest()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "kept no hashes"),
        ("{", "not readable as JSON"),
        ("[" * 100_000, "not readable as JSON"),
        ("[]", "should hold one hash for each file"),
        ('{"a": 1}', "should hold one hash for each file"),
        (json.dumps({"../../etc/passwd": "0"}), "names a file outside the run's folder"),
        (json.dumps({"/etc/passwd": "0"}), "names a file outside the run's folder"),
    ],
)
def test_hashes_that_are_none_are_one_sentence_with_the_files_name(run, content, sentence):
    if content is not None:
        (run.path / HASHES).write_text(content)
    with pytest.raises(InputError, match=sentence) as raised:
        read_hashes(run)
    assert str(run.path / HASHES) in str(raised.value)


def score(**changes):
    facts = {
        "case": "c",
        "variant": {},
        "estimator": "e",
        "repeat": 0,
        "status": "ok",
        "reason": "",
        "coverage": 1.0,
        "frames": 9,
        "path_m": 1.0,
        "score": None,
    }
    return TrialScore(**{**facts, **changes})


def fill_with(*scores):
    def fill(folder):
        for s in scores:
            target = folder.estimate(s.case, s.estimator, s.repeat)
            target.mkdir(parents=True)
            write_json(target / SCORE, s.model_dump(mode="json"))

    return fill


def test_scores_come_back_as_they_went_in(tmp_path):
    scores = [score(case=c, estimator=e, reason="grün\n") for c in "ab" for e in "xy"]
    assert make_run(tmp_path, "suite", "0123456789", fill_with(*scores)).scores() == scores


def test_a_suites_folder_stands_for_its_latest_run(tmp_path):
    for name in ("old", "new"):
        made = make_run(tmp_path, "suite", "key", fill_with(score(estimator=name)))
    assert open_run(tmp_path / "suite").path.resolve() == made.path
    assert [s.estimator for s in open_run(tmp_path / "suite").scores()] == ["new"]
    assert open_run(made.path) == made


def test_runs_that_end_in_the_same_second_do_not_meet(tmp_path):
    paths = {make_run(tmp_path, "suite", "samekey!", fill_with(score())).path for _ in range(5)}
    assert len(paths) == 5
    assert all(path.parent == tmp_path / "suite" and "samekey!" in path.name for path in paths)


def test_a_run_that_stops_leaves_nothing_and_the_latest_where_it_was(tmp_path):
    made = make_run(tmp_path, "suite", "key", fill_with(score()))

    def stop(folder):
        fill_with(score())(folder)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make_run(tmp_path, "suite", "key", stop)
    assert {path.name for path in (tmp_path / "suite").iterdir()} == {made.path.name, "latest"}
    assert open_run(tmp_path / "suite").path.resolve() == made.path


def test_a_folder_that_is_no_run_is_refused_in_one_line(tmp_path):
    with pytest.raises(InputError, match=r"^not the folder of a run \(no .*score\.json in it\): "):
        open_run(tmp_path).scores()


def test_a_run_whose_estimates_lie_beside_the_sequence_is_an_older_one(tmp_path):
    old = tmp_path / "cases" / "c" / "e" / "0"
    old.mkdir(parents=True)
    write_json(old / SCORE, score().model_dump(mode="json"))
    with pytest.raises(InputError, match=r"^a run of an older vobench, .*; run the suite again: "):
        RunFolder(tmp_path).scores()


def test_a_score_that_names_another_place_than_its_own_is_refused(tmp_path):
    made = make_run(tmp_path, "suite", "key", fill_with(score()))
    file = made.estimate("c", "e", 0) / SCORE
    write_json(file, score(estimator="../../..").model_dump(mode="json"))
    with pytest.raises(InputError, match=r"^should be the score of its folder, but is that of '\.\./"):
        made.scores()


def test_a_statistic_that_was_not_computed_is_none_and_not_zero():
    metrics = {"metrics": [{"name": "ate_trans", "rmse": 0.5}]}
    assert score(score=metrics).value("ate_trans", "rmse") == 0.5
    assert score(score=metrics).value("rpe_trans", "rmse") is None
    assert score().value("ate_trans", "rmse") is None


def test_a_status_outside_the_list_is_no_score():
    assert STATUSES[:2] == SURVIVED
    with pytest.raises(ValidationError):
        score(status="fine")


def test_a_score_or_a_folder_that_is_none_is_one_sentence_with_its_place(tmp_path):
    with pytest.raises(InputError, match=r"^no such folder: .*nowhere$"):
        RunFolder(tmp_path / "nowhere").scores()
    file = tmp_path / "score.json"
    for content, said in (
        (b"{", r"Invalid JSON"),
        (b"\xff", "Invalid JSON"),
        (b'{"schema_version": "x"}', "schema_version: "),
    ):
        file.write_bytes(content)
        with pytest.raises(InputError, match=rf"^not a score as vobench writes it \({said}.*score\.json$"):
            read_score(file)


def test_a_board_says_what_estimators_could_see():
    full = Sandbox("full")
    none = Sandbox("none", ("the user's files", "the network"))
    honest = [score(estimator=name, sandbox=full) for name in ("a", "b")]
    assert visible_to(honest) == ONLY_THEIR_OWN
    assert visible_to([*honest, score(estimator="c", sandbox=none), score(estimator="d", sandbox=none)]) == (
        "c, d: not sandboxed: it could see the user's files and the network."
    )
    assert "/opt/ros" in visible_to([score(estimator="a", sandbox=Sandbox("full", read=("/opt/ros",)))])


def test_a_board_says_of_which_trials_nothing_is_recorded():
    assert visible_to([score(estimator="old")]) == "old: what it could see is not recorded."
    assert visible_to([score(estimator="a", status="refused")]) == ONLY_THEIR_OWN
    assert visible_to([score(estimator="a", claims=("oracle",))]) == ONLY_THEIR_OWN


def test_a_score_of_before_sandboxes_were_recorded_can_be_read(tmp_path):
    facts = score(estimator="old").model_dump(mode="json")
    del facts["sandbox"]
    (tmp_path / "score.json").write_text(json.dumps(facts))
    assert read_score(tmp_path / "score.json").sandbox is None


def test_a_score_keeps_what_its_estimator_could_see(tmp_path):
    kept = score(sandbox=Sandbox("partial", ("the network",), ("/opt/ros",), "why"))
    (tmp_path / "score.json").write_text(kept.model_dump_json())
    assert read_score(tmp_path / "score.json") == kept
