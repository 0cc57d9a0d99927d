"""Turns pydantic's validation errors into sentences for the authors of YAML files."""

from collections.abc import Collection, Iterator
from difflib import get_close_matches
from typing import Any

from pydantic import ValidationError

from vobench.errors import Mistake, SettingError
from vobench.setting import COMPLAINTS, complaint
from vobench.suite.yaml_source import Keys, YamlFile

Schema = dict[str, Any]  # a JSON Schema or a section of one
UNKNOWN_KEY = "unexpected_keyword_argument"  # pydantic's type of the error


def complaints(
    source: YamlFile, error: ValidationError, schema: Schema, unread: Collection[Keys] = ()
) -> Iterator[Mistake]:
    """The mistakes in a file that caused a validation error, with unknown keys first.

    An error that only follows from another mistake is omitted: a required key that is missing because it is misspelt,
    and a list that is too short because some of its entries are wrong.
    `unread` lists the places of values that could not be read. Errors at these places are omitted, because the mistakes
    have already been reported.
    """
    errors = sorted(error.errors(), key=lambda entry: entry["type"] != UNKNOWN_KEY)
    wrong_places = [*unread, *map(location, errors)]
    misspelt_places = _misspelt_places(errors, schema)

    for each in errors:
        place = location(each)
        keys, _ = _walk(schema, place)
        if keys in unread:
            continue
        is_key_misspelt = each["type"] == "missing" and place in misspelt_places
        if is_key_misspelt:
            continue
        is_list_with_wrong_entries = each["type"] == "too_short" and _contains_any(place, wrong_places)
        if is_list_with_wrong_entries:
            continue
        yield Mistake(_sentence(each, schema, source), (source.place(keys),))


def _misspelt_places(errors: Collection[Any], schema: Schema) -> set[tuple[Any, ...]]:
    """The place of the known key that each unknown key probably stands for."""
    places = set[tuple[Any, ...]]()
    for each in errors:
        if each["type"] == UNKNOWN_KEY:
            section_place = each["loc"][:-1]
            places.add((*section_place, _nearest_key(each, schema)))
    return places


def location(error: Any) -> Keys:
    """The place of one of pydantic's errors. If a SettingError caused it, the keys that it names are appended."""
    cause = error.get("ctx", {}).get("error")
    if isinstance(cause, SettingError):
        return (*error["loc"], *cause.keys)
    place: Keys = error["loc"]
    return place


def _contains_any(place: Keys, others: Collection[Keys]) -> bool:
    """Whether one of the other places is inside the section at this place."""
    return any(len(other) > len(place) and other[: len(place)] == place for other in others)


def _nearest_key(error: Any, schema: Schema) -> str | None:
    """The known key that is most similar to an unknown key; None if no key is similar."""
    unknown_key = str(error["loc"][-1])
    nearest = get_close_matches(unknown_key, _known_keys(error["loc"], schema), n=1)
    return nearest[0] if nearest else None


def _known_keys(place: Keys, schema: Schema) -> list[str]:
    """The keys that are allowed in the section that contains a place, sorted."""
    _, section = _walk(schema, place[:-1])
    return sorted(section.get("properties", {}))


def _sentence(error: Any, schema: Schema, source: YamlFile) -> str:
    """The sentence about one of pydantic's errors."""
    if error["type"] == UNKNOWN_KEY:
        return _about_unknown_key(error, schema, source)
    context = error.get("ctx", {})
    cause = context.get("error")
    if isinstance(cause, SettingError):  # its sentence already contains the wrong value
        return cause.sentence
    template = COMPLAINTS.get(error["type"])
    if template is None:
        return complaint(error["msg"], error["input"], {})
    return complaint(template, error["input"], context)


def _about_unknown_key(error: Any, schema: Schema, source: YamlFile) -> str:
    """The sentence about an unknown key, with the most similar known key and a list of all known keys."""
    sentence_on_kinds = _about_other_kinds(error["loc"], schema, source)
    if sentence_on_kinds:
        return sentence_on_kinds
    nearest = _nearest_key(error, schema)
    guess = f" Did you mean {nearest!r}?" if nearest else ""
    return f"unknown key.{guess} Known: {', '.join(_known_keys(error['loc'], schema))}"


def _about_other_kinds(place: Keys, schema: Schema, source: YamlFile) -> str:
    """The sentence about a key that this kind of section does not have, but other kinds of it have.

    For example, a lamp of the kind `point` has no `size_m`, but a `panel` has.
    Empty if no kind has the key, or if only the unit is missing in the key, as in `power` for `power_lm`.
    """
    if len(place) < 2:
        return ""
    *section_place, kind, key = place
    section_keys, section = _walk(schema, tuple(section_place))
    references_by_kind = _references_by_kind(section)
    if str(kind) not in references_by_kind:
        return ""

    kinds_with_key = []
    for name, reference in references_by_kind.items():
        if key in _resolve(schema, reference)["properties"]:
            kinds_with_key.append(name)
    lacks_unit = any(name.startswith(f"{key}_") for name in _known_keys(place, schema))
    if not kinds_with_key or lacks_unit:
        return ""

    is_kind_written = source.place((*section_keys, "kind")).value is not None
    this_kind = f"this is {kind}" if is_kind_written else f"without a kind this is {kind}"
    return f"belongs to {', '.join(kinds_with_key)}; {this_kind}"


def _references_by_kind(section: Schema) -> dict[str, str]:
    """The reference to the schema of each kind of a section; empty if the section has no kinds."""
    references: dict[str, str] = section.get("discriminator", {}).get("mapping", {})
    return references


def _walk(schema: Schema, place: Keys) -> tuple[Keys, Schema]:
    """The path of keys in the file that corresponds to one of pydantic's places, and the schema at that place.

    A place can contain two parts that are not keys of the file: the kind of a section, and "[key]", which says that a
    key is wrong instead of its value.
    """
    keys = list[int | str]()
    section = _without_alternatives(schema, schema)
    for part in place:
        if part == "[key]":
            continue
        kind_reference = _references_by_kind(section).get(str(part))
        if kind_reference:
            section = _resolve(schema, kind_reference)
            continue
        keys.append(part)
        section = _without_alternatives(schema, _entry_schema(section, part))
    return tuple(keys), section


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
    """The first alternative of a section, which is its full form; the others are null or the name of a preset."""
    while "anyOf" in section or "$ref" in section:
        section = _resolve(schema, section["$ref"]) if "$ref" in section else section["anyOf"][0]
    return section


def _resolve(schema: Schema, reference: str) -> Schema:
    """The definition that a reference such as #/$defs/Suite points to."""
    resolved: Schema = schema["$defs"][reference.rpartition("/")[2]]
    return resolved
