"""Keyframes of the path through a place that is rebuilt."""

from pathlib import Path

import numpy as np
import pytest

from tests.analysis.pictures import DISPARITY_PX, pair
from vobench.analysis import recorded_place
from vobench.analysis.path_placement import WantedDisparities
from vobench.analysis.recorded_place import keyframe_indices, own_placement, recorded_scene
from vobench.errors import InputError
from vobench.geometry import se3


def test_keyframes_follow_the_motion_of_the_image() -> None:
    width_px = pair().left.camera.width_px
    step_px = recorded_place.STEP_SHARES[0] * width_px / 2.2  # every third frame is a keyframe
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
    with pytest.raises(InputError, match="10 images, more than 5; take a part of it, as by --frames 0:5"):
        keyframe_indices(moving, pair(), typical_disparity_px=DISPARITY_PX)


def test_keyframes_of_a_long_path_are_farther_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    step_px = recorded_place.STEP_SHARES[0] * pair().left.camera.width_px * 1.1
    step_m = step_px / pair().K[0, 0] * (pair().focal_baseline / DISPARITY_PX)
    moving = np.stack([se3.transform(np.eye(3), [step_m * index, 0, 0]) for index in range(11)])
    assert keyframe_indices(moving, pair(), typical_disparity_px=DISPARITY_PX) == list(range(11))
    monkeypatch.setattr(recorded_place, "MOST_KEYFRAMES", 6)
    assert keyframe_indices(moving, pair(), typical_disparity_px=DISPARITY_PX) == [0, 2, 4, 6, 8, 10]


@pytest.mark.parametrize(("nearness", "is_refused"), [(1.4, False), (1.6, True)])
def test_a_rebuilt_place_that_is_too_near_is_refused(monkeypatch: pytest.MonkeyPatch, nearness, is_refused) -> None:
    for name in ("build", "triangles", "RayCaster"):
        monkeypatch.setattr(recorded_place, name, lambda *_: None)
    monkeypatch.setattr(recorded_place, "misfit_of", lambda *_: 0.1)
    monkeypatch.setattr(recorded_place, "nearness_of", lambda *_: nearness)
    scene = recorded_scene(Path("recorded.glb"))
    wanted = WantedDisparities.of_cells(np.full((1, 3, 3), DISPARITY_PX))
    if is_refused:
        with pytest.raises(InputError, match=r"cannot be rebuilt: surfaces are 1\.6 times as near"):
            own_placement(scene, np.eye(4)[None], pair(), wanted)
    else:
        assert own_placement(scene, np.eye(4)[None], pair(), wanted).nearness == nearness
