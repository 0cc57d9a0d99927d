"""The sky as emitters: one for each pane through which it is visible, and one for the sky without panes."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import scipy

from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Floats, Mask
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
from vobench.rendering.shadow_kernels import sum_of_directions
from vobench.rendering.solid_angle import Rectangle, SeenRectangle, SolidAngle, rectangle
from vobench.rendering.texel import Texels
from vobench.rendering.thread_pool import in_chunks
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sky


@dataclass(frozen=True, slots=True, eq=False)
class SkyPane(Emitter):
    """The sky through one pane. Light that also crosses another such pane belongs to the pane that is farther away.

    `face` is the rectangle of the pane, None if it has another shape.
    `reaches_front` and `reaches_back` are whether its light reaches the side of its normal, and the other side.
    """

    sky: ClassVar[str] = "pane"
    light: Sky
    pane: PlanarPatch
    visibility: Visibility
    ball: BoundingSphere
    face: Rectangle | None
    reaches_front: bool
    reaches_back: bool

    def may_reach(self, points_m: Floats) -> Mask:
        """Whether the sky is visible on the side of the pane that is opposite to each point (P, 3)."""
        is_in_front = self.pane.height_m(points_m) > 0
        return np.where(is_in_front, self.reaches_front, self.reaches_back)

    def towards(self, texels: Texels) -> Aim:
        """Places that are uniform over the solid angle of the pane, or over its area if it is not a rectangle."""
        places = self._places(texels)
        has_pane_behind, has_pane_in_front = self._other_panes()

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, steradian = places(a, b)
            direction = vectors_m / lengths(vectors_m)[:, None]
            is_to_front = direction @ self.pane.normal > 0
            may_cross_other = np.where(is_to_front, has_pane_in_front, has_pane_behind)
            luminance_cd_m2 = self._luminance_cd_m2(texels.points_m + vectors_m, direction, may_cross_other)
            strength = steradian * luminance_cd_m2
            return (FAR_M * direction).astype(np.float32), strength.astype(np.float32)

        return aim

    def _luminance_cd_m2(self, places_m: Floats, directions: Floats, may_cross_other: Mask) -> Floats:
        """The luminance (P,) of the sky through places (P, 3) of the pane; 0 if another such pane is beyond it.

        Only rays that may cross another pane (P,) are tested for it.
        """
        transmitted = self.visibility.pane_transmittance(self.pane, directions)
        luminance_cd_m2 = self.light.luminance_cd_m2(directions) * transmitted
        rows = np.flatnonzero(may_cross_other)
        beyond_m = places_m[rows] + 2 * RAY_OFFSET_M * directions[rows]
        luminance_cd_m2[rows] *= ~self.visibility.crosses_sky_pane(beyond_m, FAR_M * directions[rows])
        return luminance_cd_m2

    def width_rad(self, points_m: Floats) -> Floats:
        """The width of its bounding sphere."""
        return sphere_width_rad(self.ball, points_m)

    def transmittance(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) between the points and this pane. It is 0 behind an opaque face.

        The transmittance of this pane is not included, because it is a part of the strength of the emitter.
        """
        transmittance = occluder.is_unoccluded(origins_m, segments_m).astype(np.float32)
        rays = np.flatnonzero(transmittance)
        start_m = origins_m[rays]
        ray_m = segments_m[rays]
        pane_at = -self.pane.height_m(start_m) / (ray_m @ self.pane.normal)  # in lengths of the segment
        before_pane = ((1 - 1e-4) * pane_at[:, None]).astype(np.float32)
        transmittance[rays] *= occluder.transmittance_of_panes(start_m, ray_m * before_pane)
        return transmittance

    def _places(self, texels: Texels) -> Aim:
        """A function that returns vectors to places on the pane, and the solid angle in sr that each represents."""
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

    def _other_panes(self) -> tuple[bool, bool]:
        """Whether another pane that shows the sky extends behind this one, and whether one extends in front of it."""
        heights_m = [self.pane.height_m(other.corners_m).ravel() for other in self.visibility.sky_panes]
        height_m = np.concatenate(heights_m)
        has_pane_behind = bool((height_m < -RAY_OFFSET_M).any())
        has_pane_in_front = bool((height_m > RAY_OFFSET_M).any())
        return has_pane_behind, has_pane_in_front


