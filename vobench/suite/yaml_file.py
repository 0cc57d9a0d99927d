"""YAML into checked settings, with errors that name file, line, key, the value seen and what would be right."""

import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from copy import deepcopy
from dataclasses import MISSING, dataclass, field, fields, replace
from difflib import get_close_matches
from functools import cache, lru_cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.constructor import ConstructorError, RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from vobench.errors import Mistake, Place, SettingError, SuiteError, VobenchError
from vobench.setting import COMPLAINTS, complaint, hints, over, unit_of
from vobench.suite import catalog, file_kind
from vobench.suite.file_kind import Kind

Model = TypeVar("Model")
Keys = tuple[int | str, ...]
# Limits of a file, far beyond what a person writes; each is reported in one line.
MOST_BYTES = 2 << 20
MOST_NODES = 100_000
MOST_DEPTH = 100
MOST_DIGITS = 400  # of a number; no float has as many
NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
TOO_DEEP = "brackets or indents are nested too deep"
KEPT = 64  # files, parsed: scenarios change one scene again and again
INCLUDE = "include"  # the key of a file that others of its kind build on


@dataclass(frozen=True, slots=True)
class YamlFile:
    """A YAML file as it was read: what it holds, and on which line each key stands.

    `kept` says which entries of its lists are left, by their numbers in the file, where some are left out; `included`
    is the file whose keys are its own where it has none.
    """

    path: Path
    marked: Any
    kept: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    included: "YamlFile | None" = None

    @property
    def plain(self) -> Any:
        """What it holds over what it includes, in Python's own types; a key without a value takes one of that away."""
        own = _plain(self.marked)
        return without_nothing(over(self.included.plain, own)) if self.included else own

    def placed(self, error: VobenchError, *keys: int | str) -> tuple[Mistake, ...]:
        """The mistakes of an error, this place in front of their own; without keys, where they have none."""
        place = self.place(self.written(keys))
        return tuple(
            replace(mistake, places=(place, *mistake.places)) if keys or not mistake.places else mistake
            for mistake in error.mistakes
        )

    def place(self, keys: Keys) -> Place:
        """The place of the deepest of these keys that the file has, or that is in what it includes."""
        return max((file._place(keys) for file in self.files), key=lambda each: each[0])[1]

    @property
    def files(self) -> "tuple[YamlFile, ...]":
        """The file, what it includes, what that includes."""
        return self, *(self.included.files if self.included else ())

    def _place(self, keys: Keys) -> tuple[int, Place]:
        """How many of the keys the file has, and the place of the last of them."""
        tree = self.marked
        line = None
        named = list[int | str]()
        depth = 0
        for key in keys:
            if isinstance(key, int) and (isinstance(tree, str | int) or (isinstance(tree, dict) and key not in tree)):
                continue  # one value stands for a list of one
            named.append(key)
            lines = getattr(tree, "lc", None)  # what was put in place of the file's has none
            if isinstance(tree, dict) and key in tree:
                tree = tree[key]
                line = lines.key(key)[0] + 1 if lines and key in (lines.data or ()) else line
                depth = len(named)
            elif isinstance(tree, list) and isinstance(key, int) and key < len(tree):
                tree = tree[key]
                line = lines.item(key)[0] + 1 if lines else line
                depth = len(named)
            else:
                tree = None
        value = tree if isinstance(tree, str | bool | int | float) else None
        return depth, Place(str(self.path), line, key=".".join(map(str, named)), value=value)

    def written(self, keys: Keys) -> Keys:
        """The keys with an entry's number as it is in the file."""
        if len(keys) > 1 and isinstance(keys[1], int) and keys[0] in self.kept:
            return keys[0], self.kept[str(keys[0])][keys[1]], *keys[2:]
        return keys


@dataclass(frozen=True, slots=True)
class Mistakes:
    """Gathers what is wrong with a file, so that all of it is said at once."""

    source: YamlFile
    found: list[Mistake] = field(default_factory=list)

    @contextmanager
    def at(self, *keys: int | str) -> Iterator[None]:
        """Errors of the block are gathered, with the place of these keys in front; what follows it is done."""
        try:
            yield
        except VobenchError as error:
            self.found.extend(self.source.placed(error, *keys))

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


