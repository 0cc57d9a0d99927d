"""Looks for places in which the path of a recording fits: a named one, and those that generators create by seed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vobench.analysis.path_placement import Placement, WantedDisparities, place_path
from vobench.analysis.recorded_place import recorded_scene
from vobench.errors import InputError, SuiteError
from vobench.estimator.stereo import StereoPair
from vobench.geometry.se3 import Array
from vobench.runner.store import SILENT, Progress
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_place
from vobench.suite.scene_spec import SceneFile

GENERATORS = ("street", "park", "office", "flat", "warehouse", "room")
SEEDS = range(1, 5)  # of places that are tried of the generator of the named place
OTHER_SEEDS = range(1, 3)  # of those that are tried of each other generator
LIGHTING = "day"


@dataclass(frozen=True, slots=True)
class PlacedPath:
    """A placement of a path in a place: the name of its scene, and the seed if its generator creates the place.

    `model` is the file of a place that was rebuilt from the recording, and empty for others. `vignetting` is that of
    the recording's camera, which is known for such a place.
    """

    place: str
    seed: int | None
    placement: Placement
    model: str = ""
    vignetting: float = 0.0

    @property
    def title(self) -> str:
        """The place in words."""
        if self.model:
            return "the recorded place"
        return self.place if self.seed is None else f"{self.place} {self.seed}"

    def scene(self) -> SceneFile:
        """The place at the scale of the placement."""
        if self.model:
            return recorded_scene(Path(self.model))
        spec = read_twin_place(self.place, self.seed)
        return replace(spec, scale=spec.scale * self.placement.scale)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        own = {"place": self.place, "seed": self.seed, "model": self.model, "vignetting": self.vignetting}
        return {**own, **self.placement.as_dict()}

    @classmethod
    def of_dict(cls, facts: Mapping[str, Any]) -> "PlacedPath":
        """What `as_dict` described."""
        own_keys = ("place", "seed", "model", "vignetting")
        of_placement = {key: value for key, value in facts.items() if key not in own_keys}
        own = {key: facts[key] for key in own_keys}
        return cls(**own, placement=Placement.of_dict(of_placement))


def read_twin_place(place: str, seed: int | None) -> SceneFile:
    """A place as its file describes it or, with a seed, as its generator creates it by daylight."""
    if seed is None:
        return read_place(place)
    return read_place(place, seed=seed, lighting=LIGHTING)


def find_places(
    place: str,
    T_world_left: Array,
    pair: StereoPair,
    wanted: WantedDisparities,
    *,
    most: int,
    progress: Progress = SILENT,
) -> list[PlacedPath]:
    """Placements of a path (N, 4, 4) in different places, at most so many: first in the named place.

    Then come the places of its generator by seed and, if nothing has fitted so far, those of another generator.
    Raises InputError with the reason of each place if the path fits nowhere.
    """
    found = list[PlacedPath]()
    reasons = []
    for name, seed in _tried_places(place):
        is_of_other_generator = bool(found) and name != found[-1].place
        if len(found) == most or is_of_other_generator:
            break
        title = name if seed is None else f"{name} {seed}"
        with progress.step(f"looking for a free path in {title}"):
            scene = build(read_twin_place(name, seed), {})
            try:
                (placement,) = place_path(scene, T_world_left, pair, wanted)
            except InputError as error:
                reasons.append(f"{title}: {error}")
                continue
        found.append(PlacedPath(name, seed, placement))
    if not found:
        raise InputError("the path fits in no place at its own scale: " + "; ".join(reasons))
    return found


def _tried_places(place: str) -> Iterator[tuple[str, int | None]]:
    """The names and seeds of the places that are tried, in their order."""
    yield place, None
    if _has_generator(place):
        for seed in SEEDS:
            yield place, seed
    for name in GENERATORS:
        if name != place:
            for seed in OTHER_SEEDS:
                yield name, seed


def _has_generator(place: str) -> bool:
    """Whether a scene has a generator."""
    try:
        read_twin_place(place, SEEDS[0])
    except SuiteError:
        return False
    return True
