"""Reads YAML files into checked settings, and reports mistakes with file, line, key and value."""

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError
from ruamel.yaml.comments import CommentedMap, CommentedSeq

from vobench.errors import FilePlace, Mistake, SuiteError, VobenchError
from vobench.setting import MESSAGES, hints, unit_of
from vobench.suite import catalog, file_kind
from vobench.suite.display_path import display_path
from vobench.suite.file_kind import Kind
from vobench.suite.validation_message import pydantic_location, validation_mistakes
from vobench.suite.yaml_parser import parse_file, parse_text
from vobench.suite.yaml_source import Keys, YamlFile, line_of, plain_tree

Model = TypeVar("Model")
INCLUDE = "include"  # the key that refers to another file of the same kind
SET_OPTION = "--set"  # the option of `vobench run` that replaces values of a file


@dataclass(frozen=True, slots=True)
class FileReading(Generic[Model]):
    """The content of a file as settings, and the mistakes in it.

    If there are mistakes, `model` contains only the correct entries, is not checked as a whole, and lacks sections
    without a correct entry.
    """

    model: Model
    source: YamlFile
    mistakes: tuple[Mistake, ...] = ()


def read(path: Path, model: type[Model], kind: Kind | None = None) -> Model:
    """The content of a file as settings. Raises SuiteError with all mistakes, as in `read_all`."""
    reading = read_all(path, model, kind=kind)
    if reading.mistakes:
        raise SuiteError(*reading.mistakes)
    return reading.model


def read_all(
    path: Path,
    model: type[Model],
    changes: Mapping[str, str] = MappingProxyType({}),
    kind: Kind | None = None,
) -> FileReading[Model]:
    """The content of a file as far as it is correct, and all mistakes in it.

    `changes` are YAML values that replace values of the file; the keys of nested values are joined by dots.
    If the settings have a field `include`, a file can include another file of the same `kind`, by default a suite.
    Raises SuiteError if the file is not YAML, or is evidently of another kind.
    """
    if kind:
        _refuse(path, file_kind.model_sentence(kind, path))
    has_include = INCLUDE in hints(model)
    source, duplicates = _read_with_included(path, kind or "suite", ()) if has_include else _read_mapping(path)
    if kind:
        _refuse(path, file_kind.wrong_kind_sentence(kind, path, [*source.plain]))
    if changes:
        source = _changed(source, changes)
    return _checked_reading(model, source, duplicates)


def _refuse(path: Path, sentence: str | None) -> None:
    if sentence:
        raise SuiteError(Mistake(sentence, (FilePlace(display_path(path)),)))


def _read_mapping(path: Path) -> tuple[YamlFile, list[Mistake]]:
    """The content of a file, and its duplicate keys. Raises SuiteError if it is not a mapping."""
    parsed = parse_file(path)
    source = YamlFile(path, parsed.tree)
    if not isinstance(parsed.tree, dict):
        kind = _describe_content(parsed.tree)
        raise SuiteError(Mistake(f"should be keys with values, but is {kind}", (source.place(()),)))
    return source, list(parsed.duplicates)


def _describe_content(tree: Any) -> str:
    if tree is None:
        return "empty"
    if isinstance(tree, list):
        return "a list"
    return f"the single value {tree!r}"


def _read_with_included(path: Path, kind: Kind, including: tuple[Path, ...]) -> tuple[YamlFile, list[Mistake]]:
    """The content of a file merged with the file that it includes, and the duplicate keys of both."""
    source, duplicates = _read_mapping(path)
    name = source.parsed.get(INCLUDE)
    if not isinstance(name, str):
        return source, duplicates
    resolved_path = path.resolve()
    try:
        included_path = catalog.find(kind, name, suite=resolved_path).path
        if included_path in (resolved_path, *including):
            raise SuiteError(f"a {kind} cannot include itself: {included_path}")
        included, more_duplicates = _read_with_included(included_path, kind, (resolved_path, *including))
    except VobenchError as error:
        raise SuiteError(*source.located_mistakes(error, INCLUDE)) from None
    return replace(source, included=included), [*duplicates, *more_duplicates]


def _changed(source: YamlFile, changes: Mapping[str, str]) -> YamlFile:
    """The content of a file with other values. Raises SuiteError for an impossible key or value."""
    tree = _shallow_copy(source.parsed)
    for dotted_keys, value in changes.items():
        _set_value(tree, dotted_keys, value)
    return replace(source, parsed=tree)


def _shallow_copy(section: Any) -> Any:
    """A mapping or list of a file with the same values and line numbers; another one is not shared, so it is itself."""
    if isinstance(section, CommentedMap):
        return section.copy()
    if isinstance(section, CommentedSeq):
        copy = CommentedSeq(section)
        section.copy_attributes(copy)
        return copy
    return section


def _set_value(tree: Any, dotted_keys: str, value: str) -> None:
    """Replace the value at some keys by a YAML value. Missing sections are created.

    The sections on the way are copied before they change, because other readers of the file share them.
    """
    change = f"{SET_OPTION} {dotted_keys}={value}"
    keys = [int(key) if key.isdigit() else key for key in dotted_keys.split(".")]
    last_key = keys.pop()
    section = tree
    for key in keys:
        subsection = _subsection(section, key)
        if not isinstance(subsection, dict | list):
            raise SuiteError(f"{change}: there are no keys below {key!r}")
        section[key] = _shallow_copy(subsection)
        section = section[key]
    if isinstance(section, list):
        has_entry = isinstance(last_key, int) and last_key < len(section)
        if not has_entry:
            raise SuiteError(f"{change}: a list of {len(section)} has no entry {last_key!r}")
    try:
        section[last_key] = plain_tree(parse_text(Path(SET_OPTION), value).tree)
    except SuiteError:
        raise SuiteError(f"{change}: should be a value in YAML, such as 3, true or [1, 2]") from None


