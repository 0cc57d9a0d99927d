"""Wind: deflections grow with the square of its speed, gusts travel with it, and time alone determines them."""

import numpy as np
import pytest

from vobench.geometry.se3 import Array
from vobench.scene.wind import ACROSS, BRANCH_HZ, DAMPING, TREE_HZ_M, VARIATION, WAVES, Sway, Wind, branch_sways
from vobench.trajectory.nanoseconds import NS_PER_S

LONG_S = np.arange(0, 3000, 0.21)
ORIGIN_M = np.zeros(3)


def sways(wind: Wind, *, tree: int = 0, place_m: Array = ORIGIN_M, height_m: float = 7.5) -> list[Sway]:
    return branch_sways(wind, tree=tree, place_m=place_m, height_m=height_m, branches=4)


def deflections_rad(sway: Sway, times_s: Array) -> Array:
    return np.array([sway.at(t_s * NS_PER_S) for t_s in times_s])


def test_the_deflection_has_the_stated_mean_and_variation() -> None:
    wind = Wind(speed_mps=8.0, seed=2)
    for sway in sways(wind):
        along_rad, across_rad = deflections_rad(sway, LONG_S).T
        variation_rad = VARIATION * wind.deflection_rad
        assert along_rad.mean() == pytest.approx(wind.deflection_rad, rel=0.02)
        assert across_rad.mean() == pytest.approx(0, abs=0.02 * wind.deflection_rad)
        assert along_rad.std() == pytest.approx(variation_rad, rel=0.05)
        assert across_rad.std() == pytest.approx(ACROSS * variation_rad, rel=0.05)


def test_twice_the_speed_deflects_four_times_as_much() -> None:
    assert Wind(speed_mps=12.0).deflection_rad == pytest.approx(4 * Wind(speed_mps=6.0).deflection_rad)
    assert Wind(speed_mps=10.0).deflection_rad == pytest.approx(np.deg2rad(5))


def test_an_instant_has_one_deflection_whatever_was_asked_before() -> None:
    sway, *_ = sways(Wind(seed=5))
    again, *_ = sways(Wind(seed=5))
    first = sway.at(7_300_000_000)
    for t_ns in (0, 9_000_000_000, -4_000_000_000):
        sway.at(t_ns)
    assert np.array_equal(sway.at(7_300_000_000), first)
    assert np.array_equal(again.at(7_300_000_000), first)


def test_seeds_trees_and_branches_differ() -> None:
    one, other = sways(Wind(seed=1))[:2]
    all_first = [one, other, sways(Wind(seed=2))[0], sways(Wind(seed=1), tree=1)[0]]
    deflections = {tuple(sway.at(2_000_000_000)) for sway in all_first}
    assert len(deflections) == len(all_first)


def test_gusts_arrive_downwind_as_late_as_the_wind_takes() -> None:
    wind = Wind(speed_mps=5.0, towards_deg=90.0)
    here, *_ = sways(wind)
    downwind, *_ = sways(wind, place_m=np.array([0.0, 20.0, 0.0]))
    beside, *_ = sways(wind, place_m=np.array([20.0, 0.0, 0.0]))
    gust_here_rad = here.phase_rad[:WAVES]
    delayed_rad = gust_here_rad - 2 * np.pi * here.frequency_hz[:WAVES, None] * 4.0  # 20 m at 5 m/s
    assert downwind.phase_rad[:WAVES] == pytest.approx(delayed_rad)
    assert beside.phase_rad[:WAVES] == pytest.approx(gust_here_rad)


@pytest.mark.parametrize("height_m", [6.0, 12.0])
def test_trees_sway_slowly_and_their_branches_faster(height_m: float) -> None:
    for sway in sways(Wind(seed=3), height_m=height_m):
        tree_hz = sway.frequency_hz[WAVES : 2 * WAVES]
        branch_hz = sway.frequency_hz[2 * WAVES :]
        assert np.abs(tree_hz / (TREE_HZ_M / height_m) - 1).max() <= 4 * DAMPING + 1e-12
        assert branch_hz.min() >= (1 - 4 * DAMPING) * BRANCH_HZ[0]
        assert branch_hz.max() <= (1 + 4 * DAMPING) * BRANCH_HZ[1]
