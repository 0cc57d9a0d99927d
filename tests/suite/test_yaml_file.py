"""Settings in YAML: every mistake is a sentence with its line."""

import os
from typing import Annotated, Literal

import pytest
from annotated_types import Ge, Gt, Le

from tests.work import calls_of
from vobench.errors import SettingError, SuiteError
from vobench.setting import ByKind, FromPreset, Name, OneOf, Share, settings
from vobench.suite import yaml_parser
from vobench.suite.yaml_file import read, read_all


@settings()
class Chip:
    """A chip."""

    read_noise_e: Annotated[float, Ge(0)] = 0.0
    prnu: Share = 0.0
    adc_bits: Literal[8, 10] | None = None


CHIPS = {"clean": Chip(), "noisy": Chip(read_noise_e=25.0, adc_bits=10)}


@settings()
class Limits:
    """Least and most."""

    least_ms: float = 1.0
    most_ms: float = 2.0

    def __post_init__(self) -> None:
        if self.least_ms > self.most_ms:
            raise SettingError(f"should be at most most_ms (got {self.least_ms:g})", "least_ms")


@settings()
class Circle:
    """A circle."""

    radius_m: Annotated[float, Gt(0)]
    kind: Literal["circle"] = "circle"


@settings()
class Square:
    """A square."""

    side_m: Annotated[float, Gt(0)]
    kind: Literal["square"] = "square"


Course = Annotated[Circle | Square, ByKind("course", default="circle")]


@settings()
class File:
    """All of it."""

    name: Name
    seed: Annotated[int, Ge(0), Le(9)] = 0
    lens: Annotated[str, OneOf("lens", ("wide", "tele"))] = "wide"
    chips: dict[Name, Annotated[Chip, FromPreset("chip", CHIPS)]] | None = None
    courses: dict[Name, Course] | None = None
    limits: Limits | None = None
    times_s: tuple[float, ...] = ()


COURSES = "Known: circle, square"
WRONG = [
    ("name: 12", "name: should be text (a number or a date needs quotes) (got 12)"),
    ("sed: 1", "sed: unknown key. Did you mean 'seed'? Known: chips, courses, lens, limits, name, seed, times_s"),
    ("seed: 1.5", "seed: should be a whole number (got 1.5)"),
    ("seed: 10", "seed: should be 9 or less (got 10)"),
    ("lens: wild", "lens: no lens named 'wild'. Did you mean 'wide'? Known: tele, wide"),
    ("times_s: 1", "times_s: should be a list, as in [a, b] (got 1)"),
    ("times_s: [1, '2']", "times_s.1: should be a number (got '2')"),
    ("limits: 3", "limits: should be keys with values (got 3)"),
    ("limits: {least_ms: 3}", "limits.least_ms: should be at most most_ms (got 3)"),
    ("chips: {A: clean}", "chips.A: should be lower-case letters, digits, _ and ., a letter or digit first (got 'A')"),
    ("chips: {a: noizy}", "chips.a: no chip named 'noizy'. Did you mean 'noisy'? Known: clean, noisy"),
    ("chips: {a: {like: noizy}}", "chips.a.like: no chip named 'noizy'. Did you mean 'noisy'? Known: clean, noisy"),
    ("chips: {a: {like: noisy, prnu: 2}}", "chips.a.prnu: should be 1 or less (got 2)"),
    ("chips: {a: {pr: 0}}", "chips.a.pr: unknown key. Did you mean 'prnu'? Known: adc_bits, like, prnu, read_noise_e"),
    ("chips: {a: {adc_bits: 9}}", "chips.a.adc_bits: should be 8 or 10 (got 9)"),
    ("courses: {a: {kind: cir}}", f"courses.a.kind: no kind of course named 'cir'. Did you mean 'circle'? {COURSES}"),
    ("courses: {a: {kind: 3}}", f"courses.a.kind: no kind of course named '3'. {COURSES}"),
    ("courses: {a: {}}", "courses.a.radius_m: this key is missing"),
    ("courses: {a: {radius: 1}}", "courses.a.radius: unknown key. Did you mean 'radius_m'? Known: kind, radius_m"),
    ("courses: {a: {radius_m: 1, side_m: 1}}", "courses.a.side_m: belongs to square; the kind is circle by default"),
    ("courses: {a: {kind: square, side_m: 1, radius_m: 1}}", "courses.a.radius_m: belongs to circle; this is square"),
    ("courses: {a: 3}", "courses.a: should be keys with values (got 3)"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "sentence"), WRONG, ids=[line for line, _ in WRONG])
def test_a_mistake_is_one_sentence_with_line_key_value_and_remedy(tmp_path, line, sentence):
    path = tmp_path / "file.yaml"
    path.write_text("# settings\n" + line + ("" if line.startswith("name") else "\nname: a") + "\n")
    with pytest.raises(SuiteError) as refused:
        read(path, File)
    assert str(refused.value) == f"{path}:2: {sentence}"


def test_what_is_right_in_a_wrong_file_is_read(tmp_path):
    (tmp_path / "file.yaml").write_text("chips: {a: clean, b: {prnu: 3}}\ntimes_s: [1, x, 3]\nlens: x\n")
    reading = read_all(tmp_path / "file.yaml", File)
    assert sorted(m.places[0].key for m in reading.mistakes) == ["chips.b.prnu", "lens", "name", "times_s.1"]
    assert (reading.model.chips, reading.model.times_s, reading.model.seed) == ({"a": Chip()}, (1.0, 3.0), 0)
    assert reading.source.original_keys(("times_s", 1)) == ("times_s", 2)
    assert not hasattr(reading.model, "name")


