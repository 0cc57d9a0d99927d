"""Emitters: for a point and two random numbers, in which direction an emitter lies and how bright it is there."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
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
from vobench.rendering.texel import Texels
from vobench.rendering.visibility import Visibility
from vobench.scene.light import SUN_RADIUS_RAD, AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.mesh import areas_m2, face_normals
from vobench.scene.mesh import corners as mesh_corners

FAR_OFF = 2.9  # radii of a rectangle, beyond which rays spread over its area tell as well what hides it
MESH_SAMPLES = 8  # along a side, of a mesh's light without rays
FILLED = 1e-4  # share by which triangles may miss the rectangle that they fill
CURVE_BITS = 10
LEVEL_M = 1e-6  # a point nearer than this to a rectangle's plane sees none of it


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A corner, two edges at right angles and the normal edge_u × edge_v (3,) of a rectangle."""

    corner_m: Array
    edge_u_m: Array
    edge_v_m: Array
    normal: Array


def rectangle(corners_m: Array) -> Rectangle | None:
    """The rectangle that triangles (K, 3, 3) fill between them, if they do."""
    first, second, third = corners_m[0]
    normal = unit(np.cross(second - first, third - first))
    edges = np.roll(corners_m[0], -1, axis=0) - corners_m[0]
    square = np.abs([edges[i] @ edges[i - 1] for i in range(3)]).argmin()  # the corner with the right angle
    u_axis = unit(edges[square])
    v_axis = np.cross(normal, u_axis)

    local_m = (corners_m - first) @ np.stack([u_axis, v_axis, normal]).T
    low_m = local_m.min((0, 1))
    size_m = np.ptp(local_m, axis=(0, 1))
    first_edge_m = local_m[:, 1] - local_m[:, 0]
    second_edge_m = local_m[:, 2] - local_m[:, 0]
    doubled_areas = np.cross(first_edge_m, second_edge_m)[:, 2]
    area_m2 = doubled_areas.sum() / 2
    box_area_m2 = size_m[0] * size_m[1]
    is_thick = size_m[2] > FILLED * size_m.max()
    tolerance_m2 = FILLED * size_m[0] * size_m[1]
    if is_thick or abs(area_m2 - box_area_m2) > tolerance_m2:
        return None
    corner_m = first + low_m[0] * u_axis + low_m[1] * v_axis
    return Rectangle(corner_m, size_m[0] * u_axis, size_m[1] * v_axis, normal)


class SolidAngle:
    """A rectangle as seen from points, and places on it spread evenly over its solid angle.

    Names are those of the source: Ureña, Fajardo, King (2013), An area-preserving parametrization for spherical
    rectangles.
    """

    def __init__(self, face: Rectangle, points_m: Floats) -> None:
        to_corner_m = face.corner_m - points_m.astype(float)
        width_m = np.linalg.norm(face.edge_u_m)
        length_m = np.linalg.norm(face.edge_v_m)
        x_axis = face.edge_u_m / width_m
        y_axis = face.edge_v_m / length_m
        height_m = to_corner_m @ face.normal
        # The paper's axes: the rectangle lies at negative z.
        self._axes = np.stack([x_axis, y_axis, face.normal])
        self._flip = np.where(height_m > 0, -1.0, 1.0)
        self._z0 = np.minimum(-np.abs(height_m), -LEVEL_M)
        self._x0 = to_corner_m @ x_axis
        self._y0 = to_corner_m @ y_axis
        self._x1 = self._x0 + width_m
        self._y1 = self._y0 + length_m

        n0 = -self._y0 / np.hypot(self._z0, self._y0)
        n2 = self._y1 / np.hypot(self._z0, self._y1)
        n1 = self._x1 / np.hypot(self._z0, self._x1)
        n3 = -self._x0 / np.hypot(self._z0, self._x0)
        g0 = _angle(n0, n1)
        g1 = _angle(n1, n2)
        g2 = _angle(n2, n3)
        g3 = _angle(n3, n0)
        self._b0 = n0
        self._b1 = n2
        self._k = 2 * np.pi - g2 - g3
        is_seen = np.abs(height_m) > LEVEL_M
        self.steradian = np.where(is_seen, np.maximum(g0 + g1 - self._k, 0), 0)

    def vectors_m(self, a: Floats, b: Floats) -> Floats:
        """Vectors (P, 3) to places on the rectangle, by two numbers (P,) in [0, 1) each."""
        au = a * self.steradian + self._k
        sine = np.sin(au)
        divisor = np.where(sine == 0, 1e-12, sine)
        fu = (np.cos(au) * self._b0 - self._b1) / divisor
        cu = np.copysign(1.0, fu) / np.sqrt(fu * fu + self._b0 * self._b0)
        cu = np.clip(cu, -1, 1)
        xu = -cu * self._z0 / np.sqrt(np.maximum(1 - cu * cu, 1e-30))
        xu = np.clip(xu, self._x0, self._x1)
        d = np.hypot(xu, self._z0)
        h0 = self._y0 / np.hypot(d, self._y0)
        h1 = self._y1 / np.hypot(d, self._y1)
        hv = h0 + b * (h1 - h0)
        yv = hv * d / np.sqrt(np.maximum(1 - hv * hv, 1e-30))
        yv = np.clip(yv, self._y0, self._y1)
        local_m = np.stack([xu, yv, self._z0 * self._flip], -1)
        return np.asarray((local_m @ self._axes).astype(np.float32))


