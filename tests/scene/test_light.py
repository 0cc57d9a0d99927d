"""Means over time are exact, and what leaves a lamp or falls from the sky is what was asked for."""

import numpy as np
import pytest
from trimesh import Trimesh

from vobench.asset.shape import at, block, cushion
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.scene.light import (
    NS_PER_S,
    SKIES,
    SUN_RADIUS_RAD,
    AreaLight,
    Dimmer,
    Flicker,
    Level,
    PointLight,
    Sky,
    SpotLight,
    Steady,
    Sun,
    Switched,
    scaled,
)
from vobench.scene.mesh import moved, quad
from vobench.scene.scene import ceiling_light

LEVELS: dict[str, Level] = {
    "steady": Steady(0.7),
    "flicker": Flicker(mains_hz=50, depth=0.4, phase_deg=60.0),
    "dimmer": Dimmer((1.0, 1.2, 2.0), (0.2, 1.0, 0.5)),
    "switched": Switched((1.05, 1.3, 1.31)),
    "switched on": Switched((1.1,), on_first=False),
    "scaled": scaled(Dimmer((1.0, 1.2), (0.2, 1.0)), 0.3),
}
INTERVALS = [(0.9, 1.02), (1.0, 1.35), (1.104, 1.109), (1.25, 3.0), (0.0, 0.5)]


def ns(t_s: float) -> int:
    return round(t_s * NS_PER_S)


