"""Emitters: for a point and two random numbers, in which direction an emitter lies and how bright it is there."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np
import scipy

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.rendering.array_types import Floats, Mask
from vobench.rendering.geometry import (
    FAR_M,
    RAY_OFFSET_M,
    BoundingSphere,
    PlanarPatch,
    bounding_sphere,
    lengths,
    sample_points,
    tangents,
)
from vobench.rendering.shadow_kernels import CURVE_BITS, aim_at_area, aim_at_triangles
from vobench.rendering.solid_angle import Rectangle, SeenRectangle, SolidAngle, rectangle
from vobench.rendering.texel import Texels
from vobench.rendering.visibility import Visibility
from vobench.scene.light import SUN_RADIUS_RAD, AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import fresnel
from vobench.scene.mesh import face_corners


class Occluder(Protocol):
    """Whatever may stand between points and an emitter; rays run from origins to origins + segments (R, 3)."""

    def clear(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether nothing opaque is there."""

    def passing(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) of light that passes what is there."""

    def through_panes(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) that all panes there let through."""


Aim = Callable[[Floats, Floats], tuple[Floats, Floats]]


class Emitter(ABC):
    """One thing that shines. `ball` encloses it, of infinite radius where it is all around.

    sky: "pane" for the sky behind a pane, "open" for the sky that no pane covers, else empty.
    """

    __slots__ = ()
    sky: ClassVar[str] = ""
    ball: BoundingSphere

    @property
    def open_side(self) -> int:
        """How many places along a side are needed at least where its light without shadows is sampled."""
        return 1

    @property
    def is_hard(self) -> bool:
        """Whether it is so narrow that one ray tells whether a point sees it."""
        return False

    @abstractmethod
    def towards(self, texels: Texels) -> Aim:
        """For two random numbers (P,) each: vectors (P, 3) to places on it, and illuminance (P,) square to them."""

    @abstractmethod
    def width_rad(self, points_m: Floats) -> Floats:
        """Roughly how wide it is (P,) seen from points (P, 3); 0 for hard shadows."""

    def passing(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) of light that comes from origins + segments (R, 3), of what `towards` does not count."""
        return occluder.passing(origins_m, segments_m)

    def may_light(self, points_m: Floats) -> Mask:
        """The points (P, 3) that any of its light can reach, as far as that is known without rays."""
        return np.ones(len(points_m), bool)

    def open_light(self, texels: Texels) -> Floats:
        """Illuminance (P,) that enters if nothing hides it; NaN where only sampling tells."""
        return np.full(len(texels), np.nan, np.float32)


NEAR = 2.0  # radii of a rectangle, within which rays spread over its area would be too uneven
ENTERING_SIDE = 2  # along a side, places of a panel that tell how much of its light enters a coat


@dataclass(frozen=True, slots=True, eq=False)
class Panel(Emitter):
    """A rectangular lamp, which shines only to its front."""

    light: AreaLight
    face: Rectangle
    ball: BoundingSphere

    def towards(self, texels: Texels) -> Aim:
        """Places spread evenly over its area, from near points over its solid angle."""
        distances_m = lengths(texels.points_m - self.ball.centre_m.astype(np.float32))
        near = np.flatnonzero(distances_m < NEAR * self.ball.radius_m)
        from_afar = self._by_area(texels)
        if not len(near):
            return from_afar
        from_near = self._by_solid_angle(texels.take(near))

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, strength = from_afar(a, b)
            vectors_m[near], strength[near] = from_near(a[near], b[near])
            return vectors_m, strength

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """As wide as a sphere around it, at most."""
        return _width_rad(self.ball, points_m)

    def open_light(self, texels: Texels) -> Floats:
        """By Lambert's formula; NaN where the horizon of a curved shape cuts the panel."""
        seen = SeenRectangle(self.face, texels.points_m)
        projected_sr = seen.projected_sr(texels.normals, texels.planes)
        arriving_lx = self.light.luminance_cd_m2 * projected_sr
        light = np.where(seen.is_before, arriving_lx, 0).astype(np.float32)
        coated = np.flatnonzero((texels.eta > 0) & (light > 0))
        light[coated] *= self._entering(texels.take(coated))
        return light

    def _entering(self, texels: Texels) -> Floats:
        """Share (P,) of its light that passes the points' coats."""
        aim = self.towards(texels)
        arriving = np.zeros(len(texels), np.float32)
        entering = np.zeros(len(texels), np.float32)
        for column, row in np.ndindex(ENTERING_SIDE, ENTERING_SIDE):
            a = np.full(len(texels), (column + 0.5) / ENTERING_SIDE, np.float32)
            b = np.full(len(texels), (row + 0.5) / ENTERING_SIDE, np.float32)
            vectors_m, strength = aim(a, b)
            cosine = texels.cosine(vectors_m)
            arriving += strength * cosine
            entering += strength * cosine * texels.entering(cosine)
        return entering / np.maximum(arriving, np.float32(1e-30))

    def _by_solid_angle(self, texels: Texels) -> Aim:
        seen = SeenRectangle(self.face, texels.points_m)
        angle = SolidAngle(seen)
        arriving_lx = self.light.luminance_cd_m2 * angle.steradian
        strength = np.where(seen.is_before, arriving_lx, 0).astype(np.float32)
        lift_m = (RAY_OFFSET_M * self.face.normal).astype(np.float32)
        return lambda a, b: (angle.vectors_m(a, b) + lift_m, strength)

    def _by_area(self, texels: Texels) -> Aim:
        face = self.face
        area_m2 = np.linalg.norm(face.edge_u_m) * np.linalg.norm(face.edge_v_m)
        intensity_cd = float(self.light.luminance_cd_m2 * area_m2)  # straight ahead
        lifted_m = face.corner_m + RAY_OFFSET_M * face.normal
        panel = (lifted_m, face.edge_u_m, face.edge_v_m, face.normal, intensity_cd)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m = np.empty((len(texels), 3), np.float32)
            strength = np.empty(len(texels), np.float32)
            aim_at_area(texels.points_m, *panel, a, b, vectors_m, strength)
            return vectors_m, strength

        return aim


