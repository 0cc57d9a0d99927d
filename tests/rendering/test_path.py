"""Laws of light, with little to see and few paths: each figure is the law's, within the noise."""

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.rendering.panoramas import PANORAMA, level_illuminance_lx
from tests.rendering.rectangles import rectangle, room
from vobench.asset.texture import Procedural
from vobench.errors import MissingDependencyError, RenderError
from vobench.geometry import se3
from vobench.geometry.camera import KannalaBrandt, Pinhole, pixel_grid
from vobench.geometry.rig import looking
from vobench.geometry.vector import unit
from vobench.rendering import mitsuba
from vobench.rendering.path import PathRenderer
from vobench.rendering.renderer import View, single_instant
from vobench.scene.light import AreaLight, Dimmer, Flicker, PointLight, Sky, SpotLight, Sun, Switched
from vobench.scene.material import LUMINANCE, Material, Picture, fresnel, linear, pane_reflectance, under_coat
from vobench.scene.mesh import as_arrays, as_mesh, quad, two_sided
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light
from vobench.scene.triangles import Thing

X, Y, Z = np.eye(3)
SMALL = Pinhole(12, 8, 200.0, 200.0, 5.5, 3.5)
CHECKER = ("checker", 0.5, 0.8, 0.8, 512, 0)
DOWN = looking(pitch_deg=90, position_m=(0, 0, 1.5))

Trace = Callable[..., np.ndarray]


@pytest.fixture(scope="module")
def trace() -> Trace:
    """Pictures of scenes, or a skip where this machine cannot trace paths."""
    try:
        mitsuba.prepare()
    except MissingDependencyError as error:
        pytest.skip(str(error))

    def picture(scene, T_world_camera=DOWN, camera=SMALL, *, views=None, weights=LUMINANCE, **settings):
        renderer = PathRenderer(scene, **{"samples": 64, **settings})
        light = renderer.radiance(camera, views or single_instant(camera, T_world_camera), weights=weights)
        renderer.close()
        return light

    return picture


def tone(albedo: float) -> tuple[str, float, float, float, int, int]:
    return "plain", albedo, 0.0, 1.0, 8, 0


def plate(material, z_m=0.0, *, side_m=8.0, up=True):
    u, v = (X, Y) if up else (Y, X)
    return rectangle(z_m * Z, side_m * u, side_m * v, material, material)


def floor_under(*lights, material=None, over=(), materials=None) -> Scene:
    floor = material or Material(texture=Procedural(*tone(0.5)))
    return Scene("floor", (plate("floor"), *over), {"floor": floor, **(materials or {})}, tuple(lights))


SLANTED = SpotLight("spot", np.array([3.0, 0.0, 4.0]), np.array([-0.6, 0.0, -0.8]), 500.0, 20.0, 40.0)


@pytest.mark.parametrize(
    ("light", "illuminance_lx"),
    [
        (PointLight("bulb", np.array([0.0, 0.0, 2.0]), 800.0), 800 / (4 * np.pi) / 2**2),
        (SLANTED, SLANTED.peak_cd / 25 * 0.8),
        (Sun("sun", 30_000.0, (0.0,), (40.0,), (30.0,)), 30_000 * 0.5),
        (Sky("sky", 5000.0, "uniform"), 5000.0),
        (Sky("sky", 5000.0, "overcast"), 5000.0),
        (Sky("sky", 5000.0, "clear", np.array([0.6, 0.0, 0.8])), 5000.0),
        (ceiling_light("panel", np.array([0.0, 0.0, 5.0]), (0.2, 0.2), power_lm=900.0), 900 / np.pi / 25),
    ],
    ids=lambda value: getattr(value, "kind", getattr(value, "name", "")),
)
def test_a_matt_floor_shows_its_illuminance_times_its_albedo_over_pi(trace, light, illuminance_lx):
    shown = trace(floor_under(light), samples=512 if isinstance(light, Sky) else 64)
    assert shown.mean() == pytest.approx(0.5 * illuminance_lx / np.pi, rel=0.01)


