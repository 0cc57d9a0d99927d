"""Designs that spread the scenarios or settings of a suite over units: places, drives, or drives in places."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import ceil
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError, SuiteError
from vobench.setting import settings

UnitAxis = Literal["scene", "trajectory"]
UNIT_AXES: tuple[UnitAxis, ...] = ("scene", "trajectory")
SPREAD_STREAM = 2_917  # separates the draw of units from the other random streams of a seed
MOST_UNITS = 10_000


@settings()
class Spread:
    """A balanced design, in which scenarios do not run in all places but in some of them.

    A unit is a combination of the variants of the axes `over`: by default a drive in a place. The design has `units`
    of them, and each scenario runs in `each` of these, at all its severities. In a suite without scenarios, the
    combinations of the other axes are spread instead. All estimators run in the same units.

    `pairs` maps a scene to the trajectories that belong there, such as {street: [car], flat: [walk]}. Both are named as
    in the suite, without seeds. Every trajectory belongs to the scenes that are not listed.
    """

    over: Annotated[tuple[UnitAxis, ...], MinLen(1)] = UNIT_AXES
    units: Annotated[int, Ge(1), Le(MOST_UNITS)]
    each: Annotated[int, Ge(1), Le(MOST_UNITS)] = 3
    pairs: dict[str, tuple[str, ...]] | None = None

    def __post_init__(self) -> None:
        if self.pairs and set(self.over) != set(UNIT_AXES):
            raise SettingError(f"are for designs over scene and trajectory (over is {list(self.over)})", "pairs")
        if len(set(self.over)) != len(self.over):
            raise SettingError(f"should name each axis once (got {list(self.over)})", "over")


@dataclass(frozen=True, slots=True)
class Unit:
    """One variant of each axis of a design: for example a drive in a place."""

    by_axis: Mapping[str, str]

    @property
    def place(self) -> str:
        """The scene with its seed; the drive in a design that is not over scenes."""
        return self.by_axis.get("scene", "") or self.by_axis["trajectory"]

    @property
    def kind(self) -> str:
        """The name of the place without its seed."""
        return self.place.split(".")[0]

    @property
    def name(self) -> str:
        """The variants in the order of the axes, as in the names of cases."""
        return "-".join(self.by_axis[axis] for axis in UNIT_AXES if axis in self.by_axis)


def units(spread: Spread, variants: Mapping[str, Collection[str]]) -> list[Unit]:
    """The units of a design over the variants of each axis.

    The design is balanced: the numbers of units of two variants of an axis differ by at most 1. With `pairs`, this
    holds for the scenes, and for the trajectories of scenes that have the same ones.

    Raises SuiteError for more units than there are, and for pairs of unknown scenes or trajectories.
    """
    by_axis: dict[str, list[str]] = {axis: list(variants[axis]) for axis in UNIT_AXES if axis in spread.over}
    combinations = _diagonals(by_axis, _paired(spread.pairs or {}, by_axis))
    if spread.units > len(combinations):
        raise SuiteError(_too_few_sentence(spread, by_axis, len(combinations)))
    return [Unit(combination) for combination in combinations[: spread.units]]


def _too_few_sentence(spread: Spread, variants: Mapping[str, Collection[str]], available: int) -> str:
    """The message for a design with more units than are available."""
    if spread.pairs:
        reason = "that the pairs of spread allow; raise the seeds of a scene or a trajectory, or ask for fewer"
    else:
        counts = " × ".join(f"{len(names)} ({axis})" for axis, names in variants.items())
        reason = f"that there are, {counts}; raise the seeds of a scene or a trajectory, or ask for fewer"
    return f"{spread.units} units are more than the {available} {reason}"


def _paired(pairs: Mapping[str, Collection[str]], variants: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """The trajectories that belong to each scene with pairs, both with their seeds.

    Raises SuiteError for pairs of unknown scenes or trajectories.
    """
    allowed = dict[str, list[str]]()
    for scene, names in pairs.items():
        scenes = _of_entry(scene, "scene", variants)
        drives = [drive for name in names for drive in _of_entry(name, "trajectory", variants)]
        if not drives:
            raise SuiteError(f"spread.pairs.{scene} should name trajectories of the suite (got none)")
        allowed.update(dict.fromkeys(scenes, drives))
    return allowed


def _of_entry(name: str, axis: str, variants: Mapping[str, Sequence[str]]) -> list[str]:
    """The variants of an entry of the suite: those with its name, or with its name before a seed."""
    matching = [variant for variant in variants[axis] if variant == name or variant.startswith(f"{name}.")]
    if not matching:
        raise SuiteError(f"spread.pairs names the {axis} '{name}', which is not among {', '.join(variants[axis])}")
    return matching


def _diagonals(variants: Mapping[str, Sequence[str]], allowed: Mapping[str, list[str]]) -> list[dict[str, str]]:
    """All combinations of the variants, in an order in which any number of the first ones is balanced.

    In a table of scenes and trajectories, they are the diagonals: first each scene with a trajectory, then each scene
    with the next trajectory, and so on. `allowed` are the trajectories of some of the scenes; the others have all.
    """
    if len(variants) == 1:
        ((axis, names),) = variants.items()
        return [{axis: name} for name in names]
    drives_of = {scene: tuple(allowed.get(scene, variants["trajectory"])) for scene in variants["scene"]}
    starts = _first_drives(drives_of)
    combinations = []
    most_drives = max(len(drives) for drives in drives_of.values())
    for diagonal, (scene, drives) in product(range(most_drives), drives_of.items()):
        if diagonal < len(drives):
            index = (starts[scene] + diagonal) % len(drives)
            combinations.append({"scene": scene, "trajectory": drives[index]})
    return combinations


def _first_drives(drives_of: Mapping[str, tuple[str, ...]]) -> dict[str, int]:
    """The number of the trajectory with which each scene begins, different ones for scenes with the same ones."""
    scene_count = Counter[tuple[str, ...]]()
    starts = dict[str, int]()
    for scene, drives in drives_of.items():
        starts[scene] = scene_count[drives]
        scene_count[drives] += 1
    return starts


@dataclass(slots=True)
class Dealer:
    """Assigns units to treatments, such as scenarios, one treatment after the other.

    Each treatment gets `each` different units, one by one. The next one is that with the fewest runs so far, where a
    unit in a kind of place that the treatment already has counts as if it had the runs of one more treatment. Ties are
    decided by the treatment's own units in that kind of place and in that place, then by the runs of the place and of
    the drive, and last by the seed.
    """

    units: Sequence[Unit]
    each: int
    seed: int
    _rng: np.random.Generator = field(init=False)
    _dealt: Counter[str] = field(init=False, default_factory=Counter)
    _dealt_by_variant: Counter[tuple[str, str]] = field(init=False, default_factory=Counter)

    def __post_init__(self) -> None:
        if self.each > len(self.units):
            raise SuiteError(f"spread runs each scenario in {self.each} units, but there are {len(self.units)}")
        self._rng = np.random.default_rng([self.seed, SPREAD_STREAM])

    def deal(self, runs: int = 1) -> list[Unit]:
        """The units of the next treatment, which has a number of runs in each of them."""
        order = self._rng.permutation(len(self.units)).tolist()
        candidates = [self.units[index] for index in order]
        chosen = list[Unit]()
        chosen_by_kind = Counter[str]()
        chosen_by_place = Counter[str]()

        def rank(unit: Unit) -> tuple[int, ...]:
            """The candidate with the lowest rank is next."""
            of_kind = chosen_by_kind[unit.kind]
            runs_of_kind = runs if of_kind else 0
            return self._dealt[unit.name] + runs_of_kind, of_kind, chosen_by_place[unit.place], self._load(unit)

        for _ in range(self.each):
            unit = min(candidates, key=rank)
            candidates.remove(unit)
            chosen.append(unit)
            chosen_by_kind[unit.kind] += 1
            chosen_by_place[unit.place] += 1
            self._dealt[unit.name] += runs
            for variant in unit.by_axis.items():
                self._dealt_by_variant[variant] += runs
        return sorted(chosen, key=self.units.index)

    def _load(self, unit: Unit) -> int:
        """The number of runs in the place of a unit so far, plus that of its drive."""
        return sum(self._dealt_by_variant[variant] for variant in unit.by_axis.items())


def changes_for_units(suite: Mapping[str, Any], count: int) -> dict[str, str]:
    """The changes of a suite, as plain YAML, that give its design a number of units.

    The numbers of seeds of its places are multiplied or, if the design is not over scenes, those of its drives.

    Raises SuiteError if the suite has no design.
    """
    spread = suite.get("spread")
    if not isinstance(spread, Mapping) or not isinstance(spread.get("units"), int):
        raise SuiteError("--units is for suites with `spread`, and this suite has none")
    over = spread.get("over") or UNIT_AXES
    changes = {"spread.units": str(count)}
    least_factor = ceil(count / spread["units"])
    trajectories = suite.get("trajectories") or {}
    if "scene" not in over:
        return changes | _more_seeds("trajectories", trajectories, least_factor, count)

    scenes = dict(enumerate(suite.get("scenes") or ()))
    drive_count = 1
    if "trajectory" in over:
        drive_count = max(sum(_seeds_or_one(entry) for entry in trajectories.values()), 1)
    needed_places = ceil(count / drive_count)
    return changes | _more_seeds("scenes", scenes, least_factor, needed_places)


def _more_seeds(key: str, entries: Mapping[Any, Any], least_factor: int, needed: int) -> dict[str, str]:
    """The changes of entries of a suite that multiply their seeds by one factor.

    The factor is at least `least_factor`, and so large that there are `needed` variants.
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


def _seeds_or_one(entry: Any) -> int:
    """The number of variants of an entry."""
    return entry["seeds"] if _has_seeds(entry) else 1
