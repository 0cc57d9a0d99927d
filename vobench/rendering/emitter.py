"""Emitters: for a point and two random numbers, in which direction an emitter lies and how bright it is there."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.geometry import FAR_M, RAY_OFFSET_M, Ball, Flat, Floats, Mask, Visibility, ball, lengths, spots
from vobench.rendering.lightmap import Texels, tangents
from vobench.scene.light import SUN_RADIUS_RAD, AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.mesh import areas_m2, face_normals, unit
from vobench.scene.mesh import corners as mesh_corners

FAR_OFF = 2.9  # radii of a rectangle, beyond which rays spread over its area tell as well what hides it
MESH_SPOTS = 8
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
    normal = unit(np.cross(corners_m[0, 1] - corners_m[0, 0], corners_m[0, 2] - corners_m[0, 0]))
    edges = np.roll(corners_m[0], -1, axis=0) - corners_m[0]
    square = np.abs([edges[i] @ edges[i - 1] for i in range(3)]).argmin()  # the corner with the right angle
    u = unit(edges[square])
    v = np.cross(normal, u)
    local = (corners_m - corners_m[0, 0]) @ np.stack([u, v, normal]).T
    low = local.min((0, 1))
    size = np.ptp(local, axis=(0, 1))
    turned = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])[:, 2].sum() / 2
    if size[2] > 1e-4 * size.max() or abs(turned - size[0] * size[1]) > 1e-4 * size[0] * size[1]:
        return None
    return Rectangle(corners_m[0, 0] + low[0] * u + low[1] * v, size[0] * u, size[1] * v, normal)


class SolidAngle:
    """A rectangle as seen from points, and spots on it spread evenly over its solid angle.

    Source: Ureña, Fajardo, King (2013), An area-preserving parametrization for spherical rectangles.
    """

    def __init__(self, face: Rectangle, points_m: Floats) -> None:
        way = face.corner_m - points_m.astype(float)
        width = np.linalg.norm(face.edge_u_m)
        length = np.linalg.norm(face.edge_v_m)
        x_axis = face.edge_u_m / width
        y_axis = face.edge_v_m / length
        height = way @ face.normal
        # The paper's axes: the rectangle lies at negative z.
        self._axes = np.stack([x_axis, y_axis, face.normal]), np.where(height > 0, -1.0, 1.0)
        self._z0 = np.minimum(-np.abs(height), -LEVEL_M)
        self._x0 = way @ x_axis
        self._y0 = way @ y_axis
        self._x1 = self._x0 + width
        self._y1 = self._y0 + length
        n0 = -self._y0 / np.hypot(self._z0, self._y0)
        n2 = self._y1 / np.hypot(self._z0, self._y1)
        n1 = self._x1 / np.hypot(self._z0, self._x1)
        n3 = -self._x0 / np.hypot(self._z0, self._x0)
        g0, g1, g2, g3 = (np.arccos(np.clip(-a * b, -1, 1)) for a, b in ((n0, n1), (n1, n2), (n2, n3), (n3, n0)))
        self._b0 = n0
        self._b1 = n2
        self._k = 2 * np.pi - g2 - g3
        self.steradian = np.where(np.abs(height) > LEVEL_M, np.maximum(g0 + g1 - self._k, 0), 0)

    def spot(self, a: Floats, b: Floats) -> Floats:
        """Ways (P, 3) to spots."""
        au = a * self.steradian + self._k
        sine = np.sin(au)
        fu = (np.cos(au) * self._b0 - self._b1) / np.where(sine == 0, 1e-12, sine)
        cu = np.clip(np.copysign(1.0, fu) / np.sqrt(fu * fu + self._b0 * self._b0), -1, 1)
        xu = np.clip(-cu * self._z0 / np.sqrt(np.maximum(1 - cu * cu, 1e-30)), self._x0, self._x1)
        d = np.hypot(xu, self._z0)
        h0 = self._y0 / np.hypot(d, self._y0)
        h1 = self._y1 / np.hypot(d, self._y1)
        hv = h0 + b * (h1 - h0)
        yv = np.clip(hv * d / np.sqrt(np.maximum(1 - hv * hv, 1e-30)), self._y0, self._y1)
        axes, flip = self._axes
        return np.asarray((np.stack([xu, yv, self._z0 * flip], -1) @ axes).astype(np.float32))


class Between(Protocol):
    """What may stand between points and an emitter; rays run from origins to origins + way (R, 3)."""

    def clear(self, origins_m: Floats, way: Floats) -> Mask:
        """Whether nothing opaque is there."""

    def passing(self, origins_m: Floats, way: Floats) -> Floats:
        """Share (R,) of light that passes what is there."""

    def through_panes(self, origins_m: Floats, way: Floats) -> Floats:
        """Share (R,) that all panes there let through."""


Aim = Callable[[Floats, Floats], tuple[Floats, Floats]]
FARTHEST_M = 1e7  # from there rays are parallel within a scene to a tenth of a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class Emitter:
    """One thing that shines; `ball` encloses it, of infinite radius where it is all around. `sky`: "pane", "open".

    towards: for points and two random numbers each, vectors (P, 3) to it and illuminance (P,) square to them.
    width_rad: roughly how wide it is (P,) seen from points (P, 3), 0 for hard shadows.
    passing: share (R,) of light that comes from origins + way (R, 3) to the origins (R, 3), of what `towards` does
    not count. may_light: the points (P, 3) that any of it can reach, as far as that is known without rays.
    evenly: as `towards`, with less grain and at more cost, for light without rays; spots: along a side for that, at
    least, 0 where its light is even.
    """

    ball: Ball
    towards: Callable[[Texels], Aim]
    width_rad: Callable[[Floats], Floats]
    passing: Callable[[Between, Floats, Floats], Floats] = lambda between, *ways: between.passing(*ways)
    sky: str = ""
    may_light: Callable[[Floats], Mask] = lambda points_m: np.ones(len(points_m), bool)
    evenly: Callable[[Texels], Aim] | None = None
    spots: int = 0


def panel_emitter(light: AreaLight) -> Emitter:
    """A lamp's faces, which shine only to their front: rectangles by solid angle, all else by area."""
    corners_m = mesh_corners(light.mesh)
    face = rectangle(corners_m)
    around = ball(corners_m)
    if face is None:
        # In an order in which near triangles are near to one another (Morton).
        shares = (corners_m.mean(1) - around.centre_m) / around.radius_m / 2 + 0.5
        curve = corners_m[np.argsort(_interleaved(np.clip(shares, 0, 1 - 1e-6)), kind="stable")]
        return Emitter(around, lambda texels: _by_area(light, curve, texels), _width_rad(around), spots=MESH_SPOTS)

    def towards(texels: Texels) -> Aim:
        nearest = lengths(texels.points_m - around.centre_m).min(initial=np.inf)
        is_far = nearest > FAR_OFF * around.radius_m
        return _by_area(light, corners_m, texels, face) if is_far else evenly(texels)

    def evenly(texels: Texels) -> Aim:
        angle = SolidAngle(face, texels.points_m)
        in_front = (texels.points_m - face.corner_m) @ face.normal > LEVEL_M
        strength = np.where(in_front, light.luminance_cd_m2 * angle.steradian, 0).astype(np.float32)
        return lambda a, b: (angle.spot(a, b) + (RAY_OFFSET_M * face.normal).astype(np.float32), strength)

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


