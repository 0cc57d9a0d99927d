"""The sky as emitters: behind each pane that shows it, and where no pane covers it."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy

from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Floats
from vobench.rendering.cosine_sampling import cosine_weighted
from vobench.rendering.emitter import Aim, Emitter, Occluder, sphere_width_rad
from vobench.rendering.geometry import (
    FAR_M,
    RAY_OFFSET_M,
    BoundingSphere,
    bounding_sphere,
    lengths,
    sample_points,
)
from vobench.rendering.planar_patch import PlanarPatch
from vobench.rendering.solid_angle import Rectangle, SeenRectangle, SolidAngle, rectangle
from vobench.rendering.texel import Texels
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sky
from vobench.scene.material import fresnel


@dataclass(frozen=True, slots=True, eq=False)
class SkyPane(Emitter):
    """The sky through one pane. Rays that cross another such pane behind it do not count, so that none counts twice."""

    sky: ClassVar[str] = "pane"
    light: Sky
    pane: PlanarPatch
    visibility: Visibility
    ball: BoundingSphere
    face: Rectangle | None

    def towards(self, texels: Texels) -> Aim:
        """Places uniform over the solid angle of the pane, or over its area if it is not a rectangle."""
        places = self._places(texels)
        follows = self._followed()

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, steradian = places(a, b)
            direction = vectors_m / lengths(vectors_m)[:, None]
            strength = steradian * self._luminance(texels.points_m + vectors_m, direction, follows)
            return (FAR_M * direction).astype(np.float32), strength.astype(np.float32)

        return aim

    def _luminance(self, places_m: Floats, directions: Floats, follows: tuple[bool, bool]) -> Floats:
        """The luminance (P,) seen through places (P, 3) of the pane, 0 where another pane of the sky follows."""
        luminance = self.light.luminance_cd_m2(directions) * self.visibility.pane_passes(self.pane, directions)
        is_outward = directions @ self.pane.normal > 0
        doubtful = np.flatnonzero(np.where(is_outward, follows[1], follows[0]))
        beyond_m = places_m[doubtful] + 2 * RAY_OFFSET_M * directions[doubtful]
        luminance[doubtful] *= ~self.visibility.crosses_sky_pane(beyond_m, FAR_M * directions[doubtful])
        return luminance

    def width_rad(self, points_m: Floats) -> Floats:
        """The width of its bounding sphere."""
        return sphere_width_rad(self.ball, points_m)

    def passing(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """What passes opaque faces, and the panes in front of this one."""
        share = occluder.clear(origins_m, segments_m).astype(np.float32)
        rays = np.flatnonzero(share)
        start_m = origins_m[rays]
        ahead_m = segments_m[rays]
        reach = -self.pane.height_m(start_m) / (ahead_m @ self.pane.normal)
        short_of_pane = ((1 - 1e-4) * reach[:, None]).astype(np.float32)
        share[rays] *= occluder.through_panes(start_m, ahead_m * short_of_pane)
        return share

    def _places(self, texels: Texels) -> Aim:
        """A function that gives vectors to places on the pane, and the solid angle in sr that each stands for."""
        if self.face is not None:
            angle = SolidAngle(SeenRectangle(self.face, texels.points_m))
            return lambda a, b: (angle.vectors_m(a, b), angle.steradian)
        area_m2 = areas_m2(self.pane.corners_m).sum()

        def by_area(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m = sample_points(self.pane.corners_m, a, b) - texels.points_m
            distance_m = np.maximum(np.linalg.norm(vectors_m, axis=1), 1e-6)
            height_m = np.abs(vectors_m @ self.pane.normal)
            return vectors_m, area_m2 * height_m / distance_m**3

        return by_area

    def _followed(self) -> tuple[bool, bool]:
        """Whether another pane that shows the sky extends behind this one, and whether one extends in front of it."""
        heights_m = [self.pane.height_m(other.corners_m).ravel() for other in self.visibility.sky_panes]
        height_m = np.concatenate(heights_m)
        return bool((height_m < -RAY_OFFSET_M).any()), bool((height_m > RAY_OFFSET_M).any())


@dataclass(frozen=True, slots=True, eq=False)
class OpenSky(Emitter):
    """The sky that no pane covers: rays in the hemisphere above each point. tables: what coats of each index let in."""

    sky: ClassVar[str] = "open"
    light: Sky
    visibility: Visibility
    ball: BoundingSphere
    tables: dict[float, Floats] = field(default_factory=dict, repr=False)

    def towards(self, texels: Texels) -> Aim:
        """Cosine-weighted directions."""
        around = cosine_weighted(texels.normals)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            direction = around(a, b)
            luminance_cd_m2 = self.light.luminance_cd_m2(direction)
            # Divided by the cosine, in proportion to which the directions are sampled.
            cosine = np.einsum("ij,ij->i", direction, texels.normals)
            strength = np.pi * luminance_cd_m2 / np.maximum(cosine, 1e-6)
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """The square root of the solid angle of a hemisphere."""
        return np.full(len(points_m), np.sqrt(2 * np.pi), np.float32)

    def passing(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """What passes opaque faces and panes, without panes that are emitters themselves."""
        share = occluder.passing(origins_m, segments_m)
        rays = np.flatnonzero(share)
        share[rays] *= ~self.visibility.crosses_sky_pane(origins_m[rays], segments_m[rays])
        return share

    def unshadowed_light(self, texels: Texels) -> Floats:
        """By a table of normals; NaN where the normal of the shape is not that of its flat face."""
        light = np.full(len(texels), np.nan, np.float32)
        is_flat = np.einsum("ij,ij->i", texels.normals, texels.planes) > FLAT
        for eta in np.unique(texels.eta):
            rows = np.flatnonzero(is_flat & (texels.eta == eta))
            light[rows] = _read_by_normal(self._table(float(eta)), texels.normals[rows])
        return light

    def _table(self, eta: float) -> Floats:
        """The light by normal that enters a coat of a refractive index, 0 without a coat; computed once."""
        if eta not in self.tables:
            self.tables[eta] = _sky_table(self.light, eta)
        return self.tables[eta]


FLAT = 1 - 1e-5  # cosine of a normal of the shape to that of its face, from which the face alone limits the sky
TABLE_STEPS = 32  # of normals, from pole to pole; twice as many around
SKY_DIRECTIONS = 4096
GOLDEN_RAD = np.pi * (3 - np.sqrt(5))


def _sky_table(sky: Sky, eta: float) -> Floats:
    """Illuminance (TABLE_STEPS + 1, 2 TABLE_STEPS + 1) that enters a face under the whole sky, by its normal."""
    nth = np.arange(SKY_DIRECTIONS)
    height = 1 - (2 * nth + 1) / SKY_DIRECTIONS
    directions = _by_height(height, nth * GOLDEN_RAD)  # Fibonacci's lattice
    sent = sky.luminance_cd_m2(directions) * 4 * np.pi / SKY_DIRECTIONS
    table_normals = _table_directions()
    table = np.empty(table_normals.shape[:2])
    for row, normals in enumerate(table_normals):
        cosine = np.maximum(normals @ directions.T, 0)
        entering = 1 - fresnel(cosine, eta) if eta else 1.0
        table[row] = (cosine * entering * sent).sum(1)
    return table


def _by_height(height: Floats, turn_rad: Floats) -> Floats:
    """Unit vectors (..., 3) by their height and the angle around the vertical (...)."""
    level = np.sqrt(np.maximum(1 - height**2, 0))
    return np.stack([level * np.cos(turn_rad), level * np.sin(turn_rad), height], -1)


def _table_directions() -> Floats:
    """The directions (TABLE_STEPS + 1, 2 TABLE_STEPS + 1, 3) that the entries of a table stand for."""
    tilt_rad = np.linspace(0, np.pi, TABLE_STEPS + 1)
    turn_rad = np.linspace(-np.pi, np.pi, 2 * TABLE_STEPS + 1)
    tilt, turn = np.meshgrid(tilt_rad, turn_rad, indexing="ij")
    return _by_height(np.cos(tilt), turn)


def _read_by_normal(table: Floats, normals: Floats) -> Floats:
    """Values (P,) of a table of tilts and turns at normals (P, 3), interpolated linearly."""
    tilt = np.arccos(np.clip(normals[:, 2], -1, 1)) / np.pi * TABLE_STEPS
    turn = (np.arctan2(normals[:, 1], normals[:, 0]) / np.pi + 1) * TABLE_STEPS
    return np.asarray(scipy.ndimage.map_coordinates(table, [tilt, turn], order=1))


def sky_pane(light: Sky, pane: PlanarPatch, visibility: Visibility) -> SkyPane:
    """The emitter of the sky behind a pane."""
    return SkyPane(light, pane, visibility, bounding_sphere(pane.corners_m), rectangle(pane.corners_m))


def open_sky(light: Sky, visibility: Visibility) -> OpenSky:
    """The emitter of the sky that no pane covers."""
    return OpenSky(light, visibility, BoundingSphere(np.zeros(3), np.inf))
