"""The map of a panorama while it is painted: its pixels, the light outside, the haze, and noise for textures."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.asset.panorama_noise import Floats, fade_pattern, sample_tile
from vobench.asset.panorama_sky import Sunlight, sky_colours
from vobench.asset.picture import Rng, noise
from vobench.geometry.se3 import Array
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE, linear
from vobench.scene.panorama import PanoramaMap

ROWS = 1280
COLUMNS = 4096
CELL_SR = 4 * np.pi / (ROWS * COLUMNS)
EYE_M = 1.0  # above the floor of the scene
MOST_CD_M2_PER_LX = 6e4  # what float16 holds
HAZE_M = 9000.0  # distance at which e^-1 of the contrast is left
HAZE_ROWS = ROWS // 40  # above the horizon, whose mean is the colour of the haze: 3 degrees

Columns = NDArray[np.int64]
Albedo = tuple[float, float, float]


def albedo_of(colour: str) -> Albedo:
    """The albedo of #rrggbb."""
    channels = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)
    red, green, blue = (float(value) for value in linear(channels))
    return red, green, blue


def reflected_cd_m2(albedo: ArrayLike, illuminance_lx: ArrayLike) -> Floats:
    """Luminance (..., 3) of diffuse surfaces."""
    exitance = np.asarray(albedo, np.float32) * np.asarray(illuminance_lx, np.float32)
    return np.asarray(exitance / np.pi, np.float32)


def azimuths(columns: NDArray[Any], count: int = COLUMNS) -> Array:
    """The azimuth of the middle of each column, in radians, if there are `count` columns all around."""
    turns = (columns + 0.5) / count - 0.5
    return np.asarray(2 * np.pi * turns)


