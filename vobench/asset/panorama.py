"""Panoramas by seed: the streets, gardens or fields around a scene, under a sky with clouds.

The map of a panorama is painted from far to near. Nothing in it has parallax, so all of it is as seen from one place.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import product
from typing import Annotated, Any
from zlib import crc32

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import ArrayLike, NDArray

from vobench.asset import PANORAMAS
from vobench.asset.picture import Rng, noise
from vobench.geometry.se3 import Array
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE, WHITE, Rgb, linear
from vobench.scene.panorama import PanoramaMap
from vobench.setting import NonNegative, OneOf, Positive, settings

ROWS = 1280
COLUMNS = 4096
EYE_M = 1.0  # above the floor of the scene
CELL_SR = 4 * np.pi / (ROWS * COLUMNS)
MOST = 6e4  # what float16 holds

Floats = NDArray[Any]  # float32 where there are many
Columns = NDArray[np.int64]
Albedo = tuple[float, float, float]


@settings()
class Surroundings:
    """What surrounds a scene.

    height_m: how high the scene's z = 0 is above the ground around. distance_m: how near the first things are.
    sun_lx, sun_colour: of a sun where the sky is brightest.
    """

    kind: Annotated[str, OneOf("panorama", PANORAMAS)]
    seed: Annotated[int, Ge(0)] = 0
    height_m: Annotated[float, Ge(0), Le(300)] = 0.0
    distance_m: Positive = 30.0
    sun_lx: NonNegative = 0.0
    sun_colour: Rgb = WHITE

    def map_under(self, sky: Sky) -> PanoramaMap:
        """The map of the panorama; it takes a second to paint and is cached."""
        x, y, z = (float(part) for part in sky.sun_direction)
        return _painted(self, sky.illuminance_lx, sky.kind, (x, y, z), sky.ground_albedo)


@lru_cache(maxsize=4)
def _painted(
    around: Surroundings,
    illuminance_lx: float,
    kind: str,
    sun_direction: Rgb,
    ground_albedo: float,
) -> PanoramaMap:
    sky_lx = max(illuminance_lx, 1e-3)  # the map is in units of it
    sky = Sky("sky", sky_lx, kind, np.array(sun_direction), ground_albedo)
    rng = np.random.default_rng([around.seed, crc32(around.kind.encode())])
    canvas = _Canvas(around, sky, rng)
    PAINTERS[around.kind](canvas)
    return canvas.finished()


class _Daylight:
    """Illuminance by sun and sky, in lux of red, green and blue, of surfaces outside."""

    def __init__(self, around: Surroundings, sky: Sky, upper: Floats) -> None:
        """`upper` (ROWS / 2, COLUMNS, 3): the sky's luminance."""
        self.sun_direction = sky.sun_direction
        self.sun_lx = around.sun_lx * np.array(around.sun_colour, np.float32)
        sine = self.sun_direction[2]
        coarse = upper.reshape(16, -1, 64, COLUMNS // 64, 3).mean((1, 3))
        self._coarse = coarse
        z = 1 - (np.arange(16) + 0.5) / 16
        azimuth = 2 * np.pi * ((np.arange(64) + 0.5) / 64 - 0.5)
        solid_angle_sr = 2 * np.pi / coarse[..., 0].size
        self.sky_lx = (coarse * z[:, None, None]).sum((0, 1)) * solid_angle_sr
        self.level_lx = self.sky_lx + self.sun_lx * max(float(sine), 0.0)
        self._bounced_lx = 0.5 * sky.ground_albedo * self.level_lx

        cosine = np.sqrt(1 - z**2)
        facing = np.maximum(np.cos(azimuth[:, None] - azimuth), 0)  # (normals, directions)
        by_azimuth = np.einsum("r,rcd->cd", cosine, coarse) * solid_angle_sr
        self._upright_lx = facing @ by_azimuth

    def upright_lx(self, azimuth: float) -> Floats:
        """Illuminance (3,) of an upright surface that faces an azimuth."""
        column = int((azimuth / (2 * np.pi) + 0.5) * 64) % 64
        normal = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        cosine = max(float(normal @ self.sun_direction), 0.0)
        return np.asarray(self._upright_lx[column] + self._bounced_lx + cosine * self.sun_lx, np.float32)

    def sky_cd_m2(self, azimuth: float, elevation: float = 0.5) -> Floats:
        """The sky's luminance (3,), smoothed, at an azimuth and a sine of the elevation."""
        row = min(int((1 - elevation) * 16), 15)
        return np.asarray(self._coarse[row, int((azimuth / (2 * np.pi) + 0.5) * 64) % 64], np.float32)


class _Canvas:
    """The map while it is painted, in cd/m²: sky and ground at first."""

    def __init__(self, around: Surroundings, sky: Sky, rng: Rng) -> None:
        self.around = around
        self.rng = rng
        self.eye_m = around.height_m + EYE_M
        sine = 1 - (np.arange(ROWS) + 0.5) * (2 / ROWS)
        cosine = np.sqrt(1 - sine**2)
        self.tangent = (sine / cosine).astype(np.float32)
        self.tangent_step = (2 / ROWS / cosine**3).astype(np.float32)
        self.azimuth = (2 * np.pi * ((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5)).astype(np.float32)
        self.grain = noise(rng, 512, 2, 256, slope=0.6)
        self.colour = np.zeros((ROWS, COLUMNS, 3), np.float32)
        self.lamps = np.zeros((ROWS, COLUMNS), np.float32)

        upper = self.colour[: ROWS // 2]
        azimuth = self.azimuth[None, :]
        around_axis = np.stack([np.cos(azimuth), np.sin(azimuth)], -1) * cosine[: ROWS // 2, None, None]
        upward = np.broadcast_to(sine[: ROWS // 2, None, None], (ROWS // 2, COLUMNS, 1))
        directions = np.concatenate([around_axis, upward], -1).astype(np.float32)
        _paint_sky(upper, directions, sky, around, rng)
        self.daylight = _Daylight(around, sky, upper)
        band = upper[-ROWS // 40 :].mean(0)  # (COLUMNS, 3), 3 degrees above the horizon
        self._haze = band

    def finished(self) -> PanoramaMap:
        """The map in cd/m² per lux of the sky, measured on level ground at the middle of the map."""
        upper = self.colour[: ROWS // 2] @ np.array(LUMINANCE, np.float32)
        sine = 1 - (np.arange(ROWS // 2) + 0.5) * (2 / ROWS)
        level_lx = float((upper.sum(1, dtype=float) * sine).sum()) * CELL_SR
        per_lux = np.clip(self.colour / np.float32(level_lx), 0, MOST)
        return PanoramaMap(per_lux.astype(np.float16), self.lamps.astype(np.float16))

    def rows(self, low: float, high: float) -> slice:
        """The rows between two tangents of the elevation."""
        sine_high = high / np.hypot(1, high)
        sine_low = low / np.hypot(1, low)
        first = int(np.floor((1 - sine_high) * ROWS / 2)) - 1
        end = int(np.ceil((1 - sine_low) * ROWS / 2)) + 1
        return slice(max(first, 0), min(end, ROWS))

    def columns(self, first: float, last: float) -> Columns:
        """The columns (C,) from one azimuth to a greater one, by as much as an edge on each side."""
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
        seen_colour = clear * np.asarray(colour, np.float32)
        for part, seen in _runs(columns):
            hazy = seen_colour[:, seen] + (1 - clear) * self._haze[part]
            colours = self.colour[rows, part]
            colours += cover[:, seen, None] * (hazy - colours)
            of_lamps = self.lamps[rows, part]
            of_lamps *= 1 - cover[:, seen]
            if lamps is not None:
                of_lamps += cover[:, seen] * lamps[:, seen]

    def reflected(self, albedo: ArrayLike, lux: ArrayLike) -> Floats:
        """Luminance (..., 3) of diffuse surfaces."""
        return np.asarray(np.asarray(albedo, np.float32) * np.asarray(lux, np.float32) / np.pi, np.float32)

    def grained(self, u: Floats, v: Floats) -> Floats:
        """Noise of unit variance at places in units of its tile, which repeats."""
        size = len(self.grain)
        row = (v * size).astype(np.int32) % size
        column = (u * size).astype(np.int32) % size
        return np.asarray(self.grain[row, column])

    def grown(self, x_m: Floats, y_m: Floats, footprint_m: Floats) -> Floats:
        """Noise as of grass at places on the ground, coarse and fine, each faded where pixels cover more of it."""
        coarse = _sampled(self.grain, x_m / 170 + y_m / 400, y_m / 170 - x_m / 400)
        fine = _sampled(self.grain, x_m / 11 - y_m / 30, y_m / 11 + x_m / 30)
        faded_coarse = _blurred_pattern(coarse, footprint_m, 6.0)
        faded_fine = _blurred_pattern(fine, footprint_m, 0.25)
        return np.asarray(0.16 * faded_coarse + 0.22 * faded_fine)


def _runs(columns: Columns) -> list[tuple[slice, slice]]:
    """The columns of the map that consecutive columns (C,), which may go around, are; and where each run is in them."""
    runs = []
    start = 0
    while start < len(columns):
        first = int(columns[start]) % COLUMNS
        length = min(len(columns) - start, COLUMNS - first)
        runs.append((slice(first, first + length), slice(start, start + length)))
        start += length
    return runs


HAZE_M = 9000.0  # distance at which e^-1 of the contrast is left

# The sky

CLEAR_ZENITH = np.array([0.38, 0.66, 1.35], np.float32)
CLEAR_HORIZON = np.array([0.86, 0.97, 1.2], np.float32)
CLOUD_M = 1400.0
CLOUD_TILE_M = 9000.0


def _paint_sky(upper: Floats, directions: Floats, sky: Sky, around: Surroundings, rng: Rng) -> None:
    """Fill the upper half of a map (r, c, 3): the sky's law, and clouds that leave its illuminance as it is."""
    luminance = sky.standard_cd_m2(directions).astype(np.float32)
    z = directions[..., 2]
    up = z[:, :1]
    chroma = CLEAR_HORIZON + (CLEAR_ZENITH - CLEAR_HORIZON) * np.sqrt(up)[..., None]
    if sky.kind != "clear":
        chroma = np.ones(3, np.float32)
    chroma = chroma / (chroma @ np.array(LUMINANCE, np.float32))[..., None]

    # A layer of clouds of one height, seen in perspective; the earth's curve bounds its distance.
    reach_m = CLOUD_M / (z + 0.06)
    u = directions[..., 0] * reach_m / CLOUD_TILE_M
    v = directions[..., 1] * reach_m / CLOUD_TILE_M
    tile = _smooth(noise(rng, 1024, 2, 400, slope=1.65))
    detail = _sampled(tile, u, v)
    if sky.kind == "clear":
        cover = np.clip((detail - 0.55) / 0.7, 0, 1)
        cover = cover * cover * (3 - 2 * cover)
        lit = 1.35 - 0.5 * np.clip(detail - 1.0, 0, 1.2)  # thick clouds are darker below
        bright = lit * np.float32(0.55 * sky.illuminance_lx / np.pi + 0.18 * around.sun_lx / np.pi)
        seen = (1 - cover) * luminance + cover * np.maximum(bright, 0.9 * luminance)
        sun_tint = 0.5 + 0.5 * np.array(around.sun_colour, np.float32)
        chroma = chroma + cover[..., None] * (sun_tint - chroma)
    elif sky.kind == "overcast":
        seen = luminance * np.exp(0.16 * detail)
    else:
        seen = luminance
    # The sum of luminance times sine over pixels of one solid angle is the illuminance.
    seen = seen * np.float32((luminance * z).sum(dtype=float) / (seen * z).sum(dtype=float))
    upper[...] = seen[..., None] * chroma


def _smooth(values: Floats) -> Floats:
    """The mean of each pixel of a periodic tile and its neighbours."""
    rows = (np.roll(values, 1, 0) + 2 * values + np.roll(values, -1, 0)) / 4
    return np.asarray((np.roll(rows, 1, 1) + 2 * rows + np.roll(rows, -1, 1)) / 4)


def _sampled(tile: Floats, u: Floats, v: Floats) -> Floats:
    """Values of a periodic tile (N, N) at places (r, c) in tiles, interpolated; N is a power of two."""
    result = np.empty(u.shape, np.float32)
    for start in range(0, len(u), BAND_ROWS):
        band = slice(start, start + BAND_ROWS)
        result[band] = _sampled_band(tile, u[band], v[band])
    return result


BAND_ROWS = 16  # of a map that are worked on at a time: their arrays stay in the processor's cache


def _sampled_band(tile: Floats, u: Floats, v: Floats) -> Floats:
    size = len(tile)
    last = size - 1  # by which & takes a number modulo the size
    values = tile.ravel()
    x = u * size
    y = v * size
    left = np.floor(x)
    top = np.floor(y)
    right_share = x - left
    lower_share = y - top
    column = left.astype(np.int32)
    row = top.astype(np.int32)
    next_column = (column + 1) & last
    next_row = ((row + 1) & last) * size
    column = column & last
    row = (row & last) * size
    upper = (1 - right_share) * values.take(row + column) + right_share * values.take(row + next_column)
    lower = (1 - right_share) * values.take(next_row + column) + right_share * values.take(next_row + next_column)
    return np.asarray((1 - lower_share) * upper + lower_share * lower)


# Ground, hills


def _ground_places(canvas: _Canvas) -> tuple[Floats, Floats, Floats]:
    """x, y in metres and the length in metres that a row covers, of the rows (ROWS / 2) below the horizon."""
    tangent = canvas.tangent[ROWS // 2 :, None]
    distance_m = canvas.eye_m / -tangent
    footprint_m = distance_m**2 / canvas.eye_m * canvas.tangent_step[ROWS // 2 :, None]
    x_m = distance_m * np.cos(canvas.azimuth)
    y_m = distance_m * np.sin(canvas.azimuth)
    return x_m, y_m, footprint_m


def _paint_ground(canvas: _Canvas, albedo: Floats, lamps: Floats | None = None) -> None:
    """Fill what is below the horizon with ground of an albedo (ROWS / 2, COLUMNS, 3) in the haze."""
    below = canvas.colour[ROWS // 2 :]
    distance_m = canvas.eye_m / -canvas.tangent[ROWS // 2 :, None, None]
    clear = np.exp(-distance_m / HAZE_M)
    below[...] = clear * canvas.reflected(albedo, canvas.daylight.level_lx) + (1 - clear) * canvas._haze
    if lamps is not None:
        canvas.lamps[ROWS // 2 :] = lamps


def _blurred_pattern(values: Floats, footprint_m: Floats, cell_m: float) -> Floats:
    """Values around 0 of a pattern with cells of some size, faded where a pixel covers more than a cell."""
    return np.asarray(values * np.clip(cell_m / footprint_m - 0.5, 0, 1))


def _paint_hills(canvas: _Canvas, *, rise: float, distance_m: float, albedo: Albedo) -> None:
    """A range of hills whose crest rises to a tangent of the elevation; woods and fields lie on it."""
    steps = np.arange(1, 40)
    phases = 2 * np.pi * canvas.rng.random(39)
    strength = steps**-1.3 * canvas.rng.standard_normal(39)
    waves = np.cos(steps * canvas.azimuth[:, None] + phases)
    profile = waves @ strength
    profile = (profile - profile.min()) / np.ptp(profile)
    roughness = noise(canvas.rng, 512, 20, 256, slope=0.8)[0]
    trees = np.interp(canvas.azimuth, np.linspace(-np.pi, np.pi, 513), [*roughness, roughness[0]])
    crest = rise * (0.35 + 0.65 * profile) + 0.0012 * trees

    rows = canvas.rows(-0.01, float(crest.max()))
    columns = np.arange(COLUMNS)
    tangent = canvas.tangent[rows, None]
    cover = np.clip((crest - tangent) / canvas.tangent_step[rows, None] + 0.5, 0, 1)
    cover *= tangent > -0.002
    patches = canvas.grained(canvas.azimuth[None, :] * 0.9, tangent * 6)
    tone = np.exp(0.35 * patches)[..., None]
    light = 0.6 * canvas.daylight.level_lx
    canvas.paint(rows, columns, canvas.reflected(albedo, light) * tone, cover, distance_m=distance_m)


# Buildings


@dataclass(frozen=True, slots=True)
class _Facade:
    """How the walls of a building look: albedos, storeys, bays of windows."""

    wall: Albedo
    trim: Albedo
    storey_m: float = 3.2
    bay_m: float = 2.6
    window_m: float = 1.25
    sill_m: float = 0.95
    head_m: float = 2.5
    has_shops: bool = False
    lit_share: float = 0.25


@dataclass(frozen=True, slots=True)
class _Building:
    """A box on the ground: its middle (2,), half its sides (2,), yaw, height to the eaves, and its roof's rise."""

    middle_m: tuple[float, float]
    half_m: tuple[float, float]
    yaw_rad: float
    height_m: float
    facade: _Facade
    roof_m: float = 0.0
    roof: Albedo = (0.12, 0.06, 0.045)

    @property
    def distance_m(self) -> float:
        """How far its middle is."""
        return float(np.hypot(*self.middle_m))

    def corners_m(self) -> Array:
        """The four corners (4, 2), counter-clockwise."""
        c = np.cos(self.yaw_rad)
        s = np.sin(self.yaw_rad)
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return np.asarray(signs * self.half_m @ np.array([[c, s], [-s, c]]) + self.middle_m)


@dataclass(frozen=True, slots=True)
class _Wall:
    """One upright rectangle as it is seen: per column its distance and the place along it.

    left_m is where it begins as seen from the middle of the map, along_m (C,) the way from there.
    """

    columns: Columns
    distance_m: Floats
    along_m: Floats
    along_step_m: Floats
    length_m: float
    normal_azimuth: float


def _wall(canvas: _Canvas, first_m: Array, second_m: Array) -> _Wall | None:
    """The wall between two corners of a building, None where its front is turned away."""
    along = second_m - first_m
    length_m = float(np.hypot(*along))
    along = along / length_m
    normal = np.array([along[1], -along[0]])
    height_m = float(-(first_m @ normal))  # of the eye before the wall
    if height_m < 0.05 * length_m and height_m < 0.5:
        return None
    first_azimuth = float(np.arctan2(first_m[1], first_m[0]))
    turn = float(np.arctan2(second_m[1], second_m[0])) - first_azimuth
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    low = min(first_azimuth, first_azimuth + turn)
    columns = canvas.columns(low, low + abs(turn))
    azimuth = 2 * np.pi * ((columns + 0.5) / COLUMNS - 0.5)
    toward = -(np.cos(azimuth) * normal[0] + np.sin(azimuth) * normal[1])
    toward = np.maximum(toward, 0.02)
    distance_m = height_m / toward
    along_m = (np.cos(azimuth) * along[0] + np.sin(azimuth) * along[1]) * distance_m - first_m @ along
    step_m = distance_m / toward * (2 * np.pi / COLUMNS)
    return _Wall(
        columns=columns,
        distance_m=distance_m.astype(np.float32),
        along_m=along_m.astype(np.float32),
        along_step_m=step_m.astype(np.float32),
        length_m=length_m,
        normal_azimuth=float(np.arctan2(normal[1], normal[0])),
    )


def _between(values: Floats, low: ArrayLike, high: ArrayLike, step: Floats) -> Floats:
    """How much (...) of pixels as wide as `step` lies between two values."""
    return np.asarray(np.clip((values - low) / step + 0.5, 0, 1) * np.clip((high - values) / step + 0.5, 0, 1))


class _WallPatch:
    """The pixels (r, c) of a wall, of which each is `height_m` above the ground and `along_m` from the wall's end."""

    def __init__(self, canvas: _Canvas, wall: _Wall, building: _Building, rows: slice) -> None:
        self._canvas = canvas
        self._wall = wall
        self._building = building
        distance_m = wall.distance_m[None, :]
        self.height_m = canvas.eye_m + canvas.tangent[rows, None] * distance_m
        self._height_step_m = canvas.tangent_step[rows, None] * distance_m
        self.along_m = wall.along_m[None, :]
        self._along_step_m = wall.along_step_m[None, :]
        self._light_lx = canvas.daylight.upright_lx(wall.normal_azimuth)

        facade = building.facade
        self._bays = max(int(wall.length_m / facade.bay_m), 1)
        self._storeys = max(int(building.height_m / facade.storey_m + 0.2), 1)
        self._bay_m = wall.length_m / self._bays
        self._bay = np.clip((self.along_m / self._bay_m).astype(np.int32), 0, self._bays - 1)
        self._storey = np.clip((self.height_m / facade.storey_m).astype(np.int32), 0, self._storeys - 1)
        self._at_bay_m = self.along_m - self._bay * self._bay_m
        self._at_storey_m = self.height_m - self._storey * facade.storey_m

    def _in_width(self, values_m: Floats, low_m: float, high_m: float) -> Floats:
        return _between(values_m, low_m, high_m, self._along_step_m)

    def _in_height(self, values_m: Floats, low_m: ArrayLike, high_m: ArrayLike) -> Floats:
        return _between(values_m, low_m, high_m, self._height_step_m)

    def cover(self, gable_m: float) -> Floats:
        """How much of each pixel the wall covers, whose middle is higher than its ends by gable_m."""
        length_m = self._wall.length_m
        to_end_m = np.minimum(self.along_m, length_m - self.along_m)
        top_m = self._building.height_m + 2 * gable_m / length_m * np.maximum(to_end_m, 0)
        # Half a pixel wider, so that nothing shines through between walls that touch.
        half_m = self._along_step_m / 2
        width = _between(self.along_m, -half_m, length_m + half_m, self._along_step_m)
        return np.asarray(self._in_height(self.height_m, 0, top_m) * width)

    def masonry(self, *, has_bands: bool) -> Floats:
        """Luminance (r, c, 3) of the wall without its windows, perhaps with a band at each storey and a cornice."""
        building = self._building
        facade = building.facade
        stains = self._canvas.grained(self.along_m / 23 + building.middle_m[0], self.height_m / 31)
        at_ground = np.clip(self.height_m / 4, 0, 1)
        tone = (0.82 + 0.18 * at_ground) * np.exp(0.06 * stains)
        colour = tone[..., None] * self._canvas.reflected(facade.wall, self._light_lx)
        if has_bands:
            bands = 0.35 * self._in_height(self.height_m % facade.storey_m, 0.0, 0.16)
            cornice = self._in_height(self.height_m, building.height_m - 0.35, building.height_m)
            self._lay_trim(colour, np.maximum(bands, cornice))
        return np.asarray(colour)

    def _lay_trim(self, colour: Floats, cover: Floats) -> None:
        trim = self._canvas.reflected(self._building.facade.trim, self._light_lx)
        colour += cover[..., None] * (trim - colour)

    def add_windows(self, colour: Floats) -> Floats:
        """Add the windows to a wall (r, c, 3), and return the luminance (r, c) of those that are lit at night."""
        facade = self._building.facade
        under_eaves = self.height_m < self._building.height_m - 0.3
        left_m = (self._bay_m - facade.window_m) / 2
        right_m = left_m + facade.window_m
        width = self._in_width(self._at_bay_m, left_m, right_m)
        height = self._in_height(self._at_storey_m, facade.sill_m, facade.head_m)
        frame_width = self._in_width(self._at_bay_m, left_m - 0.12, right_m + 0.12)
        frame_height = self._in_height(self._at_storey_m, facade.sill_m - 0.16, facade.head_m + 0.12)
        panes = width * height
        frames = frame_width * frame_height
        if facade.has_shops:
            is_shop = self._storey == 0
            at_shop_m = self.along_m % (2 * self._bay_m)
            shop_width = self._in_width(at_shop_m, 0.35, 2 * self._bay_m - 0.35)
            shop_height = self._in_height(self.height_m, 0.45, facade.storey_m - 0.75)
            sign = self._in_height(self.height_m, facade.storey_m - 0.7, facade.storey_m - 0.1)
            panes = np.where(is_shop, shop_width * shop_height, panes)
            frames = np.where(is_shop, sign, frames)
        self._lay_trim(colour, frames * under_eaves)
        mullion = self._in_width(self._at_bay_m, self._bay_m / 2 - 0.04, self._bay_m / 2 + 0.04)
        return self._lay_panes(colour, panes * under_eaves * (1 - 0.8 * mullion))

    def _lay_panes(self, colour: Floats, panes: Floats) -> Floats:
        """Panes mirror the sky behind the viewer, and show a dark room or a blind. Returns as `add_windows`."""
        facade = self._building.facade
        rng = self._canvas.rng
        each = (self._storey, self._bay)
        size = (self._storeys, self._bays)
        depth = rng.random(size).astype(np.float32)
        has_blind = rng.random(size) < 0.3
        blind_bottom_m = facade.head_m - depth * (facade.head_m - facade.sill_m)
        blind = (has_blind[each] & (self._at_storey_m > blind_bottom_m[each])).astype(np.float32)
        blind_cd_m2 = self._canvas.reflected((0.3, 0.29, 0.26), self._light_lx)
        mirrored = 0.05 + 0.16 * depth[each]
        pane_cd_m2 = mirrored[..., None] * self._canvas.daylight.sky_cd_m2(self._wall.normal_azimuth)
        pane_cd_m2 = pane_cd_m2 + blind[..., None] * (blind_cd_m2 - pane_cd_m2)
        colour += panes[..., None] * (pane_cd_m2 - colour)

        is_lit = rng.random(size) < facade.lit_share
        if facade.has_shops:
            is_lit[0] = rng.random(self._bays) < LIT_SHOPS
        lit_cd_m2 = np.where(is_lit, 8 + 30 * depth, 0).astype(np.float32)
        return np.asarray(panes * lit_cd_m2[each] * (1 - 0.6 * blind))


LIT_SHOPS = 0.7


def _paint_wall(canvas: _Canvas, wall: _Wall, building: _Building, *, gable_m: float, lowest: float) -> None:
    """A wall with its windows, above a tangent of the elevation; its middle is higher than its ends by gable_m."""
    nearest_m = max(float(wall.distance_m.min()), 1.0)
    farthest_m = max(float(wall.distance_m.max()), 1.0)
    rise_m = building.height_m + gable_m - canvas.eye_m
    highest = rise_m / (nearest_m if rise_m > 0 else farthest_m)
    rows = canvas.rows(max(-canvas.eye_m / nearest_m, lowest), highest)
    if rows.stop <= rows.start:
        return
    patch = _WallPatch(canvas, wall, building, rows)
    colour = patch.masonry(has_bands=gable_m == 0)
    lamps = patch.add_windows(colour)
    street_light = 0.12 * building.facade.wall[1] * np.exp(-np.maximum(patch.height_m, 0) / 5)
    distance_m = float(wall.distance_m.mean())
    canvas.paint(rows, wall.columns, colour, patch.cover(gable_m), distance_m=distance_m, lamps=lamps + street_light)


def _paint_roof(canvas: _Canvas, wall: _Wall, building: _Building, depth_m: float) -> None:
    """The slope of a roof above a wall at its eaves; the ridge is half of the depth farther off."""
    ridge_m = building.height_m + building.roof_m
    far_m = wall.distance_m + depth_m / 2
    low = (building.height_m - canvas.eye_m) / wall.distance_m
    high = (ridge_m - canvas.eye_m) / far_m
    if not (high > low).any():
        return
    rows = canvas.rows(float(low.min()), float(high.max()))
    step = canvas.tangent_step[rows, None]
    tangent = canvas.tangent[rows, None]
    overhang_m = 0.35
    cover = _between(tangent, low[None, :], high[None, :], step)
    cover *= _between(wall.along_m, -overhang_m, wall.length_m + overhang_m, wall.along_step_m)[None, :]
    upward = np.array([np.cos(wall.normal_azimuth), np.sin(wall.normal_azimuth), 1.2])
    upward /= np.linalg.norm(upward)
    cosine = max(float(upward @ canvas.daylight.sun_direction), 0.0)
    light = 0.85 * canvas.daylight.sky_lx + cosine * canvas.daylight.sun_lx
    courses = canvas.grained(wall.along_m[None, :] / 9 + building.middle_m[1], tangent * 40)
    tone = np.exp(0.12 * courses)[..., None]
    colour = canvas.reflected(building.roof, light) * tone
    canvas.paint(rows, wall.columns, colour, cover, distance_m=float(wall.distance_m.mean()))


@dataclass(frozen=True, slots=True)
class _Side:
    """A wall of a building that is seen, above the tangents (C,) up to which nearer walls hide it."""

    building: _Building
    wall: _Wall
    is_eaves: bool
    depth_m: float
    hidden_to: Floats

    def paint(self, canvas: _Canvas) -> None:
        """Paint the wall, and the roof above it where the roof slopes up from there."""
        roof_m = self.building.roof_m
        if self.is_eaves and roof_m:
            _paint_roof(canvas, self.wall, self.building, self.depth_m)
        lowest = float(self.hidden_to.min())
        _paint_wall(canvas, self.wall, self.building, gable_m=0.0 if self.is_eaves else roof_m, lowest=lowest)


def _sides(canvas: _Canvas, building: _Building) -> list[_Side]:
    """The sides of a building that are turned to the viewer, the farther first."""
    corners_m = building.corners_m()
    is_along = building.half_m[0] >= building.half_m[1]  # the ridge runs along the longer side
    sides = []
    for nth in range(4):
        wall = _wall(canvas, corners_m[nth], corners_m[(nth + 1) % 4])
        if wall is not None:
            is_eaves = (nth % 2 == 0) == is_along
            depth_m = 2 * building.half_m[(nth + 1) % 2]
            sides.append(_Side(building, wall, is_eaves, depth_m, np.zeros(0, np.float32)))
    return sorted(sides, key=lambda side: -float(side.wall.distance_m.mean()))


def _paint_building(canvas: _Canvas, building: _Building) -> None:
    """A building that nothing painted so far hides."""
    for side in _sides(canvas, building):
        wall = side.wall
        open_from = np.full(len(wall.columns), -np.inf, np.float32)
        replace(side, hidden_to=open_from).paint(canvas)


def _paint_buildings(canvas: _Canvas, buildings: Sequence[_Building]) -> None:
    """Buildings from far to near, without the walls that nearer ones hide."""
    hidden_to = np.full(COLUMNS, -np.inf, np.float32)
    seen = []
    for building in sorted(buildings, key=lambda each: each.distance_m):
        for side in reversed(_sides(canvas, building)):
            wall = side.wall
            columns = wall.columns % COLUMNS
            top = (building.height_m - canvas.eye_m) / wall.distance_m
            highest = (building.height_m + building.roof_m - canvas.eye_m) / wall.distance_m
            before = hidden_to[columns]
            if (highest > before).any():
                seen.append(replace(side, hidden_to=before))
            inner = slice(2, len(columns) - 2)
            hidden_to[columns[inner]] = np.maximum(before, top)[inner]
    for side in reversed(seen):
        side.paint(canvas)


# Trees

TREE_PX = 128
TREE_KINDS = 6


FarTree = list[Floats]  # what a tree looks like (N, N, 5), at levels of half the size each, all with a rim of zeros
# channels of a tree's look
OPACITY = 0
NORMAL = slice(1, 4)  # to the right, up and towards the viewer
SHADE = 4


def _tree(rng: Rng) -> FarTree:
    """A crown of balls of leaves above a trunk, row 0 at the top."""
    places = (np.arange(TREE_PX, dtype=np.float32) + 0.5) / TREE_PX
    x, y = np.meshgrid(2 * places - 1, 1 - places)
    wide = rng.uniform(0.55, 0.95)
    ragged = 0.06 * noise(rng, TREE_PX, 8, 64, slope=0.3)
    nearest = np.full((TREE_PX, TREE_PX), -9.0, np.float32)
    normals = np.zeros((TREE_PX, TREE_PX, 3), np.float32)
    opacity = np.zeros((TREE_PX, TREE_PX), np.float32)
    trunk = (np.abs(x) < 0.03 + 0.05 * (0.3 - y)) & (y < 0.45)
    opacity[trunk] = 1
    normals[trunk] = (0, -0.6, 0.3)
    for _ in range(70):
        turn = rng.uniform(0, 2 * np.pi)
        out = np.sqrt(rng.random())
        middle_x = wide * out * np.cos(turn) * 0.8
        middle_y = 0.55 + 0.33 * out * np.sin(turn)
        depth = rng.uniform(-0.3, 0.3) * np.sqrt(max(1 - out**2, 0))
        radius = rng.uniform(0.06, 0.17)
        right = (x - middle_x) / radius
        up = (y - middle_y) * 1.6 / radius
        squared = right**2 + up**2 + 6 * ragged
        inside = squared < 1
        height = depth + radius * np.sqrt(np.maximum(1 - squared, 0))
        is_front = inside & (height > nearest)
        ahead = np.sqrt(np.maximum(1 - squared, 0.05))
        nearest[is_front] = height[is_front]
        normals[is_front] = np.stack([right, up, ahead], -1)[is_front]
        opacity[is_front] = 1
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = normals / np.maximum(length, 1e-6)
    leaves = noise(rng, TREE_PX, 10, 64, slope=0.3)
    depth = np.clip((nearest + 0.3) / 0.6, 0, 1)
    shade = (0.45 + 0.55 * depth) * np.exp(0.25 * leaves)
    shade[trunk & (nearest < -8)] = 1.0
    return _levels(np.concatenate([opacity[..., None], normals, shade[..., None]], -1).astype(np.float32))


class _Trees:
    """Trees of a few looks, seen at any size and place."""

    def __init__(self, canvas: _Canvas) -> None:
        self._canvas = canvas
        self._kinds = [_tree(canvas.rng) for _ in range(TREE_KINDS)]

    def paint(self, azimuth: float, distance_m: float, height_m: float, *, sunk: float = 0.0) -> None:
        """A tree on the ground, or a bush: a tree of which a share of the height is sunk below it."""
        canvas = self._canvas
        rng = canvas.rng
        kind = self._kinds[int(rng.integers(TREE_KINDS))]
        green = rng.uniform(0, 1)
        albedo = (0.045 + 0.05 * green, 0.075 + 0.035 * green, 0.025 + 0.012 * green)
        half_width = 0.42 * height_m / distance_m
        ground = -canvas.eye_m / distance_m
        low = ground - sunk * height_m / distance_m
        rows = canvas.rows(low, low + height_m / distance_m)
        columns = canvas.columns(azimuth - half_width, azimuth + half_width)
        if rows.stop - rows.start < 3 or len(columns) > COLUMNS // 4:
            return
        row_share = 1 - (canvas.tangent[rows] - low) * distance_m / height_m  # 0 at the top
        turn = 2 * np.pi * ((columns + 0.5) / COLUMNS - 0.5) - azimuth
        column_share = 0.5 - turn / (2 * half_width)  # azimuth grows to the left
        size = max(len(columns), 1)
        look = _resampled(kind, row_share, column_share, size)
        opacity = look[..., OPACITY] * ((canvas.tangent[rows, None] > ground) | (sunk == 0))
        normals = look[..., NORMAL]
        shade = look[..., SHADE]

        sun = canvas.daylight.sun_direction
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0.0])
        toward = np.array([-np.cos(azimuth), -np.sin(azimuth), 0.0])
        local = np.array([right @ sun, sun[2], toward @ sun], np.float32)
        direct = np.maximum(normals @ local, 0)[..., None] * canvas.daylight.sun_lx
        diffuse = (0.55 + 0.45 * normals[..., 1])[..., None] * canvas.daylight.sky_lx
        colour = canvas.reflected(albedo, (direct + diffuse) * shade[..., None])
        canvas.paint(rows, columns, colour, opacity, distance_m=distance_m)


LEAST_PX = 4  # of a level's side


def _levels(values: Floats) -> list[Floats]:
    """Values (N, N, C), then the means of squares of 2 x 2 of them and so on, all with a rim of zeros."""
    levels = [values]
    while len(levels[-1]) >= 2 * LEAST_PX:
        rows = (levels[-1][::2] + levels[-1][1::2]) / 2
        levels.append((rows[:, ::2] + rows[:, 1::2]) / 2)
    return [np.pad(level, [(1, 1), (1, 1), (0, 0)]) for level in levels]


def _resampled(levels: Sequence[Floats], row_share: Floats, column_share: Floats, size_px: int) -> Floats:
    """Values (r, c, C) at shares (r,), (c,) of the sides, from a level of about size_px pixels; 0 outside."""
    fitting = [level for level in levels if len(level) - 2 < 2 * max(size_px, LEAST_PX)]
    padded = fitting[0]
    size = len(padded) - 2
    y = np.clip(row_share * size + 0.5, 0, size + 0.999)
    x = np.clip(column_share * size + 0.5, 0, size + 0.999)
    top = y.astype(np.int32)
    left = x.astype(np.int32)
    down = (y - top).astype(np.float32)[:, None, None]
    right = (x - left).astype(np.float32)[None, :, None]
    upper = padded[top][:, left] * (1 - right) + padded[top][:, left + 1] * right
    lower = padded[top + 1][:, left] * (1 - right) + padded[top + 1][:, left + 1] * right
    return np.asarray(upper * (1 - down) + lower * down, np.float32)


def _srgb(colour: str) -> Albedo:
    """The albedo of #rrggbb."""
    channels = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)
    red, green, blue = (float(value) for value in linear(channels))
    return red, green, blue


# City

CITY_WALLS = ("#6b3b2d", "#774d3b", "#7a6a59", "#6b655b", "#574639", "#837559", "#5b5652", "#743f31", "#5f6265")
CITY_TRIMS = ("#aaa396", "#8f897f", "#4a4642", "#b5aea2", "#6b5a4c")
CITY_TOWERS = ("#6d747c", "#8b8f92", "#5c6268", "#9a948a")
STREET_M = 14.0
ASPHALT = (0.075, 0.075, 0.078)
PAVING = (0.2, 0.19, 0.175)
LAWN = (0.075, 0.1, 0.035)
CARS = ("#b8bcc0", "#2b2e33", "#7a1f1f", "#27445c", "#d8d8d4", "#4a5a50", "#8a8f94")


def _one(rng: Rng, choices: Sequence[str]) -> Albedo:
    return _srgb(choices[int(rng.integers(len(choices)))])


HALF_DEPTH_M = 8.0  # of a building, at most


def _below_sun(canvas: _Canvas, middle_m: Array, height_m: float) -> float:
    """The height of a building, lowered where it would hide the sun from the scene."""
    sun = canvas.daylight.sun_direction
    distance_m = float(np.hypot(*middle_m))
    nearest_m = max(distance_m - HALF_DEPTH_M, 0.6 * distance_m)
    level = float(np.hypot(sun[0], sun[1]))
    if canvas.around.sun_lx == 0 or level < 0.05:
        return height_m
    cosine = float(middle_m @ sun[:2]) / (distance_m * level)
    if cosine < np.cos(np.deg2rad(40)):
        return height_m
    most_m = canvas.eye_m + 0.75 * nearest_m * float(sun[2]) / level
    return max(min(height_m, most_m), 4.0)


def _city_facade(rng: Rng) -> _Facade:
    return _Facade(
        wall=_one(rng, CITY_WALLS),
        trim=_one(rng, CITY_TRIMS),
        storey_m=float(rng.uniform(3.1, 3.7)),
        bay_m=float(rng.uniform(2.2, 3.4)),
        window_m=float(rng.uniform(1.0, 1.5)),
        has_shops=bool(rng.random() < 0.6),
        lit_share=float(rng.uniform(0.12, 0.4)),
    )


def _tower_facade(rng: Rng) -> _Facade:
    return _Facade(
        wall=_one(rng, CITY_TOWERS),
        trim=_one(rng, CITY_TRIMS),
        storey_m=3.6,
        bay_m=3.0,
        window_m=2.5,
        sill_m=0.7,
        head_m=3.2,
        lit_share=0.3,
    )


def _row_of_buildings(
    canvas: _Canvas, start_m: Array, along: Array, length_m: float, height_m: float
) -> list[_Building]:
    """Buildings side by side from a point on; the street is to the right of `along`."""
    rng = canvas.rng
    inward = np.array([-along[1], along[0]])
    yaw = float(np.arctan2(along[1], along[0]))
    buildings = []
    done_m = 0.0
    while done_m < length_m - 1:
        width_m = min(float(rng.uniform(10, 24)), length_m - done_m)
        if length_m - done_m - width_m < 8:
            width_m = length_m - done_m
        depth_m = 12.0
        middle_m = start_m + (done_m + width_m / 2) * along + depth_m / 2 * inward
        own_m = _below_sun(canvas, middle_m, height_m * float(rng.uniform(0.75, 1.35)))
        facade = _city_facade(rng)
        place = (float(middle_m[0]), float(middle_m[1]))
        buildings.append(_Building(place, (width_m / 2, depth_m / 2), yaw, own_m, facade))
        done_m += width_m
    return buildings


def _block(canvas: _Canvas, middle_m: Array, half_m: Array, height_m: float) -> list[_Building]:
    """A block of the city: rows of buildings along the four sides of a court."""
    buildings = []
    for c, s in COMPASS:
        along = np.array([c, s], float)
        outward = np.array([s, -c], float)
        half_length_m = float(np.abs(along) @ half_m)
        half_depth_m = float(np.abs(outward) @ half_m)
        start_m = middle_m - half_length_m * along + half_depth_m * outward
        buildings += _row_of_buildings(canvas, start_m, along, 2 * half_length_m, height_m)
    return buildings


COMPASS = ((1, 0), (0, 1), (-1, 0), (0, -1))


def _paint_city(canvas: _Canvas) -> None:
    """Blocks with shops and trees along straight streets, towers farther off."""
    rng = canvas.rng
    near_m = canvas.around.distance_m
    _paint_hills(canvas, rise=0.03, distance_m=9000, albedo=(0.06, 0.08, 0.05))
    x_m, y_m, footprint_m = _ground_places(canvas)
    across_m = np.maximum(np.abs(x_m), np.abs(y_m))
    is_paving = (across_m > near_m - 3.5) | (across_m < near_m - STREET_M + 1)
    texture = np.exp(0.4 * canvas.grown(x_m, y_m, footprint_m))[..., None]
    albedo = np.where(is_paving[..., None], PAVING, ASPHALT).astype(np.float32) * texture
    line_m = np.abs(across_m - (near_m - 3.5 - (STREET_M - 4.5) / 2))
    dashes = ((x_m + y_m) % 6 < 3) & (line_m < 0.08)
    albedo += 0.35 * _blurred_pattern(dashes.astype(np.float32), footprint_m, 0.15)[..., None]
    _paint_ground(canvas, albedo.astype(np.float32))

    towers = []
    for _ in range(90):
        turn = rng.uniform(-np.pi, np.pi)
        reach_m = rng.uniform(350, 2200)
        middle_m = reach_m * np.array([np.cos(turn), np.sin(turn)])
        tall_m = _below_sun(canvas, middle_m, float(rng.uniform(25, 45) + 70 * rng.random() ** 3))
        half = (float(rng.uniform(9, 22)), float(rng.uniform(9, 16)))
        place = (float(middle_m[0]), float(middle_m[1]))
        towers.append(_Building(place, half, 0.0, tall_m, _tower_facade(rng)))
    blocks = []
    middles_m, halves_m = _block_places(near_m)
    places = list(zip(middles_m, halves_m, strict=True))
    for (east_m, half_east_m), (north_m, half_north_m) in product(places, places):
        ring_m = max(abs(east_m), abs(north_m))
        if ring_m:
            tall_m = float(rng.uniform(15, 20)) + 0.03 * ring_m
            blocks += _block(canvas, np.array([east_m, north_m]), np.array([half_east_m, half_north_m]), tall_m)
    _paint_buildings(canvas, [*towers, *blocks])
    _paint_street_side(canvas, near_m)


def _block_places(near_m: float) -> tuple[list[float], list[float]]:
    """Middles and half widths along one axis of blocks in a grid of streets; the scene is in the one at 0."""
    half_m = 38.0
    own_half_m = max(near_m - STREET_M, 0.5 * near_m)
    first_m = near_m + half_m
    second_m = first_m + 2 * half_m + STREET_M
    middles_m = [-second_m, -first_m, 0.0, first_m, second_m]
    return middles_m, [half_m, half_m, own_half_m, half_m, half_m]


def _paint_street_side(canvas: _Canvas, near_m: float) -> None:
    """Trees and parked cars along the four streets around the scene's own block."""
    rng = canvas.rng
    trees = _Trees(canvas)
    places = []
    for side, (c, s) in enumerate(COMPASS):
        for along_m in np.arange(-near_m - 8, near_m + 8, 5.6):
            shift_m = along_m + rng.uniform(-0.6, 0.6)
            car_m = np.array([c, s]) * (near_m - 4.6) + np.array([-s, c]) * shift_m
            tree_m = np.array([c, s]) * (near_m - 2.6) + np.array([-s, c]) * shift_m
            if rng.random() < 0.55:
                places.append((float(np.hypot(*car_m)), "car", car_m, side))
            if rng.random() < 0.4:
                places.append((float(np.hypot(*tree_m)), "tree", tree_m, side))
    places.sort(key=lambda place: -place[0])
    for distance_m, kind, place_m, side in places:
        if kind == "tree":
            height_m = _below_sun(canvas, place_m, float(rng.uniform(6, 10)))
            trees.paint(float(np.arctan2(place_m[1], place_m[0])), distance_m, height_m)
        else:
            _paint_car(canvas, place_m, np.pi / 2 * (side + 1))


def _paint_car(canvas: _Canvas, place_m: Array, yaw_rad: float) -> None:
    """A parked car: a body, and a cabin of glass on it."""
    paint = _one(canvas.rng, CARS)
    place = (float(place_m[0]), float(place_m[1]))
    body = _Facade(paint, paint, storey_m=9.0, bay_m=9.0, window_m=0.0)
    glass = _Facade((0.05, 0.055, 0.06), paint, storey_m=9.0, bay_m=9.0, window_m=0.0)
    _paint_building(canvas, _Building(place, (1.25, 0.72), yaw_rad, 1.42, glass))
    _paint_building(canvas, _Building(place, (2.1, 0.86), yaw_rad, 0.86, body))


# Suburb

HOUSE_WALLS = ("#a08f78", "#8f5a45", "#aba08c", "#85705d", "#9a8267", "#8a8379", "#7d4a39")
ROOFS = ("#6d3d2a", "#5b4a42", "#4a4744", "#7a4a34", "#54504c")


class _Scenery:
    """Trees, hedges and houses that are collected in any order, and painted from far to near."""

    def __init__(self, canvas: _Canvas) -> None:
        self._canvas = canvas
        self._trees = _Trees(canvas)
        self._items: list[tuple[float, Callable[[], None]]] = []

    def add_tree(self, place_m: Array, height_m: float, *, sunk: float = 0.0) -> None:
        """A tree, or a bush if a share of its height is sunk."""
        distance_m = float(np.hypot(*place_m))
        azimuth = float(np.arctan2(place_m[1], place_m[0]))
        lowered_m = _below_sun(self._canvas, place_m, height_m) if sunk == 0 else height_m
        self._items.append((distance_m, partial(self._trees.paint, azimuth, distance_m, lowered_m, sunk=sunk)))

    def add_hedge(self, start_m: Array, along: Array, length_m: float) -> None:
        """Bushes in a row."""
        for step_m in np.arange(0, length_m, 1.1):
            height_m = float(self._canvas.rng.uniform(2.6, 3.4))
            self.add_tree(start_m + step_m * along, height_m, sunk=0.5)

    def add_house(self, place_m: Array, yaw_rad: float) -> None:
        """A house with a pitched roof."""
        house = _house(self._canvas, place_m, yaw_rad)
        self._items.append((house.distance_m, partial(_paint_building, self._canvas, house)))

    def paint(self) -> None:
        """Paint all that was added."""
        for _, paint in sorted(self._items, key=lambda item: -item[0]):
            paint()


def _house(canvas: _Canvas, middle_m: Array, yaw_rad: float) -> _Building:
    rng = canvas.rng
    facade = _Facade(
        wall=_one(rng, HOUSE_WALLS),
        trim=_srgb("#b9b4a8"),
        storey_m=2.8,
        bay_m=float(rng.uniform(2.4, 3.2)),
        window_m=float(rng.uniform(1.1, 1.5)),
        sill_m=0.9,
        head_m=2.25,
        lit_share=0.45,
    )
    storeys = 2 if rng.random() < 0.6 else 1
    height_m = _below_sun(canvas, middle_m, 2.9 * storeys)
    half_m = (float(rng.uniform(4.5, 6.5)), float(rng.uniform(3.8, 4.6)))
    place = (float(middle_m[0]), float(middle_m[1]))
    return _Building(place, half_m, yaw_rad, height_m, facade, float(rng.uniform(2.4, 3.6)), _one(rng, ROOFS))


def _paint_suburb(canvas: _Canvas) -> None:
    """Houses with gardens and trees on streets around the scene."""
    near_m = canvas.around.distance_m
    _paint_hills(canvas, rise=0.05, distance_m=7000, albedo=(0.05, 0.075, 0.04))
    _paint_hills(canvas, rise=0.022, distance_m=2500, albedo=(0.045, 0.07, 0.03))
    x_m, y_m, footprint_m = _ground_places(canvas)
    across_m = np.maximum(np.abs(x_m), np.abs(y_m))
    road_m = near_m - 9
    is_road = np.abs(across_m - road_m) < 2.8
    is_path = np.abs(np.abs(across_m - road_m) - 3.7) < 0.9
    lawn = np.exp(canvas.grown(x_m, y_m, footprint_m))[..., None] * np.array(LAWN, np.float32)
    albedo = lawn
    albedo[is_path] = PAVING
    albedo[is_road] = ASPHALT
    _paint_ground(canvas, albedo)

    scenery = _Scenery(canvas)
    for ring in range(4):
        for side in range(4):
            _add_row_of_houses(canvas, scenery, ring, side)
    for _ in range(260):
        place_m = _somewhere(canvas.rng, near_m + 130, 600)
        scenery.add_tree(place_m, float(canvas.rng.uniform(8, 16)))
    scenery.paint()


def _add_row_of_houses(canvas: _Canvas, scenery: _Scenery, ring: int, side: int) -> None:
    """Houses along one side of a square around the scene, with hedges and trees between them."""
    rng = canvas.rng
    near_m = canvas.around.distance_m
    reach_m = near_m + 6 + 32 * ring
    outward = np.array(COMPASS[side], float)
    along = np.array([-outward[1], outward[0]])
    for along_m in np.arange(-reach_m, reach_m, 17.0):
        shift_m = along_m + rng.uniform(-2, 2)
        if rng.random() < 0.85:
            scenery.add_house(outward * reach_m + along * shift_m, np.pi / 2 * (side + 1) + rng.normal(0, 0.04))
        if ring < 2 and rng.random() < 0.6:
            start_m = outward * (reach_m - 7.5) + along * (shift_m - 7)
            scenery.add_hedge(start_m, along, float(rng.uniform(5, 11)))
        for _ in range(4):
            garden_m = outward * (reach_m + rng.uniform(-8, 14)) + along * (shift_m + rng.uniform(6, 11))
            if float(np.hypot(*garden_m)) > near_m - 4:
                scenery.add_tree(garden_m, float(rng.uniform(3.5, 9.5)))


def _somewhere(rng: Rng, nearest_m: float, farthest_m: float) -> Array:
    """A place (2,) in any direction between two distances."""
    turn = rng.uniform(-np.pi, np.pi)
    return rng.uniform(nearest_m, farthest_m) * np.array([np.cos(turn), np.sin(turn)])


# Country

FIELDS = np.array(
    [[0.1, 0.12, 0.04], [0.16, 0.15, 0.06], [0.075, 0.1, 0.035], [0.22, 0.19, 0.1], [0.13, 0.1, 0.07]], np.float32
)


def _paint_country(canvas: _Canvas) -> None:
    """Fields with hedges and woods before hills, and a few farms."""
    rng = canvas.rng
    near_m = canvas.around.distance_m
    _paint_hills(canvas, rise=0.075, distance_m=11000, albedo=(0.05, 0.07, 0.05))
    _paint_hills(canvas, rise=0.045, distance_m=5000, albedo=(0.06, 0.085, 0.04))
    x_m, y_m, footprint_m = _ground_places(canvas)
    warp = 8 * canvas.grained(x_m / 900, y_m / 900)
    turn = 0.4
    u = np.floor((x_m * np.cos(turn) + y_m * np.sin(turn) + warp) / 95).astype(np.int32)
    v = np.floor((y_m * np.cos(turn) - x_m * np.sin(turn)) / 140).astype(np.int32)
    choice = rng.integers(len(FIELDS), size=(64, 64))
    field = FIELDS[choice[u % 64, v % 64]]
    meadow = np.hypot(x_m, y_m) < near_m + 20
    field = np.where(meadow[..., None], np.array(LAWN, np.float32), field)
    mean = FIELDS.mean(0)
    fine = np.clip(60 / footprint_m - 0.5, 0, 1)[..., None]
    texture = np.exp(canvas.grown(x_m, y_m, footprint_m))[..., None]
    _paint_ground(canvas, (texture * (mean + fine * (field - mean))).astype(np.float32))

    scenery = _Scenery(canvas)
    for _ in range(34):
        _add_row_of_trees(canvas, scenery)
    for _ in range(40):
        scenery.add_tree(_somewhere(rng, near_m, near_m + 70), float(rng.uniform(7, 14)))
    for _ in range(6):
        scenery.add_house(_somewhere(rng, near_m + 60, 350), rng.uniform(0, np.pi))
    scenery.paint()


def _add_row_of_trees(canvas: _Canvas, scenery: _Scenery) -> None:
    """Trees along the edge of a field, more or less across the direction of sight."""
    rng = canvas.rng
    near_m = canvas.around.distance_m
    start_m = _somewhere(rng, near_m + 25, 600)
    heading = np.arctan2(start_m[1], start_m[0]) + np.pi / 2 + rng.normal(0, 0.35)
    along = np.array([np.cos(heading), np.sin(heading)])
    for step_m in np.arange(0, rng.uniform(60, 220), rng.uniform(3.5, 8)):
        place_m = start_m + along * step_m + rng.normal(0, 1.5, 2)
        if float(np.hypot(*place_m)) > near_m:
            scenery.add_tree(place_m, float(rng.uniform(5, 15)))


PAINTERS: dict[str, Callable[[_Canvas], None]] = {
    "city": _paint_city,
    "suburb": _paint_suburb,
    "country": _paint_country,
}
