"""Settings: frozen dataclasses whose fields define the name with its unit, the default and the bounds of each once.

A class of settings checks its values whoever creates an object:

    @settings()
    class Shutter:
        readout_ms: Annotated[float, Ge(0), Le(1000)] = 0.0

YAML files are read into such classes, and JSON Schemas and the tables of the docs are generated from them: see `suite`.
"""

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict, dataclass, field, fields
from functools import cache
from math import isclose, isfinite
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, dataclass_transform, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen

from vobench.errors import SettingError, unknown_name_sentence

# Messages about wrong values for those who write YAML, by pydantic's type of the error; {} are filled in.
MESSAGES = {
    "missing": "this key is missing",
    "string_type": "should be text (a number or a date needs quotes)",
    "int_type": "should be a whole number",
    "int_from_float": "should be a whole number",
    "float_type": "should be a number",
    "bool_type": "should be true or false",
    "finite_number": "should be a finite number",
    "tuple_type": "should be a list, as in [a, b]",
    **dict.fromkeys(
        ("dict_type", "model_attributes_type", "dataclass_type", "dataclass_exact_type"), "should be keys with values"
    ),
    "too_short": "should have {min_length} or more entries, but has {actual_length}",
    "too_long": "should have {max_length} or fewer entries, but has {actual_length}",
    "string_too_short": "should not be empty",
    "literal_error": "should be {expected}",
    "greater_than": "should be greater than {gt}",
    "greater_than_equal": "should be {ge} or more",
    "less_than": "should be less than {lt}",
    "less_than_equal": "should be {le} or less",
}
# The unit of a value, by the suffix of its name.
UNITS = {
    **{unit: unit for unit in ("m", "s", "ms", "ns", "rad", "deg", "px", "kg", "V", "lm", "lx")},
    "hz": "Hz",
    "mib": "MiB",
    "db": "dB",
    "ev": "EV",
    "e": "electrons",
    "dn": "grey values",
    "e_per_s": "electrons/s",
    "cd_m2": "cd/m²",
    "mps": "m/s",
    "mps2": "m/s²",
    "radps": "rad/s",
    "radps2": "rad/s²",
}

T = TypeVar("T")


def unit_of(name: str) -> str:
    """The unit that a setting's name ends in; empty if it has none."""
    parts = name.split("_")
    for first in range(1, len(parts)):
        suffix = "_".join(parts[first:])
        if suffix in UNITS:
            return UNITS[suffix]
    return ""


WHOLE_TOLERANCE = 1e-9  # relative: far more than rounding errors, far less than anybody writes


def nearest_whole(value: float) -> int | None:
    """The whole number that a value equals up to rounding errors, such as 252 for 0.35 × 720; None if there is none."""
    nearest = round(value)
    return nearest if isclose(value, nearest, rel_tol=WHOLE_TOLERANCE) else None


