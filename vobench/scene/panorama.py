"""Panoramas: the luminance of what surrounds a scene at infinity, by direction."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.scene.material import LUMINANCE, Map

LIGHT_CELL_PX = 16  # rows and columns whose mean luminance lights a scene: 1.4 degrees
DARK_LX = 40.0  # illuminance by the sky below which all lamps are on
DUSK_LX = 400.0  # above which none is


@dataclass(frozen=True, eq=False)
class PanoramaMap:
    """A panorama as two pictures in the cylindrical equal-area projection.

    Column 0 starts at azimuth -180 degrees, and azimuth grows with the column. Row 0 starts at the zenith, and the sine
    of the elevation falls evenly from 1 to -1. So each pixel has the same solid angle.

    daylight (H, W, 3) float16: linear red, green and blue by daylight, in cd/m² per lux of the sky.
    lamps (H, W) float16: luminance in cd/m² of lit windows and street lamps.
    """

    daylight: NDArray[np.float16]
    lamps: NDArray[np.float16]

    def map_under(self, sky: object) -> "PanoramaMap":
        """This map, whatever the sky."""
        del sky
        return self

    @cached_property
    def light(self) -> Map:
        """Mean luminance (h, w) float32 of daylight in cells of LIGHT_CELL_PX, in cd/m² per lux of the sky."""
        rows, columns, _ = self.daylight.shape
        size = (rows // LIGHT_CELL_PX, LIGHT_CELL_PX, columns // LIGHT_CELL_PX, LIGHT_CELL_PX)
        luminance = self.daylight.astype(np.float32) @ np.array(LUMINANCE, np.float32)
        return np.asarray(luminance.reshape(size).mean((1, 3)))

    @cached_property
    def around_horizon(self) -> Array:
        """The mean daylight (3,) within 30 degrees of the horizon, in cd/m² per lux of the sky."""
        quarter = len(self.daylight) // 4  # of the rows, which are even in the sine
        return np.asarray(self.daylight[quarter:-quarter].mean((0, 1), dtype=float))

    def luminance(self, directions: Array) -> Array:
        """Luminance (...) along unit directions (..., 3) as it lights a scene, in cd/m² per lux of the sky."""
        rows, columns = self.light.shape
        row, column = _pixels(directions, rows, columns)
        nearest_row = np.minimum(row.astype(np.int32), rows - 1)
        nearest_column = column.astype(np.int32) % columns
        return np.asarray(self.light[nearest_row, nearest_column])

    def seen(self, directions: Array) -> Array:
        """Daylight (..., 3) along unit directions (..., 3) as it is seen, interpolated between pixels."""
        rows, columns, _ = self.daylight.shape
        row, column = _pixels(directions, rows, columns)
        row = np.clip(row - 0.5, 0, rows - 1)
        column = column - 0.5
        upper = np.minimum(row.astype(np.int32), rows - 2)
        left = np.floor(column).astype(np.int32)
        down = (row - upper)[..., None]
        right = (column - left)[..., None]

        top = self._mixed(upper, left, right)
        bottom = self._mixed(upper + 1, left, right)
        return np.asarray((1 - down) * top + down * bottom)

    def _mixed(self, row: NDArray[np.int32], left: NDArray[np.int32], right: Array) -> Array:
        """Daylight between a column and the next one, which may be the first."""
        columns = self.daylight.shape[1]
        first = self.daylight[row, left % columns].astype(np.float32)
        second = self.daylight[row, (left + 1) % columns].astype(np.float32)
        return np.asarray((1 - right) * first + right * second)


def _pixels(directions: Array, rows: int, columns: int) -> tuple[Array, Array]:
    """Row and column (...), counted from the map's corner, that unit directions (..., 3) point to."""
    azimuth = np.arctan2(directions[..., 1], directions[..., 0])
    row = (1 - directions[..., 2]) * (rows / 2)
    column = (azimuth / (2 * np.pi) + 0.5) * columns
    return row, column


def lamp_share(illuminance_lx: float) -> float:
    """The share of a panorama's lamps that are on while the sky gives this illuminance."""
    return float(np.clip((DUSK_LX - illuminance_lx) / (DUSK_LX - DARK_LX), 0, 1))
