"""Parks by seed: valid, equal for equal seeds, different for others; the lighting is that of the outside alone."""

import numpy as np
import pytest

from vobench.asset import park, site_check
from vobench.asset.daylight import LIGHTINGS
from vobench.asset.park_plan import ParkPlan, park_plan
from vobench.asset.site import Site, footprint
from vobench.scene.light import AreaLight, Sky

SEEDS = (3, 4)
MANY_SEEDS = range(1, 9)


@pytest.fixture(scope="module")
def parks() -> dict[int, Site]:
    return {seed: park.generated_park(seed, LIGHTINGS[seed % 4]) for seed in SEEDS}


@pytest.fixture(scope="module")
def by_lighting() -> dict[str, Site]:
    """One park by day and by night."""
    return {lighting: park.generated_park(5, lighting) for lighting in ("day", "night")}


def plan_of(seed: int) -> ParkPlan:
    return park_plan(np.random.default_rng([seed, 0]))


@pytest.mark.slow
@pytest.mark.parametrize("seed", MANY_SEEDS)
def test_nothing_is_wrong_with_parks(seed: int) -> None:
    assert site_check.complaints(park.generated_park(seed, LIGHTINGS[seed % 4])) == []


def test_a_seed_gives_the_same_bytes_each_time(parks: dict[int, Site]) -> None:
    first = parks[3].place()
    second = park.generated_park(3, LIGHTINGS[3]).place()
    assert [thing.name for thing in first.things] == [thing.name for thing in second.things]
    for one, other in zip(first.things, second.things, strict=True):
        assert one.mesh.vertices.tobytes() == other.mesh.vertices.tobytes()
        assert one.mesh.visual.uv.tobytes() == other.mesh.visual.uv.tobytes()
    assert first.materials == second.materials


def test_lamps_shine_at_night_only_and_stand_there_by_day(by_lighting: dict[str, Site]) -> None:
    by_day = by_lighting["day"]
    by_night = by_lighting["night"]
    assert not [light for light in by_day.lights if isinstance(light, AreaLight)]
    (lamps,) = [light for light in by_night.lights if isinstance(light, AreaLight)]
    posts = [piece for piece in by_night.pieces if piece.name.startswith("lamp_")]
    assert lamps.power_lm == pytest.approx(park.LAMP_LM * len(posts))
    assert "globes" in [structure.name for structure in by_day.structures]
    assert "globes" not in [structure.name for structure in by_night.structures]
    sky_lx = [
        sum(light.illuminance_lx for light in site.lights if isinstance(light, Sky)) for site in (by_day, by_night)
    ]
    assert sky_lx[0] > 1000 * sky_lx[1]


def test_the_lighting_moves_nothing(by_lighting: dict[str, Site]) -> None:
    by_day = by_lighting["day"]
    by_night = by_lighting["night"]
    assert [piece.name for piece in by_day.pieces] == [piece.name for piece in by_night.pieces]
    for one, other in zip(by_day.pieces, by_night.pieces, strict=True):
        assert np.array_equal(one.parts[0].arrays.vertices_m, other.parts[0].arrays.vertices_m)


def test_nothing_but_people_stands_on_a_path_and_they_leave_its_middle_free(parks: dict[int, Site]) -> None:
    for seed, site in parks.items():
        for path in plan_of(seed).paths:
            for piece in site.pieces:
                corners_m = footprint(piece).corners_m
                to_path_m = np.linalg.norm(path.points_m[:, None] - corners_m, axis=2)
                overlap_m = (path.widths_m[:, None] / 2 - to_path_m).max()
                if piece.name.startswith("person"):
                    assert to_path_m.min() > park.BODY_RADIUS_M
                else:
                    assert overlap_m <= 0


def test_nothing_stands_in_deep_water(parks: dict[int, Site]) -> None:
    for seed, site in parks.items():
        ground = plan_of(seed).ground
        for piece in site.pieces:
            assert np.isfinite(ground.heights_m(footprint(piece).corners_m)).all()


@pytest.mark.slow
def test_seeds_differ_in_paths_trees_and_what_is_built() -> None:
    parks = [park.generated_park(seed, "overcast") for seed in range(20, 26)]
    assert len({site.area_m2 for site in parks}) == len(parks)
    assert len({sum(piece.name.startswith("tree") for piece in site.pieces) for site in parks}) >= 3