def test_the_same_file_is_the_same_settings(tmp_path):
    (tmp_path / "file.yaml").write_text("{name: a, chips: {a: noisy}, courses: {b: {radius_m: 1}}, times_s: [1]}")
    course, chips = Circle(radius_m=1.0), {"a": CHIPS["noisy"]}
    assert read(tmp_path / "file.yaml", File) == File(name="a", chips=chips, courses={"b": course}, times_s=(1.0,))


def test_a_change_is_made_at_its_keys_alone_and_the_file_reads_as_before_next_time(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text("name: x\nchips: {a: &a {prnu: 0.25}, b: *a}\ntimes_s: [1, 2]\n")
    unchanged = read(path, File)
    changed = read_all(path, File, {"chips.a.prnu": "0.5", "times_s.1": "3", "chips.a.read_noise_e": "2"}).model
    assert changed.chips == {"a": Chip(prnu=0.5, read_noise_e=2.0), "b": Chip(prnu=0.25)}
    assert changed.times_s == (1.0, 3.0)
    assert read(path, File) == unchanged
    whole = read_all(path, File, {"chips": "{c: {prnu: 0.1}}", "chips.c.prnu": "0.2"}).model
    assert whole.chips == {"c": Chip(prnu=0.2)}


def bomb(levels: int) -> str:
    """Each level repeats the one before nine times."""
    lines = ["name: x", "l0: &l0 {a: 1}"]
    lines += [f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * 9)}]" for n in range(1, levels)]
    return "\n".join(lines)


HOSTILE = {
    "self-merge": ("name: x\na: &a {<<: *a}\n", r":2:4: an alias is inside what it repeats"),
    "list in itself": ("name: x\na: &a [*a]\n", r":2:4: an alias is inside what it repeats"),
    "long integer": (f"name: x\na: {'9' * 4301}\n", r":2:4: a number has more than 400 characters"),
    "long hexadecimal": (f"name: x\na: 0x{'f' * 5000}\n", r":2:4: a number has more than 400 characters"),
    "bomb": (bomb(12), r"holds more than 10000 values, including those that aliases repeat"),
    "bomb of merges": (
        "name: x\nl0: &l0 {a: 1, b: 2}\n"
        + "".join(f"l{n}: &l{n} {{<<: [{', '.join([f'*l{n - 1}'] * 9)}]}}\n" for n in range(1, 12)),
        r"holds more than 10000 values",
    ),
    "depth": (f"name: x\na: {'[' * 300}{']' * 300}\n", r"nested"),
    "great depth": (f"name: x\na: {'[' * 100_000}{']' * 100_000}\n", r":2:104: is nested more than 100 deep"),
    "many keys": ("name: x\n" + "".join(f"k{n}: 1\n" for n in range(6_000)), r"holds more than 10000 values"),
    "long text": (f"name: {'x' * (3 << 20)}\n", r"should be text of at most 2 MiB"),
    "no date": ("name: x\na: 2001-99-99\n", r":2:4: "),
    "not base 64": ("name: x\na: !!binary '~'\n", r"file\.yaml"),
    "merge of a number": ("name: x\na: {<<: 3}\n", r":2"),
    "a key of a list": ("name: x\n? [a, b]\n: 1\n", r"file\.yaml"),
    "a set": ("name: x\na: !!set {b, c}\n", r"file\.yaml"),
    "an omap": ("name: x\na: !!omap {b: 1}\n", r"file\.yaml"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_one_line_with_its_place_soon(tmp_path, monkeypatch, name):
    monkeypatch.setattr(yaml_parser, "MOST_NODES", 10_000)
    text, sentence = HOSTILE[name]
    path = tmp_path / "file.yaml"
    path.write_text(text)

    def refused():
        with pytest.raises(SuiteError, match=sentence) as raised:
            read(path, File)
        for line in str(raised.value).splitlines():
            assert str(path) in line or line.startswith("and ")

    assert calls_of(refused) < 10_000_000  # less than a thousand for each of the values that a file may have


def test_a_device_or_a_pipe_is_one_line_and_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.yaml")
    (tmp_path / "zero.yaml").symlink_to("/dev/zero")
    for name in ("pipe.yaml", "zero.yaml"):
        with pytest.raises(SuiteError, match=f"cannot read .*{name}: not a regular file"):
            read(tmp_path / name, File)


def test_a_value_to_set_obeys_the_limits_of_files(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text("name: x\n")
    with pytest.raises(SuiteError, match="should be a value in YAML"):
        read_all(path, File, {"name": "9" * 5000})


def test_a_deep_file_of_every_days_size_is_read(tmp_path):
    path = tmp_path / "file.yaml"
    path.write_text("name: x\na: &a {b: [1, 2]}\nc: [*a, *a]\n")
    with pytest.raises(SuiteError) as raised:
        read(path, File)
    assert all("unknown" in line or "a" in line for line in str(raised.value).splitlines())
    assert "alias" not in str(raised.value)
