"""Keyframes of the path through a place that is rebuilt."""

import numpy as np
import pytest

from tests.analysis.pictures import DISPARITY_PX, pair
from vobench.analysis import recorded_place
from vobench.analysis.recorded_place import keyframe_indices
from vobench.errors import InputError
from vobench.geometry import se3


def test_keyframes_follow_the_motion_of_the_image() -> None:
    width_px = pair().left.camera.width_px
    step_px = recorded_place.STEP_SHARE * width_px / 2.2  # every third frame is a keyframe
    step_m = step_px / pair().K[0, 0] * (pair().focal_baseline / DISPARITY_PX)
    still = np.tile(np.eye(4), (5, 1, 1))
    moving = np.stack([se3.transform(np.eye(3), [step_m * index, 0, 0]) for index in range(10)])
    assert keyframe_indices(moving, pair(), typical_disparity_px=DISPARITY_PX) == [0, 3, 6, 9]
    assert keyframe_indices(still, pair(), typical_disparity_px=DISPARITY_PX) == [0, 4]
    turning = np.stack([se3.transform(se3.rotation_z(0.02 * index), np.zeros(3)) for index in range(10)])
    assert len(keyframe_indices(turning, pair(), typical_disparity_px=DISPARITY_PX)) > 4


def test_a_path_that_is_too_long_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_place, "MOST_KEYFRAMES", 5)
    moving = np.stack([se3.transform(np.eye(3), [0.2 * index, 0, 0]) for index in range(10)])
    with pytest.raises(InputError, match="10 images, more than 5"):
        keyframe_indices(moving, pair(), typical_disparity_px=DISPARITY_PX)
