"""YAML into checked models, with errors that name file, line, key, the value seen and what would be right."""

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import AfterValidator, BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from vobench.errors import SuiteError, VobenchError

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
class Source:
    """A YAML file as it was read: what it holds, and on which line each key stands."""

    path: Path
    marked: Any

    @contextmanager
    def at(self, *keys: int | str) -> Iterator[None]:
        """Errors of the block come as SuiteError with the file, line and key in front."""
        try:
            yield
        except VobenchError as error:
            raise SuiteError(f"{self.place(keys)}: {error}") from error

    def place(self, keys: Keys) -> str:
        """`file:line: a.b.c` of the deepest of these keys that the file has."""
        tree, line, named = self.marked, None, list[int | str]()
        for key in keys:
            if isinstance(key, int) and isinstance(tree, str | dict) and key not in list(tree):
                continue  # one value stands for a list of one
            named.append(key)
            if isinstance(tree, dict) and key in tree:
                tree, line = tree[key], tree.lc.key(key)[0] + 1
            elif isinstance(tree, list) and isinstance(key, int) and key < len(tree):
                tree, line = tree[key], tree.lc.item(key)[0] + 1
        where = f"{self.path}:{line}" if line else str(self.path)
        return f"{where}: {'.'.join(map(str, named))}" if named else where


def read(path: Path, model: type[Model]) -> Model:
    """The file as `model`. Raises SuiteError, one line, for whatever is wrong first."""
    return read_marked(path, model)[0]


def read_marked(path: Path, model: type[Model]) -> tuple[Model, Source]:
    """The file as `model`, and where its keys stand. Raises SuiteError, one line."""
    source = Source(path, _parse(path))
    if not isinstance(source.marked, dict):
        raise SuiteError(f"{path}: should be keys with values, but is {_kind(source.marked)}")
    try:
        return model.model_validate(_plain(source, source.marked, ())), source
    except ValidationError as error:
        raise SuiteError(_sentence(source, error, model)) from None


def _parse(path: Path) -> Any:
    try:
        text = path.read_text(encoding="utf-8")
        # YAML 1.2: 1e-3 is a number, 'no' a word, a key twice an error.
        return YAML(typ="rt", pure=True).load(text)
    except OSError as error:
        raise SuiteError(f"cannot read {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SuiteError(f"{path}: not a text file in UTF-8") from None
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"{path}:{mark.line + 1}:{mark.column + 1}" if mark else str(path)
        raise SuiteError(f"{place}: {' '.join(str(error.problem).split())}") from None
    except YAMLError as error:
        raise SuiteError(f"{path}: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise SuiteError(f"{path}: brackets or indents are nested too deep") from None


def _plain(source: Source, tree: Any, keys: Keys) -> Any:
    """The tree in Python's own types, lists as tuples. Raises SuiteError for what JSON could not hold either."""
    if isinstance(tree, dict):
        for key in tree:
            if not isinstance(key, str):
                raise SuiteError(f"{source.place((*keys, key))}: a key should be text (put it in quotes; got {key!r})")
        return {str(key): _plain(source, value, (*keys, key)) for key, value in tree.items()}
    if isinstance(tree, list):
        return tuple(_plain(source, value, (*keys, index)) for index, value in enumerate(tree))
    for made in (str, bool, int):
        if isinstance(tree, made):
            return made(tree)
    if isinstance(tree, float):
        if not math.isfinite(tree):
            raise SuiteError(f"{source.place(keys)}: {COMPLAINTS['finite_number']} (got {tree})")
        return float(tree)
    if tree is not None:
        raise SuiteError(f"{source.place(keys)}: should be a number, text, a list or keys with values (got {tree})")
    return None


def _kind(tree: Any) -> str:
    return "empty" if tree is None else "a list" if isinstance(tree, list) else f"the single value {tree!r}"


def _sentence(source: Source, error: ValidationError, model: type[BaseModel]) -> str:
    """The first thing wrong, unknown keys before missing ones: the one is often the other misspelt."""
    found = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    # Pydantic marks a bad key, as opposed to its value, with a last part of its own.
    keys, _ = _walk(model, tuple(part for part in found[0]["loc"] if part != "[key]"))
    others = len(found) - 1
    more = f" (and {others} more mistake{'s' if others > 1 else ''})" if others else ""
    return f"{source.place(keys)}: {_complaint(found[0], model)}{more}"


def _complaint(error: Any, model: type[BaseModel]) -> str:
    if error["type"] == "extra_forbidden":
        known = sorted(_walk(model, error["loc"][:-1])[1].get("properties", {}))
        near = get_close_matches(str(error["loc"][-1]), known, n=1)
        return f"unknown key.{f' Did you mean {near[0]!r}?' if near else ''} Known: {', '.join(known)}"
    template, seen = COMPLAINTS.get(error["type"]), error["input"]
    context = {key: f"{value:g}" if isinstance(value, float) else value for key, value in error.get("ctx", {}).items()}
    text = template.format(**context) if template else error["msg"].removeprefix("Value error, ")
    # Our own checks name the value themselves; a whole section is no help in a line.
    shown = "" if error["type"] == "value_error" or isinstance(seen, dict | tuple) else f" (got {_as_yaml(seen)})"
    return f"{text}{shown}"


def _as_yaml(value: Any) -> str:
    return "nothing" if value is None else str(value).lower() if isinstance(value, bool) else repr(value)


def _walk(model: type[BaseModel], loc: Keys) -> tuple[Keys, dict[str, Any]]:
    """The keys of a place in the file, and the part of the model's schema there.

    Pydantic's own place also names the kind that was chosen where the model offers several.
    """
    schema = model.model_json_schema()
    keys, part = list[int | str](), schema
    for key in loc:
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
