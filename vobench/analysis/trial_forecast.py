"""Forecasts how many trials an explanation runs, and how long they take."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from vobench.analysis.explain import Effort
from vobench.runner.frames import read_frames
from vobench.runner.store import Progress

MS_PER_S = 1e3
SECONDS_TO_SAY = 5.0  # a stage that took less needs no forecast


@dataclass(slots=True)
class TrialForecast:
    """Says how many trials an explanation runs, and how long the rest may take by the trials so far.

    `count` is the number of things that are removed, and `removed` what they are called. `seconds_per_trial` is an
    estimate for the first stage; None if there is none. `parts` is the largest number of parts of one of them.
    """

    progress: Progress
    seeds: Effort
    count: int
    seconds_per_trial: float | None
    removed: str
    parts: int = 0
    done: int = 0
    seconds: float = 0.0

    @contextmanager
    def stage(self, trials: int) -> Iterator[None]:
        """Announce a stage of the explanation, and measure how long it takes."""
        self.progress.say(self._sentence(trials))
        began_s = time.monotonic()
        yield
        self.seconds += time.monotonic() - began_s
        self.done += trials

    def _sentence(self, trials: int) -> str:
        most = self.seeds.most_trials(self.count, self.parts)
        numbers = f"trials {self.done + 1} to {self.done + trials} of at most {most}"
        if self.done == 0:
            seconds_per_trial = self.seconds_per_trial
            duration = "" if seconds_per_trial is None else f", about {trials * seconds_per_trial:.0f} s"
            each = f"each of {self.count} {self.removed} removed, with {self.seeds.screening} seeds"
            return f"{numbers}{duration}: {each}"
        if self.seconds < SECONDS_TO_SAY:
            return numbers
        return f"{numbers}, about {trials * self.seconds / self.done:.0f} s"


def estimator_seconds(trial: Path) -> float:
    """How long the estimator took for all frames of the trial in a folder."""
    return sum(row.wall_ms or 0.0 for row in read_frames(trial)) / MS_PER_S
