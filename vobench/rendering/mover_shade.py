"""The light map as it is drawn: that of the stationary scene, with the shadows of movers and the light on them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.batch import morton
from vobench.rendering.culling import bounds
from vobench.rendering.geometry import BoundingSphere
from vobench.rendering.gl_texture import TiledLightTexture
from vobench.rendering.mover_kernels import (
    TILE,
    EmitterAt,
    LightMap,
    MovingParts,
    ShadowMaps,
    add_light_on_points,
    draw_map,
    mark_in_views,
    take_shaded,
)
from vobench.rendering.mover_light import MoverLight, MoverLightAt
from vobench.rendering.sampled_emitter import SampledEmitter
from vobench.rendering.texel_owner import Owners, owners
from vobench.rendering.view import Box, PinholeView
from vobench.scene.light import Steady

Views = Sequence[tuple[PinholeView, Box]]
BLOCK = 64  # the number of nearby sites that are shaded or culled together
WIDEST_M = 0.04  # the largest distance between texels that share a site for soft light
READ_M = 0.1  # the distance from the visible surfaces up to which a view reads the light map
SHADOW_PX = 64  # the side of one shadow map
UNNOTICED = 1 / 150  # the largest invisible share of the direct light at a site, about one step of 8 bits
PLACED = 100_000  # the number of texels whose positions are computed at a time
MOST_PLANES = 6  # that bound a view


@dataclass(frozen=True, slots=True)
class Sites:
    """P points of the stationary scene at which shadows are computed. Nearby sites are in the same block.

    `texels` (P,) are the indices of the sites' texels in the light map, `rows` and `columns` (P,) their places there.
    `places_m` and `normals` (P, 3) are their positions and normals.
    `width_px` (P,) is 1, or 2 for a site that represents 2 x 2 texels, of which its own has the smallest index.
    `blocks` are the bounding spheres (N,) of the blocks.
    """

    texels: Rows
    rows: Indices
    columns: Indices
    places_m: Floats
    normals: Floats
    width_px: Indices
    blocks: BoundingSphere

    def of_site(self, values: Floats, map_width: int) -> Floats:
        """The smallest value (P,) of a map (H·W,) among the texels of each site."""
        least = values[self.texels]
        wide = np.flatnonzero(self.width_px == 2)
        for step in (1, map_width, map_width + 1):
            least[wide] = np.minimum(least[wide], values[self.texels[wide] + step])
        return least

    def seen(self, views: Views) -> Mask:
        """Which blocks (N,) are in one of the views, or so close that a view reads their light."""
        planes = np.zeros((len(views), MOST_PLANES, 4))
        for nth, (view, box) in enumerate(views):
            view_planes = bounds(view, box)
            planes[nth, : len(view_planes)] = view_planes / np.linalg.norm(view_planes[:, :3], axis=1, keepdims=True)
        result = np.zeros(len(self.blocks.radius_m), bool)
        mark_in_views(self.blocks.centre_m, self.blocks.radius_m, planes.astype(np.float32), READ_M, result)
        return result


def _sites(baked: BakedScene, owner: Owners, *, widest_m: float) -> Sites:
    """The sites of all stationary faces. Blocks of 2 x 2 texels up to `widest_m` apart in one plane share a site."""
    faces = baked.faces
    width = baked.atlas.width
    texels = np.flatnonzero((owner.face >= 0) & (faces.mover[owner.face] < 0))
    places_m = np.zeros((len(owner.face), 3), np.float32)
    for start in range(0, len(texels), PLACED):
        part = texels[start : start + PLACED]
        weights = np.column_stack([1 - owner.uv[part].sum(1), owner.uv[part]])
        places_m[part] = np.einsum("ni,nij->nj", weights, faces.corners_m[owner.face[part]])
    width_px = np.ones(len(texels), np.int64)
    if widest_m:
        row, column = np.divmod(texels, width)
        is_first = (row % 2 == 0) & (column % 2 == 0) & (row + 1 < baked.atlas.height) & (column + 1 < width)
        first = texels[is_first]
        is_whole = np.ones(len(first), bool)
        thing = np.where(owner.face >= 0, faces.thing[owner.face], -1)
        for step in (1, width, width + 1):
            other = first + step
            is_whole &= thing[other] == thing[first]
            is_whole &= (faces.plane[owner.face[other]] == faces.plane[owner.face[first]]).all(1)
            apart_m = np.linalg.norm(places_m[other] - places_m[first], axis=1)
            is_whole &= apart_m <= widest_m
        first = first[is_whole]
        is_covered = np.zeros(len(owner.face), bool)
        for step in (1, width, width + 1):
            is_covered[first + step] = True
        is_wide = np.zeros(len(owner.face), bool)
        is_wide[first] = True
        texels = texels[~is_covered[texels]]
        width_px = np.where(is_wide[texels], 2, 1)
        places_m[first] = (places_m[first] + places_m[first + width + 1]) / 2
    places_m = places_m[texels]
    if len(texels):
        order = np.argsort(morton(places_m.astype(float)), kind="stable")
        texels = texels[order]
        places_m = places_m[order]
        width_px = width_px[order]
    low_m, high_m = _block_boxes(places_m)
    rows, columns = np.divmod(texels.astype(np.int32), width)
    return Sites(
        texels=texels,
        rows=rows,
        columns=columns,
        places_m=places_m,
        normals=faces.plane[owner.face[texels]].astype(np.float32),
        width_px=width_px.astype(np.int32),
        blocks=_around(low_m, high_m),
    )


def _block_boxes(places_m: Floats) -> tuple[Floats, Floats]:
    """The lower and the upper corners (N, 3) of the bounding boxes of the blocks of points (P, 3)."""
    if not len(places_m):
        return places_m, places_m
    starts = np.arange(0, len(places_m), BLOCK)
    return np.minimum.reduceat(places_m, starts), np.maximum.reduceat(places_m, starts)


def _around(low_m: Floats, high_m: Floats) -> BoundingSphere:
    """The spheres (N,) around boxes with these corners (N, 3), in float32."""
    centre_m = (low_m + high_m) / 2
    return BoundingSphere(centre_m, np.linalg.norm(high_m - low_m, axis=1) / 2)


def sky_shares(movers: MoverLight, sampled: Sequence[SampledEmitter], sites: Sites) -> Floats:
    """The share (E, P) of a light's illuminance at each site that comes from each emitter; equal within a block."""
    middles = np.minimum(np.arange(len(sites.blocks.radius_m)) * BLOCK + BLOCK // 2, len(sites.texels) - 1)
    shares = movers.sky_shares(sampled, sites.places_m[middles], sites.normals[middles])
    return np.repeat(shares.T, BLOCK, axis=1)[:, : len(sites.texels)]


def tile_runs(tiles: Mask, height: int, width: int) -> Iterator[tuple[slice, slice]]:
    """The rows and columns of a map (height, width) in each run of marked tiles beside one another."""
    for tile_row in np.flatnonzero(tiles.any(1)).tolist():
        rows = slice(tile_row * TILE, min((tile_row + 1) * TILE, height))
        edges = np.flatnonzero(np.diff(tiles[tile_row].astype(np.int8), prepend=0, append=0))
        for first, end in edges.reshape(-1, 2).tolist():
            yield rows, slice(first * TILE, min(end * TILE, width))


class ShadedLight:
    """The texture of the light map of a scene with movers.

    `update` uploads the light without movers. `shade` adds their shadows and the light on them.
    Shadows are computed only where a view shows them. The value of a texel does not depend on the views.
    """

    def __init__(self, baked: BakedScene, values: Floats) -> None:
        owner = owners(baked.atlas)
        self._movers = MoverLight(baked, owner)
        height, width = baked.direct.shape[1:]
        lights = baked.scene.lights
        sampled = self._movers.emitters(tuple(0.0 for _ in lights))
        soft_sites = _sites(baked, owner, widest_m=WIDEST_M)
        is_any_hard = any(emitter.is_hard for emitter in sampled)
        hard_sites = _sites(baked, owner, widest_m=0) if is_any_hard else soft_sites
        self._site_sets = (soft_sites, hard_sites)
        shares = sky_shares(self._movers, sampled, soft_sites)
        direct_lx = baked.direct.reshape(len(lights), -1)
        steady_lx = np.zeros(direct_lx.shape[1], np.float32)
        for light, layer in zip(lights, direct_lx, strict=True):
            if isinstance(light.level, Steady) and not light.moves:
                steady_lx += np.float32(light.level.mean(0, 0)) * layer

        self._steady_lx = [sites.of_site(steady_lx, width) for sites in self._site_sets]
        self._kind = [int(emitter.is_hard) for emitter in sampled]  # the set of sites of each emitter
        self._direct_lx: list[Floats] = []
        self._is_lit: list[Mask] = []
        for nth, emitter in enumerate(sampled):
            share = 1.0 if emitter.is_hard else shares[nth]
            kind = self._kind[nth]
            site_lx = share * self._site_sets[kind].of_site(direct_lx[emitter.light], width)
            noticed_lx = _noticed(site_lx, self._steady_lx[kind])
            self._direct_lx.append(noticed_lx)
            self._is_lit.append(_any_in_block(noticed_lx > 0))

        tiles = (-(-height // TILE), -(-width // TILE))  # rounded up
        self._base: Floats | None = None
        self._drawn = np.zeros((height, width, 3), np.float32)
        self._differs = np.zeros(tiles, bool)  # the tiles in which `_drawn` is not `_base`
        self._is_new = np.zeros(tiles, bool)  # the tiles that are to be uploaded
        self._texture = TiledLightTexture(width, height)
        self.id = self._texture.id
        self._key: object = None
        self._moment: _Moment | None = None
        self.update(values)

    def update(self, values: Floats) -> None:
        """Show a light map (H, W, 3) without movers. An array that is already shown is not uploaded again."""
        if values is self._base and self._key is None:
            return
        self._restore(values)
        self._upload()

    def _restore(self, values: Floats) -> None:
        """Copy a light map without movers to the drawn one, as far as they differ."""
        if values is self._base:
            for rows, columns in tile_runs(self._differs, *values.shape[:2]):
                self._drawn[rows, columns] = values[rows, columns]
            self._is_new |= self._differs
        else:
            self._base = values
            self._drawn[:] = values
            self._is_new[:] = True
        self._differs[:] = False
        self._key = None
        self._moment = None

    def _upload(self) -> None:
        self._texture.replace(self._drawn, tile_runs(self._is_new, *self._drawn.shape[:2]))
        self._is_new[:] = False

    def shade(
        self,
        values: Floats,
        t_ns: float,
        suns_ns: Sequence[float],
        colours: Floats,
        views: Views,
    ) -> None:
        """Show a light map (H, W, 3) with the movers at a time, for lights with colours (L, 3) times their levels.

        Shadows may be missing where no view shows them.
        """
        if not self._movers.bodies:
            self.update(values)
            return
        key = (self._movers.poses(t_ns).tobytes(), tuple(suns_ns), colours.tobytes(), id(values))
        if key != self._key or self._moment is None:
            self._restore(values)
            self._key = key
            self._moment = _Moment(self._movers.at(t_ns, suns_ns), colours, self._site_sets)
            self._light_movers(self._moment)
        moment = self._moment
        for kind, sites in enumerate(self._site_sets):
            blocks = sites.seen(views) & ~moment.is_drawn[kind]
            moment.is_drawn[kind] |= blocks
            for nth in range(len(self._kind)):
                if self._kind[nth] == kind:
                    self._take(moment, nth, blocks & self._is_lit[nth])
        self._upload()

    def _take(self, moment: "_Moment", nth: int, blocks: Mask) -> None:
        """Subtract the light of an emitter that movers block, in the marked blocks (N,)."""
        if not moment.is_blocked[nth] or not blocks.any():
            return
        kind = self._kind[nth]
        sites = self._site_sets[kind]
        changed = np.zeros_like(self._differs)
        take_shaded(
            sites.places_m,
            sites.normals,
            sites.rows,
            sites.columns,
            sites.width_px,
            self._steady_lx[kind],
            self._direct_lx[nth],
            np.flatnonzero(blocks),
            BLOCK,
            sites.blocks.centre_m,
            sites.blocks.radius_m,
            moment.occluders,
            moment.emitters[nth],
            moment.maps,
            moment.colours[nth],
            LightMap(self._drawn, changed),
        )
        self._mark(changed)

    def _light_movers(self, moment: "_Moment") -> None:
        """Add the light on movers."""
        at = moment.at
        light_lx = at.gathered(moment.light_colours).astype(np.float32)
        no_light_lx = np.zeros(len(light_lx), np.float32)
        hard_row = 0
        for nth, emitter in enumerate(moment.emitters):
            hard_lx = no_light_lx
            if emitter.is_hard:
                hard_lx = at.hard[hard_row]
                hard_row += 1
            if not moment.is_lighting[nth]:
                continue
            add_light_on_points(
                at.points_m,
                at.normals,
                at.eta,
                at.probe_place,
                hard_lx,
                moment.occluders,
                len(self._movers.bodies),
                emitter,
                moment.maps,
                moment.colours[nth],
                light_lx,
            )
        texels = self._movers.texels
        self._drawn.reshape(-1, 3)[texels] += light_lx
        rows, columns = np.divmod(texels, self._drawn.shape[1])
        changed = np.zeros_like(self._differs)
        changed[rows // TILE, columns // TILE] = True
        self._mark(changed)

    def _mark(self, changed: Mask) -> None:
        """Note the tiles that have changed."""
        self._differs |= changed
        self._is_new |= changed


class _Moment:
    """The movers and the light around them at an instant, as the kernels take them.

    `emitters` (E,) and the `colours` (E, 3) of their lights, times the levels of these.
    `is_lighting` (E,) are the emitters whose light reaches bodies, `is_blocked` (E,) those whose light they block.
    `is_drawn` has for each set of sites the blocks (N,) whose shadows are in the light map.
    """

    def __init__(self, at: MoverLightAt, light_colours: Floats, site_sets: Sequence[Sites]) -> None:
        self.at = at
        self.light_colours = light_colours
        self.is_drawn = [np.zeros(len(sites.blocks.radius_m), bool) for sites in site_sets]
        self.maps = _shadow_maps(at)
        self.occluders = MovingParts(
            at.spheres.centre_m.astype(np.float32),
            at.spheres.radius_m.astype(np.float32),
            at.sphere_body.astype(np.int32),
        )
        self.emitters = [_emitter_at(at, nth) for nth in range(len(at.emitters))]
        self.colours = [light_colours[emitter.light].astype(np.float32) for emitter in at.emitters]
        is_on = [bool(colour.any()) for colour in self.colours]
        reaches_probes = [bool(emitter.reach.any()) for emitter in self.emitters]
        reaches_bodies = [bool(emitter.strength.any()) for emitter in self.emitters]
        self.is_lighting = np.array(is_on) & np.array(reaches_probes)
        self.is_blocked = np.array(is_on) & np.array(reaches_bodies)


def _shadow_maps(at: MoverLightAt) -> ShadowMaps:
    """The shadow map of each body for every sample whose light reaches it."""
    matrices = np.ascontiguousarray(at.maps, np.float32)
    nearness = np.zeros((len(matrices), SHADOW_PX, SHADOW_PX), np.float32)
    has_position = at.places[:, 3] > 0
    for corners_m, numbers in zip(at.occluders_m, at.map_of, strict=True):
        triangles_m = corners_m.astype(np.float32)
        for sample in np.flatnonzero(numbers >= 0):
            number = numbers[sample]
            draw_map(triangles_m, matrices[number], has_position[sample], nearness[number])
    return ShadowMaps(matrices, nearness)


def _emitter_at(at: MoverLightAt, nth: int) -> EmitterAt:
    """An emitter with what reaches the bodies of its light."""
    emitter = at.emitters[nth]
    first, count = at.sample_range(nth)
    samples = slice(first, first + count)
    body_count = len(at.map_of)
    radius_m = emitter.ball.radius_m if np.isfinite(emitter.ball.radius_m) else -1.0
    return EmitterAt(
        centre_m=np.asarray(emitter.ball.centre_m, np.float32),
        radius_m=cast("float", np.float32(radius_m)),  # the kernels compute in float32
        is_hard=emitter.is_hard,
        places=at.places[samples],
        axes=at.axes[samples],
        strength=at.reach[-body_count:, samples].mean(0),
        reach=np.ascontiguousarray(at.reach[:-body_count, samples]),
        map_of=np.ascontiguousarray(at.map_of[:, samples]),
    )


def _noticed(site_lx: Floats, steady_lx: Floats) -> Floats:
    """The direct light (P,) of an emitter at sites, 0 where it is too weak beside all steady light to be visible."""
    is_noticed = site_lx > UNNOTICED * (steady_lx + site_lx)
    return np.where(is_noticed, site_lx, 0).astype(np.float32)


def _any_in_block(marked: Mask) -> Mask:
    """Which blocks (N,) have a marked site, given which sites (P,) are marked."""
    if not len(marked):
        return np.zeros(0, bool)
    return np.asarray(np.logical_or.reduceat(marked, np.arange(0, len(marked), BLOCK)))
