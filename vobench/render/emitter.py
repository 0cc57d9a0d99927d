"""Emitters: for a point and two random numbers, where to look and how bright it is there."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

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
        spots: Floats = (np.stack([xu, yv, self._z0 * flip], -1) @ axes).astype(np.float32)
        return spots


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


class Emitter(Protocol):
    """One thing that shines."""

    def ball(self) -> Ball:
        """What encloses it; of infinite radius where it is all around."""

    def width_rad(self, points_m: Floats) -> Floats:
        """Roughly how wide it looks (P,) from points (P, 3); 0 for hard shadows."""

    def towards(self, texels: Texels) -> Aim:
        """Ways to it and strengths, see above."""

    def unshadowed(self, texels: Texels) -> Floats | None:
        """Exact illuminance (P,) if nothing were in the way, NaN where unknown: takes the grain out of open light."""

    def passing(self, sight: Visibility, origins_m: Floats, way: Floats) -> Floats:
        """Share (R,) of light that comes from origins + way (R, 3) to the origins, of what `towards` does not count."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A lamp's rectangle."""

    light: AreaLight

    def ball(self) -> Ball:
        """Around its corners."""
        return ball([self.light.surface])

    def width_rad(self, points_m: Floats) -> Floats:
        """The root of the solid angle."""
        return np.sqrt(SolidAngle(self.light.surface, points_m).steradian).astype(np.float32)

    def towards(self, texels: Texels) -> Aim:
        """Only from in front."""
        surface, points = self.light.surface, texels.points_m
        angle = SolidAngle(surface, points)
        in_front = (points - surface.corner_m) @ surface.normal > FLAT_M
        strength = np.where(in_front, self.light.luminance_cd_m2 * angle.steradian, 0).astype(np.float32)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            return angle.spot(a, b) + (RAY_OFFSET_M * surface.normal).astype(np.float32), strength

        return aim

    def unshadowed(self, texels: Texels) -> Floats:
        """By the rectangle's edges, where all of it is above the horizon."""
        return self.light.luminance_cd_m2 * polygon_illuminance(
            corners(self.light.surface), texels.points_m, texels.normals
        )

    def passing(self, sight: Visibility, origins_m: Floats, way: Floats) -> Floats:
        """Past walls and through panes."""
        return sight.passing(origins_m, way)


@dataclass(frozen=True, slots=True)
class Bulb:
    """A point or spot."""

    light: PointLight | SpotLight

    def ball(self) -> Ball:
        """A point."""
        return Ball(self.light.position_m, 0.0)

    def width_rad(self, points_m: Floats) -> Floats:
        """None."""
        return np.zeros(len(points_m), np.float32)

    def towards(self, texels: Texels) -> Aim:
        """Inverse square."""
        way = (self.light.position_m - texels.points_m).astype(np.float32)
        squared = np.einsum("ij,ij->i", way, way)
        strength = (self.light.intensity_cd(-way / np.sqrt(squared)[:, None]) / squared).astype(np.float32)
        return lambda _a, _b: (way, strength)

    def unshadowed(self, texels: Texels) -> None:
        """Nothing to add."""

    def passing(self, sight: Visibility, origins_m: Floats, way: Floats) -> Floats:
        """Past walls and through panes."""
        return sight.passing(origins_m, way)


@dataclass(frozen=True, slots=True)
class SunDisc:
    """The sun where it stands at one instant."""

    light: Sun
    t_ns: float = 0

    def ball(self) -> Ball:
        """So far away that it stands in the same direction from everywhere."""
        return Ball(FARTHEST_M * self.light.direction(self.t_ns), FARTHEST_M * SUN_RADIUS_RAD)

    def width_rad(self, points_m: Floats) -> Floats:
        """So narrow that most points need one ray."""
        return np.zeros(len(points_m), np.float32)

    def towards(self, texels: Texels) -> Aim:
        """Rays spread evenly over the disc."""
        centre = self.light.direction(self.t_ns)
        axes = tangents(centre[None])
        arriving = self.light.illuminance_lx * np.maximum(texels.normals @ centre, 0)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            x, y = (np.tan(SUN_RADIUS_RAD) * part for part in disc(a, b))
            direction = (centre + x[:, None] * axes[0] + y[:, None] * axes[1]).astype(np.float32)
            # One ray alone must not tell where on the disc it went.
            return FAR_M * direction, arriving / np.maximum(texels.cosine(direction), SUN_RADIUS_RAD)

        return aim

    def unshadowed(self, texels: Texels) -> None:
        """Nothing to add."""

    def passing(self, sight: Visibility, origins_m: Floats, way: Floats) -> Floats:
        """Past walls and through panes."""
        return sight.passing(origins_m, way)