def test_a_panorama_is_seen_as_its_map_says_and_lights_a_floor(trace):
    floor = floor_under(PANORAMA)
    assert trace(floor, samples=512).mean() == pytest.approx(0.5 * level_illuminance_lx() / np.pi, rel=0.02)
    camera = Pinhole(24, 16, 20.0, 20.0, 11.5, 7.5)
    T = se3.transform(se3.rotation_z(2.8), np.zeros(3)) @ looking(pitch_deg=-45, position_m=(0, 0, 0.4))
    shown = trace(floor, T, camera=camera, samples=64)
    rays = camera.rays(pixel_grid(camera)) @ T[:3, :3].T
    expected = PANORAMA.seen_cd_m2(rays) @ LUMINANCE
    np.testing.assert_allclose(shown.squeeze(), expected, rtol=0.06)


def test_a_spot_fades_as_its_intensity_says(trace):
    spot = SpotLight("spot", np.array([0.0, 0.0, 2.0]), -Z, 500.0, 10.0, 40.0)
    camera, eye = Pinhole(9, 1, 2.5, 1000.0, 4.0, 0.0), looking(pitch_deg=90, position_m=(0, 0, 1.99))
    shown = trace(floor_under(spot), camera=camera, T_world_camera=eye, samples=4000)
    x = (np.arange(-4.5, 4.5, 0.01) + 0.005) / 2.5 * 1.99
    way = np.stack([x, 0 * x, -2 + 0 * x], -1) / np.hypot(x, 2)[:, None]
    expected = 0.5 / np.pi * spot.intensity_cd(way) * 2 / np.hypot(x, 2) ** 3
    np.testing.assert_allclose(shown[0], expected.reshape(9, 100).mean(1), atol=0.03 * expected.max())


def test_the_sun_s_disc_softens_the_edge_of_a_shadow_by_its_width(trace):
    sun = Sun("sun", 1000.0, (0.0,), (0.0,), (90.0,))
    blade = rectangle(4 * X + 3 * Z, 8 * X, 8 * Y, "blade", "blade")  # its edge is at x = 0, 3 m above the floor
    scene = floor_under(sun, over=(blade,), materials={"blade": Material(texture=Procedural(*tone(0.5)))})
    line = Pinhole(60, 1, 2000.0, 2000.0, 29.5, 0.0)  # 1 px is 0.5 mm of the floor
    T_world_camera = se3.transform(np.stack([X, -Y, -Z], -1), [0, 0, 1.0])
    shown = trace(scene, T_world_camera, line, samples=400)[0] / (0.5 * 1000 / np.pi)
    x = (np.arange(60) - 29.5) * 0.0005
    s = np.clip(x / (3 * np.tan(np.deg2rad(0.533 / 2))), -1, 1)
    disc_seen = 0.5 - (s * np.sqrt(1 - s**2) + np.arcsin(s)) / np.pi
    np.testing.assert_allclose(shown, disc_seen, atol=0.06)
    assert np.abs(shown - disc_seen).mean() < 0.02


@pytest.mark.parametrize("max_depth", [2, 4, None])
@pytest.mark.parametrize("albedo", [0.3, 0.8])
def test_in_a_closed_box_light_adds_up_to_a_geometric_series(trace, albedo, max_depth):
    """A lamp amid a cube lights all sides alike, and each bounce keeps the share `albedo` of its flux."""
    sides = tuple(room((2, 2, 2), floor="skin", wall="skin", ceiling="skin"))
    scene = Scene("box", sides, {"skin": Material(texture=Procedural(*tone(albedo)))}, (PointLight("bulb", Z, 600.0),))
    # From above, through the ceiling's back: the picture is just the floor, each pixel of the same area.
    camera = Pinhole(16, 16, 32.0, 32.0, 7.5, 7.5)
    shown = trace(scene, looking(pitch_deg=90, position_m=(0, 0, 4.0)), camera, samples=400, max_depth=max_depth)
    bounces = 1 / (1 - albedo) if max_depth is None else sum(albedo**k for k in range(max_depth - 1))
    assert shown.mean() == pytest.approx(albedo / np.pi * 600 / (6 * 4) * bounces, rel=0.01)