def read(path: Path, model: type[Model], kind: Kind | None = None) -> Model:
    """The file as `model`. Raises SuiteError with all that is wrong, as `read_all` does."""
    reading = read_all(path, model, kind=kind)
    if reading.mistakes:
        raise SuiteError(*reading.mistakes)
    return reading.model


def read_all(
    path: Path,
    model: type[Model],
    changes: Mapping[str, str] = MappingProxyType({}),
    kind: Kind | None = None,
) -> Reading[Model]:
    """The file as far as it can be read, and where its keys stand. Raises SuiteError where it is no such file.

    `changes` are values in YAML by keys with dots between, which are put in place of the file's. `kind` is that of the
    file: one of another kind is refused with a sentence that says so, and a model with `include` includes files of
    this kind, suites if none is given.
    """
    if kind:
        _refuse(path, file_kind.model_mistaken_for(kind, path))
    has_include = INCLUDE in hints(model)
    source, mistakes = _with_included(path, kind or "suite", ()) if has_include else _parse(path)
    if kind:
        _refuse(path, file_kind.mistaken_for(kind, path, [*source.plain]))
    source = replace(source, marked=deepcopy(source.marked)) if changes else source
    for keys, value in changes.items():
        _change(source.marked, keys, value)
    unread = {keys: sentence for file in source.files for keys, sentence in _unreadable(file.marked, ())}
    mistakes += [Mistake(sentence, (source.place(keys),)) for keys, sentence in unread.items()]
    data = source.plain
    wrong = [*unread]
    try:
        whole = checked(model, data)
        if not mistakes:
            return Reading(whole, source)
    except ValidationError as error:
        wrong += [_loc(each) for each in error.errors()]
        mistakes += _complaints(source, error, json_schema(model), unread)
    parts, kept = _intact(model, data, wrong)
    return Reading(_partial(model, parts), replace(source, kept=kept), tuple(sorted(mistakes, key=_line)))


def _refuse(path: Path, sentence: str | None) -> None:
    if sentence:
        raise SuiteError(Mistake(sentence, (Place(file_kind.shown(path)),)))


def _with_included(path: Path, kind: Kind, including: tuple[Path, ...]) -> tuple[YamlFile, list[Mistake]]:
    """The file with the one of its kind that it includes, by name or path, and the keys that are twice in one."""
    source, twice = _parse(path)
    name = source.marked.get(INCLUDE)
    if not isinstance(name, str):
        return source, twice
    try:
        found = catalog.find(kind, name, suite=path.resolve()).path
        if found in (path.resolve(), *including):
            raise SuiteError(f"a {kind} cannot include itself: {found}")
        included, more = _with_included(found, kind, (path.resolve(), *including))
    except VobenchError as error:
        raise SuiteError(*source.placed(error, INCLUDE)) from None
    return replace(source, included=included), [*twice, *more]


def _change(tree: Any, keys: str, value: str) -> None:
    *way, last = (int(key) if key.isdigit() else key for key in keys.split("."))
    for key in way:
        held = tree.setdefault(key, CommentedMap()) if isinstance(tree, dict) and isinstance(key, str) else None
        if held is None and isinstance(tree, list) and isinstance(key, int) and key < len(tree):
            held = tree[key]
        if not isinstance(held, dict | list):
            raise SuiteError(f"--set {keys}={value}: there are no keys below {key!r}")
        tree = held
    if isinstance(tree, list) and (not isinstance(last, int) or last >= len(tree)):
        raise SuiteError(f"--set {keys}={value}: a list of {len(tree)} has no entry {last!r}")
    try:
        tree[last] = _plain(_of_text(Path("--set"), value)[0].marked)
    except SuiteError:
        raise SuiteError(f"--set {keys}={value}: should be a value as YAML has it, such as 3, true or [1, 2]") from None


_adapter: Callable[[Any], TypeAdapter[Any]] = cache(TypeAdapter)


def checked(kind: type[Model], data: Any) -> Model:
    """Plain data as settings. Raises pydantic's ValidationError with all that is wrong.

    Strict as JSON is: lists and sections become tuples and objects, but no text a number, and no number a truth.
    """
    read: Model = _adapter(kind).validate_json(json.dumps(data), strict=True)
    return read