def sphere(count: int) -> Array:
    """Unit vectors (count, 3) spread evenly: Fibonacci's lattice."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    return np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], -1)


@pytest.mark.parametrize("span_s", INTERVALS)
@pytest.mark.parametrize("level", LEVELS.values(), ids=list(LEVELS))
def test_the_mean_over_an_interval_is_the_integral_of_its_instants(level: Level, span_s: tuple[float, float]) -> None:
    count = 4_000
    step_s = (span_s[1] - span_s[0]) / count
    instants = span_s[0] + step_s * (np.arange(count) + 0.5)
    values = [level.mean(ns(t), ns(t)) for t in instants]
    # A jump falls within one step, hence the share of one.
    assert level.mean(ns(span_s[0]), ns(span_s[1])) == pytest.approx(np.mean(values), abs=2 / count)


@pytest.mark.parametrize("level", LEVELS.values(), ids=list(LEVELS))
def test_two_intervals_mean_what_both_together_do(level: Level) -> None:
    start, middle, end = ns(1.001), ns(1.123), ns(1.4)
    whole = level.mean(start, end) * (end - start)
    assert whole == pytest.approx(
        level.mean(start, middle) * (middle - start) + level.mean(middle, end) * (end - middle)
    )


def test_an_exposure_of_a_whole_period_sees_no_flicker_and_the_lamp_flickers_at_twice_the_mains() -> None:
    lamp = LEVELS["flicker"]
    assert lamp.mean(ns(0.123), ns(0.133)) == pytest.approx(1, abs=1e-12)
    assert lamp.mean(ns(0.1), ns(0.1)) == pytest.approx(lamp.mean(ns(0.11), ns(0.11)))
    assert abs(lamp.mean(ns(0.1), ns(0.1)) - lamp.mean(ns(0.105), ns(0.105))) > 0.3


def test_a_scaled_light_is_brighter_by_the_factor_and_steady_where_it_was() -> None:
    for level in LEVELS.values():
        assert scaled(level, 3.0).mean(ns(1.0), ns(1.4)) == pytest.approx(3 * level.mean(ns(1.0), ns(1.4)))
    assert scaled(Steady(0.5), 3.0) == Steady(1.5)


def test_a_switch_turns_at_its_instants_and_not_before() -> None:
    lamp = Switched((1.0, 2.0))
    assert [lamp.mean(t, t) for t in (0, ns(1) - 1, ns(1), ns(2) - 1, ns(2))] == [1, 1, 0, 0, 1]


@pytest.mark.parametrize(("inner_deg", "outer_deg"), [(10, 30), (25, 25), (0, 60)])
def test_all_light_of_a_spot_adds_up_to_its_power(inner_deg: float, outer_deg: float) -> None:
    axis = np.array([0.6, 0.0, -0.8])
    spot = SpotLight("s", np.zeros(3), axis, 800.0, inner_deg, outer_deg)
    directions = sphere(400_000)
    assert spot.intensity_cd(directions).mean() * 4 * np.pi == pytest.approx(800, rel=2e-3)
    assert spot.intensity_cd(axis) == pytest.approx(spot.peak_cd)
    off_axis = np.rad2deg(np.arccos(np.clip(directions @ axis, -1, 1)))
    assert (spot.intensity_cd(directions[off_axis > outer_deg]) == 0).all()


def test_a_spots_light_falls_in_a_straight_line_between_its_two_angles() -> None:
    spot = SpotLight("s", np.zeros(3), np.array([0, 0, 1.0]), 100.0, 20, 40)
    angles = np.deg2rad([20, 25, 30, 35, 40])
    towards = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], -1)
    np.testing.assert_allclose(spot.intensity_cd(towards) / spot.peak_cd, [1, 0.75, 0.5, 0.25, 0], atol=1e-9)


SHAPES = {
    "panel": quad((0, 0, 0), (2.0, 0, 0), (0, 0.5, 0)),
    "bevelled block": moved(block((0.3, 0.2, 0.1), bevel_m=0.02), at(1, 2, 3, yaw=20)),
    "ball": cushion((0.3, 0.3, 0.3), power=2, cells=4),
}


@pytest.mark.parametrize("shape", SHAPES.values(), ids=list(SHAPES))
def test_a_lamps_luminance_over_its_area_and_half_space_is_its_power(shape: Trimesh) -> None:
    lamp, directions = AreaLight("lamp", shape, 900.0), sphere(20_000)
    a, b, c = np.moveaxis(shape.triangles, 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    cosines = np.maximum(directions @ face_normals(shape.triangles).T, 0)
    assert lamp.luminance_cd_m2 * (cosines @ area).mean() * 4 * np.pi == pytest.approx(900, rel=1e-3)


@pytest.mark.parametrize("size_m", [(0.6, 0.6), (1.2, 0.1)])
def test_a_ceiling_light_shines_down_from_where_it_hangs(size_m: tuple[float, float]) -> None:
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, 2.9]), size_m, power_lm=4000)
    np.testing.assert_allclose(lamp.mesh.vertices.mean(0), [0.3, -0.2, 2.9])
    np.testing.assert_allclose(np.ptp(lamp.mesh.vertices, axis=0), [*size_m, 0])
    np.testing.assert_allclose(face_normals(lamp.mesh.triangles), [[0, 0, -1]] * 2)
    assert lamp.luminance_cd_m2 == pytest.approx(4000 / (np.pi * np.prod(size_m)))
    assert areas_m2(lamp.mesh.triangles).sum() == pytest.approx(np.prod(size_m))


def test_a_bulb_sends_out_its_power() -> None:
    bulb = PointLight("b", np.zeros(3), 900.0)
    assert bulb.intensity_cd(sphere(1000)).mean() * 4 * np.pi == pytest.approx(900)


@pytest.mark.parametrize("kind", SKIES)
def test_level_ground_gets_the_skys_illuminance(kind: str) -> None:
    sky = Sky("s", 12_000.0, kind, sun_direction=np.array([0.6, 0.0, 0.8]))
    directions = sphere(400_000)
    arriving = sky.luminance_cd_m2(directions) * np.maximum(directions[:, 2], 0)
    # The circumsolar peak of the clear sky is narrow.
    assert arriving.mean() * 4 * np.pi == pytest.approx(12_000, rel=1e-3)


@pytest.mark.parametrize("azimuth_deg", [90.0, 137.0, 270.0])
def test_a_sky_turns_with_its_sun(azimuth_deg: float) -> None:
    R = at(yaw=azimuth_deg)[:3, :3]
    sun = np.array([0.6, 0.0, 0.8])
    directions = sphere(1000)
    here = Sky("c", 1000.0, "clear", sun).luminance_cd_m2(directions)
    there = Sky("c", 1000.0, "clear", R @ sun).luminance_cd_m2(directions @ R.T)
    np.testing.assert_allclose(there, here, rtol=1e-3)


def test_skies_differ_as_the_standard_says() -> None:
    horizon, zenith, down = np.array([1.0, 0, 0.0]), np.array([0, 0, 1.0]), np.array([0, 0, -1.0])
    uniform, overcast = Sky("u", 1000.0, "uniform"), Sky("o", 1000.0, "overcast")
    assert uniform.luminance_cd_m2(horizon) == pytest.approx(1000 / np.pi)
    assert uniform.luminance_cd_m2(zenith) == pytest.approx(1000 / np.pi)
    # Moon and Spencer: an overcast zenith is three times as bright as the horizon.
    assert overcast.luminance_cd_m2(zenith) / overcast.luminance_cd_m2(horizon) == pytest.approx(3, rel=0.07)
    assert overcast.luminance_cd_m2(down) == pytest.approx(0.2 * 1000 / np.pi)


def test_a_clear_sky_is_brightest_around_the_sun() -> None:
    sun = np.array([0.6, 0.0, 0.8])
    directions = sphere(20_000)
    up = directions[directions[:, 2] > 0.3]
    brightest = up[np.argmax(Sky("c", 1000.0, "clear", sun).luminance_cd_m2(up))]
    assert brightest @ sun > 0.999


def test_the_sun_stands_where_it_was_put_and_moves_evenly_between() -> None:
    sun = Sun("s", 1e5, (0.0, 10.0), (0.0, 90.0), (30.0, 30.0))
    assert sun.moves
    np.testing.assert_allclose(sun.direction(0), [np.sqrt(0.75), 0, 0.5], atol=1e-12)
    np.testing.assert_allclose(sun.direction(10 * NS_PER_S), [0, np.sqrt(0.75), 0.5], atol=1e-12)
    middle = sun.direction(5 * NS_PER_S)
    assert middle[0] == pytest.approx(middle[1])
    np.testing.assert_allclose(sun.direction(99 * NS_PER_S), sun.direction(10 * NS_PER_S))
    assert not Sun("s", 1e5, (0.0,), (0.0,), (30.0,)).moves
    assert pytest.approx(0.0093, abs=1e-5) == 2 * SUN_RADIUS_RAD