@dataclass(frozen=True, slots=True, eq=False)
class OpenSky(Emitter):
    """The sky without panes, sampled in the hemisphere above each point.

    `tables` are the tables of `_sky_table` by the refractive index of the coat; they are computed when they are needed.
    """

    sky: ClassVar[str] = "open"
    light: Sky
    visibility: Visibility
    ball: BoundingSphere
    tables: dict[float, Floats] = field(default_factory=dict, repr=False)

    def towards(self, texels: Texels) -> Aim:
        """Cosine-distributed directions."""
        around = cosine_weighted(texels.normals)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            direction = around(a, b)
            luminance_cd_m2 = self.light.luminance_cd_m2(direction)
            # The strength is divided by the cosine, because the directions are sampled in proportion to it.
            cosine = np.einsum("ij,ij->i", direction, texels.normals)
            strength = np.pi * luminance_cd_m2 / np.maximum(cosine, 1e-6)
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """The square root of the solid angle of a hemisphere."""
        return np.full(len(points_m), np.sqrt(2 * np.pi), np.float32)

    def transmittance(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """The transmittance (R,) of faces and panes. It is 0 through panes that are emitters themselves."""
        transmittance = occluder.transmittance(origins_m, segments_m)
        rays = np.flatnonzero(transmittance)
        transmittance[rays] *= ~self.visibility.crosses_sky_pane(origins_m[rays], segments_m[rays])
        return transmittance

    def unshadowed_light(self, texels: Texels) -> Floats:
        """The illuminance (P,), read from a table by the normal; NaN where the normal is not that of the flat face."""
        light = np.full(len(texels), np.nan, np.float32)
        is_flat = np.einsum("ij,ij->i", texels.normals, texels.planes) > FLAT
        for eta in np.unique(texels.eta):
            rows = np.flatnonzero(is_flat & (texels.eta == eta))
            light[rows] = _read_by_normal(self._table(float(eta)), texels.normals[rows])
        return light

    def _table(self, eta: float) -> Floats:
        """The table of `_sky_table` for a refractive index, which is computed once."""
        if eta not in self.tables:
            self.tables[eta] = _sky_table(self.light, eta)
        return self.tables[eta]


FLAT = 1 - 1e-5  # the smallest cosine of a normal to that of its flat face, for which the table is valid
TABLE_STEPS = 32  # the number of steps of the tilt in the table; the angle around the vertical has twice as many
SKY_DIRECTIONS = 4096  # the number of directions over which the light of the sky is summed
GOLDEN_RAD = np.pi * (3 - np.sqrt(5))


def _sky_table(sky: Sky, eta: float) -> Floats:
    """The illuminance (TABLE_STEPS + 1, 2 TABLE_STEPS + 1) of faces by the whole sky, by their normals.

    Under a coat, it is the light that enters the coat. `eta` is the refractive index of the coat, 0 without a coat.
    """
    number = np.arange(SKY_DIRECTIONS)
    height = 1 - (2 * number + 1) / SKY_DIRECTIONS
    directions = _by_height(height, number * GOLDEN_RAD)  # a Fibonacci lattice
    sent = sky.luminance_cd_m2(directions) * 4 * np.pi / SKY_DIRECTIONS
    table_normals = _table_directions()
    table = np.empty(table_normals.shape[:2])

    def fill(part: slice) -> None:
        normals = table_normals[part].reshape(-1, 3)
        light = np.empty(len(normals))
        sum_of_directions(normals, directions, sent, eta, light)
        table[part] = light.reshape(table[part].shape)

    in_chunks(fill, len(table), chunk=1)
    return table


def _by_height(height: Floats, turn_rad: Floats) -> Floats:
    """The unit vectors (..., 3) with a height (...) and an angle (...) around the vertical."""
    level = np.sqrt(np.maximum(1 - height**2, 0))
    return np.stack([level * np.cos(turn_rad), level * np.sin(turn_rad), height], -1)


def _table_directions() -> Floats:
    """The normals (TABLE_STEPS + 1, 2 TABLE_STEPS + 1, 3) of the entries of a table."""
    tilt_rad = np.linspace(0, np.pi, TABLE_STEPS + 1)
    turn_rad = np.linspace(-np.pi, np.pi, 2 * TABLE_STEPS + 1)
    tilt, turn = np.meshgrid(tilt_rad, turn_rad, indexing="ij")
    return _by_height(np.cos(tilt), turn)


def _read_by_normal(table: Floats, normals: Floats) -> Floats:
    """The values (P,) of a table at normals (P, 3), interpolated linearly."""
    tilt = np.arccos(np.clip(normals[:, 2], -1, 1)) / np.pi * TABLE_STEPS
    turn = (np.arctan2(normals[:, 1], normals[:, 0]) / np.pi + 1) * TABLE_STEPS
    return np.asarray(scipy.ndimage.map_coordinates(table, [tilt, turn], order=1))


def sky_pane(light: Sky, pane: PlanarPatch, visibility: Visibility) -> SkyPane:
    """The emitter of the sky behind a pane."""
    is_sky_in_front, is_sky_behind = visibility.sky_sides(pane)
    return SkyPane(
        light,
        pane,
        visibility,
        ball=bounding_sphere(pane.corners_m),
        face=rectangle(pane.corners_m),
        reaches_front=is_sky_behind,
        reaches_back=is_sky_in_front,
    )


def open_sky(light: Sky, visibility: Visibility) -> OpenSky:
    """The emitter of the sky without panes."""
    return OpenSky(light, visibility, BoundingSphere(np.zeros(3), np.inf))
