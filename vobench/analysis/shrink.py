"""The shortest part of a case that still fails in the same way: delta debugging over its frames and its nuisances."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from vobench.analysis.nuisance import Nuisance, without
from vobench.suite.suite import Case, Window

FIRST_SHARE = 0.1  # of all frames: what is tried first, around where the trial went wrong
# Of a window: what comes before that place, where most of the frames may fail and where most must not.
LEAD, LEAD_OF_PARTIAL = 0.25, 0.75
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
    """The smallest case that was found to fail in the same way, and what was tried: which case, and whether it did."""

    case: Case
    removed: tuple[str, ...]
    tried: tuple[tuple[str, bool], ...]


class _Spent(Exception):  # noqa: N818 - no error: the trials are used up
    pass


def shrink(
    case: Case,
    count: int,
    wrong_at: int,
    nuisances: Sequence[Nuisance],
    fails: Callable[[Case], bool],
    *,
    trials: int,
    lead: float = LEAD,
) -> Shrunk:
    """Cut a case of `count` frames that goes wrong at one of them, then remove nuisances, in so many trials at most.

    First a window around that place, doubled until it fails; then its end and its start are moved inwards by halves;
    then all nuisances at once, or one after the other. `fails` runs a case and says whether it fails the same way.
    """
    search = _Search(case, case.frames or (0, count), fails, trials)
    try:
        search.find(wrong_at, lead)
        search.cut()
        search.remove(nuisances)
    except _Spent:
        pass
    return Shrunk(search.case, tuple(search.removed), tuple(search.tried))


class _Search:
    """The smallest case so far, and what was tried."""

    def __init__(self, case: Case, whole: Window, fails: Callable[[Case], bool], trials: int) -> None:
        self._original, self._whole, self._fails, self._left = case, whole, fails, trials
        self.window, self.removed = whole, list[str]()
        self.tried = list[tuple[str, bool]]()

    @property
    def case(self) -> Case:
        """The smallest that is known to fail."""
        return self._made(self.window, self.removed)

    def find(self, wrong_at: int, lead: float) -> None:
        """A window around the place, twice as long each time, the whole where no shorter one fails."""
        first, end = self._whole
        length = max(FEWEST_FRAMES, round(FIRST_SHARE * (end - first)))
        while length < end - first:
            begin = min(max(first, first + wrong_at - max(1, round(lead * length))), end - length)
            if self._try((begin, begin + length)):
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
            self.window, self.removed = window, [*removed]
        return failed

    def _made(self, window: Window, removed: Sequence[str]) -> Case:
        return replace(without(self._original, removed), frames=window)
