"""Wet ground mirrors by Fresnel's law and is darker than dry ground; puddles divide faces and cover their share."""

from typing import Any

import numpy as np
import pytest

from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.triangle import areas_m2
from vobench.rendering.renderer import single_instant
from vobench.rendering.wet_ground import FILM_ROUGHNESS, random_puddles, wetted
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE, WATER_ETA, Material, fresnel, inner_reflectance
from vobench.scene.mesh import as_arrays, face_corners, joined, quad
from vobench.scene.rain import Rain
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing

SKY = Sky("sky", 1000.0)
MATERIALS = {
    "asphalt": Material(colour=(0.1, 0.1, 0.1)),
    "white": Material(colour=(0.8, 0.8, 0.8)),
    "leaf": Material(colour=(0.1, 0.5, 0.1), cutout=0.5),
    "lacquer": Material(colour=(0.5, 0.1, 0.1), eta=1.5),
}
SIDE_M = 30.0
RAIN = Rain(rate_mm_per_h=0.0, puddles=0.3)
GROUND = Thing("ground", quad((-SIDE_M / 2, -SIDE_M / 2, 0), (SIDE_M, 0, 0), (0, SIDE_M, 0)), "asphalt")


def scene(*things: Thing, rain: Rain | None = RAIN) -> Scene:
    return Scene("yard", things or (GROUND,), MATERIALS, (SKY,), rain=rain)


def area_m2(wet: Scene, material: str) -> float:
    return float(sum(areas_m2(face_corners(thing.mesh)).sum() for thing in wet.things if thing.material == material))


def test_without_rain_a_scene_stays_as_it_is() -> None:
    dry = scene(rain=None)
    assert wetted(dry) is dry


def test_puddles_and_the_film_divide_the_ground_without_gaps() -> None:
    wet = wetted(scene())
    assert {thing.material for thing in wet.things} == {"asphalt (wet)", "asphalt (puddle)"}
    assert {thing.name for thing in wet.things} == {"ground"}
    parts = [face_corners(thing.mesh) for thing in wet.things]
    assert sum(areas_m2(corners_m).sum() for corners_m in parts) == pytest.approx(SIDE_M**2, rel=1e-6)
    corners_m = np.concatenate(parts)
    edges = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
    assert (edges[:, 2] > 0).all()  # all faces are visible from above
    np.testing.assert_array_equal(corners_m[..., 2], 0)
    # A grid of points: each is in one face, so faces do not overlap.
    points_m = np.random.default_rng(0).uniform(-SIDE_M / 2, SIDE_M / 2, (300, 2))
    assert {faces_at(corners_m, point_m) for point_m in points_m} == {1}


def faces_at(corners_m: Any, point_m: Any) -> int:
    a, b, c = corners_m[..., :2].swapaxes(0, 1)
    sides = [
        (end - start)[:, 0] * (point_m - start)[:, 1] - (end - start)[:, 1] * (point_m - start)[:, 0]
        for start, end in ((a, b), (b, c), (c, a))
    ]
    return int((np.array(sides) > 0).all(0).sum())


def test_the_texture_lies_where_it_lay() -> None:
    for thing in wetted(scene()).things:
        mesh = as_arrays(thing.mesh)
        np.testing.assert_allclose(mesh.uv, mesh.vertices_m[:, :2] + SIDE_M / 2, atol=1e-9)
        np.testing.assert_allclose(mesh.normals, np.broadcast_to([0, 0, 1], mesh.normals.shape), atol=1e-9)


@pytest.mark.parametrize("share", [0.1, pytest.param(0.4, marks=pytest.mark.slow)])
def test_puddles_cover_their_share_on_average(share: float) -> None:
    shares = []
    for seed in range(12):
        wet = wetted(scene(rain=Rain(rate_mm_per_h=0.0, puddles=share, seed=seed)))
        shares.append(area_m2(wet, "asphalt (puddle)") / SIDE_M**2)
    error = np.std(shares) / np.sqrt(len(shares))
    assert np.mean(shares) == pytest.approx(share, abs=3 * error + 0.02)


def test_two_faces_agree_on_the_puddles_at_their_common_edge() -> None:
    """Both have a corner wherever an outline crosses the edge, so there are no gaps, and outlines have no steps."""
    wet = wetted(scene())
    on_edge = []
    for thing in wet.things:
        corners_m = face_corners(thing.mesh)[..., :2]
        is_on_diagonal = np.abs(corners_m[..., 0] - corners_m[..., 1]) < 1e-9
        middles_m = corners_m.mean(1)
        is_right = middles_m[:, 0] > middles_m[:, 1]
        for side in (is_right, ~is_right):
            along_m = np.unique(np.round(corners_m[side][is_on_diagonal[side]][:, 0], 6))
            on_edge.append(set(along_m.tolist()))
    film_right, film_left, puddle_right, puddle_left = on_edge
    assert len(puddle_right) > 4
    assert film_right | puddle_right == film_left | puddle_left
    assert len(puddle_right & puddle_left) >= 0.8 * len(puddle_right | puddle_left)