@dataclass(frozen=True, slots=True, eq=False)
class MeshPanel(Emitter):
    """A lamp of any shape, whose triangles (K, 3, 3) shine only to their front; near ones are near in their order."""

    light: AreaLight
    corners_m: Array
    ball: BoundingSphere

    @property
    def open_side(self) -> int:
        """As many as the shape of a mesh takes."""
        return 8

    def towards(self, texels: Texels) -> Aim:
        """Places on triangles in proportion to their areas."""
        normals = face_normals(self.corners_m)
        lifted_m = self.corners_m + RAY_OFFSET_M * normals[:, None]
        ends_m2 = np.cumsum(areas_m2(self.corners_m))
        mesh = (lifted_m, normals, ends_m2, float(self.light.luminance_cd_m2))

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m = np.empty((len(texels), 3), np.float32)
            strength = np.empty(len(texels), np.float32)
            aim_at_triangles(texels.points_m, *mesh, a, b, vectors_m, strength)
            return vectors_m, strength

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """As wide as a sphere around it, at most."""
        return _width_rad(self.ball, points_m)


def panel_emitter(light: AreaLight) -> Panel | MeshPanel:
    """A lamp's faces: as a rectangle if they fill one, or as a mesh."""
    corners_m = face_corners(light.mesh)
    ball = bounding_sphere(corners_m)
    face = rectangle(corners_m)
    if face is not None:
        return Panel(light, face, ball)
    # In an order in which near triangles are near to one another (Morton).
    shares = (corners_m.mean(1) - ball.centre_m) / ball.radius_m / 2 + 0.5
    along_curve = _interleaved(np.clip(shares, 0, 1 - 1e-6))
    order = np.argsort(along_curve, kind="stable")
    return MeshPanel(light, corners_m[order], ball)


def _interleaved(shares: Floats) -> Floats:
    """Numbers (N,) in [0, 1) whose bits are by turns those of shares (N, D) in [0, 1)."""
    rest = shares.astype(float)
    place = 1.0
    total = np.zeros(len(shares))
    for _ in range(CURVE_BITS):
        rest = 2 * rest
        bits = np.floor(rest)
        rest = rest - bits
        for bit in bits.T:
            place /= 2
            total += place * bit
    return total


