"""Baked light obeys photometry: inverse square, cosines, superposition, shadow and conservation of energy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.render.bake import LIGHT, BakedScene, BakeSettings, bake, load_baked, save_baked
from vobench.scene.light import Flicker, Light, PointLight, SpotLight, Sun
from vobench.scene.material import Matt, Mirror, Polished, fresnel, under_coat
from vobench.scene.scene import Scene, ceiling_light
from vobench.scene.surface import Surface, box, rectangle, room

DIRECT = BakeSettings(spacing_m=0.1, light_rays=16, indirect_spacing_m=1.0, indirect_rays=1, bounces=0)
BODY = ("plain", 0.5, 0.0, 1.0, 8, 0)
GREY = {"grey": Matt(*BODY)}
FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "grey")
LAMP = ceiling_light("lamp", np.array([0.3, -0.2, 2.0]), (0.04, 0.06), power_lm=1000)


def scene(*lamps: Light, surfaces: tuple[Surface, ...] = (FLOOR,)) -> Scene:
    return Scene("test", surfaces, GREY, lamps)


def floor_light(baked: BakedScene) -> tuple[Array, Array, Array]:
    """Places x, y and illuminance (rows, columns) on the first surface."""
    patch = baked.atlas.charts[0]
    points = baked.scene.surfaces[0].at(*patch.fractions())
    return points[..., 0], points[..., 1], baked.light.sum(0)[patch.window].astype(float)


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
        bake(scene(replace(LAMP, power_lm=power), surfaces=closed), settings).light for power in (700.0, 1400.0)
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
    x, y, shaded = floor_light(bake(scene(lamp, surfaces=(FLOOR, *blocker)), DIRECT))
    open_light = floor_light(bake(scene(lamp), DIRECT))[2]
    far = np.maximum(np.abs(x), np.abs(y))
    # From the lamp's rims past the box's: the box's top is 0.95 m below the lamp, its underside 1.05 m.
    umbra, lit = 0.1 + (0.4 - 0.1) / 1.05 * 2.0, -0.1 + (0.4 + 0.1) / 0.95 * 2.0
    np.testing.assert_array_equal(shaded[far < umbra - 0.01], 0)
    share = shaded / open_light
    np.testing.assert_allclose(share[far > lit + 0.01], 1, atol=0.03)
    half_lit = share[np.abs(far - (umbra + lit) / 2) < 0.06]
    assert 0.2 < half_lit.mean() < 0.7


def test_half_shadows_are_smooth() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.0]), (0.2, 0.2), power_lm=1000)
    blocker = box(np.array([0, 0, 1.0]), (0.8, 0.8, 0.1), yaw_deg=0, material="grey")
    shaded, fine = (
        floor_light(bake(scene(lamp, surfaces=(FLOOR, *blocker)), replace(DIRECT, spacing_m=0.03, light_rays=rays)))[2]
        for rays in (16, 400)
    )
    open_light = floor_light(bake(scene(lamp), replace(DIRECT, spacing_m=0.03)))[2]
    half = (fine > 0) & (fine < 0.97 * open_light)
    # Sixteen rays alone would leave a grain of 5 %.
    assert np.sqrt(np.mean(((shaded - fine) / open_light)[half] ** 2)) < 0.03


def test_nothing_shines_through_the_corners_of_a_closed_box() -> None:
    lamp = ceiling_light("lamp", np.array([0.5, 0.4, 2.0]), (0.2, 0.2), power_lm=1000)
    crate = box(np.array([0, 0, 0.5]), (1.0, 1.0, 1.0), yaw_deg=0, material="grey")
    x, y, light = floor_light(bake(scene(lamp, surfaces=(FLOOR, *crate)), DIRECT))
    np.testing.assert_array_equal(light[np.maximum(np.abs(x), np.abs(y)) < 0.49], 0)


def flux_lm(baked: BakedScene) -> float:
    """Light that arrives on all surfaces but the lamps' panels: trapezoids over each patch."""
    total = 0.0
    for surface, patch in zip(baked.scene.surfaces, baked.atlas.charts, strict=False):
        weights = np.outer(*(_trapezoid(n) for n in (patch.rows, patch.columns)))
        total += float((weights * baked.light.sum(0)[patch.window]).sum() * np.prod(surface.size_m))
    return total


def _trapezoid(count: int) -> Array:
    weights = np.full(count, 1 / (count - 1))
    weights[[0, -1]] /= 2
    return weights


