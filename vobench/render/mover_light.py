"""Light on movers, and what they keep from the rest."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene, StaticScene, bodies
from vobench.render.direct_light import Rays, arriving, cell_spot, footprint, in_front, mirror_images
from vobench.render.emitter import Emitter, emitters
from vobench.render.geometry import Ball, Floats, Indices, Mask, RayCaster, Visibility, face_materials
from vobench.render.indirect_light import FinalGather, Gatherer, blend, response, surfels
from vobench.render.lightmap import Places, Texels, in_chunks, owners, texels
from vobench.scene.light import AreaLight, Light, Sky, Sun
from vobench.scene.mesh import Triangles

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

SIDE, SHADE_SIDE, SKY_SIDE = 3, 2, 5  # rays along a side to an emitter: on movers, in their shade, to the sky
SKY_REACH = 10  # radii beyond which a mover hides less than a hundredth of an open sky
GATHER_RAYS = 64
GATHER_M = 0.2  # between places that gather indirect light
UNNOTICED = 1 / 300  # share of a place's light, less than a step of 8 bits


def may_shade(mover: Ball, emitter: Ball, points: Ball) -> Mask:
    """Whether a way from within each of `points` (N,) to within the emitter's ball can pass the mover's."""
    if np.isinf(emitter.radius_m):
        distance = np.linalg.norm(mover.centre_m - points.centre_m, axis=-1)
        return np.asarray(distance <= SKY_REACH * mover.radius_m + points.radius_m)
    to_mover, to_source = mover.centre_m - points.centre_m, emitter.centre_m - points.centre_m
    far_mover, far_source = (np.linalg.norm(way, axis=-1) for way in (to_mover, to_source))
    cosine = np.einsum("ij,ij->i", to_mover, to_source) / np.maximum(far_mover * far_source, 1e-9)
    angles = (
        np.arcsin(np.clip((one.radius_m + points.radius_m) / np.maximum(far, 1e-9), 0, 1))
        for one, far in ((mover, far_mover), (emitter, far_source))
    )
    reach = far_source + emitter.radius_m + mover.radius_m + points.radius_m
    inside = far_mover <= mover.radius_m + points.radius_m
    return np.asarray(inside | ((np.arccos(np.clip(cosine, -1, 1)) <= sum(angles)) & (far_mover <= reach)))


class MovingCaster:
    """Rays against bodies where they are: each caster is in its body's frame, and T_body_world (4, 4) leads there."""

    def __init__(self, bodies: Sequence[tuple[RayCaster, Array]], still: RayCaster | None = None) -> None:
        self._bodies, self._still = bodies, still

    def stops(self, origins_m: Floats, way: Floats) -> Mask:
        """Whether anything is between origins and origins + way (R, 3)."""
        hidden = self._still.stops(origins_m, way) if self._still else np.zeros(len(origins_m), bool)
        for caster, T in self._bodies:
            some = np.flatnonzero(~hidden)
            hidden[some] = caster.stops(se3.apply(T, origins_m[some]), way[some] @ T[:3, :3].T)
        return hidden


@dataclass(frozen=True, slots=True)
class MoverLightAt:
    """Movers at one instant: each light's direct light (L, M) on their points, and what they keep from others (L, P).

    gathered: what reaches their groups of points from the surfels and lamps of what stands still.
    """

    direct: Floats
    lost: Floats
    gathered: FinalGather


