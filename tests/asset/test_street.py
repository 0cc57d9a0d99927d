"""Streets by seed: valid, equal for equal seeds, different for others; the lighting changes lights alone."""

import numpy as np
import pytest

from vobench.asset import site_check, street
from vobench.asset.daylight import LIGHTINGS
from vobench.asset.site import Site
from vobench.scene.light import AreaLight, Sky

SEEDS = (3, 4)
MANY_SEEDS = range(1, 7)


@pytest.fixture(scope="module")
def streets() -> dict[int, Site]:
    return {seed: street.generated_street(seed, LIGHTINGS[seed % 4]) for seed in SEEDS}


@pytest.fixture(scope="module")
def street_at_night() -> Site:
    return street.generated_street(4, "night")


@pytest.mark.slow
@pytest.mark.parametrize("seed", MANY_SEEDS)
def test_nothing_is_wrong_with_streets(seed: int) -> None:
    assert site_check.complaints(street.generated_street(seed, LIGHTINGS[seed % 4])) == []


def test_a_seed_gives_the_same_bytes_each_time(streets: dict[int, Site]) -> None:
    first = streets[3].place()
    second = street.generated_street(3, LIGHTINGS[3]).place()
    assert [thing.name for thing in first.things] == [thing.name for thing in second.things]
    for one, other in zip(first.things, second.things, strict=True):
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
        assert one.mesh.visual.uv.tobytes() == other.mesh.visual.uv.tobytes()
    assert first.materials == second.materials


def test_the_lighting_changes_lights_alone(streets: dict[int, Site], street_at_night: Site) -> None:
    day = streets[4]
    assert LIGHTINGS[0] == "day"
    night = street_at_night
    assert [piece.name for piece in day.pieces] == [piece.name for piece in night.pieces]
    for one, other in zip(day.place().things, night.place().things, strict=True):
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
    names = {light.name for light in night.lights if isinstance(light, AreaLight)}
    assert {"street_lamps", "windows"} <= names
    assert not any(isinstance(light, AreaLight) for light in day.lights)


def test_another_seed_has_other_corners(streets: dict[int, Site]) -> None:
    corners = [np.concatenate([area.corners_m for area in site.roads]).tobytes() for site in streets.values()]
    assert len(set(corners)) == len(SEEDS)


def test_what_is_behind_the_last_house_is_a_panorama_beyond_the_street(streets: dict[int, Site]) -> None:
    for site in streets.values():
        (sky,) = (light for light in site.lights if isinstance(light, Sky))
        assert sky.panorama is not None
        corners_m = np.concatenate([area.corners_m for area in site.roads])
        assert np.linalg.norm(corners_m, axis=1).max() < street.PANORAMA_M[0]


def test_every_lamp_that_shines_hangs_over_the_foot_of_a_mast(street_at_night: Site) -> None:
    site = street_at_night
    (lamps,) = (light for light in site.lights if light.name == "street_lamps")
    masts = [piece for piece in site.pieces if piece.name.startswith("lamp_")]
    heads_m = lamps.mesh.triangles.reshape(len(masts), -1, 3).mean(axis=1)
    for mast, head_m in zip(masts, heads_m, strict=True):
        vertices_m = np.concatenate([part.arrays.vertices_m for part in mast.parts])
        foot_m = vertices_m[vertices_m[:, 2].argmin(), :2]
        assert np.linalg.norm(head_m[:2] - foot_m) < street.LAMP_REACH_M + 0.2
