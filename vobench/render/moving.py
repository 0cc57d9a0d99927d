"""Movers in the light: what shines on them where they are, and what they keep from the rest.

Direct light is by rays; indirect light on movers is gathered from the map of what stands still. Movers
neither shade nor return indirect light.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.render.bake import BakedScene, Stage, reached
from vobench.render.direct import arriving, first_rays
from vobench.render.geometry import Floats, Inventory, inventory
from vobench.render.image import images
from vobench.render.indirect import Gathering, answers, gathering
from vobench.render.lightmap import Layout, Scales, layout
from vobench.render.shade import Shade, Shaded, Target, blocks
from vobench.render.sight import Sight
from vobench.render.source import OpenSky, Source, sources
from vobench.render.texels import Texels, texels
from vobench.scene.light import Sky, Sun
from vobench.scene.surface import Surface
from vobench.scene.texture import Map

GATHER_RAYS = 64
GATHER_SPACING_M = 0.2
SKY_SHARE = 0.05  # of all points
UNNOTICED = 1 / 300  # share of a place's light, less than a step of 8 bits


@dataclass(frozen=True, slots=True)
class Moment:
    """Movers at one instant: each light's direct light (L, P) on their points, and what they shade of it.

    gathered: what reaches their coarse points, at `coarse` (C,) in the coarse map.
    """

    index: NDArray[np.int64]
    direct: Floats
    shaded: tuple[tuple[Shaded, ...], ...]
    gathered: Gathering
    coarse: NDArray[np.int64]


class MoverLight:
    """The light of a baked scene's movers."""

    def __init__(self, baked: BakedScene, still: Stage) -> None:
        self._scene, self._settings, self._still = baked.scene, baked.settings, still
        self._shade = Shade(still.points, still.where, blocks(still.points, still.where), still.sight)
        self._movers = tuple(np.flatnonzero(still.things.mover >= 0).tolist())
        self._scales = Scales(still.where, layout(still.things.surfaces, spacing_m=GATHER_SPACING_M))
        self._answer = answers(still.things.surfaces, self._scene.materials, baked.albedo, still.things.panel)
        self._skies = [light for light in self._scene.lights if isinstance(light, Sky)]
        self._targets = [self._seen(sources(light, still.sight)) for light in self._scene.lights]
        self._layers = baked.light.reshape(len(baked.light), -1)

    def at(self, t_ns: float, suns_ns: Sequence[float], is_on: Sequence[bool]) -> Moment:
        """All that the movers' places decide.

        suns_ns (L,): when to look for each sun that moves; is_on (L,): which lights shine at all.
        """
        things, side = inventory(self._scene, t_ns=t_ns), round(np.sqrt(self._settings.light_rays))
        lit = self._points(things, self._still.where)
        sight = Sight(things.surfaces, self._scene.materials, range(len(things.surfaces)))
        shining = [self._shining(index, suns_ns[index]) if on else [] for index, on in enumerate(is_on)]
        movers = [sides for index in range(len(self._scene.movers)) if (sides := self._opaque(things, index))]
        direct = np.zeros((len(shining), len(lit)), np.float32)
        for row, light, targets, sun_ns in zip(direct, self._scene.lights, shining, suns_ns, strict=True):
            shown = images(light, sight, t_ns=sun_ns) if targets else []
            for source in [*(target.source for target in targets), *shown]:
                for rays, some in first_rays(source, lit, side):
                    row[some] += arriving(source, lit.take(some), sight, rays)[0]
        least_lx = (UNNOTICED * np.asarray(is_on, np.float32) @ self._layers)[self._still.points.index]
        shaded = tuple(tuple(self._shade.by(movers, target, least_lx) for target in targets) for targets in shining)
        coarse = self._points(things, self._scales.coarse)
        return Moment(lit.index, direct, shaded, self._gathered(coarse), coarse.index)

    def add(self, moment: Moment, total: Map, levels: Sequence[float]) -> None:
        """Put the movers' light and shade into the sum of all layers (H, W) of what stands still."""
        flat = total.reshape(-1)
        for level, parts in zip(levels, moment.shaded, strict=True):
            for part in parts:
                place = self._still.points.index[part.some]
                flat[place] = np.maximum(flat[place] - np.float32(level) * part.lost, 0)
        of_sky = [level for level, light in zip(levels, self._scene.lights, strict=True) if isinstance(light, Sky)]
        around = np.zeros((1, self._scales.coarse.height * self._scales.coarse.width), np.float32)
        around[0, moment.coarse] = moment.gathered.table @ flat + np.asarray(of_sky, np.float32) @ moment.gathered.sky
        on_map = around.reshape(1, self._scales.coarse.height, -1)
        indirect = self._scales.refined(on_map, self._movers).reshape(-1)
        flat[moment.index] = np.asarray(levels, np.float32) @ moment.direct + indirect[moment.index]

    def _points(self, things: Inventory, where: Layout) -> Texels:
        materials, seed = self._scene.materials, self._settings.seed
        return texels(things.surfaces, materials, where, among=self._movers, seed=seed)

    def _gathered(self, coarse: Texels) -> Gathering:
        where, sight = self._still.where, self._still.sight
        rays = GATHER_RAYS if self._settings.bounces else 0
        return gathering(coarse, where, sight, self._answer, self._skies, rays=rays)

    def _shining(self, index: int, t_ns: float) -> list[Target]:
        light = self._scene.lights[index]
        if isinstance(light, Sun) and light.moves:
            return [Target(source) for source in sources(light, self._still.sight, t_ns=t_ns)]
        return self._targets[index]

    def _seen(self, parts: list[Source]) -> list[Target]:
        """All but an open sky that few points see, such as undersides of things that stand on the floor."""
        some = [reached(source, self._still).mean() if isinstance(source, OpenSky) else 1 for source in parts]
        return [Target(source) for source, share in zip(parts, some, strict=True) if share > SKY_SHARE]

    def _opaque(self, things: Inventory, mover: int) -> list[Surface]:
        return [things.surfaces[i] for i in np.flatnonzero((things.mover == mover) & ~things.pane)]