def _angle(a: Floats, b: Floats) -> Floats:
    """The inner angle of a spherical rectangle between sides whose normals have these z."""
    return np.asarray(np.arccos(np.clip(-a * b, -1, 1)))


class Occluder(Protocol):
    """Whatever may stand between points and an emitter; rays run from origins to origins + segments (R, 3)."""

    def clear(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether nothing opaque is there."""

    def passing(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) of light that passes what is there."""

    def through_panes(self, origins_m: Floats, segments_m: Floats) -> Floats:
        """Share (R,) that all panes there let through."""


Aim = Callable[[Floats, Floats], tuple[Floats, Floats]]
FARTHEST_M = 1e7  # from there rays are parallel within a scene to a tenth of a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class Emitter:
    """One thing that shines; `ball` encloses it, of infinite radius where it is all around. `sky`: "pane", "open".

    towards: for points and two random numbers each, vectors (P, 3) to it and illuminance (P,) square to them.
    width_rad: roughly how wide it is (P,) seen from points (P, 3), 0 for hard shadows.
    passing: share (R,) of light that comes from origins + segments (R, 3) to the origins (R, 3), of what `towards`
    does not count. may_light: the points (P, 3) that any of it can reach, as far as that is known without rays.
    evenly: as `towards`, with less grain and at more cost, for light without rays; side_samples: along a side for
    that, at least, 0 where its light is even.
    """

    ball: BoundingSphere
    towards: Callable[[Texels], Aim]
    width_rad: Callable[[Floats], Floats]
    passing: Callable[[Occluder, Floats, Floats], Floats] = lambda occluder, *rays: occluder.passing(*rays)
    sky: str = ""
    may_light: Callable[[Floats], Mask] = lambda points_m: np.ones(len(points_m), bool)
    evenly: Callable[[Texels], Aim] | None = None
    side_samples: int = 0


def panel_emitter(light: AreaLight) -> Emitter:
    """A lamp's faces, which shine only to their front: rectangles by solid angle, all else by area."""
    corners_m = mesh_corners(light.mesh)
    face = rectangle(corners_m)
    around = bounding_sphere(corners_m)
    if face is None:
        # In an order in which near triangles are near to one another (Morton).
        shares = (corners_m.mean(1) - around.centre_m) / around.radius_m / 2 + 0.5
        along_curve = _interleaved(np.clip(shares, 0, 1 - 1e-6))
        order = np.argsort(along_curve, kind="stable")
        ordered_m = corners_m[order]

        def by_area(texels: Texels) -> Aim:
            return _by_area(light, ordered_m, texels)

        return Emitter(around, by_area, _width_rad(around), side_samples=MESH_SAMPLES)

    def towards(texels: Texels) -> Aim:
        distances_m = lengths(texels.points_m - around.centre_m)
        nearest_m = distances_m.min(initial=np.inf)
        is_far = nearest_m > FAR_OFF * around.radius_m
        return _by_area(light, corners_m, texels, face) if is_far else evenly(texels)

    def evenly(texels: Texels) -> Aim:
        angle = SolidAngle(face, texels.points_m)
        is_before = (texels.points_m - face.corner_m) @ face.normal > LEVEL_M
        arriving_lx = light.luminance_cd_m2 * angle.steradian
        strength = np.where(is_before, arriving_lx, 0).astype(np.float32)
        lift_m = (RAY_OFFSET_M * face.normal).astype(np.float32)
        return lambda a, b: (angle.vectors_m(a, b) + lift_m, strength)

    return Emitter(around, towards, _width_rad(around), evenly=evenly)


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


def _by_area(
    light: AreaLight,
    corners_m: Array,
    texels: Texels,
    face: Rectangle | None = None,
) -> Aim:
    """Places on triangles in proportion to their areas, or all over the rectangle that they fill."""
    area_m2 = areas_m2(corners_m)
    normals = face_normals(corners_m).astype(np.float32)
    ends = np.cumsum(area_m2) / area_m2.sum()
    intensity_cd = np.float32(light.luminance_cd_m2 * area_m2.sum())  # straight ahead

    def on_triangles(a: Floats, b: Floats) -> tuple[Floats, Floats]:
        # strata of the square are such of the mesh
        along_curve = _interleaved(np.stack([a, b], -1))
        rest = b * 2**CURVE_BITS % 1
        triangle = np.searchsorted(ends, along_curve, side="right")
        triangle = np.minimum(triangle, len(ends) - 1)
        normal = normals[triangle]
        places_m = sample_points(corners_m, along_curve, rest) + RAY_OFFSET_M * normal
        return places_m.astype(np.float32), normal

    def on_rectangle(
        filled: Rectangle,
        a: Floats,
        b: Floats,
    ) -> tuple[Floats, Floats]:
        lift_m = RAY_OFFSET_M * filled.normal
        corner_m = (filled.corner_m + lift_m).astype(np.float32)
        u_m = filled.edge_u_m.astype(np.float32)
        v_m = filled.edge_v_m.astype(np.float32)
        return corner_m + a[:, None] * u_m + b[:, None] * v_m, normals[:1]

    def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
        places_m, normal = on_triangles(a, b) if face is None else on_rectangle(face, a, b)
        vectors_m = places_m - texels.points_m
        squared_m2 = np.maximum(np.einsum("ij,ij->i", vectors_m, vectors_m), np.float32(1e-9))
        along_normal = np.einsum("ij,ij->i", vectors_m, np.broadcast_to(normal, vectors_m.shape))
        ahead = np.maximum(-along_normal, 0)
        return vectors_m, intensity_cd * ahead / (squared_m2 * np.sqrt(squared_m2))

    return aim


def bulb_emitter(light: PointLight | SpotLight) -> Emitter:
    """A point or spot: inverse square."""

    def towards(texels: Texels) -> Aim:
        vectors_m = (light.position_m - texels.points_m).astype(np.float32)
        squared_m2 = np.einsum("ij,ij->i", vectors_m, vectors_m)
        from_lamp = -vectors_m / np.sqrt(squared_m2)[:, None]
        strength = (light.intensity_cd(from_lamp) / squared_m2).astype(np.float32)
        return lambda _a, _b: (vectors_m, strength)

    return Emitter(BoundingSphere(light.position_m, 0.0), towards, _hard)


def sun_emitter(light: Sun, t_ns: float) -> Emitter:
    """The sun at one instant, so narrow that most points need one ray; rays are spread evenly over its disc."""
    centre = light.direction(t_ns)

    def towards(texels: Texels) -> Aim:
        u_axis, v_axis = tangents(centre[None])
        arriving_lx = light.illuminance_lx * np.maximum(texels.normals @ centre, 0)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            x, y = disc(a, b)
            x_offset = np.tan(SUN_RADIUS_RAD) * x
            y_offset = np.tan(SUN_RADIUS_RAD) * y
            towards_disc = centre + x_offset[:, None] * u_axis + y_offset[:, None] * v_axis
            direction = towards_disc.astype(np.float32)
            # One ray alone must not tell where on the disc it went.
            cosine = np.maximum(texels.cosine(direction), SUN_RADIUS_RAD)
            return FAR_M * direction, arriving_lx / cosine

        return aim

    around = BoundingSphere(FARTHEST_M * centre, FARTHEST_M * SUN_RADIUS_RAD)
    return Emitter(around, towards, _hard)


def _pane_emitter(light: Sky, pane: PlanarPatch, visibility: Visibility) -> Emitter:
    """The sky through one pane: only rays that cross no other pane behind it, so that none counts twice."""
    followed_back, followed_front = _followed(pane, visibility)
    face = rectangle(pane.corners_m)
    area_m2 = areas_m2(pane.corners_m).sum()

    def aim_at_pane(texels: Texels) -> Aim:
        """Vectors to places on the pane, and the solid angle that each stands for."""
        if face is not None:
            angle = SolidAngle(face, texels.points_m)
            return lambda a, b: (angle.vectors_m(a, b), angle.steradian)

        def by_area(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m = sample_points(pane.corners_m, a, b) - texels.points_m
            distance_m = np.maximum(np.linalg.norm(vectors_m, axis=1), 1e-6)
            height_m = np.abs(vectors_m @ pane.normal)
            return vectors_m, area_m2 * height_m / distance_m**3

        return by_area

    def towards(texels: Texels) -> Aim:
        vector_and_angle = aim_at_pane(texels)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            vectors_m, steradian = vector_and_angle(a, b)
            direction = vectors_m / lengths(vectors_m)[:, None]
            luminance = steradian * light.luminance_cd_m2(direction)
            strength = luminance * visibility.pane_passes(pane, direction)
            is_outward = direction @ pane.normal > 0
            doubtful = np.flatnonzero(np.where(is_outward, followed_front, followed_back))
            beyond_m = (texels.points_m + vectors_m + 2 * RAY_OFFSET_M * direction)[doubtful]
            strength[doubtful] *= ~visibility.crosses_sky_pane(beyond_m, FAR_M * direction[doubtful])
            return (FAR_M * direction).astype(np.float32), strength.astype(np.float32)

        return aim

    def passing(occluder: Occluder, origins_m: Floats, segments_m: Floats) -> Floats:
        """Past walls, and through panes before this one."""
        share = occluder.clear(origins_m, segments_m).astype(np.float32)
        rays = np.flatnonzero(share)
        start_m = origins_m[rays]
        ahead_m = segments_m[rays]
        reach = -pane.height_m(start_m) / (ahead_m @ pane.normal)
        short_of_pane = ((1 - 1e-4) * reach[:, None]).astype(np.float32)
        share[rays] *= occluder.through_panes(start_m, ahead_m * short_of_pane)
        return share

    around = bounding_sphere(pane.corners_m)
    return Emitter(around, towards, _width_rad(around), passing, sky="pane")


def _open_sky_emitter(light: Sky, visibility: Visibility) -> Emitter:
    """The sky that no pane covers: rays all over the half sphere above each point."""

    def towards(texels: Texels) -> Aim:
        around = cosine_weighted(texels.normals)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            direction = around(a, b)
            luminance_cd_m2 = light.luminance_cd_m2(direction)
            # The rays are as dense as their cosine, hence over it.
            cosine = np.einsum("ij,ij->i", direction, texels.normals)
            strength = np.pi * luminance_cd_m2 / np.maximum(cosine, 1e-6)
            strength[visibility.crosses_sky_pane(texels.points_m, FAR_M * direction)] = 0
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def width_rad(points_m: Floats) -> Floats:
        return np.full(len(points_m), np.sqrt(2 * np.pi), np.float32)

    return Emitter(BoundingSphere(np.zeros(3), np.inf), towards, width_rad, sky="open")


def _width_rad(around: BoundingSphere) -> Callable[[Floats], Floats]:
    """As wide as the sphere is seen, at most."""

    def width_rad(points_m: Floats) -> Floats:
        distance_m = np.linalg.norm(around.centre_m - points_m, axis=1)
        width = np.sqrt(np.pi) * around.radius_m / np.maximum(distance_m, 1e-6)
        return np.asarray(width, np.float32)

    return width_rad


def _hard(points_m: Floats) -> Floats:
    return np.zeros(len(points_m), np.float32)


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
            panes = [_pane_emitter(light, pane, visibility) for pane in visibility.sky_panes]
            return [*panes, _open_sky_emitter(light, visibility)]


def _followed(pane: PlanarPatch, visibility: Visibility) -> tuple[bool, bool]:
    """Whether any other pane that shows the sky reaches to the back of a pane, and to its front."""
    heights_m = [pane.height_m(other.corners_m).ravel() for other in visibility.sky_panes]
    height_m = np.concatenate(heights_m)
    return bool((height_m < -RAY_OFFSET_M).any()), bool((height_m > RAY_OFFSET_M).any())
