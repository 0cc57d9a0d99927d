"""Settings hold their bounds whoever builds them, and YAML and Python are told the same."""

from dataclasses import replace
from math import inf, nan, nextafter
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
import pytest
from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen
from numpy.typing import NDArray
from pydantic import ValidationError
from typing_extensions import TypeAliasType

from vobench.errors import InputError, SettingError
from vobench.setting import ByKind, FromPreset, Matching, Name, OneOf, hints, settings, unit_of
from vobench.suite.yaml_file import checked, json_schema, plain


@settings()
class Spring:
    """A part of something larger."""

    stiffness: Annotated[float, Gt(0), Lt(10)] = 1.0
    coils: Annotated[int, Ge(1), Le(9)] = 3
    is_wound: bool = False


@settings()
class Slide:
    """One of two ways to move."""

    length_m: float
    kind: Literal["slide"] = "slide"


@settings()
class Swing:
    """The other."""

    arm_m: float
    via_m: tuple[tuple[float, float], ...] = ()
    kind: Literal["swing"] = "swing"


SPRINGS = {"soft": Spring(stiffness=0.5), "stiff": Spring(stiffness=9.0, coils=9)}


@settings()
class Toy:
    """Something of every sort that a field can be."""

    name: Name = "toy"
    wall: Literal["north", "south"] | None = None
    color: Annotated[str, OneOf("color", {"red": 1, "green": 2})] = "red"
    code: Annotated[str, Matching("[a-z]+", "small letters")] = "a"
    text: Annotated[str, MinLen(1)] = "a"
    size_m: tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)]] | None = None
    times_s: Annotated[tuple[float, ...], MinLen(1), MaxLen(3)] = (0.0,)
    curve: Annotated[float, Ge(0.5)] | str | tuple[float, ...] = "straight"
    spring: Annotated[Spring, FromPreset("spring", SPRINGS)] = Spring()
    motion: Annotated[Slide | Swing, ByKind("motion", default="swing")] = Slide(length_m=1.0)
    springs: dict[Name, Spring] | None = None
    first_s: float = 0.0
    last_s: float = 1.0

    def __post_init__(self) -> None:
        if self.first_s > self.last_s:
            raise SettingError(f"should be at most last_s, but is {self.first_s:g} against {self.last_s:g}", "first_s")


def said_by_pydantic(kind: type, data: dict[str, Any]) -> list[tuple[tuple[int | str, ...], str]]:
    with pytest.raises(ValidationError) as refused:
        checked(kind, data)
    return [(error["loc"], error["type"]) for error in refused.value.errors()]


def sides(bound: Any) -> tuple[float, float]:
    """The last value that a bound lets pass, and the first that it does not."""
    match bound:
        case Gt(at):
            return nextafter(at, inf), at
        case Ge(at):
            return at, nextafter(at, -inf)
        case Lt(at):
            return nextafter(at, -inf), at
        case Le(at):
            return at, nextafter(at, inf)
    raise AssertionError(bound)


@pytest.mark.parametrize("bound", hints(Spring)["stiffness"].__metadata__, ids=repr)
def test_both_sides_of_a_bound_are_as_pydantic_has_them(bound):
    passes, fails = sides(bound)
    assert checked(Spring, {"stiffness": passes}) == Spring(stiffness=passes)
    said_by_pydantic(Spring, {"stiffness": fails})
    with pytest.raises(SettingError, match=r"^stiffness: should be (greater|less) than"):
        Spring(stiffness=fails)


RIGHT = [
    {},
    {"wall": "north", "color": "green", "code": "abc", "size_m": [1, 2], "times_s": [1, 2, 3]},
    *({"curve": curve} for curve in (0.5, 2, "bent", [], [0, 1.5])),
    {"springs": {"a": {"coils": 2}, "b": {}}, "first_s": 1, "last_s": 1},
    {"spring": {"stiffness": 2, "is_wound": True}},
]  # fmt: skip
WRONG = [
    *({"name": name} for name in ("", "A", "a/b", 3, None)),
    *({"wall": wall} for wall in ("east", 1)),
    *({"color": color} for color in ("rad", 1)),
    *({"code": code} for code in ("a1", "", [])),
    *({"text": text} for text in ("", 2)),
    *({"size_m": size} for size in ([1], [1, 2, 3], [1, 0], [1, "2"], 1, [True, 1])),
    *({"times_s": times} for times in ([], [1, 2, 3, 4], ["a"])),
    *({"curve": curve} for curve in (0.4, None, [[1]])),
    *({"first_s": first} for first in ("0", True, None, [0], 2)),
    *({"spring": spring} for spring in (3, None)),
    *({"motion": motion} for motion in (3, None)),
    *({"springs": springs} for springs in (3, {"A": {}}, {"a": 3})),
]  # fmt: skip


