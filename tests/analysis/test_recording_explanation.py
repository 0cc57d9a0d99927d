"""The answer about a recording, in sentences."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.changes import change
from vobench.analysis.explanation import Explanation
from vobench.analysis.frame_failure import coincidence
from vobench.analysis.picture_change import BLUR, DROPPED, NOISE, Blur, MissingFrames
from vobench.analysis.recording_explanation import FailingFrames, RecordingExplanation, TwinTrials

FRAMES = 50
BLURRED = Blur("edges are 6.0 px wide in both images of 20 of 50 frames, and 2.0 px elsewhere", np.ones((FRAMES, 2)))


def failing(first: int, end: int) -> np.ndarray:
    is_failing = np.zeros(FRAMES, bool)
    is_failing[first:end] = True
    return is_failing


def explanation(*singles, everything=None) -> Explanation:
    return Explanation(0.4, "ok", True, everything or singles[0], singles, {}, (), 18)


def answer(
    *, twin_frames: tuple[int, int] = (12, 32), found: Explanation | None = None, **parts
) -> RecordingExplanation:
    is_failing = failing(10, 30)
    frames = FailingFrames(5.0 + np.arange(FRAMES) / 10, np.where(is_failing, 0.4, 0.01), 0.01, is_failing)
    in_twin = failing(*twin_frames)
    twin = TwinTrials(
        loss=np.where(in_twin, 0.3, 0.01),
        unchanged_loss=np.full(FRAMES, 0.01),
        coincidence=coincidence(is_failing.astype(float), in_twin.astype(float)),
        explanation=found or explanation(change(BLUR, reduction=0.8)),
        scale=1.4,
        misfit=0.12,
    )
    given = {"estimator": "mine", "is_stand_in": False, "frames": frames, "changes": (BLURRED,), "twin": twin}
    return RecordingExplanation(**{**given, **parts})


def test_the_first_sentence_says_what_fails_when_why_and_what_to_do() -> None:
    found = answer()
    assert found.named == (BLUR,)
    assert found.sentences[0] == (
        "mine fails at 6.0 to 7.9 s because the images are blurred. With sharp images, the error in the twin drops by "
        "80% (95 % CI 10% to 90%) and 1 of 6 runs end well: focus the lens, expose shorter, or vibrate less."
    )


def test_it_is_said_how_far_the_twin_is_to_be_trusted_and_what_was_seen() -> None:
    found = answer()
    assert found.overlap == pytest.approx(18 / 22)
    assert found.sentences[1:3] == (
        "The simulated twin of these seconds is trusted: its errors overlap in time with the recording's by 0.82 (at "
        "least 0.6 is asked). Shifted in time, they do by 0.31 on average, and as much for 10% of the shifts (at most "
        "10% is asked).",
        "The recording fails in 20 frames, with a mean error of 40.0%. In the twin, the differences raise the error of "
        "these frames from 1.0% to 27.1%, and that of the others from 1.0% to 2.9%.",
    )
    assert f"In the images: {BLURRED.evidence}." in found.sentences
    assert found.sentences[-1].startswith("Not found in these frames: noisy images, exposure jumps,")


def test_where_all_frames_fail_there_is_no_sentence_about_others() -> None:
    found = answer()
    all_fail = replace(found, frames=replace(found.frames, is_failing=np.ones(FRAMES, bool)))
    (sentence,) = [sentence for sentence in all_fail.sentences if "raise the error" in sentence]
    assert sentence.endswith("raise the error of these frames from 1.0% to 12.6%.")


def test_a_twin_that_fails_elsewhere_names_nothing() -> None:
    found = answer(twin_frames=(25, 45))
    assert not found.is_trusted
    assert found.named == ()
    assert "its twin does not fail at the same times: the cause is not confirmed" in found.sentences[0]


def test_a_twin_that_fails_throughout_as_the_recording_does_names_nothing() -> None:
    found = answer()
    assert found.twin is not None
    throughout = coincidence(np.ones(FRAMES), np.ones(FRAMES))
    found = replace(found, twin=replace(found.twin, coincidence=throughout))
    assert found.overlap == pytest.approx(1)
    assert not found.is_trusted
    assert found.named == ()


def test_a_removal_that_does_not_help_names_nothing() -> None:
    found = answer(found=explanation(change(BLUR, reduction=0.1, is_sure=False)))
    assert found.named == ()
    assert "no removal of these surely helps: the cause is unknown" in found.sentences[0]


def test_images_that_do_not_differ_leave_the_cause_unknown() -> None:
    found = answer(changes=(), twin=None)
    assert found.named == ()
    assert found.rows() == []
    assert "as sharp, clean, bright and complete as elsewhere: the cause is unknown" in found.sentences[0]


def test_of_two_changes_the_one_that_explains_it_is_named() -> None:
    both = change(BLUR, DROPPED, reduction=0.85)
    found = answer(
        changes=(BLURRED, MissingFrames("3 of 50 frames are missing by their stamps")),
        found=explanation(change(BLUR, reduction=0.8), change(DROPPED, reduction=0.05, is_sure=False), everything=both),
    )
    assert found.named == (BLUR,)
    assert [row["removed"] for row in found.rows()] == [(BLUR,), (DROPPED,)]


def test_alternatives_are_named_as_well() -> None:
    found = answer(found=explanation(change(BLUR, reduction=0.8), change(NOISE, reduction=0.7)))
    assert found.named == (BLUR, NOISE)
    assert "because the images are blurred and the images are noisy. With sharp images" in found.sentences[0]


def test_a_stand_in_is_called_one() -> None:
    found = answer(is_stand_in=True)
    assert found.sentences[0].startswith("The estimate fails at 6.0 to 7.9 s")
    assert "mine stands in for the estimator that the estimate comes from." in found.sentences


def test_the_dictionary_is_plain() -> None:
    facts = json.loads(json.dumps(answer().as_dict()))
    assert facts["named"] == [BLUR]
    assert facts["overlap"] == pytest.approx(18 / 22)
    assert facts["overlap_by_chance"] < facts["overlap"]
    assert facts["overlap_p"] == pytest.approx(0.1)
    assert (facts["fails_from_s"], facts["fails_to_s"], facts["failing_frames"]) == (6.0, pytest.approx(7.9), 20)
    assert "overlap" not in replace(answer(), changes=(), twin=None).as_dict()
