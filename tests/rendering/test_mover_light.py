"""What may be left out of a mover's shade is left out, and nothing else."""

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
from vobench.rendering.bake import BakedScene, BakeSettings, bake
from vobench.rendering.emitter import Emitter, bulb_emitter, panel_emitter
from vobench.rendering.geometry import BoundingSphere, RayCaster
from vobench.rendering.illumination import Illumination
from vobench.rendering.mover_light import Casters, may_shade, parts
from vobench.rendering.renderer import single_instant
from vobench.rendering.view import Box, PinholeView, pinhole_view
from vobench.scene.light import PointLight, Sky
from vobench.scene.material import Material
from vobench.scene.mesh import Thing, moved, quad, table
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light

PILLAR = moved(block((0.5, 0.3, 1.8), bevel_m=0), at(0.4, -0.2, 0.9, yaw=25))
FLOOR = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
LAMP = ceiling_light("panel", np.array([1.0, 0.3, 2.4]), (0.8, 0.4), power_lm=1000)
PANEL = panel_emitter(LAMP)
BULB = bulb_emitter(PointLight("bulb", np.array([-1.0, 0.5, 2.0]), 500.0))
CASTER = RayCaster(table([Thing("pillar", PILLAR, "grey")], [-1], [-1]))


def each(balls: BoundingSphere) -> list[BoundingSphere]:
    return [balls.take(slice(nth, nth + 1)) for nth in range(len(balls.radius_m))]


def test_parts_enclose_all_of_a_thing_and_are_smaller_than_one_ball() -> None:
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), 200)
    points = np.einsum("nk,fkj->fnj", weights, PILLAR.triangles).reshape(-1, 3)
    balls = parts(PILLAR.triangles)
    apart = np.linalg.norm(points[:, None] - balls.centre_m, axis=-1)
    assert (apart <= balls.radius_m + 1e-9).any(1).all()
    assert balls.radius_m.max() < 0.6
    assert len(parts(FLOOR.triangles).radius_m) == 1


@pytest.mark.parametrize("emitter", [PANEL, BULB], ids=["panel", "bulb"])
def test_a_place_from_which_a_ray_meets_the_thing_is_never_left_out(emitter: Emitter) -> None:
    numbers = np.random.default_rng(1)
    points = np.append(numbers.uniform(-4, 4, (4000, 2)), np.full((4000, 1), 1e-4), axis=1)
    spots = np.einsum("nk,kj->nj", numbers.dirichlet((1, 1, 1), 4000), LAMP.mesh.triangles[0])
    lamp = spots if emitter is PANEL else np.broadcast_to(emitter.ball.centre_m, points.shape)
    hidden = CASTER.occluded(points, lamp)
    kept = np.any(
        [may_shade(b, emitter.ball, BoundingSphere(points, np.zeros(4000))) for b in each(parts(PILLAR.triangles))], 0
    )
    assert hidden.any()
    assert not (hidden & ~kept).any()
    assert kept.mean() < 0.6


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
def test_a_picture_has_shade_wherever_it_looks(
    draw: Any, monkeypatch: pytest.MonkeyPatch, cell: BakedScene, yaw_deg: float
) -> None:
    """As it would with shade everywhere, in either eye and by way of a mirror."""
    eyes = [
        se3.transform(se3.rotation_z(np.deg2rad(yaw_deg)), (0.2, -0.5, 0))
        @ looking(pitch_deg=10, position_m=(0, 0.1 * side, 1.2))
        for side in (1, -1)
    ]
    shots = [single_instant(CAMERA, eye, t_ns=t) for t in (0, 10**8) for eye in eyes]
    renderer = draw(cell)
    ours = [renderer.radiance(CAMERA, shot) for shot in shots]
    everywhere = Illumination.at
    monkeypatch.setattr(Illumination, "at", lambda self, start, end, views=None: everywhere(self, start, end))
    whole = draw(cell)
    for shot, picture in zip(shots, ours, strict=True):
        assert picture.tobytes() == whole.radiance(CAMERA, shot).tobytes()


def views(cell: BakedScene, yaw_deg: float) -> list[tuple[PinholeView, Box]]:
    poses = [mover.path.pose(0) for mover in cell.scene.movers]
    T = se3.transform(se3.rotation_z(np.deg2rad(yaw_deg)), np.zeros(3)) @ looking(pitch_deg=10, position_m=(0, 0, 1))
    return [(pinhole_view(CAMERA, T, poses, np.zeros((0, 4, 4)), ambient_cd_m2=np.ones(3)), (0, 90, 0, 60))]


def test_shade_where_nobody_looks_is_left_out(cell: BakedScene) -> None:
    light = Illumination(cell)
    ahead, aside, whole = (
        int((Illumination(cell).at(0, 0, shown) < light.without_movers(0, 0)).sum())
        for shown in (views(cell, 0), views(cell, 90), None)
    )
    assert 0 < ahead < 0.8 * whole
    assert ahead != aside


def test_shade_found_bit_by_bit_is_that_found_at_once(cell: BakedScene) -> None:
    light, maps = Illumination(cell), []
    for yaw_deg in (0, 90, 200):
        maps.append(light.at(0, 0, views(cell, yaw_deg)))
        assert light.at(0, 0, views(cell, yaw_deg)) is maps[-1]
    assert len({one.tobytes() for one in maps}) == len(maps)
    assert light.at(0, 0).tobytes() == Illumination(cell).at(0, 0).tobytes()
    assert light.at(0, 0) is light.at(0, 0)


def test_several_casters_stop_what_any_of_them_stops() -> None:
    elsewhere = RayCaster(table([Thing("pillar", moved(PILLAR, at(0.7, -0.4, 0.1, yaw=70)), "grey")], [-1], [-1]))
    numbers = np.random.default_rng(2)
    origins, ways = numbers.uniform(-2, 2, (3000, 3)), numbers.uniform(-3, 3, (3000, 3))
    there, here = elsewhere.stops(origins, ways), CASTER.stops(origins, ways)
    assert (there & ~here).any()
    assert (here & ~there).any()
    np.testing.assert_array_equal(Casters(elsewhere, CASTER).stops(origins, ways), there | here)
