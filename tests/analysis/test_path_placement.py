"""A path is placed where it is free and where the disparities along it agree."""

import numpy as np
import pytest

from vobench.analysis import path_placement
from vobench.analysis.path_placement import levelled, place_path, stretch_disparities
from vobench.errors import InputError
from vobench.estimator.tools import stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking, stereo_rig
from vobench.rendering.geometry import RayCaster
from vobench.scene.material import Material
from vobench.scene.mesh import Thing, flat
from vobench.scene.scene import Scene, triangles

LENS = Pinhole(160, 120, 150.0, 150.0, 79.5, 59.5)
PAIR = stereo_pair(stereo_rig(LENS, pitch_deg=0, baseline_m=0.2), "test")


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    monkeypatch.setattr(path_placement, "DRAWS", 600)
    monkeypatch.setattr(path_placement, "NEAR_DRAWS", 200)


def hall(*, pillar: bool = False) -> Scene:
    """A room of 8 x 6 x 3 m seen from within, and perhaps a pillar that leaves no way through its middle."""
    boxes = [((-4, -3, 0), (4, 3, 3), True), *([((-2.9, -1.9, 0), (2.9, 1.9, 2.9), False)] if pillar else [])]
    things = []
    for number, (low, high, inward) in enumerate(boxes):
        corners = np.array(
            [[(low, high)[i >> 2 & 1][0], (low, high)[i >> 1 & 1][1], (low, high)[i & 1][2]] for i in range(8)], float
        )
        faces = np.array(
            [
                [0, 1, 3],
                [0, 3, 2],
                [4, 6, 7],
                [4, 7, 5],
                [0, 4, 5],
                [0, 5, 1],
                [2, 3, 7],
                [2, 7, 6],
                [0, 2, 6],
                [0, 6, 4],
                [1, 5, 7],
                [1, 7, 3],
            ]
        )
        corners_m = corners[faces]
        vertices = corners_m.reshape(-1, 3)
        mesh = flat(vertices, np.arange(len(vertices)).reshape(-1, 3), np.zeros((len(vertices), 2)))
        outward = np.einsum("ij,ij->i", mesh.normals[::3], corners_m.mean(1) - corners.mean(0)) > 0
        turned = mesh.flipped() if outward.all() == inward else mesh
        things.append(Thing(f"box_{number}", turned, "paint"))
    return Scene("hall", tuple(things), {"paint": Material()}, ())


def straight(length_m: float, count: int = 20) -> np.ndarray:
    way = np.zeros((count, 3))
    way[:, 0] = np.linspace(0, length_m, count)
    return se3.transform(np.eye(3), way) @ looking(pitch_deg=0, position_m=(0, 0, 0))


def test_a_path_lies_free_and_its_disparities_agree():
    wanted = np.full((1, 3, 3), 150 * 0.2 / 2.5)
    found = place_path(hall(), straight(1.5), PAIR, wanted)
    places = (found.T_place_world @ straight(1.5))[:, :3, 3] / found.scale
    assert (np.abs(places) < [3.9, 2.9, 3.0]).all()
    assert found.misfit < 0.5
    assert place_path(hall(), straight(1.5), PAIR, wanted / 20).scale > 1.5  # a hall of 8 m has nothing so far away


def test_where_a_path_was_is_found_by_its_disparities_along_the_way():
    scene = hall()
    there = se3.transform(se3.rotation_z(0.4), (-2.5, 0.6, 1.2)) @ straight(4.0)
    wanted = stretch_disparities(RayCaster(triangles(scene, t_ns=0)), there, PAIR, 1.0, 4)
    found = place_path(scene, straight(4.0), PAIR, wanted)
    ends = (found.T_place_world @ straight(4.0))[[0, -1], :2, 3] / found.scale
    assert found.misfit < 0.05
    # The hall is its own image when it is turned by half.
    assert min(np.abs(sign * ends - there[[0, -1], :2, 3]).max() for sign in (1, -1)) < 0.25


def test_a_place_without_a_free_way_is_refused():
    with pytest.raises(InputError, match=r"no free path of 60.0 m was found in 'hall'; take fewer pictures"):
        place_path(hall(pillar=True), straight(60.0), PAIR, np.full((1, 3, 3), 10.0))


def test_a_tilted_world_is_levelled():
    turn = np.linspace(0, 5, 60)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(60)], -1) * 3
    level = se3.transform(np.eye(3), circle)
    tilt = se3.transform(se3.rotation_z(0.3) @ looking(pitch_deg=-8, position_m=(0, 0, 0))[:3, [2, 0, 1]], np.zeros(3))
    assert np.ptp((tilt @ level)[:, 2, 3]) > 0.5
    assert np.ptp(levelled(tilt @ level)[:, 2, 3]) < 0.02
