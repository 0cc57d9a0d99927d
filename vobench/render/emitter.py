"""Emitters: for a point and two random numbers, in which direction an emitter lies and how bright it is there."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.render.geometry import FAR_M, RAY_OFFSET_M, Ball, Floats, Visibility, ball, corners
from vobench.render.lightmap import Texels, tangents
from vobench.scene.light import SUN_RADIUS_RAD, AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.surface import Surface

FLAT_M = 1e-6  # a point nearer than this to a rectangle's plane sees none of it


class SolidAngle:
    """A rectangle as seen from points, and spots on it spread evenly over its solid angle.

    Source: Ureña, Fajardo, King (2013), An area-preserving parametrization for spherical rectangles.
    """

    def __init__(self, surface: Surface, points_m: Floats) -> None:
        way = surface.corner_m - points_m.astype(float)
        x_axis, y_axis = (edge / np.linalg.norm(edge) for edge in (surface.edge_u_m, surface.edge_v_m))
        height = way @ surface.normal
        # The paper's axes: the rectangle lies at negative z.
        self._axes = np.stack([x_axis, y_axis, surface.normal]), np.where(height > 0, -1.0, 1.0)
        self._z0 = np.minimum(-np.abs(height), -FLAT_M)
        self._x0, self._y0 = way @ x_axis, way @ y_axis
        self._x1, self._y1 = self._x0 + surface.size_m[0], self._y0 + surface.size_m[1]
        n0, n2 = (-self._y0 / np.hypot(self._z0, self._y0), self._y1 / np.hypot(self._z0, self._y1))
        n1, n3 = (self._x1 / np.hypot(self._z0, self._x1), -self._x0 / np.hypot(self._z0, self._x0))
        g0, g1, g2, g3 = (np.arccos(np.clip(-a * b, -1, 1)) for a, b in ((n0, n1), (n1, n2), (n2, n3), (n3, n0)))
        self._b0, self._b1, self._k = n0, n2, 2 * np.pi - g2 - g3
        self.steradian = np.where(np.abs(height) > FLAT_M, np.maximum(g0 + g1 - self._k, 0), 0)

    def spot(self, a: Floats, b: Floats) -> Floats:
        """Ways (P, 3) to spots."""
        au = a * self.steradian + self._k
        sine = np.sin(au)
        fu = (np.cos(au) * self._b0 - self._b1) / np.where(sine == 0, 1e-12, sine)
        cu = np.clip(np.copysign(1.0, fu) / np.sqrt(fu * fu + self._b0 * self._b0), -1, 1)
        xu = np.clip(-cu * self._z0 / np.sqrt(np.maximum(1 - cu * cu, 1e-30)), self._x0, self._x1)
        d = np.hypot(xu, self._z0)
        h0, h1 = self._y0 / np.hypot(d, self._y0), self._y1 / np.hypot(d, self._y1)
        hv = h0 + b * (h1 - h0)
        yv = np.clip(hv * d / np.sqrt(np.maximum(1 - hv * hv, 1e-30)), self._y0, self._y1)
        axes, flip = self._axes
        return np.asarray((np.stack([xu, yv, self._z0 * flip], -1) @ axes).astype(np.float32))


def polygon_illuminance(corners_m: Array, points_m: Floats, normals: Floats) -> Floats:
    """Illuminance (P,) by a polygon of luminance 1 and corners (C, 3), NaN where the horizon cuts it.

    Source: Lambert (1760); Arvo (1995), Analytic methods for simulated light transport, eq. 2.30.
    """
    ways = corners_m[:, None] - points_m.astype(float)
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    total, normals = np.zeros(len(points_m)), normals.astype(float)
    for first, second in zip(ways, np.roll(ways, -1, axis=0), strict=True):
        angle = np.arccos(np.clip(np.einsum("ij,ij->i", first, second), -1, 1))
        edge = np.cross(first, second)
        total += angle * np.einsum("ij,ij->i", edge, normals) / np.maximum(np.linalg.norm(edge, axis=1), 1e-12)
    whole = (np.einsum("kij,ij->ki", ways, normals) > 0).all(0)
    return np.where(whole, np.abs(total) / 2, np.nan).astype(np.float32)


Aim = Callable[[Floats, Floats], tuple[Floats, Floats]]
FARTHEST_M = 1e7  # from there rays are parallel within a scene to a tenth of a millimetre


@dataclass(frozen=True, slots=True, eq=False)
class Emitter:
    """One thing that shines; `ball` encloses it, of infinite radius where it is all around. `sky`: "pane", "open".

    towards: for points and two random numbers each, vectors (P, 3) to it and illuminance (P,) square to them.
    width_rad: roughly how wide it is (P,) seen from points (P, 3), 0 for hard shadows.
    passing: share (R,) of light that comes from origins + way (R, 3) to the origins, of what `towards` does not count.
    unshadowed: exact illuminance (P,) if nothing were in the way, NaN where unknown: takes the grain out of open light.
    """

    ball: Ball
    towards: Callable[[Texels], Aim]
    width_rad: Callable[[Floats], Floats]
    passing: Callable[[Visibility, Floats, Floats], Floats] = Visibility.passing
    unshadowed: Callable[[Texels], Floats] | None = None
    sky: str = ""


def panel_emitter(light: AreaLight) -> Emitter:
    """A lamp's rectangle, which shines only to its front."""
    surface = light.surface

    def towards(texels: Texels) -> Aim:
        angle = SolidAngle(surface, texels.points_m)
        in_front = (texels.points_m - surface.corner_m) @ surface.normal > FLAT_M
        strength = np.where(in_front, light.luminance_cd_m2 * angle.steradian, 0).astype(np.float32)
        return lambda a, b: (angle.spot(a, b) + (RAY_OFFSET_M * surface.normal).astype(np.float32), strength)

    def unshadowed(texels: Texels) -> Floats:
        return light.luminance_cd_m2 * polygon_illuminance(corners(surface), texels.points_m, texels.normals)

    return Emitter(ball([surface]), towards, _width_rad(surface), unshadowed=unshadowed)


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


