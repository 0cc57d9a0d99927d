"""YAML into checked settings, with errors that name file, line, key, the value seen and what would be right."""

import math
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError
from ruamel.yaml import YAML
from ruamel.yaml.constructor import RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from vobench.errors import Mistake, Place, SuiteError, VobenchError, unknown

Model = TypeVar("Model", bound=BaseModel)
Keys = tuple[int | str, ...]

# What pydantic finds, in the words of somebody who writes YAML; {} are filled from its context.
COMPLAINTS = {
    "missing": "this key is missing",
    "string_type": "should be text (a number or a date needs quotes)",
    "int_type": "should be a whole number",
    "int_from_float": "should be a whole number",
    "float_type": "should be a number",
    "bool_type": "should be true or false",
    "finite_number": "should be a finite number",
    "tuple_type": "should be a list, as in [a, b]",
    "dict_type": "should be keys with values",
    "model_type": "should be keys with values",
    "model_attributes_type": "should be keys with values",
    "too_short": "should have {min_length} or more entries, but has {actual_length}",
    "too_long": "should have {max_length} or fewer entries, but has {actual_length}",
    "string_too_short": "should not be empty",
    "literal_error": "should be {expected}",
    "greater_than": "should be greater than {gt}",
    "greater_than_equal": "should be {ge} or more",
    "less_than": "should be less than {lt}",
    "less_than_equal": "should be {le} or less",
}


def matching(pattern: str, words: str) -> AfterValidator:
    """A check that text matches all of a pattern; `words` say what would be right."""

    def check(text: str) -> str:
        if not re.fullmatch(pattern, text):
            raise ValueError(f"should be {words} (got {text!r})")
        return text

    return AfterValidator(check)


@dataclass(frozen=True, slots=True)
class YamlFile:
    """A YAML file as it was read: what it holds, and on which line each key stands.

    `kept` says which entries of its lists are left, by their numbers in the file, where some are left out.
    """

    path: Path
    marked: Any
    kept: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    @contextmanager
    def at(self, *keys: int | str) -> Iterator[None]:
        """Errors of the block come as SuiteError with the file, line and key in front."""
        try:
            yield
        except VobenchError as error:
            raise SuiteError(*self.placed(error, *keys)) from error

    def placed(self, error: VobenchError, *keys: int | str) -> tuple[Mistake, ...]:
        """The mistakes of an error, this place in front of their own; without keys, where they have none."""
        place = self.place(self.written(keys))
        return tuple(
            replace(mistake, places=(place, *mistake.places)) if keys or not mistake.places else mistake
            for mistake in error.mistakes
        )

    def place(self, keys: Keys) -> Place:
        """The place of the deepest of these keys that the file has."""
        tree, line, named = self.marked, None, list[int | str]()
        for key in keys:
            if isinstance(key, int) and isinstance(tree, str | dict) and key not in list(tree):
                continue  # one value stands for a list of one
            named.append(key)
            if isinstance(tree, dict) and key in tree:
                tree, line = tree[key], tree.lc.key(key)[0] + 1
            elif isinstance(tree, list) and isinstance(key, int) and key < len(tree):
                tree, line = tree[key], tree.lc.item(key)[0] + 1
            else:
                tree = None
        value = tree if isinstance(tree, str | bool | int | float) else None
        return Place(str(self.path), line, key=".".join(map(str, named)), value=value)

    def written(self, keys: Keys) -> Keys:
        """The keys with an entry's number as it is in the file."""
        if len(keys) > 1 and isinstance(keys[1], int) and keys[0] in self.kept:
            return keys[0], self.kept[str(keys[0])][keys[1]], *keys[2:]
        return keys


@dataclass(frozen=True, slots=True)
class Mistakes:
    """Gathers what is wrong with a file, so that all of it is said at once."""

    source: YamlFile | None
    found: list[Mistake] = field(default_factory=list)

    @contextmanager
    def at(self, *keys: int | str) -> Iterator[None]:
        """Errors of the block are gathered, with the place of these keys in front; what follows it is done."""
        try:
            yield
        except VobenchError as error:
            self.found.extend(self.source.placed(error, *keys) if self.source else error.mistakes)

    def require_none(self) -> None:
        """Raise SuiteError with all that was gathered, each once, in the order of the file."""
        once = {str(mistake): mistake for mistake in self.found}.values()
        if once:
            raise SuiteError(*sorted(once, key=_line))


def _line(mistake: Mistake) -> int:
    return mistake.places[0].line or 0 if mistake.places else 0


@dataclass(frozen=True, slots=True)
class Reading(Generic[Model]):
    """A file as `model`, or what is wrong with it.

    Where there are mistakes, `model` has the entries in which there are none, unchecked as a whole, and lacks
    sections that are wrong altogether.
    """

    model: Model
    source: YamlFile
    mistakes: tuple[Mistake, ...] = ()


