"""Pictures of a scene with movers do not depend on what was drawn before."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.rendering.rectangles import room
from vobench.asset.shape import at, block
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.renderer import single_instant
from vobench.scene.light import PointLight, Sky
from vobench.scene.material import Material
from vobench.scene.mesh import moved
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light
from vobench.scene.triangles import Thing

PILLAR = moved(block((0.5, 0.3, 1.8), bevel_m=0), at(0.4, -0.2, 0.9, yaw=25))
LAMP = ceiling_light("panel", np.array([1.0, 0.3, 2.4]), (0.8, 0.4), power_lm=1000)


CAMERA = Pinhole(90, 60, 60.0, 60.0, 44.5, 29.5)
MATERIALS = {
    "grey": Material(texture=Procedural("plain", 0.5, 0.0, 1.0, 8, 0)),
    "mirror": Material("mirror", tint=0.8),
    "glass": Material("pane", eta=1.5),
}
CELL = tuple(room((4, 4, 2.5), floor="grey", wall="grey", ceiling="grey"))


@pytest.fixture(scope="module")
def cell() -> BakedScene:
    """A pillar that moves in a cell with one wall of mirror and one of glass, before the sky."""
    kinds = {"wall_east": "mirror", "wall_north": "glass"}
    things = tuple(replace(thing, material=kinds.get(thing.name, "grey")) for thing in CELL)
    way = WaypointMotion(np.array([0.0, 1.0]), np.array([[-0.5, 0.4, 0.0], [0.1, 0.7, 0.0]]), np.array([0.0, 30.0]))
    pillar = Mover("pillar", (Thing("pillar", PILLAR, "grey"),), way)
    lights = (LAMP, PointLight("bulb", np.array([-1.0, 0.5, 2.0]), 500.0), Sky("sky", 2000.0, "uniform"))
    settings = BakeSettings(spacing_m=0.1, light_rays=4, indirect_spacing_m=0.3, indirect_rays=16, bounces=2)
    return bake(Scene("cell", things, MATERIALS, lights, (pillar,)), settings)


@pytest.mark.parametrize("yaw_deg", [0, 90, 200])
def test_a_picture_has_the_same_bytes_whatever_was_drawn_before(draw: Any, cell: BakedScene, yaw_deg: float) -> None:
    """In either eye and by way of a mirror."""
    eyes = [
        se3.transform(se3.rotation_z(np.deg2rad(yaw_deg)), (0.2, -0.5, 0))
        @ looking(pitch_deg=10, position_m=(0, 0.1 * side, 1.2))
        for side in (1, -1)
    ]
    shots = [single_instant(CAMERA, eye, t_ns=t) for t in (0, 10**8) for eye in eyes]
    renderer = draw(cell)
    ours = [renderer.radiance(CAMERA, shot) for shot in shots]
    again = draw(cell)
    for shot, picture in reversed(list(zip(shots, ours, strict=True))):
        assert picture.tobytes() == again.radiance(CAMERA, shot).tobytes()
