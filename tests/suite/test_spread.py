"""Designs are balanced: over places, over drives and over units."""

from collections import Counter

import pytest

from vobench.errors import SettingError, SuiteError
from vobench.suite.scene_entry import drawn_lighting
from vobench.suite.scene_spec import LIGHTINGS
from vobench.suite.spread import Dealer, Spread, Unit, changes_for_units, units

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


TOUR = {"tour": {"kind": "wander", "seeds": 2}}


@pytest.mark.parametrize(
    ("suite", "count", "changes"),
    [
        ({"scenes": [{"name": "flat", "seeds": 6}, "room"], "trajectories": TOUR}, 24, {"scenes.0.seeds": "12"}),
        ({"scenes": [{"name": "flat", "seeds": 6}], "trajectories": TOUR}, 12, {}),
        ({"scenes": [{"name": "flat", "seeds": 6}], "trajectories": TOUR}, 6, {}),
        # Twice as many seeds and the room would be nine places.
        (
            {"scenes": [{"name": "flat", "seeds": 4}, "room"], "trajectories": {"tour": {}}},
            10,
            {"scenes.0.seeds": "12"},
        ),
        ({"over": ["trajectory"], "scenes": ["room"], "trajectories": TOUR}, 30, {"trajectories.tour.seeds": "30"}),
        ({"scenes": ["room"], "trajectories": {"tour": {}}}, 30, {}),
    ],
)
def test_more_units_take_more_seeds_of_places_or_drives(suite, count, changes) -> None:
    written = {"spread": {"units": 12, "over": suite.pop("over", ["scene", "trajectory"])}, **suite}
    assert changes_for_units(written, count) == {"spread.units": str(count), **changes}


def test_units_of_a_suite_without_a_design_are_refused() -> None:
    with pytest.raises(SuiteError, match="this suite has none"):
        changes_for_units({}, 24)


PAIRED = {
    "scene": ["flat.1", "flat.2", "street.1", "street.2", "street.3", "park"],
    "trajectory": ["tour.1", "tour.2", "walk", "car.1", "car.2"],
}


def test_paired_scenes_have_their_trajectories_alone_and_the_others_have_all() -> None:
    pairs = {"flat": ("tour", "walk"), "street": ("car",)}
    made = units(Spread(units=2 * 3 + 3 * 2 + 5, pairs=pairs), PAIRED)
    drives: dict[str, set[str]] = {}
    for unit in made:
        drives.setdefault(unit.by_axis["scene"], set()).add(unit.by_axis["trajectory"])
    assert len({unit.name for unit in made}) == len(made)
    for scene in ("flat.1", "flat.2"):
        assert drives[scene] == {"tour.1", "tour.2", "walk"}
    for scene in ("street.1", "street.2", "street.3"):
        assert drives[scene] == {"car.1", "car.2"}
    assert drives["park"] == set(PAIRED["trajectory"])


def test_the_first_paired_units_are_in_different_places_with_different_drives() -> None:
    pairs = {"flat": ("tour",), "street": ("car",), "park": ("walk",)}
    made = units(Spread(units=6, pairs=pairs), PAIRED)
    assert {unit.by_axis["scene"] for unit in made} == set(PAIRED["scene"])
    counts = Counter(unit.by_axis["trajectory"] for unit in made)
    assert counts == {"tour.1": 1, "tour.2": 1, "car.1": 2, "car.2": 1, "walk": 1}


@pytest.mark.parametrize("count", range(3, 12))
def test_fewer_units_than_scenes_have_all_kinds_in_proportion(count: int) -> None:
    scenes = [*(f"flat.{seed}" for seed in range(6)), *(f"park.{seed}" for seed in range(3)), "hall", "street.1"]
    pairs = {"park": ("walk",), "street": ("car",)}
    made = units(Spread(units=count, pairs=pairs), {"scene": scenes, "trajectory": ["tour", "walk", "car"]})
    assert len({unit.place for unit in made}) == count
    sizes = {"flat": 6, "park": 3, "hall": 1, "street": 1}
    for kind, size in sizes.items():
        of_kind = sum(unit.kind == kind for unit in made)
        assert abs(of_kind - count * size / len(scenes)) <= 1
    drives = Counter(unit.by_axis["trajectory"] for unit in made if unit.kind in ("flat", "hall"))
    assert max(drives.values()) - min(drives[name] for name in ("tour", "walk", "car")) <= 1


def test_pairs_that_name_all_trajectories_change_nothing() -> None:
    everything = {"flat": ("tour", "walk", "car"), "street": ("tour", "walk", "car")}
    assert units(Spread(units=30, pairs=everything), PAIRED) == units(Spread(units=30), PAIRED)


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        ({"flt": ("tour",)}, "spread.pairs names the scene 'flt', which is not among flat.1, flat.2, street.1"),
        ({"flat": ("tor",)}, "spread.pairs names the trajectory 'tor', which is not among tour.1, tour.2, walk"),
        ({"flat": ()}, "spread.pairs.flat should name trajectories of the suite"),
    ],
)
def test_pairs_of_what_is_not_in_the_suite_are_one_line_of_error(
    pairs: dict[str, tuple[str, ...]], message: str
) -> None:
    with pytest.raises(SuiteError, match=message):
        units(Spread(units=2, pairs=pairs), PAIRED)