def test_a_coat_takes_its_share_of_the_light_on_the_way_in_and_out(trace):
    bulb = PointLight("bulb", np.array([1.5, 0.0, 1.5]), 800.0)
    shown = trace(floor_under(bulb, material=Material(texture=Procedural(*tone(0.6)), eta=1.5))).mean()
    cosine = np.array([np.cos(np.pi / 4), 1.0])
    entering = 800 / (4 * np.pi) / 4.5 * cosine[0] * (1 - fresnel(cosine, 1.5)[0])
    expected = under_coat(np.array(0.6), 1.5) * entering * (1 - fresnel(cosine, 1.5)[1]) / np.pi
    assert shown == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("pitch_deg", [90, 20])
def test_a_polished_floor_under_an_even_sky_shows_its_body_and_the_sky_by_fresnel_s_law(trace, pitch_deg):
    sky = Sky("sky", 1000.0, "uniform")
    eye = looking(pitch_deg=pitch_deg, position_m=(0, 0, 0.5))
    shown = trace(
        floor_under(sky, material=Material(texture=Procedural(*tone(0.6)), eta=1.5, tint=0.7)), eye, samples=1000
    )
    F = fresnel(np.array(np.sin(np.deg2rad(pitch_deg))), 1.5)
    everywhere = fresnel(np.sqrt((np.arange(4096) + 0.5) / 4096), 1.5).mean()
    body = under_coat(np.array(0.6), 1.5) * (1 - everywhere) * (1 - F)
    assert shown.mean() == pytest.approx(1000 / np.pi * (body + 0.7 * F), rel=0.02)


@pytest.mark.parametrize(("roughness", "least"), [(0.0, 0.999), (0.1, 0.98)])
def test_a_mirror_keeps_the_share_tint(trace, roughness, least):
    floor = Material("mirror", tint=0.7, roughness=roughness)
    shown = trace(floor_under(Sky("sky", 1000.0, "uniform"), material=floor)).mean() * np.pi / 1000 / 0.7
    assert least <= shown <= 1.001


def test_a_mirror_shows_what_the_mirrored_camera_sees(trace):
    poster = rectangle(np.array([2.0, 0.0, 1.0]), 2 * Z, 2 * Y, "poster")
    materials = {
        "poster": Material(texture=Procedural("checker", 0.5, 0.8, 1.6, 64, 0)),
        "mirror": Material("mirror", tint=0.8),
    }
    bulb = (PointLight("bulb", np.array([0.0, 1.0, 3.0]), 800.0),)
    camera = Pinhole(32, 24, 30.0, 30.0, 15.5, 11.5)
    eye = looking(pitch_deg=50, position_m=(0.0, 0.0, 0.8))
    scene = Scene("mirrored", (poster, plate("mirror")), materials, bulb)
    shown = trace(scene, eye, camera, samples=400, max_depth=3)
    # The same without a mirror: camera and picture turned upside down.
    below = se3.transform(np.diag([1, 1, -1.0]) @ eye[:3, :3] @ np.diag([1, -1, 1.0]), [0, 0, -0.8])
    real = trace(Scene("real", (poster,), materials, bulb), below, camera, samples=400, max_depth=2)[::-1]
    assert (real > 0).mean() > 0.3
    np.testing.assert_allclose(shown, 0.8 * real, atol=0.08 * real.max())
    assert shown.mean() == pytest.approx(0.8 * real.mean(), rel=0.01)


def test_a_pane_lets_sunlight_through_and_is_looked_through(trace):
    sun = Sun("sun", 30_000.0, (0.0,), (0.0,), (30.0,))
    pane = Material("pane", eta=1.5, tint=0.9)
    shown = trace(
        floor_under(
            sun,
            material=Material(texture=Procedural(*tone(0.02))),
            over=(plate("pane", 0.5),),
            materials={"pane": pane},
        )
    )
    passes = 0.9 * (1 - pane_reflectance(np.array([0.5, 1.0]), 1.5))
    assert shown.mean() == pytest.approx(0.02 / np.pi * 15_000 * passes.prod(), rel=0.01)


