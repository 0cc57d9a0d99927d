"""Every error that vobench raises on purpose, in one tree.

VobenchError               an error that the user can correct: one line, exit code 1
├── InputError             a file or an argument is wrong
│   ├── SettingError       a setting has a wrong value, or contradicts others
│   ├── SuiteError         a suite, scene or manifest: names file, line, key and value of every mistake
│   ├── ModelError         a model of triangles: a glTF, OBJ, STL or PLY file
│   └── TrajectoryError    a trajectory file or array
├── UnknownNameError       no scene, suite or estimator has that name
├── MissingDependencyError this machine lacks something; the message names the remedy
├── AlignmentError         two trajectories cannot be compared in the requested way
├── MotionError            the robot cannot drive in the requested way
├── NoSequenceError        no case of a suite could be simulated or imported
├── RenderError            the renderer cannot render this image
└── SequenceError          a recording is incomplete, damaged or of another form
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

MOST_SAID = 10  # mistakes in one message; the others are counted


@dataclass(frozen=True, slots=True)
class FilePlace:
    """A place in a file: line and column, counted from 1, and the key and value there, as far as they are known."""

    file: str
    line: int | None = None
    column: int | None = None
    key: str = ""
    value: Any = None

    def __str__(self) -> str:
        parts = (self.file, self.line, self.column)
        position = ":".join(str(part) for part in parts if part is not None)
        return f"{position}: {self.key}" if self.key else position


@dataclass(frozen=True, slots=True)
class Mistake:
    """One mistake in a sentence; its places lead from the requested file to the wrong one."""

    sentence: str
    places: tuple[FilePlace, ...] = ()

    def __str__(self) -> str:
        return ": ".join([*map(str, self.places), self.sentence])


class VobenchError(Exception):
    """An error that the user can correct; the message is one line."""

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        """The mistakes, one by one."""
        return (Mistake(str(self)),)

    def _render_traceback_(self) -> list[str]:
        """The lines that Jupyter shows instead of a traceback."""
        return [f"{type(self).__name__}: {line}" for line in printable(str(self)).splitlines()]


class InputError(VobenchError):
    """A file or an argument is wrong."""


class SettingError(InputError, ValueError):
    """A setting is wrong; `keys` lead to it from its object. It is a ValueError so that pydantic gathers it."""

    def __init__(self, sentence: str, *keys: int | str) -> None:
        self.sentence = sentence
        self.keys = keys
        super().__init__(f"{'.'.join(map(str, keys))}: {sentence}" if keys else sentence)


class SuiteError(InputError):
    """A suite, scene or manifest is wrong; the message has a line with file, line, key and value for each mistake."""

    def __init__(self, *mistakes: Mistake | str) -> None:
        self._mistakes = tuple(Mistake(each) if isinstance(each, str) else each for each in mistakes)
        lines = [str(mistake) for mistake in self._mistakes[:MOST_SAID]]
        more_count = len(self._mistakes) - len(lines)
        if more_count:
            lines.append(f"and {counted(more_count, 'more mistake')}")
        super().__init__("\n".join(lines))

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        """All mistakes, including those that the message only counts."""
        return self._mistakes


class ModelError(InputError):
    """A model of triangles or its texture is wrong; the message names the file, the node and the remedy."""


class TrajectoryError(InputError):
    """A trajectory file or array is wrong."""


class UnknownNameError(VobenchError):
    """No scene, suite or estimator has that name."""


class MissingDependencyError(VobenchError):
    """This machine lacks something; the message names the remedy."""


class AlignmentError(VobenchError):
    """Two trajectories cannot be compared in the requested way."""


class MotionError(VobenchError):
    """The robot cannot drive in the requested way."""


class NoSequenceError(VobenchError):
    """Cases of a suite could not be simulated or imported; the message names them, the reason and the remedy."""


class RenderError(VobenchError):
    """The renderer cannot render this image."""


class SequenceError(VobenchError):
    """A recording is incomplete, damaged or of another form."""


def printable(text: str) -> str:
    """A text of unknown origin that is safe on a terminal: control characters and lone surrogates become spaces."""
    return "".join(character if _is_safe(character) else " " for character in text)


def _is_safe(character: str) -> bool:
    return character.isprintable() or character == "\n"


def error_sentence(error: Exception) -> str:
    """An exception as one line. The name of its type comes first, unless it is a VobenchError."""
    text = " ".join(str(error).split())
    return text if isinstance(error, VobenchError) else f"{type(error).__name__}: {text}"


def unknown_name_sentence(kind: str, name: str, known: list[str]) -> str:
    """The sentence about an unknown name, with the nearest known name and all known ones."""
    nearest = get_close_matches(name, known, n=1)
    guess = f" Did you mean '{nearest[0]}'?" if nearest else ""
    known_names = ", ".join(sorted(known)) or "none"
    return f"no {kind} named '{name}'.{guess} Known: {known_names}"


def require_known(kind: str, name: str, known: Iterable[str]) -> str:
    """Return `name` if it is one of `known`. Otherwise raise UnknownNameError with the nearest known name."""
    names = list(known)
    if name not in names:
        raise UnknownNameError(unknown_name_sentence(kind, name, names))
    return name


def counted(number: int, noun: str) -> str:
    """A number with a noun, in the plural unless it is 1."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def listed(phrases: Sequence[str]) -> str:
    """The phrases joined by commas, with "and" before the last one."""
    if len(phrases) < 2:
        return "".join(phrases)
    return f"{', '.join(phrases[:-1])} and {phrases[-1]}"


def enumerated(names: Sequence[str], most: int) -> str:
    """At most `most` names, and the number of the others."""
    shown = ", ".join(names[:most])
    omitted_count = len(names) - most
    return f"{shown} and {omitted_count} more" if omitted_count > 0 else shown