def built(data: dict[str, Any]) -> Toy:
    """A toy as Python builds one, of the same values."""
    toy = dict(data)
    if isinstance(toy.get("spring"), dict):
        toy["spring"] = Spring(**toy["spring"])
    if isinstance(toy.get("springs"), dict):
        toy["springs"] = {name: Spring(**s) if isinstance(s, dict) else s for name, s in toy["springs"].items()}
    return Toy(**toy)


@pytest.mark.parametrize("data", RIGHT, ids=repr)
def test_what_pydantic_lets_pass_python_builds_as_equal_and_as_the_same_json(data):
    toy = checked(Toy, data)
    assert built(data) == toy
    assert checked(Toy, plain(toy)) == toy
    assert plain(built(data)) == plain(toy)


@pytest.mark.parametrize("data", WRONG, ids=repr)
def test_what_pydantic_refuses_python_refuses_at_the_same_key(data):
    places = {loc[0] for loc, _ in said_by_pydantic(Toy, data) if loc}
    with pytest.raises(SettingError) as refused:
        built(data)
    assert isinstance(refused.value, InputError)
    assert {refused.value.keys[0]} == set(data)
    assert places <= set(data)


@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_no_setting_is_nan_or_infinite(value):
    with pytest.raises(SettingError, match="first_s: should be a finite number"):
        Toy(first_s=value)
    with pytest.raises(SettingError, match=r"size_m\.1: should be a finite number"):
        Toy(size_m=(1.0, value))


def test_whole_numbers_become_fractions_so_that_equal_settings_are_equal_text():
    toy = Toy(size_m=(1, np.float32(2)), times_s=[3], spring=Spring(stiffness=np.int64(4)))
    assert [type(x) for x in (*toy.size_m, *toy.times_s, toy.spring.stiffness)] == [float] * 4
    assert repr(Toy(first_s=0, last_s=1)) == repr(Toy())


def test_a_changed_copy_is_held_to_the_same_bounds():
    with pytest.raises(SettingError, match=r"^coils: should be 9 or less \(got 10\)$"):
        replace(Spring(), coils=10)


def test_a_preset_gives_what_is_not_said_otherwise():
    assert checked(Toy, {"spring": "stiff"}).spring == SPRINGS["stiff"]
    assert checked(Toy, {"spring": {"like": "stiff", "coils": 2}}).spring == replace(SPRINGS["stiff"], coils=2)
    assert json_schema(Toy)["properties"]["spring"]["anyOf"][0]["properties"]["like"]["enum"] == ["soft", "stiff"]


def test_a_section_without_a_kind_is_of_the_default_one():
    assert checked(Toy, {"motion": {"arm_m": 1, "via_m": [[1, 2]]}}).motion == Swing(arm_m=1.0, via_m=((1.0, 2.0),))
    assert checked(Toy, {"motion": {"kind": "slide", "length_m": 2}}).motion == Slide(length_m=2.0)
    with pytest.raises(ValidationError, match=r"no kind of motion named 'slyde'\. Did you mean 'slide'"):
        checked(Toy, {"motion": {"kind": "slyde"}})


@pytest.mark.parametrize(
    ("name", "unit"),
    [("size_m", "m"), ("wheel_speed_mps", "m/s"), ("dark_e_per_s", "electrons/s"), ("white_cd_m2", "cd/m²"), ("m", "")],
)  # fmt: skip
def test_a_name_says_its_unit(name, unit):
    assert unit_of(name) == unit


Entry = TypeVar("Entry")
Row = TypeAliasType("Row", tuple[Entry, ...], type_params=(Entry,))
Height = TypeAliasType("Height", Annotated[float, Gt(0)])


@settings()
class Table:
    """Fields whose annotations are aliases, as NDArray is one from NumPy 2.5 on."""

    row: Row[int] = (1, 2)
    height_m: Height | None = 1.0
    places_m: NDArray[np.float64] | None = None


def test_an_alias_holds_values_to_what_it_stands_for():
    places_m = np.zeros((2, 3))
    assert Table(row=(3,), height_m=2, places_m=places_m).places_m is places_m
    for wrong, key in (({"row": (1, "a")}, "row.1"), ({"height_m": 0}, "height_m"), ({"places_m": 1}, "places_m")):
        with pytest.raises(SettingError, match=rf"^{key}: should be"):
            Table(**wrong)