def _by_area(light: AreaLight, corners_m: Array, texels: Texels, face: Rectangle | None = None) -> Aim:
    """Spots on triangles in proportion to their areas, or all over the rectangle that they fill."""
    area = areas_m2(corners_m)
    normals = face_normals(corners_m).astype(np.float32)
    ends = np.cumsum(area) / area.sum()
    power = np.float32(light.luminance_cd_m2 * area.sum())

    def spot(a: Floats, b: Floats) -> tuple[Floats, Floats]:
        if face is None:
            # strata of the square are such of the mesh
            a = _interleaved(np.stack([a, b], -1))
            b = b * 2**CURVE_BITS % 1
            normal = normals[np.minimum(np.searchsorted(ends, a, side="right"), len(ends) - 1)]
            return (spots(corners_m, a, b) + RAY_OFFSET_M * normal).astype(np.float32), normal
        corner = (face.corner_m + RAY_OFFSET_M * face.normal).astype(np.float32)
        u = face.edge_u_m.astype(np.float32)
        v = face.edge_v_m.astype(np.float32)
        return corner + a[:, None] * u + b[:, None] * v, normals[:1]

    def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
        ends_m, normal = spot(a, b)
        way = ends_m - texels.points_m
        squared = np.maximum(np.einsum("ij,ij->i", way, way), np.float32(1e-9))
        before = np.maximum(-np.einsum("ij,ij->i", way, np.broadcast_to(normal, way.shape)), 0)
        return way, power * before / (squared * np.sqrt(squared))

    return aim


def bulb_emitter(light: PointLight | SpotLight) -> Emitter:
    """A point or spot: inverse square."""

    def towards(texels: Texels) -> Aim:
        way = (light.position_m - texels.points_m).astype(np.float32)
        squared = np.einsum("ij,ij->i", way, way)
        strength = (light.intensity_cd(-way / np.sqrt(squared)[:, None]) / squared).astype(np.float32)
        return lambda _a, _b: (way, strength)

    return Emitter(Ball(light.position_m, 0.0), towards, _hard)


