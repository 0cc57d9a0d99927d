"""Designs that spread the scenarios or settings of a suite over units: places, drives, or drives in places."""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import ceil
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError, SuiteError
from vobench.setting import settings

UnitAxis = Literal["scene", "trajectory"]
KeptKey = Literal["rig", "camera", "trajectory", "props"]
UNIT_AXES: tuple[UnitAxis, ...] = ("scene", "trajectory")
SPREAD_STREAM = 2_917  # separates the draw of units from the other random streams of a seed
MOST_UNITS = 10_000


@settings()
class Spread:
    """A balanced design, in which each scenario runs in some of the places instead of all of them.

    A unit is one combination of the variants of the axes in `over`. By default it is a drive in a place.

    `over` names the axes whose variants are combined.
    `units` is the number of units in the design.
    `each` is the number of units in which each scenario runs, at all its severities.
    `pairs` maps a scene to the trajectories that it is combined with, such as {street: [car], flat: [walk]}. Scenes and
    trajectories are named as in the suite, without seeds. A scene that is not listed is combined with all trajectories.
    `own_place` names scenarios that stay in their own place, although they suit any: their difficulty depends on it.
    `places` maps a scenario to the scenes that it is spread over, such as {rain: [street, park]}. Scenarios of the
    weather, or with a lighting of their own, are spread only if they are listed here.
    `keep` maps a scenario to what it keeps of its own, such as {spin_in_place: [trajectory, camera]}, where the suite's
    replaces that of other scenarios. A trajectory that is kept starts where the place is free, and the scenario runs
    only in places where there is such a start. `props` are boards and movers, which stay where they are relative to
    that trajectory.

    In a suite without scenarios, the combinations of the other axes are spread instead. All estimators run in the same
    units.
    """

    over: Annotated[tuple[UnitAxis, ...], MinLen(1)] = UNIT_AXES
    units: Annotated[int, Ge(1), Le(MOST_UNITS)]
    each: Annotated[int, Ge(1), Le(MOST_UNITS)] = 3
    pairs: dict[str, tuple[str, ...]] | None = None
    own_place: tuple[str, ...] = ()
    places: dict[str, tuple[str, ...]] | None = None
    keep: dict[str, tuple[KeptKey, ...]] | None = None

    def __post_init__(self) -> None:
        if self.places and "scene" not in self.over:
            raise SettingError(f"is for designs over scenes (over is {list(self.over)})", "places")
        if self.pairs and set(self.over) != set(UNIT_AXES):
            raise SettingError(f"are for designs over scene and trajectory (over is {list(self.over)})", "pairs")
        for scenario, kept in (self.keep or {}).items():
            if "props" in kept and "trajectory" not in kept:
                raise SettingError(f"should also keep the trajectory of {scenario}, which its props are around", "keep")
        if len(set(self.over)) != len(self.over):
            raise SettingError(f"should name each axis once (got {list(self.over)})", "over")


@dataclass(frozen=True, slots=True)
class Unit:
    """One variant of each axis of a design: for example a drive in a place."""

    by_axis: Mapping[str, str]

    @property
    def place(self) -> str:
        """The scene with its seed. In a design that is not over scenes, it is the drive."""
        if "scene" in self.by_axis:
            return self.by_axis["scene"]
        return self.by_axis["trajectory"]

    @property
    def kind(self) -> str:
        """The name of the place without its seed."""
        return kind_of(self.place)

    @property
    def name(self) -> str:
        """The variants in the order of the axes, as in the names of cases."""
        variants = [self.by_axis[axis] for axis in UNIT_AXES if axis in self.by_axis]
        return "-".join(variants)


def kind_of(place: str) -> str:
    """The name of a place without its seed, and without the lighting that may follow it."""
    return place.split(".", maxsplit=1)[0]


