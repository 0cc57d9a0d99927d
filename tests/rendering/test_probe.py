"""Gloss by a room probe: it conserves energy, shows what is there in the metal's colour, and glints."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from trimesh import Trimesh

from tests.rendering.rectangles import room
from vobench.asset.texture import Procedural
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.probe import FACES, LEVELS, level_of, roughness_of
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.light import Flicker, PointLight, Sky
from vobench.scene.material import LUMINANCE, Material, inner_reflectance
from vobench.scene.mesh import make_mesh, quad
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
AHEAD = looking(pitch_deg=0, position_m=(-2.0, 0, 1.5))
RADIUS_M = 0.5
BRIGHT = 50.0
ALL_AROUND = Sky("sky", np.pi * BRIGHT, "uniform", ground_albedo=1.0)
GREY = Material(texture=Procedural("plain", 0.5, 0, 1, 8, 0))


def ball(centre_m: tuple[float, float, float] = (0.0, 0.0, 1.5), count: int = 60) -> Trimesh:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * count + 1), np.linspace(0, np.pi, count + 1))
    points = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1).reshape(-1, 3)
    a = (np.arange(count)[:, None] * (2 * count + 1) + np.arange(2 * count)).ravel()
    b = a + 2 * count + 1
    faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)]).astype(np.int32)
    return make_mesh(RADIUS_M * points + centre_m, faces, np.stack([u, v], -1).reshape(-1, 2), points)


def shown(material: Material, *, sides: dict[str, Material] | None = None, lights: Any = (ALL_AROUND,)) -> Scene:
    """A ball in a room of some materials, or under the sky with one small board far below."""
    materials = {"ball": material, "grey": Material() if sides is None else GREY} | (sides or {})
    around = room((8, 8, 3), floor="grey", wall="grey", ceiling="grey")
    around = [replace(side, material=side.name if side.name in materials else "grey") for side in around]
    if sides is None:
        around = [replace(around[0], mesh=quad((-3.0, -3, -3), (0.1, 0, 0), (0, 0.1, 0)))]
    return Scene("ball", (*around, Thing("ball", ball(), "ball")), materials, lights)


def on_ball(T: Array = AHEAD, *, within: float = 0.97) -> Any:
    """The pixels (H, W) of the ball, and its normals (H, W, 3)."""
    v, u = np.indices((120, 180))
    rays = CAMERA.rays(np.stack([u, v], -1).astype(float)) @ T[:3, :3].T
    to_centre = np.array([0, 0, 1.5]) - T[:3, 3]
    along = rays @ to_centre
    beside = np.sqrt(np.maximum(to_centre @ to_centre - along**2, 0))
    inside = beside < within * RADIUS_M
    depth = along - np.sqrt(np.maximum(RADIUS_M**2 - beside**2, 0))
    return inside, (depth[..., None] * rays - to_centre) / RADIUS_M


@pytest.fixture(scope="module")
def snap(draw: Any, even_light: Any) -> Any:
    def of(scene: Scene, illuminance_lx: float = np.pi * BRIGHT, weights: Any = None) -> Radiance:
        renderer = draw(even_light(scene, illuminance_lx=illuminance_lx))
        picture: Radiance = renderer.radiance(CAMERA, single_instant(CAMERA, AHEAD), weights=weights)
        return picture

    return of


@pytest.mark.parametrize("roughness", [0.0, 0.05, 0.2, 0.35, 0.6])
@pytest.mark.parametrize("kind", ["coat", "metal", "mirror"])
def test_a_white_body_in_even_light_gives_back_all_of_it_and_is_not_seen(
    snap: Any, kind: str, roughness: float
) -> None:
    materials = {
        "coat": Material(eta=1.5, roughness=roughness),
        "metal": Material(metal=1.0, roughness=roughness),
        "mirror": Material("mirror", roughness=roughness),
    }
    enters = (1 - inner_reflectance(1.5)) * 1.5**2 if kind == "coat" else 1.0
    picture = snap(shown(materials[kind]), np.pi * BRIGHT * enters)
    inside, _ = on_ball()
    np.testing.assert_allclose(picture[inside], BRIGHT, rtol=5e-3)
    np.testing.assert_allclose(picture[~on_ball(within=1.05)[0]], BRIGHT, rtol=1e-3)


def test_metal_mirrors_in_its_colour(snap: Any) -> None:
    picture = snap(shown(Material(colour=(0.9, 0.6, 0.2), metal=1.0, roughness=0.1)))
    middle = picture[58:62, 88:92].mean((0, 1))
    np.testing.assert_allclose(middle, BRIGHT * np.array([0.9, 0.6, 0.2]), rtol=5e-3)
    inside, _ = on_ball(within=0.999)
    # Schlick: towards its rim everything becomes white.
    assert (picture[inside][:, 2] / picture[inside][:, 0]).max() > 0.4


def test_metal_whose_normals_lie_square_to_the_view_has_a_luminance(draw: Any, even_light: Any) -> None:
    # A bevel seen along its face: at some dozens of these samples the cosine is 0 to the last bit.
    askew = np.tile(np.array([0.0, 1, 1]) / np.sqrt(2), (4, 1))
    points = np.array([[2.0, -1, -1], [2, 1, -1], [2, 1, 1], [2, -1, 1]])
    bevel = make_mesh(points, np.array([[0, 2, 1], [0, 3, 2]], np.int32), np.zeros((4, 2)), askew)
    metal = {"metal": Material(colour=(0.5, 0.5, 0.5), metal=1.0, roughness=0.25)}
    camera = Pinhole(320, 240, 160.0, 160.0, 159.25, 119.25)
    renderer = draw(even_light(Scene("bevel", (Thing("bevel", bevel, "metal"),), metal, ())))
    picture = renderer.radiance(camera, single_instant(camera, looking(pitch_deg=0, position_m=(0, 0, 0))))
    assert np.isfinite(picture).all()


def test_a_smooth_ball_shows_the_walls_that_reflected_rays_meet(snap: Any) -> None:
    sides = {
        name: Material(colour=c)
        for name, c in (
            ("wall_north", (0.8, 0.1, 0.1)),
            ("wall_south", (0.1, 0.1, 0.8)),
            ("floor", (0.1, 0.8, 0.1)),
            ("wall_west", (0.6, 0.6, 0.6)),
            ("ceiling", (0.7, 0.7, 0.1)),
        )
    }
    picture = snap(shown(Material(metal=1.0), sides=sides, lights=()))
    inside, normals = on_ball(within=0.9)
    v, u = np.indices((120, 180))
    rays = CAMERA.rays(np.stack([u, v], -1).astype(float)) @ AHEAD[:3, :3].T
    mirrored = rays - 2 * np.einsum("ijk,ijk->ij", rays, normals)[..., None] * normals
    start = np.array([0, 0, 1.5]) + RADIUS_M * normals
    with np.errstate(divide="ignore"):
        reach = np.maximum((np.array([-4, -4, 0]) - start) / mirrored, (np.array([4, 4, 3]) - start) / mirrored)
    axis = reach.argmin(-1)
    side = 2 * axis + (np.take_along_axis(mirrored, axis[..., None], -1)[..., 0] > 0)
    names = ["wall_west", "wall_east", "wall_south", "wall_north", "floor", "ceiling"]
    colours = np.array([(sides | {"wall_east": Material(colour=(0.5,) * 3)})[name].colour for name in names])
    expected = colours[side] * BRIGHT
    same = np.isclose(picture, expected, rtol=0.02).all(-1)[inside]
    # The probe does not stand in the ball: what it sees of it, or beside an edge, is all that is elsewhere.
    assert same.mean() > 0.8


def test_where_less_light_arrives_less_is_mirrored(snap: Any) -> None:
    open_, dim = (snap(shown(Material(eta=1.5, colour=(0.0,) * 3, roughness=0.1)), lx) for lx in (np.pi * BRIGHT, 30.0))
    inside, _ = on_ball(within=0.8)
    assert dim[inside].mean() < 0.3 * open_[inside].mean()


def test_the_rougher_a_ball_the_softer_is_what_it_mirrors(snap: Any) -> None:
    sides = {"wall_north": Material(colour=(0.9,) * 3), "wall_south": Material(colour=(0.05,) * 3)}
    steps = []
    for roughness in (0.0, 0.05, 0.1, 0.2, 0.3):
        picture = snap(shown(Material(metal=1.0, roughness=roughness), sides=sides, lights=()))[60, :, 0]
        steps.append(np.abs(np.diff(picture[60:120])).max())
    assert steps == sorted(steps, reverse=True)
    assert steps[0] > 4 * steps[-1]


def test_levels_and_roughness_are_each_others_inverse() -> None:
    for level in range(1, LEVELS):
        assert level_of(roughness_of(level)) == pytest.approx(level)
    assert level_of(0.0) == roughness_of(0) == 0.0


def test_the_six_faces_show_the_world_mirrored_and_look_all_ways() -> None:
    np.testing.assert_allclose(np.linalg.det(FACES), -1.0)
    assert sorted(FACES[:, 2].tolist()) == sorted([*np.eye(3).tolist(), *(-np.eye(3)).tolist()])


def test_a_point_glints_where_the_facet_that_mirrors_it_lies_and_the_more_lamps_the_more_light(snap: Any) -> None:
    lamp = PointLight("lamp", np.array([-1.5, 1.0, 2.0]), 4000.0)
    both = (lamp, replace(lamp, name="other", position_m=np.array([-1.5, -1.0, 2.0])))
    black = Material(colour=(0.0,) * 3, eta=1.5, roughness=0.08)
    none, one, two = (snap(shown(black, lights=some), 1e4)[..., 0] for some in ((), both[:1], both))
    added = one - none
    inside, normals = on_ball(within=0.95)
    row, column = np.unravel_index(np.argmax(np.where(inside, added, 0)), added.shape)
    at = np.array([0, 0, 1.5]) + RADIUS_M * normals[row, column]
    to_lamp, to_eye = lamp.position_m - at, AHEAD[:3, 3] - at
    half = to_lamp / np.linalg.norm(to_lamp) + to_eye / np.linalg.norm(to_eye)
    assert normals[row, column] @ half / np.linalg.norm(half) > np.cos(np.deg2rad(2))
    assert two[inside].sum() - none[inside].sum() == pytest.approx(2 * added[inside].sum(), rel=0.05)
    assert added.max() > 10


def test_a_glint_is_not_there_where_the_lamp_does_not_reach(snap: Any) -> None:
    lamp = PointLight("lamp", np.array([-1.5, 1.0, 2.0]), 4000.0)
    black = Material(colour=(0.0,) * 3, eta=1.5, roughness=0.08)
    added = [
        snap(shown(black, lights=(lamp,)), lux)[..., 0] - snap(shown(black, lights=()), lux)[..., 0]
        for lux in (1e4, 20.0)
    ]
    assert added[1].sum() < 0.01 * added[0].sum()


def test_colours_of_gloss_times_the_weights_are_the_picture_of_one_channel(snap: Any) -> None:
    sides = {"wall_north": Material(colour=(0.9, 0.3, 0.2)), "floor": Material(colour=(0.2, 0.3, 0.6), eta=1.5)}
    lamp = PointLight("lamp", np.array([-1.5, 1.0, 2.0]), 4000.0, colour=(1.0, 0.8, 0.5))
    scene = shown(Material(colour=(0.9, 0.6, 0.2), metal=0.7, eta=1.4, roughness=0.1), sides=sides, lights=(lamp,))
    colours, mono = snap(scene), snap(scene, weights=LUMINANCE)
    np.testing.assert_allclose(colours @ LUMINANCE, mono, rtol=1e-5)


def test_a_flickering_lamp_scales_what_the_probe_shows(draw: Any, even_light: Any) -> None:
    scene = shown(Material(metal=1.0, roughness=0.1), sides={}, lights=())
    baked = even_light(scene, level=Flicker(depth=0.9))
    renderer = draw(baked)
    bright, dim = (
        renderer.radiance(CAMERA, single_instant(CAMERA, AHEAD, t_ns=t_ns))[on_ball(within=0.9)[0]]
        for t_ns in (0, 5_000_000)
    )
    level = baked.scene.lights[0].level
    np.testing.assert_allclose(dim / bright, level.mean(5_000_000, 5_000_000) / level.mean(0, 0), rtol=1e-3)
