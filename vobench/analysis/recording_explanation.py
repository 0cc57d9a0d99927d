"""The answer to why an estimator fails in a part of a recording, in sentences."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from vobench.analysis.explanation import Change, Explanation
from vobench.analysis.frame_failure import Coincidence, Frames
from vobench.analysis.picture_change import CHANGE_TEXTS, INSTEAD, PictureChange
from vobench.geometry.se3 import Array

TRUSTED_OVERLAP = 0.6  # of errors in time: a twin with less does not count, ...
TRUSTED_P = 0.1  # nor does one whose overlap a larger share of shifts in time reaches


@dataclass(frozen=True, slots=True)
class FailingFrames:
    """The F frames of the worst part of a recording: their times since its start, and which of them fail.

    `time_s` and `loss` are (F,): time, and error around each frame. `typical` is the median error of the other frames
    of the recording. `is_failing` (F,) are the frames whose error is far above that.
    """

    time_s: Array
    loss: Array
    typical: float
    is_failing: Frames

    @property
    def span_s(self) -> tuple[float, float]:
        """The times of the first and the last failing frame."""
        failing_s = self.time_s[self.is_failing]
        return float(failing_s[0]), float(failing_s[-1])


@dataclass(frozen=True, slots=True)
class TwinTrials:
    """What the estimator does in the twin: its errors at the same F frames, and what removing each change does.

    `loss` and `unchanged_loss` (F,) are the mean errors around each frame, with all changes and without any.
    `coincidence` compares when the recording's error is above the usual one, and when the changes raise the twin's.
    `scale` is the factor by which the place was enlarged, and `misfit` the mean error of the logarithm of disparities.
    """

    loss: Array
    unchanged_loss: Array
    coincidence: Coincidence
    explanation: Explanation
    scale: float
    misfit: float


@dataclass(frozen=True, slots=True)
class RecordingExplanation:
    """Why an estimator fails in the worst part of a recording.

    `is_stand_in` states that the estimator in the twin is not the one that the estimate comes from. `changes` are the
    properties in which the images differ from the rest of the recording. There is no twin if there are none.
    """

    estimator: str
    is_stand_in: bool
    frames: FailingFrames
    changes: tuple[PictureChange, ...]
    twin: TwinTrials | None

    @property
    def overlap(self) -> float:
        """How far the errors of the recording and of its twin occur at the same times; see `Coincidence`."""
        return 0.0 if self.twin is None else self.twin.coincidence.overlap

    @property
    def is_trusted(self) -> bool:
        """Whether the changes raise the twin's error when the recording's is large, more than by chance."""
        if self.twin is None:
            return False
        return self.overlap >= TRUSTED_OVERLAP and self.twin.coincidence.p <= TRUSTED_P

    @property
    def named(self) -> tuple[str, ...]:
        """The changes that explain the failure in a twin that is trusted; empty if none does."""
        if self.twin is None or not self.is_trusted:
            return ()
        explanation = self.twin.explanation
        alternatives = [name for removed in explanation.alternatives for name in removed]
        return (*explanation.named, *alternatives)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What fails, why and what to do; how far the twin is to be trusted; and what was seen in the images."""
        sentences = [self._answer()]
        if self.twin is not None:
            sentences += _trust_sentences(self, self.twin)
        sentences += [f"In the images: {change.evidence}." for change in self.changes]
        if self.is_stand_in:
            sentences.append(f"{self.estimator} stands in for the estimator that the estimate comes from.")
        found = {change.name for change in self.changes}
        unchanged = [name for name in INSTEAD if name not in found]
        if unchanged:
            sentences.append(f"Not found in these frames: {', '.join(unchanged)}.")
        return tuple(sentences)

    def _answer(self) -> str:
        """What fails, why, what removes it, and what to do, in one sentence."""
        begin_s, end_s = self.frames.span_s
        whose = "The estimate" if self.is_stand_in else self.estimator
        symptom = f"{whose} fails at {begin_s:.1f} to {end_s:.1f} s"
        if self.twin is None:
            return (
                f"{symptom}, but the images there are as sharp, clean, bright and complete as elsewhere: "
                "the cause is unknown (the motion, what is in view, or the estimator)."
            )
        seen = " and ".join(CHANGE_TEXTS[change.name].because for change in self.changes)
        if not self.is_trusted:
            return f"{symptom}, where {seen}, but its twin does not fail at the same times: the cause is not confirmed."
        if not self.named:
            return f"{symptom}, where {seen}, but in the twin no removal of these surely helps: the cause is unknown."

        explanation = self.twin.explanation
        reasons = " and ".join(CHANGE_TEXTS[name].because for name in self.named)
        advice = "; ".join(CHANGE_TEXTS[name].advice for name in self.named)
        change = _change_of(explanation, explanation.named)
        instead = " and ".join(INSTEAD[name] for name in change.removed)
        interval = f"95 % CI {change.low:.0%} to {change.high:.0%}"
        return (
            f"{symptom} because {reasons}. With {instead}, the error in the twin drops by {change.reduction:.0%} "
            f"({interval}) and {change.survived} of {change.repeats} runs end well: {advice}."
        )

    def rows(self) -> list[dict[str, Any]]:
        """One row for each change that was removed from the twin; empty if there is no twin."""
        if self.twin is None:
            return []
        explanation = self.twin.explanation
        return [asdict(change) for change in (*explanation.singles, *explanation.pairs)]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench explain --json` prints them."""
        begin_s, end_s = self.frames.span_s
        facts: dict[str, Any] = {
            "estimator": self.estimator,
            "is_stand_in": self.is_stand_in,
            "fails_from_s": begin_s,
            "fails_to_s": end_s,
            "failing_frames": int(self.frames.is_failing.sum()),
            "typical_error": self.frames.typical,
            "named": self.named,
            "changes": {change.name: change.evidence for change in self.changes},
            "sentences": self.sentences,
        }
        if self.twin is not None:
            facts["overlap"] = self.overlap
            facts["overlap_by_chance"] = self.twin.coincidence.by_chance
            facts["overlap_p"] = self.twin.coincidence.p
            facts["is_trusted"] = self.is_trusted
            facts["explanation"] = asdict(self.twin.explanation)
            facts["place"] = {"scale": self.twin.scale, "misfit": self.twin.misfit}
        return facts


def _change_of(explanation: Explanation, removed: Sequence[str]) -> Change:
    changes: Mapping[tuple[str, ...], Change] = {
        change.removed: change for change in (*explanation.singles, *explanation.pairs)
    }
    return changes[tuple(removed)]


def _trust_sentences(found: RecordingExplanation, twin: TwinTrials) -> list[str]:
    """How far the twin resembles the recording."""
    is_failing = found.frames.is_failing
    recorded_loss = float(found.frames.loss[is_failing].mean())
    in_others = "" if is_failing.all() else f", and that of the others {_rise(twin, ~is_failing)}"
    coincidence = twin.coincidence
    trusted = "trusted" if found.is_trusted else "not trusted"
    return [
        f"The simulated twin of these seconds is {trusted}: its errors overlap in time with the recording's by "
        f"{coincidence.overlap:.2f} (at least {TRUSTED_OVERLAP} is asked). Shifted in time, they do by "
        f"{coincidence.by_chance:.2f} on average, and as much for {coincidence.p:.0%} of the shifts (at most "
        f"{TRUSTED_P:.0%} is asked).",
        f"The recording fails in {is_failing.sum()} frames, with a mean error of {recorded_loss:.1%}. In the twin, the "
        f"differences raise the error of these frames {_rise(twin, is_failing)}{in_others}.",
        f"The twin's place is scaled by {twin.scale:g}, and its disparities differ by {twin.misfit:.0%}.",
    ]


def _rise(twin: TwinTrials, frames: Frames) -> str:
    """The mean error of some frames of the twin without and with the differences."""
    unchanged_loss = float(twin.unchanged_loss[frames].mean())
    loss = float(twin.loss[frames].mean())
    return f"from {unchanged_loss:.1%} to {loss:.1%}"
