"""Designs are balanced: over places, over drives and over units."""

from collections import Counter

import pytest

from vobench.errors import SuiteError
from vobench.suite.scene_entry import drawn_lighting
from vobench.suite.scene_spec import LIGHTINGS
from vobench.suite.spread import Dealer, Spread, changes_for_units, units

VARIANTS = {"scene": [f"flat.{k}" for k in range(1, 7)], "trajectory": ["tour.1", "tour.2", "tour.3"]}


@pytest.mark.parametrize("count", [1, 4, 6, 9, 12, 18])
def test_units_are_distinct_and_places_and_drives_occur_about_equally_often(count: int) -> None:
    made = units(Spread(units=count), VARIANTS)
    assert len({unit.name for unit in made}) == count
    for axis, names in VARIANTS.items():
        counts = Counter(unit.by_axis[axis] for unit in made)
        numbers = [counts[name] for name in names]
        assert max(numbers) - min(numbers) <= 1


def test_more_units_than_there_are_is_one_line_of_error() -> None:
    with pytest.raises(
        SuiteError, match=r"19 units are more than the 18 that there are, 6 \(scene\) × 3 \(trajectory\)"
    ):
        units(Spread(units=19), VARIANTS)


def test_each_treatment_gets_distinct_units_in_distinct_places_and_units_get_equally_many() -> None:
    made = units(Spread(units=12), VARIANTS)
    dealer = Dealer(made, 3, seed=1)
    load = Counter[str]()
    for _ in range(20):
        dealt = dealer.deal()
        assert len({unit.name for unit in dealt}) == 3
        load.update(unit.name for unit in dealt)
    assert max(load.values()) - min(load.values()) <= 1


@pytest.mark.parametrize("treatments", range(1, 25))
def test_places_and_drives_have_about_equally_many_treatments_after_any_number(treatments: int) -> None:
    made = units(Spread(units=12), VARIANTS)
    dealer = Dealer(made, 3, seed=treatments)
    dealt = [unit for _ in range(treatments) for unit in dealer.deal()]
    for axis in ("scene", "trajectory"):
        load = Counter(unit.by_axis[axis] for unit in dealt)
        counts = [load[name] for name in VARIANTS[axis]]
        assert max(counts) - min(counts) <= 2


def test_the_seed_decides_which_units_a_treatment_gets() -> None:
    made = units(Spread(units=12), VARIANTS)
    first, again, other = ([Dealer(made, 3, seed).deal() for _ in range(1)] for seed in (1, 1, 2))
    assert first == again
    assert first != other


def test_four_seeds_in_a_row_have_the_four_lightings() -> None:
    for block in range(50):
        drawn = {drawn_lighting(4 * block + position) for position in (1, 2, 3, 4)}
        assert drawn == set(LIGHTINGS)


def test_more_units_take_more_seeds_of_places() -> None:
    suite = {"spread": {"units": 12}, "scenes": [{"name": "flat", "seeds": 6}, "room"]}
    assert changes_for_units(suite, 24) == {"spread.units": "24", "scenes.0.seeds": "12"}
    with pytest.raises(SuiteError, match="this suite has none"):
        changes_for_units({}, 24)