@pytest.mark.parametrize("pitch_deg", [90, 30])
def test_a_pane_mirrors_by_fresnel_s_law_on_both_of_its_sides(trace, pitch_deg):
    lamp = AreaLight("lamp", plate("lamp", 4.0, side_m=40.0, up=False).mesh, 1e5)
    for up in (True, False):
        scene = Scene("pane", (plate("pane", up=up),), {"pane": Material("pane", eta=1.5)}, (lamp,))
        shown = trace(scene, looking(pitch_deg=pitch_deg, position_m=(0, 0, 1.0)), samples=400).mean()
        mirrored = pane_reflectance(np.array(np.sin(np.deg2rad(pitch_deg))), 1.5)
        assert shown == pytest.approx(mirrored * lamp.luminance_cd_m2, rel=0.04)


def test_a_panel_is_seen_as_its_luminance_from_the_front_and_not_from_behind(trace):
    lamp = AreaLight("lamp", plate("lamp", 1.0, up=False).mesh, 1000.0)
    scene = floor_under(lamp)
    up = se3.transform(np.diag([1, -1, -1.0]) @ DOWN[:3, :3], [0, 0, 0.5])
    np.testing.assert_allclose(trace(scene, up), lamp.luminance_cd_m2, rtol=1e-5)
    above, below = (looking(pitch_deg=90, position_m=(0, 0, z)) for z in (1.5, 0.5))
    assert trace(scene, above, samples=400).mean() == pytest.approx(trace(scene, below, samples=400).mean(), rel=0.01)


LAMP = ceiling_light("panel", np.array([0.0, 0.0, 3.0]), (1.0, 1.0), power_lm=900.0)


def test_the_same_seed_gives_the_same_bytes_and_another_seed_time_or_pose_another_noise(trace):
    scene = floor_under(LAMP)
    picture = trace(scene, seed=1)
    assert trace(scene, seed=1).tobytes() == picture.tobytes()
    elsewhere = looking(pitch_deg=90, position_m=(0, 1e-6, 1.5))
    for other in (trace(scene, seed=2), trace(scene, seed=1, T_world_camera=elsewhere)):
        assert not np.isclose(other, picture, rtol=1e-5).any()
    assert not np.isclose(trace(scene, seed=1, views=single_instant(SMALL, DOWN, t_ns=1)), picture, rtol=1e-5).any()


def instant(rows: slice, T_world_camera, start_ns=0, end_ns=0) -> View:
    poses = np.asarray(T_world_camera).reshape(-1, 4, 4)
    return View(rows, poses, np.full(len(poses), start_ns), np.full(len(poses), end_ns))


def test_a_picture_in_two_views_of_rows_is_the_picture_in_one(trace):
    scene = floor_under(LAMP)
    halves = (instant(slice(0, 3), DOWN), instant(slice(3, 8), DOWN))
    assert trace(scene, views=halves).tobytes() == trace(scene).tobytes()


def test_more_paths_than_are_traced_at_once_give_one_picture(trace, monkeypatch):
    scene = floor_under(Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,)), material=Material(texture=Procedural(*tone(0.5))))
    at_once = trace(scene, samples=7)
    monkeypatch.setattr("vobench.rendering.path.MAX_LANES", 200)
    piece_by_piece = trace(scene, samples=7)
    np.testing.assert_allclose(piece_by_piece, at_once, rtol=5e-3)
    assert piece_by_piece.mean() == pytest.approx(at_once.mean(), rel=5e-4)


def test_each_row_is_seen_from_its_own_pose(trace):
    scene = floor_under(Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,)), material=Material(texture=Procedural(*CHECKER)))
    poses = [looking(pitch_deg=90, position_m=(0.02 * r, 0, 1.5)) for r in range(8)]
    rolling = trace(scene, views=[instant(slice(r, r + 1), pose) for r, pose in enumerate(poses)], samples=400)
    for row, pose in enumerate(poses):
        np.testing.assert_allclose(rolling[row], trace(scene, pose, samples=400)[row], atol=25)


