"""The sofa faces the television, with the coffee table between them."""

import numpy as np

from tests.asset.flats import SEEDS, flat
from vobench.asset.placed_piece import PlacedPiece, vertices_of


def middle_m(piece: PlacedPiece) -> np.ndarray:
    corners_m = vertices_of(piece.parts)[:, :2]
    return (corners_m.min(axis=0) + corners_m.max(axis=0)) / 2


def living_room_pieces(seed: int) -> dict[str, PlacedPiece]:
    """The first piece of each kind in the living room of a flat."""
    interior = flat(seed)
    living = {room.name for room in interior.plan.rooms if room.use == "living"}
    return {
        piece.name.split(".")[1].removesuffix("_1"): piece
        for piece in interior.pieces
        if piece.room in living and piece.name.endswith("_1")
    }


def test_the_sofa_is_opposite_the_television_at_a_distance_to_watch_it() -> None:
    count = 0
    for seed in SEEDS:
        pieces = living_room_pieces(seed)
        if {"television", "sofa"} <= set(pieces):
            apart_m = np.abs(middle_m(pieces["sofa"]) - middle_m(pieces["television"]))
            assert apart_m.min() < 0.1, "they are on one line"
            assert 1.8 < apart_m.max() < 4.6
            count += 1
    assert count >= len(SEEDS) // 2


def test_the_coffee_table_is_between_them() -> None:
    count = 0
    for seed in SEEDS:
        pieces = living_room_pieces(seed)
        if "coffee_table" in pieces:
            sofa_m = middle_m(pieces["sofa"])
            television_m = middle_m(pieces["television"])
            to_table_m = middle_m(pieces["coffee_table"]) - television_m
            share = to_table_m @ (sofa_m - television_m) / np.sum((sofa_m - television_m) ** 2)
            assert 0.2 < share < 0.8
            count += 1
    assert count >= 2
