"""Mirrors in mirrors: images of images where geometry puts them, and the light that is left after each."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.rendering.rectangles import Rectangle, box, rectangle, room, sheet
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.rig import LENSES, looking, stereo_rig
from vobench.geometry.se3 import Array
from vobench.rendering.illumination import AmbientLight, Illumination
from vobench.rendering.render_target import MIRRORS
from vobench.rendering.renderer import View, single_instant
from vobench.rendering.view import Plane
from vobench.scene.light import Sky
from vobench.scene.material import Material, fresnel, pane_reflectance, under_coat
from vobench.scene.scene import Scene

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
MATERIALS: dict[str, Material] = {
    "grey": Material(texture=Procedural("plain", 0.5, 0, 1, 8, 0)),
    "bright": Material(texture=Procedural("plain", 0.9, 0, 1, 8, 0)),
    "coarse": Material(texture=Procedural("checker", 0.5, 0.8, 3.2, 1024, 0)),
    "steel": Material("mirror", tint=0.8),
    "brushed": Material("mirror", tint=0.8, roughness=0.05),
    "wax": Material(texture=Procedural("plain", 0.3, 0, 1, 8, 0), eta=1.7, tint=0.9),
    "glass": Material("pane", eta=1.5, tint=0.7),
}
LUMINANCE, TINT = 0.5 * 100 / np.pi, 0.8  # of grey under 100 lx, of steel
FLOOR, EAST = Plane(np.array([0, 0, 1.0]), 0.0), Plane(np.array([-1.0, 0, 0]), 4.0)
HALF_M, HEIGHT_M = 4.0, 3.0


def hall_of(changes: dict[str, str], *, floor: str = "grey", wall: str = "grey") -> list[Rectangle]:
    """A room, 8 × 8 × 3 m, with other materials on some sides."""
    sides = room((2 * HALF_M, 2 * HALF_M, HEIGHT_M), floor=floor, wall=wall, ceiling=wall)
    return [replace(side, material=changes.get(side.name, side.material)) for side in sides]


def image_of(surface: Rectangle, plane: Plane) -> Rectangle:
    corner, R = se3.apply(plane.reflection, surface.corner_m[None])[0], plane.reflection[:3, :3]
    return sheet(corner, R @ surface.edge_u_m, R @ surface.edge_v_m, surface.material, surface.name)


def pixel_rays(T_world_camera: Array) -> Array:
    rays: Array = CAMERA.rays(pixel_grid(CAMERA)) @ T_world_camera[:3, :3].T
    return rays


def reach(rays: Array, eye_m: Array, axis: int, low: float, high: float) -> Array:
    """How far rays go until they leave the span of an axis."""
    with np.errstate(divide="ignore"):
        far: Array = np.where(rays[..., axis] > 0, high - eye_m[axis], low - eye_m[axis]) / rays[..., axis]
    return far


def test_the_image_of_an_image_lies_where_two_reflections_put_it(
    hall: Any, even_light: Any, draw: Any, measure: Any
) -> None:
    surfaces = hall_of({"wall_east": "steel"}, floor="steel", wall="coarse")
    renderer = draw(even_light(Scene("hall", tuple(surfaces), MATERIALS, ())))
    twice = FLOOR.reflection @ EAST.reflection
    images = tuple(
        replace(
            lattice,
            surface=image_of(image_of(lattice.surface, EAST), FLOOR),
            corners_m=se3.apply(twice, lattice.corners_m),
        )
        for lattice in hall.lattices[1:]
        if lattice.surface.name != "wall_east"
    )
    lens, errors, half = LENSES["paper_literal"], [], 15
    for heading, x_m, pitch_deg in ((0.0, 3.2, 45), (0.5, 2.5, 30), (-0.4, 2.8, 38), (0.1, 1.5, 25)):
        rig = stereo_rig(lens, pitch_deg=pitch_deg)
        T = se3.transform(se3.rotation_z(heading), (x_m, -0.2, 0)) @ rig.T_body_left
        picture = renderer.radiance(lens, single_instant(lens, T))
        for image, uv in replace(hall, lattices=images).corners(lens, T, apart_px=32):
            for u, v in np.rint(uv).astype(int):
                seen = picture[v - half : v + half + 1, u - half : u + half + 1] * np.pi / 100
                errors.append(measure.shift_px(seen, measure.exact_window(lens, T, image, np.array([u, v]), half)))
    measure.check(np.array(errors), at_least=40)


@pytest.mark.parametrize(("x_m", "y_m", "seen"), [(-2.6, 0.3, False), (2.8, 1.3, True), (2.6, 0.0, False)])
def test_two_mirrors_face_to_face_hide_what_is_behind_them_but_not_what_is_beside(
    draw: Any, even_light: Any, x_m: float, y_m: float, seen: bool
) -> None:
    near = rectangle(np.array([2.0, 0, 0.7]), np.array([0, 0, 1.2]), np.array([0, 1.6, 0]), "steel")
    far = rectangle(np.array([-2.0, 0, 0.7]), np.array([0, 2.4, 0]), np.array([0, 0, 1.3]), "steel")
    crate = box(np.array([x_m, y_m, 0.4]), (0.3, 0.3, 0.3), yaw_deg=20, material="bright")
    T = looking(pitch_deg=0, position_m=(0.2, 0.1, 0.5))
    in_near = np.abs(0.1 + 1.8 * pixel_rays(T)[..., 1] / pixel_rays(T)[..., 0]) < 0.75
    surfaces = [*hall_of({}), near, far]
    without, beside = (
        draw(even_light(Scene("mirrors", tuple(s), MATERIALS, ()))).radiance(CAMERA, single_instant(CAMERA, T))[in_near]
        for s in (surfaces, [*surfaces, *crate])
    )
    # What the last mirror shows is the mean of the scene, which the crate's own light is part of.
    assert (np.abs(beside - without).max() > 0.2 * LUMINANCE) == seen


def test_between_parallel_mirrors_light_dims_by_the_tint_at_each_of_them(draw: Any, even_light: Any) -> None:
    surfaces = hall_of({"wall_east": "steel", "wall_west": "steel"})
    renderer = draw(even_light(Scene("hall", tuple(surfaces), MATERIALS, ())))
    T = looking(pitch_deg=5, position_m=(0.2, 0.1, 0.8))
    rays, eye_m = pixel_rays(T), T[:3, 3]
    way = np.minimum(reach(rays, eye_m, 1, -HALF_M, HALF_M), reach(rays, eye_m, 2, 0, HEIGHT_M))
    met = np.floor((eye_m[0] + way * rays[..., 0] + HALF_M) / (2 * HALF_M))
    # The last mirror is not followed: it shows the mean of the scene, which here is what it would show.
    expected = LUMINANCE * TINT ** np.minimum(met, MIRRORS + 1)
    picture = renderer.radiance(CAMERA, single_instant(CAMERA, T))
    same = np.isclose(picture, expected, rtol=1e-4)
    assert min(same[met == n].mean() for n in range(4)) > 0.8
    assert same[met > MIRRORS].mean() > 0.5
    assert same.mean() > 0.95


def test_a_polished_floor_in_a_mirror_mirrors_too(draw: Any, even_light: Any) -> None:
    surfaces = hall_of({"wall_east": "steel"}, floor="wax")
    T = looking(pitch_deg=15, position_m=(2.5, 0.0, 0.8))
    picture = draw(even_light(Scene("hall", tuple(surfaces), MATERIALS, ()))).radiance(
        CAMERA, single_instant(CAMERA, T)
    )
    rays, eye_m = pixel_rays(T), T[:3, 3]
    to_floor, to_mirror = reach(rays, eye_m, 2, 0, HEIGHT_M), reach(rays, eye_m, 0, -HALF_M, HALF_M)
    inside = (rays[..., 2] < 0) & (to_floor > 1.05 * to_mirror) & (to_floor < 6)
    F = fresnel(rays[..., 2], 1.7)
    floor = under_coat(np.array(0.3), 1.7) * 100 / np.pi * (1 - F) + 0.9 * F * LUMINANCE
    np.testing.assert_allclose(picture[inside], TINT * floor[inside], rtol=1e-3)
    assert inside.sum() > 3000


def test_a_pane_in_a_mirror_is_as_clear_and_mirrors_as_much_as_it_does_by_itself(draw: Any, even_light: Any) -> None:
    sky = Sky("sky", np.pi * 50, "uniform", ground_albedo=1.0)  # 50 cd/m² all around
    surfaces = hall_of({"wall_east": "glass"}, floor="steel")
    T = looking(pitch_deg=15, position_m=(1.0, 0.0, 0.8))
    picture = draw(even_light(Scene("hall", tuple(surfaces), MATERIALS, (sky,)))).radiance(
        CAMERA, single_instant(CAMERA, T)
    )
    rays, eye_m = pixel_rays(T), T[:3, 3]
    to_floor, to_pane = reach(rays, eye_m, 2, 0, HEIGHT_M), reach(rays, eye_m, 0, -HALF_M, HALF_M)
    sideways = np.abs(rays[..., 1] / rays[..., 0]) < 0.25
    inside = sideways & (rays[..., 2] < 0) & (to_floor < 0.95 * to_pane) & (to_pane < 1.5 * to_floor)
    R = pane_reflectance(rays[..., 0], 1.5)
    np.testing.assert_allclose(picture[inside], TINT * ((1 - R) * 0.7 * 50 + R * LUMINANCE)[inside], rtol=2e-3)
    assert inside.sum() > 500


def test_strips_of_mirrors_in_mirrors_are_the_whole_picture(draw: Any, even_light: Any) -> None:
    changes = {"wall_east": "steel", "wall_north": "glass", "wall_west": "brushed"}
    surfaces = hall_of(changes, floor="wax", wall="coarse")
    renderer = draw(even_light(Scene("hall", tuple(surfaces), MATERIALS, ())))
    T = se3.transform(se3.rotation_z(0.6), np.zeros(3)) @ looking(pitch_deg=15, position_m=(0.0, 0.0, 0.8))
    now = np.zeros(1, np.int64)
    strips = [View(slice(row, row + 10), T[None], now, now) for row in range(0, 120, 10)]
    assert renderer.radiance(CAMERA, strips).tobytes() == renderer.radiance(CAMERA, single_instant(CAMERA, T)).tobytes()


def test_the_mean_of_a_scene_counts_its_bodies_by_area_and_follows_the_light(even_light: Any) -> None:
    surfaces = hall_of({"wall_east": "steel", "wall_west": "bright", "wall_north": "glass"})
    baked = even_light(Scene("hall", tuple(surfaces), MATERIALS, ()))
    grey_m2, bright_m2 = 2 * 64 + 24, 24
    expected = (0.5 * grey_m2 + 0.9 * bright_m2) / (grey_m2 + bright_m2) * 100 / np.pi
    ambience, light = AmbientLight(baked), Illumination(baked).at(0, 0)
    assert ambience.cd_m2(light) == pytest.approx(expected, rel=1e-3)
    assert ambience.cd_m2(2 * light) == pytest.approx(2 * expected, rel=1e-3)
