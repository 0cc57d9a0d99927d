"""Fog in pictures, by the law of Koschmieder (1924): L = L0 exp(-beta d) + A (1 - exp(-beta d)), d along the ray."""

from typing import Any

import numpy as np
import pytest

from tests.rendering.rectangles import room
from vobench.geometry.camera import KannalaBrandt, Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.background import Background
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.illumination import AmbientLight
from vobench.rendering.renderer import Radiance, single_instant
from vobench.rendering.sample_pattern import ROTATED_GRID
from vobench.scene.fog import Fog
from vobench.scene.light import Sky, Switched
from vobench.scene.material import LUMINANCE, Material, fresnel
from vobench.scene.mesh import quad
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
FISHEYE = KannalaBrandt(120, 90, 60.0, 60.0, 59.5, 44.5, 0.0, 0.0, 0.0, 0.0)
EYE_M = np.array([-1.0, 0.2, 1.0])
AHEAD = looking(pitch_deg=0, position_m=(-1.0, 0.2, 1.0))
WALL_X_M = 3.0
SKY = Sky("sky", 1000.0, "clear", colour=(0.8, 0.9, 1.2))
MATERIALS = {
    "grey": Material(colour=(0.5, 0.5, 0.5)),
    "clay": Material(colour=(0.7, 0.3, 0.1)),
    "black": Material(colour=(0.0, 0.0, 0.0)),
    "mirror": Material("mirror", tint=0.8),
    "perfect": Material("mirror", tint=1.0),
    "glass": Material("pane", eta=1.5),
    "bottle": Material("pane", eta=1.5, colour=(0.2, 0.8, 0.3)),
}


def board(x_m: float, width_m: float, height_m: float) -> Any:
    """A rectangle ahead of the camera, which it faces."""
    return quad((x_m, width_m / 2, 1 - height_m / 2), (0, -width_m, 0), (0, 0, height_m))


def wall_ahead(material: str, fog: Fog | None, *things: Thing, width_m: float = 40.0) -> Scene:
    """A wall ahead, and a body that gives the scene its mean light but is behind the camera."""
    behind = Thing("behind", quad((-30.0, 100.0, 0.0), (0, -1, 0), (0, 0, 1)), "grey")
    wall = Thing("wall", board(WALL_X_M, width_m, 40.0), material)
    return Scene("wall", (wall, behind, *things), MATERIALS, (SKY,), fog=fog)


def grey_room(fog: Fog | None, *things: Thing) -> Scene:
    """A room that is as bright as its airlight in every direction."""
    around = room((8, 8, 3), floor="grey", wall="grey", ceiling="grey")
    return Scene("room", (*around, *things), MATERIALS, (), fog=fog)


def airlight_cd_m2(baked: BakedScene) -> Array:
    """The mean luminance (3,) of surfaces in the even light of the tests, 100 lx."""
    return AmbientLight(baked).cd_m2(baked.direct[0])


def cosines(camera: Pinhole) -> Array:
    """The cosine (4, H, W) of the angle to the optical axis at the four samples of each pixel."""
    u, v = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    layers = []
    for right, down in ROTATED_GRID.positions:
        x = (u + right - 0.5 - camera.cx_px) / camera.fx_px
        y = (v + down - 0.5 - camera.cy_px) / camera.fy_px
        layers.append(1 / np.sqrt(x**2 + y**2 + 1))
    return np.array(layers)


@pytest.fixture(scope="module")
def snap(draw: Any, even_light: Any) -> Any:
    def of(shown: Scene, weights: Any = None, camera: Any = CAMERA) -> Radiance:
        picture: Radiance = draw(even_light(shown)).radiance(camera, single_instant(camera, AHEAD), weights=weights)
        return picture.astype(float)

    return of


FOG = Fog(visibility_m=20.0)
CLAY_CD_M2 = np.array([0.7, 0.3, 0.1]) * 100 / np.pi
WALL_DEPTH_M = WALL_X_M - EYE_M[0]


@pytest.mark.parametrize("visibility_m", [5.0, 20.0, 200.0])
def test_every_pixel_of_a_wall_has_the_transmittance_of_the_law(
    snap: Any, even_light: Any, visibility_m: float
) -> None:
    fog = Fog(visibility_m=visibility_m)
    airlight = airlight_cd_m2(even_light(wall_ahead("clay", fog)))
    clear = snap(wall_ahead("clay", None))
    foggy = snap(wall_ahead("clay", fog))
    measured = (foggy - airlight)[..., 0] / (clear - airlight)[..., 0]

    distances_m = WALL_DEPTH_M / cosines(CAMERA)  # along rays, not along the axis
    assert distances_m.max() > 1.15 * WALL_DEPTH_M
    np.testing.assert_allclose(measured, fog.transmittance(distances_m).mean(0), rtol=0, atol=1e-6)


def test_a_lens_that_is_no_pinhole_sees_the_same_fog(snap: Any, even_light: Any) -> None:
    airlight = airlight_cd_m2(even_light(wall_ahead("clay", FOG)))
    foggy = snap(wall_ahead("clay", FOG), camera=FISHEYE)
    u, v = np.meshgrid(np.arange(FISHEYE.width_px), np.arange(FISHEYE.height_px))
    angles_rad = np.hypot(u - FISHEYE.cx_px, v - FISHEYE.cy_px) / FISHEYE.fx_px  # equidistant
    is_wall = angles_rad < 1.0
    distances_m = WALL_DEPTH_M / np.cos(angles_rad[is_wall])
    passing = FOG.transmittance(distances_m)[:, None]
    np.testing.assert_allclose(foggy[is_wall], passing * CLAY_CD_M2 + (1 - passing) * airlight, rtol=2e-3)