def checked_section(kind: type[Model], data: Any, at: Place) -> Model:
    """As `checked`, of what a place in a file makes of the file. Raises SuiteError."""
    try:
        return checked(kind, data)
    except ValidationError as error:
        found = list(_complaints(YamlFile(Path(at.file), data), error, json_schema(kind), ()))
    places = [replace(at, key=f"{at.key}.{mistake.places[0].key}", value=mistake.places[0].value) for mistake in found]
    raise SuiteError(*(replace(mistake, places=(place,)) for mistake, place in zip(found, places, strict=True)))


def plain(settings: Any, *, exclude: Any = None) -> Any:
    """Settings as JSON can hold them, some left out; `checked` reads them again."""
    return _adapter(type(settings)).dump_python(settings, mode="json", exclude=exclude)


def json_schema(kind: Any) -> dict[str, Any]:
    """The JSON Schema of settings, with the unit of each key that has one."""
    found = _adapter(kind).json_schema()
    for section in [found, *found.get("$defs", {}).values()]:
        for key, part in section.get("properties", {}).items():
            part.pop("title", None)
            part.update({"unit": unit_of(key)} if unit_of(key) else {})
    return found


class _Constructor(RoundTripConstructor):
    """Builds what a file holds, of keys that are there twice the first, and remembers the second.

    What would be too large once its aliases are written out is refused before anything of it is built.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.twice: list[tuple[Any, str]] = []
        self.mark: Any = None  # of what is being built

    def construct_document(self, node: Any) -> Any:
        """What the file holds. Raises ConstructorError where it is beyond a limit."""
        _require_limits(node)
        return super().construct_document(node)

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        """What a node stands for; its mark is remembered for an error that has none."""
        self.mark = node.start_mark
        return super().construct_object(node, deep=deep)

    def check_mapping_key(self, node: Any, key_node: Any, mapping: Any, key: Any, value: Any) -> bool:
        """Whether a key is new."""
        del node
        if key in mapping:
            sentence = f'found duplicate key "{key}" with value "{value}" (original value: "{mapping[key]}")'
            self.twice.append((key_node.start_mark, sentence))
            return False
        return True


def _require_limits(root: Node) -> None:
    """Raise ConstructorError for a document that is too large or contains itself: aliases count as what they repeat."""
    sizes = dict[int, int]()  # of nodes with all below them, by id
    pending = [(root, False)]  # a node, and whether all below it is counted
    above = set[int]()
    while pending:
        node, is_counted = pending.pop()
        children = _children(node)
        if is_counted:
            above.discard(id(node))
            sizes[id(node)] = 1 + sum(sizes[id(child)] for child in children)
            if sizes[id(node)] > MOST_NODES:
                raise _refused(f"holds more than {MOST_NODES} values, repetitions by aliases counted", node)
            continue
        if id(node) in above:
            raise _refused("an alias stands inside of what it repeats", node)
        if id(node) in sizes:
            continue
        if len(above) >= MOST_DEPTH:
            raise _refused(f"is nested more than {MOST_DEPTH} deep", node)
        if isinstance(node, ScalarNode) and node.tag in NUMBERS and len(node.value) > MOST_DIGITS:
            raise _refused(f"a number has more than {MOST_DIGITS} characters", node)
        above.add(id(node))
        pending.append((node, True))
        pending += [(child, False) for child in children]


def _children(node: Node) -> list[Node]:
    if isinstance(node, MappingNode):
        return [each for pair in node.value for each in pair]
    return list(node.value) if isinstance(node, SequenceNode) else []


def _refused(sentence: str, node: Node) -> ConstructorError:
    return ConstructorError(None, None, sentence, node.start_mark)


def _read_text(path: Path) -> str:
    """The text of a file, which may be of any kind. Raises SuiteError where it is too long or no text."""
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise SuiteError(f"cannot read {path}: {error.strerror}") from None
    if len(content) > MOST_BYTES:
        raise SuiteError(Mistake(f"should be a text of {MOST_BYTES >> 20} MiB at most", (Place(str(path)),)))
    try:
        return content.decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise SuiteError(Mistake("not a text file in UTF-8", (Place(str(path)),))) from None


def _parse(path: Path) -> tuple[YamlFile, list[Mistake]]:
    """The file as YAML, and the keys that are in it twice. Raises SuiteError where it has no keys with values."""
    try:
        source, twice = _of_text(path, _read_text(path))
    except RecursionError:
        raise SuiteError(Mistake(TOO_DEEP, (Place(str(path)),))) from None
    if not isinstance(source.marked, dict):
        tree = source.marked
        if tree is None:
            kind = "empty"
        elif isinstance(tree, list):
            kind = "a list"
        else:
            kind = f"the single value {tree!r}"
        raise SuiteError(Mistake(f"should be keys with values, but is {kind}", (source.place(()),)))
    return source, [*twice]


@lru_cache(KEPT)
def _of_text(path: Path, text: str) -> tuple[YamlFile, tuple[Mistake, ...]]:
    # YAML 1.2: 1e-3 is a number, 'no' a word.
    yaml = YAML(typ="rt", pure=True)
    yaml.Constructor = _Constructor
    try:
        tree = yaml.load(text)
    except MarkedYAMLError as error:
        raise SuiteError(_at_mark(path, error.problem_mark, " ".join(str(error.problem).split()))) from None
    except YAMLError as error:
        raise SuiteError(Mistake(" ".join(str(error).split()), (Place(str(path)),))) from None
    except RecursionError:
        raise SuiteError(Mistake(TOO_DEEP, (Place(str(path)),))) from None
    except Exception as error:  # of the library, which meets what its authors did not think of
        sentence = f"not readable as YAML ({type(error).__name__}: {' '.join(str(error).split())})"
        raise SuiteError(_at_mark(path, yaml.constructor.mark, sentence)) from None
    return YamlFile(path, tree), tuple(_at_mark(path, mark, sentence) for mark, sentence in yaml.constructor.twice)


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
    """The tree in Python's own types, without keys that are no text and what JSON has not."""
    if isinstance(tree, dict):
        return {str(key): _plain(value) for key, value in tree.items() if isinstance(key, str)}
    if isinstance(tree, list):
        return list(map(_plain, tree))
    for made in (str, bool, int, float):
        if isinstance(tree, made):
            return made(tree)
    return None


