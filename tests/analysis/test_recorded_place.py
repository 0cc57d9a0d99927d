"""Keyframes of the path through a place that is rebuilt."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.analysis.pictures import DISPARITY_PX, pair, view
from tests.analysis.test_keyframe_depth import shots_along_the_wall
from vobench.analysis import recorded_place
from vobench.analysis.path_placement import WantedDisparities
from vobench.analysis.recorded_place import RebuiltPlace, keyframe_indices, own_placement
from vobench.analysis.stereo_matches import match_shots
from vobench.asset.luminous_model import Surface, write_luminous_model
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


def test_one_image_that_is_too_near_is_not_enough_to_refuse(tmp_path: Path) -> None:
    place = place_with_a_wall_at(pair().focal_baseline / (0.8 * DISPARITY_PX), tmp_path, count=8)
    T_world_left = np.stack([matched.shot.T_world_left for matched in place.matched])
    wanted = WantedDisparities.of_cells(np.full((1, 3, 3), float(DISPARITY_PX)))
    first, *others = place.matched
    halved = replace(first, disparity_px=first.disparity_px / 2)
    placement = own_placement(replace(place, matched=(halved, *others)), T_world_left, pair(), wanted)
    assert placement.nearness == pytest.approx(1.6, rel=0.03)


def place_with_a_wall_at(depth_m: float, folder: Path, *, count: int = 3) -> RebuiltPlace:
    """A place with a wall in front of the path, and images of a wall with a disparity of DISPARITY_PX."""
    corners = np.array([[-1, -1, 1], [1, -1, 1], [-1, 1, 1], [1, 1, 1]], float)
    uv = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], float)
    wall = Surface(10 * depth_m * corners * [1, 1, 0.1], uv, np.array([[0, 2, 1], [1, 2, 3]]), view(40, 0))
    model = folder / "recorded.glb"
    write_luminous_model([wall], model)
    return RebuiltPlace(model, 0.0, pair(), tuple(match_shots(shots_along_the_wall(count), pair())))


@pytest.mark.parametrize("nearness", [0.8, 1.0, 1.4, 1.6])
def test_a_rebuilt_place_that_is_too_near_is_refused(tmp_path: Path, nearness: float) -> None:
    place = place_with_a_wall_at(pair().focal_baseline / (nearness * DISPARITY_PX), tmp_path)
    T_world_left = np.stack([matched.shot.T_world_left for matched in place.matched])
    wanted = WantedDisparities.of_cells(np.full((1, 3, 3), float(DISPARITY_PX)))
    if nearness > 1.5:
        with pytest.raises(InputError, match=r"cannot be rebuilt: surfaces are 1\.6 times as near"):
            own_placement(place, T_world_left, pair(), wanted)
    else:
        placement = own_placement(place, T_world_left, pair(), wanted)
        assert placement.nearness == pytest.approx(nearness, rel=0.03)