@pytest.mark.parametrize("bounces", [0, 1, 3, 12])
def test_a_closed_room_keeps_its_light_and_each_bounce_returns_the_albedos_share(bounces: int) -> None:
    settings = BakeSettings(
        spacing_m=0.05, light_rays=16, indirect_spacing_m=0.15, indirect_rays=64, bounces=bounces, seed=1
    )
    # The panel itself swallows what falls on it, so it is small.
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, 1.5]), (0.1, 0.1), power_lm=1000)
    closed = tuple(room((3, 2.5, 2.5), floor="grey", wall="grey", ceiling="grey"))
    arriving = flux_lm(bake(scene(lamp, surfaces=closed), settings))
    # Ulbricht's integrating sphere: every surface returns its albedo of what it gets, whatever the shape.
    expected = 1000 * sum(0.5**n for n in range(bounces + 1))
    assert arriving == pytest.approx(expected, rel=0.01)


def test_a_bake_is_the_same_bytes_twice_and_another_seed_changes_only_noise() -> None:
    settings = replace(DIRECT, light_rays=4, indirect_spacing_m=0.3, indirect_rays=16, bounces=2)
    closed = tuple(room((3, 3, 2.5), floor="grey", wall="grey", ceiling="grey"))
    first, again, other = (bake(scene(LAMP, surfaces=closed), replace(settings, seed=seed)).light for seed in (0, 0, 1))
    assert first.tobytes() == again.tobytes()
    assert not np.array_equal(first, other)
    assert other.mean() == pytest.approx(first.mean(), rel=0.01)


def test_a_lamps_panel_shows_its_own_luminance() -> None:
    baked = bake(scene(LAMP), DIRECT)
    panel = baked.light[0][baked.atlas.charts[-1].window]
    np.testing.assert_allclose(panel, np.pi * LAMP.luminance_cd_m2, rtol=1e-6)


def test_a_bulb_obeys_the_inverse_square_and_casts_a_hard_shadow() -> None:
    bulb = PointLight("bulb", np.array([0.3, -0.2, 2.0]), 1000.0)
    blocker = rectangle(np.array([0.3, -0.2, 1.0]), np.array([0, 0.5, 0]), np.array([0.5, 0, 0]), "grey")
    x, y, light = floor_light(bake(scene(bulb), DIRECT))
    squared = (x - 0.3) ** 2 + (y + 0.2) ** 2 + 4
    np.testing.assert_allclose(light, 1000 / (4 * np.pi) * 2 / squared**1.5, rtol=5e-3)
    shaded = floor_light(bake(scene(bulb, surfaces=(FLOOR, blocker)), DIRECT))[2]
    far = np.maximum(np.abs(x - 0.3), np.abs(y + 0.2))
    np.testing.assert_array_equal(shaded[far < 0.5 - 0.08], 0)
    np.testing.assert_allclose(shaded[far > 0.5 + 0.08], light[far > 0.5 + 0.08], rtol=1e-6)


def test_the_edge_of_a_hard_shadow_is_as_light_as_the_share_of_each_sample_it_leaves() -> None:
    bulb = PointLight("bulb", np.array([0.0, 0.0, 2.0]), 1000.0)
    # Its shadow ends 0.52 m from the middle, between samples 0.1 m apart at 0.5 and 0.6.
    blocker = rectangle(np.array([0, 0, 1.0]), np.array([0, 0.52, 0]), np.array([0.52, 0, 0]), "grey")
    x, y, light = floor_light(bake(scene(bulb, surfaces=(FLOOR, blocker)), DIRECT))
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
    white = {"grey": Matt("plain", 0.8, resolution_px=8)}
    lamp = PointLight("bulb", np.array([0, 0, 1.0]), 1000.0)
    light = bake(Scene("globe", GLOBE, white, (lamp,)), ALL_EQUAL)
    straight = bake(Scene("globe", GLOBE, white, (lamp,)), replace(ALL_EQUAL, bounces=0))
    indirect = (flux_lm(light) - flux_lm(straight)) / 24
    # Ulbricht: E = Φ ρ / (A (1 - ρ)).
    assert indirect == pytest.approx(1000 * 0.8 / (24 * (1 - 0.8)), rel=0.01)
    on_floor = (light.light - straight.light)[0][light.atlas.charts[0].window]
    # A cube's corners are darker than its walls, but not by much.
    np.testing.assert_allclose(np.quantile(on_floor, [0.1, 0.9]), indirect, rtol=0.1)