def _pane_emitter(light: Sky, pane: int, visibility: Visibility) -> Emitter:
    """The sky through one pane: only rays that cross no other pane behind it, so that none counts twice."""
    surface, (followed_back, followed_front) = visibility.surfaces[pane], _followed(pane, visibility)

    def towards(texels: Texels) -> Aim:
        angle = SolidAngle(surface, texels.points_m)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            spot = angle.spot(a, b)
            direction = spot / np.linalg.norm(spot, axis=1, keepdims=True)
            strength = angle.steradian * light.luminance_cd_m2(direction)
            strength *= visibility.pane_passes(pane, direction)
            outward = direction @ surface.normal > 0
            doubtful = np.flatnonzero(np.where(outward, followed_front, followed_back))
            beyond = (texels.points_m + spot + 2 * RAY_OFFSET_M * direction)[doubtful]
            strength[doubtful] *= ~visibility.crosses_pane(beyond, FAR_M * direction[doubtful])
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def passing(visibility: Visibility, origins_m: Floats, way: Floats) -> Floats:
        """Past walls, and through panes before this one."""
        share = visibility.clear(origins_m, way).astype(np.float32)
        some = np.flatnonzero(share)
        start, ahead = origins_m[some], way[some]
        reach = ((surface.corner_m - start) @ surface.normal) / (ahead @ surface.normal)
        share[some] *= visibility.through_panes(start, ahead * ((1 - 1e-4) * reach[:, None]).astype(np.float32))
        return share

    return Emitter(ball([surface]), towards, _width_rad(surface), passing, sky="pane")


def _open_sky_emitter(light: Sky, visibility: Visibility) -> Emitter:
    """The sky that no pane covers: rays all over the half sphere above each point."""

    def towards(texels: Texels) -> Aim:
        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            direction = cosine_weighted(texels.normals, a, b)
            luminance = light.luminance_cd_m2(direction)
            # The rays are as dense as their cosine, hence over it.
            strength = np.pi * luminance / np.maximum(np.einsum("ij,ij->i", direction, texels.normals), 1e-6)
            strength[visibility.crosses_pane(texels.points_m, FAR_M * direction)] = 0
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def width_rad(points_m: Floats) -> Floats:
        return np.full(len(points_m), np.sqrt(2 * np.pi), np.float32)

    return Emitter(Ball(np.zeros(3), np.inf), towards, width_rad, sky="open")


def _width_rad(surface: Surface) -> Callable[[Floats], Floats]:
    return lambda points_m: np.sqrt(SolidAngle(surface, points_m).steradian).astype(np.float32)


def _hard(points_m: Floats) -> Floats:
    return np.zeros(len(points_m), np.float32)


def disc(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Points x, y spread evenly over the unit disc."""
    radius, angle = np.sqrt(a), np.float32(2 * np.pi) * b
    return radius * np.cos(angle), radius * np.sin(angle)


def cosine_weighted(normals: Floats, a: Floats, b: Floats) -> Floats:
    """Unit directions (P, 3) around normals, as dense as their cosine."""
    (x, y), (u_axis, v_axis) = disc(a, b), tangents(normals)
    up = np.sqrt(np.maximum(1 - a, 1e-7))
    return np.asarray(x[:, None] * u_axis + y[:, None] * v_axis + up[:, None] * normals)


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
            panes = [_pane_emitter(light, pane, visibility) for pane in visibility.sky_panes()]
            return [*panes, _open_sky_emitter(light, visibility)]


def _followed(pane: int, visibility: Visibility) -> tuple[bool, bool]:
    """Whether any other pane reaches to the back of a pane, and to its front."""
    surface, panes = visibility.surfaces[pane], [visibility.surfaces[i] for i in visibility.panes]
    height = np.concatenate([(corners(other) - surface.corner_m) @ surface.normal for other in panes])
    return bool((height < -RAY_OFFSET_M).any()), bool((height > RAY_OFFSET_M).any())