def units(spread: Spread, variants: Mapping[str, Collection[str]]) -> list[Unit]:
    """The units of a design over the variants of each axis.

    The design is balanced: the numbers of units of any two variants of an axis differ by at most 1. With `pairs`, this
    is guaranteed for scenes, and for trajectories among the scenes that are paired with the same trajectories. A design
    with fewer units than scenes has about the same share of the scenes of each kind.

    Raises SuiteError if the design has more units than there are combinations, or if `pairs` names an unknown scene or
    trajectory.
    """
    variants_by_axis: dict[str, list[str]] = {}
    for axis in UNIT_AXES:
        if axis in spread.over:
            variants_by_axis[axis] = list(variants[axis])
    paired_drives = _paired_drives(spread.pairs or {}, variants_by_axis)
    if spread.units < len(variants_by_axis.get("scene", ())):
        variants_by_axis["scene"] = _evenly_of_kinds(variants_by_axis["scene"], spread.units)

    combinations = _diagonals(variants_by_axis, paired_drives)
    if spread.units > len(combinations):
        raise SuiteError(_too_few_sentence(spread, variants_by_axis, len(combinations)))
    return [Unit(combination) for combination in combinations[: spread.units]]


def _evenly_of_kinds(scenes: Sequence[str], count: int) -> list[str]:
    """A number of scenes, in their order, with about the same share of those of each kind."""
    size_of_kind = Counter(kind_of(scene) for scene in scenes)
    seen_of_kind = Counter[str]()
    share_before = dict[str, float]()  # of the scenes of its kind, up to the middle of a scene
    for scene in scenes:
        kind = kind_of(scene)
        share_before[scene] = (seen_of_kind[kind] + 0.5) / size_of_kind[kind]
        seen_of_kind[kind] += 1
    chosen = set(sorted(scenes, key=lambda scene: share_before[scene])[:count])
    return [scene for scene in scenes if scene in chosen]


def _too_few_sentence(spread: Spread, variants: Mapping[str, Collection[str]], available: int) -> str:
    """The message for a design with more units than are available."""
    if spread.pairs:
        reason = "that the pairs of spread allow; raise the seeds of a scene or a trajectory, or ask for fewer"
    else:
        counts = " × ".join(f"{len(names)} ({axis})" for axis, names in variants.items())
        reason = f"that there are, {counts}; raise the seeds of a scene or a trajectory, or ask for fewer"
    return f"{spread.units} units are more than the {available} {reason}"


