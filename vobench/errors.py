"""Every error that vobench raises on purpose, in one tree.

VobenchError               the user's mistake or machine: one line, exit code 1
├── InputError             a file does not say what it should
│   ├── SettingError       a setting is not what its field takes, or does not fit the others
│   ├── SuiteError         a suite, scene or manifest: names file, line, key and value of every mistake
│   ├── ModelError         a model of triangles: a glTF, OBJ, STL or PLY file
│   └── TrajectoryError    a trajectory file or array
├── UnknownNameError       no scene, suite or estimator of that name
├── MissingDependencyError this machine lacks something; the message says how to get it
├── AlignmentError         two trajectories cannot be compared as asked
├── MotionError            the robot cannot drive as asked
├── NoSequenceError        no case of a suite could be simulated or imported
├── RenderError            the renderer cannot make this picture
└── SequenceError          a recording is incomplete, torn or of another form
"""

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

# More than fit a screen are counted.
MOST_SAID = 10


@dataclass(frozen=True, slots=True)
class Place:
    """A place in a file: its line and column from 1 on, and the key and value there, as far as they are known."""

    file: str
    line: int | None = None
    column: int | None = None
    key: str = ""
    value: Any = None

    def __str__(self) -> str:
        where = ":".join(str(part) for part in (self.file, self.line, self.column) if part is not None)
        return f"{where}: {self.key}" if self.key else where


@dataclass(frozen=True, slots=True)
class Mistake:
    """One thing that is wrong, in a sentence; its places lead from the file asked for to the one at fault."""

    sentence: str
    places: tuple[Place, ...] = ()

    def __str__(self) -> str:
        return ": ".join([*map(str, self.places), self.sentence])


class VobenchError(Exception):
    """Something the person at the keyboard can mend; the message is one line."""

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        """What is wrong, one by one."""
        return (Mistake(str(self)),)

    def _render_traceback_(self) -> list[str]:
        """What Jupyter shows in place of a traceback."""
        return [f"{type(self).__name__}: {line}" for line in printable(str(self)).splitlines()]


class InputError(VobenchError):
    """A file does not say what it should."""


class SettingError(InputError, ValueError):
    """A setting is wrong; `keys` lead to it from the object that has it. A ValueError, so that pydantic gathers it."""

    def __init__(self, sentence: str, *keys: int | str) -> None:
        self.sentence = sentence
        self.keys = keys
        super().__init__(f"{'.'.join(map(str, keys))}: {sentence}" if keys else sentence)


class SuiteError(InputError):
    """A suite, scene or manifest is wrong; the message names file, line, key and value, a line for each mistake."""

    def __init__(self, *mistakes: Mistake | str) -> None:
        self._mistakes = tuple(Mistake(each) if isinstance(each, str) else each for each in mistakes)
        said = [*map(str, self._mistakes[:MOST_SAID])]
        if more := len(self._mistakes) - len(said):
            said.append(f"and {more} more mistake{'s' if more > 1 else ''}")
        super().__init__("\n".join(said))

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        """Every one, also those that the message only counts."""
        return self._mistakes


class ModelError(InputError):
    """A model of triangles, or a picture on it, is wrong; the message names file, node and what would help."""


class TrajectoryError(InputError):
    """A trajectory file or array is wrong."""


class UnknownNameError(VobenchError):
    """No scene, suite or estimator of that name."""


class MissingDependencyError(VobenchError):
    """This machine lacks something; the message says how to get it."""


class AlignmentError(VobenchError):
    """Two trajectories cannot be compared as asked."""


class MotionError(VobenchError):
    """The robot cannot drive as asked."""


class NoSequenceError(VobenchError):
    """Cases of a suite could not be simulated or imported; the message says which, why and what helps."""


class RenderError(VobenchError):
    """The renderer cannot make this picture."""


class SequenceError(VobenchError):
    """A recording is incomplete, torn or of another form."""


def printable(text: str) -> str:
    """A text of somebody else's as a terminal may have it: without ESC, NUL and their like, or lone surrogates."""
    return "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text)


def unknown(kind: str, name: str, known: list[str]) -> str:
    """One line for a name that nothing has, with the nearest one and all there are."""
    near = get_close_matches(name, known, n=1)
    guess = f" Did you mean '{near[0]}'?" if near else ""
    return f"no {kind} named '{name}'.{guess} Known: {', '.join(sorted(known)) or 'none'}"


def require_known(kind: str, name: str, known: Iterable[str]) -> None:
    """Raise UnknownNameError, with the nearest known name, unless `name` is one of `known`."""
    names = list(known)
    if name not in names:
        raise UnknownNameError(unknown(kind, name, names))
