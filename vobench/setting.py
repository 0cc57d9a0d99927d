"""Settings: frozen dataclasses whose fields state the name with its unit, the default and the bounds of each once.

A class of settings says what it takes, and holds it whoever builds one:

    @settings()
    class Shutter:
        readout_ms: Annotated[float, Ge(0), Le(1000)] = 0.0

YAML files are read into such classes, and JSON Schemas and the tables of the docs are made from them: see `suite`.
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

from vobench.errors import SettingError, unknown

# What may be wrong with a value, in the words of somebody who writes YAML, by pydantic's names; {} are filled in.
COMPLAINTS = {
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
# What a suffix of a name says of its value.
UNITS = {
    **{unit: unit for unit in ("m", "s", "ms", "ns", "rad", "deg", "px", "kg", "V", "lm", "lx")},
    "hz": "Hz",
    "mib": "MiB",
    "db": "dB",
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
    """The unit that a setting's name ends in; empty where it has none."""
    parts = name.split("_")
    return next((UNITS[end] for end in ("_".join(parts[n:]) for n in range(1, len(parts))) if end in UNITS), "")


WHOLE_WITHIN = 1e-9  # relative: far more than rounding does, far less than anybody writes


def nearest_whole(value: float) -> int | None:
    """The whole number that a value is but for rounding, as 0.35 × 720 is 252; None where it is none."""
    nearest = round(value)
    return nearest if isclose(value, nearest, rel_tol=WHOLE_WITHIN) else None


def tupled(value: Any) -> Any:
    """Lists as tuples, all the way down."""
    if isinstance(value, dict):
        return {key: tupled(part) for key, part in value.items()}
    return tuple(map(tupled, value)) if isinstance(value, list | tuple) else value


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def settings(*, kw_only: bool = True) -> Callable[[type[T]], type[T]]:
    """A frozen dataclass whose fields are held to their annotations, then to its own `__post_init__`."""

    def decorate(cls: type[T]) -> type[T]:
        further = getattr(cls, "__post_init__", None)

        def checked(self: T) -> None:
            require(self)
            if further:
                further(self)

        # How pydantic reads the class: unknown keys, NaN and infinity are errors.
        config = {"extra": "forbid", "allow_inf_nan": False, **vars(cls).get("__pydantic_config__", {})}
        for name, value in (("__post_init__", checked), ("__pydantic_config__", config)):
            setattr(cls, name, value)
        return dataclass(frozen=True, slots=True, kw_only=kw_only)(cls)

    return decorate


