"""Direct light on open points agrees with photometry, and with what a mirror shows."""

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats
from vobench.rendering.direct_light import Rays, arriving, direct_light, first_rays, mirror_images, open_light, reached
from vobench.rendering.emitter import Emitter, emitters
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import Material
from vobench.scene.scene import ceiling_light
from vobench.scene.triangles import Thing, triangle_table

MATERIALS = {"a": Material(), "mirror": Material("mirror", tint=0.8)}
X, Y, Z = np.eye(3)
FLOOR = rectangle(0 * Z, 2 * X, 2 * Y, "a", "floor")
BULB = PointLight("bulb", np.array([0.3, -0.2, 1.5]), 4 * np.pi * 100)
PANEL_M = np.array([0.2, 0.1, 2.0])
PANEL = ceiling_light("panel", PANEL_M, (0.4, 0.3), power_lm=500)


def open_floor(*more: Thing, spacing_m: float = 0.1) -> tuple[Texels, TexelLayout, Visibility]:
    things = [FLOOR, *more]
    faces = triangle_table(things, [-1] * len(things), [-1] * len(things))
    lit = faces.thing == 0
    atlas = unwrap(faces, np.full(len(faces), spacing_m), lit)
    visibility = Visibility(faces, MATERIALS, np.arange(len(faces)))
    points, layout = texels(faces, MATERIALS, atlas, owners(atlas), among=lit, seed=0, visibility=visibility)
    return points, layout, visibility


def lit_by(light: Light, *more: Thing, side: int = 4) -> tuple[Array, Array]:
    """Points (P, 3) and their illuminance (P,) by an emitter of a light and all its images in mirrors."""
    points, layout, visibility = open_floor(*more)
    cells = np.zeros(len(points), np.int32)
    among = np.ones(len(points), bool)
    total = np.zeros(len(points))
    for emitter in [*emitters(light, visibility), *mirror_images(light, visibility, t_ns=0)]:
        total += direct_light(emitter, points, layout, cells, visibility, side=side, among=among)
    return points.points_m.astype(float), total


def by_inverse_square(points_m: Array, position_m: Array, intensity_cd: float) -> Array:
    vectors = position_m - points_m
    return intensity_cd * vectors[:, 2] / np.linalg.norm(vectors, axis=1) ** 3


def test_a_bulb_lights_by_the_inverse_square_and_the_cosine() -> None:
    points_m, light_lx = lit_by(BULB)
    np.testing.assert_allclose(light_lx, by_inverse_square(points_m, BULB.position_m, 100), rtol=1e-4)


def test_a_spot_is_dark_outside_its_cone() -> None:
    spot = SpotLight("spot", np.array([0.0, 0, 1.0]), -Z, 300.0, 10.0, 20.0)
    points_m, light_lx = lit_by(spot)
    angle_deg = np.rad2deg(np.arctan(np.linalg.norm(points_m[:, :2], axis=1)))
    assert (light_lx[angle_deg > 20.5] == 0).all()
    centre = angle_deg < 9.5
    np.testing.assert_allclose(
        light_lx[centre], by_inverse_square(points_m, spot.position_m, spot.peak_cd)[centre], rtol=1e-3
    )


def test_the_sun_lights_open_ground_by_the_sine_of_its_elevation() -> None:
    _, light_lx = lit_by(Sun("sun", 1000.0, (0.0,), (40.0,), (30.0,)))
    np.testing.assert_allclose(light_lx, 500.0, rtol=2e-3)


def test_the_open_sky_lights_level_ground_by_its_illuminance() -> None:
    _, light_lx = lit_by(Sky("sky", 2000.0, "overcast"), side=12)
    assert light_lx.mean() == pytest.approx(2000.0, rel=0.01)


def test_a_panel_far_away_is_a_point_with_the_cosine_of_its_face() -> None:
    far = ceiling_light("far", np.array([0.0, 0, 30.0]), (0.4, 0.3), power_lm=5000)
    points_m, light_lx = lit_by(far)
    vectors = np.array([0, 0, 30.0]) - points_m
    cosine = vectors[:, 2] / np.linalg.norm(vectors, axis=1)
    expected = 5000 / np.pi * cosine**2 / (vectors**2).sum(1)
    np.testing.assert_allclose(light_lx, expected, rtol=2e-3)