def tupled(value: Any) -> Any:
    """The value with lists as tuples at every level."""
    if isinstance(value, dict):
        return {key: tupled(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return tuple(tupled(part) for part in value)
    return value


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def settings(*, kw_only: bool = True) -> Callable[[type[T]], type[T]]:
    """A frozen dataclass whose fields are checked against their annotations, then by its own `__post_init__`."""

    def decorate(cls: type[T]) -> type[T]:
        own_check = getattr(cls, "__post_init__", None)

        def check_fields(self: T) -> None:
            require(self)
            if own_check:
                own_check(self)

        # For pydantic, unknown keys, NaN and infinity are errors.
        own_config = vars(cls).get("__pydantic_config__", {})
        config = {"extra": "forbid", "allow_inf_nan": False, **own_config}
        setattr(cls, "__post_init__", check_fields)  # noqa: B010 - mypy refuses a method of another signature
        setattr(cls, "__pydantic_config__", config)  # noqa: B010
        return dataclass(frozen=True, slots=True, kw_only=kw_only)(cls)

    return decorate


# Marks in annotations. Their two dunder methods tell pydantic how to read and describe a value.


@dataclass(frozen=True, slots=True, eq=False)
class ValueCheck:
    """A value that `check` accepts, which raises SettingError otherwise; `schema` describes it in a JSON Schema.

    With `first`, the value is checked before its type is, as it was written, with lists as tuples.
    """

    check: Callable[[Any], object]
    schema: Mapping[str, Any] = field(default_factory=dict)
    first: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        if self.first:
            return _before(lambda value: self._passed(tupled(value)), handler(source))
        from pydantic_core import core_schema

        return core_schema.no_info_after_validator_function(self._passed, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Callable[[Any], Any]) -> dict[str, Any]:
        return {**handler(schema), **self.schema}

    def _passed(self, value: Any) -> Any:
        self.check(value)
        return value


def OneOf(what: str, known: Collection[str]) -> ValueCheck:
    """Text that is one of the known names, which are names of a `what`; for other text the nearest is suggested."""

    def check(name: str) -> None:
        if name not in known:
            raise SettingError(unknown_name_sentence(what, name, list(known)))

    return ValueCheck(check, {"enum": sorted(known)})


def Matching(pattern: str, words: str) -> ValueCheck:
    """Text that matches a pattern as a whole; `words` describe the pattern."""

    def check(text: str) -> None:
        if not re.fullmatch(pattern, text):
            raise SettingError(f"should be {words} (got {text!r})")

    return ValueCheck(check, {"pattern": f"^{pattern}$"})


@dataclass(frozen=True, slots=True, eq=False)
class ShortForm:
    """A value with a short form, which `expand` turns into the full form; `schema` describes the short form."""

    expand: Callable[[Any], Any]
    schema: Mapping[str, Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        return _before(lambda value: tupled(self.expand(value)), handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Callable[[Any], Any]) -> dict[str, Any]:
        return {"anyOf": [handler(schema), dict(self.schema)]}


@dataclass(frozen=True, slots=True, eq=False)
class FromPreset:
    """A section that may start from a preset: `like: name` and the keys that differ; a bare name is the preset itself.

    `key` replaces `like`. `section` is the key of the part that the presets describe, if they do not describe all.
    """

    what: str
    presets: Mapping[str, Any]
    key: str = "like"
    section: str = ""

    def merged(self, value: Any) -> Any:
        """The section with the preset's values for keys that it lacks. Raises SettingError."""
        written = {self.key: value} if isinstance(value, str) else tupled(value)
        if not isinstance(written, dict) or self.key not in written:
            return written
        name = written.pop(self.key)
        if name not in self.presets:
            is_bare_name = value == name
            keys = [] if is_bare_name else [self.key]
            raise SettingError(unknown_name_sentence(self.what, str(name), list(self.presets)), *keys)
        preset = asdict(self.presets[name])
        return merged_over({self.section: preset} if self.section else preset, written)

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        return _before(self.merged, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        section = handler.resolve_ref_schema(handler(schema))
        bare_name = {"type": "string", "enum": sorted(self.presets)}
        properties = {self.key: {**bare_name, "default": None}, **section["properties"]}
        return {"anyOf": [{**section, "properties": properties}, bare_name]}


@dataclass(frozen=True, slots=True, eq=False)
class ByKind:
    """A union of classes of settings, distinguished by the literal of their field `kind`: a kind of a `what`.

    A section without a kind is of the `default` kind, if there is one.
    """

    what: str
    default: str | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        from pydantic_core import core_schema

        members = dict[str, Any]()
        for member in get_args(source):
            (kind_name,) = get_args(hints(member)["kind"])
            members[kind_name] = handler(member)

        def with_kind(value: Any) -> Any:
            if not isinstance(value, dict):
                return value
            kind = value.get("kind", self.default)
            if kind is None:
                raise SettingError(f"this key is missing; it is one of {', '.join(sorted(members))}", "kind")
            if not isinstance(kind, str) or kind not in members:
                raise SettingError(unknown_name_sentence(f"kind of {self.what}", str(kind), list(members)), "kind")
            return {**tupled(value), "kind": kind}

        union = core_schema.tagged_union_schema(members, discriminator="kind")
        return _before(with_kind, union)


def _before(change: Callable[[Any], Any], schema: Any) -> Any:
    from pydantic_core import core_schema

    return core_schema.no_info_before_validator_function(change, schema)


def merged_over(preset: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """The preset with the given values in place of its own: sections are merged key by key, other values replaced."""
    merged = {**preset, **given}
    for key, value in given.items():
        if isinstance(value, dict) and isinstance(preset.get(key), dict):
            merged[key] = merged_over(preset[key], value)
    return merged


Positive = Annotated[float, Gt(0)]
# The largest number of points or legs of a path in settings: more would take minutes to drive.
MOST_POINTS = 10_000
NonNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1)]
Triple = tuple[float, float, float]
# Names become folders, and a case's name joins several with a hyphen.
Name = Annotated[str, Matching(r"[a-z0-9][a-z0-9_.]*", "lower-case letters, digits, _ and ., a letter or digit first")]


def _field_hints(settings_class: Any) -> dict[str, Any]:
    all_hints = get_type_hints(settings_class, include_extras=True)
    return {each.name: all_hints[each.name] for each in fields(settings_class)}


# The annotation of each field of a class of settings, marks included.
hints: Callable[[Any], dict[str, Any]] = cache(_field_hints)


def require(settings: Any) -> None:
    """Check an object's fields against their annotations: types, bounds and marks. For use in `__post_init__`.

    Whole numbers become floats in fields of that type, so that 5 and 5.0 are equal settings. Raises SettingError.
    """
    for name, hint in hints(type(settings)).items():
        object.__setattr__(settings, name, _checked_at(name, getattr(settings, name), hint))


def _checked_at(key: int | str, value: Any, hint: Any) -> Any:
    """The checked value; an error names the key."""
    try:
        return _checked(value, hint)
    except SettingError as error:
        raise SettingError(error.sentence, key, *error.keys) from None


def _unaliased(hint: Any) -> Any:
    """The type that an alias of a `type` statement stands for, such as NDArray from NumPy 2.5 on."""
    alias = get_origin(hint) or hint
    aliased = getattr(alias, "__value__", None)
    if aliased is None:
        return hint
    args = get_args(hint)
    return _unaliased(aliased[args] if args else aliased)


def _checked(value: Any, hint: Any) -> Any:
    """The value as an annotation requires it. Raises SettingError."""
    hint = _unaliased(hint)
    origin = get_origin(hint)
    args = get_args(hint)
    if origin is Annotated:
        return _checked_by_marks(value, args[0], args[1:])
    if origin in (Union, UnionType):
        return _checked_choice(value, args)
    if origin is Literal:
        return _checked_literal(value, args)
    if origin is tuple and isinstance(value, tuple | list):
        return _checked_entries(tuple(value), args)
    if origin is dict and isinstance(value, dict):
        key_hint, value_hint = args
        return {_checked(key, key_hint): _checked_at(key, entry, value_hint) for key, entry in value.items()}
    return _checked_plain(value, origin or hint)


def _checked_by_marks(value: Any, hint: Any, marks: tuple[Any, ...]) -> Any:
    """The value of an annotated type."""
    for mark in marks:
        if isinstance(mark, ValueCheck) and mark.first:
            mark.check(value)
    checked = _checked(value, hint)
    for mark in marks:
        _require_mark(mark, checked)
    return checked


def _checked_choice(value: Any, choices: tuple[Any, ...]) -> Any:
    """The value of a union: of the first type that fits, or else of the first type."""
    if value is None and NoneType in choices:
        return value
    types = [choice for choice in choices if choice is not NoneType]
    for choice in types:
        if _is_type(value, choice):
            return _checked(value, choice)
    return _checked(value, types[0])


def _checked_literal(value: Any, literals: tuple[Any, ...]) -> Any:
    if value in literals:
        return value
    *others, last = map(repr, literals)
    raise _error("literal_error", value, expected=f"{', '.join(others)} or {last}")


def _checked_entries(entries: tuple[Any, ...], entry_hints: tuple[Any, ...]) -> tuple[Any, ...]:
    """The entries of a tuple, of any length if its annotation ends in `...`."""
    if entry_hints[1:] == (...,):
        entry_hints = entry_hints[:1] * len(entries)
    if len(entries) < len(entry_hints):
        raise SettingError(MESSAGES["missing"], len(entries))
    if len(entries) > len(entry_hints):
        raise _error("too_long", entries, max_length=len(entry_hints), actual_length=len(entries))
    checked = list[Any]()
    for index, (entry, hint) in enumerate(zip(entries, entry_hints, strict=True)):
        checked.append(_checked_at(index, entry, hint))
    return tuple(checked)


# Pydantic's type of the error for a value that is not of a type, and the classes of values that are.
TYPES: dict[Any, tuple[str, Any]] = {
    float: ("float_type", Real),
    int: ("int_type", Integral),
    str: ("string_type", str),
    bool: ("bool_type", bool),
    tuple: ("tuple_type", (tuple, list)),
    dict: ("dict_type", dict),
}


def _checked_plain(value: Any, kind: Any) -> Any:
    """The value of a type without arguments."""
    if kind is Any:
        return value
    if not _is_type(value, kind):
        error_type, _ = TYPES.get(kind, ("dataclass_type", kind))
        raise _error(error_type, value)
    if kind is float and not isfinite(value):
        raise _error("finite_number", value)
    return kind(value) if kind in (float, int) else value


def _is_type(value: Any, hint: Any) -> bool:
    hint = _unaliased(hint)
    kind = get_origin(hint) or hint
    if kind is Annotated:
        return _is_type(value, get_args(hint)[0])
    if kind is Literal:
        return value in get_args(hint)
    _, classes = TYPES.get(kind, ("", kind))
    is_truth_value = isinstance(value, bool)  # which Python counts as a whole number
    return isinstance(value, classes) and (kind is bool or not is_truth_value)


def _require_mark(mark: Any, value: Any) -> None:
    """Raise SettingError if a value is not within a bound, or a check fails."""
    match mark:
        case Gt(bound) if not value > bound:
            raise _error("greater_than", value, gt=bound)
        case Ge(bound) if not value >= bound:
            raise _error("greater_than_equal", value, ge=bound)
        case Lt(bound) if not value < bound:
            raise _error("less_than", value, lt=bound)
        case Le(bound) if not value <= bound:
            raise _error("less_than_equal", value, le=bound)
        case MinLen(bound) if len(value) < bound:
            error_type = "string_too_short" if isinstance(value, str) else "too_short"
            raise _error(error_type, value, min_length=bound, actual_length=len(value))
        case MaxLen(bound) if len(value) > bound:
            raise _error("too_long", value, max_length=bound, actual_length=len(value))
        case ValueCheck(first=False):
            mark.check(value)


def _error(error_type: str, value: Any, **context: Any) -> SettingError:
    return SettingError(wrong_value_message(MESSAGES[error_type], value, context))


def wrong_value_message(template: str, value: Any, context: Mapping[str, Any]) -> str:
    """The message of a template, with the value unless that is a whole section."""
    requirement = template.format(**{key: _format_number(each) for key, each in context.items()})
    return with_wrong_value(requirement, value)


def with_wrong_value(requirement: str, value: Any) -> str:
    """The message that says what would be right, with the value unless that is a whole section."""
    if isinstance(value, dict | list | tuple):
        return requirement
    return f"{requirement} (got {_format_value(value)})"


def _format_number(value: Any) -> Any:
    return f"{value:g}" if isinstance(value, float) else value


def _format_value(value: Any) -> str:
    """A value as YAML has it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value)
