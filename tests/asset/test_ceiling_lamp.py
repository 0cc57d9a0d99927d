"""Lamps hang at ceilings: over each dining table, and near the middle of every room."""

import numpy as np

from tests.asset.flats import SEEDS, flat
from vobench.asset.placed_piece import vertices_of


def test_a_pendant_hangs_over_the_middle_of_every_dining_table() -> None:
    count = 0
    for seed in SEEDS:
        interior = flat(seed)
        for table in interior.pieces:
            if ".dining_table_1" not in table.name:
                continue
            corners_m = vertices_of(table.parts)
            middle_m = (corners_m.min(axis=0) + corners_m.max(axis=0))[:2] / 2
            shades_m = [
                vertices_of(piece.parts)
                for piece in interior.pieces
                if piece.room == table.room and ".pendant_" in piece.name
            ]
            middles_m = [(shade_m.min(axis=0) + shade_m.max(axis=0))[:2] / 2 for shade_m in shades_m]
            assert min(np.linalg.norm(each_m - middle_m) for each_m in middles_m) < 0.02
            count += 1
    assert count > 5


def test_every_room_has_a_lamp_at_its_ceiling_which_touches_it() -> None:
    for seed in SEEDS:
        interior = flat(seed)
        for room in interior.plan.rooms:
            lamps = [
                piece
                for piece in interior.pieces
                if piece.room == room.name and (".lamp_body_" in piece.name or ".pendant_" in piece.name)
            ]
            assert lamps, room.name
            for lamp in lamps:
                assert abs(vertices_of(lamp.parts)[:, 2].max() - interior.plan.height_m) < 1e-6
