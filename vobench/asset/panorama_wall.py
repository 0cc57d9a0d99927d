"""Walls of distant buildings as a panorama shows them: masonry, windows, shops, and panes that are lit at night."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vobench.asset.panorama_canvas import COLUMNS, Albedo, Columns, PanoramaCanvas, azimuths, reflected_cd_m2
from vobench.asset.panorama_noise import Floats
from vobench.geometry.se3 import Array

# Where a wall is seen at a flatter angle than this, it is left out unless it is far off.
LEAST_SLOPE = 0.05  # the eye's distance from the plane of the wall, by the wall's length
LEAST_OFFSET_M = 0.5  # the same, in metres
LEAST_COSINE = 0.02  # between the direction of view and the normal, so that distances stay finite

# Masonry
FOOT_TONE = 0.82  # walls are darker near the ground
FOOT_HEIGHT_M = 4.0
STAIN_CONTRAST = 0.06  # of the logarithm of the luminance
BAND_M = 0.16
BAND_OPACITY = 0.35
CORNICE_M = 0.35

# Windows and shops
EAVES_M = 0.3  # below the eaves, no window
FRAME_M = 0.12
SILL_M = 0.16
MULLION_HALF_M = 0.04
MULLION_OPACITY = 0.8
SHOP_MARGIN_M = 0.35
SHOP_SILL_M = 0.45
SHOP_LINTEL_M = 0.75  # below the first storey's top; the sign is above it
SIGN_M = (0.7, 0.1)  # the sign's lower and upper edge below the first storey's top

# Panes mirror a share of the sky behind the viewer: the least, and how much more others mirror.
PANE_MIRRORED = 0.05
PANE_MIRRORED_RANGE = 0.16
BLIND_SHARE = 0.3  # of the windows
BLIND_ALBEDO: Albedo = (0.3, 0.29, 0.26)
LIT_SHOPS = 0.7
LIT_CD_M2 = 8  # of a lit window at least
LIT_RANGE_CD_M2 = 30
BLIND_DIMMING = 0.6


@dataclass(frozen=True, slots=True)
class DistantFacade:
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
class SeenWall:
    """One upright rectangle as it is seen: for each of its columns (C,), the distance and the place along it.

    along_m (C,): from the end on the left, as seen from the middle of the map. along_step_m: what a column covers.
    """

    columns: Columns
    distance_m: Floats
    along_m: Floats
    along_step_m: Floats
    length_m: float
    normal_azimuth: float

    @property
    def mean_distance_m(self) -> float:
        """The mean distance over its columns."""
        return float(self.distance_m.mean())


def seen_wall(canvas: PanoramaCanvas, first_m: Array, second_m: Array) -> SeenWall | None:
    """The wall between two corners of a building, None where its front is turned away."""
    edge_m = second_m - first_m
    length_m = float(np.hypot(*edge_m))
    along = edge_m / length_m
    normal = np.array([along[1], -along[0]])
    offset_m = float(-(first_m @ normal))  # of the eye before the wall
    if offset_m < LEAST_SLOPE * length_m and offset_m < LEAST_OFFSET_M:
        return None

    columns = _columns_between(canvas, first_m, second_m)
    azimuth = azimuths(columns)
    cosine = -(np.cos(azimuth) * normal[0] + np.sin(azimuth) * normal[1])
    cosine = np.maximum(cosine, LEAST_COSINE)
    distance_m = offset_m / cosine
    along_m = (np.cos(azimuth) * along[0] + np.sin(azimuth) * along[1]) * distance_m - first_m @ along
    step_m = distance_m / cosine * (2 * np.pi / COLUMNS)
    return SeenWall(
        columns=columns,
        distance_m=distance_m.astype(np.float32),
        along_m=along_m.astype(np.float32),
        along_step_m=step_m.astype(np.float32),
        length_m=length_m,
        normal_azimuth=float(np.arctan2(normal[1], normal[0])),
    )


def _columns_between(canvas: PanoramaCanvas, first_m: Array, second_m: Array) -> Columns:
    """The columns between two places (2,), by the shorter arc."""
    first_azimuth = float(np.arctan2(first_m[1], first_m[0]))
    arc = float(np.arctan2(second_m[1], second_m[0])) - first_azimuth
    arc = (arc + np.pi) % (2 * np.pi) - np.pi
    low = min(first_azimuth, first_azimuth + arc)
    return canvas.columns(low, low + abs(arc))


def coverage(values: Floats, low: ArrayLike, high: ArrayLike, step: Floats) -> Floats:
    """How much (...) of pixels as wide as `step` lies between two values."""
    above_low = np.clip((values - low) / step + 0.5, 0, 1)
    below_high = np.clip((high - values) / step + 0.5, 0, 1)
    return np.asarray(above_low * below_high)


class WallPatch:
    """The pixels (r, c) of a wall, each of which is `height_m` above the ground and `along_m` from the wall's end.

    eaves_m: the height of the building at its eaves. texture_offset: so that no two buildings have the same stains.
    """

    def __init__(
        self,
        canvas: PanoramaCanvas,
        wall: SeenWall,
        facade: DistantFacade,
        rows: slice,
        *,
        eaves_m: float,
        texture_offset: float,
    ) -> None:
        self._canvas = canvas
        self._wall = wall
        self._facade = facade
        self._eaves_m = eaves_m
        self._texture_offset = texture_offset
        self._light_lx = canvas.daylight.upright_lx(wall.normal_azimuth)

        distance_m = wall.distance_m[None, :]
        self.height_m = canvas.eye_m + canvas.tangent[rows, None] * distance_m
        self._height_step_m = canvas.tangent_step[rows, None] * distance_m
        self._along_m = wall.along_m[None, :]
        self._along_step_m = wall.along_step_m[None, :]

        # The wall is divided into whole bays and storeys. Each pixel has the indices of its bay and of its storey, and
        # its place within them.
        self._bays = max(int(wall.length_m / facade.bay_m), 1)
        self._storeys = max(int(eaves_m / facade.storey_m + 0.2), 1)
        self._bay_m = wall.length_m / self._bays
        bay = (self._along_m / self._bay_m).astype(np.int32)
        storey = (self.height_m / facade.storey_m).astype(np.int32)
        self._bay = np.clip(bay, 0, self._bays - 1)
        self._storey = np.clip(storey, 0, self._storeys - 1)
        self._in_bay_m = self._along_m - self._bay * self._bay_m
        self._in_storey_m = self.height_m - self._storey * facade.storey_m

    def _in_width(self, values_m: Floats, low_m: float, high_m: float) -> Floats:
        return coverage(values_m, low_m, high_m, self._along_step_m)

    def _in_height(self, values_m: Floats, low_m: ArrayLike, high_m: ArrayLike) -> Floats:
        return coverage(values_m, low_m, high_m, self._height_step_m)

    def cover(self, gable_m: float) -> Floats:
        """How much of each pixel the wall covers, whose middle is higher than its ends by gable_m."""
        length_m = self._wall.length_m
        to_end_m = np.minimum(self._along_m, length_m - self._along_m)
        gable_slope = 2 * gable_m / length_m
        top_m = self._eaves_m + gable_slope * np.maximum(to_end_m, 0)
        height = self._in_height(self.height_m, 0, top_m)

        # Half a pixel wider, so that nothing shines through between walls that touch.
        half_step_m = self._along_step_m / 2
        width = coverage(self._along_m, -half_step_m, length_m + half_step_m, self._along_step_m)
        return np.asarray(height * width)

    def masonry(self, *, has_bands: bool) -> Floats:
        """Luminance (r, c, 3) of the wall without its windows, perhaps with a band at each storey and a cornice."""
        facade = self._facade
        stains = self._canvas.grain(self._along_m / 23 + self._texture_offset, self.height_m / 31)
        height_share = np.clip(self.height_m / FOOT_HEIGHT_M, 0, 1)
        tone = (FOOT_TONE + 0.18 * height_share) * np.exp(STAIN_CONTRAST * stains)
        colour = tone[..., None] * reflected_cd_m2(facade.wall, self._light_lx)
        if has_bands:
            bands = BAND_OPACITY * self._in_height(self.height_m % facade.storey_m, 0.0, BAND_M)
            cornice = self._in_height(self.height_m, self._eaves_m - CORNICE_M, self._eaves_m)
            self._add_trim(colour, np.maximum(bands, cornice))
        return np.asarray(colour)

    def _add_trim(self, colour: Floats, cover: Floats) -> None:
        trim_cd_m2 = reflected_cd_m2(self._facade.trim, self._light_lx)
        colour += cover[..., None] * (trim_cd_m2 - colour)

    def add_windows(self, colour: Floats) -> Floats:
        """Add the windows to a wall (r, c, 3), and return the luminance (r, c) of those that are lit at night."""
        panes, frames = self._windows()
        if self._facade.has_shops:
            is_shop = self._storey == 0
            shop_panes, signs = self._shops()
            panes = np.where(is_shop, shop_panes, panes)
            frames = np.where(is_shop, signs, frames)

        is_below_eaves = self.height_m < self._eaves_m - EAVES_M
        self._add_trim(colour, frames * is_below_eaves)
        middle_m = self._bay_m / 2
        mullion = self._in_width(self._in_bay_m, middle_m - MULLION_HALF_M, middle_m + MULLION_HALF_M)
        return self._add_panes(colour, panes * is_below_eaves * (1 - MULLION_OPACITY * mullion))

    def _windows(self) -> tuple[Floats, Floats]:
        """How much of each pixel is pane, and how much is frame or pane."""
        facade = self._facade
        left_m = (self._bay_m - facade.window_m) / 2
        right_m = left_m + facade.window_m
        width = self._in_width(self._in_bay_m, left_m, right_m)
        height = self._in_height(self._in_storey_m, facade.sill_m, facade.head_m)
        frame_width = self._in_width(self._in_bay_m, left_m - FRAME_M, right_m + FRAME_M)
        frame_height = self._in_height(self._in_storey_m, facade.sill_m - SILL_M, facade.head_m + FRAME_M)
        return width * height, frame_width * frame_height

    def _shops(self) -> tuple[Floats, Floats]:
        """How much of each pixel is shop window, two bays wide, and how much is the sign above."""
        storey_m = self._facade.storey_m
        shop_m = 2 * self._bay_m
        width = self._in_width(self._along_m % shop_m, SHOP_MARGIN_M, shop_m - SHOP_MARGIN_M)
        height = self._in_height(self.height_m, SHOP_SILL_M, storey_m - SHOP_LINTEL_M)
        sign_low_m, sign_high_m = SIGN_M
        sign = self._in_height(self.height_m, storey_m - sign_low_m, storey_m - sign_high_m)
        return width * height, sign

    def _add_panes(self, colour: Floats, panes: Floats) -> Floats:
        """Add panes, which mirror the sky and show a dark room or a blind. Returns the same as `add_windows`."""
        facade = self._facade
        rng = self._canvas.rng
        size = (self._storeys, self._bays)
        window = (self._storey, self._bay)  # of each pixel

        depth = rng.random(size).astype(np.float32)
        has_blind = rng.random(size) < BLIND_SHARE
        blind_bottom_m = facade.head_m - depth * (facade.head_m - facade.sill_m)
        is_blind = has_blind[window] & (self._in_storey_m > blind_bottom_m[window])
        blind = is_blind.astype(np.float32)
        blind_cd_m2 = reflected_cd_m2(BLIND_ALBEDO, self._light_lx)

        mirrored = PANE_MIRRORED + PANE_MIRRORED_RANGE * depth[window]
        pane_cd_m2 = mirrored[..., None] * self._canvas.daylight.sky_cd_m2(self._wall.normal_azimuth)
        pane_cd_m2 = pane_cd_m2 + blind[..., None] * (blind_cd_m2 - pane_cd_m2)
        colour += panes[..., None] * (pane_cd_m2 - colour)

        is_lit = rng.random(size) < facade.lit_share
        if facade.has_shops:
            is_lit[0] = rng.random(self._bays) < LIT_SHOPS
        lit_cd_m2 = np.where(is_lit, LIT_CD_M2 + LIT_RANGE_CD_M2 * depth, 0).astype(np.float32)
        return np.asarray(panes * lit_cd_m2[window] * (1 - BLIND_DIMMING * blind))
