"""Rows of pallet racks: uprights with braces, beams and decks."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from vobench.asset.furniture import SIDES, STEEL, Part
from vobench.asset.shape import at, block_arrays, tube
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

UPRIGHT_M = 0.1  # what an upright takes up along the row
ABOVE_DECK_M = 1.3  # height of the uprights above the uppermost deck
LOWEST_BRACE_M = 0.3
BRACE_M = 0.85  # height of a brace
BEAM_M = 0.12  # height of a beam
SLATS = 10  # of the deck of a bay


@dataclass(frozen=True, slots=True)
class Rack:
    """A row of pallet racks along x, centred at the origin.

    `bays` is the number of bays, and `bay_m` the length of each.
    `levels_m` are the heights of the decks.
    """

    bays: int
    bay_m: float
    depth_m: float
    levels_m: tuple[float, ...]
    upright: Material
    beam: Material

    @property
    def pitch_m(self) -> float:
        """The distance between uprights."""
        return self.bay_m + UPRIGHT_M

    @property
    def length_m(self) -> float:
        """The length of the row."""
        return self.bays * self.pitch_m + UPRIGHT_M

    def bay_x_m(self, bay: int) -> float:
        """The middle of a bay."""
        return (bay - (self.bays - 1) / 2) * self.pitch_m

    def parts(self) -> list[Part]:
        """The uprights with their braces, the beams, and the decks."""
        return [
            Part(joined_arrays([*self._posts(), *self._braces()]), self.upright),
            Part(joined_arrays(self._beams()), self.beam),
            Part(joined_arrays(self._decks()), STEEL),
        ]

    @property
    def _height_m(self) -> float:
        return self.levels_m[-1] + ABOVE_DECK_M

    def _uprights_x_m(self) -> list[float]:
        """The places of the uprights along the row."""
        return [(number - self.bays / 2) * self.pitch_m for number in range(self.bays + 1)]

    def _posts(self) -> list[MeshArrays]:
        """Two posts for each upright."""
        post = block_arrays((0.08, 0.1, self._height_m), bevel_m=0).moved(at(z_m=self._height_m / 2))
        posts = []
        for x_m in self._uprights_x_m():
            for side in SIDES:
                y_m = side * self.depth_m / 2
                posts.append(post.moved(at(x_m, y_m)))
        return posts

    def _braces(self) -> list[MeshArrays]:
        """Diagonal braces between the two posts of each upright."""
        half_m = self.depth_m / 2
        braces = []
        for x_m in self._uprights_x_m():
            for z_m in np.arange(LOWEST_BRACE_M, self._height_m - 0.9, BRACE_M).tolist():
                start = [x_m, -half_m, z_m]
                end = [x_m, half_m, z_m + BRACE_M]
                braces.append(as_arrays(tube([start, end], 0.016, sections=4)))
        return braces

    def _beams(self) -> list[MeshArrays]:
        """Two beams below each deck."""
        beam = block_arrays((self.bay_m, 0.05, BEAM_M), bevel_m=0)
        beams = []
        for bay, level_m, side in product(range(self.bays), self.levels_m, SIDES):
            x_m = self.bay_x_m(bay)
            y_m = side * self.depth_m / 2
            beams.append(beam.moved(at(x_m, y_m, level_m - BEAM_M / 2)))
        return beams

    def _decks(self) -> list[MeshArrays]:
        """Slats across the beams."""
        slat = block_arrays((0.1, self.depth_m - 0.06, 0.02), bevel_m=0)
        slats_x_m = np.linspace(-self.bay_m / 2 + 0.1, self.bay_m / 2 - 0.1, SLATS).tolist()
        slats = []
        for bay, level_m, slat_x_m in product(range(self.bays), self.levels_m, slats_x_m):
            x_m = self.bay_x_m(bay) + slat_x_m
            slats.append(slat.moved(at(x_m, 0, level_m - 0.011)))
        return slats
