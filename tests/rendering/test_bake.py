"""Baked light obeys photometry: inverse square, cosines, superposition, shadow and conservation of energy."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from tests.rendering.parts import light_at
from tests.rendering.rectangles import Rectangle, box, rectangle, room
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.cosine_sampling import cosine_weighted
from vobench.rendering.embree import Hits
from vobench.rendering.geometry import offset_from_surface
from vobench.rendering.illumination import Illumination
from vobench.rendering.texel_owner import owners
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Flicker, Light, PointLight, SpotLight
from vobench.scene.material import Material, fresnel
from vobench.scene.mesh import flat_shaded, flipped, make_mesh, moved
from vobench.scene.scene import Scene, ceiling_light
from vobench.scene.triangles import Thing

DIRECT = BakeSettings(spacing_m=0.1, light_rays=16, indirect_spacing_m=1.0, indirect_rays=1, bounces=0)
BODY = ("plain", 0.5, 0.0, 1.0, 8, 0)
GREY = {"grey": Material(texture=Procedural(*BODY))}
FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "grey")
LAMP = ceiling_light("lamp", np.array([0.3, -0.2, 2.0]), (0.04, 0.06), power_lm=1000)


def scene(*lamps: Light, things: tuple[Rectangle, ...] = (FLOOR,)) -> Scene:
    return Scene("test", things, GREY, lamps)


def on_quad(baked: BakedScene, light: Array, thing: int, s: Array, t: Array) -> Array:
    """What a map shows at fractions s and t of the edges of a thing that is a rectangle."""
    first = int(baked.parts.parent[baked.faces.thing == thing].min())
    upper = (t > s).ravel()
    u, v = np.where(t > s, s, s - t).ravel(), np.where(t > s, t - s, t).ravel()
    return light_at(baked, light, first + upper, u, v).reshape(*s.shape, *light.shape[2:])


def floor_light(baked: BakedScene) -> tuple[Array, Array, Array]:
    """Places x, y and illuminance (rows, columns) on the first thing, a floor of 4 m; samples are on its edges."""
    count = round(4 / baked.settings.spacing_m) + 1
    s, t = np.meshgrid(*[np.linspace(0, 1, count)] * 2)
    light = Illumination(baked).at(0, 0)[..., 0]
    return 4 * s - 2, 4 * t - 2, on_quad(baked, light, 0, s, t)


def test_the_floor_is_read_where_its_samples_are() -> None:
    baked = bake(scene(LAMP), DIRECT)
    rectangle_px = baked.atlas.light_px[:2].reshape(-1, 2)
    np.testing.assert_allclose(np.ptp(rectangle_px, axis=0), 40, atol=1e-4)
    np.testing.assert_allclose(rectangle_px % 1, 0.5, atol=1e-4)


@pytest.mark.parametrize("height_m", [1.0, 2.0, 4.0])
def test_light_of_a_small_lamp_falls_with_the_square_of_distance_and_both_cosines(height_m: float) -> None:
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, height_m]), (0.04, 0.06), power_lm=1000)
    x, y, light = floor_light(bake(scene(lamp), DIRECT))
    squared = (x - 0.3) ** 2 + (y + 0.2) ** 2 + height_m**2
    # A Lambertian panel sends power / π along its normal.
    expected = 1000 / np.pi * (height_m**2 / squared) / squared
    np.testing.assert_allclose(light, expected, rtol=0.02)
    assert (light / expected).mean() == pytest.approx(1, abs=0.001)


def test_a_wide_panel_right_above_gives_the_light_of_its_solid_angle() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 0.5]), (1.0, 1.0), power_lm=1000)
    x, y, light = floor_light(bake(scene(lamp), replace(DIRECT, light_rays=1024)))
    # Form factor of a square from below its middle: four corners with a = b = 0.5, c = 0.5 (Howell, B-4).
    factor = 4 / (2 * np.pi) * 2 / np.sqrt(2) * np.arctan(1 / np.sqrt(2))
    middle = np.unravel_index(np.argmin(x**2 + y**2), x.shape)
    assert light[middle] == pytest.approx(1000 * factor, rel=0.005)


def test_twice_the_power_is_exactly_twice_the_light() -> None:
    settings = replace(DIRECT, indirect_spacing_m=0.3, indirect_rays=16, bounces=2)
    closed = tuple(room((3, 3, 2.5), floor="grey", wall="grey", ceiling="grey"))
    once, twice = (
        whole(bake(scene(replace(LAMP, power_lm=power), things=closed), settings)) for power in (700.0, 1400.0)
    )
    np.testing.assert_array_equal(twice, 2 * once)


def test_the_light_of_two_lamps_is_the_sum_of_each() -> None:
    other = ceiling_light("other", np.array([-1.0, 1.0, 1.5]), (0.3, 0.3), power_lm=500)
    both, first, second = (floor_light(bake(scene(*lamps), DIRECT))[2] for lamps in ((LAMP, other), (LAMP,), (other,)))
    np.testing.assert_allclose(both, first + second, rtol=0.03)
    assert both.mean() == pytest.approx((first + second).mean(), rel=0.001)


def test_behind_a_box_there_is_no_direct_light_and_beside_it_all_of_it() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.0]), (0.2, 0.2), power_lm=1000)
    blocker = box(np.array([0, 0, 1.0]), (0.8, 0.8, 0.1), yaw_deg=0, material="grey")
    x, y, shaded = floor_light(bake(scene(lamp, things=(FLOOR, *blocker)), DIRECT))
    open_light = floor_light(bake(scene(lamp), DIRECT))[2]
    far = np.maximum(np.abs(x), np.abs(y))
    # From the lamp's rims past the box's: the box's top is 0.95 m below the lamp, its underside 1.05 m.
    umbra, lit = 0.1 + (0.4 - 0.1) / 1.05 * 2.0, -0.1 + (0.4 + 0.1) / 0.95 * 2.0
    np.testing.assert_allclose(shaded[far < umbra - 0.01], 0, atol=1e-9)
    share = shaded / open_light
    np.testing.assert_allclose(share[far > lit + 0.01], 1, atol=0.03)
    half_lit = share[np.abs(far - (umbra + lit) / 2) < 0.06]
    assert 0.2 < half_lit.mean() < 0.7


def test_half_shadows_are_smooth() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.0]), (0.2, 0.2), power_lm=1000)
    blocker = box(np.array([0, 0, 1.0]), (0.8, 0.8, 0.1), yaw_deg=0, material="grey")
    shaded, fine = (
        floor_light(bake(scene(lamp, things=(FLOOR, *blocker)), replace(DIRECT, spacing_m=0.03, light_rays=rays)))[2]
        for rays in (16, 400)
    )
    open_light = floor_light(bake(scene(lamp), replace(DIRECT, spacing_m=0.03)))[2]
    half = (fine > 0) & (fine < 0.97 * open_light)
    # Sixteen rays alone would leave a grain of 5 %.
    assert np.sqrt(np.mean(((shaded - fine) / open_light)[half] ** 2)) < 0.03


def test_nothing_shines_through_the_corners_of_a_closed_box() -> None:
    lamp = ceiling_light("lamp", np.array([0.5, 0.4, 2.0]), (0.2, 0.2), power_lm=1000)
    crate = box(np.array([0, 0, 0.501]), (1.0, 1.0, 1.0), yaw_deg=0, material="grey")
    x, y, light = floor_light(bake(scene(lamp, things=(FLOOR, *crate)), DIRECT))
    np.testing.assert_allclose(light[np.maximum(np.abs(x), np.abs(y)) < 0.49], 0, atol=1e-9)


def flux_lm(baked: BakedScene, light: Array) -> float:
    """Light (H, W) that arrives on all bodies, by places spread evenly over their faces."""
    area_m2 = areas_m2(baked.faces.corners_m) * (baked.atlas.chart >= 0)
    numbers = np.random.default_rng(0)
    face = np.searchsorted(np.cumsum(area_m2), (np.arange(200_000) + 0.5) / 200_000 * area_m2.sum())
    a, b = numbers.random((2, len(face)))
    u, v = np.sqrt(a) * (1 - b), np.sqrt(a) * b
    return float(baked.atlas.read(light, face.astype(np.int32), u, v).mean() * area_m2.sum())


def whole(baked: BakedScene) -> Array:
    return Illumination(baked).at(0, 0)[..., 0]


def maps(baked: BakedScene) -> tuple[bytes, bytes]:
    return baked.direct.tobytes(), baked.bounced.tobytes()


@pytest.mark.parametrize("bounces", [0, 1, 3, 12])
def test_a_closed_room_keeps_its_light_and_each_bounce_returns_the_albedos_share(bounces: int) -> None:
    settings = BakeSettings(
        spacing_m=0.05, light_rays=16, indirect_spacing_m=0.15, indirect_rays=64, bounces=bounces, seed=1
    )
    # The panel itself swallows what falls on it, so it is small.
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, 1.5]), (0.1, 0.1), power_lm=1000)
    closed = tuple(room((3, 2.5, 2.5), floor="grey", wall="grey", ceiling="grey"))
    baked = bake(scene(lamp, things=closed), settings)
    arriving = flux_lm(baked, whole(baked))
    # Ulbricht's integrating sphere: every surface returns its albedo of what it gets, whatever the shape.
    expected = 1000 * sum(0.5**n for n in range(bounces + 1))
    assert arriving == pytest.approx(expected, rel=0.01)


def test_a_bake_is_the_same_bytes_twice_and_another_seed_changes_only_noise() -> None:
    settings = replace(DIRECT, light_rays=4, indirect_spacing_m=0.3, indirect_rays=16, bounces=2)
    closed = tuple(room((3, 3, 2.5), floor="grey", wall="grey", ceiling="grey"))
    first, again, other = (bake(scene(LAMP, things=closed), replace(settings, seed=seed)) for seed in (0, 0, 1))
    assert maps(first) == maps(again)
    assert maps(first) != maps(other)
    assert whole(other).mean() == pytest.approx(whole(first).mean(), rel=0.01)


def test_a_lamps_panel_shows_its_own_luminance() -> None:
    baked = bake(scene(LAMP), DIRECT)
    panel = on_quad(baked, whole(baked), 1, *np.meshgrid(*[np.linspace(0, 1, 5)] * 2))
    np.testing.assert_allclose(panel, np.pi * LAMP.luminance_cd_m2, rtol=1e-6)


@pytest.mark.parametrize("bounces", [0, 2])
@pytest.mark.filterwarnings("error")
def test_a_scene_in_which_everything_shines_has_the_light_of_its_lamps(bounces: int) -> None:
    baked = bake(scene(LAMP, things=()), replace(DIRECT, bounces=bounces))
    panel = on_quad(baked, whole(baked), 0, *np.meshgrid(*[np.linspace(0, 1, 5)] * 2))
    np.testing.assert_allclose(panel, np.pi * LAMP.luminance_cd_m2, rtol=1e-6)


def test_a_bulb_obeys_the_inverse_square_and_casts_a_hard_shadow() -> None:
    bulb = PointLight("bulb", np.array([0.3, -0.2, 2.0]), 1000.0)
    blocker = rectangle(np.array([0.3, -0.2, 1.0]), np.array([0, 0.5, 0]), np.array([0.5, 0, 0]), "grey")
    x, y, light = floor_light(bake(scene(bulb), DIRECT))
    squared = (x - 0.3) ** 2 + (y + 0.2) ** 2 + 4
    np.testing.assert_allclose(light, 1000 / (4 * np.pi) * 2 / squared**1.5, rtol=5e-3)
    shaded = floor_light(bake(scene(bulb, things=(FLOOR, blocker)), DIRECT))[2]
    far = np.maximum(np.abs(x - 0.3), np.abs(y + 0.2))
    np.testing.assert_allclose(shaded[far < 0.5 - 0.08], 0, atol=1e-9)
    np.testing.assert_allclose(shaded[far > 0.5 + 0.08], light[far > 0.5 + 0.08], rtol=1e-6)


def test_the_edge_of_a_hard_shadow_is_as_light_as_the_share_of_each_sample_it_leaves() -> None:
    bulb = PointLight("bulb", np.array([0.0, 0.0, 2.0]), 1000.0)
    # Its shadow ends 0.52 m from the middle, between samples 0.1 m apart at 0.5 and 0.6.
    blocker = rectangle(np.array([0, 0, 1.0]), np.array([0, 0.52, 0]), np.array([0.52, 0, 0]), "grey")
    x, y, light = floor_light(bake(scene(bulb, things=(FLOOR, blocker)), DIRECT))
    open_light = floor_light(bake(scene(bulb), DIRECT))[2]
    edge = (np.abs(x - 0.5) < 1e-6) & (np.abs(y) < 0.35)
    np.testing.assert_allclose((light / open_light)[edge], 0.3, atol=0.1)


def test_a_spot_lights_its_circle_and_nothing_beyond() -> None:
    spot = SpotLight("spot", np.array([0, 0, 2.0]), np.array([0, 0, -1.0]), 500.0, 20, 30)
    x, y, light = floor_light(bake(scene(spot), DIRECT))
    angle = np.rad2deg(np.arctan2(np.hypot(x, y), 2.0))
    expected = spot.peak_cd * np.clip((30 - angle) / 10, 0, 1) * np.cos(np.deg2rad(angle)) ** 3 / 4
    np.testing.assert_allclose(light, expected, rtol=3e-3, atol=0.5)


ALL_EQUAL = replace(DIRECT, indirect_spacing_m=0.1, indirect_rays=100, bounces=40)
GLOBE = tuple(room((2, 2, 2), floor="grey", wall="grey", ceiling="grey"))


def test_in_a_closed_grey_box_indirect_light_is_that_of_the_integrating_sphere() -> None:
    white = {"grey": Material(texture=Procedural("plain", 0.8, resolution_px=8))}
    lamp = PointLight("bulb", np.array([0, 0, 1.0]), 1000.0)
    light = bake(Scene("globe", GLOBE, white, (lamp,)), ALL_EQUAL)
    around = whole(light) - light.direct[0]
    indirect = flux_lm(light, around) / 24
    # Ulbricht: E = Φ ρ / (A (1 - ρ)).
    assert indirect == pytest.approx(1000 * 0.8 / (24 * (1 - 0.8)), rel=0.01)
    on_floor = on_quad(light, around, 0, *np.meshgrid(*[np.linspace(0, 1, 21)] * 2))
    # A cube's corners are darker than its walls, but not by much.
    np.testing.assert_allclose(np.quantile(on_floor, [0.1, 0.9]), indirect, rtol=0.1)


def test_each_light_has_a_layer_of_its_own_and_dimming_one_leaves_the_others_byte_equal() -> None:
    # How many rays follow the first ones depends on all lights.
    settings = replace(DIRECT, indirect_spacing_m=0.3, indirect_rays=32, bounces=2, light_noise=10.0)
    bulb = PointLight("bulb", np.array([0.5, 0, 1.0]), 300.0)
    both = bake(scene(LAMP, bulb, things=GLOBE), settings)
    dimmed = bake(scene(replace(LAMP, power_lm=10, level=Flicker(depth=0.5)), bulb, things=GLOBE), settings)
    for layers, others in ((both.direct, dimmed.direct), (both.bounced, dimmed.bounced)):
        assert layers[1].tobytes() == others[1].tobytes()
        assert not np.array_equal(layers[0], others[0])
    alone = bake(scene(bulb, things=GLOBE), settings)
    assert flux_lm(alone, alone.direct[0]) == pytest.approx(flux_lm(both, both.direct[1]), rel=0.01)
    assert alone.bounced[0].mean() == pytest.approx(both.bounced[1].mean(), rel=0.03)


def test_under_a_coat_light_counts_by_what_the_coat_lets_in() -> None:
    bulb = PointLight("bulb", np.array([0.0, 0.0, 1.0]), 1000.0)
    x, y, diffuse = floor_light(bake(scene(bulb), DIRECT))
    coated = Scene("coat", (FLOOR,), {"grey": Material(texture=Procedural(*BODY), eta=1.5)}, (bulb,))
    _, _, let_in = floor_light(bake(coated, DIRECT))
    cosine = 1 / np.sqrt(x**2 + y**2 + 1)
    np.testing.assert_allclose(let_in, diffuse * (1 - fresnel(cosine, 1.5)), rtol=1e-3)


def test_a_white_coated_box_keeps_its_light_as_a_white_matt_one_does() -> None:
    """What a coat mirrors and what its body scatters add up to everything."""
    lamp = PointLight("bulb", np.array([0.3, 0.2, 1.1]), 1000.0)
    kept = []
    for material in (
        Material(texture=Procedural("plain", 0.98, resolution_px=8)),
        Material(texture=Procedural("plain", 0.98, resolution_px=8), eta=1.5),
    ):
        settings = replace(ALL_EQUAL, bounces=6, indirect_rays=64)
        walls = tuple(room((2, 2, 2), floor="grey", wall="diffuse", ceiling="diffuse"))
        materials = {"grey": material, "diffuse": Material(texture=Procedural("plain", 0.5, resolution_px=8))}
        baked = bake(Scene("box", walls, materials, (lamp,)), settings)
        places = np.meshgrid(*[np.linspace(0, 1, 21)] * 2)
        kept.append(np.mean([on_quad(baked, whole(baked), wall, *places).mean() for wall in range(1, 6)]))
    assert kept[1] == pytest.approx(kept[0], rel=0.02)


MIRROR = rectangle(np.array([2.0, 0, 1.5]), np.array([0, 0, 3.0]), np.array([0, 8.0, 0]), "mirror")


def by_mirror(light: Light, image: Light, settings: BakeSettings, roughness: float) -> tuple[Array, Array]:
    """Light on the floor that a mirror wall adds, and the light of a lamp put where its image is."""
    materials = {**GREY, "mirror": Material("mirror", tint=0.8, roughness=roughness)}
    with_mirror = floor_light(bake(Scene("m", (FLOOR, MIRROR), materials, (light,)), settings))[2]
    x, y, straight = floor_light(bake(scene(light), settings))
    near = (np.abs(x) < 1.5) & (np.abs(y) < 1.5)
    return (with_mirror - straight)[near], floor_light(bake(scene(image), settings))[2][near]


def test_a_mirror_wall_doubles_a_lamp() -> None:
    panel = ceiling_light("lamp", np.array([1.0, 0.0, 2.0]), (1.0, 1.0), power_lm=1000)
    image = replace(panel, mesh=moved(panel.mesh, se3.transform(np.eye(3), np.array([2.0, 0, 0]))))
    bulb = PointLight("bulb", np.array([1.0, 0.5, 1.5]), 1000.0)
    for light, behind in ((panel, image), (bulb, replace(bulb, position_m=np.array([3.0, 0.5, 1.5])))):
        added, reflected = by_mirror(light, behind, DIRECT, 0.0)
        np.testing.assert_allclose(added, 0.8 * reflected, rtol=0.04)
        assert added.mean() == pytest.approx(0.8 * reflected.mean(), rel=0.002)


@pytest.mark.parametrize(
    ("roughness", "tolerance"), [(0.0, 0.02), pytest.param(0.05, 0.05, marks=pytest.mark.slow)], ids=["smooth", "rough"]
)
def test_a_lamp_in_a_mirror_counts_once_and_gathered_rays_find_the_lamps_that_a_rough_mirror_blurs(
    roughness: float, tolerance: float
) -> None:
    panel = ceiling_light("lamp", np.array([1.0, 0.0, 2.0]), (1.0, 1.0), power_lm=1000)
    image = replace(panel, mesh=moved(panel.mesh, se3.transform(np.eye(3), np.array([2.0, 0, 0]))))
    settings = replace(DIRECT, indirect_spacing_m=0.2, indirect_rays=256, bounces=1, light_noise=10)
    added, reflected = by_mirror(panel, image, settings, roughness)
    assert added.mean() == pytest.approx(0.8 * reflected.mean(), rel=tolerance)
    assert np.corrcoef(added, reflected)[0, 1] > 0.97


def test_what_stands_between_a_lamp_and_the_mirror_shades_the_lamps_image() -> None:
    bulb = PointLight("bulb", np.array([1.0, 0.0, 1.0]), 1000.0)
    # Between the bulb and the mirror, facing the bulb.
    blocker = rectangle(np.array([1.5, 0, 1.0]), np.array([0, 6.0, 0]), np.array([0, 0, 4.0]), "grey")
    materials = {**GREY, "mirror": Material("mirror", tint=0.8)}
    light = floor_light(bake(Scene("m", (FLOOR, MIRROR, blocker), materials, (bulb,)), DIRECT))
    straight = floor_light(bake(scene(bulb, things=(FLOOR, blocker)), DIRECT))
    before = light[0] < 1.4
    np.testing.assert_array_equal(light[2][before], straight[2][before])


def test_the_floor_under_a_box_has_the_light_beside_it_so_that_no_darkness_leaks_out() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.0]), (0.2, 0.2), power_lm=1000)
    crate = box(np.array([0.6, 0, 0.1]), (0.55, 0.55, 0.2), yaw_deg=0, material="grey")
    x, y, light = floor_light(bake(scene(lamp, things=(FLOOR, *crate)), DIRECT))
    open_light = floor_light(bake(scene(lamp), DIRECT))[2]
    row = np.abs(y).argmin(0)[0]
    lit_foot = np.flatnonzero((x[row] > 0.325) & (x[row] < 0.45))[0]
    assert light[row, lit_foot] == pytest.approx(open_light[row, lit_foot], rel=0.1)


@pytest.mark.parametrize("threads", [1, 5])
def test_the_number_of_threads_changes_no_byte(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = replace(DIRECT, indirect_spacing_m=0.1, indirect_rays=16, bounces=2)
    coated = {"grey": Material(texture=Procedural(*BODY), eta=1.5, roughness=0.1)}
    usual = maps(bake(Scene("s", GLOBE, coated, (LAMP,)), settings))
    monkeypatch.setattr("vobench.rendering.thread_pool.os.cpu_count", lambda: threads)
    assert maps(bake(Scene("s", GLOBE, coated, (LAMP,)), settings)) == usual


def solid(name: str, shape: trimesh.Trimesh, *, smooth: bool = False, inside: bool = False) -> Thing:
    vertices, faces = np.asarray(shape.vertices, float), np.asarray(shape.faces, np.int32)
    mesh = flat_shaded(vertices, faces, vertices[:, :2])
    if smooth:
        mesh = make_mesh(vertices, faces, vertices[:, :2].copy(), np.asarray(shape.vertex_normals, float))
    return Thing(name, flipped(mesh) if inside else mesh, "grey")


@pytest.mark.parametrize("smooth", [False, True])
def test_in_a_sphere_of_triangles_light_is_that_of_the_integrating_sphere_all_over_it(smooth: bool) -> None:
    ball = solid("ball", trimesh.creation.icosphere(subdivisions=4), smooth=smooth, inside=True)
    bulb = PointLight("bulb", np.array([0.3, 0.1, 0.2]), 1000.0)
    settings = BakeSettings(spacing_m=0.05, indirect_rays=256)
    baked = bake(Scene("globe", (ball,), {"grey": Material(colour=(0.8, 0.5, 0.2))}, (bulb,)), settings)
    light, area_m2 = Illumination(baked).at(0, 0), areas_m2(baked.faces.corners_m).sum()
    for channel, albedo in enumerate((0.8, 0.5, 0.2)):
        around = light[..., channel] - baked.direct[0]
        expected = 1000 * albedo / (1 - albedo) / area_m2
        assert flux_lm(baked, around) / area_m2 == pytest.approx(expected, rel=0.01)
        on_ball = around[baked.patches.surfel_of.reshape(around.shape) >= 0]
        np.testing.assert_allclose(on_ball, expected, rtol=0.03)


def test_a_round_lamp_lights_as_its_solid_angle_says() -> None:
    shape = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    shape.apply_translation([0.2, -0.1, 1.0])
    lamp = AreaLight("ball", solid("ball", shape).mesh, power_lm=1000)
    x, y, light = floor_light(bake(scene(lamp), replace(DIRECT, spacing_m=0.05, light_rays=256)))
    squared = (x - 0.2) ** 2 + (y + 0.1) ** 2 + 1
    # A sphere that is seen whole lights as all of its power would from its middle.
    expected = 1000 / (4 * np.pi) / squared / np.sqrt(squared)
    assert light.mean() == pytest.approx(expected.mean(), rel=0.005)
    np.testing.assert_allclose(light, expected, rtol=0.08)


def test_no_light_passes_a_thin_wall() -> None:
    walls = trimesh.creation.box((4.0, 2.0, 2.0))
    between = trimesh.creation.box((0.02, 2.01, 2.01))
    things = (solid("room", walls, inside=True), solid("wall", between))
    bulb = PointLight("bulb", np.array([-1.0, 0.1, 0.2]), 1000.0)
    baked = bake(Scene("rooms", things, GREY, (bulb,)), BakeSettings(indirect_rays=64))
    own = owners(baked.atlas)
    in_room = (own.face >= 0) & (baked.faces.thing[own.face] == 0)
    (u, v), face = own.uv[in_room].T.astype(float), own.face[in_room]
    places = Hits(face, u, v, u).at(baked.faces.corners_m)
    light = baked.atlas.read(whole(baked), face, u, v)
    assert light[places[:, 0] < -0.02].min() > 1
    np.testing.assert_allclose(light[places[:, 0] > 0.02], 0, atol=1e-3)


def traced(baked: BakedScene, bulb: PointLight, *, count: int, paths: int) -> tuple[tuple[Array, Array, Array], Array]:
    """Places (face, u, v) of bodies and their indirect light (count, 3), by paths that look for a bulb at each turn."""
    numbers, faces, materials = np.random.default_rng(7), baked.faces, baked.scene.materials
    visibility = Visibility(faces, materials, np.arange(len(faces)))
    area_m2 = areas_m2(faces.corners_m)
    face = numbers.choice(len(faces), count, p=area_m2 / area_m2.sum()).astype(np.int32)
    a, b = numbers.random((2, count))
    place = (face, np.sqrt(a) * (1 - b), np.sqrt(a) * b)
    start = offset_from_surface(Hits(*place, place[1]).at(faces.corners_m), faces.plane[face]).astype(np.float32)
    points, normals, path = (
        np.repeat(start, paths, 0),
        np.repeat(faces.plane[face], paths, 0).astype(np.float32),
        np.arange(count * paths),
    )
    carried, total = np.ones((len(points), 3)), np.zeros((count * paths, 3))
    for _ in range(12):
        ways = cosine_weighted(normals)(*numbers.random((2, len(points)), dtype=np.float32))
        hits = visibility.opaque.hits(points, ways)
        front = (hits.face >= 0) & (np.einsum("ij,ij->i", ways, visibility.normals[hits.face]) < 0)
        hits, ends, path, carried = (
            hits.take(front),
            (points + hits.distance[:, None] * ways)[front],
            path[front],
            carried[front],
        )
        carried = carried * reflected(baked, hits)
        normals = visibility.normals[hits.face]
        points = offset_from_surface(ends, normals).astype(np.float32)
        way = (bulb.position_m - points).astype(np.float32)
        squared = np.einsum("ij,ij->i", way, way)
        cosine = np.maximum(np.einsum("ij,ij->i", way, normals), 0) / np.sqrt(squared)
        straight = bulb.power_lm / (4 * np.pi) * cosine / squared * visibility.is_unoccluded(points, way)
        total[path] += carried * straight[:, None]
    return place, total.reshape(count, paths, 3).mean(1)


def reflected(baked: BakedScene, hits: Hits) -> Array:
    """Reflectance (R, 3) where rays end, by the textures' own pixels."""
    result = np.zeros((len(hits.face), 3))
    names = np.array([thing.material for thing in baked.faces.things])[baked.faces.thing[hits.face]]
    for name, material in baked.scene.materials.items():
        own = names == name
        tile = material.texture.pixels() if material.texture else np.ones((1, 1))
        uv = hits.take(own).at(baked.faces.uv) / material.tile_m % 1
        rows, columns = (
            (uv[:, 1] * len(tile)).astype(int) % len(tile),
            (uv[:, 0] * len(tile[0])).astype(int) % len(tile[0]),
        )
        result[own] = tile[rows, columns][:, None] * np.array(material.colour)
    return result