def test_sub_frames_are_averaged_in_linear_light(trace):
    scene = floor_under(Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,)), material=Material(texture=Procedural(*CHECKER)))
    poses = np.array([looking(pitch_deg=90, position_m=(0.02 * m, 0, 1.5)) for m in range(3)])
    blurred = trace(scene, views=[instant(slice(0, 8), poses)], samples=600)
    expected = np.mean([trace(scene, pose, samples=400) for pose in poses], 0)
    np.testing.assert_allclose(blurred, expected, atol=20)


LEVELS = {
    "flicker": Flicker(mains_hz=50.0, depth=0.6),
    "dimmer": Dimmer((0.0, 1.0), (0.2, 1.0)),
    "switched": Switched((0.004,)),
}


@pytest.mark.parametrize("kind", ["panel", "bulb", "spot", "sun", "sky"])
@pytest.mark.parametrize("level", LEVELS.values(), ids=LEVELS)
def test_a_light_counts_with_its_mean_level_over_the_exposure(trace, kind, level):
    def scene(level):
        lights = {
            "panel": AreaLight("panel", LAMP.mesh, 900.0, level),
            "bulb": PointLight("bulb", 2 * Z, 800.0, level),
            "spot": SpotLight("spot", 2 * Z, -Z, 800.0, 20.0, 40.0, level),
            "sun": Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,), level),
            "sky": Sky("sky", 1000.0, level=level),
        }
        return floor_under(lights[kind])

    steady = trace(scene(Dimmer((0.0,), (1.0,))), views=[instant(slice(0, 8), DOWN, 1_000_000, 9_000_000)])
    shown = trace(scene(level), views=[instant(slice(0, 8), DOWN, 1_000_000, 9_000_000)])
    np.testing.assert_allclose(shown, steady * level.mean(1_000_000, 9_000_000), rtol=1e-5)


def test_one_renderer_shows_lights_suns_and_movers_as_they_are_at_each_time(trace):
    way = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [4.0, 0, 0]]), np.array([0.0, 90.0]))
    box = Mover("lid", (rectangle(0.5 * Z, X, Y, "lid"),), way)
    sun = Sun("sun", 1000.0, (0.0, 1.0), (0.0, 0.0), (90.0, 30.0))
    scene = Scene(
        "moving",
        (plate("floor"),),
        {"floor": Material(texture=Procedural(*tone(0.5))), "lid": Material(texture=Procedural(*tone(0.2)))},
        (sun,),
        (box,),
    )
    renderer = PathRenderer(scene, samples=64, max_depth=2)
    for t_s, albedo, elevation_deg in ((0.0, 0.2, 90.0), (1.0, 0.5, 30.0), (0.0, 0.2, 90.0)):
        shown = renderer.radiance(SMALL, single_instant(SMALL, DOWN, t_ns=int(t_s * 1e9)))
        expected = albedo * 1000 / np.pi * np.sin(np.deg2rad(elevation_deg))
        assert shown.mean() == pytest.approx(expected, rel=0.01)
    renderer.close()


@pytest.mark.parametrize(
    "camera",
    [
        Pinhole(160, 120, 300.0, 250.0, 75.0, 62.0),
        KannalaBrandt(160, 120, 300.0, 300.0, 79.5, 59.5, 0.05, -0.02, 0.01, 0.0),
    ],
    ids=["pinhole", "fisheye"],
)
def test_the_corners_of_a_checker_land_where_projection_says(trace, camera):
    scene = floor_under(Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,)), material=Material(texture=Procedural(*CHECKER)))
    eye = looking(pitch_deg=80, position_m=(0.03, 0.02, 0.8))
    picture = trace(scene, eye, camera, samples=256, max_depth=2)
    lattice = np.stack(np.meshgrid(np.arange(-4, 4, 0.1), np.arange(-4, 4, 0.1), [0.0]), -1).reshape(-1, 3)
    expected = camera.project(se3.apply(se3.inverse(eye), lattice))
    expected = expected[((expected > 14) & (expected < [145, 105])).all(1)]
    assert len(expected) >= 6
    blurred = cv2.GaussianBlur(picture, (0, 0), 1.5)
    start = expected.astype(np.float32).reshape(-1, 1, 2).copy()
    found = cv2.cornerSubPix(blurred, start, (7, 7), (-1, -1), (3, 200, 1e-6)).reshape(-1, 2)
    apart = np.linalg.norm(found - expected, axis=1)
    assert apart.mean() < 0.05
    assert apart.max() < 0.1


