"""The stock engine puts points where geometry has them, the right way up, under lights and shadows, in 8 bits."""

import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle
from vobench.errors import MissingDependencyError
from vobench.geometry import se3
from vobench.geometry.camera import KannalaBrandt, Pinhole
from vobench.geometry.rig import looking
from vobench.rendering import pyrender_material
from vobench.rendering.pyrender_engine import PyrenderRenderer
from vobench.rendering.renderer import Radiance, View, single_instant
from vobench.scene.light import AreaLight, PointLight, Sky, SpotLight, Sun, Switched
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import quad, two_sided
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light
from vobench.scene.triangles import Thing

X, Y, Z = np.eye(3)
CAMERA = Pinhole(161, 121, 120.0, 118.0, 78.0, 62.5)
DOWN = looking(pitch_deg=90, position_m=(0, 0, 1.5))
WHITE_CD_M2 = 100.0
OVERHEAD = PointLight("bulb", np.array([0.0, 0.0, 2.0]), 2000.0)
GREY = Material(colour=(0.5, 0.5, 0.5))


@contextmanager
def opened(scene: Scene, *, white_cd_m2: float = WHITE_CD_M2) -> Iterator[PyrenderRenderer]:
    with closing(PyrenderRenderer(scene, white_cd_m2=white_cd_m2)) as renderer:
        yield renderer


def drawn(scene: Scene, T_world_camera=DOWN, camera=CAMERA, *, t_ns: int = 0, white_cd_m2=WHITE_CD_M2) -> Radiance:
    """A picture (H, W, 3), white at 1."""
    with opened(scene, white_cd_m2=white_cd_m2) as renderer:
        views = single_instant(camera, T_world_camera, t_ns=t_ns)
        return renderer.radiance(camera, views, weights=None) / np.float32(white_cd_m2)


def floor(material: str = "floor", side_m: float = 8.0) -> Thing:
    return rectangle(np.zeros(3), side_m * X, side_m * Y, material, material)


def scene(*things: Thing, lights=(OVERHEAD,), **materials: Material) -> Scene:
    return Scene("test", things, {"floor": GREY, **materials}, tuple(lights))


def centroid(weight: np.ndarray) -> np.ndarray:
    """Mean pixel (u, v) of a picture (H, W) of weights."""
    v, u = np.indices(weight.shape)
    return np.array([(u * weight).sum(), (v * weight).sum()]) / weight.sum()


@pytest.mark.parametrize(
    "camera",
    [CAMERA, KannalaBrandt(160, 120, 90.0, 90.0, 77.0, 61.0, 0.01, 0.0, 0.0, 0.0)],
    ids=["pinhole", "fisheye"],
)
def test_bright_patches_land_at_the_pixels_that_geometry_says(camera) -> None:
    places_m = np.random.default_rng(0).uniform(-0.5, 0.5, (24, 3)) * [1, 1, 0]
    half_m = 0.03
    glowing = Material(colour=(0.0, 0.0, 0.0), emission_cd_m2=(60.0, 60.0, 60.0))
    errors_px = []
    for place_m in places_m:
        patch = Thing("patch", quad(place_m - half_m * (X + Y), 2 * half_m * X, 2 * half_m * Y), "patch")
        picture = drawn(scene(patch, lights=(), patch=glowing), camera=camera)
        expected = camera.project(se3.apply(se3.inverse(DOWN), place_m[None]))[0]
        errors_px.append(centroid(picture[..., 1]) - expected)
    # Four samples a pixel place an edge to a quarter of a pixel; half a pixel of offset would show in the mean.
    assert np.abs(errors_px).max() < 0.35
    np.testing.assert_allclose(np.mean(errors_px, axis=0), 0, atol=0.08)


