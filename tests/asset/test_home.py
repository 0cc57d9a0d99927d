"""Flats by seed: valid, furnished by use, equal for equal seeds, and different for others."""

import numpy as np
import pytest

from vobench.asset import home, place_check
from vobench.asset.daylight import LIGHTINGS
from vobench.scene.light import AreaLight, Sky

SEEDS = range(1, 25)
MORE_SEEDS = [pytest.param(seed, marks=pytest.mark.slow) for seed in SEEDS[8:]]


@pytest.mark.parametrize("seed", [*SEEDS[:8], *MORE_SEEDS])
def test_nothing_is_wrong_with_a_flat(seed: int) -> None:
    interior = home.furnished_flat(seed, LIGHTINGS[seed % 4])
    assert place_check.complaints(interior) == []


def test_a_seed_gives_the_same_bytes_each_time() -> None:
    first = home.furnished_flat(7, "evening").place()
    second = home.furnished_flat(7, "evening").place()
    assert [thing.name for thing in first.things] == [thing.name for thing in second.things]
    for one, other in zip(first.things, second.things, strict=True):
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
        assert one.mesh.visual.uv.tobytes() == other.mesh.visual.uv.tobytes()
    assert first.materials == second.materials


def test_the_lighting_changes_lights_alone() -> None:
    day = home.furnished_flat(5, "day")
    night = home.furnished_flat(5, "night")
    lamps = {light.name for each in (day, night) for light in each.lights if isinstance(light, AreaLight)}
    for name in {piece.name for piece in day.pieces} ^ {piece.name for piece in night.pieces}:
        assert name in lamps, "a lamp that is off is a piece"
    assert day.plan == night.plan


@pytest.mark.slow
def test_lamps_shine_at_night_and_mostly_not_by_day() -> None:
    shining = {}
    for lighting in ("day", "night"):
        lights = [light for seed in SEEDS for light in home.furnished_flat(seed, lighting).lights]
        shining[lighting] = sum(isinstance(light, AreaLight) for light in lights)
    assert shining["night"] > 3 * shining["day"]
    assert shining["night"] >= 4 * len(SEEDS)


def test_pictures_on_textures_are_few_so_that_they_are_shared() -> None:
    for seed in (1, 2, 3):
        materials = home.furnished_flat(seed, "day").place().materials.values()
        textures = {id(material.texture) for material in materials if material.texture is not None}
        assert len(textures) < 60


def test_a_flat_has_one_sky_with_a_panorama() -> None:
    (sky,) = (light for light in home.furnished_flat(3, "day").lights if isinstance(light, Sky))
    assert sky.panorama is not None


@pytest.mark.slow
def test_plans_and_colours_differ_between_seeds() -> None:
    floors = set()
    for seed in SEEDS:
        place = home.furnished_flat(seed, "day").place()
        floors.add(tuple(np.round([thing.mesh.area for thing in place.things if ".floor" in thing.name], 4)))
    assert len(floors) == len(SEEDS)
