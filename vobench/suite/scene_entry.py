"""The entries of a suite's `scenes`: a scene as its file describes it, or places that its generator creates."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le, MinLen

from vobench.errors import SettingError, SuiteError
from vobench.setting import OneOf, ShortForm, settings
from vobench.suite.scene_spec import LIGHTINGS, GeneratedSpec, SceneFile, Seed

DRAWN = "drawn"
MOST_PLACES = 10_000
LIGHTING_STREAM = 4_409  # separates the draw of lightings from the other random streams of a seed


@settings()
class SceneEntry:
    """A scene of a suite, by its name or path. With a seed, it is the place that the scene's generator creates.

    `seed` names one place, and `seeds` is the number of places, whose seeds are 1, 2, 3 and so on, plus the base seed
    of the suite. `lighting` is that of the places. By default it is drawn: of the places 4k + 1 to 4k + 4, each has
    another one.
    """

    name: Annotated[str, MinLen(1)]
    seed: Seed | None = None
    seeds: Annotated[int, Ge(1), Le(MOST_PLACES)] | None = None
    lighting: Annotated[str, OneOf("lighting", (*LIGHTINGS, DRAWN))] = DRAWN

    def __post_init__(self) -> None:
        if self.seed is not None and self.seeds is not None:
            raise SettingError("is the number of places, and seed names one; remove one of them", "seeds")
        if self.lighting != DRAWN and not self.has_seeds:
            raise SettingError("is for the places of a generator; add a seed, or use lightings", "lighting")

    @property
    def has_seeds(self) -> bool:
        """Whether the entry stands for places of a generator."""
        return self.seed is not None or self.seeds is not None

    def place_seeds(self, base_seed: int = 0) -> range:
        """The seeds of the places; empty for a scene as its file describes it."""
        if self.seed is not None:
            return range(self.seed, self.seed + 1)
        return range(base_seed + 1, base_seed + 1 + (self.seeds or 0))


def _named(value: Any) -> Any:
    return {"name": value} if isinstance(value, str) else value


NamedScene = Annotated[SceneEntry, ShortForm(_named, {"type": "string"})]


@dataclass(frozen=True, slots=True)
class Place:
    """A scene of a suite: its name on the axis, and its spec."""

    name: str
    scene: SceneFile


def drawn_lighting(seed: int) -> str:
    """The lighting of a seed. Any four seeds 4k + 1 to 4k + 4 have the four lightings, in an order drawn for k."""
    block, position = divmod(seed + len(LIGHTINGS) - 1, len(LIGHTINGS))
    order = np.random.default_rng([block, LIGHTING_STREAM]).permutation(len(LIGHTINGS))
    return LIGHTINGS[int(order[position])]


def generated_scene(scene: SceneFile, seed: int, lighting: str = DRAWN) -> SceneFile:
    """The place that the generator of a scene creates for a seed.

    Of what the file describes, only the name, the summary and the scale remain. Raises SuiteError if the scene has no
    generator.
    """
    if scene.generator is None:
        raise SuiteError(f"'{scene.name}' has no generator, so it has no seeds; leave seed and seeds out")
    chosen = drawn_lighting(seed) if lighting == DRAWN else lighting
    return SceneFile(
        name=scene.name,
        summary=scene.summary,
        scale=scene.scale,
        generator=scene.generator,
        generated=GeneratedSpec(seed=seed, lighting=chosen),
    )


def described_scene(scene: SceneFile) -> SceneFile:
    """The scene as its file describes it, without its generator. Raises SuiteError if the file only names that."""
    if scene.generated:
        return scene
    if not scene.is_described:
        raise SuiteError(f"'{scene.name}' has only a generator; give it a seed, as in {{name: {scene.name}, seed: 1}}")
    return replace(scene, generator=None)


def places(entry: SceneEntry, name: str, scene: SceneFile, *, base_seed: int = 0) -> Iterator[Place]:
    """The places of an entry. `name` is the name of the scene in the catalog, and `scene` what its file describes.

    Raises SuiteError if the scene cannot be had without, or with, a seed.
    """
    if not entry.has_seeds:
        yield Place(name, described_scene(scene))
        return
    suffix = "" if entry.lighting == DRAWN else f".{entry.lighting}"
    for seed in entry.place_seeds(base_seed):
        yield Place(f"{name}.{seed}{suffix}", generated_scene(scene, seed, entry.lighting))
