"""A run's hashes: one for each file, and only for files of the run."""

import hashlib
import json

import pytest

from vobench.errors import InputError
from vobench.results.hashes import HASHES, file_hash, read_hashes, write_hashes
from vobench.results.run_folder import SEQUENCE, RunFolder


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
