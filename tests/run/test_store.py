"""The cache: what is there is whole, what is equal is one, and what is dead is swept."""

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench.run.key import cache_folder, canonical, digest, folder_digest
from vobench.run.store import PREFIX, Store, sweep

Json = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def write(text):
    return lambda folder: (folder / "result").write_text(text)


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "cache")


def test_a_result_is_made_once(store):
    made = [store.get("kind", {"a": 1}, write(text)) for text in ("first", "second")]
    assert made[0] == made[1]
    assert (made[0] / "result").read_text() == "first"


def test_other_inputs_or_another_kind_are_another_result(store):
    paths = {store.get(kind, inputs, write("")) for kind in ("a", "b") for inputs in ({"x": 1}, {"x": 2}, {"y": 1})}
    assert len(paths) == 6


def test_a_result_says_what_it_was_made_from_in_any_language(store):
    inputs = {"scene": "Stube × 3"}
    assert (store.get("kind", inputs, write("")) / "inputs.json").read_text(encoding="utf-8") == canonical(inputs)


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_a_build_that_stops_half_way_leaves_nothing(store, error):
    def build(folder):
        write("half")(folder)
        raise error

    with pytest.raises(error):
        store.get("kind", {}, build)
    assert list((store.root / "kind").iterdir()) == []


def test_nothing_is_seen_under_its_name_before_it_is_whole(store):
    def build(folder):
        write("half")(folder)
        assert not store.path("kind", {}).exists()

    store.get("kind", {}, build)


def no_locks(*_):
    raise OSError(errno.ENOLCK, "No locks available")


def test_where_another_process_was_faster_its_result_is_taken(store, monkeypatch):
    monkeypatch.setattr(fcntl, "flock", no_locks)  # else it would have waited

    def build(folder):
        write("slow")(folder)
        store.get("kind", {}, write("fast"))

    assert (store.get("kind", {}, build) / "result").read_text() == "fast"
    assert [path.name for path in (store.root / "kind").iterdir()] == [digest({})]


def test_a_result_that_is_not_kept_is_made_anew_and_leaves_nothing_behind(store):
    store.get("kind", {}, write("old"))
    made = store.get("kind", {}, write("new"), keeps=lambda folder: (folder / "result").read_text() == "new")
    assert (made / "result").read_text() == "new"
    assert list((store.root / "kind").iterdir()) == [made]


def test_a_result_that_is_made_anew_stays_until_it_is(store):
    old = store.get("kind", {}, write("old"))
    with pytest.raises(ZeroDivisionError):
        store.get("kind", {}, lambda _: 1 / 0, keeps=lambda _: False)
    assert (old / "result").read_text() == "old"
    assert store.has(f"kind/{old.name}")


def test_what_a_killed_process_left_is_swept_and_what_a_living_one_fills_is_not(store):
    script = (
        "import sys, time; from pathlib import Path; from vobench.run.store import Store\n"
        "def build(folder): print(folder, flush=True); time.sleep(60)\n"
        "Store(Path(sys.argv[1])).get('kind', {'from': 'other'}, build)"
    )
    command = [sys.executable, "-c", script, str(store.root)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        folder = Path(process.stdout.readline().strip())
        sweep(folder.parent)
        assert folder.is_dir()
        assert folder.name.startswith(PREFIX)
        process.kill()
    sweep(folder.parent)
    assert not folder.exists()


@given(st.dictionaries(st.text(), Json, max_size=4))
def test_a_digest_depends_on_content_and_not_on_order(inputs):
    backwards = dict(reversed(list(inputs.items())))
    assert digest(backwards) == digest(inputs)
    assert digest({**inputs, "one more": 0}) != digest(inputs)


def test_a_folders_digest_sees_names_and_contents_and_no_compiled_python(tmp_path):
    (tmp_path / "a.py").write_text("1")
    seen = [folder_digest(tmp_path)]
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_bytes(b"x")
    assert folder_digest(tmp_path) == seen[0]
    (tmp_path / "a.py").write_text("2")
    seen.append(folder_digest(tmp_path))
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    seen.append(folder_digest(tmp_path))
    assert len(set(seen)) == 3


@pytest.mark.parametrize(
    ("variables", "root"),
    [
        ({"VOBENCH_CACHE": "/a", "XDG_CACHE_HOME": "/b", "HOME": "/c"}, "/a"),
        ({"XDG_CACHE_HOME": "/b", "HOME": "/c"}, "/b/vobench"),
        ({"XDG_CACHE_HOME": "", "VOBENCH_CACHE": "", "HOME": "/c"}, "/c/.cache/vobench"),
    ],
)
def test_where_the_cache_lies(monkeypatch, variables, root):
    for name in ("VOBENCH_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert os.fspath(cache_folder()) == root
