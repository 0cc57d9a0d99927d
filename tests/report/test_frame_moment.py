"""The frames of a trial that are worth a look."""

import numpy as np

from vobench.report.frame_moment import worst_moments
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
