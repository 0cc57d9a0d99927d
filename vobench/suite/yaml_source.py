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
class _FoundPlace:
    """A place in a file, and how many of the requested keys lead to it."""

    depth: int
    place: FilePlace


@dataclass(frozen=True, slots=True)
class YamlFile:
    """The content of a YAML file, and the line of each key.

    `marked` is the tree that was parsed.
    `kept` has the original indices of the entries of each list from which entries were removed.
    `included` is the file that this one includes. Its keys apply if this file does not have them.
    """

    path: Path
    marked: Any
    kept: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    included: "YamlFile | None" = None

    @property
    def plain(self) -> Any:
        """The content in Python's built-in types, merged over that of the included file.

        A key without a value removes the key of the included file.
        """
        own = plain_tree(self.marked)
        if self.included is None:
            return own
        return without_nothing(merged_over(self.included.plain, own))

    @property
    def files(self) -> "tuple[YamlFile, ...]":
        """This file, the file that it includes, the file that that one includes, and so on."""
        if self.included is None:
            return (self,)
        return self, *self.included.files

    def placed(self, error: VobenchError, *keys: int | str) -> tuple[Mistake, ...]:
        """The mistakes of an error, with the place of the given keys in front of their places.

        Without keys, a mistake without a place gets this file as its place.
        """
        place = self.place(self.written(keys))
        mistakes = list[Mistake]()
        for mistake in error.mistakes:
            if keys or not mistake.places:
                mistakes.append(replace(mistake, places=(place, *mistake.places)))
            else:
                mistakes.append(mistake)
        return tuple(mistakes)

    def place(self, keys: Keys) -> FilePlace:
        """The place of the last of the given keys that exists in this file or an included one."""
        found_places = [file._find_place(keys) for file in self.files]
        return max(found_places, key=lambda found: found.depth).place

    def _find_place(self, keys: Keys) -> _FoundPlace:
        """The place of the last of the given keys that exists in this file."""
        tree = self.marked
        line: int | None = None
        written_keys = list[int | str]()
        depth = 0
        for key in keys:
            if _is_single_value_for_list(tree, key):
                continue
            written_keys.append(key)
            if _has_entry(tree, key):
                line = _line_of_entry(tree, key) or line
                tree = tree[key]
                depth = len(written_keys)
            else:
                tree = None
        value = tree if isinstance(tree, str | bool | int | float) else None
        return _FoundPlace(depth, FilePlace(str(self.path), line, key=".".join(map(str, written_keys)), value=value))

    def written(self, keys: Keys) -> Keys:
        """The keys with the original indices of list entries."""
        if len(keys) < 2:
            return keys
        section, index, *rest = keys
        if isinstance(index, int) and section in self.kept:
            return section, self.kept[str(section)][index], *rest
        return keys


def _is_single_value_for_list(tree: Any, key: int | str) -> bool:
    """Whether a key is the index of a list entry, but the file has a single value instead of a list."""
    if not isinstance(key, int):
        return False
    is_other_mapping = isinstance(tree, dict) and key not in tree
    return is_other_mapping or isinstance(tree, str | int)


def _has_entry(tree: Any, key: int | str) -> bool:
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
    found: list[Mistake] = field(default_factory=list)

    @contextmanager
    def at(self, *keys: int | str) -> Iterator[None]:
        """Record the error that a block raises, with the place of the given keys.

        Execution continues after the block.
        """
        try:
            yield
        except VobenchError as error:
            self.found.extend(self.source.placed(error, *keys))

    def require_none(self) -> None:
        """Raise SuiteError with all distinct mistakes, in the order of the file, if there are any."""
        distinct = {str(mistake): mistake for mistake in self.found}.values()
        if distinct:
            raise SuiteError(*sorted(distinct, key=line_of))


def line_of(mistake: Mistake) -> int:
    """The line of a mistake in the requested file; 0 if it has none."""
    return mistake.places[0].line or 0 if mistake.places else 0


def plain_tree(tree: Any) -> Any:
    """A tree in Python's built-in types, without keys that are not text and values that JSON cannot represent."""
    if isinstance(tree, dict):
        return {str(key): plain_tree(value) for key, value in tree.items() if isinstance(key, str)}
    if isinstance(tree, list):
        return [plain_tree(value) for value in tree]
    for builtin in (str, bool, int, float):
        if isinstance(tree, builtin):
            return builtin(tree)
    return None


def without_nothing(tree: Any) -> Any:
    """A tree without keys that have no value, because YAML treats them like missing keys."""
    if isinstance(tree, dict):
        with_value = {key: without_nothing(value) for key, value in tree.items()}
        return {key: value for key, value in with_value.items() if value is not None}
    if isinstance(tree, list | tuple):
        return [without_nothing(value) for value in tree]
    return tree
