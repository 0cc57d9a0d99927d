"""Bedside tables stand beside the head of their bed."""

from tests.asset.flats import SEEDS, flat
from vobench.asset.placed_piece import vertices_of


def test_bedside_tables_touch_the_wall_at_the_head_of_a_bed_on_both_sides_at_most_once() -> None:
    count = 0
    for seed in SEEDS:
        interior = flat(seed)
        for table in interior.pieces:
            if ".bedside_table_" not in table.name:
                continue
            count += 1
            (bed,) = (piece for piece in interior.pieces if piece.room == table.room and ".bed_" in piece.name)
            bed_m = vertices_of(bed.parts)[:, :2]
            table_m = vertices_of(table.parts)[:, :2]
            gap_m = [
                max(bed_m[:, axis].min() - table_m[:, axis].max(), table_m[:, axis].min() - bed_m[:, axis].max())
                for axis in (0, 1)
            ]
            assert -0.01 < max(gap_m) < 0.15, "beside the bed, and not in it"
            assert sum(".bedside_table_" in piece.name and piece.room == table.room for piece in interior.pieces) <= 2
    assert count > 5