def quarters() -> Picture:
    """A texture whose quarters are red, green (above), blue and white (below)."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32, :32] = [255, 0, 0]
    pixels[:32, 32:] = [0, 255, 0]
    pixels[32:, :32] = [0, 0, 255]
    pixels[32:, 32:] = [255, 255, 255]
    return Picture(pixels)


def test_a_texture_is_neither_mirrored_nor_upside_down() -> None:
    # One repeat over a square metre, u along x and v along y.
    sheet = Thing("sheet", quad((-0.5, -0.5, 0), X, Y), "sheet")
    textured = scene(sheet, sheet=Material(texture=quarters()))
    picture = drawn(textured)
    T_camera_world = se3.inverse(DOWN)
    for (x, y), colour in {(-0.25, -0.25): (1, 0, 0), (0.25, -0.25): (0, 1, 0), (-0.25, 0.25): (0, 0, 1)}.items():
        u, v = CAMERA.project(se3.apply(T_camera_world, np.array([[x, y, 0.0]])))[0]
        seen = picture[round(v), round(u)]
        np.testing.assert_allclose(seen / seen.max(), colour, atol=0.05)


def test_a_point_light_gives_what_the_inverse_square_law_says() -> None:
    picture = drawn(scene(floor()))
    below = CAMERA.project(se3.apply(se3.inverse(DOWN), np.zeros((1, 3))))[0].round().astype(int)
    # pyrender's diffuse surfaces reflect 96 % diffusely, and have a faint highlight of a roughness of 1.
    expected = 0.5 * 2000 / (4 * np.pi) / 2.0**2 / np.pi / WHITE_CD_M2
    assert picture[below[1], below[0], 0] == pytest.approx(expected, rel=0.08)


def test_twice_the_white_is_half_the_picture_and_the_same_radiance() -> None:
    once, twice = (drawn(scene(floor()), white_cd_m2=white) for white in (100.0, 200.0))
    assert np.median(twice / once) == pytest.approx(0.5, rel=0.03)


def test_what_is_brighter_than_white_is_cut_off_and_stored_in_256_steps() -> None:
    bright = replace(OVERHEAD, power_lm=1e6)
    assert drawn(scene(floor(), lights=(bright,))).max() == 1.0
    stored = (255 * drawn(scene(floor())).astype(float) ** (1 / 2.2)).ravel()
    np.testing.assert_allclose(stored, np.rint(stored), atol=0.01)


LIGHTS = {
    "sun": Sun("sun", 500.0, (0.0,), (0.0,), (75.0,)),
    "spot": SpotLight("spot", np.array([-0.6, 0, 3.0]), np.array([0.0, 0, -1]), 3000.0, 40.0, 50.0),
    "panel": ceiling_light("panel", np.array([-0.6, 0, 3.0]), (0.2, 0.2), power_lm=3000.0),
}


@pytest.mark.parametrize("kind", LIGHTS)
def test_a_shadow_falls_where_rays_from_the_light_are_blocked(kind: str) -> None:
    light = LIGHTS[kind]
    plate = Thing("plate", two_sided(quad((-0.15, -0.15, 1.0), 0.3 * X, 0.3 * Y)), "floor")
    below = looking(pitch_deg=90, position_m=(0, 0, 0.9))
    lit, shaded = (drawn(scene(*things, lights=(light,)), below)[..., 0] for things in ([floor()], [floor(), plate]))
    # Where the shadow of the plate's middle is, and the same place on the other side.
    sideways_m = -light.direction(0)[:2] / light.direction(0)[2] if kind == "sun" else np.array([0.3, 0])
    places_m = np.array([[*sideways_m, 0.0], [*-sideways_m, 0.0]])
    pixels = CAMERA.project(se3.apply(se3.inverse(below), places_m)).round().astype(int)
    (in_shadow, in_light) = (shaded[v, u] / lit[v, u] for u, v in pixels)
    assert in_shadow < 0.2
    assert in_light > 0.8


def test_a_wall_seen_from_behind_by_the_sun_shades_and_a_pane_does_not() -> None:
    # Both face down, away from the sun, as a room's ceiling does.
    def over(material: str) -> Scene:
        roof = Thing("roof", quad((-2, -2, 1.9), 4 * Y, 4 * X), material)
        sun = Sun("sun", 500.0, (0.0,), (0.0,), (90.0,))
        return scene(floor(side_m=2.0), roof, lights=(sun,), glass=Material(kind="pane", eta=1.5))

    wall, pane = (np.median(drawn(over(material))[..., 0]) for material in ("floor", "glass"))
    assert wall < 0.1 * pane
    assert pane > 0.5


def test_the_sky_lights_what_is_open_and_is_the_background() -> None:
    sky = Sky("sky", 500.0, kind="uniform")
    picture = drawn(scene(floor(side_m=1.0), lights=(sky,)))
    middle = picture[62, 78, 0]
    assert middle == pytest.approx(0.5 * 500 / np.pi / WHITE_CD_M2, rel=0.1)
    level = looking(pitch_deg=-30, position_m=(0, 0, 1.5))
    np.testing.assert_allclose(drawn(scene(floor(), lights=(sky,)), level)[0], 1.0)


def test_lamps_that_are_off_give_no_light() -> None:
    off = replace(OVERHEAD, level=Switched((1.0,), on_first=False))
    assert drawn(scene(floor(), lights=(off,))).max() == 0
    assert drawn(scene(floor(), lights=(off,)), t_ns=2_000_000_000).max() > 0.05


def test_a_mover_is_where_its_path_has_it() -> None:
    tile = Thing("tile", quad((-0.03, -0.03, 0.002), 0.06 * X, 0.06 * Y), "tile")
    path = WaypointMotion(np.array([0.0, 1.0]), np.array([[-0.4, 0.2, 0], [0.4, 0.2, 0]]), np.zeros(2))
    materials = {"tile": Material(colour=(0, 0, 0), emission_cd_m2=(50.0, 50.0, 50.0))}
    moving = Scene("moving", (), materials, (), (Mover("tile", (tile,), path),))
    for t_s in (0.0, 0.5, 1.0):
        expected = CAMERA.project(se3.apply(se3.inverse(DOWN), np.array([[0.8 * t_s - 0.4, 0.2, 0.0]])))[0]
        picture = drawn(moving, t_ns=round(1e9 * t_s))
        np.testing.assert_allclose(centroid(picture[..., 0]), expected, atol=0.1)


def test_strips_are_rows_of_the_whole_picture_and_sub_frames_their_mean() -> None:
    now = np.zeros(1, np.int64)
    moved = looking(pitch_deg=80, position_m=(0.1, 0, 1.5))
    with opened(scene(floor(), floor=Material(texture=quarters()))) as renderer:
        first, second = (renderer.radiance(CAMERA, single_instant(CAMERA, T)) for T in (DOWN, moved))
        strips = [View(slice(0, 50), DOWN[None], now, now), View(slice(50, 121), moved[None], now, now)]
        both = renderer.radiance(CAMERA, strips)
        two = np.zeros(2, np.int64)
        mean = renderer.radiance(CAMERA, [View(slice(0, 121), np.stack([DOWN, moved]), two, two)])
    assert first.shape == (121, 161)
    np.testing.assert_array_equal(both, np.concatenate([first[:50], second[50:]]))
    np.testing.assert_allclose(mean, (first + second) / 2, rtol=1e-5)


def test_a_lamp_is_seen_as_bright_as_it_is() -> None:
    lamp = ceiling_light("lamp", np.array([0.0, 0, 2.0]), (1.0, 1.0), power_lm=100 * np.pi)
    assert isinstance(lamp, AreaLight)
    up = looking(pitch_deg=-90, position_m=(0, 0, 1.0))
    picture = drawn(scene(lights=(lamp,)), up, white_cd_m2=200.0)
    assert picture[60, 80, 0] == pytest.approx(0.5, rel=0.02)


def test_a_stock_pyrender_beside_the_fork_is_named_with_the_command_that_helps(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pyrender", None)
    with pytest.raises(
        MissingDependencyError, match=r"stock pyrender seems to be installed beside pyrender2"
    ) as caught:
        PyrenderRenderer(scene(floor()), white_cd_m2=100.0)
    assert str(caught.value).endswith(pyrender_material.REMEDY)