def test_indirect_light_is_that_of_paths_traced_one_by_one() -> None:
    things = [solid("room", trimesh.creation.box((3, 2.6, 2.2)), inside=True)]
    for nth, (size, at) in enumerate(
        (
            ((1.2, 0.7, 0.03), (-0.5, 0.6, -0.4)),
            ((1.4, 1.0, 0.008), (0.4, -0.4, -1.095)),
            ((0.3, 0.4, 0.9), (1, 0.7, -0.64)),
        )
    ):
        part = trimesh.creation.box(size)
        part.apply_translation(at)
        things.append(replace(solid(f"part {nth}", part), material="red"))
    round_ = trimesh.creation.icosphere(subdivisions=2, radius=0.25)
    round_.apply_translation([0.1, -0.5, -0.8])
    things.append(replace(solid("round", round_, smooth=True), material="red"))
    materials = {
        "grey": Material(texture=Procedural("checker", 0.6, 0.5, 0.4, 64, 0)),
        "red": Material(colour=(0.7, 0.3, 0.1)),
    }
    bulb = PointLight("bulb", np.array([-0.7, -0.5, 0.8]), 1000.0)
    made = Scene("room", tuple(things), materials, (bulb,))
    baked = bake(made, BakeSettings())
    place, expected = traced(baked, bulb, count=400, paths=400)
    around = Illumination(baked).at(0, 0) - baked.direct[0][..., None]
    seen = baked.atlas.read(around, *place)
    outside = expected.sum(1) > 1
    for channel in range(3):
        assert seen[outside, channel].mean() == pytest.approx(expected[outside, channel].mean(), rel=0.015)