# Marks in annotations. Pydantic asks them how to read and describe a value; nobody else needs it.


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """A value that `check` raises no SettingError for; `schema` is what a JSON Schema can say of that.

    What is to be checked `first`, before its type is, is handed over as it was written, lists as tuples.
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


def OneOf(what: str, known: Collection[str]) -> Check:
    """Text that is one of the known names; a near one is suggested. `what` says what they are names of."""

    def check(name: str) -> None:
        if name not in known:
            raise SettingError(unknown(what, name, list(known)))

    return Check(check, {"enum": sorted(known)})


def Matching(pattern: str, words: str) -> Check:
    """Text that matches all of a pattern; `words` say what would be right."""

    def check(text: str) -> None:
        if not re.fullmatch(pattern, text):
            raise SettingError(f"should be {words} (got {text!r})")

    return Check(check, {"pattern": f"^{pattern}$"})


@dataclass(frozen=True, slots=True, eq=False)
class Short:
    """What is written in a shorter form, too, which `expand` makes the full one of; `schema` describes it."""

    expand: Callable[[Any], Any]
    schema: Mapping[str, Any]

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        return _before(lambda value: tupled(self.expand(value)), handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Callable[[Any], Any]) -> dict[str, Any]:
        return {"anyOf": [handler(schema), dict(self.schema)]}


@dataclass(frozen=True, slots=True, eq=False)
class Like:
    """A section may begin as a preset: `like: name` and what differs from it; a bare name is the preset as it is.

    `key` is another word for `like`, and `section` the part that presets are of, where it is not the whole.
    """

    what: str
    presets: Mapping[str, Any]
    key: str = "like"
    section: str = ""

    def merged(self, value: Any) -> Any:
        """The section with the values of its preset where it has none. Raises SettingError."""
        given = {self.key: value} if isinstance(value, str) else tupled(value)
        if not isinstance(given, dict) or self.key not in given:
            return given
        name = given.pop(self.key)
        if name not in self.presets:
            place = [] if value == name else [self.key]
            raise SettingError(unknown(self.what, str(name), list(self.presets)), *place)
        preset = asdict(self.presets[name])
        return over({self.section: preset} if self.section else preset, given)

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        return _before(self.merged, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        section = handler.resolve_ref_schema(handler(schema))
        name = {"type": "string", "enum": sorted(self.presets)}
        named = {self.key: {**name, "default": None}, **section["properties"]}
        return {"anyOf": [{**section, "properties": named}, name]}


@dataclass(frozen=True, slots=True, eq=False)
class ByKind:
    """A union of classes of settings, told apart by the literal of their field `kind`; `what` says kinds of what.

    Where a section has no kind, it is of the `default` one, if there is any.
    """

    what: str
    default: str | None = None

    def __get_pydantic_core_schema__(self, source: Any, handler: Callable[[Any], Any]) -> Any:
        from pydantic_core import core_schema

        members = {get_args(hints(member)["kind"])[0]: handler(member) for member in get_args(source)}

        def with_kind(value: Any) -> Any:
            if not isinstance(value, dict):
                return value
            kind = value.get("kind", self.default)
            if kind is None:
                raise SettingError(f"this key is missing; it is one of {', '.join(sorted(members))}", "kind")
            if not isinstance(kind, str) or kind not in members:
                raise SettingError(unknown(f"kind of {self.what}", str(kind), list(members)), "kind")
            return {**tupled(value), "kind": kind}

        told_apart = core_schema.tagged_union_schema(members, discriminator="kind")
        return _before(with_kind, told_apart)


def _before(change: Callable[[Any], Any], schema: Any) -> Any:
    from pydantic_core import core_schema

    return core_schema.no_info_before_validator_function(change, schema)


def over(preset: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """What is given, and the preset's values elsewhere: sections key by key, all else as a whole."""
    both = [key for key in given if isinstance(given[key], dict) and isinstance(preset.get(key), dict)]
    return {**preset, **given, **{key: over(preset[key], given[key]) for key in both}}


Positive = Annotated[float, Gt(0)]
NonNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1)]
Triple = tuple[float, float, float]
# Names become folders, and a case's name joins several with a hyphen.
Name = Annotated[str, Matching(r"[a-z0-9][a-z0-9_.]*", "lower-case letters, digits, _ and ., a letter or digit first")]


def _hints(settings: Any) -> dict[str, Any]:
    found = get_type_hints(settings, include_extras=True)
    return {each.name: found[each.name] for each in fields(settings)}


# The annotation of each field of a class of settings, marks included.
hints: Callable[[Any], dict[str, Any]] = cache(_hints)


def require(settings: Any) -> None:
    """Hold an object's fields to their annotations: types, bounds, marks; to be called by `__post_init__`.

    Whole numbers become fractions where those are meant, so that 5 and 5.0 are one setting. Raises SettingError.
    """
    for name, hint in hints(type(settings)).items():
        object.__setattr__(settings, name, _at(name, getattr(settings, name), hint))


def _at(key: int | str, value: Any, hint: Any) -> Any:
    try:
        return _held(value, hint)
    except SettingError as error:
        raise SettingError(error.sentence, key, *error.keys) from None


def _unaliased(hint: Any) -> Any:
    """The type that an alias made by a `type` statement stands for, such as NDArray from NumPy 2.5 on."""
    alias = get_origin(hint) or hint
    meant = getattr(alias, "__value__", None)
    if meant is None:
        return hint
    args = get_args(hint)
    return _unaliased(meant[args] if args else meant)