def without_nothing(tree: Any) -> Any:
    """Without what is left out in YAML: keys without a value."""
    if isinstance(tree, dict):
        kept = {key: without_nothing(value) for key, value in tree.items()}
        return {key: value for key, value in kept.items() if value is not None}
    return [without_nothing(value) for value in tree] if isinstance(tree, list | tuple) else tree


def _intact(model: type, data: dict[str, Any], wrong: list[Keys]) -> tuple[dict[str, Any], dict[str, Any]]:
    """The sections of a file without the entries in which something is wrong, and which are left of each list."""
    parts = dict[str, Any]()
    kept = dict[str, tuple[int, ...]]()
    known = hints(model)
    for key in data.keys() & known.keys():
        value = data[key]
        bad = [keys[1:2] for keys in wrong if keys[0:1] == (key,)]
        if isinstance(value, dict):
            value = {name: entry for name, entry in value.items() if (name,) not in bad}
        elif isinstance(value, list):
            kept[key] = tuple(index for index in range(len(value)) if (index,) not in bad)
            value = [value[index] for index in kept[key]]
        with suppress(ValidationError):  # what is wrong with it has been said
            parts[key] = TypeAdapter(known[key]).validate_json(json.dumps(value), strict=True)
    return parts, kept


def _partial(model: type[Model], parts: dict[str, Any]) -> Model:
    """An object with these fields and the defaults of others, unchecked; what else it needs, it lacks."""
    lacking = object.__new__(model)
    for each in fields(model):  # type: ignore[arg-type]
        default = each.default if each.default_factory is MISSING else each.default_factory()
        if each.name in parts or default is not MISSING:
            object.__setattr__(lacking, each.name, parts.get(each.name, default))
    return lacking


UNKNOWN_KEY = "unexpected_keyword_argument"