def read(path: Path, model: type[Model]) -> Model:
    """The file as `model`. Raises SuiteError with all that is wrong."""
    reading = read_all(path, model)
    if reading.mistakes:
        raise SuiteError(*reading.mistakes)
    return reading.model


def read_all(path: Path, model: type[Model]) -> Reading[Model]:
    """The file as far as it can be read, and where its keys stand. Raises SuiteError where it is no such file."""
    source, twice = _parse(path)
    if not isinstance(source.marked, dict):
        raise SuiteError(Mistake(f"should be keys with values, but is {_kind(source.marked)}", (source.place(()),)))
    unread = dict(_unreadable(source.marked, ()))
    mistakes = [*twice, *(Mistake(sentence, (source.place(keys),)) for keys, sentence in unread.items())]
    data, wrong = _plain(source.marked), [*unread]
    try:
        whole = model.model_validate(data)
        if not mistakes:
            return Reading(whole, source)
    except ValidationError as error:
        wrong += [each["loc"] for each in error.errors()]
        mistakes += _complaints(source, error, model.model_json_schema(), unread)
    parts, kept = _intact(model, data, wrong)
    left = model.model_construct(None, **parts)
    return Reading(left, replace(source, kept=kept), tuple(sorted(mistakes, key=_line)))


class _Constructor(RoundTripConstructor):
    """Builds what a file holds, of keys that are there twice the first, and remembers the second."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.twice: list[tuple[Any, str]] = []

    def check_mapping_key(self, node: Any, key_node: Any, mapping: Any, key: Any, value: Any) -> bool:
        """Whether a key is new."""
        del node
        if key in mapping:
            sentence = f'found duplicate key "{key}" with value "{value}" (original value: "{mapping[key]}")'
            self.twice.append((key_node.start_mark, sentence))
            return False
        return True


def _parse(path: Path) -> tuple[YamlFile, list[Mistake]]:
    """The file as YAML, and the keys that are in it twice. Raises SuiteError where it is none."""
    # YAML 1.2: 1e-3 is a number, 'no' a word.
    yaml = YAML(typ="rt", pure=True)
    yaml.Constructor = _Constructor
    try:
        tree = yaml.load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise SuiteError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SuiteError(Mistake("not a text file in UTF-8", (Place(str(path)),))) from None
    except MarkedYAMLError as error:
        raise SuiteError(_at_mark(path, error.problem_mark, " ".join(str(error.problem).split()))) from None
    except YAMLError as error:
        raise SuiteError(Mistake(" ".join(str(error).split()), (Place(str(path)),))) from None
    except RecursionError:
        raise SuiteError(Mistake("brackets or indents are nested too deep", (Place(str(path)),))) from None
    return YamlFile(path, tree), [_at_mark(path, mark, sentence) for mark, sentence in yaml.constructor.twice]


def _at_mark(path: Path, mark: Any, sentence: str) -> Mistake:
    return Mistake(sentence, (Place(str(path), mark.line + 1, mark.column + 1) if mark else Place(str(path)),))


def _unreadable(tree: Any, keys: Keys) -> Iterator[tuple[Keys, str]]:
    """What JSON could not hold either: where it is, and what would be right."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if isinstance(key, str):
                yield from _unreadable(value, (*keys, key))
            else:
                yield (*keys, key), f"a key should be text (put it in quotes; got {key!r})"
    elif isinstance(tree, list):
        for index, value in enumerate(tree):
            yield from _unreadable(value, (*keys, index))
    elif isinstance(tree, float) and not math.isfinite(tree):
        yield keys, f"{COMPLAINTS['finite_number']} (got {tree})"
    elif not (tree is None or isinstance(tree, str | bool | int | float)):
        yield keys, f"should be a number, text, a list or keys with values (got {tree})"


def _plain(tree: Any) -> Any:
    """The tree in Python's own types, lists as tuples, without keys that are no text."""
    if isinstance(tree, dict):
        return {str(key): _plain(value) for key, value in tree.items() if isinstance(key, str)}
    if isinstance(tree, list):
        return tuple(map(_plain, tree))
    for made in (str, bool, int, float):
        if isinstance(tree, made):
            return made(tree)
    return tree


