"""Mirrors and panes: images where reflection puts them, nothing from behind, and the shares that Fresnel says."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.rendering.panoramas import PANORAMA
from tests.rendering.rectangles import Rectangle, box, rectangle, room, sheet
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import KannalaBrandt, Pinhole, pixel_grid
from vobench.geometry.rig import LENSES, looking, stereo_rig
from vobench.geometry.se3 import Array
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, single_instant
from vobench.rendering.view import Plane, visible_boxes, within
from vobench.scene.light import Sky, Steady
from vobench.scene.material import Material, fresnel, pane_reflectance, under_coat
from vobench.scene.scene import Scene

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
AHEAD = looking(pitch_deg=20, position_m=(0.2, 0.1, 0.4))
MATERIALS = {
    "grey": Material(texture=Procedural("plain", 0.5, 0, 1, 8, 0)),
    "bright": Material(texture=Procedural("plain", 0.9, 0, 1, 8, 0)),
    "busy": Material(texture=Procedural("terrazzo", 0.5, 0.6, 1.0, 512, 1)),
    "steel": Material("mirror", tint=0.8),
    "wax": Material(texture=Procedural("plain", 0.3, 0, 1, 8, 0), eta=1.7, tint=0.9),
    "glass": Material("pane", eta=1.5, tint=0.7),
}
LUMINANCE = 0.5 * 100 / np.pi  # of grey under 100 lx


def snap(renderer: RasterRenderer, T_world_camera: Array, camera: Pinhole = CAMERA) -> Radiance:
    return renderer.radiance(camera, single_instant(camera, T_world_camera))


def upside_down(surface: Rectangle) -> Rectangle:
    """A surface's image in the plane z = 0."""
    flip = np.array([1.0, 1.0, -1.0])
    edges = flip * surface.edge_u_m, flip * surface.edge_v_m
    return sheet(flip * surface.corner_m, *edges, surface.material, surface.name)


def pixel_rays(T_world_camera: Array) -> Array:
    rays: Array = CAMERA.rays(pixel_grid(CAMERA)) @ T_world_camera[:3, :3].T
    return rays


def test_reflecting_twice_changes_nothing_and_points_of_the_plane_stay() -> None:
    plane = Plane(np.array([0.6, 0.0, 0.8]), -1.5)
    np.testing.assert_allclose(plane.reflection @ plane.reflection, np.eye(4), atol=1e-12)
    on_plane = np.array([2.5 * 0.6 + 0.8, 3.0, 1.5 * 0.8 - 0.36, 1.0])
    on_plane[:3] -= plane.distance_m(on_plane[:3]) * plane.normal
    np.testing.assert_allclose(plane.reflection @ on_plane, on_plane, atol=1e-12)


def test_a_moved_plane_holds_the_moved_points() -> None:
    plane, T = Plane(np.array([0.0, 0.6, 0.8]), 0.7), se3.transform(se3.rotation_z(0.4), [1.0, -2.0, 0.3])
    point = np.array([0.3, 0.9, -1.2])
    assert plane.moved(T).distance_m(se3.apply(T, point[None])[0]) == pytest.approx(plane.distance_m(point))


@pytest.mark.parametrize("quad", ["ahead", "astride", "behind"])
def test_the_box_around_a_quad_is_what_it_can_touch_and_no_more(quad: str) -> None:
    z = {"ahead": [2, 2, 4, 4], "astride": [-1, -1, 4, 4], "behind": [-1, -1, -2, -2]}[quad]
    corners = np.stack([[-0.5, 0.5, 0.5, -0.5], [0.3] * 4, z], -1).astype(float)
    whole = (0, CAMERA.width_px, 0, CAMERA.height_px)
    found = within(visible_boxes(CAMERA, np.stack([corners, corners + 1]))[0], whole)
    if quad == "behind":
        assert found is None
        return
    assert found is not None
    assert found[2] == pytest.approx(59.5 + 136.2 * 0.3 / 4, abs=2)
    assert found[3] == (pytest.approx(59.5 + 136.2 * 0.3 / 2, abs=3) if quad == "ahead" else CAMERA.height_px)