class OutdoorLight:
    """Illuminance by sun and sky, in lux of red, green and blue, of surfaces outside.

    sky_lx, level_lx (3,): of level ground by the sky alone, and by sky and sun. sun_lx (3,): of what faces the sun.
    """

    ROWS = 16  # cells of the sky's luminance, above the horizon and all around
    COLUMNS = 64
    BOUNCED_SHARE = 0.5  # of the light that the ground reflects, what an upright surface gets

    def __init__(self, sky: Sky, sun: Sunlight, sky_map_cd_m2: Floats) -> None:
        """`sky_map_cd_m2` (ROWS / 2, COLUMNS, 3): the sky's luminance."""
        self.sun_direction = sky.sun_direction
        self.sun_lx = sun.illuminance_lx * np.array(sun.colour, np.float32)

        cells = sky_map_cd_m2.reshape(self.ROWS, -1, self.COLUMNS, COLUMNS // self.COLUMNS, 3)
        self._sky_cd_m2 = cells.mean((1, 3))  # (rows, columns, 3)
        solid_angle_sr = 2 * np.pi / self._sky_cd_m2[..., 0].size
        sine = 1 - (np.arange(self.ROWS) + 0.5) / self.ROWS
        self.sky_lx = (self._sky_cd_m2 * sine[:, None, None]).sum((0, 1)) * solid_angle_sr
        sun_sine = max(float(self.sun_direction[2]), 0.0)
        self.level_lx = self.sky_lx + self.sun_lx * sun_sine
        self._bounced_lx = self.BOUNCED_SHARE * sky.ground_albedo * self.level_lx

        azimuth = azimuths(np.arange(self.COLUMNS), self.COLUMNS)
        facing = np.maximum(np.cos(azimuth[:, None] - azimuth), 0)  # (normals, directions)
        cosine = np.sqrt(1 - sine**2)
        lx_by_azimuth = np.einsum("r,rcd->cd", cosine, self._sky_cd_m2) * solid_angle_sr
        self._upright_lx = facing @ lx_by_azimuth  # by the sky, for each azimuth of the normal

    def _column(self, azimuth: float) -> int:
        turns = azimuth / (2 * np.pi) + 0.5
        return int(turns * self.COLUMNS) % self.COLUMNS

    def upright_lx(self, azimuth: float) -> Floats:
        """Illuminance (3,) of an upright surface that faces an azimuth."""
        normal = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        cosine = max(float(normal @ self.sun_direction), 0.0)
        diffuse_lx = self._upright_lx[self._column(azimuth)] + self._bounced_lx
        return np.asarray(diffuse_lx + cosine * self.sun_lx, np.float32)

    def sky_cd_m2(self, azimuth: float, sine: float = 0.5) -> Floats:
        """The sky's luminance (3,), smoothed, at an azimuth and a sine of the elevation."""
        row = min(int((1 - sine) * self.ROWS), self.ROWS - 1)
        return np.asarray(self._sky_cd_m2[row, self._column(azimuth)], np.float32)


class PanoramaCanvas:
    """The map while it is painted, in cd/m²: the sky at first.

    eye_m: the height of the eye above the ground. nearest_m: how near the first things are.
    tangent, tangent_step (ROWS,): of the elevation of each row, and the difference between rows.
    azimuth (COLUMNS,): of each column, in radians.
    colour (ROWS, COLUMNS, 3): luminance by daylight. lamps (ROWS, COLUMNS): luminance of lamps and lit windows.
    """

    def __init__(self, sky: Sky, sun: Sunlight, *, eye_m: float, nearest_m: float, rng: Rng) -> None:
        self.sun = sun
        self.eye_m = eye_m
        self.nearest_m = nearest_m
        self.rng = rng

        sine = 1 - (np.arange(ROWS) + 0.5) * (2 / ROWS)
        cosine = np.sqrt(1 - sine**2)
        self.tangent = (sine / cosine).astype(np.float32)
        self.tangent_step = (2 / ROWS / cosine**3).astype(np.float32)
        self.azimuth = azimuths(np.arange(COLUMNS)).astype(np.float32)
        self._grain = noise(rng, 512, 2, 256, slope=0.6)
        self.colour = np.zeros((ROWS, COLUMNS, 3), np.float32)
        self.lamps = np.zeros((ROWS, COLUMNS), np.float32)

        sky_rows = slice(0, ROWS // 2)
        directions = _directions(self.azimuth, sine[sky_rows], cosine[sky_rows])
        self.colour[sky_rows] = sky_colours(directions, sky, sun, rng)
        self.daylight = OutdoorLight(sky, sun, self.colour[sky_rows])
        self.haze_cd_m2 = self.colour[sky_rows][-HAZE_ROWS:].mean(0)  # (COLUMNS, 3)

    def finished(self) -> PanoramaMap:
        """The map in cd/m² per lux of the sky, measured on level ground at the middle of the map."""
        luminance = self.colour[: ROWS // 2] @ np.array(LUMINANCE, np.float32)
        sine = 1 - (np.arange(ROWS // 2) + 0.5) * (2 / ROWS)
        level_lx = float((luminance.sum(1, dtype=float) * sine).sum()) * CELL_SR
        per_lux = np.clip(self.colour / np.float32(level_lx), 0, MOST_CD_M2_PER_LX)
        return PanoramaMap(per_lux.astype(np.float16), self.lamps.astype(np.float16))

    def rows(self, low: float, high: float) -> slice:
        """The rows between two tangents of the elevation."""
        sine_high = high / np.hypot(1, high)
        sine_low = low / np.hypot(1, low)
        first = int(np.floor((1 - sine_high) * ROWS / 2)) - 1
        end = int(np.ceil((1 - sine_low) * ROWS / 2)) + 1
        return slice(max(first, 0), min(end, ROWS))

    def columns(self, first: float, last: float) -> Columns:
        """The columns (C,) from one azimuth to a greater one, and one more on each side for soft edges."""
        start = int(np.floor((first / (2 * np.pi) + 0.5) * COLUMNS)) - 1
        end = int(np.ceil((last / (2 * np.pi) + 0.5) * COLUMNS)) + 1
        return np.arange(start, min(end, start + COLUMNS))

    def paint(
        self,
        rows: slice,
        columns: Columns,
        colour: ArrayLike,
        cover: Floats,
        *,
        distance_m: float,
        lamps: Floats | None = None,
    ) -> None:
        """Lay colours (r, c, 3) over the map by how much they cover (r, c), in the haze of a distance."""
        clear = np.float32(np.exp(-distance_m / HAZE_M))
        clear_colour = clear * np.asarray(colour, np.float32)
        for run in _runs(columns):
            run_cover = cover[:, run.in_columns]
            hazy = clear_colour[:, run.in_columns] + (1 - clear) * self.haze_cd_m2[run.in_map]
            map_colour = self.colour[rows, run.in_map]  # a view, as is map_lamps
            map_colour += run_cover[..., None] * (hazy - map_colour)
            map_lamps = self.lamps[rows, run.in_map]
            map_lamps *= 1 - run_cover
            if lamps is not None:
                map_lamps += run_cover * lamps[:, run.in_columns]

    def grain(self, u: Floats, v: Floats) -> Floats:
        """Noise of unit variance at places in units of its tile, which repeats."""
        size = len(self._grain)
        row = (v * size).astype(np.int32) % size
        column = (u * size).astype(np.int32) % size
        return np.asarray(self._grain[row, column])

    def grass(self, x_m: Floats, y_m: Floats, footprint_m: Floats) -> Floats:
        """Noise as of grass at places on the ground, coarse and fine, each faded where pixels cover more of it.

        The tiles are oblique, so that their repetition is not seen along the axes.
        """
        coarse = sample_tile(self._grain, x_m / 170 + y_m / 400, y_m / 170 - x_m / 400)
        fine = sample_tile(self._grain, x_m / 11 - y_m / 30, y_m / 11 + x_m / 30)
        faded_coarse = fade_pattern(coarse, footprint_m, 6.0)
        faded_fine = fade_pattern(fine, footprint_m, 0.25)
        return np.asarray(0.16 * faded_coarse + 0.22 * faded_fine)


class _Run(NamedTuple):
    """Successive columns: where they are in the map, and in the columns that were asked for."""

    in_map: slice
    in_columns: slice


def _runs(columns: Columns) -> list[_Run]:
    """Successive columns (C,), of which those beyond the last column of the map go on at its first one."""
    runs = []
    start = 0
    while start < len(columns):
        first = int(columns[start]) % COLUMNS
        length = min(len(columns) - start, COLUMNS - first)
        runs.append(_Run(slice(first, first + length), slice(start, start + length)))
        start += length
    return runs


def _directions(azimuth: Floats, sine: Floats, cosine: Floats) -> Floats:
    """Unit vectors (rows, columns, 3) at azimuths (columns,), and at sines and cosines (rows,) of the elevation."""
    shape = (len(sine), len(azimuth), 1)
    horizontal = np.stack([np.cos(azimuth), np.sin(azimuth)], -1) * cosine[:, None, None]
    vertical = np.broadcast_to(sine[:, None, None], shape)
    return np.concatenate([horizontal, vertical], -1).astype(np.float32)
