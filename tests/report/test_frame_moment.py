"""The frames of a trial that are worth a look."""

from dataclasses import replace

import numpy as np

from vobench.report.frame_moment import LEAST_GAP_FRAMES, FrameMoment, worst_moments
from vobench.runner.frames import FrameRow


def rows(errors, statuses):
    known = enumerate(zip(errors, statuses, strict=True))
    return [FrameRow(k, k * 10**9, s, "", e, None, None, None, None, None, "", None, None) for k, (e, s) in known]


def test_the_worst_moments_are_where_track_was_lost_the_largest_error_and_its_largest_jump_well_apart():
    errors = np.ones(60)
    errors[40], errors[20:30] = 9, np.inf
    errors[50:] = 5
    frames = rows(errors, ["lost" if np.isinf(e) else "ok" for e in errors])
    found = [(moment.frame, moment.why) for moment in worst_moments(frames, errors)]
    assert found == [(20, "lost"), (40, "large error"), (50, "jump")]
    assert worst_moments([], np.zeros(0)) == []


def errors_of(count, **at):
    """Small equal errors but for some frames, by e<index>."""
    errors_m = np.ones(count)
    for name, value in at.items():
        errors_m[int(name.removeprefix("e"))] = value
    return errors_m


def whys(errors_m, statuses=None):
    frames = rows(errors_m, statuses or ["ok"] * len(errors_m))
    return [(moment.frame, moment.why) for moment in worst_moments(frames, errors_m)]


def test_equal_errors_have_a_largest_one_and_no_jump():
    assert whys(np.ones(20)) == [(0, "large error")]
    assert whys(np.zeros(20)) == []
    assert whys(np.full(20, np.inf)) == []


def test_the_first_frame_cannot_be_lost():
    assert whys(np.zeros(20), ["lost"] + ["ok"] * 19) == []
    assert whys(np.zeros(20), ["ok", "lost"] + ["ok"] * 18) == [(1, "lost")]
    assert whys(np.zeros(20), ["ok"] * 9 + [""] + ["ok"] * 10) == [(9, "lost")]


def test_moments_are_apart_by_the_least_gap_and_no_more():
    close = 10 + LEAST_GAP_FRAMES - 1
    statuses = ["ok"] * 10 + ["lost"] + ["ok"] * 29
    assert whys(errors_of(40, **{f"e{close}": 9.0, "e30": 5.0}), statuses)[1] == (30, "large error")
    assert whys(errors_of(40, **{f"e{close + 1}": 9.0, "e30": 5.0}), statuses)[1] == (close + 1, "large error")


def test_a_time_counts_from_the_first_frame_and_a_number_is_the_frames():
    errors_m = np.array([0.0, 0.0, 3.0])
    frames = []
    for index, row in enumerate(rows(errors_m, ["ok"] * 3)):
        frames.append(replace(row, frame=7 + index, t_ns=5 * 10**9 + row.t_ns // 3))
    (moment,) = worst_moments(frames, errors_m)
    assert moment == FrameMoment(frame=9, t_s=0.67, why="large error")


def test_six_frames_are_enough_between_two_moments():
    statuses = ["ok"] * 10 + ["lost"] + ["ok"] * 29
    assert whys(errors_of(40, e16=9.0), statuses)[:2] == [(10, "lost"), (16, "large error")]