def test_a_picture_of_one_channel_is_the_weighted_picture_in_colour(snap: Any) -> None:
    pane = Thing("pane", board(1.0, 1.0, 1.0), "glass")
    mirror = Thing("mirror", board(2.0, 3.0, 0.5), "mirror")
    shown = wall_ahead("clay", Fog(visibility_m=8.0, airlight="sky"), pane, mirror)
    np.testing.assert_allclose(snap(shown) @ np.array(LUMINANCE), snap(shown, LUMINANCE), rtol=1e-5)


def test_the_sky_is_airlight_alone(snap: Any, even_light: Any) -> None:
    is_sky = np.zeros((CAMERA.height_px, CAMERA.width_px), bool)
    is_sky[:, [0, 1, -2, -1]] = True
    by_light = snap(wall_ahead("black", FOG, width_m=1.0))[is_sky]
    airlight = airlight_cd_m2(even_light(wall_ahead("black", FOG, width_m=1.0)))
    np.testing.assert_allclose(by_light, np.broadcast_to(airlight, by_light.shape), rtol=1e-6)
    by_sky = snap(wall_ahead("black", Fog(visibility_m=20.0, airlight="sky"), width_m=1.0))[is_sky]
    even_cd_m2 = 1000 / np.pi * np.array([0.8, 0.9, 1.2])
    np.testing.assert_allclose(by_sky, np.broadcast_to(even_cd_m2, by_sky.shape), rtol=1e-6)


def test_the_airlight_of_a_sky_follows_its_level() -> None:
    dimmed = Sky("sky", 1000.0, level=Switched((1.0,)))
    second_ns = 1_000_000_000
    before = Background([dimmed]).mean_cd_m2(0, second_ns)
    across = Background([dimmed, SKY]).mean_cd_m2(0, 2 * second_ns)
    np.testing.assert_allclose(before, np.full(3, 1000 / np.pi))
    np.testing.assert_allclose(across, 1000 / np.pi * np.array([1.3, 1.4, 1.7]))


@pytest.mark.parametrize("material", ["glass", "bottle"])
def test_fog_lies_before_and_behind_a_pane(snap: Any, even_light: Any, material: str) -> None:
    pane_x_m = 1.0
    pane = Thing("pane", board(pane_x_m, 40.0, 40.0), material)
    foggy = snap(wall_ahead("clay", FOG, pane))
    airlight = airlight_cd_m2(even_light(wall_ahead("clay", FOG, pane)))

    cosine = cosines(CAMERA)[..., None]
    to_pane = FOG.transmittance((pane_x_m - EYE_M[0]) / cosine)
    beyond = FOG.transmittance((WALL_X_M - pane_x_m) / cosine)
    once = fresnel(cosine, 1.5)
    reflected = 2 * once / (1 + once)
    through = (1 - reflected) * np.array(MATERIALS[material].colour)
    behind_pane = beyond * CLAY_CD_M2 + (1 - beyond) * airlight
    at_pane = through * behind_pane + reflected * airlight  # it mirrors the sky, which is airlight
    expected = to_pane * at_pane + (1 - to_pane) * airlight
    np.testing.assert_allclose(foggy, expected.mean(0), rtol=1e-5)


def test_fog_lies_before_a_mirror_and_on_the_way_to_what_it_shows(snap: Any, even_light: Any) -> None:
    mirror_x_m, back_x_m = 3.0, -4.0
    mirror = Thing("mirror", board(mirror_x_m, 40.0, 40.0), "mirror")
    back = Thing("back", quad((back_x_m, -50.0, -50.0), (0, 100, 0), (0, 0, 100)), "clay")
    shown = Scene("mirror", (mirror, back), MATERIALS, (), fog=FOG)
    foggy = snap(shown)
    airlight = airlight_cd_m2(even_light(shown))

    cosine = cosines(CAMERA)[..., None]
    to_mirror = FOG.transmittance((mirror_x_m - EYE_M[0]) / cosine)
    onwards = FOG.transmittance((mirror_x_m - back_x_m) / cosine)
    at_mirror = 0.8 * (onwards * CLAY_CD_M2 + (1 - onwards) * airlight)
    expected = to_mirror * at_mirror + (1 - to_mirror) * airlight
    np.testing.assert_allclose(foggy, expected.mean(0), rtol=1e-5)


def test_where_all_is_as_bright_as_the_airlight_fog_is_not_seen(snap: Any) -> None:
    things = [Thing("pane", board(1.0, 2.0, 1.0), "glass"), Thing("mirror", board(2.0, 3.0, 0.5), "perfect")]
    clear = snap(grey_room(None, *things))
    foggy = snap(grey_room(Fog(visibility_m=5.0), *things))
    np.testing.assert_allclose(foggy, clear, rtol=1e-5)


def test_fog_of_endless_visibility_is_clear_air_and_dense_fog_is_airlight(snap: Any, even_light: Any) -> None:
    clear = snap(wall_ahead("clay", None))
    np.testing.assert_allclose(snap(wall_ahead("clay", Fog(visibility_m=1e5))), clear, rtol=1e-3)
    dense = snap(wall_ahead("clay", Fog(visibility_m=1.0)))
    airlight = airlight_cd_m2(even_light(wall_ahead("clay", None)))
    np.testing.assert_allclose(dense, np.broadcast_to(airlight, dense.shape), rtol=1e-5)
