"""A suburb has a road with paths around the scene, and houses beyond it."""

from dataclasses import dataclass, field

import numpy as np

from tests.asset.canvases import NEAREST_M, canvas
from vobench.asset.panorama_ground import ASPHALT, LAWN, PAVING, ground_places
from vobench.asset.panorama_suburb import ROAD_TO_FRONT_M, _add_row_of_houses, _ground_albedo


@dataclass
class Recorder:
    """Scenery that records the places of houses and trees."""

    houses_m: list = field(default_factory=list)
    trees_m: list = field(default_factory=list)

    def add_house(self, place_m, yaw_rad):
        self.houses_m.append(place_m)

    def add_tree(self, place_m, height_m, *, sunk=0.0):
        self.trees_m.append(place_m)

    def add_hedge(self, start_m, along, length_m):
        pass


def test_the_road_is_a_square_around_the_scene_with_paths_beside_it():
    empty = canvas()
    x_m, y_m, _ = ground_places(empty)
    across_m = np.maximum(np.abs(x_m), np.abs(y_m))
    albedo = _ground_albedo(empty)
    road_m = NEAREST_M - ROAD_TO_FRONT_M
    assert (albedo[np.abs(across_m - road_m) < 2.5] == np.float32(ASPHALT)).all()
    assert (albedo[np.abs(across_m - road_m - 3.7) < 0.5] == np.float32(PAVING)).all()
    lawn = albedo[across_m > NEAREST_M]
    assert np.abs(lawn.mean(axis=0) / LAWN - 1).max() < 0.2


def test_rows_of_houses_surround_the_scene_and_no_tree_is_too_near():
    scenery = Recorder()
    empty = canvas()
    for side in range(4):
        _add_row_of_houses(empty, scenery, 0, side)
    houses_m = np.array(scenery.houses_m)
    assert (np.abs(houses_m).max(axis=1) >= NEAREST_M + 5.9).all()
    for axis in (0, 1):
        assert houses_m[:, axis].min() < -NEAREST_M
        assert houses_m[:, axis].max() > NEAREST_M
    assert np.linalg.norm(scenery.trees_m, axis=1).min() > NEAREST_M - 4