def test_each_light_has_a_layer_of_its_own_and_dimming_one_leaves_the_others_byte_equal() -> None:
    settings = replace(DIRECT, indirect_spacing_m=0.3, indirect_rays=16, bounces=2)
    bulb = PointLight("bulb", np.array([0.5, 0, 1.0]), 300.0)
    both = bake(scene(LAMP, bulb, surfaces=GLOBE), settings).light
    dimmed = bake(scene(replace(LAMP, power_lm=10, level=Flicker(depth=0.5)), bulb, surfaces=GLOBE), settings).light
    assert both[1].tobytes() == dimmed[1].tobytes()
    assert not np.array_equal(both[0], dimmed[0])
    alone = bake(scene(bulb, surfaces=GLOBE), settings).light[0]
    floor = both.shape[1:]
    assert alone.shape[1:] == floor[1:]
    patch = bake(scene(bulb, surfaces=GLOBE), settings).atlas.charts[0].window
    assert alone[patch].mean() == pytest.approx(both[1][patch].mean(), rel=0.03)


def test_under_a_coat_light_counts_by_what_the_coat_lets_in() -> None:
    bulb = PointLight("bulb", np.array([0.0, 0.0, 1.0]), 1000.0)
    x, y, matt = floor_light(bake(scene(bulb), DIRECT))
    coated = Scene("coat", (FLOOR,), {"grey": Polished(*BODY)}, (bulb,))
    _, _, let_in = floor_light(baked := bake(coated, DIRECT))
    cosine = 1 / np.sqrt(x**2 + y**2 + 1)
    np.testing.assert_allclose(let_in, matt * (1 - fresnel(cosine, 1.5)), rtol=1e-3)
    np.testing.assert_allclose(baked.albedo["grey"], under_coat(np.array(0.5), 1.5), rtol=1e-5)


def test_a_white_coated_box_keeps_its_light_as_a_white_matt_one_does() -> None:
    """What a coat mirrors and what its body scatters add up to everything."""
    lamp = PointLight("bulb", np.array([0.3, 0.2, 1.1]), 1000.0)
    kept = []
    for material in (Matt("plain", 0.98, resolution_px=8), Polished("plain", 0.98, resolution_px=8)):
        settings = replace(ALL_EQUAL, bounces=6, indirect_rays=64)
        walls = tuple(room((2, 2, 2), floor="grey", wall="matt", ceiling="matt"))
        materials = {"grey": material, "matt": Matt("plain", 0.5, resolution_px=8)}
        baked = bake(Scene("box", walls, materials, (lamp,)), settings)
        kept.append(np.mean([baked.light[0][p.window].mean() for p in baked.atlas.charts[1:]]))
    assert kept[1] == pytest.approx(kept[0], rel=0.02)


MIRROR = rectangle(np.array([2.0, 0, 1.5]), np.array([0, 0, 3.0]), np.array([0, 8.0, 0]), "mirror")


def by_mirror(light: Light, image: Light, settings: BakeSettings, roughness: float) -> tuple[Array, Array]:
    """Light on the floor that a mirror wall adds, and the light of a lamp put where its image is."""
    materials = {**GREY, "mirror": Mirror(0.8, roughness)}
    with_mirror = floor_light(bake(Scene("m", (FLOOR, MIRROR), materials, (light,)), settings))[2]
    x, y, straight = floor_light(bake(scene(light), settings))
    near = (np.abs(x) < 1.5) & (np.abs(y) < 1.5)
    return (with_mirror - straight)[near], floor_light(bake(scene(image), settings))[2][near]


def test_a_mirror_wall_doubles_a_lamp() -> None:
    panel = ceiling_light("lamp", np.array([1.0, 0.0, 2.0]), (1.0, 1.0), power_lm=1000)
    image = replace(panel, surface=rectangle(np.array([3.0, 0, 2.0]), *_edges(panel.surface), "image"))
    bulb = PointLight("bulb", np.array([1.0, 0.5, 1.5]), 1000.0)
    for light, behind in ((panel, image), (bulb, replace(bulb, position_m=np.array([3.0, 0.5, 1.5])))):
        added, reflected = by_mirror(light, behind, DIRECT, 0.0)
        np.testing.assert_allclose(added, 0.8 * reflected, rtol=0.04)
        assert added.mean() == pytest.approx(0.8 * reflected.mean(), rel=0.002)


def test_a_lamp_in_a_mirror_counts_once_and_gathered_rays_find_the_lamps_that_a_rough_mirror_blurs() -> None:
    panel = ceiling_light("lamp", np.array([1.0, 0.0, 2.0]), (1.0, 1.0), power_lm=1000)
    image = replace(panel, surface=rectangle(np.array([3.0, 0, 2.0]), *_edges(panel.surface), "image"))
    settings = replace(DIRECT, indirect_spacing_m=0.2, indirect_rays=1024, bounces=1)
    for roughness in (0.0, 0.05):
        added, reflected = by_mirror(panel, image, settings, roughness)
        assert added.mean() == pytest.approx(0.8 * reflected.mean(), rel=0.02 if roughness == 0 else 0.05)
        assert np.corrcoef(added, reflected)[0, 1] > 0.97


