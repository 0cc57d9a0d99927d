"""Trees, hedges and houses of a panorama, which are collected in any order and painted from far to near."""

from collections.abc import Callable
from functools import partial

import numpy as np

from vobench.asset.panorama_building import DistantBuilding, height_below_sun_m, paint_building
from vobench.asset.panorama_canvas import PanoramaCanvas, albedo_of
from vobench.asset.panorama_tree import DistantTrees
from vobench.asset.panorama_wall import DistantFacade
from vobench.asset.picture import Rng
from vobench.geometry.se3 import Array

# The four directions of a square around the scene. Their order is that in which random numbers are drawn.
COMPASS = ((1, 0), (0, 1), (-1, 0), (0, -1))

HOUSE_WALLS = ("#a08f78", "#8f5a45", "#aba08c", "#85705d", "#9a8267", "#8a8379", "#7d4a39")
HOUSE_ROOFS = ("#6d3d2a", "#5b4a42", "#4a4744", "#7a4a34", "#54504c")
HOUSE_TRIM = "#b9b4a8"
BUSH_SPACING_M = 1.1
BUSH_SUNK = 0.5  # a bush is a tree of which half is below the ground


class Scenery:
    """Trees, hedges and houses around a scene."""

    def __init__(self, canvas: PanoramaCanvas) -> None:
        self._canvas = canvas
        self._trees = DistantTrees(canvas)
        self._painters: list[tuple[float, Callable[[], None]]] = []  # by their distance in metres

    def add_tree(self, place_m: Array, height_m: float, *, sunk: float = 0.0) -> None:
        """A tree, or a bush if a share of its height is sunk."""
        distance_m = float(np.hypot(*place_m))
        azimuth = float(np.arctan2(place_m[1], place_m[0]))
        seen_height_m = height_below_sun_m(self._canvas, place_m, height_m) if sunk == 0 else height_m
        paint = partial(self._trees.paint, azimuth, distance_m, seen_height_m, sunk=sunk)
        self._painters.append((distance_m, paint))

    def add_hedge(self, start_m: Array, along: Array, length_m: float) -> None:
        """Bushes in a row."""
        for step_m in np.arange(0, length_m, BUSH_SPACING_M):
            height_m = float(self._canvas.rng.uniform(2.6, 3.4))
            self.add_tree(start_m + step_m * along, height_m, sunk=BUSH_SUNK)

    def add_house(self, place_m: Array, yaw_rad: float) -> None:
        """A house with a pitched roof."""
        house = _house(self._canvas, place_m, yaw_rad)
        self._painters.append((house.distance_m, partial(paint_building, self._canvas, house)))

    def paint(self) -> None:
        """Paint all that was added."""
        for _, paint in sorted(self._painters, key=lambda painter: -painter[0]):
            paint()


def one_albedo(rng: Rng, colours: tuple[str, ...]) -> tuple[float, float, float]:
    """The albedo of one of several colours."""
    return albedo_of(colours[int(rng.integers(len(colours)))])


def random_place(rng: Rng, nearest_m: float, farthest_m: float) -> Array:
    """A place (2,) in any direction between two distances."""
    azimuth = rng.uniform(-np.pi, np.pi)
    distance_m = rng.uniform(nearest_m, farthest_m)
    return np.array([np.cos(azimuth), np.sin(azimuth)]) * distance_m


def _house(canvas: PanoramaCanvas, middle_m: Array, yaw_rad: float) -> DistantBuilding:
    rng = canvas.rng
    facade = DistantFacade(
        wall=one_albedo(rng, HOUSE_WALLS),
        trim=albedo_of(HOUSE_TRIM),
        storey_m=2.8,
        bay_m=float(rng.uniform(2.4, 3.2)),
        window_m=float(rng.uniform(1.1, 1.5)),
        sill_m=0.9,
        head_m=2.25,
        lit_share=0.45,
    )
    storeys = 2 if rng.random() < 0.6 else 1
    height_m = height_below_sun_m(canvas, middle_m, 2.9 * storeys)
    half_length_m = float(rng.uniform(4.5, 6.5))
    half_width_m = float(rng.uniform(3.8, 4.6))
    roof_m = float(rng.uniform(2.4, 3.6))
    return DistantBuilding(
        middle_m=(float(middle_m[0]), float(middle_m[1])),
        half_m=(half_length_m, half_width_m),
        yaw_rad=yaw_rad,
        height_m=height_m,
        facade=facade,
        roof_m=roof_m,
        roof=one_albedo(rng, HOUSE_ROOFS),
    )