@pytest.mark.parametrize("lens", LENSES.values(), ids=list(LENSES))
def test_what_a_mirror_floor_shows_lies_where_reflection_puts_it(
    hall: Any, even_light: Any, draw: Any, measure: Any, lens: Pinhole
) -> None:
    materials = {
        "steel": Material("mirror", tint=1.0),
        "coarse": Material(texture=Procedural("checker", 0.5, 0.8, 3.2, 1024, 0)),
    }
    surfaces = tuple(room((8, 8, 3), floor="steel", wall="coarse", ceiling="coarse"))
    renderer = draw(even_light(Scene("hall", surfaces, materials, ())))
    images = [replace(lattice, surface=upside_down(lattice.surface)) for lattice in hall.lattices[1:]]
    images = [replace(image, corners_m=image.corners_m * [1, 1, -1]) for image in images]
    errors, half = [], 15
    for heading in (0.3, 2.1, 4.4):
        for pitch_deg in (20, 50):
            rig = stereo_rig(lens, pitch_deg=pitch_deg)
            T = se3.transform(se3.rotation_z(heading), (0.3, -0.2, 0)) @ rig.T_body_left
            picture = renderer.radiance(lens, single_instant(lens, T))
            for image, uv in replace(hall, lattices=tuple(images)).corners(lens, T):
                for u, v in np.rint(uv).astype(int):
                    seen = picture[v - half : v + half + 1, u - half : u + half + 1] * np.pi / 100
                    exact = measure.exact_window(lens, T, image, np.array([u, v]), half)
                    errors.append(measure.shift_px(seen, exact))
    measure.check(np.array(errors), at_least=60)


@pytest.mark.parametrize("hidden", [True, False])
def test_what_stands_behind_a_mirror_is_not_seen_in_it(draw: Any, even_light: Any, hidden: bool) -> None:
    panel = rectangle(np.array([2.0, 0, 0.5]), np.array([0, 0, 1.6]), np.array([0, 1.6, 0]), "steel")
    x = 2.6 if hidden else 1.0
    crate = box(np.array([x, 0, 0.3]), (0.4, 0.4, 0.4), yaw_deg=20, material="bright")
    surfaces = (*room((8, 8, 3), floor="grey", wall="grey", ceiling="grey"), panel)
    without, beside = (Scene("panel", s, MATERIALS, ()) for s in (surfaces, (*surfaces, *crate)))
    pictures = [snap(draw(even_light(scene)), AHEAD) for scene in (without, beside)]
    assert np.array_equal(*pictures) == hidden


def test_a_mirror_dims_by_its_tint_and_shows_its_back_nowhere(draw: Any, even_light: Any) -> None:
    panel = rectangle(np.array([1.5, 0, 0.5]), np.array([0, 0, 4.0]), np.array([0, 4.0, 0]), "steel")
    surfaces = (*room((6, 6, 5), floor="grey", wall="grey", ceiling="grey"), panel)
    renderer = draw(even_light(Scene("panel", surfaces, MATERIALS, ())))
    np.testing.assert_allclose(snap(renderer, AHEAD)[20:50, 60:120], 0.8 * LUMINANCE, rtol=3e-5)
    behind = se3.transform(se3.rotation_z(np.pi), (2.5, 0, 0)) @ AHEAD
    np.testing.assert_allclose(snap(renderer, behind)[20:50, 60:120], LUMINANCE, rtol=3e-5)


@pytest.mark.parametrize("pitch_deg", [90, 45, 15])
def test_a_polished_floor_shares_light_between_body_and_mirror_as_fresnel_says(
    draw: Any, even_light: Any, pitch_deg: float
) -> None:
    surfaces = tuple(room((6, 6, 3), floor="wax", wall="grey", ceiling="grey"))
    T = looking(pitch_deg=pitch_deg, position_m=(0, 0, 0.4))
    picture = snap(draw(even_light(Scene("room", surfaces, MATERIALS, ()))), T)
    rays = pixel_rays(T)
    floor = rays[..., 2] < -0.4 / 2.9 * np.linalg.norm(rays[..., :2], axis=-1) * 1.05
    F = fresnel(-rays[..., 2], 1.7)
    body = under_coat(np.array(0.3), 1.7) * 100 / np.pi
    np.testing.assert_allclose(picture[floor], (body * (1 - F) + 0.9 * F * LUMINANCE)[floor], rtol=1e-3)
    assert floor.sum() > 5000


SKY = Sky("sky", np.pi * 50, "uniform", ground_albedo=1.0)  # 50 cd/m² all around


@pytest.mark.parametrize("outside", [False, True])
def test_a_pane_lets_pass_and_mirrors_the_right_shares_from_both_sides(
    draw: Any, even_light: Any, outside: bool
) -> None:
    walls = [s for s in room((4, 4, 3), floor="grey", wall="grey", ceiling="grey") if s.name != "wall_east"]
    pane = rectangle(np.array([2.0, 0, 1.5]), np.array([0, 0, 3.0]), np.array([0, 4.0, 0]), "glass")
    renderer = draw(even_light(Scene("room", (*walls, pane), MATERIALS, (SKY,))))
    turn = se3.transform(se3.rotation_z(np.pi * outside), (4.0 * outside, 0, 0))
    T = turn @ looking(pitch_deg=0, position_m=(0, 0, 1.5))
    picture, rays = snap(renderer, T), pixel_rays(T)
    R = pane_reflectance(rays[..., 0], 1.5)
    behind, before = (LUMINANCE, 50.0) if outside else (50.0, LUMINANCE)
    expected = (1 - R) * 0.7 * behind + R * before
    middle = (slice(30, 90), slice(30, 150))
    np.testing.assert_allclose(picture[middle], expected[middle], rtol=1e-3)