def test_a_mirror_beside_the_floor_adds_its_share_of_the_lamps_image() -> None:
    mirror = rectangle(-3 * X + 5 * Z, 40 * Y, 40 * Z, "mirror", "mirror")
    points_m, light_lx = lit_by(BULB, mirror)
    image_m = BULB.position_m * [-1, 1, 1] - [6, 0, 0]
    direct = by_inverse_square(points_m, BULB.position_m, 100)
    image = 0.8 * by_inverse_square(points_m, image_m, 100)
    assert image.min() > 1e-3 * direct.max()
    np.testing.assert_allclose(light_lx, direct + image, rtol=1e-3)


def test_a_roof_takes_all_light_and_the_open_light_stays() -> None:
    roof = rectangle(Z, 6 * Y, 6 * X, "a", "roof")
    points, _, visibility = open_floor(roof)
    (emitter,) = emitters(BULB, visibility)
    rows = np.arange(len(points))
    light, clear, unshaded = arriving(emitter, points, rows, visibility, Rays(1))
    assert (light == 0).all()
    assert (clear == 0).all()
    np.testing.assert_allclose(unshaded, open_light(emitter, points, rows, 1)[0])
    assert (unshaded > 0).all()


@pytest.mark.parametrize("light", [BULB, PANEL], ids=["bulb", "panel"])
def test_points_that_face_away_are_not_reached(light: Light) -> None:
    points, _, visibility = open_floor()
    below = np.ones(len(points), bool)
    for emitter in emitters(light, visibility):
        assert len(reached(emitter, points, np.flatnonzero(below))) == len(points)
        under = points.take(np.arange(len(points)))
        under.normals[:] = -under.normals
        assert len(reached(emitter, under, np.arange(len(points)))) == 0


def test_wide_emitters_take_more_rays_than_narrow_ones_and_points_take_one() -> None:
    points_m = np.zeros((1, 3), np.float32)
    sides = []
    for distance_m in (0.3, 3.0, 300.0):
        panel = ceiling_light("panel", np.array([0, 0, distance_m]), (0.5, 0.5), power_lm=1)
        (emitter,) = emitters(panel, open_floor()[2])
        sides.append(int(first_rays(emitter, points_m, 8)[0]))
    assert sides == [12, 4, 4]
    (bulb,) = emitters(BULB, open_floor()[2])
    assert isinstance(bulb, Emitter)
    assert first_rays(bulb, points_m, 8).tolist() == [1]


def test_a_soft_shadow_is_that_of_many_rays_and_takes_a_fraction_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    block = rectangle(PANEL_M - 1.5 * Z, 0.6 * Y, 0.6 * X, "a", "block")
    points, layout, visibility = open_floor(block, spacing_m=0.025)
    (emitter,) = emitters(PANEL, visibility)
    rows = np.arange(len(points))
    exact_lx = arriving(emitter, points, rows, visibility, Rays(16, spread=True))[0]
    sent = []
    passing = visibility.passing

    def counted(origins_m: Floats, segments_m: Floats) -> Floats:
        sent.append(len(origins_m))
        return passing(origins_m, segments_m)

    monkeypatch.setattr(visibility, "passing", counted)
    cells = np.arange(len(points), dtype=np.int32)
    light_lx = direct_light(emitter, points, layout, cells, visibility, side=4, among=np.ones(len(points), bool))
    assert sum(sent) < 4 * len(points)
    error = (light_lx - exact_lx) / exact_lx.max()
    assert np.sqrt((error**2).mean()) < 0.03
    assert abs(error.mean()) < 2e-3
    assert np.abs(error).max() < 0.25


def test_the_open_light_of_a_panel_is_exact_where_it_is_interpolated() -> None:
    points, layout, visibility = open_floor(spacing_m=0.025)
    (emitter,) = emitters(PANEL, visibility)
    cells = np.zeros(len(points), np.int32)
    light_lx = direct_light(emitter, points, layout, cells, visibility, side=4, among=np.ones(len(points), bool))
    exact_lx, _ = open_light(emitter, points, np.arange(len(points)), 4)
    np.testing.assert_allclose(light_lx, exact_lx, rtol=3e-3)