def _paired_drives(pairs: Mapping[str, Collection[str]], variants: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """The trajectories that each scene in `pairs` is combined with. Scenes and trajectories have their seeds.

    Raises SuiteError if `pairs` names an unknown scene or trajectory.
    """
    drives_of_scene = dict[str, list[str]]()
    for scene_name, trajectory_names in pairs.items():
        scenes = _variants_of_entry(scene_name, "scene", variants)
        drives = list[str]()
        for trajectory_name in trajectory_names:
            drives += _variants_of_entry(trajectory_name, "trajectory", variants)
        if not drives:
            raise SuiteError(f"spread.pairs.{scene_name} should name trajectories of the suite (got none)")
        for scene in scenes:
            drives_of_scene[scene] = drives
    return drives_of_scene


def _variants_of_entry(name: str, axis: str, variants: Mapping[str, Sequence[str]]) -> list[str]:
    """The variants of an entry of the suite: those with its name alone, or with its name followed by a seed.

    Raises SuiteError if the suite has no such entry.
    """
    matching = [variant for variant in variants[axis] if variant == name or variant.startswith(f"{name}.")]
    if not matching:
        raise SuiteError(f"spread.pairs names the {axis} '{name}', which is not among {', '.join(variants[axis])}")
    return matching


def _diagonals(variants: Mapping[str, Sequence[str]], paired_drives: Mapping[str, list[str]]) -> list[dict[str, str]]:
    """All combinations of the variants, ordered so that the first N of them are balanced for every N.

    The order follows the diagonals of a table of scenes and trajectories. The first diagonal combines each scene with
    one trajectory, the second one combines each scene with its next trajectory, and so on.

    `paired_drives` has the trajectories of the scenes that are paired. All other scenes have all trajectories.
    """
    if len(variants) == 1:
        ((axis, names),) = variants.items()
        return [{axis: name} for name in names]

    drives_of_scene = dict[str, tuple[str, ...]]()
    for scene in variants["scene"]:
        drives_of_scene[scene] = tuple(paired_drives.get(scene, variants["trajectory"]))
    first_index = _first_drive_indices(drives_of_scene)
    diagonal_count = max(len(drives) for drives in drives_of_scene.values())

    combinations = []
    for diagonal, (scene, drives) in product(range(diagonal_count), drives_of_scene.items()):
        if diagonal < len(drives):
            index = (first_index[scene] + diagonal) % len(drives)
            combinations.append({"scene": scene, "trajectory": drives[index]})
    return combinations


def _first_drive_indices(drives_of_scene: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """The index of the trajectory that each scene is combined with first.

    Scenes that have the same list of trajectories start at consecutive indices, so that they start differently. An
    index may exceed the length of the list; it is to be taken modulo the length.
    """
    scene_count = Counter[tuple[str, ...]]()
    first_index = dict[str, int]()
    for scene, drives in drives_of_scene.items():
        first_index[scene] = scene_count[drives]
        scene_count[drives] += 1
    return first_index


@dataclass(slots=True)
class Dealer:
    """Assigns units to treatments, such as scenarios, one treatment after the other.

    Each treatment gets `each` different units. They are chosen one at a time. Candidates are compared by the following
    numbers in this order, and the candidate with the smallest numbers is chosen:

    1. the number of runs of the unit so far, plus the runs of the treatment in one unit if the treatment already has a
       unit in this kind of place,
    2. the number of units that the treatment already has in this kind of place,
    3. the number of units that the treatment already has in this place,
    4. the number of runs so far in this place plus the number of runs so far of this drive,
    5. the position in a random order, which depends on `seed`.

    `units` are the units of the design.
    `each` is the number of units that a treatment gets.
    `seed` is the seed of the random order.
    """

    units: Sequence[Unit]
    each: int
    seed: int
    _rng: np.random.Generator = field(init=False)
    _runs_by_unit: Counter[str] = field(init=False, default_factory=Counter)
    _runs_by_variant: Counter[tuple[str, str]] = field(init=False, default_factory=Counter)

    def __post_init__(self) -> None:
        if self.each > len(self.units):
            raise SuiteError(f"spread runs each scenario in {self.each} units, but there are {len(self.units)}")
        self._rng = np.random.default_rng([self.seed, SPREAD_STREAM])

    def deal(
        self,
        runs: int = 1,
        kinds: Collection[str] | None = None,
        fits: Callable[[Unit], bool] | None = None,
    ) -> list[Unit]:
        """The units of the next treatment. The treatment has `runs` runs in each of its units.

        `kinds` are the kinds of places in which its units are; by default, all.
        `fits` says whether the treatment can run in a unit; by default, it can run in all. It may be slow, so it is
        asked only about units that would be chosen.

        Raises SuiteError if there are fewer than `each` such units.
        """
        order = self._rng.permutation(len(self.units)).tolist()
        candidates = [self.units[index] for index in order]
        if kinds is not None:
            candidates = [unit for unit in candidates if unit.kind in kinds]
        if len(candidates) < self.each:
            listed = ", ".join(kinds or ())
            raise SuiteError(f"spread runs each scenario in {self.each} units, but {listed} has {len(candidates)}")
        available = len(candidates)
        chosen = list[Unit]()
        chosen_by_kind = Counter[str]()
        chosen_by_place = Counter[str]()

        def priority(unit: Unit) -> tuple[int, int, int, int]:
            """The first four numbers of a candidate. Candidates are in random order, so `min` breaks ties at random."""
            chosen_of_kind = chosen_by_kind[unit.kind]
            chosen_of_place = chosen_by_place[unit.place]
            penalty = runs if chosen_of_kind else 0
            penalised_runs = self._runs_by_unit[unit.name] + penalty
            return penalised_runs, chosen_of_kind, chosen_of_place, self._runs_of_variants(unit)

        while len(chosen) < self.each:
            if not candidates:
                raise SuiteError(_misfit_sentence(len(chosen), available, self.each))
            unit = min(candidates, key=priority)
            candidates.remove(unit)
            if fits is not None and not fits(unit):
                continue
            chosen.append(unit)
            chosen_by_kind[unit.kind] += 1
            chosen_by_place[unit.place] += 1
            self._runs_by_unit[unit.name] += runs
            for variant in unit.by_axis.items():
                self._runs_by_variant[variant] += runs
        return sorted(chosen, key=self.units.index)

    def _runs_of_variants(self, unit: Unit) -> int:
        """The number of runs so far in the place of a unit plus the number of runs so far of its drive."""
        return sum(self._runs_by_variant[variant] for variant in unit.by_axis.items())


def _misfit_sentence(fitting: int, available: int, each: int) -> str:
    """The message for a scenario that fits into fewer units than it should run in."""
    return (
        f"spread runs each scenario in {each} units, but the path that it keeps has a free start in only {fitting} of "
        f"{available}; raise the seeds of the scenes, name larger ones in places, or add it to own_place"
    )


def changes_for_units(suite: Mapping[str, Any], count: int) -> dict[str, str]:
    """The changes of a suite after which its design has `count` units.

    `suite` is the content of the YAML file. The keys of the result are paths in it, such as "spread.units". The numbers
    of seeds of scenes are multiplied so that there are enough places. If the design is not over scenes, the numbers of
    seeds of trajectories are multiplied instead.

    Raises SuiteError if the suite has no design.
    """
    spread = suite.get("spread")
    if not isinstance(spread, Mapping) or not isinstance(spread.get("units"), int):
        raise SuiteError("--units is for suites with `spread`, and this suite has none")
    over = spread.get("over") or UNIT_AXES
    units_change = {"spread.units": str(count)}
    least_factor = ceil(count / spread["units"])
    trajectories = suite.get("trajectories") or {}
    if "scene" not in over:
        return units_change | _more_seeds("trajectories", trajectories, least_factor, count)

    scenes = dict(enumerate(suite.get("scenes") or ()))
    drive_count = 1
    if "trajectory" in over:
        variant_counts = [_variant_count(entry) for entry in trajectories.values()]
        drive_count = max(sum(variant_counts), 1)
    needed_places = ceil(count / drive_count)
    return units_change | _more_seeds("scenes", scenes, least_factor, needed_places)


def _more_seeds(key: str, entries: Mapping[Any, Any], least_factor: int, needed: int) -> dict[str, str]:
    """The changes that multiply the numbers of seeds of the entries at `key` by one factor.

    The factor is at least `least_factor`, and large enough for `needed` variants in total. Entries without seeds have
    one variant each, and do not change.
    """
    seeds_of = {name: entry["seeds"] for name, entry in entries.items() if _has_seeds(entry)}
    if not seeds_of:
        return {}
    entries_without_seeds = len(entries) - len(seeds_of)
    factor_for_needed = ceil((needed - entries_without_seeds) / sum(seeds_of.values()))
    factor = max(least_factor, factor_for_needed)
    if factor <= 1:
        return {}
    return {f"{key}.{name}.seeds": str(seeds * factor) for name, seeds in seeds_of.items()}


def _has_seeds(entry: Any) -> bool:
    """Whether an entry of a suite has several variants, by seed."""
    return isinstance(entry, Mapping) and isinstance(entry.get("seeds"), int)


def _variant_count(entry: Any) -> int:
    """The number of variants of an entry: its number of seeds, or 1 if it has none."""
    return entry["seeds"] if _has_seeds(entry) else 1
