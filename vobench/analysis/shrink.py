"""Finds the shortest part of a case that still fails in the same way, by delta debugging of frames and nuisances."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import NamedTuple

from vobench.analysis.nuisance import Nuisance, without
from vobench.suite.case import Case
from vobench.suite.suite_spec import Window

FIRST_SHARE = 0.1  # of all frames, in the first windows
WINDOW_OVERLAP = 4  # windows begin a quarter of their length apart
MIN_FRAMES = 4
MIN_STEP_SHARE = 1 / 8  # of a window, by which it is still cut
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?")


@dataclass(frozen=True, slots=True)
class Failure:
    """The kind of a failure: the status of the trial, and its reason without numbers."""

    status: str
    reason: str

    @classmethod
    def of(cls, status: str, reason: str) -> "Failure":
        """The kind of the failure with a status and a reason."""
        return cls(status, NUMBER.sub("#", reason))


class TriedPart(NamedTuple):
    """A candidate that was run, and whether it fails in the same way."""

    description: str
    fails: bool


@dataclass(frozen=True, slots=True)
class Shrunk:
    """The smallest case found that fails in the same way, and the candidates that were tried with their results.

    `window` is its range of frames, and `whole` the range of the whole case.
    `removed` lists the nuisances that it is without.
    """

    case: Case
    window: Window
    whole: Window
    removed: tuple[str, ...]
    tried: tuple[TriedPart, ...]


class _TrialsUsedUp(Exception):  # noqa: N818 - no error: the search ends
    """Ends the search, however deep in its steps, when no more trials may be run."""


def shrink(
    case: Case,
    whole: Window,
    *,
    is_likely: Callable[[Window], bool],
    nuisances: Sequence[Nuisance],
    fails: Callable[[Case], bool],
    trials: int,
) -> Shrunk:
    """Cut a case down to a part of its frames, then remove nuisances, in a limited number of trials.

    First, find a window in which the estimate of the whole trial fails in the same way, according to `is_likely`;
    double it until it also fails by itself. Then move its end and its start inwards, by half the length and less. Then
    remove all nuisances at once, or one after the other. `fails` runs a case and returns whether it fails in the same
    way.
    """
    search = _Search(case, whole, fails, trials)
    with suppress(_TrialsUsedUp):
        search.find_window(is_likely)
        search.cut_window()
        search.remove(nuisances)
    return Shrunk(search.case, search.window, whole, tuple(search.removed), tuple(search.tried))


class _Search:
    """The smallest failing case so far, and what was tried."""

    def __init__(
        self,
        case: Case,
        whole: Window,
        fails: Callable[[Case], bool],
        trials: int,
    ) -> None:
        self._original = case
        self._whole = whole
        self._fails = fails
        self._trials_left = trials
        self.window = whole
        self.removed: list[str] = []
        self.tried: list[TriedPart] = []

    @property
    def case(self) -> Case:
        """The smallest case that is known to fail."""
        return self._variant(self.window, self.removed)

    def find_window(self, is_likely: Callable[[Window], bool]) -> None:
        """Find a window that fails, by doubling its length; the whole case if no shorter window fails."""
        first, end = self._whole
        length = max(MIN_FRAMES, round(FIRST_SHARE * (end - first)))
        while length < end - first:
            step = max(1, length // WINDOW_OVERLAP)
            starts = [*range(first, end - length, step), end - length]
            likely = [is_likely((start, start + length)) for start in starts]
            middle = middle_of_first_run(likely)
            if middle is not None and self._try((starts[middle], starts[middle] + length)):
                return
            length *= 2

    def cut_window(self) -> None:
        """Remove frames at the end, then at the start, as long as the case still fails."""
        self._cut(at_end=True)
        self._cut(at_end=False)

    def _cut(self, *, at_end: bool) -> None:
        """Remove half of the window. After each success, remove as much again; after a failure, try half as much."""
        step = _length(self.window) // 2
        while step >= 1 and _length(self.window) - step >= MIN_FRAMES:
            first, end = self.window
            shorter = (first, end - step) if at_end else (first + step, end)
            if self._try(shorter):
                continue
            step //= 2
            if step < (end - first) * MIN_STEP_SHARE:
                return

    def remove(self, nuisances: Sequence[Nuisance]) -> None:
        """Remove all nuisances at once, or one after the other if the case does not fail without all of them."""
        names = [nuisance.name for nuisance in nuisances]
        if not names or self._try(self.window, names) or len(names) == 1:
            return
        for name in names:
            self._try(self.window, [*self.removed, name])

    def _try(self, window: Window, removed: Sequence[str] = ()) -> bool:
        """Run a variant of the case, and keep it if it fails in the same way."""
        if self._trials_left == 0:
            raise _TrialsUsedUp
        self._trials_left -= 1
        is_failure = self._fails(self._variant(window, removed))
        description = f"frames {window[0]} to {window[1] - 1}"
        if removed:
            description += f" without {', '.join(removed)}"
        self.tried.append(TriedPart(description, is_failure))
        if is_failure:
            self.window = window
            self.removed = [*removed]
        return is_failure

    def _variant(self, window: Window, removed: Sequence[str]) -> Case:
        return replace(without(self._original, removed), frames=window)


def _length(window: Window) -> int:
    first, end = window
    return end - first


def middle_of_first_run(is_set: Sequence[bool]) -> int | None:
    """The index in the middle of the first run of true values; None if there is none."""
    if True not in is_set:
        return None
    first = is_set.index(True)
    run_length = sum(1 for _ in takewhile(bool, is_set[first:]))
    return first + run_length // 2
