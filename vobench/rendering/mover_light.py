"""Light on movers, and the light that they take from the stationary part of a scene."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import doubled_areas_px2
from vobench.rendering.bake import BakedScene, StaticScene, bodies
from vobench.rendering.culling import bounds
from vobench.rendering.direct_light import Rays, arriving, footprint_m, mirror_images, place_in_cell, reached
from vobench.rendering.emitter import Emitter, emitters
from vobench.rendering.geometry import BoundingSphere, RayCaster, are_panes
from vobench.rendering.indirect_light import FinalGather, Gatherer, blend, response, surfels
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_owner import owners
from vobench.rendering.thread_pool import chunked
from vobench.rendering.view import Box, PinholeView
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Light, Sky
from vobench.scene.mesh import Triangles, areas_m2

if TYPE_CHECKING:
    from scipy.sparse import csr_array, csr_matrix

Views = Sequence[tuple[PinholeView, Box]]
# rays along a side from points on movers, to an emitter and to the sky
SIDE = 3
SKY_SIDE = 5
# the same from points in their shade
SHADE_SIDE = 2
SKY_SHADE_SIDE = 3
SKY_REACH = 10  # radii beyond which a mover hides less than a hundredth of an open sky
GATHER_RAYS = 64
GATHER_M = 0.2  # between places that gather indirect light
UNNOTICED = 1 / 300  # share of a place's light, less than a step of 8 bits
STEEPEST = 0.999  # sine of the angle of a frustum that is as good as open to all sides
SMOOTHINGS = 2  # of the sky's shade
READ_TEXELS = 2  # from what is seen, as far as pictures read light
AHEAD_M = 0.3  # beyond what a view needs: the other eye is about there
UNSURE = 0.2  # standard deviation of the shares lost at the points around, above which a point is asked itself


def may_shade(mover: BoundingSphere, emitter: BoundingSphere, points: BoundingSphere) -> Mask:
    """Whether a ray from within each of `points` (N,) to within the emitter's sphere can pass the mover's.

    All rays lie in a cone frustum about the line between the two spheres, here one a little wider.
    """
    to_mover_m = mover.centre_m - points.centre_m
    squared_m2 = np.einsum("ij,ij->i", to_mover_m, to_mover_m)
    if np.isinf(emitter.radius_m):
        reach_m = SKY_REACH * mover.radius_m + points.radius_m
        return np.asarray(squared_m2 <= reach_m**2)
    near_m = mover.radius_m + points.radius_m
    to_emitter_m = emitter.centre_m - points.centre_m
    emitter_distance_m = np.maximum(np.sqrt(np.einsum("ij,ij->i", to_emitter_m, to_emitter_m)), 1e-9)
    along_m = np.einsum("ij,ij->i", to_mover_m, to_emitter_m) / emitter_distance_m
    aside_m = np.sqrt(np.maximum(squared_m2 - along_m**2, 0))
    sine = np.minimum((emitter.radius_m + points.radius_m) / emitter_distance_m, STEEPEST)
    cone_radius_m = near_m + sine * np.maximum(along_m, 0)
    is_in_cone = aside_m * np.sqrt(1 - sine**2) <= cone_radius_m
    is_before_emitter = along_m <= emitter_distance_m + emitter.radius_m + near_m
    is_ahead = along_m >= -near_m
    return np.asarray((squared_m2 <= near_m**2) | (is_in_cone & is_before_emitter & is_ahead))


class Casters:
    """Several ray casters as one."""

    def __init__(self, *casters: RayCaster) -> None:
        self._casters = casters

    def stops(self, origins_m: Floats, segments_m: Floats) -> Mask:
        """Whether anything is between origins and origins + segments (R, 3)."""
        is_hidden = np.zeros(len(origins_m), bool)
        for caster in self._casters:
            rays = np.flatnonzero(~is_hidden)
            is_hidden[rays] = caster.stops(origins_m[rays], segments_m[rays])
        return is_hidden


@dataclass(slots=True)
class MoverLightAt:
    """Movers at one instant: each light's direct light (L, M) on their points.

    gathered: what reaches their groups of points from the surfels and lamps of the stationary part. movers, balls:
    the movers as faces that rays meet, and around their parts. known (C,): the cells whose shade has been looked for;
    lost: of a light the points (N,) there that the movers shade, and the illuminance (N,) that these lose.
    """

    direct: Floats
    gathered: FinalGather
    movers: RayCaster
    balls: list[BoundingSphere]
    shining: "list[list[_Lit]]"
    known: Mask
    lost: list[tuple[int, Rows, Floats]]


@dataclass(frozen=True, slots=True)
class _Lit:
    """Stationary points that have an emitter's light, surfel by surfel: has (P,) marks them.

    points (N,): in the order of their cells (C,), cell by cell from starts (C + 1,) on; balls around each of these.
    """

    emitter: Emitter
    is_soft: bool
    has: Mask
    points: Rows
    cells: Indices
    balls: BoundingSphere
    starts: Rows

    def shaded_cells(self, movers: Sequence[BoundingSphere], among: Mask) -> Mask:
        """The cells among all (A,) of which some point may lose light to one of the movers, given as spheres."""
        asked = np.flatnonzero(among[self.cells])
        balls = self.balls.take(asked)
        is_shaded = np.zeros(len(asked), bool)
        for mover_parts in movers:
            may_be = may_shade(_around(mover_parts), self.emitter.ball, balls)
            rows = np.flatnonzero(~is_shaded & may_be)
            candidates = balls.take(rows)
            for part in range(len(mover_parts.radius_m)):
                part_ball = mover_parts.take(slice(part, part + 1))
                is_shaded[rows] |= may_shade(part_ball, self.emitter.ball, candidates)
        result = np.zeros(len(among), bool)
        result[self.cells[asked[is_shaded]]] = True
        return result

    def points_in(self, among: Mask) -> Rows:
        """Its points in the cells among all (A,)."""
        return self.points[spans(self.starts, np.flatnonzero(among[self.cells]))]


class MoverLight:
    """The light of a baked scene's movers."""

    def __init__(self, baked: BakedScene, static: StaticScene) -> None:
        self._baked = baked
        self._static = static
        self._lights = baked.scene.lights
        self._direct = [layer.ravel()[static.points.index] for layer in baked.direct]
        faces = baked.faces
        materials = baked.scene.materials

        # What casts shade: the movers' faces but for panes.
        is_solid = ~are_panes(faces, materials)
        mover_count = len(baked.scene.movers)
        mover_faces = [np.flatnonzero((faces.mover == nth) & is_solid) for nth in range(mover_count)]
        self._solid = [nth for nth, rows in enumerate(mover_faces) if len(rows)]
        self._bodies = faces.some(np.concatenate([NO_ROWS, *mover_faces]))
        self._parts = [parts(faces.corners_m[mover_faces[nth]]) for nth in self._solid]

        # The movers' points, and those that gather light for their neighbours.
        is_moving_body = (faces.mover >= 0) & bodies(baked.scene, faces)
        self._points, self._layout = texels(
            faces, materials, baked.atlas, owners(baked.atlas), among=is_moving_body, seed=baked.settings.seed
        )
        self._mover = faces.mover[self._points.face]
        self._groups, blend_table = self._grouped(faces)
        is_mover_texel = self._layout.source < len(self._points)
        self._mover_texels = np.flatnonzero(is_mover_texel)
        self._blend = blend_table[self._mover_texels]
        self._gatherer = Gatherer(
            baked.atlas,
            static.visibility,
            response(faces, materials, static.visibility),
            [light for light in self._lights if isinstance(light, Sky)],
            baked.patches.surfel_of,
            len(baked.patches.area_m2),
            len(self._lights),
        )

        # The stationary points by cell, and the texels of the map by point.
        self._by_cell = np.argsort(static.cells, kind="stable")
        self._cells = _cells(baked, static, self._by_cell)
        by_point = np.argsort(static.layout.source, kind="stable")
        self._texels = by_point.astype(np.int32)
        sources = static.layout.source[self._texels]
        point_limits = np.arange(len(static.points) + 1)
        self._texel_starts = np.searchsorted(sources, point_limits)
        self._lit: dict[tuple[int, float], list[_Lit]] = {}

    def _grouped(self, faces: Triangles) -> "tuple[Rows, csr_matrix]":
        """The points that gather light for their neighbours, and the weights (H·W, S) of these at each texel."""
        points = self._points
        moving = np.flatnonzero(faces.mover >= 0)
        visibility = Visibility(faces, self._baked.scene.materials, moving)
        steps_m = np.full(len(points), GATHER_M, np.float32)
        groups = surfels(points, faces.thing[points.face], steps_m, visibility)
        usable = np.ones(len(groups), bool)
        return groups.middle, blend(points, groups, self._layout, visibility, usable)

    def at(
        self,
        t_ns: float,
        suns_ns: Sequence[float],
        is_on: Sequence[bool],
    ) -> MoverLightAt:
        """What the movers' places decide, but for their shade.

        suns_ns (L,): the instant of each sun that moves; is_on (L,): which lights are on at all.
        """
        poses = [mover.path.pose(t_ns) for mover in self._baked.scene.movers]
        movers = RayCaster(self._bodies.moved(poses))
        balls = [_moved(part_balls, poses[nth]) for part_balls, nth in zip(self._parts, self._solid, strict=True)]
        points = self._placed(poses)
        with_movers = copy(self._static.visibility)
        with_movers.opaque = Casters(with_movers.opaque, movers)  # type: ignore[assignment]

        direct = np.zeros((len(self._lights), len(points)), np.float32)
        shining = [self._lit_by(i, suns_ns[i]) if is_on[i] else [] for i in range(len(self._lights))]
        for index, light_emitters in enumerate(shining):
            for lit in light_emitters:
                emitter = lit.emitter
                rows = reached(emitter, points, np.arange(len(points)))
                rays = Rays(SKY_SIDE if emitter.sky else SIDE)
                direct[index, rows] += arriving(emitter, points, rows, with_movers, rays)[0]

        ray_count = GATHER_RAYS if self._baked.settings.bounces else 0
        gathered = self._gatherer.gather(points.take(self._groups), rays=ray_count)
        cell_count = int(self._static.cells.max(initial=-1)) + 1
        known = np.zeros(cell_count, bool)
        return MoverLightAt(direct, gathered, movers, balls, shining, known, [])

    def shade(self, moment: MoverLightAt, views: Views | None) -> None:
        """Find the light that the movers take from all that views show, or from everything."""
        inside_m = np.full(len(moment.known), np.inf)
        if views is not None:
            inside_m = _inside_m(self._cells, views)
        is_missing = (inside_m > 0) & ~moment.known
        if not is_missing.any():
            return
        new = (inside_m > -AHEAD_M) & ~moment.known
        moment.known = moment.known | new
        for index, shining in enumerate(moment.shining):
            taken_lx = np.zeros(len(self._static.points), np.float32)
            shaded = [NO_ROWS]
            for lit in shining:
                rows, lost_lx = self._lost(lit, index, moment, new)
                taken_lx[rows] += lost_lx
                shaded.append(rows[lost_lx > 0])
            points = _distinct(np.concatenate(shaded))
            # Rounding apart, nothing is taken that had not come.
            available_lx = self._direct[index][points]
            moment.lost.append((index, points, np.minimum(taken_lx[points], available_lx)))

    def add(
        self,
        moment: MoverLightAt,
        static_light: Floats,
        levels: Sequence[float],
    ) -> Floats:
        """The map (H, W, 3) of the stationary part with the movers' light and shade."""
        total = static_light.copy()
        flat = total.reshape(-1, 3)
        strength = np.asarray(levels, np.float32)
        nominal_colours = np.array([light.colour for light in self._lights], np.float32)
        colours = strength[:, None] * nominal_colours

        shaded = [rows for _, rows, _ in moment.lost]
        points = _distinct(np.concatenate([NO_ROWS, *shaded]))
        row_of = np.zeros(len(self._static.points), np.int32)
        row_of[points] = np.arange(len(points))
        shade = np.zeros((len(points), 3), np.float32)
        for index, rows, taken_lx in moment.lost:
            shade[row_of[rows]] += taken_lx[:, None] * colours[index]
        shaded_texels = self._texels[spans(self._texel_starts, points)]
        texel_counts = np.diff(self._texel_starts)[points]
        texel_shade = np.repeat(shade, texel_counts, axis=0)
        flat[shaded_texels] = np.maximum(flat[shaded_texels] - texel_shade, 0)

        point_light = moment.direct.T @ colours
        direct = point_light[self._layout.source[self._mover_texels]]
        indirect = self._blend @ self._indirect(moment.gathered, colours)
        flat[self._mover_texels] = direct + indirect
        return total

    def _indirect(self, gathered: FinalGather, colours: Floats) -> Floats:
        """Illuminance (S, 3) of the movers' groups by bounces, lamps in mirrors included."""
        radiosity = np.einsum("lsc,lc->sc", self._baked.patches.radiosity, colours)
        lamp_radiosity = []
        sky_colours = []
        for colour, light in zip(colours, self._lights, strict=True):
            lamp_radiosity.append(np.pi * light.luminance_cd_m2 if isinstance(light, AreaLight) else 0)
            if isinstance(light, Sky):
                sky_colours.append(colour)
        glow = np.array(lamp_radiosity, np.float32)[:, None] * colours
        sent = np.concatenate([radiosity, glow])
        sky_table = np.array(sky_colours, np.float32).reshape(-1, 3)
        by_mirrors = gathered.sky.T @ sky_table
        return np.asarray(gathered.table @ sent + by_mirrors, np.float32)

    def _placed(self, poses: Sequence[Array]) -> Texels:
        """The movers' points where they are."""
        points = self._points
        T_world_movers = np.array(poses)[self._mover]

        def turned(vectors: Floats) -> Floats:
            R_world_movers = T_world_movers[:, :3, :3]
            return np.asarray(np.einsum("nij,nj->ni", R_world_movers, vectors), np.float32)

        points_m = turned(points.points_m) + T_world_movers[:, :3, 3]
        return replace(
            points,
            points_m=points_m.astype(np.float32),
            normals=turned(points.normals),
            planes=turned(points.planes),
            step_u_m=turned(points.step_u_m),
            step_v_m=turned(points.step_v_m),
        )

    def _shining(self, light: Light, sun_ns: float) -> list[Emitter]:
        """The emitters of a light, its images in mirrors included."""
        t_ns = sun_ns if light.moves else 0.0
        light_emitters = emitters(light, self._static.visibility, t_ns=t_ns)
        images = mirror_images(light, self._static.visibility, t_ns=t_ns)
        return [*light_emitters, *images]

    def _lit_by(self, index: int, sun_ns: float) -> list[_Lit]:
        """The emitters of a light, each with the points that it may light, of a moving sun at an instant."""
        key = index, sun_ns
        if key not in self._lit:
            self._lit = {other: lit for other, lit in self._lit.items() if other[0] != index}
            light_emitters = self._shining(self._lights[index], sun_ns)
            self._lit[key] = [self._lit_from(emitter, index) for emitter in light_emitters]
        return self._lit[key]

    def _lit_from(self, emitter: Emitter, index: int) -> _Lit:
        points = self._static.points
        direct_lx = self._direct[index]
        noticed_lx = UNNOTICED * direct_lx.max(initial=0)
        noticed = self._by_cell[direct_lx[self._by_cell] > noticed_lx]
        rows = reached(emitter, points, noticed)
        has = np.zeros(len(points), bool)
        has[rows] = True
        cells = self._static.cells[rows]
        starts = np.flatnonzero(np.diff(cells, prepend=-1, append=-1))
        is_soft = bool((emitter.width_rad(points.points_m[rows]) > 0).any())
        balls = _balls(points.points_m[rows], starts)
        return _Lit(emitter, is_soft, has, rows, cells[starts[:-1]], balls, starts)

    def _lost(
        self,
        lit: _Lit,
        index: int,
        moment: MoverLightAt,
        new: Mask,
    ) -> tuple[Rows, Floats]:
        """Points (N,) in new cells and the illuminance (N,) that movers take from them.

        Soft shadows are asked at few points, and at others where those around differ, as light is. What is found at
        a point does not depend on which others are asked for.
        """
        direct_lx = self._direct[index]
        layout = self._static.layout
        cells = lit.shaded_cells(moment.balls, new)
        wanted = lit.points_in(cells)
        if not lit.is_soft:
            return wanted, self._traced(lit.emitter, wanted, moment.movers, SHADE_SIDE)
        smoothings = SMOOTHINGS if lit.emitter.sky == "pane" else 0
        side = SKY_SHADE_SIDE if lit.emitter.sky == "pane" else SHADE_SIDE

        rows = wanted
        for _ in range(smoothings):
            with_neighbours: Rows = np.append(rows, layout.neighbours[:, rows])
            rows = self._may_lose(lit, moment, cells, with_neighbours)
        is_sparse = layout.is_sparse[rows]
        rest = rows[~is_sparse]
        weights = layout.weights[rest]
        read: Rows = np.append(rows[is_sparse], weights.indices)
        sparse = self._may_lose(lit, moment, cells, read)
        share = np.zeros(len(direct_lx), np.float32)
        sparse_lx = self._traced(lit.emitter, sparse, moment.movers, side)
        share[sparse] = sparse_lx / direct_lx[sparse]

        mean, is_unsure = _weighted_mean(weights, share, lit.has)
        share[rest] = np.where(is_unsure, 0, mean)
        asked = rest[is_unsure]
        asked_lx = self._traced(lit.emitter, asked, moment.movers, side)
        share[asked] = asked_lx / direct_lx[asked]
        for _ in range(smoothings):
            around = share[layout.neighbours[:, rows]].sum(0)
            share[rows] = (4 * share[rows] + around) / 8
        return wanted, share[wanted] * direct_lx[wanted]

    def _may_lose(
        self,
        lit: _Lit,
        moment: MoverLightAt,
        shaded: Mask,
        points: Rows,
    ) -> Rows:
        """Those of the points, each once, that have an emitter's light and may lose some of it.

        shaded (C,): the cells of which that is known; it is asked for others.
        """
        points = _distinct(points[lit.has[points]])
        cells = self._static.cells[points]
        others = np.zeros(len(shaded), bool)
        others[cells[~shaded[cells]]] = True
        may_lose = shaded | lit.shaded_cells(moment.balls, others)
        return points[may_lose[cells]]

    def _traced(
        self,
        emitter: Emitter,
        rows: Rows,
        movers: RayCaster,
        side: int,
    ) -> Floats:
        """The illuminance (N,) that movers take from the points at rows, by side x side rays each."""
        return chunked(lambda part: self._lost_at(emitter, rows[part], movers, side), len(rows))

    def _lost_at(
        self,
        emitter: Emitter,
        rows: Rows,
        movers: RayCaster,
        side: int,
    ) -> Floats:
        points = self._static.points.take(rows)
        towards = emitter.towards(points)
        lost_lx = np.zeros(len(points), np.float32)
        for cell in range(side**2):
            a, b = place_in_cell(points, cell, side)
            vectors_m, strength = towards(a, b)
            cosine = points.cosine(vectors_m)
            light_lx = strength * np.maximum(cosine, 0) * points.entering(cosine)
            aside_m = footprint_m(points, slice(None), cell)
            start_m = points.points_m + aside_m
            ahead_m = vectors_m - aside_m
            hit = np.flatnonzero(movers.stops(start_m, ahead_m) & (light_lx > 0))
            passing = emitter.passing(self._static.visibility, start_m[hit], ahead_m[hit])
            lost_lx[hit] += light_lx[hit] * passing
        return lost_lx / np.float32(side**2)


