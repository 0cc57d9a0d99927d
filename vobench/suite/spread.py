"""Designs that spread the scenarios or settings of a suite over units: places, drives, or drives in places."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
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
    """A balanced design in place of crossing everything.

    A unit is a combination of the variants of the axes `over`: by default a drive in a place. Every scenario, at all
    its severities, runs in `each` of the units; a suite without scenarios spreads each combination of its other axes.
    All estimators run in the same units.

    `pairs` names, for some of the scenes, the trajectories that belong there, such as {street: [car], flat: [walk]};
    both as in the suite, without seeds. All trajectories belong to the other scenes.
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
    """The variant on each axis of a design: for example a drive in a place."""

    by_axis: Mapping[str, str]

    @property
    def place(self) -> str:
        """What units have in common that are in one place: their scene, or else the drive."""
        return self.by_axis.get("scene", "") or self.by_axis["trajectory"]

    @property
    def kind(self) -> str:
        """What places have in common that differ by their seed: the name before the seed."""
        return self.place.split(".")[0]

    @property
    def name(self) -> str:
        """The variants in the order of the axes, as in the names of cases."""
        return "-".join(self.by_axis[axis] for axis in UNIT_AXES if axis in self.by_axis)


def units(spread: Spread, variants: Mapping[str, Collection[str]]) -> list[Unit]:
    """The units of a design over the variants of each axis. Each variant is in as many units as any other, or one less.

    With `pairs`, this holds for the scenes, and for the trajectories among scenes that have the same ones.

    Raises SuiteError for more units than there are, and for pairs of unknown scenes or trajectories.
    """
    by_axis: dict[str, list[str]] = {axis: list(variants[axis]) for axis in UNIT_AXES if axis in spread.over}
    combinations = _diagonals(by_axis, _paired(spread.pairs or {}, by_axis))
    if spread.units > len(combinations) and spread.pairs:
        raise SuiteError(
            f"{spread.units} units are more than the {len(combinations)} that the pairs of spread allow; raise the "
            "seeds of a scene or a trajectory, or ask for fewer"
        )
    if spread.units > len(combinations):
        counts = " × ".join(f"{len(variants[axis])} ({axis})" for axis in UNIT_AXES if axis in spread.over)
        raise SuiteError(
            f"{spread.units} units are more than the {len(combinations)} that there are, {counts}; "
            "raise the seeds of a scene or a trajectory, or ask for fewer"
        )
    return [Unit(combination) for combination in combinations[: spread.units]]


def _paired(pairs: Mapping[str, Collection[str]], variants: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """The variants of trajectories that belong to each variant of a scene with pairs.

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
    found = [variant for variant in variants[axis] if variant == name or variant.startswith(f"{name}.")]
    if not found:
        raise SuiteError(f"spread.pairs names the {axis} '{name}', which is not among {', '.join(variants[axis])}")
    return found


def _diagonals(variants: Mapping[str, Sequence[str]], allowed: Mapping[str, list[str]]) -> list[dict[str, str]]:
    """All combinations, along diagonals, so that variants of an axis occur about equally often in the first.

    `allowed` are the trajectories of some of the scenes. The other scenes have all of them.
    """
    if len(variants) == 1:
        ((axis, names),) = variants.items()
        return [{axis: name} for name in names]
    drives_of = {scene: tuple(allowed.get(scene, variants["trajectory"])) for scene in variants["scene"]}
    # Scenes with the same trajectories take turns among these.
    turns = Counter[tuple[str, ...]]()
    first = dict[str, int]()
    for scene, drives in drives_of.items():
        first[scene] = turns[drives]
        turns[drives] += 1
    combinations = []
    most = max(len(drives) for drives in drives_of.values())
    for shift, (scene, drives) in product(range(most), drives_of.items()):
        if shift < len(drives):
            combinations.append({"scene": scene, "trajectory": drives[(first[scene] + shift) % len(drives)]})
    return combinations


@dataclass(slots=True)
class Dealer:
    """Deals units to treatments one after the other, such as scenarios, so that units have about equally many.

    A treatment gets different units, if possible in different kinds of places: a kind that it already has counts as
    one more treatment of all units there. Among units that have equally many treatments, those of the places and drives
    that have the fewest come first; the rest is drawn by the seed.
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
        chosen = list[Unit]()
        places = Counter[str]()
        kinds = Counter[str]()
        order = self._rng.permutation(len(self.units)).tolist()
        candidates = [self.units[index] for index in order]

        def rank(unit: Unit) -> tuple[int, ...]:
            """The candidate with the lowest rank is next."""
            runs_of_kind = runs if kinds[unit.kind] else 0
            return self._dealt[unit.name] + runs_of_kind, kinds[unit.kind], places[unit.place], self._load(unit)

        for _ in range(self.each):
            unit = min(candidates, key=rank)
            candidates.remove(unit)
            chosen.append(unit)
            places[unit.place] += 1
            kinds[unit.kind] += 1
            self._dealt[unit.name] += runs
            for variant in unit.by_axis.items():
                self._dealt_by_variant[variant] += runs
        return sorted(chosen, key=self.units.index)

    def _load(self, unit: Unit) -> int:
        """The number of runs that have been dealt to the place of a unit, plus that to its drive."""
        return sum(self._dealt_by_variant[variant] for variant in unit.by_axis.items())


def changes_for_units(suite: Mapping[str, Any], count: int) -> dict[str, str]:
    """The changes of a suite, as plain YAML, that give its design a number of units.

    The number of seeds is multiplied, of its places or, if the design is not over scenes, of its drives.

    Raises SuiteError if the suite has no design.
    """
    spread = suite.get("spread")
    if not isinstance(spread, Mapping) or not isinstance(spread.get("units"), int):
        raise SuiteError("--units is for suites with `spread`, and this suite has none")
    over = spread.get("over") or UNIT_AXES
    scenes = dict(enumerate(suite.get("scenes") or ()))
    trajectories = suite.get("trajectories") or {}

    changes = {"spread.units": str(count)}
    least_factor = -(-count // spread["units"])
    if "scene" in over:
        drives = sum(map(_seeds_or_one, trajectories.values())) if "trajectory" in over else 1
        return changes | _more_seeds("scenes", scenes, least_factor, -(-count // max(drives, 1)))
    return changes | _more_seeds("trajectories", trajectories, least_factor, count)


def _more_seeds(key: str, entries: Mapping[Any, Any], least_factor: int, needed: int) -> dict[str, str]:
    """The changes of entries of a suite that multiply their seeds by a factor, so that there are enough variants."""
    seeded = {name: entry["seeds"] for name, entry in entries.items() if _has_seeds(entry)}
    others = len(entries) - len(seeded)
    if not seeded:
        return {}
    factor = max(least_factor, -(-(needed - others) // sum(seeded.values())))
    if factor <= 1:
        return {}
    return {f"{key}.{name}.seeds": str(seeds * factor) for name, seeds in seeded.items()}


def _has_seeds(entry: Any) -> bool:
    return isinstance(entry, Mapping) and isinstance(entry.get("seeds"), int)


def _seeds_or_one(entry: Any) -> int:
    """The number of variants of an entry."""
    return entry["seeds"] if _has_seeds(entry) else 1
