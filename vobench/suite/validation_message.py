"""Turns pydantic's validation errors into messages for the authors of YAML files.

Pydantic says where an error is by a location, `loc`. It has more parts than the path of keys in the file, `key_path`:

    loc       ("lamps", 0, "point", "size_m")     the key size_m of the first lamp, which is of the kind `point`
    key_path  ("lamps", 0, "size_m")              its keys in the file, from which the file finds the line

`_schema_place` turns one into the other. It follows the schema, which distinguishes keys from kinds of sections.
"""

from collections.abc import Collection, Iterator
from difflib import get_close_matches
from typing import Any, NamedTuple

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vobench.errors import Mistake, SettingError
from vobench.setting import MESSAGES, with_wrong_value, wrong_value_message
from vobench.suite.yaml_source import Keys, YamlFile

Schema = dict[str, Any]  # a JSON Schema or a section of one
PydanticLocation = tuple[int | str, ...]
UNKNOWN_KEY = "unexpected_keyword_argument"  # pydantic's type of the error


def validation_mistakes(
    source: YamlFile, error: ValidationError, schema: Schema, unread: Collection[Keys] = ()
) -> Iterator[Mistake]:
    """The mistakes in a file that caused a validation error, with unknown keys first.

    An error that only follows from another mistake is omitted: a required key that is missing because it is misspelt,
    and a list that is too short because some of its entries are wrong.
    `unread` lists the key paths of values that could not be read. Errors there are omitted, because the mistakes have
    already been reported.
    """
    errors = sorted(error.errors(), key=lambda details: details["type"] != UNKNOWN_KEY)
    wrong_locs = [*unread, *map(pydantic_location, errors)]
    misspelt_locs = _misspelt_locs(errors, schema)

    for details in errors:
        loc = pydantic_location(details)
        key_path = _schema_place(schema, loc).key_path
        if key_path in unread:
            continue
        is_key_misspelt = details["type"] == "missing" and loc in misspelt_locs
        if is_key_misspelt:
            continue
        is_list_with_wrong_entries = details["type"] == "too_short" and _contains_any(loc, wrong_locs)
        if is_list_with_wrong_entries:
            continue
        yield Mistake(_message(details, schema, source), (source.place(key_path),))


def pydantic_location(details: ErrorDetails) -> PydanticLocation:
    """Pydantic's location of an error. If a SettingError caused it, the keys that it names are appended."""
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return (*details["loc"], *cause.keys)
    return details["loc"]


def _misspelt_locs(errors: Collection[ErrorDetails], schema: Schema) -> set[PydanticLocation]:
    """The location of the known key that each unknown key probably stands for."""
    locs: set[PydanticLocation] = set()
    for details in errors:
        if details["type"] != UNKNOWN_KEY:
            continue
        *section_loc, unknown_key = pydantic_location(details)
        nearest_key = _nearest_key(str(unknown_key), _known_keys(details, schema))
        if nearest_key:
            locs.add((*section_loc, nearest_key))
    return locs


def _contains_any(loc: PydanticLocation, others: Collection[PydanticLocation]) -> bool:
    """Whether one of the other locations is inside the section at this location."""
    return any(len(other) > len(loc) and other[: len(loc)] == loc for other in others)


def _nearest_key(unknown_key: str, known_keys: Collection[str]) -> str | None:
    """The known key that is most similar to an unknown key; None if no key is similar."""
    nearest = get_close_matches(unknown_key, known_keys, n=1)
    return nearest[0] if nearest else None


def _known_keys(details: ErrorDetails, schema: Schema) -> list[str]:
    """The keys that are allowed in the section that contains an unknown key, sorted."""
    section_loc = pydantic_location(details)[:-1]
    return sorted(_schema_place(schema, section_loc).schema.get("properties", {}))


def _message(details: ErrorDetails, schema: Schema, source: YamlFile) -> str:
    """The message about one of pydantic's errors."""
    if details["type"] == UNKNOWN_KEY:
        return _unknown_key_message(details, schema, source)
    context = details.get("ctx", {})
    cause = context.get("error")
    if isinstance(cause, SettingError):  # its sentence already contains the wrong value
        return cause.sentence
    template = MESSAGES.get(details["type"])
    if template is None:
        return with_wrong_value(details["msg"], details["input"])
    return wrong_value_message(template, details["input"], context)