def test_what_stands_between_a_lamp_and_the_mirror_shades_the_lamps_image() -> None:
    bulb = PointLight("bulb", np.array([1.0, 0.0, 1.0]), 1000.0)
    # Between the bulb and the mirror, facing the bulb.
    blocker = rectangle(np.array([1.5, 0, 1.0]), np.array([0, 6.0, 0]), np.array([0, 0, 4.0]), "grey")
    materials = {**GREY, "mirror": Mirror(0.8)}
    light = floor_light(bake(Scene("m", (FLOOR, MIRROR, blocker), materials, (bulb,)), DIRECT))
    straight = floor_light(bake(scene(bulb, surfaces=(FLOOR, blocker)), DIRECT))
    before = light[0] < 1.4
    np.testing.assert_array_equal(light[2][before], straight[2][before])


def _edges(surface: Surface) -> tuple[Array, Array]:
    return surface.edge_u_m, surface.edge_v_m


def test_the_floor_under_a_box_has_the_light_beside_it_so_that_no_darkness_leaks_out() -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.0]), (0.2, 0.2), power_lm=1000)
    crate = box(np.array([0.6, 0, 0.1]), (0.55, 0.55, 0.2), yaw_deg=0, material="grey")
    x, y, light = floor_light(bake(scene(lamp, surfaces=(FLOOR, *crate)), DIRECT))
    open_light = floor_light(bake(scene(lamp), DIRECT))[2]
    row = np.abs(y).argmin(0)[0]
    lit_foot = np.flatnonzero((x[row] > 0.325) & (x[row] < 0.45))[0]
    assert light[row, lit_foot] == pytest.approx(open_light[row, lit_foot], rel=0.1)


@pytest.mark.parametrize("threads", [1, 5])
def test_the_number_of_threads_changes_no_byte(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = replace(DIRECT, indirect_spacing_m=0.1, indirect_rays=16, bounces=2)
    coated = {"grey": Polished(*BODY, roughness=0.1)}
    usual = bake(Scene("s", GLOBE, coated, (LAMP,)), settings).light
    monkeypatch.setattr("vobench.render.lightmap.os.cpu_count", lambda: threads)
    assert bake(Scene("s", GLOBE, coated, (LAMP,)), settings).light.tobytes() == usual.tobytes()


@pytest.fixture(scope="module")
def baked() -> BakedScene:
    floor = Polished("terrazzo", 0.5, 0.5, 1.0, 64, 0)
    materials = {"floor": floor, "wall": Matt("plain", 0.6, 0.0, 1.0, 8, 0)}
    surfaces = tuple(room((2, 2, 2), floor="floor", wall="wall", ceiling="wall"))[1:]
    sun = Sun("sun", 1e4, (0.0, 10.0), (0.0, 10.0), (60.0, 70.0))
    lamp = ceiling_light("lamp", np.array([0, 0, 1.9]), (0.2, 0.2), power_lm=100)
    settings = BakeSettings(spacing_m=0.5, indirect_spacing_m=1.0, light_rays=1, indirect_rays=4)
    return bake(Scene("cell", surfaces, materials, (lamp, sun)), settings)


def test_what_was_saved_is_what_is_loaded(baked: BakedScene, tmp_path: Path) -> None:
    save_baked(tmp_path, baked)
    loaded = load_baked(tmp_path, baked.scene)
    assert loaded.atlas == baked.atlas
    assert loaded.settings == baked.settings
    assert loaded.light.tobytes() == baked.light.tobytes()
    assert loaded.light.dtype == baked.light.dtype
    (track,), (kept,) = loaded.tracks, baked.tracks
    assert (track.light, track.times_ns) == (kept.light, kept.times_ns)
    assert track.bounced.tobytes() == kept.bounced.tobytes()
    assert sorted(loaded.albedo) == sorted(baked.albedo)
    for name, tile in baked.albedo.items():
        assert loaded.albedo[name].tobytes() == tile.tobytes()


@pytest.mark.parametrize("name", [LIGHT, "sun.1.npz"])
@pytest.mark.parametrize("left", [0, 100])
def test_an_empty_or_torn_file_is_an_error_that_names_the_folder(baked, tmp_path, name, left):
    save_baked(tmp_path, baked)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:left])
    with pytest.raises(RenderError, match=str(tmp_path)):
        load_baked(tmp_path, baked.scene)


def test_a_missing_texture_is_an_error_that_names_the_folder(baked: BakedScene, tmp_path: Path) -> None:
    save_baked(tmp_path, baked)
    (tmp_path / "albedo.floor.npy").unlink()
    with pytest.raises(RenderError, match=str(tmp_path)):
        load_baked(tmp_path, baked.scene)
