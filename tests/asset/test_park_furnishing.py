"""The furnishing of parks: nothing overlaps, lamps have their globes, benches face the path, and seeds differ."""

from itertools import combinations

import numpy as np
import pytest

from vobench.asset.park_furnishing import CLOSE_M, LAMP_M, ParkFurnishing, _indices, _place_beside, furnish_park
from vobench.asset.park_plan import STEP_M, ParkPlan, park_plan
from vobench.asset.site import footprint


@pytest.fixture(scope="module")
def plan() -> ParkPlan:
    return park_plan(np.random.default_rng(5))


@pytest.fixture(scope="module")
def furnishing(plan: ParkPlan) -> ParkFurnishing:
    return furnish_park(plan, seed=5)


def test_no_piece_overlaps_another_one(furnishing: ParkFurnishing) -> None:
    footprints = [footprint(piece) for piece in furnishing.pieces]
    assert len(footprints) > 20
    assert all(one.overlap_depth_m(other, CLOSE_M) == 0 for one, other in combinations(footprints, 2))


def test_people_leave_the_middle_of_paths_free() -> None:
    plan = park_plan(np.random.default_rng([158, 0]))  # where a person stood next to the middle of the loop
    furnishing = furnish_park(plan, seed=158)
    people = [footprint(piece) for piece in furnishing.pieces if piece.name.startswith("person_")]
    assert people
    for path in plan.paths:
        for person in people:
            assert np.linalg.norm(path.points_m[:, None] - person.corners_m, axis=2).min() > 0.4


def test_each_lamp_has_a_globe_above_its_foot(furnishing: ParkFurnishing) -> None:
    lamps = [piece for piece in furnishing.pieces if piece.name.startswith("lamp_")]
    assert len(lamps) == len(furnishing.bulbs) > 0
    for lamp, bulb in zip(lamps, furnishing.bulbs, strict=True):
        middle_m = bulb.vertices_m.mean(axis=0)
        place = footprint(lamp)
        assert np.linalg.norm(middle_m[:2] - place.corners_m.mean(axis=0)) < 0.1
        assert middle_m[2] - place.low_m == pytest.approx(LAMP_M, abs=0.1)


def test_a_place_beside_a_path_faces_it_from_either_side(plan: ParkPlan) -> None:
    loop = plan.loop
    for side in (-1, 1):
        place = _place_beside(loop, 10, 0.5, side=side)
        towards = loop.points_m[10] - [place.x_m, place.y_m]
        assert np.linalg.norm(towards) == pytest.approx(loop.widths_m[10] / 2 + 0.5)
        heading_rad = np.deg2rad(place.heading_deg)
        facing = [np.cos(heading_rad), np.sin(heading_rad)]
        assert facing @ towards == pytest.approx(np.linalg.norm(towards))


def test_indices_are_a_pitch_apart(plan: ParkPlan) -> None:
    indices = _indices(plan.loop, 12.0)
    assert set(np.diff(list(indices))) == {round(12.0 / STEP_M)}


def test_equal_seeds_give_equal_pieces_and_another_seed_others(plan: ParkPlan, furnishing: ParkFurnishing) -> None:
    names = [piece.name for piece in furnishing.pieces]
    again = furnish_park(plan, seed=5)
    other = furnish_park(plan, seed=6)
    assert [piece.name for piece in again.pieces] == names
    assert [piece.name for piece in other.pieces] != names