def _unknown_key_message(details: ErrorDetails, schema: Schema, source: YamlFile) -> str:
    """The message about an unknown key, with the most similar known key and a list of all known keys."""
    other_kinds_message = _other_kinds_message(details, schema, source)
    if other_kinds_message is not None:
        return other_kinds_message
    known_keys = _known_keys(details, schema)
    nearest_key = _nearest_key(str(pydantic_location(details)[-1]), known_keys)
    guess = f" Did you mean {nearest_key!r}?" if nearest_key else ""
    return f"unknown key.{guess} Known: {', '.join(known_keys)}"


def _other_kinds_message(details: ErrorDetails, schema: Schema, source: YamlFile) -> str | None:
    """The message about a key that this kind of section does not have, but other kinds of it have.

    For example, a lamp of the kind `point` has no `size_m`, but a `panel` has. None if the key belongs to no kind, or
    if it probably lacks a unit, as `power` does, which stands for `power_lm`.
    """
    loc = pydantic_location(details)
    if len(loc) < 2 or _probably_lacks_unit(details, schema):
        return None
    *section_loc, kind, key = loc
    section = _schema_place(schema, tuple(section_loc))
    is_section_of_kinds = str(kind) in _references_by_kind(section.schema)
    if not is_section_of_kinds:
        return None
    kinds_with_key = _kinds_with_key(schema, section.schema, key)
    if not kinds_with_key:
        return None

    is_kind_written = source.place((*section.key_path, "kind")).value is not None
    this_kind = f"this is {kind}" if is_kind_written else f"the kind is {kind} by default"
    return f"belongs to {', '.join(kinds_with_key)}; {this_kind}"


def _probably_lacks_unit(details: ErrorDetails, schema: Schema) -> bool:
    """Whether an unknown key is the beginning of a known key, as `power` is of `power_lm`."""
    unknown_key = pydantic_location(details)[-1]
    return any(known_key.startswith(f"{unknown_key}_") for known_key in _known_keys(details, schema))


def _kinds_with_key(schema: Schema, section: Schema, key: int | str) -> list[str]:
    """The kinds of a section that have a key."""
    kinds = []
    for kind, reference in _references_by_kind(section).items():
        if key in _resolve(schema, reference)["properties"]:
            kinds.append(kind)
    return kinds


def _references_by_kind(section: Schema) -> dict[str, str]:
    """The reference to the schema of each kind of a section; empty if the section has no kinds."""
    references: dict[str, str] = section.get("discriminator", {}).get("mapping", {})
    return references


class _SchemaPlace(NamedTuple):
    """The keys of the file that lead to a place, and the schema of what is there."""

    key_path: Keys
    schema: Schema


def _schema_place(schema: Schema, loc: PydanticLocation) -> _SchemaPlace:
    """The place in the file that one of pydantic's locations stands for.

    Two kinds of parts of a location are not keys of the file: the kind of a section, and "[key]", which says that a key
    is wrong instead of its value. They are left out of the path of keys.
    """
    key_path: Keys = ()
    section = _without_alternatives(schema, section=schema)
    for part in loc:
        if part == "[key]":
            continue
        kind_reference = _references_by_kind(section).get(str(part))
        if kind_reference:
            section = _resolve(schema, kind_reference)
            continue
        key_path = (*key_path, part)
        section = _without_alternatives(schema, _entry_schema(section, part))
    return _SchemaPlace(key_path, section)


def _entry_schema(section: Schema, key: int | str) -> Schema:
    """The schema of one entry of a section, a mapping or a list; empty if it is unknown."""
    property_schema: Schema | None = section.get("properties", {}).get(key)
    return property_schema or _value_schema(section) or section.get("items") or {}


def _value_schema(section: Schema) -> Schema | None:
    """The schema of the values of a mapping; None if the section is not a mapping."""
    if "patternProperties" not in section:
        additional: Schema | None = section.get("additionalProperties")
        return additional
    schemas_by_pattern: dict[str, Schema] = section["patternProperties"]
    return next(iter(schemas_by_pattern.values()))


def _without_alternatives(schema: Schema, section: Schema) -> Schema:
    """The full form of a section: references are followed, and of alternatives, the first is used.

    The other alternatives are null or the name of a preset. References point into the definitions of `schema`.
    """
    while True:
        if "$ref" in section:
            section = _resolve(schema, section["$ref"])
        elif "anyOf" in section:
            section = section["anyOf"][0]
        else:
            return section


def _resolve(schema: Schema, reference: str) -> Schema:
    """The definition that a reference such as #/$defs/Suite points to."""
    resolved: Schema = schema["$defs"][reference.rpartition("/")[2]]
    return resolved