def _weighted_mean(
    weights: "csr_array",
    share: Floats,
    has: Mask,
) -> tuple[Floats, Mask]:
    """The mean (N,) of shares (P,) by the rows of weights (N, P), of points that have light; and which are unsure.

    A mean is unsure where the shares differ by more than UNSURE, or where there are none.
    """
    values = share[weights.indices]
    value_weights = weights.data * has[weights.indices]
    starts = weights.indptr[:-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        total = np.add.reduceat(value_weights, starts)
        mean = np.add.reduceat(value_weights * values, starts) / total
        mean_square = np.add.reduceat(value_weights * values**2, starts) / total
        deviation = np.sqrt(np.maximum(mean_square - mean**2, 0))
        is_sure = deviation <= UNSURE
    return mean, ~is_sure


NO_ROWS = np.zeros(0, np.int64)


def _distinct(points: Rows) -> Rows:
    """Each of the points (N,) once, in order."""
    points = np.sort(points)
    return np.asarray(points[np.diff(points, prepend=-1) > 0])


def spans(begins: Rows, rows: Rows) -> Rows:
    """All numbers from begins[i] to begins[i + 1] for each i among rows (N,), one after the other."""
    count = begins[rows + 1] - begins[rows]
    ends = np.cumsum(count)
    total = ends[-1] if len(ends) else 0
    shift = begins[rows] - ends + count  # from the place in the result to the number
    return np.asarray(np.arange(total) + np.repeat(shift, count))


def _cells(baked: BakedScene, static: StaticScene, by_cell: Rows) -> BoundingSphere:
    """Spheres (C,) around all places that read light of the cells of the stationary part."""
    faces = static.faces
    with np.errstate(divide="ignore", invalid="ignore"):
        face_px2 = np.abs(doubled_areas_px2(baked.atlas.light_px))
        texel_m = np.sqrt(2 * areas_m2(faces.corners_m) / face_px2)
    texel_m = np.where(np.isfinite(texel_m), texel_m, 0)
    cells = static.cells[by_cell]
    starts = np.flatnonzero(np.diff(cells, prepend=-1, append=-1))
    around = _balls(static.points.points_m[by_cell], starts)
    point_texel_m = texel_m[static.points.face[by_cell]]
    largest_m = np.maximum.reduceat(point_texel_m, starts[:-1])
    return BoundingSphere(around.centre_m, around.radius_m + READ_TEXELS * largest_m)


def _inside_m(cells: BoundingSphere, views: Views) -> Floats:
    """How far cells (C,) reach into what one of the views shows, at least; negative for how far they are from all."""
    farthest_m = np.full(len(cells.radius_m), -np.inf)
    for view, box in views:
        planes = bounds(view, box)
        normal_lengths = np.linalg.norm(planes[:, :3], axis=1)
        planes /= normal_lengths[:, None]
        heights_m = np.einsum("ij,kj->ik", planes[:, :3], cells.centre_m) + planes[:, 3:]
        farthest_m = np.maximum(farthest_m, heights_m.min(0) + cells.radius_m)
    return farthest_m


def _balls(points_m: Floats, starts: NDArray[np.int64]) -> BoundingSphere:
    """Spheres (C,) around points (N, 3) from each start (C + 1,) to the next."""
    if not len(points_m):
        return BoundingSphere(np.zeros((0, 3)), np.zeros(0))
    count = np.diff(starts)
    sums_m = np.add.reduceat(points_m.astype(float), starts[:-1])
    centre_m = sums_m / count[:, None]
    own_centre_m = np.repeat(centre_m, count, axis=0)
    distance_m = np.linalg.norm(points_m - own_centre_m, axis=1)
    return BoundingSphere(centre_m, np.maximum.reduceat(distance_m, starts[:-1]))


def _around(balls: BoundingSphere) -> BoundingSphere:
    """One sphere (1,) around several."""
    centre_m = balls.centre_m.mean(0)
    distance_m = np.linalg.norm(balls.centre_m - centre_m, axis=1)
    reach_m = distance_m + balls.radius_m
    return BoundingSphere(centre_m[None], reach_m.max(keepdims=True))


MOST_PARTS = 8


def parts(corners_m: Array) -> BoundingSphere:
    """Spheres (K,) that enclose faces (F, 3, 3) together: of those in slices across the longest side of their box."""
    points_m = corners_m.reshape(-1, 3)
    low_m = points_m.min(0)
    size_m = np.ptp(points_m, axis=0)
    longest = int(size_m.argmax())
    middle_size_m = max(np.sort(size_m)[1], 1e-3)
    count = int(np.clip(np.ceil(size_m[longest] / middle_size_m), 1, MOST_PARTS))
    part_m = np.where(np.arange(3) == longest, size_m / count, size_m)
    along = np.eye(3)[longest]
    steps_m = np.arange(count)[:, None] * along * part_m
    centres_m = low_m + part_m / 2 + steps_m
    radius_m = float(np.linalg.norm(part_m) / 2)
    return BoundingSphere(centres_m, np.full(count, radius_m))


def _moved(balls: BoundingSphere, T_world_body: NDArray[np.float64]) -> BoundingSphere:
    return BoundingSphere(se3.apply(T_world_body, balls.centre_m), balls.radius_m)
