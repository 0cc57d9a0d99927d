"""Furnishing of streets: nothing overlaps, lamps have poses at their feet, and slots of the kerb have their kinds."""

from itertools import combinations

import numpy as np
import pytest

from vobench.asset import street_furnishing
from vobench.asset.site import footprint
from vobench.asset.street_furnishing import (
    CLOSE_M,
    KERB_KINDS,
    LAMP_SLOTS,
    WIDE_KERB_KINDS,
    StreetFurnishing,
    _kind_of_slot,
    furnish_street,
)
from vobench.asset.street_layout import street_plan


@pytest.fixture(scope="module")
def furnishing() -> StreetFurnishing:
    plan = street_plan(np.random.default_rng(1))
    return furnish_street(plan, seed=1, rng=np.random.default_rng(2))


def test_no_piece_overlaps_another_one(furnishing: StreetFurnishing) -> None:
    footprints = [footprint(piece) for piece in furnishing.pieces]
    assert len(footprints) > 10
    assert all(one.overlap_depth_m(other, CLOSE_M) == 0 for one, other in combinations(footprints, 2))


def test_each_lamp_has_a_pose_at_its_foot(furnishing: StreetFurnishing) -> None:
    lamps = [piece for piece in furnishing.pieces if piece.name.startswith("lamp_")]
    assert len(lamps) == len(furnishing.lamp_poses) > 0
    for lamp, T_world_lamp in zip(lamps, furnishing.lamp_poses, strict=True):
        vertices_m = np.concatenate([part.arrays.vertices_m for part in lamp.parts])
        lowest_m = vertices_m[vertices_m[:, 2].argmin()]
        assert np.linalg.norm(lowest_m - T_world_lamp[:3, 3]) < 0.2


def test_a_street_has_no_more_people_than_allowed(
    furnishing: StreetFurnishing, monkeypatch: pytest.MonkeyPatch
) -> None:
    def people(furnished: StreetFurnishing) -> int:
        return sum(piece.name.startswith("person_") for piece in furnished.pieces)

    limit = people(furnishing) - 2
    assert limit > 0
    monkeypatch.setattr(street_furnishing, "MOST_PEOPLE", limit)
    plan = street_plan(np.random.default_rng(1))
    assert people(furnish_street(plan, seed=1, rng=np.random.default_rng(2))) <= limit


def test_names_of_pieces_are_distinct(furnishing: StreetFurnishing) -> None:
    names = [piece.name for piece in furnishing.pieces]
    assert len(set(names)) == len(names)


def test_a_lamp_stands_at_every_sixth_slot_whatever_the_choice() -> None:
    for choice in (0.0, 0.5, 0.99):
        assert _kind_of_slot(2 * LAMP_SLOTS, choice, has_trees=True, is_wide=True) == "lamp"


def test_benches_and_bicycles_stand_on_wide_pavements_alone() -> None:
    choices = np.linspace(0, 0.999, 500).tolist()
    narrow = {_kind_of_slot(2, choice, has_trees=False, is_wide=False) for choice in choices}
    wide = {_kind_of_slot(2, choice, has_trees=False, is_wide=True) for choice in choices}
    assert narrow == {None, *KERB_KINDS}
    assert wide == {None, *WIDE_KERB_KINDS}
