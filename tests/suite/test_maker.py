"""The maker of a scene runs in a sandbox, hands back what it made, and harms nobody whatever it does."""

import sys
from contextlib import suppress
from pathlib import Path

import pytest

from tests.generated import GENERATOR, write_cell
from vobench.errors import SuiteError
from vobench.estimator import isolation
from vobench.estimator.manifest import Limits
from vobench.estimator.program import sandbox_here
from vobench.suite import maker
from vobench.suite.catalog import builtin_root
from vobench.suite.maker import create_scene, generate_place
from vobench.suite.maker_message import encode

pytestmark = pytest.mark.slow  # each starts a process; run by `pytest -m slow`, and by CI
needs_a_sandbox = pytest.mark.skipif(
    sys.platform != "linux" or isolation.FILES in sandbox_here().sees, reason="this machine has no sandbox"
)
HEAD = """
import os, signal, socket
from pathlib import Path
from vobench.plugin import Material, Thing, quad

WALL = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))

def wall(colour):
    return [Thing("wall", WALL, "paint")], {"paint": Material(colour=colour)}
"""


@pytest.fixture
def make(tmp_path):
    """Runs a maker whose `make(seed)` has these lines."""

    def run(body: str, *, seed: int = 0):
        path = tmp_path / "strangers" / "maker.py"
        path.parent.mkdir(exist_ok=True)
        lines = "".join(f"    {line}\n" for line in body.splitlines())
        path.write_text(f"{HEAD}\ndef make(seed):\n{lines}")
        return create_scene(path, seed=seed, scene_name="theirs")

    return run


def test_it_gets_the_seed_and_its_scene_arrives(make) -> None:
    made = make("return wall((0.1 * seed, 0.0, 0.0))", seed=3)
    assert made.materials["paint"].colour == (pytest.approx(0.3), 0, 0)
    assert [thing.name for thing in made.things] == ["wall"]


def test_one_of_ours_makes_the_same_in_the_sandbox(monkeypatch) -> None:
    ramp = builtin_root() / "scenes" / "ramp" / "maker.py"
    in_this_process = encode(create_scene(ramp, seed=2, scene_name="ramp"))
    monkeypatch.setattr(maker, "builtin_root", lambda: Path("/nowhere"))
    assert encode(create_scene(ramp, seed=2, scene_name="ramp")) == in_this_process


def test_it_may_read_the_files_beside_it(make, tmp_path) -> None:
    (tmp_path / "strangers").mkdir()
    (tmp_path / "strangers" / "red.txt").write_text("0.75")
    made = make('return wall((float(Path(__file__).with_name("red.txt").read_text()), 0.0, 0.0))')
    assert made.materials["paint"].colour[0] == 0.75


@needs_a_sandbox
def test_it_reads_no_other_file_of_the_users(make, tmp_path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("0.75")
    with pytest.raises(SuiteError, match=r"No such file or directory|Permission denied"):
        make(f"return wall((float(Path({str(secret)!r}).read_text()), 0.0, 0.0))")


@needs_a_sandbox
def test_it_writes_nowhere_that_stays(make, tmp_path) -> None:
    for place in (tmp_path / "left", tmp_path / "strangers" / "left", Path.home() / "vobench_maker_left"):
        with suppress(SuiteError):  # where it does not write into a folder that ends with it
            make(f"Path({str(place)!r}).write_text('x')\nreturn wall((0.5, 0.5, 0.5))")
        assert not place.exists()


@needs_a_sandbox
@pytest.mark.skipif(
    isolation.NETWORK in sandbox_here().sees, reason="this machine cannot keep programs off the network"
)
def test_it_has_no_network(make) -> None:
    with pytest.raises(SuiteError, match=r"OSError.*unreachable"):
        make("socket.create_connection(('192.0.2.1', 80), timeout=1)\nreturn wall((0.5, 0.5, 0.5))")


def test_what_it_prints_does_not_reach_our_output(make, capfd) -> None:
    make("print('hello')\nreturn wall((0.5, 0.5, 0.5))")
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("return 1 / 0", r"maker\.py: ZeroDivisionError: division by zero"),
        ("import no_such_module", r"maker\.py: ModuleNotFoundError: No module named 'no_such_module'"),
        ("os._exit(0)", "returned no scene"),
        ("os._exit(3)", "the process ended with exit code 3"),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "SIGSEGV"),
        ("raise ValueError('a\\x1b[31m\\nb')", r"ValueError: a.?\[31m b$"),
        ("Path('scene.bin').write_bytes(b'junk')\nos._exit(0)", "what the maker handed back cannot be read"),
        ("Path('scene.bin').symlink_to('/etc/passwd')\nos._exit(0)", "returned no scene"),
        ("Path('error.txt').write_text('all is lost')\nos._exit(0)", "all is lost"),
        ("return None", "should return things, materials by name and, optionally, lights"),
    ],
)
def test_whatever_goes_wrong_is_one_line_that_names_the_maker(make, body, sentence) -> None:
    with pytest.raises(SuiteError, match=sentence) as raised:
        make(body)
    assert "maker.py: " in str(raised.value)
    assert "\n" not in str(raised.value)
    assert "\x1b" not in str(raised.value)


def test_one_that_does_not_end_is_ended(make, monkeypatch) -> None:
    monkeypatch.setattr(maker, "LIMITS", Limits(trial_s=3.0))
    with pytest.raises(SuiteError, match=r"maker\.py: took more than 3 s"):
        make("while True: pass")