def _complaints(
    source: YamlFile, error: ValidationError, schema: dict[str, Any], unread: Collection[Keys]
) -> Iterator[Mistake]:
    """What is wrong, unknown keys first, but for `unread` ones and for what is wrong only because others are."""
    found = sorted(error.errors(), key=lambda each: each["type"] != UNKNOWN_KEY)
    places = [*unread, *map(_loc, found)]
    meant = {(*each["loc"][:-1], _nearest(each, schema)) for each in found if each["type"] == UNKNOWN_KEY}
    for each in found:
        loc = _loc(each)
        keys = _walk(schema, _loc(each))[0]
        is_misspelt = each["type"] == "missing" and loc in meant
        lost_some = each["type"] == "too_short" and any(loc == other[: len(loc)] != other for other in places)
        if not (keys in unread or is_misspelt or lost_some):
            yield Mistake(_complaint(each, schema, source), (source.place(keys),))


def _loc(error: Any) -> Keys:
    """Where an error is, by pydantic's reckoning; our own know which key of a section is at fault."""
    cause = error.get("ctx", {}).get("error")
    return (*error["loc"], *cause.keys) if isinstance(cause, SettingError) else error["loc"]


def _nearest(error: Any, schema: dict[str, Any]) -> str | None:
    """The key that an unknown one may be meant for."""
    near = get_close_matches(str(error["loc"][-1]), _known(error, schema), n=1)
    return near[0] if near else None


def _known(error: Any, schema: dict[str, Any]) -> list[str]:
    return sorted(_walk(schema, error["loc"][:-1])[1].get("properties", {}))


def _complaint(error: Any, schema: dict[str, Any], source: YamlFile) -> str:
    if error["type"] == UNKNOWN_KEY:
        if elsewhere := _of_other_kinds(error["loc"], schema, source):
            return elsewhere
        near = _nearest(error, schema)
        guess = f" Did you mean {near!r}?" if near else ""
        return f"unknown key.{guess} Known: {', '.join(_known(error, schema))}"
    context = error.get("ctx", {})
    template = COMPLAINTS.get(error["type"])
    if isinstance(context.get("error"), SettingError):  # names the value itself
        return str(context["error"].sentence)
    return complaint(template or error["msg"], error["input"], context if template else {})


def _of_other_kinds(loc: Keys, schema: dict[str, Any], source: YamlFile) -> str:
    """What to say of an unknown key that other kinds of the section have; nothing where only its unit is missing."""
    keys, section = _walk(schema, loc[:-2])
    kind = str(loc[-2:][0])
    key = str(loc[-1])
    own = _known({"loc": loc}, schema)
    members = section.get("discriminator", {}).get("mapping", {})
    owners = [name for name in members if key in _referred(schema, {"$ref": members[name]})["properties"]]
    if not owners or kind not in members or any(name.startswith(f"{key}_") for name in own):
        return ""
    is_said = source.place((*keys, "kind")).value is not None
    return f"belongs to {', '.join(owners)}; {'this is' if is_said else 'without a kind this is'} {kind}"


def _walk(schema: dict[str, Any], loc: Keys) -> tuple[Keys, dict[str, Any]]:
    """The keys of a place in the file, and the part of the schema there.

    Pydantic's own place also names the kind that was chosen where there are several, and ends in a part
    of its own where a key is wrong, as opposed to its value.
    """
    keys = list[int | str]()
    part = _chosen(schema, schema)
    for key in loc:
        if key == "[key]":
            continue
        if reference := part.get("discriminator", {}).get("mapping", {}).get(key):
            part = _referred(schema, {"$ref": reference})
            continue
        keys.append(key)
        named = part.get("patternProperties", {None: part.get("additionalProperties")})
        entry = next(iter(named.values())) or part.get("items") or {}
        part = _chosen(schema, part.get("properties", {}).get(key) or entry)
    return tuple(keys), part


def _chosen(schema: dict[str, Any], part: dict[str, Any]) -> dict[str, Any]:
    """A part that is no choice: an optional section is one between itself and nothing, a preset one with a name."""
    while "anyOf" in part or "$ref" in part:
        part = _referred(schema, part) if "$ref" in part else part["anyOf"][0]
    return part


def _referred(schema: dict[str, Any], part: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = schema["$defs"][part["$ref"].rpartition("/")[2]] if "$ref" in part else part
    return found
