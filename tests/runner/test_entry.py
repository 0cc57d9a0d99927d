"""Entries of the store: whatever befalls a file that was written, it is noticed before it is believed."""

import os
import random
import shutil
from pathlib import Path

import pytest

from vobench.errors import InputError
from vobench.report import page
from vobench.runner import entry
from vobench.runner.entry import MANIFEST, copy_files, fault, remember, seal
from vobench.runner.estimate import ESTIMATE
from vobench.runner.executor import Serial
from vobench.runner.folder import SCORE
from vobench.runner.run import run_suite
from vobench.runner.store import Store
from vobench.runner.task import plan

FILES = {"a.npy": b"0123456789" * 9, "deep/b.tum": b"0 1 2\n", "empty": b""}


@pytest.fixture
def made(tmp_path):
    """A sealed entry, and the file that says which states were hashed."""
    folder, checked = tmp_path / "entry", tmp_path / "state" / "entry.json"
    for name, content in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    remember(checked, seal(folder))
    return folder, checked


def change(path: Path, content: bytes) -> None:
    """Write other bytes, at another time than before by any clock."""
    after_ns = path.stat().st_mtime_ns + 10_000_000
    path.write_bytes(content)
    os.utime(path, ns=(after_ns, after_ns))


def never(*_):
    raise AssertionError("nothing should be hashed")


def test_a_sealed_entry_is_sound_and_is_not_hashed_again(made, monkeypatch):
    monkeypatch.setattr(entry, "file_hash", never)
    assert fault(*made) == ""


def test_a_copy_is_hashed_once(made, tmp_path, monkeypatch):
    shutil.copytree(made[0], tmp_path / "copy")
    assert fault(tmp_path / "copy", tmp_path / "checked") == ""
    monkeypatch.setattr(entry, "file_hash", never)
    assert fault(tmp_path / "copy", tmp_path / "checked") == ""


def test_where_nothing_can_be_written_a_process_hashes_once(made, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    nowhere = tmp_path / "file" / "checked"
    assert fault(made[0], nowhere) == ""
    monkeypatch.setattr(entry, "file_hash", never)
    assert fault(made[0], nowhere) == ""


@pytest.mark.parametrize("name", [*FILES, MANIFEST])
def test_every_byte_that_is_flipped_or_cut_off_is_noticed(made, name):
    folder, checked = made
    whole = (folder / name).read_bytes()
    for at in range(len(whole)):
        for bad in (whole[:at] + bytes([whole[at] ^ 0x20]) + whole[at + 1 :], whole[:at], whole + b"\n"):
            change(folder / name, bad)
            assert fault(folder, checked), (at, bad)
    change(folder / name, whole)
    assert fault(folder, checked) == ""


def test_what_is_wrong_is_said_with_the_files_name(made):
    folder, checked = made
    change(folder / "a.npy", bytes(90))
    assert fault(folder, checked) == "a.npy holds other bytes than were written"
    change(folder / "a.npy", bytes(8))
    assert fault(folder, checked) == "a.npy has 8 bytes, should have 90"
    (folder / "a.npy").unlink()
    assert fault(folder, checked) == "a.npy cannot be read (No such file or directory)"
    (folder / MANIFEST).write_text("{}")
    assert fault(folder, checked) == f"{MANIFEST} is not as it was written"


def test_bytes_that_rot_without_a_trace_are_found_when_all_is_hashed_anew(made):
    folder, checked = made
    stat = (folder / "a.npy").stat()
    (folder / "a.npy").write_bytes(bytes(90))
    os.utime(folder / "a.npy", ns=(stat.st_atime_ns, stat.st_mtime_ns))
    assert fault(folder, checked) == ""
    assert fault(folder) == "a.npy holds other bytes than were written"


@pytest.mark.parametrize("content", [b"", b"\0" * 40, b'{"a.npy": [90, 1, 2]}', b"[]"])
def test_a_damaged_memory_of_states_is_made_anew(made, content):
    folder, checked = made
    right = checked.read_bytes()
    checked.write_bytes(content)
    assert fault(folder, checked) == ""
    assert checked.read_bytes() == right


def test_a_file_is_copied_if_it_is_what_was_written(made, tmp_path):
    copy_files(made[0], ["a.npy"], tmp_path)
    assert (tmp_path / "a.npy").read_bytes() == FILES["a.npy"]
    change(made[0] / "a.npy", bytes(90))
    with pytest.raises(InputError, match=r"differs from what was written; run the suite again to recreate it: .*a.npy"):
        copy_files(made[0], ["a.npy"], tmp_path)


def damaged(content: bytes, rng: random.Random) -> bytes:
    """The same number of bytes, or fewer: one bit flipped, a stretch zeroed, or the end cut off."""
    at = rng.randrange(len(content))
    if rng.random() < 0.5:
        return content[:at] + bytes([content[at] ^ (1 << rng.randrange(8))]) + content[at + 1 :]
    end = rng.randrange(at, len(content)) + 1
    zeroed = content[:at] + bytes(end - at) + content[end:]
    return zeroed if zeroed != content else content[:at]


ROUNDS = 2


@pytest.mark.slow
def test_damage_to_any_file_of_every_entry_is_told_and_mended_and_scores_stay_equal(bench, first, tmp_path):
    """Lights, sequences, estimates and scores, their manifests among them: in each round one file of each entry."""
    rng, store, suite = random.Random(14), tmp_path / "cache", bench.plan()
    shutil.copytree(bench.folder / "cache", store)
    keys, before = [task.key for task in plan(suite, {})], scores(first)
    for _ in range(ROUNDS):
        said, spoilt = list[str](), list[Path]()
        for key in keys:
            spoilt.append(rng.choice([path for path in sorted((store / key).iterdir()) if path.stat().st_size]))
            change(spoilt[-1], damaged(spoilt[-1].read_bytes(), rng))
        run = run_suite(
            suite, {}, root=tmp_path, store=store, executor=Serial(), finish=page.write_reports, tell=said.append
        )
        assert sorted(sentence.split("/")[-1] for sentence in said) == sorted(path.parent.name for path in spoilt)
        assert scores(run) == before
        assert all(Store(store).has(key) for key in keys)


def scores(run):
    return {
        str(path.relative_to(run.path)): path.read_bytes()
        for name in (SCORE, ESTIMATE)
        for path in run.path.rglob(name)
    }