@dataclass(frozen=True, slots=True)
class SkyPane:
    """The sky through one pane: only rays that cross no other pane behind it, so that none counts twice.

    followed: whether other panes stand behind it for light that falls along its normal, and against it.
    """

    light: Sky
    pane: int
    sight: Visibility
    followed: tuple[bool, bool]

    @property
    def surface(self) -> Surface:
        """The pane's rectangle."""
        return self.sight.surfaces[self.pane]

    def ball(self) -> Ball:
        """Around the pane."""
        return ball([self.surface])

    def width_rad(self, points_m: Floats) -> Floats:
        """The root of the solid angle."""
        return np.sqrt(SolidAngle(self.surface, points_m).steradian).astype(np.float32)

    def towards(self, texels: Texels) -> Aim:
        """The sky's luminance beyond the pane."""
        angle = SolidAngle(self.surface, texels.points_m)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            spot = angle.spot(a, b)
            direction = spot / np.linalg.norm(spot, axis=1, keepdims=True)
            strength = angle.steradian * self.light.luminance_cd_m2(direction)
            strength *= self.sight.pane_passes(self.pane, direction)
            outward = direction @ self.surface.normal > 0
            doubtful = np.flatnonzero(np.where(outward, self.followed[1], self.followed[0]))
            beyond = (texels.points_m + spot + 2 * RAY_OFFSET_M * direction)[doubtful]
            strength[doubtful] *= ~self.sight.crosses_pane(beyond, FAR_M * direction[doubtful])
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def unshadowed(self, texels: Texels) -> None:
        """Nothing to add."""

    def passing(self, sight: Visibility, origins_m: Floats, way: Floats) -> Floats:
        """Past walls, and through panes before this one."""
        share = sight.clear(origins_m, way).astype(np.float32)
        some = np.flatnonzero(share)
        start, ahead = origins_m[some], way[some]
        reach = ((self.surface.corner_m - start) @ self.surface.normal) / (ahead @ self.surface.normal)
        share[some] *= sight.through_panes(start, ahead * ((1 - 1e-4) * reach[:, None]).astype(np.float32))
        return share


@dataclass(frozen=True, slots=True)
class OpenSky:
    """The sky that no pane covers: rays all over the half sphere above each point."""

    light: Sky
    sight: Visibility

    def ball(self) -> Ball:
        """All around."""
        return Ball(np.zeros(3), np.inf)

    def width_rad(self, points_m: Floats) -> Floats:
        """All of it."""
        return np.full(len(points_m), np.sqrt(2 * np.pi), np.float32)

    def towards(self, texels: Texels) -> Aim:
        """Cosine-weighted, hence strength over cosine."""

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            direction = cosine_weighted(texels.normals, a, b)
            luminance = self.light.luminance_cd_m2(direction)
            strength = np.pi * luminance / np.maximum(np.einsum("ij,ij->i", direction, texels.normals), 1e-6)
            strength[self.sight.crosses_pane(texels.points_m, FAR_M * direction)] = 0
            return FAR_M * direction, strength.astype(np.float32)

        return aim

    def unshadowed(self, texels: Texels) -> None:
        """Nothing to add."""

    def passing(self, sight: Visibility, origins_m: Floats, way: Floats) -> Floats:
        """Past walls and through panes."""
        return sight.passing(origins_m, way)


def disc(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Points x, y spread evenly over the unit disc."""
    radius, angle = np.sqrt(a), np.float32(2 * np.pi) * b
    return radius * np.cos(angle), radius * np.sin(angle)


def cosine_weighted(normals: Floats, a: Floats, b: Floats) -> Floats:
    """Unit directions (P, 3) around normals, as dense as their cosine."""
    (x, y), (u_axis, v_axis) = disc(a, b), tangents(normals)
    up = np.sqrt(np.maximum(1 - a, 1e-7))
    directions: Floats = x[:, None] * u_axis + y[:, None] * v_axis + up[:, None] * normals
    return directions


def emitters(light: Light, sight: Visibility, *, t_ns: float = 0) -> list[Emitter]:
    """All that one light is made of."""
    match light:
        case AreaLight():
            return [Panel(light)]
        case PointLight() | SpotLight():
            return [Bulb(light)]
        case Sun():
            return [SunDisc(light, t_ns)]
        case Sky():
            panes = [SkyPane(light, i, sight, _followed(i, sight)) for i in sight.sky_panes()]
            return [*panes, OpenSky(light, sight)]


def _followed(pane: int, sight: Visibility) -> tuple[bool, bool]:
    """Whether any other pane reaches to the back of a pane, and to its front."""
    surface = sight.surfaces[pane]
    height = np.concatenate([(corners(sight.surfaces[i]) - surface.corner_m) @ surface.normal for i in sight.panes])
    return bool((height < -RAY_OFFSET_M).any()), bool((height > RAY_OFFSET_M).any())