@pytest.mark.parametrize("is_builtin", [False, True])
def test_a_file_without_make_is_named_once(tmp_path, monkeypatch, is_builtin) -> None:
    path = tmp_path / "maker.py"
    path.write_text("x = 1\n")
    if is_builtin:
        monkeypatch.setattr(maker, "builtin_root", lambda: tmp_path)
    with pytest.raises(SuiteError) as raised:
        create_scene(path, seed=0, scene_name="theirs")
    assert str(raised.value) == f"{path}: has no function make(seed)"


def test_a_scene_file_that_is_too_large_is_reported_as_such(make, monkeypatch) -> None:
    monkeypatch.setattr(maker, "MAX_SCENE_BYTES", 10)
    with pytest.raises(SuiteError, match=r"returned no scene: scene\.bin is larger than 10 bytes$"):
        make("return wall((0.5, 0.5, 0.5))")


def test_a_scene_file_with_a_second_name_is_reported_as_such(make) -> None:
    with pytest.raises(SuiteError, match=r"returned no scene: scene\.bin has a second name.*\(a hard link\)$"):
        make("Path('a').write_bytes(b'x')\nos.link('a', 'scene.bin')\nos._exit(0)")


def test_a_maker_is_trusted_with_every_python_file_of_its_folder(tmp_path) -> None:
    path = tmp_path / "maker.py"
    other = tmp_path / "parts" / "maker.py"
    other.parent.mkdir()
    path.write_text("one\n")
    other.write_text("two\n")
    (tmp_path / "table.py").write_text("three\n")
    names_and_contents = [*maker.sources(path)]
    assert names_and_contents[:2] == [b"maker.py", b"one\n"]
    assert names_and_contents[2:] == [b"parts/maker.py", b"two\n", b"table.py", b"three\n"]


@pytest.fixture
def generate(tmp_path):
    """Runs the generator of the cell with some text of it replaced."""

    def run(old="", new="", *, seed=3, lighting="day"):
        assert old in GENERATOR
        scene = write_cell(tmp_path / "strangers", GENERATOR.replace(old, new, 1) if old else GENERATOR)
        return generate_place(scene.with_name("generator.py"), seed=seed, lighting=lighting, scene_name="cell")

    return run


def test_a_generator_gets_seed_and_lighting_and_its_place_arrives_with_its_surroundings(generate):
    place = generate(seed=5, lighting="evening")
    lamp, sky = place.lights
    assert [thing.name for thing in place.things] == ["floor", "wall_0", "wall_1", "wall_2", "wall_3", "crate"]
    assert (lamp.name, lamp.power_lm) == ("lamp", 600.0)
    assert sky.illuminance_lx == 2000.0
    assert (sky.panorama.kind, sky.panorama.seed) == ("city", 5)


def test_a_seed_gives_the_same_bytes_again_and_another_seed_gives_others(generate):
    first, again, other = [encode(generate(seed=seed)) for seed in (3, 3, 4)]
    assert first == again
    assert first != other


def test_a_generator_gives_the_same_bytes_in_the_sandbox_and_in_this_process(generate, monkeypatch, tmp_path):
    in_the_sandbox = encode(generate(seed=3))
    monkeypatch.setattr(maker, "builtin_root", lambda: tmp_path)
    assert encode(generate(seed=3)) == in_the_sandbox


def test_a_generator_of_ours_gives_the_same_bytes_in_the_sandbox(monkeypatch):
    flat = builtin_root() / "scenes" / "flat" / "generator.py"
    in_this_process = encode(generate_place(flat, seed=2, lighting="overcast", scene_name="flat"))
    monkeypatch.setattr(maker, "builtin_root", lambda: Path("/nowhere"))
    assert encode(generate_place(flat, seed=2, lighting="overcast", scene_name="flat")) == in_this_process


@needs_a_sandbox
def test_a_generator_reads_no_other_file_of_the_users_and_leaves_none(generate, tmp_path):
    secret = tmp_path / "secret.txt"
    secret.write_text("0.75")
    with pytest.raises(SuiteError, match=r"No such file or directory|Permission denied"):
        generate('"""The cell of a seed."""', f"open({str(secret)!r}).read()")
    with suppress(SuiteError):
        generate('"""The cell of a seed."""', f"open({str(tmp_path / 'left')!r}, 'w').write('x')")
    assert not (tmp_path / "left").exists()


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("def generate(", "def make(", r"generator\.py: has no function generate\(seed, lighting\)$"),
        ("return GeneratedPlace(", "return (", r"should return a GeneratedPlace, not tuple$"),
        ('"plaster": Material', '"paint": Material', r"returns things without materials: plaster$"),
        ("lighting], panorama", 'lighting + "s"], panorama', r"KeyError: 'days'$"),
        ("side_m = float(", "side_m = float('nan') * float(", r"'floor' with a mesh whose .* not finite$"),
        ("[lamp, sky]", "[lamp, 3]", r"returns a light that is no .*: int$"),
        ("[lamp, sky]", "7", r"should return a list of lights, not int$"),
    ],
)
def test_whatever_goes_wrong_in_a_generator_is_one_line_that_names_it(generate, old, new, sentence):
    with pytest.raises(SuiteError, match=sentence) as raised:
        generate(old, new)
    assert "generator.py: " in str(raised.value)
    assert "\n" not in str(raised.value)
