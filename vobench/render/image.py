"""Lamps as flat mirrors show them: light by way of one smooth mirror, with shadows as sharp as the lamp's own."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.render.geometry import RAY_OFFSET_M, Ball, Floats
from vobench.render.sight import Sight
from vobench.render.source import Aim, Source, sources
from vobench.render.texels import Texels
from vobench.scene.light import Light, Sky
from vobench.scene.surface import Surface


@dataclass(frozen=True, slots=True)
class Image:
    """A source in a mirror: rays go straight to where it seems to be, through the mirror's rectangle."""

    source: Source
    mirror: Surface
    tint: float

    def ball(self) -> Ball:
        """The source's, behind the mirror."""
        ball = self.source.ball()
        return Ball(self._behind(ball.centre_m[None])[0], ball.radius_m)

    def width_rad(self, points_m: Floats) -> Floats:
        """As wide as the source looks from behind the mirror."""
        return self.source.width_rad(self._behind(points_m))

    def towards(self, texels: Texels) -> Aim:
        """What the source gives the points' own images."""
        images = replace(texels, points_m=self._behind(texels.points_m), normals=self._turned(texels.normals))
        aim_from_behind = self.source.towards(images)

        def aim(a: Floats, b: Floats) -> tuple[Floats, Floats]:
            way, strength = aim_from_behind(a, b)
            way = self._turned(way)
            return way, np.where(self._meets(texels.points_m, way), self.tint * strength, 0)

        return aim

    def unshadowed(self, texels: Texels) -> None:
        """The mirror's rim may cut it."""

    def passing(self, sight: Sight, origins_m: Floats, way: Floats) -> Floats:
        """To the mirror, and from there to the source."""
        reach = self._reach(origins_m, way)[:, None]
        share = sight.passing(origins_m, reach * way)
        some = np.flatnonzero(share)
        met = origins_m[some] + reach[some] * way[some] + (RAY_OFFSET_M * self.mirror.normal).astype(np.float32)
        share[some] *= self.source.passing(sight, met, self._turned((1 - reach[some]) * way[some]))
        return share

    def _reach(self, points_m: Floats, way: Floats) -> Floats:
        """The share (P,) of each way at which it meets the mirror's plane."""
        normal = self.mirror.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            reach: Floats = ((self.mirror.corner_m - points_m) @ normal) / (way @ normal)
        return reach.astype(np.float32)

    def _meets(self, points_m: Floats, way: Floats) -> Floats:
        """Whether ways (P, 3) from points pass the mirror's rectangle from its front."""
        reach = self._reach(points_m, way)
        ahead = (way @ self.mirror.normal < 0) & (reach > 0) & (reach < 1)
        place = points_m + np.where(ahead, reach, 0)[:, None] * way - self.mirror.corner_m
        u, v = (place @ edge / (edge @ edge) for edge in (self.mirror.edge_u_m, self.mirror.edge_v_m))
        inside: Floats = ahead & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        return inside

    def _behind(self, points_m: Floats) -> Floats:
        normal = self.mirror.normal
        height = (points_m - self.mirror.corner_m) @ normal
        return (points_m - 2 * height[:, None] * normal).astype(points_m.dtype)

    def _turned(self, vectors: Floats) -> Floats:
        normal = self.mirror.normal
        return (vectors - 2 * (vectors @ normal)[:, None] * normal).astype(vectors.dtype)


def images(light: Light, sight: Sight, *, t_ns: float) -> list[Source]:
    """A lamp or the sun in every smooth mirror; the sky's come with the rays that gather indirect light."""
    if isinstance(light, Sky):
        return []
    shown = sources(light, sight, t_ns=t_ns)
    return [Image(source, mirror, tint) for mirror, tint in sight.mirrors for source in shown]