def test_a_larger_share_has_the_puddles_of_a_smaller_one_and_more() -> None:
    level_m = face_corners(GROUND.mesh)
    few = random_puddles(Rain(puddles=0.1), level_m)
    many = random_puddles(Rain(puddles=0.4), level_m)
    assert len(many) > len(few) > 0
    np.testing.assert_array_equal(many.middles_m[: len(few)], few.middles_m)


def test_what_is_under_a_roof_is_steep_or_takes_no_film_stays_dry() -> None:
    overhang_m = SIDE_M + 2
    roof = Thing("roof", quad((-overhang_m / 2, -overhang_m / 2, 5), (overhang_m, 0, 0), (0, overhang_m, 0)), "white")
    assert area_m2(wetted(scene(GROUND, roof)), "asphalt") == pytest.approx(SIDE_M**2)
    wall = Thing("wall", quad((0, 0, 0), (1, 0, 0), (0, 0, 3)), "white")
    card = Thing("leaf", quad((0, 0, 1), (1, 0, 0), (0, 1, 0)), "leaf")
    car = Thing("car", quad((3, 0, 1), (1, 0, 0), (0, 1, 0)), "lacquer")
    for thing in (wall, card, car):
        assert wetted(scene(thing)).things[0].material == thing.material


def test_a_slope_is_wet_but_has_no_puddles() -> None:
    slope = Thing("slope", quad((0, 0, 0), (10, 0, 1), (0, 10, 0)), "white")
    assert {thing.material for thing in wetted(scene(slope)).things} == {"white (wet)"}
    assert wetted(scene(slope)).materials["white (wet)"].roughness == FILM_ROUGHNESS


def test_a_thing_with_a_dry_part_keeps_it() -> None:
    box = joined([quad((0, 0, 1), (4, 0, 0), (0, 4, 0)), quad((0, 0, 0), (4, 0, 0), (0, 0, 1))])
    wet = wetted(scene(Thing("box", box, "white")))
    assert area_m2(wet, "white") == pytest.approx(4)
    assert area_m2(wet, "white (wet)") + area_m2(wet, "white (puddle)") == pytest.approx(16)


def test_a_puddle_mirrors_by_fresnels_law_and_darkens_what_is_below(draw: Any, even_light: Any) -> None:
    """Looking down on a puddle before a wall, which it mirrors: L = F L_wall + body (1 - F)."""
    camera = Pinhole(40, 200, 150.0, 150.0, 19.5, 99.5)
    wall = Thing("wall", quad((6, 40, -1), (0, -80, 0), (0, 0, 60)), "white")
    ground = Thing("ground", quad((-20, -40, 0), (26, 0, 0), (0, 80, 0)), "asphalt")
    dry = scene(ground, wall, rain=None)
    flooded = Scene(
        "flooded",
        (Thing("ground", ground.mesh, "water"), wall),
        {**MATERIALS, "water": wetted(scene()).materials["asphalt (puddle)"]},
        (SKY,),
    )
    eye = looking(pitch_deg=35, position_m=(0.0, 0.0, 1.5))
    view = single_instant(camera, eye)
    before = draw(even_light(dry)).radiance(camera, view, weights=LUMINANCE)[:, 20].astype(float)
    after = draw(even_light(flooded)).radiance(camera, view, weights=LUMINANCE)[:, 20].astype(float)

    rows = np.arange(camera.height_px)
    down_rad = np.deg2rad(35) + np.arctan((rows - camera.cy_px) / camera.fy_px)
    is_ground = (1.5 / np.tan(down_rad) < 5.8) & (down_rad > 0)
    assert is_ground.sum() > 100
    cosine = np.sin(down_rad[is_ground])
    F = fresnel(cosine, WATER_ETA)
    assert F.max() > 2.5 * F.min()
    wall_cd_m2 = 0.8 * 100 / np.pi
    entering = 100 / np.pi  # the even light of these tests is that which enters a coat
    body = 0.1 / (1 - 0.1 * inner_reflectance(WATER_ETA)) / WATER_ETA**2 * entering
    np.testing.assert_allclose(after[is_ground], F * wall_cd_m2 + (1 - F) * body, rtol=0.01)
    np.testing.assert_allclose(before[is_ground], 0.1 * 100 / np.pi, rtol=1e-3)
    assert (1 - F).max() * body < 0.65 * before[is_ground].min()
