"""A piece of furniture in its place, and what holds it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench.asset.furniture import Part
from vobench.geometry.se3 import Array

# Supports of pieces; every other support is the name of the piece on which a piece stands.
SHELL = "shell"  # the piece is a part of the building
FLOOR = "floor"
WALL = "wall"
CEILING = "ceiling"


@dataclass(frozen=True, slots=True)
class PlacedPiece:
    """A piece of furniture in a room.

    `parts` are in the frame of the place.
    `support` is SHELL, FLOOR, WALL, CEILING, or the name of the piece on which it stands.
    `may_overlap` names pieces whose bounding boxes it may enter, as a chair does under a table.
    """

    name: str
    room: str
    parts: tuple[Part, ...]
    support: str
    may_overlap: tuple[str, ...] = ()


def vertices_of(parts: Sequence[Part]) -> Array:
    """The vertices (N, 3) of parts in metres."""
    return np.concatenate([part.arrays.vertices_m for part in parts])
