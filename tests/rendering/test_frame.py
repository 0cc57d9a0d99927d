"""Meshes in colour: what a picture's channels have to do with one another, with albedo and with light."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from trimesh import Trimesh

from tests.rendering.rectangles import room
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import KannalaBrandt, Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.renderer import Radiance, single_instant
from vobench.scene.light import AreaLight, Sky
from vobench.scene.material import LUMINANCE, Material, Picture, linear
from vobench.scene.mesh import flat_shaded, make_mesh, quad, textured
from vobench.scene.scene import Scene, ceiling_light
from vobench.scene.triangles import Thing

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
FISHEYE = KannalaBrandt(120, 90, 60.0, 60.0, 59.5, 44.5, 0.0, 0.0, 0.0, 0.0)
AHEAD = looking(pitch_deg=0, position_m=(0, 0, 1.0))
LIGHT = 100 / np.pi  # luminance of white under 100 lx
WEIGHTS = (0.3, 0.6, 0.2)
RNG = np.random.default_rng(0)
PRINT = Picture(RNG.integers(0, 256, (64, 64, 3)).astype(np.uint8), 0.7)
MATERIALS = {
    "print": Material(texture=PRINT),
    "clay": Material(colour=(0.7, 0.3, 0.1)),
    "grey": Material(texture=Procedural("terrazzo", 0.5, 0.6, 1.0, 256, 1)),
    "wax": Material(texture=PRINT, colour=(0.9, 0.8, 0.7), eta=1.5),
    "gold": Material(colour=(0.9, 0.7, 0.3), metal=1.0),
    "mirror": Material("mirror", tint=0.8),
    "rose": Material("mirror", colour=(0.9, 0.5, 0.5)),
    "glass": Material("pane", eta=1.5),
    "bottle": Material("pane", eta=1.5, colour=(0.2, 0.8, 0.3)),
}
SKY = Sky("sky", 1000.0, "clear", colour=(0.8, 0.9, 1.2))


def ball(radius_m: float, *, at_m: tuple[float, float, float], count: int = 24) -> Trimesh:
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 2 * count + 1), np.linspace(0, np.pi, count + 1))
    points = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1).reshape(-1, 3)
    a = (np.arange(count)[:, None] * (2 * count + 1) + np.arange(2 * count)).ravel()
    b = a + 2 * count + 1
    faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)]).astype(np.int32)
    return make_mesh(radius_m * points + at_m, faces, np.stack([u, v], -1).reshape(-1, 2), points)


def board(x_m: float, width_m: float, height_m: float, z_m: float = 1.0) -> Trimesh:
    """A rectangle ahead of the camera, which it faces."""
    return quad((x_m, width_m / 2, z_m - height_m / 2), (0, -width_m, 0), (0, 0, height_m))


def scene(*things: tuple[Trimesh, str], lights: Any = (), sides: str | None = "grey") -> Scene:
    around = room((8, 8, 3), floor=sides or "grey", wall=sides or "grey", ceiling=sides or "grey")
    around = around if sides else [side.moved(se3.transform(np.eye(3), [-20.0, 0, -10])) for side in around[:1]]
    made = tuple(Thing(str(nth), mesh, material) for nth, (mesh, material) in enumerate(things))
    return Scene("meshes", (*around, *made), MATERIALS, lights)


@pytest.fixture(scope="module")
def snap(draw: Any, even_light: Any) -> Any:
    def of(shown: Scene, weights: Any = None, camera: Any = CAMERA, T: Array = AHEAD) -> Radiance:
        picture: Radiance = draw(even_light(shown)).radiance(camera, single_instant(camera, T), weights=weights)
        return picture

    return of


@pytest.mark.parametrize("camera", [CAMERA, FISHEYE], ids=["pinhole", "fisheye"])
@pytest.mark.parametrize("pane", ["glass", "bottle"])
def test_a_colour_picture_times_the_weights_is_the_picture_of_one_channel(
    draw: Any, even_light: Any, pane: str, camera: Any
) -> None:
    mirror = "rose" if pane == "bottle" else "mirror"
    shown = scene(
        (ball(0.4, at_m=(2.5, 0.8, 1.0)), "print"),
        (board(3.5, 3.0, 1.0, 0.6), "wax"),
        (board(3.2, 0.8, 0.8, 2.0), mirror),
        (board(1.5, 0.4, 2.0), pane),
        lights=(SKY,),
        sides="print",
    )
    shown = replace(shown, things=tuple(s for s in shown.things if s.name != "ceiling"))
    renderer = draw(even_light(shown))
    colours, mono = (renderer.radiance(camera, single_instant(camera, AHEAD), weights=w) for w in (None, WEIGHTS))
    assert colours.shape == (*mono.shape, 3)
    np.testing.assert_allclose(colours @ np.array(WEIGHTS), mono, rtol=1e-5, atol=1e-4)
    assert np.ptp(colours, axis=-1).max() > 10


def test_the_channels_of_a_grey_scene_are_equal(snap: Any) -> None:
    picture = snap(scene((ball(0.4, at_m=(2.5, 0.8, 1.0)), "grey"), (board(3.5, 3.0, 1.0), "mirror")))
    np.testing.assert_array_equal(picture[..., :1] + 0 * picture, picture)
    assert picture.std() > 1


def test_a_ball_in_even_light_shows_its_albedo_all_over(snap: Any) -> None:
    picture = snap(scene((ball(0.5, at_m=(2.0, 0, 1.0)), "clay"), sides=None))
    inside = np.hypot(*np.meshgrid((np.arange(180) - 89.5) / 164.5, (np.arange(120) - 59.5) / 136.2)) < 0.24
    np.testing.assert_allclose(picture[inside], np.broadcast_to([0.7, 0.3, 0.1], (inside.sum(), 3)) * LIGHT, rtol=1e-5)
    assert (picture[0] == 0).all()


def test_a_picture_on_a_wall_shows_its_linear_colours_where_they_belong(draw: Any, even_light: Any) -> None:
    values = np.zeros((2, 3, 3), np.uint8)
    values[0], values[1] = [[250, 0, 0], [0, 200, 0], [0, 0, 150]], [[90, 90, 0], [0, 60, 60], [30, 30, 30]]
    big = np.kron(values, np.ones((64, 64, 1), np.uint8))
    # Row 0 lies at v = 0, which is the lower edge here.
    wall = textured(board(2.0, 2.0, 1.2), np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]))
    shown = replace(scene((wall, "print")), materials=MATERIALS | {"print": Material(texture=Picture(big, 1.0))})
    picture = draw(even_light(shown)).radiance(CAMERA, single_instant(CAMERA, AHEAD), weights=None)
    for row in range(2):
        for column in range(3):
            u, v = 89.5 + 164.5 * (column - 1) * 0.333, 59.5 - 136.2 * (row - 0.5) * 0.3
            np.testing.assert_allclose(picture[round(v), round(u)], linear(values[row, column]) * LIGHT, rtol=2e-3)


def test_a_soup_of_the_same_triangles_cut_otherwise_gives_the_same_picture(snap: Any) -> None:
    whole = ball(0.5, at_m=(2.0, 0.1, 1.0))
    corners, uv = whole.triangles, whole.visual.uv[whole.faces]
    order = RNG.permutation(len(corners))
    middle = [np.concatenate([part[:, [0, 1]], part.mean(1, keepdims=True)], 1) for part in (corners, uv)]
    others = [
        [np.concatenate([part[:, [a, b]], part.mean(1, keepdims=True)], 1) for part in (corners, uv)]
        for a, b in ((1, 2), (2, 0))
    ]
    cut = [
        np.concatenate(parts)[np.concatenate([order, order + len(order), order + 2 * len(order)])]
        for parts in zip(middle, *others, strict=True)
    ]
    soup = flat_shaded(cut[0].reshape(-1, 3), np.arange(3 * len(cut[0])).reshape(-1, 3), cut[1].reshape(-1, 2))
    one, other = (snap(scene((mesh, "print"))) for mesh in (whole, soup))
    # Which triangle a sample on an edge belongs to is all that differs, and the level of detail there.
    assert (np.abs(one - other) < 1e-3 * LIGHT).mean() > 0.999


def test_what_is_under_the_cut_out_is_not_there(draw: Any, even_light: Any) -> None:
    leaf = np.full((64, 64, 4), 255, np.uint8)
    leaf[:, 32:, 3] = 40
    materials = MATERIALS | {"leaf": Material(texture=Picture(leaf, 1.0), cutout=0.5)}
    mesh = textured(board(2.0, 1.0, 1.0), np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]))
    shown = replace(scene((mesh, "leaf")), materials=materials)
    picture = draw(even_light(shown)).radiance(CAMERA, single_instant(CAMERA, AHEAD), weights=None)
    without = draw(even_light(scene())).radiance(CAMERA, single_instant(CAMERA, AHEAD), weights=None)
    right, left = slice(95, 125), slice(55, 85)
    np.testing.assert_array_equal(picture[40:80, right], without[40:80, right])
    np.testing.assert_allclose(picture[40:80, left], LIGHT, rtol=1e-5)


def test_what_glows_adds_its_emission_and_its_picture_to_what_it_reflects(draw: Any, even_light: Any) -> None:
    half = np.zeros((64, 64, 3), np.uint8)
    half[:, :32] = 255
    screen = Material(colour=(0.2, 0.2, 0.2), emission_cd_m2=(50, 80, 20), emission_texture=Picture(half, 1.0))
    mesh = textured(board(2.0, 1.0, 1.0), np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]))
    shown = replace(scene((mesh, "screen")), materials=MATERIALS | {"screen": screen})
    picture = draw(even_light(shown)).radiance(CAMERA, single_instant(CAMERA, AHEAD), weights=None)
    np.testing.assert_allclose(picture[60, 60], 0.2 * LIGHT + np.array([50, 80, 20]), rtol=1e-5)
    np.testing.assert_allclose(picture[60, 120], 0.2 * LIGHT, rtol=1e-5)


def test_the_face_of_a_lamp_shows_what_the_map_of_light_holds_there(draw: Any, even_light: Any) -> None:
    lamp = ceiling_light("lamp", np.array([0.0, 0, 1.5]), (0.5, 0.5), power_lm=100)
    assert isinstance(lamp, AreaLight)
    up = looking(pitch_deg=-90, position_m=(0, 0, 1.0))
    picture = draw(even_light(scene(lights=(lamp,)))).radiance(CAMERA, single_instant(CAMERA, up))
    assert picture[60, 90] == pytest.approx(LIGHT, rel=1e-5)


def test_the_sky_has_its_colour(snap: Any) -> None:
    picture = snap(scene((board(9.0, 0.1, 0.1), "grey"), lights=(SKY,), sides=None))
    above = picture[:40]
    np.testing.assert_allclose(above, above[..., :1] / 0.8 * np.array([0.8, 0.9, 1.2]), rtol=1e-5)
    assert above.min() > 1


def test_the_default_weights_are_those_of_luminance(draw: Any, even_light: Any) -> None:
    renderer = draw(even_light(scene((ball(0.5, at_m=(2.0, 0, 1.0)), "clay"), sides=None)))
    assert renderer.radiance(CAMERA, single_instant(CAMERA, AHEAD))[60, 90] == pytest.approx(
        np.dot(LUMINANCE, [0.7, 0.3, 0.1]) * LIGHT, rel=1e-5
    )


def test_a_mirror_of_metal_shows_things_in_its_colour(snap: Any) -> None:
    picture = snap(scene((board(2.0, 3.0, 3.0), "gold"), sides="clay"))
    # Seen square on, Schlick's rise towards grazing is nothing.
    np.testing.assert_allclose(picture[60, 90], np.array([0.9 * 0.7, 0.7 * 0.3, 0.3 * 0.1]) * LIGHT, rtol=1e-3)
