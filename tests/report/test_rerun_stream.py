"""Rows of a recording at the right frames."""

import numpy as np
import pytest

from vobench.report.rerun_stream import FrameStream, time_columns

STEP_NS = 33_000_000
T_NS = np.arange(8, dtype=np.int64) * STEP_NS


class Recorder:
    """Takes what would be sent to Rerun."""

    def __init__(self):
        self.sent = []

    def send_columns(self, entity, times, columns):
        frame, elapsed = times
        self.sent.append((entity, frame.times.to_pylist(), elapsed.times.to_pylist(), columns))


def match(t_ns, frames_ns=T_NS):
    frames, samples = FrameStream(None, frames_ns).match(np.array(t_ns, np.int64))
    return frames.tolist(), samples.tolist()


def test_each_frame_matches_a_sample_of_the_same_stamp():
    assert match(T_NS) == (list(range(8)), list(range(8)))
    assert match(T_NS[[1, 5]]) == ([1, 5], [0, 1])
    assert match([]) == ([], [])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_sample_matches_up_to_half_the_time_between_frames(sign):
    half_ns = STEP_NS // 2
    assert match(T_NS[2:6] + sign * (half_ns - 1)) == ([2, 3, 4, 5], [0, 1, 2, 3])
    assert match(T_NS[3:4] + sign * half_ns) == ([], [])


def test_of_two_samples_the_nearer_one_matches():
    close = [T_NS[3] - 2000, T_NS[3] + 1000]
    assert match(close) == ([3], [1])
    assert match([T_NS[3] - 1000, T_NS[3] + 2000]) == ([3], [0])


def test_a_single_frame_matches_within_half_a_second():
    one = np.array([10**9], np.int64)
    assert match([10**9 + 400_000_000], one) == ([0], [0])
    assert match([10**9 + 600_000_000], one) == ([], [])


def test_rows_have_the_number_and_the_time_of_their_frames():
    recorder = Recorder()
    log = FrameStream(recorder, T_NS, first=100)
    log.columns("entity", np.array([2, 5]), "columns")
    ((entity, frames, elapsed_ns, columns),) = recorder.sent
    assert (entity, columns) == ("entity", "columns")
    assert frames == [102, 105]
    assert [value.total_seconds() for value in elapsed_ns] == pytest.approx([2 * STEP_NS / 1e9, 5 * STEP_NS / 1e9])


def test_no_frames_send_nothing_and_every_sends_all():
    recorder = Recorder()
    log = FrameStream(recorder, T_NS)
    log.columns("entity", np.zeros(0, np.int64), "columns")
    assert recorder.sent == []
    log.every("entity", "columns")
    assert recorder.sent[0][1] == list(range(log.count)) == list(range(8))


def test_time_lines_are_frame_and_t():
    assert [column.timeline for column in time_columns(np.array([1]), np.array([5]))] == ["frame", "t"]