def _intact(model: type[BaseModel], data: dict[str, Any], wrong: list[Keys]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The sections of a file without the entries in which something is wrong, and which are left of each list."""
    parts, kept = dict[str, Any](), dict[str, tuple[int, ...]]()
    for key in data.keys() & model.model_fields.keys():
        value, bad = data[key], [keys[1:2] for keys in wrong if keys[0:1] == (key,)]
        if isinstance(value, dict):
            value = {name: entry for name, entry in value.items() if (name,) not in bad}
        elif isinstance(value, tuple):
            kept[key] = tuple(index for index in range(len(value)) if (index,) not in bad)
            value = tuple(value[index] for index in kept[key])
        with suppress(ValidationError):  # what is wrong with it has been said
            parts[key] = TypeAdapter(model.model_fields[key].rebuild_annotation()).validate_python(value)
    return parts, kept


def _kind(tree: Any) -> str:
    return "empty" if tree is None else "a list" if isinstance(tree, list) else f"the single value {tree!r}"


def _complaints(
    source: YamlFile, error: ValidationError, schema: dict[str, Any], unread: Collection[Keys]
) -> Iterator[Mistake]:
    """What is wrong, unknown keys first, but for `unread` ones and for what is wrong only because others are."""
    found = sorted(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
    places = [*unread, *(each["loc"] for each in found)]
    meant = {(*each["loc"][:-1], _nearest(each, schema)) for each in found if each["type"] == "extra_forbidden"}
    for each in found:
        loc, keys = each["loc"], _walk(schema, each["loc"])[0]
        is_misspelt = each["type"] == "missing" and loc in meant
        lost_some = each["type"] == "too_short" and any(loc == other[: len(loc)] != other for other in places)
        if not (keys in unread or is_misspelt or lost_some):
            yield Mistake(_complaint(each, schema), (source.place(keys),))


def _nearest(error: Any, schema: dict[str, Any]) -> str | None:
    """The key that an unknown one may be meant for."""
    near = get_close_matches(str(error["loc"][-1]), _known(error, schema), n=1)
    return near[0] if near else None


def _known(error: Any, schema: dict[str, Any]) -> list[str]:
    return sorted(_walk(schema, error["loc"][:-1])[1].get("properties", {}))


def _complaint(error: Any, schema: dict[str, Any]) -> str:
    if error["type"] == "extra_forbidden":
        near = _nearest(error, schema)
        guess = f" Did you mean {near!r}?" if near else ""
        return f"unknown key.{guess} Known: {', '.join(_known(error, schema))}"
    template, seen = COMPLAINTS.get(error["type"]), error["input"]
    context = {key: f"{value:g}" if isinstance(value, float) else value for key, value in error.get("ctx", {}).items()}
    text = template.format(**context) if template else error["msg"].removeprefix("Value error, ")
    # Our own checks name the value themselves; a whole section is no help in a line.
    shown = "" if error["type"] == "value_error" or isinstance(seen, dict | tuple) else f" (got {_as_yaml(seen)})"
    return f"{text}{shown}"


def _as_yaml(value: Any) -> str:
    return "nothing" if value is None else str(value).lower() if isinstance(value, bool) else repr(value)


def _walk(schema: dict[str, Any], loc: Keys) -> tuple[Keys, dict[str, Any]]:
    """The keys of a place in the file, and the part of the model's schema there.

    Pydantic's own place also names the kind that was chosen where the model offers several, and ends in a part
    of its own where a key is wrong, as opposed to its value.
    """
    keys, part = list[int | str](), schema
    for key in loc:
        if key == "[key]":
            continue
        if reference := part.get("discriminator", {}).get("mapping", {}).get(key):
            part = _referred(schema, {"$ref": reference})
            continue
        keys.append(key)
        part = part.get("properties", {}).get(key) or part.get("additionalProperties") or part.get("items") or {}
        # An optional section is a choice between itself and nothing.
        part = _referred(schema, next(iter(part.get("anyOf", [part]))))
    return tuple(keys), part


def _referred(schema: dict[str, Any], part: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = schema["$defs"][part["$ref"].rpartition("/")[2]] if "$ref" in part else part
    return found


class Strict(BaseModel):
    """A frozen model in which an unknown key is an error, as are NaN, infinity and a number in quotes."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


# Names become folders, and a case's name joins several with a hyphen.
NAME = matching(r"[a-z0-9][a-z0-9_.]*", "lower-case letters, digits, _ and ., a letter or digit first")
Name = Annotated[str, NAME]
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
# Wide enough for a car on a motorway, and narrow enough that no square of one overflows.
Length = Annotated[float, Field(gt=0, le=1e5)]
Speed = Annotated[float, Field(gt=0, le=100)]
Acceleration = Annotated[float, Field(gt=0, le=1000)]
Rate = Annotated[float, Field(gt=0, le=1000)]
Point = tuple[float, float]
Triple = tuple[float, float, float]
Pause = Annotated[float, Field(ge=0, le=3600)]


def tupled(value: Any) -> Any:
    """Lists as tuples, all the way down: what runs before pydantic's own checks has to hand on what YAML gives."""
    if isinstance(value, dict):
        return {key: tupled(part) for key, part in value.items()}
    return tuple(map(tupled, value)) if isinstance(value, list | tuple) else value


def one_of(kind: str, known: Collection[str]) -> AfterValidator:
    """A check that text is among the known names; a near one is suggested."""

    def check(name: str) -> str:
        if name not in known:
            raise ValueError(unknown(kind, name, list(known)))
        return name

    return AfterValidator(check)


def wrong_key(key: str, sentence: str) -> ValidationError:
    """To be raised by a validator of a whole section, where one of its keys is at fault."""
    error = PydanticCustomError("value_error", "{sentence}", {"sentence": sentence})
    return ValidationError.from_exception_data(key, [InitErrorDetails(type=error, loc=(key,), input=None)])
