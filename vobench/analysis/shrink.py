"""The shortest part of a case that still fails in the same way: delta debugging over its frames and its nuisances."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

from vobench.analysis.nuisance import Nuisance, without
from vobench.suite.suite import Case, Window

FIRST_SHARE = 0.1  # of all frames: what is tried first
STRIDES = 4  # to a window: how closely places are looked at
FEWEST_FRAMES = 4


@dataclass(frozen=True, slots=True)
class Failure:
    """How a trial failed: its status, and its reason with every number left out."""

    status: str
    reason: str

    @classmethod
    def of(cls, status: str, reason: str) -> "Failure":
        """What two failures of one kind have in common."""
        return cls(status, re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", reason))


@dataclass(frozen=True, slots=True)
class Shrunk:
    """The smallest case that was found to fail in the same way, and what was tried: which case, and whether it did.

    `window` are its frames of the `whole` way's.
    """

    case: Case
    window: Window
    whole: Window
    removed: tuple[str, ...]
    tried: tuple[tuple[str, bool], ...]


class _Spent(Exception):  # noqa: N818 - no error: the trials are used up
    pass


def shrink(
    case: Case,
    whole: Window,
    likely: Callable[[Window], bool],
    nuisances: Sequence[Nuisance],
    fails: Callable[[Case], bool],
    *,
    trials: int,
) -> Shrunk:
    """Cut a case of the frames `whole`, then remove nuisances, in so many trials at most.

    First a window where the whole trial's own estimate fails alike, which is what `likely` says, doubled until it
    does so by itself; then its end and its start are moved inwards by halves; then all nuisances at once, or one after
    the other. `fails` runs a case and says whether it fails the same way.
    """
    search = _Search(case, whole, fails, trials)
    try:
        search.find(likely)
        search.cut()
        search.remove(nuisances)
    except _Spent:
        pass
    return Shrunk(search.case, search.window, whole, tuple(search.removed), tuple(search.tried))


class _Search:
    """The smallest case so far, and what was tried."""

    def __init__(self, case: Case, whole: Window, fails: Callable[[Case], bool], trials: int) -> None:
        self._original = case
        self._whole = whole
        self._fails = fails
        self._left = trials
        self.window = whole
        self.removed = list[str]()
        self.tried = list[tuple[str, bool]]()

    @property
    def case(self) -> Case:
        """The smallest that is known to fail."""
        return self._made(self.window, self.removed)

    def find(self, likely: Callable[[Window], bool]) -> None:
        """A window that is likely to fail, twice as long each time, the whole where no shorter one does."""
        first, end = self._whole
        length = max(FEWEST_FRAMES, round(FIRST_SHARE * (end - first)))
        while length < end - first:
            begins = [*range(first, end - length, max(1, length // STRIDES)), end - length]
            middle = _middle_of_first_run([likely((begin, begin + length)) for begin in begins])
            if middle is not None and self._try((begins[middle], begins[middle] + length)):
                return
            length *= 2

    def cut(self) -> None:
        """Take away from the end, then from the start, half of what is left each time, while it goes on failing."""
        for is_end in (True, False):
            step = (self.window[1] - self.window[0]) // 2
            while step >= 1 and self.window[1] - self.window[0] - step >= FEWEST_FRAMES:
                first, end = self.window
                if not self._try((first, end - step) if is_end else (first + step, end)):
                    step //= 2
                    if step < (end - first) / 8:
                        break

    def remove(self, nuisances: Sequence[Nuisance]) -> None:
        """Remove all, else each by itself."""
        names = [nuisance.name for nuisance in nuisances]
        if not names or self._try(self.window, names) or len(names) == 1:
            return
        for name in names:
            self._try(self.window, [*self.removed, name])

    def _try(self, window: Window, removed: Sequence[str] = ()) -> bool:
        if self._left == 0:
            raise _Spent
        self._left -= 1
        failed = self._fails(self._made(window, removed))
        said = f"frames {window[0]} to {window[1] - 1}" + (f" without {', '.join(removed)}" if removed else "")
        self.tried.append((said, failed))
        if failed:
            self.window = window
            self.removed = [*removed]
        return failed

    def _made(self, window: Window, removed: Sequence[str]) -> Case:
        return replace(without(self._original, removed), frames=window)


def _middle_of_first_run(holds: Sequence[bool]) -> int | None:
    """The place in the middle of the first that hold in a row; None where none does."""
    if True not in holds:
        return None
    first = holds.index(True)
    return first + sum(1 for _ in takewhile(bool, holds[first:])) // 2
