"""The cache: what is there is whole, what is equal is one, and what is dead is swept."""

import errno
import fcntl
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from multiprocessing import get_context
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vobench import stop
from vobench.errors import InputError
from vobench.runner.key import cache_folder, canonical, digest, folder_digest
from vobench.runner.store import BAD, PREFIX, Store, sweep

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
        "import sys, time; from pathlib import Path; from vobench.runner.store import Store\n"
        "def build(folder): print(folder, flush=True); time.sleep(600)\n"
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


def test_a_folder_that_another_process_sweeps_before_it_is_locked_is_made_again(store, monkeypatch):
    make = tempfile.mkdtemp
    swept = []

    def mkdtemp(**options):
        folder = make(**options)
        if not swept:
            swept.append(folder)
            Path(folder).rmdir()
        return folder

    monkeypatch.setattr("tempfile.mkdtemp", mkdtemp)
    entry = store.get("kind", {"from": "here"}, lambda folder: (folder / "file").write_text("x"))
    assert len(swept) == 1
    assert (entry / "file").read_text() == "x"


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


RACER = """
import os, sys
from pathlib import Path
from vobench.runner import store
from vobench.runner.store import Store
store.seal.__globals__["_sync"] = lambda _: None  # the disk's pace is not what is tried
root, turns = Path(sys.argv[1]), int(sys.argv[2])
made = os.open(root / "made", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
def build(folder):
    os.write(made, b"x")
    (folder / "result").write_text("whole")
print("ready", flush=True)
sys.stdin.readline()
for turn in range(turns):
    found = Store(root).get("kind", {"turn": turn}, build)
    assert (found / "result").read_text() == "whole"
"""


@pytest.mark.parametrize("turns", [int(os.environ.get("VOBENCH_TEST_TURNS", "300"))])
def test_two_processes_that_want_the_same_never_make_it_twice(tmp_path, turns):
    command = [sys.executable, "-c", RACER, str(tmp_path), str(turns)]
    racers = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    for racer in racers:
        racer.stdout.readline()
    for racer in racers:
        racer.stdin.write("go\n")
        racer.stdin.flush()
    for racer in racers:
        racer.communicate()
        assert racer.returncode == 0
    assert (tmp_path / "made").stat().st_size == turns
    assert len(list((tmp_path / "kind").iterdir())) == turns
    assert list((tmp_path / "state" / "locks").iterdir()) == []


HOLDER = """
import sys, time
from pathlib import Path
from vobench.runner.store import Store
def build(folder):
    print("making", flush=True)
    time.sleep(600)
Store(Path(sys.argv[1])).get("kind", {}, build)
"""


