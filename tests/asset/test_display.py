"""Displays that are off emit nothing."""

import numpy as np

from vobench.asset import display
from vobench.asset.furniture import Part
from vobench.scene.material import emitted_cd_m2


def brightest_cd_m2(parts: list[Part]) -> float:
    return max(float(emitted_cd_m2(part.material).max()) for part in parts)


def test_a_monitor_that_is_off_emits_nothing() -> None:
    rng = np.random.default_rng(0)
    shining = display.monitor(rng, width_m=0.5, seed=0, is_on=True)
    dark = display.monitor(rng, width_m=0.5, seed=0, is_on=False)
    assert brightest_cd_m2(shining) > 1
    assert brightest_cd_m2(dark) == 0
    assert len(dark) == len(shining)


def test_a_laptop_is_off() -> None:
    assert brightest_cd_m2(display.laptop_off(np.random.default_rng(0), 1)) == 0


def test_some_televisions_are_on_and_most_are_off() -> None:
    rng = np.random.default_rng(0)
    lit = [brightest_cd_m2(display.television(rng, width_m=1.0, seed=0)) > 0 for _ in range(40)]
    assert 5 < sum(lit) < 20
