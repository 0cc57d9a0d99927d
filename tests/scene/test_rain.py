"""Rain: numbers of drops by Marshall and Palmer, the water that they carry, their speeds, and where they are."""

import numpy as np
import pytest

from vobench.scene.rain import LARGEST_MM, LEAST_MM, N0_PER_M3_MM, FallingDrops, Rain
from vobench.scene.scene import Scene, sized

MM_PER_M = 1e3
S_PER_H = 3600
CAMERA_M = np.array([3.0, -2.0, 1.5])


@pytest.mark.parametrize("rate_mm_per_h", [1.0, 10.0, 50.0, 200.0])
def test_the_number_of_drops_in_a_volume_is_the_integral_of_marshall_and_palmer(rate_mm_per_h: float) -> None:
    rain = Rain(rate_mm_per_h=rate_mm_per_h)
    slope = 4.1 * rate_mm_per_h**-0.21
    per_m3 = N0_PER_M3_MM / slope * (np.exp(-slope * LEAST_MM) - np.exp(-slope * LARGEST_MM))
    assert sum(drops.per_m3 for drops in rain.size_classes) == pytest.approx(per_m3)


@pytest.mark.parametrize("rate_mm_per_h", [1.0, 10.0, 50.0])
def test_the_drops_that_fall_carry_the_water_of_the_rate(rate_mm_per_h: float) -> None:
    """The distribution and the terminal velocities are from different measurements, which agree to a fifth."""
    flux_mps = sum(
        drops.per_m3 * np.pi / 6 * drops.diameter_m**3 * drops.fall_mps
        for drops in Rain(rate_mm_per_h=rate_mm_per_h).size_classes
    )
    assert flux_mps * MM_PER_M * S_PER_H == pytest.approx(rate_mm_per_h, rel=0.2)


def test_larger_drops_fall_faster_up_to_nine_metres_a_second() -> None:
    speeds_mps = [drops.fall_mps for drops in Rain().size_classes]
    assert (np.diff(speeds_mps) > 0).all()
    assert speeds_mps[-1] == pytest.approx(9.3, abs=0.2)  # Gunn and Kinzer (1949): 9.2 m/s at 5.8 mm


def test_extinction_is_that_which_optical_links_measure() -> None:
    """Atlas (1953): 0.365 rate^0.63 per km, which counts diffracted light, so twice the cross-section."""
    for rate_mm_per_h in (5.0, 10.0, 50.0):
        measured_per_km = 0.365 * rate_mm_per_h**0.63
        computed_per_km = 2 * 1e3 * Rain(rate_mm_per_h=rate_mm_per_h).extinction_per_m
        assert computed_per_km == pytest.approx(measured_per_km, rel=0.25)


def test_rain_that_has_stopped_has_no_drops() -> None:
    rain = Rain(rate_mm_per_h=0.0)
    assert rain.extinction_per_m == 0
    assert len(FallingDrops(rain).near(CAMERA_M, 0)) == 0


def test_each_size_is_as_dense_around_the_camera_as_the_distribution_says() -> None:
    rain = Rain(rate_mm_per_h=20.0)
    near = FallingDrops(rain).near(CAMERA_M, 5e9)
    for drops in rain.size_classes[:8]:
        is_size = near.diameters_m == drops.diameter_m
        from_camera_m = np.abs(near.positions_m[is_size] - CAMERA_M)
        assert from_camera_m.max() <= drops.reach_m
        expected = drops.per_m3 * (2 * drops.reach_m) ** 3
        assert is_size.sum() == pytest.approx(expected, abs=5 * np.sqrt(expected))


def test_drops_fall_at_their_velocity_and_drift_with_the_wind() -> None:
    drops = FallingDrops(Rain(rate_mm_per_h=5.0, wind_mps=(2.0, -1.0)))
    before = drops.near(CAMERA_M, 1e9)
    after = drops.near(CAMERA_M, 1.001e9)
    moved_m = after.positions_m - before.positions_m
    stayed = (np.abs(moved_m) < 0.1).all(1)  # the others entered the cube on the opposite side
    assert stayed.mean() > 0.95
    np.testing.assert_allclose(moved_m[stayed], 1e-3 * before.velocities_mps[stayed], atol=1e-9)
    np.testing.assert_array_equal(before.velocities_mps[:, :2], np.tile([2.0, -1.0], (len(before), 1)))


def test_two_cameras_see_the_same_drops_where_both_look() -> None:
    drops = FallingDrops(Rain(rate_mm_per_h=5.0))
    one = drops.near(CAMERA_M, 1e9)
    other = drops.near(CAMERA_M + np.array([0.2, 0, 0]), 1e9)
    is_shared = (np.abs(one.positions_m - other.positions_m) < 1e-6).all(1)
    assert is_shared.mean() > 0.85
    unshared_m = np.abs(one.positions_m - other.positions_m)[~is_shared].max(1)
    assert unshared_m.min() > 1.0  # half a cube on the other side


def test_a_seed_gives_the_same_drops_and_another_one_others() -> None:
    first = FallingDrops(Rain(seed=3)).near(CAMERA_M, 0)
    again = FallingDrops(Rain(seed=3)).near(CAMERA_M, 0)
    other = FallingDrops(Rain(seed=4)).near(CAMERA_M, 0)
    np.testing.assert_array_equal(first.positions_m, again.positions_m)
    shared = min(len(first), len(other))
    assert not np.isclose(first.positions_m[:shared], other.positions_m[:shared]).all(1).any()


def test_the_drops_of_a_scene_twice_as_large_are_as_large_as_before() -> None:
    rain = Rain(rate_mm_per_h=30.0)
    assert sized(Scene("empty", (), {}, (), rain=rain), 2.0).rain == rain
