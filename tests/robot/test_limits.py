"""A drive train's limits hold at every instant, and cost order only where they begin and end to act."""

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.robot.controller import CONTROLLERS
from vobench.robot.drive import drive
from vobench.robot.limits import TOOLBOX, UNLIMITED, AccelerationLimits

COURSE = ((1, 1), (0, 1))
TIGHT = AccelerationLimits(0.3, 1.0)


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("ideal", [False, True])
def test_no_acceleration_is_over_its_limit(controller: str, ideal: bool) -> None:
    options = {"theta": None} if ideal else {}
    run = drive(COURSE, controller=CONTROLLERS[controller], limits=TIGHT, **options)
    rate = np.diff(run.state[:, 3:], axis=0) * 30
    assert (np.abs(rate) <= np.array([0.3, 1.0]) * (1 + 1e-9)).all()
    assert np.abs(rate).max(0) == pytest.approx([0.3, 1.0])


def test_limits_that_are_never_reached_change_nothing_to_the_last_bit() -> None:
    np.testing.assert_array_equal(drive(COURSE, limits=AccelerationLimits(1e3, 1e3)).state, drive(COURSE).state)


def test_for_arrays_they_are_the_same_as_for_one_instant() -> None:
    rates = np.random.default_rng(0).uniform(-2, 2, (2, 20))
    held = np.array(TIGHT.held(*rates))
    np.testing.assert_array_equal(held.T, [TIGHT.held(u, w) for u, w in rates.T.tolist()])
    assert UNLIMITED.held(3.0, -4.0) == (3.0, -4.0)


def test_errors_still_fall_with_the_step_as_its_square_or_faster() -> None:
    ends = {n: drive(COURSE, limits=TOOLBOX, substeps=n, leg_s=3.0).state for n in (1, 8, 64)}
    coarse, fine = (np.abs(ends[n] - ends[64]).max() for n in (1, 8))
    assert fine < coarse / 8**2
    assert fine < 1e-5


@pytest.mark.parametrize("bad", [(0.0, 1.0), (1.0, -1.0), (float("nan"), 1.0)])
def test_a_limit_that_is_not_positive_is_refused(bad: tuple[float, float]) -> None:
    with pytest.raises(MotionError, match=r"acceleration limit .* must be positive"):
        AccelerationLimits(*bad)
