"""YAML into checked models, with errors that name file, line, key, the value seen and what would be right."""

from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from vobench.errors import SuiteError

Model = TypeVar("Model", bound=BaseModel)


def read(path: Path, model: type[Model]) -> Model:
    """The file as `model`. Raises SuiteError, one line, for whatever is wrong first."""
    tree = _parse(path)
    if not isinstance(tree, dict):
        raise SuiteError(f"{path}: expected keys and values, got {'nothing' if tree is None else type(tree).__name__}")
    try:
        return model.model_validate(tree)
    except ValidationError as error:
        raise SuiteError(_sentence(path, tree, error, model)) from None


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


def _sentence(path: Path, tree: Any, error: ValidationError, model: type[BaseModel]) -> str:
    """The first thing wrong, unknown keys before missing ones: the one is often the other misspelt."""
    found = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    first = found[0]
    keys, line = _locate(tree, first["loc"])
    place = f"{path}:{line}" if line else str(path)
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"{place}: {'.'.join(map(str, keys))}: {_complaint(first, model)}{more}"


def _locate(tree: Any, loc: tuple[int | str, ...]) -> tuple[list[int | str], int | None]:
    """The keys that exist in the file, and the line of the last of them; union tags are not keys."""
    keys: list[int | str] = []
    line: int | None = None
    for part in loc:
        if isinstance(tree, dict) and part in tree:
            line = tree.lc.key(part)[0] + 1 if hasattr(tree, "lc") else line
            tree = tree[part]
        elif isinstance(tree, list) and isinstance(part, int) and part < len(tree):
            line = tree.lc.item(part)[0] + 1 if hasattr(tree, "lc") else line
            tree = tree[part]
        elif part != loc[-1]:
            continue
        keys.append(part)
    return keys, line


def _complaint(error: Any, model: type[BaseModel]) -> str:
    if error["type"] == "extra_forbidden":
        known = sorted(_keys_of(model))
        near = get_close_matches(str(error["loc"][-1]), known, n=1)
        return f"unknown key.{f' Did you mean {near[0]!r}?' if near else ''}"
    if error["type"] == "missing":
        return "this key is missing"
    message = error["msg"].removeprefix("Value error, ")
    seen = error["input"]
    shown = "" if error["type"] == "value_error" or isinstance(seen, dict | list) else f" (got {seen!r})"
    return f"{message[0].lower()}{message[1:]}{shown}"


def _keys_of(model: type[BaseModel]) -> set[str]:
    """All keys anywhere in a model, for a guess at what was meant."""
    schema = model.model_json_schema()
    parts = [schema, *schema.get("$defs", {}).values()]
    return {key for part in parts for key in part.get("properties", {})}