def _held(value: Any, hint: Any) -> Any:
    hint = _unaliased(hint)
    origin = get_origin(hint)
    args = get_args(hint)
    if origin is Annotated:
        for mark in args[1:]:
            if isinstance(mark, Check) and mark.first:
                mark.check(value)
        value = _held(value, args[0])
        for mark in args[1:]:
            _hold_to(mark, value)
        return value
    if origin in (Union, UnionType):
        if value is None and NoneType in args:
            return value
        some = [choice for choice in args if choice is not NoneType]
        return _held(value, next((choice for choice in some if _is_type(value, choice)), some[0]))
    if origin is tuple and isinstance(value, tuple | list):
        return _held_entries(tuple(value), args)
    if origin is dict and isinstance(value, dict):
        return {_held(key, args[0]): _at(key, entry, args[1]) for key, entry in value.items()}
    if origin is Literal and value not in args:
        raise _wrong("literal_error", value, expected=" or ".join([", ".join(map(repr, args[:-1])), repr(args[-1])]))
    return value if origin is Literal or hint is Any else _held_plain(value, origin or hint)


def _held_entries(entries: tuple[Any, ...], args: tuple[Any, ...]) -> tuple[Any, ...]:
    if args[1:] == (...,):
        args = args[:1] * len(entries)
    if len(entries) < len(args):
        raise SettingError(COMPLAINTS["missing"], len(entries))
    if len(entries) > len(args):
        raise _wrong("too_long", entries, max_length=len(args), actual_length=len(entries))
    return tuple(_at(index, entry, hint) for index, (entry, hint) in enumerate(zip(entries, args, strict=True)))


# How pydantic calls a value that is not of a type, and what is.
TYPES: dict[Any, tuple[str, Any]] = {
    float: ("float_type", Real),
    int: ("int_type", Integral),
    str: ("string_type", str),
    bool: ("bool_type", bool),
    tuple: ("tuple_type", (tuple, list)),
    dict: ("dict_type", dict),
}


def _held_plain(value: Any, kind: Any) -> Any:
    if not _is_type(value, kind):
        raise _wrong(TYPES.get(kind, ("dataclass_type", kind))[0], value)
    if kind is float and not isfinite(value):
        raise _wrong("finite_number", value)
    return kind(value) if kind in (float, int) else value


def _is_type(value: Any, hint: Any) -> bool:
    hint = _unaliased(hint)
    kind = get_origin(hint) or hint
    if kind is Annotated:
        return _is_type(value, get_args(hint)[0])
    if kind is Literal:
        return value in get_args(hint)
    _, wanted = TYPES.get(kind, ("", kind))
    return isinstance(value, wanted) and (kind is bool or not isinstance(value, bool))


def _hold_to(mark: Any, value: Any) -> None:
    match mark:
        case Gt(bound) if not value > bound:
            raise _wrong("greater_than", value, gt=bound)
        case Ge(bound) if not value >= bound:
            raise _wrong("greater_than_equal", value, ge=bound)
        case Lt(bound) if not value < bound:
            raise _wrong("less_than", value, lt=bound)
        case Le(bound) if not value <= bound:
            raise _wrong("less_than_equal", value, le=bound)
        case MinLen(bound) if len(value) < bound:
            name = "string_too_short" if isinstance(value, str) else "too_short"
            raise _wrong(name, value, min_length=bound, actual_length=len(value))
        case MaxLen(bound) if len(value) > bound:
            raise _wrong("too_long", value, max_length=bound, actual_length=len(value))
        case Check(first=False):
            mark.check(value)


def _wrong(name: str, value: Any, **context: Any) -> SettingError:
    return SettingError(complaint(COMPLAINTS[name], value, context))


def complaint(template: str, value: Any, context: Mapping[str, Any]) -> str:
    """What is wrong with a value, and the value; a whole section is no help in a line."""
    said = template.format(**{k: f"{v:g}" if isinstance(v, float) else v for k, v in context.items()})
    if isinstance(value, dict | list | tuple):
        return said
    if value is None:
        seen = "nothing"
    elif isinstance(value, bool):
        seen = str(value).lower()
    else:
        seen = repr(value)
    return f"{said} (got {seen})"
