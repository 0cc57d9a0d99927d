"""The content of a YAML file with the line of each key, and the mistakes in it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from vobench.errors import FilePlace, Mistake, SuiteError, VobenchError
from vobench.setting import merged_over

Keys = tuple[int | str, ...]


@dataclass(frozen=True, slots=True)
class YamlFile:
    """The content of a YAML file, and the line of each key.

    `parsed` is the tree from the parser, whose mappings and lists have line numbers.
    `remaining` has, for each list from which entries were removed, the original indices of the entries that remain.
    `included` is the file that this one includes. Its keys apply if this file does not have them.
    """

    path: Path
    parsed: Any
    remaining: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    included: "YamlFile | None" = None

    @property
    def plain(self) -> Any:
        """The content in Python's built-in types, merged over that of the included file.

        A key without a value removes the key of the included file.
        """
        content = plain_tree(self.parsed)
        if self.included is None:
            return content
        merged = merged_over(self.included.plain, content)
        return without_empty_keys(merged)

    @property
    def files(self) -> "tuple[YamlFile, ...]":
        """This file, the file that it includes, the file that that one includes, and so on."""
        if self.included is None:
            return (self,)
        return self, *self.included.files

    def located_mistakes(self, error: VobenchError, *keys: int | str) -> tuple[Mistake, ...]:
        """The mistakes of an error, with the place of the given keys in front of their places.

        Without keys, a mistake without a place gets this file as its place.
        """
        place = self.place(self.original_keys(keys))
        mistakes = list[Mistake]()
        for mistake in error.mistakes:
            needs_place = bool(keys) or not mistake.places
            if needs_place:
                mistakes.append(replace(mistake, places=(place, *mistake.places)))
            else:
                mistakes.append(mistake)
        return tuple(mistakes)

    def place(self, keys: Keys) -> FilePlace:
        """The place of the last of the given keys that exists, in this file or the included one that has most of them.

        The place names all of the keys, so that a missing key is part of the message.
        """
        deepest = max((_KeyPath(file, keys) for file in self.files), key=lambda key_path: key_path.depth)
        return deepest.place

    def original_keys(self, keys: Keys) -> Keys:
        """The keys with the index that a list entry had before other entries were removed."""
        if len(keys) < 2:
            return keys
        section, index, *rest = keys
        if isinstance(index, int) and section in self.remaining:
            original_index = self.remaining[str(section)][index]
            return section, original_index, *rest
        return keys


class _KeyPath:
    """The way through one file along some keys, as far as the file has them.

    `depth` is the number of keys up to the last one that exists.
    """

    def __init__(self, file: YamlFile, keys: Keys) -> None:
        self.depth = 0
        self._file = file.path
        self._line: int | None = None  # of the last key that exists
        self._keys = list[int | str]()
        self._tree = file.parsed  # the value at the last key; None if the file does not have that key
        for key in keys:
            # A single value may stand for a list of one entry. The file has no index there, and the place gets none.
            if not _is_single_value_for_list(self._tree, key):
                self._follow(key)

    def _follow(self, key: int | str) -> None:
        """Go on to the value at a key."""
        self._keys.append(key)
        if not _has_entry(self._tree, key):
            self._tree = None
            return
        self.depth = len(self._keys)
        self._line = _line_of_entry(self._tree, key) or self._line
        self._tree = self._tree[key]

    @property
    def place(self) -> FilePlace:
        """The place in the file, with the value there if it is neither a mapping nor a list."""
        dotted_keys = ".".join(str(key) for key in self._keys)
        value = self._tree if isinstance(self._tree, str | bool | int | float) else None
        return FilePlace(str(self._file), self._line, key=dotted_keys, value=value)


def _is_single_value_for_list(tree: Any, key: int | str) -> bool:
    """Whether a key is the index of a list entry, but the file has a single value or a mapping instead of a list."""
    if not isinstance(key, int):
        return False
    is_mapping_without_key = isinstance(tree, dict) and key not in tree
    return is_mapping_without_key or isinstance(tree, str | int)


def _has_entry(tree: Any, key: int | str) -> bool:
    """Whether a mapping or a list has an entry at a key or an index."""
    if isinstance(tree, dict):
        return key in tree
    return isinstance(tree, list) and isinstance(key, int) and key < len(tree)


def _line_of_entry(tree: Any, key: int | str) -> int | None:
    """The line, from 1, of an entry of a mapping or a list; None if the file does not contain the entry."""
    lines = getattr(tree, "lc", None)  # values that replaced those of the file have no lines
    if not lines:
        return None
    if isinstance(tree, list):
        return int(lines.item(key)[0]) + 1
    if key not in (lines.data or ()):
        return None
    return int(lines.key(key)[0]) + 1


@dataclass(frozen=True, slots=True)
class Mistakes:
    """Collects the mistakes in a file, so that all of them are reported at once."""

    source: YamlFile
    recorded: list[Mistake] = field(default_factory=list)

    @contextmanager
    def at(self, *keys: int | str) -> Iterator[None]:
        """Record the error that a block raises, with the place of the given keys.

        Execution continues after the block.
        """
        try:
            yield
        except VobenchError as error:
            self.recorded.extend(self.source.located_mistakes(error, *keys))

    def require_none(self) -> None:
        """Raise SuiteError with all distinct mistakes, in the order of the file, if there are any."""
        if not self.recorded:
            return
        by_message = {str(mistake): mistake for mistake in self.recorded}
        raise SuiteError(*sorted(by_message.values(), key=line_of))


def line_of(mistake: Mistake) -> int:
    """The line of a mistake in the requested file; 0 if it has none."""
    if not mistake.places:
        return 0
    return mistake.places[0].line or 0


def plain_tree(tree: Any) -> Any:
    """A tree in Python's built-in types. Keys that are not text are removed; values of other types become None."""
    if isinstance(tree, dict):
        return {str(key): plain_tree(value) for key, value in tree.items() if isinstance(key, str)}
    if isinstance(tree, list):
        return [plain_tree(value) for value in tree]
    for builtin in (str, bool, int, float):
        if isinstance(tree, builtin):
            return builtin(tree)
    return None


def without_empty_keys(tree: Any) -> Any:
    """A tree without keys that have no value, which count as missing."""
    if isinstance(tree, dict):
        with_value = {key: without_empty_keys(value) for key, value in tree.items()}
        return {key: value for key, value in with_value.items() if value is not None}
    if isinstance(tree, list | tuple):
        return [without_empty_keys(value) for value in tree]
    return tree
