"""The frames of a recording that its worst part is compared with."""

from itertools import pairwise

import numpy as np
import pytest

from vobench.analysis.frame_failure import FrameRange
from vobench.analysis.recording_part import frames_of_run, read_parts, reference_runs
from vobench.errors import InputError
from vobench.runner.recording import read_recording


def test_reference_runs_lie_outside_of_the_window_and_no_frame_of_them_fails() -> None:
    is_failing = np.zeros(200, bool)
    is_failing[[5, 60, 150]] = True
    window = FrameRange(80, 130)
    runs = reference_runs(window, is_failing, 14)
    assert len(runs) == 4
    for run in runs:
        assert len(run) == 14
        assert not is_failing[run.frames].any()
        assert run.end <= window.first or run.first >= window.end
    for before, after in pairwise(runs):
        assert before.end <= after.first
    assert runs[0].first < 40
    assert runs[-1].end > 170


def test_a_recording_with_too_few_other_frames_is_refused() -> None:
    with pytest.raises(InputError, match=r"28 other frames or more .* has 14 in runs of 14"):
        reference_runs(FrameRange(0, 50), np.zeros(70, bool), 14)


def test_the_frames_of_windows_are_read_with_their_true_poses(recorded_case) -> None:
    recording = read_recording(recorded_case)
    first, second = read_parts(recording, recording.t_ns, [FrameRange(3, 6), FrameRange(8, 9)])
    assert first.t_ns.tolist() == recording.t_ns[3:6].tolist()
    assert len(second) == 1
    frames = list(recording.frames())
    assert (first.shots[2].left == frames[5].left).all()
    assert (first.shots[2].right == frames[5].right).all()
    expected = recording.truth.T_world_frame[recording.truth.t_ns == recording.t_ns[5]][0] @ recording.rig.T_body_left
    np.testing.assert_allclose(first.shots[2].T_world_left, expected, atol=1e-9)


def test_a_run_has_14_frames_or_lasts_two_seconds() -> None:
    assert frames_of_run(200_000_000) == 14
    assert frames_of_run(50_000_000) == 40