@dataclass(frozen=True, slots=True, eq=False)
class Bulb(Emitter):
    """A point or spot: inverse square, hard shadows."""

    light: PointLight | SpotLight
    ball: BoundingSphere

    @property
    def is_hard(self) -> bool:
        """True."""
        return True

    def towards(self, texels: Texels) -> Aim:
        """Its place."""
        vectors_m = (self.light.position_m - texels.points_m).astype(np.float32)
        squared_m2 = np.einsum("ij,ij->i", vectors_m, vectors_m)
        from_lamp = -vectors_m / np.sqrt(squared_m2)[:, None]
        strength = (self.light.intensity_cd(from_lamp) / squared_m2).astype(np.float32)
        return lambda _a, _b: (vectors_m, strength)

    def width_rad(self, points_m: Floats) -> Floats:
        """Zero: its shadows are hard."""
        return np.zeros(len(points_m), np.float32)


def bulb_emitter(light: PointLight | SpotLight) -> Bulb:
    """A point or spot where it is."""
    return Bulb(light, BoundingSphere(light.position_m, 0.0))


FARTHEST_M = 1e7  # from there rays are parallel within a scene to a tenth of a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class SunDisc(Emitter):
    """The sun in a direction (3,), so narrow that most points need one ray; rays are spread evenly over its disc."""

    light: Sun
    direction: Array
    ball: BoundingSphere

    @property
    def is_hard(self) -> bool:
        """True."""
        return True

    def towards(self, texels: Texels) -> Aim:
        """Places spread evenly over its disc."""
        u_axis, v_axis = tangents(self.direction[None])
        arriving_lx = self.light.illuminance_lx * np.maximum(texels.normals @ self.direction, 0)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            x, y = disc(a, b)
            x_offset = np.tan(SUN_RADIUS_RAD) * x
            y_offset = np.tan(SUN_RADIUS_RAD) * y
            towards_disc = self.direction + x_offset[:, None] * u_axis + y_offset[:, None] * v_axis
            direction = towards_disc.astype(np.float32)
            # One ray alone must not tell where on the disc it went.
            cosine = np.maximum(texels.cosine(direction), SUN_RADIUS_RAD)
            return FAR_M * direction, arriving_lx / cosine

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """Zero: its shadows are hard."""
        return np.zeros(len(points_m), np.float32)


def sun_emitter(light: Sun, t_ns: float) -> SunDisc:
    """The sun at one instant."""
    direction = light.direction(t_ns)
    return SunDisc(light, direction, BoundingSphere(FARTHEST_M * direction, FARTHEST_M * SUN_RADIUS_RAD))