@pytest.fixture
def held(store):
    """Another process makes the result of no inputs, and does not come to an end."""
    command = [sys.executable, "-c", HOLDER, str(store.root)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        process.stdout.readline()
        yield process
        process.kill()


def test_whoever_waits_says_for_whom_and_goes_on_when_that_one_is_killed(store, held):
    said = list[str]()

    def tell(sentence):
        said.append(sentence)
        held.kill()

    assert (store.get("kind", {}, write("mine"), tell=tell) / "result").read_text() == "mine"
    assert said == [f"waiting for process {held.pid} on {socket.gethostname()}, which makes kind-{digest({})}"]


def test_whoever_waits_answers_a_stop_within_a_second(store, held, monkeypatch):
    """It looks for a stop between naps, none of which is a second long: however slow the machine is."""
    sleep, naps_s = time.sleep, list[float]()

    def nap(duration_s):
        naps_s.append(duration_s)
        sleep(duration_s)

    monkeypatch.setattr("vobench.runner.store.time.sleep", nap)
    timer = threading.Timer(1.5, stop.request, [2])
    timer.start()
    try:
        with pytest.raises(stop.Stopped):
            store.get("kind", {}, write(""))
    finally:
        stop.withdraw_requests()
    assert len(naps_s) > 1
    assert max(naps_s) < 1


def test_where_another_process_has_made_a_failure_anew_that_is_taken(store):
    store.get("kind", {}, write("failed"))
    waits, made = threading.Event(), list[Path]()

    def again():
        made.append(store.get("kind", {}, write("twice"), keeps=lambda _: False, tell=lambda _: waits.set()))

    waiting = threading.Thread(target=again)

    def build(folder):
        waiting.start()
        assert waits.wait(120)
        write("failed again")(folder)

    store.get("kind", {}, build, keeps=lambda _: False)
    waiting.join()
    assert (made[0] / "result").read_text() == "failed again"


def test_a_damaged_result_is_made_anew_with_a_sentence_and_set_aside(store):
    made, said = store.get("kind", {}, write("right")), list[str]()
    (made / "result").write_text("wrong size")
    store.get("kind", {}, write("right"), tell=said.append)
    assert (made / "result").read_text() == "right"
    assert said == [f"a damaged result is computed again, because result has 10 bytes, should have 5: {made}"]
    assert (made.with_name(f"{BAD}{made.name}") / "result").read_text() == "wrong size"


def test_what_a_result_is_made_of_must_be_there_and_sound(store):
    made = store.get("kind", {}, write("right"))
    assert store.need(f"kind/{made.name}") == made
    (made / "result").write_text("wrong")
    os.utime(made / "result", ns=(0, 0))
    with pytest.raises(
        InputError, match=r"a result that this depends on is damaged \(result holds other bytes than were written\)"
    ):
        store.need(f"kind/{made.name}")
    with pytest.raises(
        InputError, match="a result that this depends on is gone; run the same command again to recreate it"
    ):
        store.need("kind/other")


def read_as_nobody(root, waits):
    os.setgid(65534)
    os.setuid(65534)
    store = Store(root)
    try:
        store.get("kind", {"other": 1}, write(""))
    except InputError as error:
        waits.put(str(error))
    waits.put((store.get("kind", {}, write("")) / "result").read_text())


@pytest.mark.skipif(os.geteuid() != 0, reason="whoever is not root need not become nobody")
def test_a_complete_cache_may_be_read_only_and_an_incomplete_one_says_so(store, tmp_path):
    """In a process of nobody's, for root may write anywhere."""
    store.get("kind", {}, write("there"))
    for place in [tmp_path, *tmp_path.parents][:-2]:
        place.chmod(place.stat().st_mode | 0o055)
    before = {path: path.stat() for path in sorted(store.root.rglob("*"))}
    context = get_context("fork")
    waits = context.SimpleQueue()
    child = context.Process(target=read_as_nobody, args=(store.root, waits))
    child.start()
    child.join()
    assert waits.get() == f"VOBENCH_CACHE should be a folder that can be written (Permission denied): {store.root}"
    assert waits.get() == "there"
    assert {path: path.stat().st_mtime_ns for path in sorted(store.root.rglob("*"))} == {
        path: stat.st_mtime_ns for path, stat in before.items()
    }


def filled(store, count):
    """Results of 1000 bytes and a little, used one day after the other, the first longest ago."""
    made = [store.get("kind", {"n": n}, write("x" * 1000)) for n in range(count)]
    for n, folder in enumerate(made):
        used_s = time.time() - (count - n) * 86400
        os.utime(folder, (used_s, used_s))
    return made


def test_the_least_recently_used_go_first_until_so_much_is_left(store):
    made = filled(store, 4)
    assert store.has(f"kind/{made[0].name}")  # which is a use
    size = next(store.entries()).bytes
    removed = store.collect(keep_bytes=2.5 * size)
    assert [entry.path for entry in removed] == made[1:3]
    assert sorted(entry.path for entry in store.entries()) == sorted([made[0], made[3]])
    assert [*store.root.glob("state/checked/kind/*")] != []
    assert len([*store.root.glob("state/checked/kind/*")]) == 2


def test_what_was_not_used_for_days_goes(store):
    made = filled(store, 4)
    assert [entry.path for entry in store.collect(older_s=2.5 * 86400)] == made[:2]
    assert store.collect(older_s=2.5 * 86400) == []


def test_what_is_damaged_or_unfinished_goes_in_any_case_and_all_else_stays(store):
    made = filled(store, 3)
    (made[1] / "result").write_text("")
    store.set_aside_damaged([f"kind/{made[1].name}"], str)
    (store.root / "kind" / f"{PREFIX}x").mkdir()
    (store.root / "state" / "locks" / "of a killed process").write_text("")
    assert [entry.is_damaged for entry in store.collect()] == [True]
    assert {path.name for path in (store.root / "kind").iterdir()} == {made[0].name, made[2].name}
    assert list((store.root / "state" / "locks").iterdir()) == []


def test_what_another_process_makes_anew_is_not_removed(store, held):
    (folder := store.path("kind", {})).mkdir()
    os.utime(folder, (0, 0))
    assert store.collect(older_s=1) == []
    held.kill()
    held.wait()
    assert [entry.path for entry in store.collect(older_s=1)] == [folder]


def test_what_a_run_has_used_since_it_began_is_not_removed(store):
    made = filled(store, 2)
    with store.in_use(str):
        time.sleep(0.02)
        assert store.has(f"kind/{made[0].name}")
        assert [entry.path for entry in store.collect(keep_bytes=0)] == [made[1]]
    assert [entry.path for entry in store.collect(keep_bytes=0)] == [made[0]]


def test_a_store_that_is_larger_than_wanted_is_told_after_a_run(store, monkeypatch):
    said = list[str]()
    filled(store, 2)
    for limit in ("1", "0.5", "1e-6"):
        monkeypatch.setenv("VOBENCH_CACHE_GB", limit)
        with store.in_use(said.append):
            pass
    (sentence,) = said
    assert sentence.startswith("the cache holds 2.")
    assert sentence.endswith(" GB, more than VOBENCH_CACHE_GB says; run: vobench cache gc --keep-gb 1e-06")


@pytest.mark.parametrize("limit", ["much", "-1", "nan", "0"])
def test_a_limit_that_is_no_number_is_said_before_a_run(store, monkeypatch, limit):
    monkeypatch.setenv("VOBENCH_CACHE_GB", limit)
    with pytest.raises(InputError, match="VOBENCH_CACHE_GB should be a number of gigabytes above 0"):
        store.in_use(str).__enter__()


def test_a_result_that_is_forgotten_is_made_again_and_others_stay(store):
    forgotten = store.get("kind", {"a": 1}, write("old"))
    other = store.get("kind", {"a": 2}, write("other"))
    store.forget([str(forgotten.relative_to(store.root)), "kind/never-made"])
    assert (store.get("kind", {"a": 1}, write("new")) / "result").read_text() == "new"
    assert (other / "result").read_text() == "other"
