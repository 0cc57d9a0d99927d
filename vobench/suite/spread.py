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
    """

    over: Annotated[tuple[UnitAxis, ...], MinLen(1)] = UNIT_AXES
    units: Annotated[int, Ge(1), Le(MOST_UNITS)]
    each: Annotated[int, Ge(1), Le(MOST_UNITS)] = 3

    def __post_init__(self) -> None:
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
    def name(self) -> str:
        """The variants in the order of the axes, as in the names of cases."""
        return "-".join(self.by_axis[axis] for axis in UNIT_AXES if axis in self.by_axis)


def units(spread: Spread, variants: Mapping[str, Collection[str]]) -> list[Unit]:
    """The units of a design over the variants of each axis. Each variant is in as many units as any other, or one less.

    Raises SuiteError for more units than there are.
    """
    combinations = _diagonals({axis: list(variants[axis]) for axis in UNIT_AXES if axis in spread.over})
    if spread.units > len(combinations):
        counts = " × ".join(f"{len(variants[axis])} ({axis})" for axis in UNIT_AXES if axis in spread.over)
        raise SuiteError(
            f"{spread.units} units are more than the {len(combinations)} that there are, {counts}; "
            "raise the seeds of a scene or a trajectory, or ask for fewer"
        )
    return [Unit(combination) for combination in combinations[: spread.units]]


def _diagonals(variants: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """All combinations, along diagonals, so that variants of an axis occur about equally often in the first."""
    if len(variants) == 1:
        ((axis, names),) = variants.items()
        return [{axis: name} for name in names]
    scenes = variants["scene"]
    trajectories = variants["trajectory"]
    combinations = []
    for shift, number in product(range(len(trajectories)), range(len(scenes))):
        trajectory = trajectories[(number + shift) % len(trajectories)]
        combinations.append({"scene": scenes[number], "trajectory": trajectory})
    return combinations


@dataclass(slots=True)
class Dealer:
    """Deals units to treatments one after the other, such as scenarios, so that units have about equally many.

    A treatment gets different units, if possible in different places. Among units that have equally many treatments,
    those of the places and drives that have the fewest come first; the rest is drawn by the seed.
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
        order = self._rng.permutation(len(self.units)).tolist()
        for _ in range(self.each):
            candidates = [self.units[index] for index in order if self.units[index] not in chosen]
            unit = min(candidates, key=lambda unit: (self._dealt[unit.name], places[unit.place], self._load(unit)))
            chosen.append(unit)
            places[unit.place] += 1
            self._dealt[unit.name] += runs
            for variant in unit.by_axis.items():
                self._dealt_by_variant[variant] += runs
        return sorted(chosen, key=self.units.index)

    def _load(self, unit: Unit) -> int:
        """The number of runs that have been dealt to the place of a unit, plus that to its drive."""
        return sum(self._dealt_by_variant[variant] for variant in unit.by_axis.items())


def changes_for_units(suite: Mapping[str, Any], count: int) -> dict[str, str]:
    """The changes of a suite, as plain YAML, that give its design a number of units: more seeds of its places.

    Raises SuiteError if the suite has no design.
    """
    spread = suite.get("spread")
    if not isinstance(spread, Mapping) or not isinstance(spread.get("units"), int):
        raise SuiteError("--units is for suites with `spread`, and this suite has none")
    changes = {"spread.units": str(count)}
    factor = -(-count // spread["units"])
    for index, scene in enumerate(suite.get("scenes") or ()):
        if factor > 1 and isinstance(scene, Mapping) and isinstance(scene.get("seeds"), int):
            changes[f"scenes.{index}.seeds"] = str(scene["seeds"] * factor)
    return changes
