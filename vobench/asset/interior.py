"""Interiors: a floor plan with its shell, its furniture and its lights."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from vobench.asset.floor_plan import FloorPlan
from vobench.asset.placed_piece import PlacedPiece
from vobench.asset.room import Instance, things
from vobench.asset.room_layout import RoomLayout
from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.light import Light

SHELL_SPACING_M = 0.08  # between samples of the light
PIECE_SPACING_M = 0.06
FACES = 20000  # of the pieces of a place, at most, and so many more per square metre of floor
FACES_PER_M2 = 410


@dataclass(frozen=True, slots=True)
class Interior:
    """A furnished floor plan: its shell, pieces and lights."""

    plan: FloorPlan
    shell: tuple[Instance, ...]
    pieces: tuple[PlacedPiece, ...]
    lights: tuple[Light, ...]

    def place(self) -> GeneratedPlace:
        """The things, materials and lights of the place."""
        coarse, shell_materials = things(self.shell)
        fine, materials = things([(piece.name, piece.parts) for piece in self.pieces], shell_materials)
        spaced = [replace(thing, spacing_m=SHELL_SPACING_M) for thing in coarse]
        spaced += [replace(thing, spacing_m=PIECE_SPACING_M) for thing in fine]
        return GeneratedPlace(tuple(spaced), materials, self.lights)


def furnished_interior(
    plan: FloorPlan,
    shell: Iterable[Instance],
    layouts: Iterable[RoomLayout],
    daylight: Sequence[Light],
    optional: Sequence[str],
) -> Interior:
    """The interior of a plan whose rooms are furnished, with its lamps and the lights outside.

    Pieces of the `optional` kinds are left out, in this order, if there are too many faces.
    """
    rooms = list(layouts)
    placed = [piece for layout in rooms for piece in layout.placed]
    lamps = [light for layout in rooms for light in layout.lights]
    pieces = without_excess(placed, most_faces(plan), optional)
    return Interior(plan, tuple(shell), pieces, (*lamps, *daylight))


def most_faces(plan: FloorPlan) -> int:
    """How many faces the pieces of a place should have at most."""
    return round(FACES + FACES_PER_M2 * plan.area_m2)


def _face_count(piece: PlacedPiece) -> int:
    return sum(len(part.arrays.faces) for part in piece.parts)


def without_excess(pieces: Sequence[PlacedPiece], faces: int, optional: Sequence[str]) -> tuple[PlacedPiece, ...]:
    """The pieces without as many of some optional kinds, the last ones first, as leave at most a number of faces.

    Nothing may lie on pieces of these kinds. Lamps do not count, so that switching them changes nothing else.
    """
    counts = [0 if "lamp_" in piece.name else _face_count(piece) for piece in pieces]
    excess = sum(counts) - faces
    dropped = set[int]()
    for kind in optional:
        for index in reversed(range(len(pieces))):
            if excess > 0 and f".{kind}_" in pieces[index].name:
                dropped.add(index)
                excess -= counts[index]
    return tuple(piece for index, piece in enumerate(pieces) if index not in dropped)
