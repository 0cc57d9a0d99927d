"""Slip has streams of its own, and settings within bounds."""

import pytest

from vobench.errors import SettingError
from vobench.motion.disturbance import DISTURBANCE_STREAMS
from vobench.motion.slip import SLIP_STREAMS, SlipSettings


def test_the_streams_of_slip_are_the_first_of_a_drives() -> None:
    assert DISTURBANCE_STREAMS[:3] == SLIP_STREAMS
    assert len(set(DISTURBANCE_STREAMS)) == len(DISTURBANCE_STREAMS)


@pytest.mark.parametrize(
    "bad",
    [
        {"ratio_std": -0.1},
        {"ratio_std": 0.5},
        {"correlation_s": 0.0},
        {"skid_s": float("nan")},
        {"traction_s2pm": -0.1},
    ],
)
def test_settings_out_of_range_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(SettingError, match=f"^{next(iter(bad))}: should be"):
        SlipSettings(**bad)
