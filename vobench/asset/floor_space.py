"""The floor of a room: the footprints on it, clearances, and whether a body still reaches every doorway."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from vobench.asset.floor_plan import Rect
from vobench.geometry.se3 import Array

BODY_RADIUS_M = 0.28  # of a body that drives through the room: 0.25 m, as in place_check, and a margin
CELL_M = 0.1  # of the grid of free floor; the body passes what is a few cells wide
LEAST_FREE_M2 = 0.6  # of floor that the body reaches
LEAST_FREE_SHARE = 0.06  # of the floor of small rooms, of which 0.6 m2 would be too much


@dataclass(frozen=True, slots=True)
class OccupiedFloor:
    """A footprint on the floor, and the height of what stands there."""

    footprint: Rect
    height_m: float


@dataclass(slots=True)
class FloorSpace:
    """The floor of a room while it is being furnished.

    `rect` is the floor between the walls.
    """

    rect: Rect
    _occupied: list[OccupiedFloor] = field(default_factory=list)
    _clearances: list[Rect] = field(default_factory=list)
    _doorway_points_m: list[tuple[float, float]] = field(default_factory=list)

    def occupy(self, footprint: Rect, height_m: float) -> None:
        """Record that something of a height stands on the floor."""
        self._occupied.append(OccupiedFloor(footprint, height_m))

    def keep_clear(self, clearance: Rect) -> None:
        """Record that nothing may stand on a part of the floor."""
        self._clearances.append(clearance)

    def keep_reachable(self, point_m: tuple[float, float]) -> None:
        """Record that a body has to reach a point (x, y) in front of a doorway."""
        self._doorway_points_m.append(point_m)

    def fits(self, footprints: Sequence[Rect], fronts: Sequence[Rect] = ()) -> bool:
        """Whether pieces can stand on footprints.

        They have to be in the room, apart from other pieces and out of all clearances, and leave a path between the
        doorways. `fronts` are rectangles in front of them that no other piece may occupy.
        """
        if not all(self._is_clear(footprint) for footprint in footprints):
            return False
        if any(self._is_occupied(rect) for rect in (*footprints, *fronts)):
            return False
        are_fronts_inside = all(self.rect.contains(front) for front in fronts)
        return are_fronts_inside and self._has_path(footprints)

    def _is_clear(self, footprint: Rect) -> bool:
        """Whether a footprint is in the room and out of all clearances."""
        is_blocking = any(footprint.overlaps(clearance) for clearance in self._clearances)
        return self.rect.contains(footprint) and not is_blocking

    def _is_occupied(self, rect: Rect) -> bool:
        return any(rect.overlaps(occupied.footprint) for occupied in self._occupied)

    def _has_path(self, added: Sequence[Rect]) -> bool:
        """Whether a body gets from each doorway to all others and into the room, past added footprints, too."""
        x_m = np.arange(self.rect.x0 + CELL_M / 2, self.rect.x1, CELL_M)  # (columns,)
        y_m = np.arange(self.rect.y0 + CELL_M / 2, self.rect.y1, CELL_M)  # (rows,)
        labels, _ = scipy.ndimage.label(self._free_cells(x_m, y_m, added))  # 0 where the body cannot be

        doorway_labels = set()
        for point_x_m, point_y_m in self._doorway_points_m:
            column = int(np.abs(x_m - point_x_m).argmin())
            row = int(np.abs(y_m - point_y_m).argmin())
            doorway_labels.add(int(labels[row, column]))
        if len(doorway_labels) != 1 or 0 in doorway_labels:
            return False

        reached_cells = int((labels == doorway_labels.pop()).sum())
        reached_m2 = float(reached_cells) * CELL_M**2
        return reached_m2 > min(LEAST_FREE_M2, LEAST_FREE_SHARE * self.rect.area_m2)

    def _free_cells(self, x_m: Array, y_m: Array, added: Sequence[Rect]) -> Array:
        """The cells (rows, columns) with centres x_m (columns,) and y_m (rows,) where the middle of a body can be."""
        is_free = np.ones((len(y_m), len(x_m)), bool)
        for footprint in (*(occupied.footprint for occupied in self._occupied), *added):
            blocked = footprint.grown(BODY_RADIUS_M)
            columns = slice(*np.searchsorted(x_m, [blocked.x0, blocked.x1]).tolist())
            rows = slice(*np.searchsorted(y_m, [blocked.y0, blocked.y1]).tolist())
            is_free[rows, columns] = False

        is_inside_x = (x_m > self.rect.x0 + BODY_RADIUS_M) & (x_m < self.rect.x1 - BODY_RADIUS_M)
        is_inside_y = (y_m > self.rect.y0 + BODY_RADIUS_M) & (y_m < self.rect.y1 - BODY_RADIUS_M)
        is_free &= is_inside_x
        is_free &= is_inside_y[:, None]
        return is_free

    def free_share(self) -> float:
        """The share of the floor on which nothing stands, 0 to 1."""
        occupied_m2 = sum(occupied.footprint.area_m2 for occupied in self._occupied)
        return 1 - occupied_m2 / self.rect.area_m2

    def footprints_above(self, height_m: float) -> list[Rect]:
        """The footprints of all that is higher than a height."""
        return [occupied.footprint for occupied in self._occupied if occupied.height_m > height_m]