class MoverLight:
    """The light of a baked scene's movers."""

    def __init__(self, baked: BakedScene, still: StaticScene) -> None:
        self._baked, self._still, self._lights = baked, still, baked.scene.lights
        faces, materials = baked.faces, baked.scene.materials
        looks = [m is not None and m.kind == "pane" for m in face_materials(faces, materials)]
        solid = ~np.array(looks, bool)[faces.thing]
        own = [np.flatnonzero((faces.mover == nth) & solid) for nth in range(len(baked.scene.movers))]
        self._solid = [nth for nth, some in enumerate(own) if len(some)]
        self._casters = [RayCaster(faces, own[nth]) for nth in self._solid]
        self._parts = [parts(faces.corners_m[own[nth]]) for nth in self._solid]
        moves = (faces.mover >= 0) & bodies(baked.scene, faces)
        self._points, self._layout = texels(
            faces, materials, baked.atlas, owners(baked.atlas), among=moves, seed=baked.settings.seed
        )
        self._mover = faces.mover[self._points.face]
        self._cells = _cells(still.points, still.cells)
        self._groups, self._blend = self._grouped(faces)
        self._gatherer = Gatherer(
            baked.atlas,
            still.visibility,
            response(faces, materials, still.visibility),
            [light for light in self._lights if isinstance(light, Sky)],
            baked.patches.surfel_of,
            len(baked.patches.area_m2),
            len(self._lights),
        )
        self._straight = [layer.ravel()[still.points.index] for layer in baked.direct]

    def _grouped(self, faces: Triangles) -> "tuple[Places, csr_matrix]":
        """The points that gather light for their neighbours, and how these take it (H·W, S)."""
        points, moving = self._points, np.flatnonzero(faces.mover >= 0)
        alone = Visibility(faces, self._baked.scene.materials, moving)
        steps = np.full(len(points), GATHER_M, np.float32)
        groups = surfels(points, faces.thing[points.face], steps, alone)
        return groups.middle, blend(points, groups, self._layout, alone, np.ones(len(groups), bool))

    def at(self, t_ns: float, suns_ns: Sequence[float], is_on: Sequence[bool]) -> MoverLightAt:
        """All that the movers' places decide.

        suns_ns (L,): the instant of each sun that moves; is_on (L,): which lights are on at all.
        """
        poses = [mover.path.pose(t_ns) for mover in self._baked.scene.movers]
        solid = [(caster, se3.inverse(poses[n])) for caster, n in zip(self._casters, self._solid, strict=True)]
        parts_at = [_moved_ball(own, poses[n]) for own, n in zip(self._parts, self._solid, strict=True)]
        points, together = self._placed(poses), copy(self._still.visibility)
        together.opaque = MovingCaster(solid, together.opaque)  # type: ignore[assignment]
        direct = np.zeros((len(self._lights), len(points)), np.float32)
        lost = np.zeros((len(self._lights), len(self._still.points)), np.float32)
        for index, light in enumerate(self._lights):
            for emitter in self._shining(light, suns_ns[index]) if is_on[index] else ():
                some = np.flatnonzero(in_front(emitter.ball, points.points_m, points.normals))
                rays = Rays(SKY_SIDE if emitter.sky else SIDE)
                direct[index, some] += arriving(emitter, points.take(some), together, rays)[0]
                lost[index] += self._lost(emitter, self._shaded(emitter, parts_at, index), MovingCaster(solid))
            # Rounding apart, nothing is taken that had not come.
            np.minimum(lost[index], self._straight[index], out=lost[index])
        count = GATHER_RAYS if self._baked.settings.bounces else 0
        return MoverLightAt(direct, lost, self._gatherer.gather(points.take(self._groups), rays=count))

    def add(self, moment: MoverLightAt, total: Floats, levels: Sequence[float]) -> None:
        """Put the movers' light and shade into the sum (H, W, 3) of all that stands still."""
        flat, strength = total.reshape(-1, 3), np.asarray(levels, np.float32)
        colours = strength[:, None] * np.array([light.colour for light in self._lights], np.float32)
        shade = np.append(moment.lost.T @ colours, np.zeros((1, 3), np.float32), 0)
        is_shaded: Mask = np.any(shade != 0, axis=1)
        shaded = np.flatnonzero(is_shaded[self._still.layout.source])
        flat[shaded] = np.maximum(flat[shaded] - shade[self._still.layout.source[shaded]], 0)
        own = np.flatnonzero(self._layout.source < len(self._points))
        lit = (moment.direct.T @ colours)[self._layout.source[own]]
        flat[own] = lit + (self._blend @ self._around(moment.gathered, colours))[own]

    def _around(self, gathered: FinalGather, colours: Floats) -> Floats:
        """Illuminance (S, 3) of the movers' groups by bounces, lamps in mirrors included."""
        radiosity = np.einsum("lsc,lc->sc", self._baked.patches.radiosity, colours)
        glow = [np.pi * x.luminance_cd_m2 if isinstance(x, AreaLight) else 0 for x in self._lights]
        sent = np.concatenate([radiosity, np.array(glow, np.float32)[:, None] * colours])
        skies = [colour for colour, x in zip(colours, self._lights, strict=True) if isinstance(x, Sky)]
        by_mirrors = gathered.sky.T @ np.array(skies, np.float32).reshape(-1, 3)
        return np.asarray(gathered.table @ sent + by_mirrors, np.float32)

    def _placed(self, poses: Sequence[Array]) -> Texels:
        """The movers' points where they are."""
        p, T = self._points, np.array(poses)[self._mover]

        def turned(vectors: Floats) -> Floats:
            return np.asarray(np.einsum("nij,nj->ni", T[:, :3, :3], vectors), np.float32)

        names = ("normals", "planes", "step_u_m", "step_v_m")
        vectors: dict[str, Any] = {name: turned(getattr(p, name)) for name in names}
        return replace(p, points_m=(turned(p.points_m) + T[:, :3, 3]).astype(np.float32), **vectors)

    def _shining(self, light: Light, sun_ns: float) -> list[Emitter]:
        """What a light shines from, its images in mirrors included."""
        t_ns = sun_ns if isinstance(light, Sun) and light.moves else 0.0
        own = emitters(light, self._still.visibility, t_ns=t_ns)
        return [*own, *mirror_images(light, self._still.visibility, t_ns=t_ns)]

    def _shaded(self, emitter: Emitter, movers: Sequence[Ball], light: int) -> Places:
        """Points (N,) that stand still, have light of a lamp, and may lose some of it to a mover."""
        near = np.zeros(len(self._cells.radius_m), bool)
        for own in movers:
            for part in range(len(own.radius_m)):
                near |= may_shade(own.take(slice(part, part + 1)), emitter.ball, self._cells)
        points, straight = self._still.points, self._straight[light]
        some = np.flatnonzero(near[self._still.cells] & (straight > UNNOTICED * straight.max(initial=0)))
        return some[in_front(emitter.ball, points.points_m[some], points.normals[some])]

    def _lost(self, emitter: Emitter, some: Places, movers: MovingCaster) -> Floats:
        """Illuminance (P,) that movers take from some points; the sky's in a pane is smoothed."""
        layout, is_soft = self._still.layout, emitter.sky == "pane"
        some, side = (some[layout.few[some]], SKY_SIDE) if is_soft else (some, SHADE_SIDE)
        lost = np.zeros(len(self._still.points), np.float32)
        found = in_chunks(lambda part: self._lost_at(emitter, some[part], movers, side), len(some))
        lost[some] = np.concatenate([*found, np.zeros(0, np.float32)])
        return layout.blurred(layout.between(lost)) if is_soft else lost

    def _lost_at(self, emitter: Emitter, some: Places, movers: MovingCaster, side: int) -> Floats:
        own = self._still.points.take(some)
        towards, lost = emitter.towards(own), np.zeros(len(own), np.float32)
        for cell in range(side**2):
            way, strength = towards(*cell_spot(own, cell, side))
            cosine = own.cosine(way)
            light = strength * np.maximum(cosine, 0) * own.entering(cosine)
            aside = footprint(own, slice(None), cell)
            start, ahead = own.points_m + aside, way - aside
            hit = np.flatnonzero(movers.stops(start, ahead) & (light > 0))
            lost[hit] += light[hit] * emitter.passing(self._still.visibility, start[hit], ahead[hit])
        return lost / np.float32(side**2)