def test_panes_one_behind_the_other_dim_one_after_the_other(draw: Any, even_light: Any) -> None:
    panes = [rectangle(np.array([x, 0, 0.4]), np.array([0, 0, 2]), np.array([0, 2.0, 0]), "glass") for x in (2.0, 1.0)]
    lit = replace(SKY, illuminance_lx=1e-6)
    wall = rectangle(np.array([3.0, 0, 0.4]), np.array([0, 0, 4.0]), np.array([0, 4.0, 0]), "grey")
    picture = snap(draw(even_light(Scene("panes", (wall, *panes), MATERIALS, (lit,)))), AHEAD)
    R = pane_reflectance(pixel_rays(AHEAD)[..., 0], 1.5)
    # Straight through both, and once to and fro between them; what stands before them shows them its back.
    expected = ((1 - R) * 0.7) ** 2 * (1 + R**2) * LUMINANCE
    np.testing.assert_allclose(picture[40:45, 80:100], expected[40:45, 80:100], rtol=1e-3)


@pytest.mark.parametrize("kind", ["uniform", "overcast", "clear"])
def test_where_nothing_stands_the_sky_shows_its_luminance(draw: Any, even_light: Any, kind: str) -> None:
    sky = Sky("sky", 10000.0, kind, sun_direction=np.array([0.6, 0.48, 0.64]))
    floor = rectangle(np.array([0, 0, -50.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "grey")
    T = looking(pitch_deg=-20, position_m=(0, 0, 0))
    picture = snap(draw(even_light(Scene("sky", (floor,), MATERIALS, (sky,)))), T)
    expected = sky.luminance_cd_m2(pixel_rays(T))
    inside = np.ones_like(picture, bool)
    horizon = np.flatnonzero(np.diff(np.sign(pixel_rays(T)[:, 90, 2])))
    for row in horizon:
        inside[row - 1 : row + 3] = False
    np.testing.assert_allclose(picture[inside], expected[inside], rtol=2e-3)


LUMINANCE_OF_RGB = (0.2126, 0.7152, 0.0722)


@pytest.mark.parametrize("heading_deg", [0, 90, 180])
def test_a_panorama_is_seen_in_all_directions_without_a_seam(draw: Any, even_light: Any, heading_deg: float) -> None:
    floor = rectangle(np.array([0, 0, -50.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "grey")
    turn = se3.transform(se3.rotation_z(np.deg2rad(heading_deg)), np.zeros(3))
    T = turn @ looking(pitch_deg=-10, position_m=(0, 0, 0))
    renderer = draw(even_light(Scene("sky", (floor,), MATERIALS, (PANORAMA,))))
    picture = renderer.radiance(CAMERA, single_instant(CAMERA, T), weights=None)
    expected = PANORAMA.seen_cd_m2(pixel_rays(T))
    np.testing.assert_allclose(picture, expected, rtol=0.01)
    grey = renderer.radiance(CAMERA, single_instant(CAMERA, T), weights=LUMINANCE_OF_RGB)
    np.testing.assert_allclose(grey.squeeze(), expected @ LUMINANCE_OF_RGB, rtol=0.01)


def test_a_pane_lets_its_share_of_a_panorama_pass(draw: Any, even_light: Any) -> None:
    walls = [s for s in room((4, 4, 3), floor="grey", wall="grey", ceiling="grey") if s.name != "wall_east"]
    pane = rectangle(np.array([2.0, 0, 1.5]), np.array([0, 0, 3.0]), np.array([0, 4.0, 0]), "glass")
    T = looking(pitch_deg=0, position_m=(0, 0, 1.5))
    picture = snap(draw(even_light(Scene("room", (*walls, pane), MATERIALS, (PANORAMA,)))), T)
    rays = pixel_rays(T)
    R = pane_reflectance(rays[..., 0], 1.5)
    behind = PANORAMA.seen_cd_m2(rays) @ LUMINANCE_OF_RGB
    expected = (1 - R) * 0.7 * behind + R * LUMINANCE
    middle = (slice(30, 90), slice(30, 150))
    np.testing.assert_allclose(picture.squeeze()[middle], expected[middle], rtol=0.01)


def test_the_windows_of_a_panorama_are_lit_in_the_dark_alone(draw: Any, even_light: Any) -> None:
    floor = rectangle(np.array([0, 0, -50.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "grey")
    expected = PANORAMA.seen_cd_m2(pixel_rays(AHEAD)) @ LUMINANCE_OF_RGB
    night = replace(PANORAMA, level=Steady(1e-3))
    picture = snap(draw(even_light(Scene("sky", (floor,), MATERIALS, (night,)))), AHEAD).squeeze()
    np.testing.assert_allclose(picture, 1e-3 * expected + 7.0, rtol=0.01)


def test_two_skies_add_up(draw: Any, even_light: Any) -> None:
    skies = [Sky("one", 1000.0, "clear"), Sky("two", 500.0, "overcast")]
    floor = rectangle(np.array([0, 0, -50.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "grey")
    both, *each = (
        snap(draw(even_light(Scene("sky", (floor,), MATERIALS, tuple(lights)))), AHEAD)
        for lights in (skies, skies[:1], skies[1:])
    )
    np.testing.assert_allclose(both, each[0] + each[1], rtol=1e-5)


def test_a_mirror_shows_the_sky_as_it_is_in_that_direction(draw: Any, even_light: Any) -> None:
    sky = Sky("sky", 10000.0, "clear", sun_direction=np.array([0.6, 0.48, 0.64]))
    floor = rectangle(np.zeros(3), np.array([40.0, 0, 0]), np.array([0, 40.0, 0]), "steel")
    picture = snap(draw(even_light(Scene("sky", (floor,), MATERIALS, (sky,)))), AHEAD)
    mirrored = pixel_rays(AHEAD) * [1, 1, -1]
    np.testing.assert_allclose(picture[60:], 0.8 * sky.luminance_cd_m2(mirrored)[60:], rtol=2e-3)


def test_mirrors_work_through_a_fisheye_too(draw: Any, even_light: Any) -> None:
    camera = KannalaBrandt(240, 240, 90.0, 90.0, 119.5, 119.5, 0.0, 0.0, 0.0, 0.0)
    sky = Sky("sky", 10000.0, "clear", sun_direction=np.array([0.6, 0.48, 0.64]))
    floor = rectangle(np.zeros(3), np.array([60.0, 0, 0]), np.array([0, 60.0, 0]), "steel")
    T = looking(pitch_deg=90, position_m=(0, 0, 0.4))
    picture = draw(even_light(Scene("sky", (floor,), MATERIALS, (sky,)))).radiance(camera, single_instant(camera, T))
    rays = camera.rays(pixel_grid(camera)) @ T[:3, :3].T
    inside = rays[..., 2] < -0.15
    expected = 0.8 * sky.luminance_cd_m2(rays * [1, 1, -1])
    np.testing.assert_allclose(picture[inside], expected[inside], rtol=6e-3)
    assert inside.sum() > 30_000


def test_a_rough_mirror_in_even_light_loses_only_what_its_facets_hide(draw: Any, even_light: Any) -> None:
    surfaces = tuple(room((6, 6, 3), floor="brushed", wall="grey", ceiling="grey"))
    T = looking(pitch_deg=60, position_m=(0, 0, 0.4))
    for roughness in (0.02, 0.1, 0.3):
        materials = MATERIALS | {"brushed": Material("mirror", tint=0.8, roughness=roughness)}
        share = snap(draw(even_light(Scene("room", surfaces, materials, ()))), T) / (0.8 * LUMINANCE)
        assert share.max() < 1.001
        assert share.min() > 1 - 0.8 * roughness


def test_the_smoother_a_mirror_the_nearer_its_picture_to_the_exact_one(draw: Any, even_light: Any) -> None:
    crate = box(np.array([1.5, 0.1, 0.4]), (0.5, 0.5, 0.8), yaw_deg=30, material="busy")
    surfaces = (*room((6, 6, 3), floor="brushed", wall="busy", ceiling="grey"), *crate)
    pictures = [
        snap(
            draw(
                even_light(
                    Scene("room", surfaces, MATERIALS | {"brushed": Material("mirror", tint=0.8, roughness=a)}, ())
                )
            ),
            AHEAD,
        )
        for a in (0.0, 0.001, 0.01, 0.05)
    ]
    floor = slice(70, 120)
    errors = [np.abs(rough - pictures[0])[floor].mean() / pictures[0][floor].mean() for rough in pictures[1:]]
    assert errors[0] < 0.03
    assert errors == sorted(errors)