def test_more_units_than_pairs_allow_is_an_error() -> None:
    with pytest.raises(SuiteError, match="20 units are more than the 19 that the pairs of spread allow"):
        units(Spread(units=20, pairs={"flat": ("walk",), "street": ("car", "tour")}), PAIRED)


def test_pairs_require_a_design_over_both_axes() -> None:
    with pytest.raises(SettingError, match="pairs"):
        Spread(units=2, over=("scene",), pairs={"flat": ("tour",)})


def test_a_treatment_gets_different_kinds_of_places_where_it_can_and_units_stay_balanced() -> None:
    scenes = ["park", "flat.1", "flat.2", "flat.3", "street.1", "street.2", "street.3"]
    made = units(Spread(units=7), {"scene": scenes, "trajectory": ["tour"]})
    dealer = Dealer(made, 3, seed=1)
    load = Counter[str]()
    for _ in range(20):
        dealt = dealer.deal(2)
        assert len({unit.kind for unit in dealt}) >= 2
        load.update(unit.name for unit in dealt)
    assert len(load) == 7
    assert max(load.values()) - min(load.values()) <= 2


def test_a_unit_of_another_kind_is_chosen_although_it_has_one_treatment_more() -> None:
    made = units(Spread(units=3), {"scene": ["flat.1", "flat.2", "park"], "trajectory": ["tour"]})
    dealer = Dealer(made, 2, seed=1)
    # After two treatments, the park has two and each flat has one.
    for _ in range(3):
        assert {unit.kind for unit in dealer.deal()} == {"flat", "park"}


@pytest.mark.parametrize("runs", [2, 5])
def test_who_gets_which_units_does_not_depend_on_how_many_runs_each_treatment_has(runs: int) -> None:
    scenes = ["park", "flat.1", "flat.2", "street.1", "street.2", "street.3"]
    made = units(Spread(units=9), {"scene": scenes, "trajectory": ["tour.1", "tour.2"]})
    of_one_run = Dealer(made, 3, seed=1)
    of_several = Dealer(made, 3, seed=1)
    for _ in range(12):
        assert of_several.deal(runs) == of_one_run.deal()


def test_where_all_places_are_of_one_kind_it_does_not_matter() -> None:
    of_one_kind = Dealer(units(Spread(units=12), VARIANTS), 3, seed=1).deal()
    assert len({unit.place for unit in of_one_kind}) == 3


# --- Treatments that do not fit everywhere ---


def in_small_flats(unit: Unit) -> bool:
    """Whether a unit is in one of the flats 1 to 4 of six."""
    return unit.place in {f"flat.{k}" for k in range(1, 5)}


def test_a_treatment_gets_only_units_that_it_fits_and_the_others_stay_balanced() -> None:
    dealer = Dealer(units(Spread(units=12), VARIANTS), 3, seed=1)
    load = Counter[str]()
    for number in range(20):
        is_picky = number % 4 == 0
        dealt = dealer.deal(fits=in_small_flats if is_picky else None)
        assert len({unit.place for unit in dealt}) == 3
        assert not is_picky or all(in_small_flats(unit) for unit in dealt)
        load.update(unit.name for unit in dealt)
    assert max(load.values()) - min(load.values()) <= 1


def test_a_treatment_that_fits_everywhere_gets_the_units_of_one_that_does_not_ask() -> None:
    made = units(Spread(units=12), VARIANTS)
    asking, other = Dealer(made, 3, seed=1), Dealer(made, 3, seed=1)
    for _ in range(8):
        assert asking.deal(fits=lambda _: True) == other.deal()


def test_whether_a_treatment_fits_is_asked_about_no_more_units_than_needed() -> None:
    asked = []

    def fits(unit: Unit) -> bool:
        asked.append(unit.name)
        return in_small_flats(unit)

    dealt = Dealer(units(Spread(units=12), VARIANTS), 3, seed=2).deal(fits=fits)
    assert len(asked) == len(set(asked))
    assert len(asked) <= 3 + 4  # of the 12 units, 4 are in flats 5 and 6
    assert asked[-1] in {unit.name for unit in dealt}


def test_too_few_units_that_a_treatment_fits_are_one_line_of_error() -> None:
    dealer = Dealer(units(Spread(units=12), VARIANTS), 3, seed=1)
    few = "runs each scenario in 3 units, but the path that it keeps has a free start in only 2 of 12; raise the seeds"
    with pytest.raises(SuiteError, match=few):
        dealer.deal(fits=lambda unit: unit.place == "flat.2")