def test_a_floor_of_two_halves_is_the_floor_in_one(trace):
    sun = (Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,)),)
    whole = plate("floor")
    halves = (0.0, 4.05), (4.05, 3.95)
    left, right = (
        replace(whole, mesh=quad(whole.corner_m + start * X, length * X, whole.edge_v_m, uv_m=(start, 0.0)))
        for start, length in halves
    )
    pictures = [
        trace(Scene("f", s, {"floor": Material(texture=Procedural(*CHECKER))}, sun)) for s in ((whole,), (left, right))
    ]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-3)
    assert pictures[0].std() > 0.2 * pictures[0].mean()


def test_where_the_lens_sees_nothing_the_picture_is_black(trace):
    camera = KannalaBrandt(40, 40, 10.0, 10.0, 19.5, 19.5, -0.15, 0.0, 0.0, 0.0)
    picture = trace(
        floor_under(Sky("sky", 1000.0, "uniform"), material=Material(texture=Procedural(*tone(0.9)))), camera=camera
    )
    u, v = np.moveaxis(pixel_grid(camera) - 19.5, -1, 0)
    assert np.isnan(camera.rays(pixel_grid(camera))[np.hypot(u, v) > 11]).all()
    assert (picture[np.hypot(u, v) > 11] == 0).all()
    assert (picture[np.hypot(u, v) < 8] > 0).all()


@pytest.mark.parametrize(
    ("settings", "says"), [({"samples": 0}, "samples must be 1 or more"), ({"max_depth": 0}, "max_depth must be 1")]
)
def test_impossible_settings_are_a_sentence(settings, says):
    with pytest.raises(RenderError, match=says):
        PathRenderer(floor_under(LAMP), **settings)


def test_each_channel_is_the_light_s_colour_times_the_floor_s(trace):
    colour, tint = (0.6, 0.3, 0.1), np.array([1.2, 1.0, 0.4])
    lamp = replace(LAMP, colour=tuple(tint))
    bulb = PointLight("bulb", 2 * Z, 800.0, colour=tuple(tint))
    sun = Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,), colour=tuple(tint))
    sky = Sky("sky", 1000.0, colour=tuple(tint))
    for light in (lamp, bulb, sun, sky):
        grey = trace(floor_under(replace(light, colour=(1.0, 1.0, 1.0)), material=Material(colour=(0.5,) * 3)), seed=3)
        rgb = trace(floor_under(light, material=Material(colour=colour)), seed=3, weights=None)
        assert rgb.shape == (*grey.shape, 3)
        # Beside the floor there is nothing, so that its light is met once.
        np.testing.assert_allclose(rgb, grey[..., None] * tint * colour / 0.5, rtol=1e-4)


def test_a_mono_picture_is_the_weighted_sum_of_its_channels(trace):
    scene = floor_under(LAMP, material=Material(colour=(0.6, 0.3, 0.1)))
    rgb, weights = trace(scene, weights=None), (0.1, 0.7, 0.2)
    np.testing.assert_allclose(trace(scene, weights=weights), rgb @ np.array(weights), rtol=1e-5)
    np.testing.assert_allclose(trace(scene), rgb @ LUMINANCE, rtol=1e-5)


def test_a_picture_in_srgb_shows_its_linear_reflectance(trace):
    pixels = np.zeros((2, 2, 3), np.uint8) + np.array([200, 120, 30], np.uint8)
    paper = Material(texture=Picture(pixels), colour=(1.0, 0.5, 1.0))
    plain = Material(colour=tuple(linear(pixels[0, 0]) * np.array([1.0, 0.5, 1.0])))
    shown, expected = (trace(floor_under(LAMP, material=m), weights=None) for m in (paper, plain))
    np.testing.assert_allclose(shown, expected, rtol=1e-4)