def _cells(points: Texels, of: Indices) -> Ball:
    """Balls around the points of each cell, whose number is given (P,)."""
    count = np.maximum(np.bincount(of), 1)
    centre = np.stack([np.bincount(of, axis) for axis in points.points_m.T], -1) / count[:, None]
    radius = np.zeros(len(count))
    np.maximum.at(radius, of, np.linalg.norm(points.points_m - centre[of], axis=1))
    return Ball(centre, radius)


MOST_PARTS = 8


def parts(corners_m: Array) -> Ball:
    """Balls (K,) that enclose faces (F, 3, 3) together: of those in slices across the longest side of their box."""
    points = corners_m.reshape(-1, 3)
    low, size = points.min(0), np.ptp(points, axis=0)
    longest = int(size.argmax())
    count = int(np.clip(np.ceil(size[longest] / max(np.sort(size)[1], 1e-3)), 1, MOST_PARTS))
    part = np.where(np.arange(3) == longest, size / count, size)
    centres = low + part / 2 + np.arange(count)[:, None] * np.eye(3)[longest] * part
    return Ball(centres, np.full(count, float(np.linalg.norm(part) / 2)))


def _moved_ball(own: Ball, T_world_body: NDArray[np.float64]) -> Ball:
    return Ball(se3.apply(T_world_body, own.centre_m), own.radius_m)
