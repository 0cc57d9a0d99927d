"""Turns pydantic's validation errors into sentences for those who write YAML."""

from collections.abc import Collection, Iterator
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

from vobench.errors import Mistake, SettingError
from vobench.setting import COMPLAINTS, complaint
from vobench.suite.yaml_source import Keys, YamlFile

Schema = dict[str, Any]  # a JSON Schema or a part of one
UNKNOWN_KEY = "unexpected_keyword_argument"  # pydantic's type of the error


def complaints(
    source: YamlFile, error: ValidationError, schema: Schema, unread: Collection[Keys] = ()
) -> Iterator[Mistake]:
    """The mistakes behind a validation error, unknown keys first.

    Consequences of other mistakes are left out: at places `unread`, a key that is missing because it is misspelt, and
    a list that is too short because entries of it are wrong.
    """
    errors = sorted(error.errors(), key=lambda each: each["type"] != UNKNOWN_KEY)
    wrong_places = [*unread, *map(location, errors)]
    intended_places = set[tuple[Any, ...]]()
    for each in errors:
        if each["type"] == UNKNOWN_KEY:
            intended_places.add((*each["loc"][:-1], _nearest_key(each, schema)))

    for each in errors:
        place = location(each)
        keys, _ = _walk(schema, place)
        is_misspelt = each["type"] == "missing" and place in intended_places
        is_short_of_wrong_entries = each["type"] == "too_short" and _contains_any(place, wrong_places)
        if not (keys in unread or is_misspelt or is_short_of_wrong_entries):
            yield Mistake(_sentence(each, schema, source), (source.place(keys),))


def location(error: Any) -> Keys:
    """The place of an error in pydantic's terms. A SettingError also names the key of the section."""
    cause = error.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return (*error["loc"], *cause.keys)
    place: Keys = error["loc"]
    return place


def _contains_any(place: Keys, others: Collection[Keys]) -> bool:
    """Whether one of the other places is inside this one."""
    return any(place == other[: len(place)] != other for other in others)


def _nearest_key(error: Any, schema: Schema) -> str | None:
    """The known key that an unknown one resembles most."""
    unknown_key = str(error["loc"][-1])
    nearest = get_close_matches(unknown_key, _known_keys(error["loc"], schema), n=1)
    return nearest[0] if nearest else None


def _known_keys(place: Keys, schema: Schema) -> list[str]:
    """The keys of the section that a place is in."""
    _, section = _walk(schema, place[:-1])
    return sorted(section.get("properties", {}))


def _sentence(error: Any, schema: Schema, source: YamlFile) -> str:
    if error["type"] == UNKNOWN_KEY:
        return _about_unknown_key(error, schema, source)
    context = error.get("ctx", {})
    if isinstance(context.get("error"), SettingError):  # names the value itself
        return str(context["error"].sentence)
    template = COMPLAINTS.get(error["type"])
    if template is None:
        return complaint(error["msg"], error["input"], {})
    return complaint(template, error["input"], context)


def _about_unknown_key(error: Any, schema: Schema, source: YamlFile) -> str:
    elsewhere = _about_other_kinds(error["loc"], schema, source)
    if elsewhere:
        return elsewhere
    nearest = _nearest_key(error, schema)
    guess = f" Did you mean {nearest!r}?" if nearest else ""
    return f"unknown key.{guess} Known: {', '.join(_known_keys(error['loc'], schema))}"


def _about_other_kinds(place: Keys, schema: Schema, source: YamlFile) -> str:
    """The sentence about an unknown key that other kinds of the section have.

    Empty if no kind has it, or if only its unit is missing.
    """
    if len(place) < 2:
        return ""
    *section_place, kind, key = place
    keys, section = _walk(schema, tuple(section_place))
    members: dict[str, str] = section.get("discriminator", {}).get("mapping", {})
    if str(kind) not in members:
        return ""
    owners = [name for name, reference in members.items() if key in _resolve(schema, reference)["properties"]]
    lacks_unit = any(name.startswith(f"{key}_") for name in _known_keys(place, schema))
    if not owners or lacks_unit:
        return ""
    is_kind_written = source.place((*keys, "kind")).value is not None
    this_kind = f"this is {kind}" if is_kind_written else f"without a kind this is {kind}"
    return f"belongs to {', '.join(owners)}; {this_kind}"


def _walk(schema: Schema, place: Keys) -> tuple[Keys, Schema]:
    """The keys in the file that lead to a place in pydantic's terms, and the part of the schema there.

    Pydantic's place also names the kind that was chosen among several, and ends in a part of its own if a key rather
    than its value is wrong.
    """
    keys = list[int | str]()
    part = _unwrapped(schema, schema)
    for key in place:
        if key == "[key]":
            continue
        kind_reference = part.get("discriminator", {}).get("mapping", {}).get(key)
        if kind_reference:
            part = _resolve(schema, kind_reference)
            continue
        keys.append(key)
        part = _unwrapped(schema, _entry_schema(part, key))
    return tuple(keys), part


def _entry_schema(part: Schema, key: int | str) -> Schema:
    """The schema of an entry of a section, a mapping or a list."""
    named: Schema | None = part.get("properties", {}).get(key)
    if named:
        return named
    by_pattern = part.get("patternProperties", {None: part.get("additionalProperties")})
    of_values: Schema | None = next(iter(by_pattern.values()))
    return of_values or part.get("items") or {}


def _unwrapped(schema: Schema, part: Schema) -> Schema:
    """A part without its alternatives: an optional section may also be null, a preset section also a name."""
    while "anyOf" in part or "$ref" in part:
        part = _resolve(schema, part["$ref"]) if "$ref" in part else part["anyOf"][0]
    return part


def _resolve(schema: Schema, reference: str) -> Schema:
    """The part of the schema that a reference, such as #/$defs/Suite, points to."""
    resolved: Schema = schema["$defs"][reference.rpartition("/")[2]]
    return resolved