def _subsection(tree: Any, key: int | str) -> Any:
    """The value at a key. If it is missing, a new section is added to a mapping; for a list, it is None."""
    if isinstance(tree, dict) and isinstance(key, str):
        return tree.setdefault(key, CommentedMap())
    if isinstance(tree, list) and isinstance(key, int) and key < len(tree):
        return tree[key]
    return None


def _checked_reading(model: type[Model], source: YamlFile, mistakes: list[Mistake]) -> FileReading[Model]:
    """The content of a file as settings, as far as it is correct."""
    unread = dict[Keys, str]()
    for file in source.files:
        unread.update(_not_in_json(file.parsed, ()))
    all_mistakes = list(mistakes)
    all_mistakes += [Mistake(sentence, (source.place(keys),)) for keys, sentence in unread.items()]

    data = source.plain
    wrong_places = [*unread]
    try:
        whole = checked(model, data)
        if not all_mistakes:
            return FileReading(whole, source)
    except ValidationError as error:
        wrong_places += [pydantic_location(each) for each in error.errors()]
        all_mistakes += validation_mistakes(source, error, json_schema(model), unread)

    sections, remaining = _intact_sections(model, data, wrong_places)
    partial = _partial_model(model, sections)
    return FileReading(partial, replace(source, remaining=remaining), tuple(sorted(all_mistakes, key=line_of)))


def _not_in_json(tree: Any, keys: Keys) -> Iterator[tuple[Keys, str]]:
    """The places of values that JSON cannot represent, and what would be right there."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if isinstance(key, str):
                yield from _not_in_json(value, (*keys, key))
            else:
                yield (*keys, key), f"a key should be text (put it in quotes; got {key!r})"
    elif isinstance(tree, list):
        for index, value in enumerate(tree):
            yield from _not_in_json(value, (*keys, index))
    elif isinstance(tree, float) and not math.isfinite(tree):
        yield keys, f"{MESSAGES['finite_number']} (got {tree})"
    elif not (tree is None or isinstance(tree, str | bool | int | float)):
        yield keys, f"should be a number, text, a list or keys with values (got {tree})"


def _intact_sections(
    model: type, data: Mapping[str, Any], wrong_places: list[Keys]
) -> tuple[dict[str, Any], dict[str, tuple[int, ...]]]:
    """The sections of a file without wrong entries, and for each list, the indices of the entries that remain."""
    sections = dict[str, Any]()
    remaining = dict[str, tuple[int, ...]]()
    known = hints(model)
    for key in data.keys() & known.keys():
        value = data[key]
        wrong_entries = _wrong_entries(key, wrong_places)
        if isinstance(value, dict):
            value = {name: entry for name, entry in value.items() if name not in wrong_entries}
        elif isinstance(value, list):
            remaining[key] = tuple(index for index in range(len(value)) if index not in wrong_entries)
            value = [value[index] for index in remaining[key]]
        with suppress(ValidationError):  # its mistakes have been recorded already
            sections[key] = TypeAdapter(known[key]).validate_json(json.dumps(value), strict=True)
    return sections, remaining


def _wrong_entries(section: str, wrong_places: list[Keys]) -> list[int | str]:
    """The keys or indices of the entries of a section that are wrong, or in which something is wrong."""
    return [place[1] for place in wrong_places if len(place) > 1 and place[0] == section]


def _partial_model(model: type[Model], sections: Mapping[str, Any]) -> Model:
    """An unchecked object with the given fields, and defaults for the others. Missing required fields are not set."""
    partial = object.__new__(model)
    for each in fields(model):  # type: ignore[arg-type]
        default = each.default if each.default_factory is MISSING else each.default_factory()
        if each.name in sections or default is not MISSING:
            object.__setattr__(partial, each.name, sections.get(each.name, default))
    return partial


_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)


def checked(kind: type[Model], data: Any) -> Model:
    """Plain data as settings. Raises pydantic's ValidationError with all mistakes.

    The types are strict: lists become tuples and sections become objects, but a text is not accepted as a number, and
    a number is not accepted as true or false.
    """
    settings: Model = _adapter(kind).validate_json(json.dumps(data), strict=True)
    return settings


def checked_section(kind: type[Model], data: Any, at: FilePlace) -> Model:
    """Data that was derived from a place in a file, as settings. Raises SuiteError with all mistakes."""
    try:
        return checked(kind, data)
    except ValidationError as error:
        source = YamlFile(Path(at.file), data)
        section_mistakes = list(validation_mistakes(source, error, json_schema(kind)))
    mistakes = list[Mistake]()
    for mistake in section_mistakes:
        inner = mistake.places[0]
        place = replace(at, key=f"{at.key}.{inner.key}", value=inner.value)
        mistakes.append(replace(mistake, places=(place,)))
    raise SuiteError(*mistakes)


def plain(settings: Any, *, exclude: Any = None) -> Any:
    """Settings as plain JSON values, without those to exclude. `checked` reads them again."""
    return _adapter(type(settings)).dump_python(settings, mode="json", exclude=exclude)


def json_schema(kind: Any) -> dict[str, Any]:
    """The JSON Schema of settings, with the unit of each key that has one."""
    schema = _adapter(kind).json_schema()
    for section in [schema, *schema.get("$defs", {}).values()]:
        for key, part in section.get("properties", {}).items():
            part.pop("title", None)
            unit = unit_of(key)
            if unit:
                part["unit"] = unit
    return schema
