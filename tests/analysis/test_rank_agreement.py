"""Orders of estimators are compared by errors that are known."""

import numpy as np
import pytest

from vobench.analysis.rank_agreement import LOST_PERCENT, agreement, segment_errors
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory


def walk(scale: float = 1.0, drift: float = 0.0) -> Trajectory:
    places = np.stack([np.linspace(0, 10, 100), np.linspace(0, 10, 100) ** 2 * drift, np.zeros(100)], -1)
    return Trajectory(np.arange(100) * 10**8, se3.transform(np.eye(3), places * scale))


def test_an_error_of_scale_is_that_share_of_every_segment():
    errors = segment_errors(walk(), walk(1.02))
    assert np.nanmin(errors) == pytest.approx(2)
    assert np.nanmax(errors) == pytest.approx(2)
    assert np.nanmax(segment_errors(walk(), walk(1.02), scaled=True)) < 1e-6


def test_a_missing_pose_is_a_lost_segment():
    half = Trajectory(walk().t_ns[:50], walk().T_world_frame[:50])
    errors = segment_errors(walk(), half)
    assert np.nanmax(errors) == LOST_PERCENT
    assert np.isfinite(errors).sum() == np.isfinite(segment_errors(walk(), walk())).sum()
    nothing = segment_errors(walk(), Trajectory(half.t_ns[:0], half.T_world_frame[:0]))
    assert np.nanmin(nothing) == LOST_PERCENT


def test_equal_orders_have_tau_1_and_reversed_ones_minus_1():
    drifts = {name: segment_errors(walk(), walk(1 + 0.01 * n)) for n, name in enumerate("abcdef", 1)}
    same = agreement(drifts, drifts)
    assert [same.tau, same.low, same.high] == pytest.approx([1, 1, 1])
    turned = dict(zip(drifts, reversed(drifts.values()), strict=True))
    assert agreement(drifts, turned).tau == pytest.approx(-1)
    with pytest.raises(InputError, match="3 estimators or more"):
        agreement(drifts, {"a": drifts["a"]})