@dataclass(frozen=True, slots=True, eq=False)
class SkyPane(Emitter):
    """The sky through one pane: only rays that cross no other pane behind it, so that none counts twice."""

    sky: ClassVar[str] = "pane"
    light: Sky
    pane: PlanarPatch
    visibility: Visibility
    ball: BoundingSphere
    face: Rectangle | None

    def towards(self, texels: Texels) -> Aim:
        """Places spread evenly over the pane's solid angle, or over its area where it is no rectangle."""
        places = self._places(texels)
        follows = self._followed()

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, steradian = places(a, b)
            direction = vectors_m / lengths(vectors_m)[:, None]
            strength = steradian * self._luminance(texels.points_m + vectors_m, direction, follows)
            return (FAR_M * direction).astype(np.float32), strength.astype(np.float32)

        return aim

    def _luminance(self, places_m: Floats, directions: Floats, follows: tuple[bool, bool]) -> Floats:
        """What is seen (P,) through places (P, 3) of the pane, nothing where panes of the sky follow."""
        luminance = self.light.luminance_cd_m2(directions) * self.visibility.pane_passes(self.pane, directions)
        is_outward = directions @ self.pane.normal > 0
        doubtful = np.flatnonzero(np.where(is_outward, follows[1], follows[0]))
        beyond_m = places_m[doubtful] + 2 * RAY_OFFSET_M * directions[doubtful]
        luminance[doubtful] *= ~self.visibility.crosses_sky_pane(beyond_m, FAR_M * directions[doubtful])
        return luminance

    def width_rad(self, points_m: Floats) -> Floats:
        """As wide as a sphere around it, at most."""
        return _width_rad(self.ball, points_m)

    def passing(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """Past walls, and through panes before this one."""
        share = occluder.clear(origins_m, segments_m).astype(np.float32)
        rays = np.flatnonzero(share)
        start_m = origins_m[rays]
        ahead_m = segments_m[rays]
        reach = -self.pane.height_m(start_m) / (ahead_m @ self.pane.normal)
        short_of_pane = ((1 - 1e-4) * reach[:, None]).astype(np.float32)
        share[rays] *= occluder.through_panes(start_m, ahead_m * short_of_pane)
        return share

    def _places(self, texels: Texels) -> Aim:
        """Vectors to places on the pane, and the solid angle that each stands for."""
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
        """Whether any other pane that shows the sky reaches to the back of this one, and to its front."""
        heights_m = [self.pane.height_m(other.corners_m).ravel() for other in self.visibility.sky_panes]
        height_m = np.concatenate(heights_m)
        return bool((height_m < -RAY_OFFSET_M).any()), bool((height_m > RAY_OFFSET_M).any())


@dataclass(frozen=True, slots=True, eq=False)
class OpenSky(Emitter):
    """The sky that no pane covers: rays all over the half sphere above each point."""

    sky: ClassVar[str] = "open"
    light: Sky
    visibility: Visibility
    ball: BoundingSphere
    tables: dict[float, Floats] = field(default_factory=dict, repr=False)

    def towards(self, texels: Texels) -> Aim:
        """Directions as dense as their cosine."""
        around = cosine_weighted(texels.normals)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            direction = around(a, b)
            luminance_cd_m2 = self.light.luminance_cd_m2(direction)
            # The rays are as dense as their cosine, hence over it.
            cosine = np.einsum("ij,ij->i", direction, texels.normals)
            strength = np.pi * luminance_cd_m2 / np.maximum(cosine, 1e-6)
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def width_rad(self, points_m: Floats) -> Floats:
        """The root of a half sphere's solid angle."""
        return np.full(len(points_m), np.sqrt(2 * np.pi), np.float32)

    def passing(self, occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """Past walls and through panes, but for those that are emitters of their own."""
        share = occluder.passing(origins_m, segments_m)
        rays = np.flatnonzero(share)
        share[rays] *= ~self.visibility.crosses_sky_pane(origins_m[rays], segments_m[rays])
        return share

    def open_light(self, texels: Texels) -> Floats:
        """By a table of normals; NaN where the shape's normal is not the flat face's."""
        light = np.full(len(texels), np.nan, np.float32)
        is_flat = np.einsum("ij,ij->i", texels.normals, texels.planes) > FLAT
        for eta in np.unique(texels.eta):
            rows = np.flatnonzero(is_flat & (texels.eta == eta))
            light[rows] = _read_by_normal(self._table(float(eta)), texels.normals[rows])
        return light

    def _table(self, eta: float) -> Floats:
        """The light that enters a coat of this index, by the normal; computed once."""
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


def _width_rad(ball: BoundingSphere, points_m: Floats) -> Floats:
    """As wide as a sphere is seen, at most."""
    distance_m = np.linalg.norm(ball.centre_m - points_m, axis=1)
    width = np.sqrt(np.pi) * ball.radius_m / np.maximum(distance_m, 1e-6)
    return np.asarray(width, np.float32)


def disc(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Points x, y spread evenly over the unit disc."""
    radius = np.sqrt(a)
    angle = np.float32(2 * np.pi) * b
    return radius * np.cos(angle), radius * np.sin(angle)


def cosine_weighted(normals: Floats) -> Callable[[Floats, Floats], Floats]:
    """For two random numbers (..., P) unit directions (..., P, 3) around normals (P, 3), as dense as their cosine."""
    u_axis, v_axis = tangents(normals)

    def direction(a: Floats, b: Floats) -> Floats:
        x, y = disc(a, b)
        z = np.sqrt(np.maximum(1 - a, 1e-7))
        return np.asarray(x[..., None] * u_axis + y[..., None] * v_axis + z[..., None] * normals)

    return direction


def emitters(
    light: Light,
    visibility: Visibility,
    *,
    t_ns: float = 0,
) -> list[Emitter]:
    """The emitters that one light consists of."""
    match light:
        case AreaLight():
            return [panel_emitter(light)]
        case PointLight() | SpotLight():
            return [bulb_emitter(light)]
        case Sun():
            return [sun_emitter(light, t_ns)]
        case Sky():
            panes = [_sky_pane(light, pane, visibility) for pane in visibility.sky_panes]
            return [*panes, _open_sky(light, visibility)]


def _sky_pane(light: Sky, pane: PlanarPatch, visibility: Visibility) -> SkyPane:
    return SkyPane(light, pane, visibility, bounding_sphere(pane.corners_m), rectangle(pane.corners_m))


def _open_sky(light: Sky, visibility: Visibility) -> OpenSky:
    return OpenSky(light, visibility, BoundingSphere(np.zeros(3), np.inf))