def sun_emitter(light: Sun, t_ns: float) -> Emitter:
    """The sun at one instant, so narrow that most points need one ray; rays are spread evenly over its disc."""
    centre = light.direction(t_ns)

    def towards(texels: Texels) -> Aim:
        axes = tangents(centre[None])
        arriving = light.illuminance_lx * np.maximum(texels.normals @ centre, 0)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            x, y = (np.tan(SUN_RADIUS_RAD) * part for part in disc(a, b))
            direction = (centre + x[:, None] * axes[0] + y[:, None] * axes[1]).astype(np.float32)
            # One ray alone must not tell where on the disc it went.
            return FAR_M * direction, arriving / np.maximum(texels.cosine(direction), SUN_RADIUS_RAD)

        return aim

    return Emitter(Ball(FARTHEST_M * centre, FARTHEST_M * SUN_RADIUS_RAD), towards, _hard)


def _pane_emitter(light: Sky, pane: Flat, visibility: Visibility) -> Emitter:
    """The sky through one pane: only rays that cross no other pane behind it, so that none counts twice."""
    followed_back, followed_front = _followed(pane, visibility)
    face = rectangle(pane.corners_m)
    area = areas_m2(pane.corners_m).sum()

    def spot(texels: Texels) -> Aim:
        """Ways to spots on the pane, and the solid angle that each stands for."""
        if face is not None:
            angle = SolidAngle(face, texels.points_m)
            return lambda a, b: (angle.spot(a, b), angle.steradian)

        def by_area(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            way = spots(pane.corners_m, a, b) - texels.points_m
            return way, area * np.abs(way @ pane.normal) / np.maximum(np.linalg.norm(way, axis=1), 1e-6) ** 3

        return by_area

    def towards(texels: Texels) -> Aim:
        spot_of = spot(texels)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            way, steradian = spot_of(a, b)
            direction = way / lengths(way)[:, None]
            strength = steradian * light.luminance_cd_m2(direction) * visibility.pane_passes(pane, direction)
            outward = direction @ pane.normal > 0
            doubtful = np.flatnonzero(np.where(outward, followed_front, followed_back))
            beyond = (texels.points_m + way + 2 * RAY_OFFSET_M * direction)[doubtful]
            strength[doubtful] *= ~visibility.crosses_sky_pane(beyond, FAR_M * direction[doubtful])
            return (FAR_M * direction).astype(np.float32), strength.astype(np.float32)

        return aim

    def passing(between: Between, origins_m: Floats, way: Floats) -> Floats:
        """Past walls, and through panes before this one."""
        share = between.clear(origins_m, way).astype(np.float32)
        some = np.flatnonzero(share)
        start = origins_m[some]
        ahead = way[some]
        reach = -pane.height_m(start) / (ahead @ pane.normal)
        share[some] *= between.through_panes(start, ahead * ((1 - 1e-4) * reach[:, None]).astype(np.float32))
        return share

    around = ball(pane.corners_m)
    return Emitter(around, towards, _width_rad(around), passing, sky="pane")


def _open_sky_emitter(light: Sky, visibility: Visibility) -> Emitter:
    """The sky that no pane covers: rays all over the half sphere above each point."""

    def towards(texels: Texels) -> Aim:
        around = cosine_weighted(texels.normals)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            direction = around(a, b)
            luminance = light.luminance_cd_m2(direction)
            # The rays are as dense as their cosine, hence over it.
            strength = np.pi * luminance / np.maximum(np.einsum("ij,ij->i", direction, texels.normals), 1e-6)
            strength[visibility.crosses_sky_pane(texels.points_m, FAR_M * direction)] = 0
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def width_rad(points_m: Floats) -> Floats:
        return np.full(len(points_m), np.sqrt(2 * np.pi), np.float32)

    return Emitter(Ball(np.zeros(3), np.inf), towards, width_rad, sky="open")


def _width_rad(around: Ball) -> Callable[[Floats], Floats]:
    """As wide as the ball is seen, at most."""
    return lambda points_m: (
        np.sqrt(np.pi) * around.radius_m / np.maximum(np.linalg.norm(around.centre_m - points_m, axis=1), 1e-6)
    ).astype(np.float32)


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
        (x, y) = disc(a, b)
        up = np.sqrt(np.maximum(1 - a, 1e-7))
        return np.asarray(x[..., None] * u_axis + y[..., None] * v_axis + up[..., None] * normals)

    return direction


def emitters(light: Light, visibility: Visibility, *, t_ns: float = 0) -> list[Emitter]:
    """All that one light is made of."""
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


def _followed(pane: Flat, visibility: Visibility) -> tuple[bool, bool]:
    """Whether any other pane that shows the sky reaches to the back of a pane, and to its front."""
    height = np.concatenate([pane.height_m(other.corners_m).ravel() for other in visibility.sky_panes])
    return bool((height < -RAY_OFFSET_M).any()), bool((height > RAY_OFFSET_M).any())
