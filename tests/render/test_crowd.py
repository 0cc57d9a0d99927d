"""What is not drawn would not have been seen."""

from typing import Any

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.render.crowd import Crowd
from vobench.render.look import NEAR_M, Look, look
from vobench.render.mesh import Batch
from vobench.render.mirror import Plane
from vobench.scene.material import Glass, Material, Matt
from vobench.scene.texture import Texture

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
MATERIALS: list[Material] = [Matt(Texture("plain", 0.5, 0, 1, 8, 0)), Glass()]
BOXES = [(0, 180, 0, 120), (0, 180, 40, 48), (60, 120, 20, 50)]
PLACES = np.stack(np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 40)), -1).reshape(-1, 2)


def crowd(rng: np.random.Generator, count: int) -> list[Batch]:
    """One random rectangle a batch, every third on a mover."""
    corner, along, up = rng.normal(0, 3, (count, 3)), *rng.normal(0, 1.5, (2, count, 3))
    quads = np.stack([corner, corner + along, corner + along + up, corner + up], 1)
    return [Batch(i, None, MATERIALS[i % 2], -1 + (i % 3 == 0), None, quads[i : i + 1], 1.0) for i in range(count)]


def shown(batch: Batch, view: Look, box: Any) -> bool:
    """Whether one of many points of a batch, that faces the eye, is in the box."""
    corner, right, _, top = batch.quads_m[0]
    T = view.pose(batch.mover)
    on = se3.apply(T, corner + PLACES[:, :1] * (right - corner) + PLACES[:, 1:] * (top - corner))
    normal: Array = T[:3, :3] @ np.cross(right - corner, top - corner)
    if isinstance(batch.material, Matt) and normal @ (view.eye_m - on[0]) <= 0:
        return False
    if view.mirror is not None:
        on = on[on @ view.mirror.normal + view.mirror.offset_m > 0]
    seen = se3.apply(view.T_camera_world, on)
    u, v = CAMERA.project(seen[seen[:, 2] > NEAR_M]).T
    return bool(((u > box[0] - 1) & (u < box[1]) & (v > box[2] - 1) & (v < box[3])).any())


@pytest.mark.parametrize("mirrors", [0, 1, 2])
@pytest.mark.parametrize("box", BOXES)
def test_no_rectangle_that_can_be_seen_is_left_out_and_most_others_are(mirrors: int, box: Any) -> None:
    rng = np.random.default_rng(mirrors)
    batches = crowd(rng, 600)
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T_mover = se3.transform(se3.rotation_z(1.0), (0.3, 0.2, -0.4))
    view = look(CAMERA, se3.transform(R * np.linalg.det(R), (0.1, 0.2, 0.3)), [T_mover], np.zeros((0, 3, 4)), 0.0)
    for turn in rng.normal(0, 0.2, (mirrors, 3)):
        towards_camera = turn - view.T_camera_world[2, :3]
        view = view.through(Plane(towards_camera / np.linalg.norm(towards_camera), 2.0))
    found = Crowd(batches).in_sight(view, box)
    must = {batch.index for batch in batches if shown(batch, view, box)}
    assert must <= found
    assert len(must) > 0
    assert len(found) < 2 * len(must) + 15