def test_metal_mirrors_in_its_colour_and_scatters_nothing(trace):
    sky, colour = Sky("sky", 1000.0, "uniform"), np.array([0.9, 0.6, 0.2])
    metal, half = (Material(colour=tuple(colour), metal=m) for m in (1.0, 0.5))
    for material in (metal, half):
        shown = trace(floor_under(sky, material=material), samples=1000, weights=None).mean((0, 1))
        np.testing.assert_allclose(shown, colour * 1000 / np.pi, rtol=0.02)
    bulb = PointLight("bulb", np.array([1.0, 0, 1.0]), 800.0)
    diffuse = trace(floor_under(bulb, material=Material(colour=tuple(colour))), samples=1000)
    assert not trace(floor_under(bulb, material=metal)).any()
    assert trace(floor_under(bulb, material=half), samples=1000).mean() == pytest.approx(0.5 * diffuse.mean(), rel=0.02)


def test_what_glows_is_seen_as_its_emission_and_lights_what_is_before_it(trace):
    emission = np.array([300.0, 100.0, 20.0])
    halves = np.zeros((1, 64, 3), np.uint8)
    halves[:, :32] = 255
    screen = Material(colour=(0.0,) * 3, emission_cd_m2=tuple(emission))
    striped = replace(screen, emission_texture=Picture(halves, 0.01))
    lamp = AreaLight("lamp", plate("lamp", 3.0, side_m=1.0, up=False).mesh, 900.0)
    panel = Thing("screen", quad([-0.5, -0.5, 3.0], Y, X), "screen")
    for material, share in ((screen, 1.0), (striped, 0.5)):
        scene = floor_under(materials={"screen": material}, over=(panel,))
        up = se3.transform(np.diag([1, -1, -1.0]) @ DOWN[:3, :3], [0, 0, 0.5])
        np.testing.assert_allclose(trace(scene, up, weights=None).mean((0, 1)), share * emission, rtol=0.02)
        shown = trace(scene, samples=1000, weights=None).mean((0, 1))
        as_lamp = trace(floor_under(lamp), samples=1000).mean() / lamp.luminance_cd_m2
        np.testing.assert_allclose(shown, as_lamp * share * emission, rtol=0.02)


def test_holes_are_seen_through_and_let_light_through(trace):
    pixels = np.full((4, 4, 4), 255, np.uint8)
    pixels[:, 2:, 3] = 0
    lace = Material(colour=(0.0,) * 3, texture=Picture(pixels, 0.004), cutout=0.5)
    sun = Sun("sun", 1000.0, (0.0,), (0.0,), (60.0,))
    sheet = Thing("lace", two_sided(quad([-4, -4, 0.5], 8 * X, 8 * Y)), "lace")
    plain = floor_under(sun)
    covered = replace(plain, things=(*plain.things, sheet), materials={**plain.materials, "lace": lace})
    shown = trace(covered, samples=2000).mean()
    # Half of the light comes in, half of that out again: the pattern is too fine to know its own shadow.
    assert shown == pytest.approx(0.25 * trace(plain).mean(), rel=0.05)
    solid = replace(covered, materials={**plain.materials, "lace": replace(lace, cutout=0.0)})
    assert not trace(solid).any()


def test_smooth_normals_shade_and_flat_faces_hide(trace):
    tilted = unit(np.array([0.5, 0.0, 1.0]))
    sun = Sun("sun", 1000.0, (0.0,), (0.0,), (90.0,))
    level = as_arrays(quad([-4, -4, 0], 8 * X, 8 * Y))
    shaded = replace(level, normals=np.tile(tilted, (4, 1)))
    floor = Thing("floor", as_mesh(shaded), "floor")
    scene = Scene("f", (floor,), {"floor": Material(colour=(0.5,) * 3)}, (sun,))
    assert trace(scene).mean() == pytest.approx(0.5 * 1000 / np.pi * tilted[2], rel=0.01)
