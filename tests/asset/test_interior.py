"""An interior has no more faces than its floor plan may have."""

from vobench.asset import furniture
from vobench.asset.furniture import WHITE
from vobench.asset.interior import without_excess
from vobench.asset.placed_piece import FLOOR, PlacedPiece


def test_optional_pieces_are_left_out_until_the_faces_are_few_enough() -> None:
    block = furniture.stood((1, 1, 1), WHITE)
    names = ["a.table_1", "a.mug_1", "a.mug_2", "a.plant_1"]
    pieces = [PlacedPiece(name, "a", (block,), FLOOR) for name in names]
    count = len(block.arrays.faces)
    kept = without_excess(pieces, 2 * count, ("mug", "plant"))
    assert [piece.name for piece in kept] == ["a.table_1", "a.plant_1"]
    assert without_excess(pieces, 4 * count, ("mug",)) == tuple(pieces)
