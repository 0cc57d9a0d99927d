"""Costs, reasons and dropped frames of an estimator on a case."""

from dataclasses import replace

from vobench.report.frame_statistics import EstimatorStatistics, summarize_frames
from vobench.runner.frames import FrameRow


def frames(*reasons):
    return [
        FrameRow(10 + k, k, "lost", reason, None, None, None, None, None, None, "{}", 1.0, 2.0)
        for k, reason in enumerate(reasons)
    ]


def test_the_commonest_reason_of_frames_is_counted_whatever_its_numbers():
    rows = frames("", "blurred", "too few tracks (7)", "", "too few tracks (-1.5e3)", "too few tracks")
    assert summarize_frames([rows]) == EstimatorStatistics(2.0, "too few tracks (7)", 2, 12, frames=6)


def test_frames_without_a_reason_have_none_and_no_frame_no_answer():
    assert summarize_frames([frames("", ""), []]) == EstimatorStatistics(2.0, frames=2)
    assert summarize_frames([[], []]) == EstimatorStatistics()


def test_the_offset_of_disparities_is_that_of_the_last_frame_and_the_median_over_trials():
    def trial(*stated):
        return [replace(frame, stats=stats) for frame, stats in zip(frames(*[""] * len(stated)), stated, strict=True)]

    found = [trial("{}", f'{{"offset_px": {offset_px}}}') for offset_px in (0.5, -0.1, 0.9)]
    assert summarize_frames(found).offset_px == 0.5
    assert summarize_frames([trial('{"offset_px": 0.5}', "{}")]).offset_px is None
    assert summarize_frames([trial("", '{"offset_px": 0}')]).offset_px is None
    assert summarize_frames([trial('{"offset_px": "far"}')]).offset_px is None


def row(frame, status="ok", *, cpu_ms=None, memory_mib=None, reason=""):
    return FrameRow(frame, frame, status, reason, None, None, None, None, None, None, "", None, cpu_ms, memory_mib)


def statuses(*words):
    return [row(index, word) for index, word in enumerate(words)]


def test_consecutive_dropped_frames_have_one_late_answer():
    late = summarize_frames([statuses("ok", "dropped", "dropped", "ok", "dropped"), statuses("ok", "dropped")])
    assert (late.frames, late.dropped, late.late) == (7, 4, 3)
    on_time = summarize_frames([statuses("ok", "lost", "ok")])
    assert (on_time.frames, on_time.dropped, on_time.late) == (3, 0, 0)


def test_the_last_frame_of_a_trial_and_the_first_of_the_next_are_no_neighbours():
    assert summarize_frames([statuses("ok"), statuses("dropped")]).late == 0


def test_cpu_time_is_a_mean_and_memory_a_maximum_over_all_trials():
    trials = [[row(0, cpu_ms=1.0, memory_mib=30.0), row(1)], [row(0, cpu_ms=4.0, memory_mib=20.0)]]
    found = summarize_frames(trials)
    assert (found.ms_per_frame, found.memory_mib) == (2.5, 30.0)


def test_of_equally_common_reasons_the_first_in_alphabetical_order_is_taken_with_its_first_frame():
    rows = [row(5, reason="blurred 9"), row(3, reason="dark"), row(2, reason="blurred 1"), row(1, reason="dark")]
    found = summarize_frames([rows])
    assert (found.reason, found.count, found.first) == ("blurred 1", 2, 2)
    commoner = summarize_frames([[*rows, row(9, reason="dark")]])
    assert (commoner.reason, commoner.count, commoner.first) == ("dark", 3, 1)


def test_statistics_of_nothing_are_all_empty():
    assert summarize_frames([]) == EstimatorStatistics()
    assert replace(EstimatorStatistics(), frames=1) != EstimatorStatistics()
