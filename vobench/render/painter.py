"""One picture of a lit scene: what scatters, mirrors with what they show, the background, then panes."""

from collections.abc import Iterable, Sequence

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.render.brush import Brush, bind_layers
from vobench.render.crowd import Crowd
from vobench.render.framebuffer import Canvas, Sum
from vobench.render.look import NEAR_M, Look
from vobench.render.mesh import Batch
from vobench.render.mirror import Box, Plane, visible_box
from vobench.render.paper import MIRRORS, Paper
from vobench.render.texture import FloatTexture
from vobench.scene.material import Glass, Mirror, Polished

Group = Sequence[Batch]


class Painter:
    """Draws batches onto paper, as long as its context is current."""

    def __init__(self, batches: Sequence[Batch], light: FloatTexture) -> None:
        self._brush, self._crowd = Brush(light), Crowd(batches)
        # Small things first: they hide much of what is large, which is then not shaded there.
        self._plain = sorted((batch for batch in batches if batch.plane is None), key=_area_m2)
        self._mirrors = _by_plane(batch for batch in batches if isinstance(batch.material, Polished | Mirror))
        self._panes = _by_plane(batch for batch in batches if isinstance(batch.material, Glass))

    def paint(self, look: Look, paper: Paper, box: Box) -> None:
        """Fill a box of the paper's canvas for as many mirrors as the look goes by, which must be clear there."""
        in_sight = self._crowd.in_sight(look, box)
        canvas = self._begin(look, paper, box)
        for batch in self._plain:
            if batch.index in in_sight:
                self._brush.surface(batch, look, canvas.layers)
        for group in _among(in_sight, self._mirrors):
            self._draw_mirror(group, look, paper, box)
        self._brush.background(look, canvas.layers)
        for group in sorted(_among(in_sight, self._panes), key=lambda panes: -_nearest_m(panes, look)):
            self._draw_mirror(group, look, paper, box)

    def add(self, canvas: Canvas, total: Sum, box: Box, weight: float) -> None:
        """Add a box of a canvas, weighted, to a total."""
        total.begin(box)
        self._brush.mean(canvas, weight)

    def delete(self) -> None:
        """Free everything on the graphics side."""
        self._brush.delete()

    def _begin(self, look: Look, paper: Paper, box: Box) -> Canvas:
        canvas = paper.canvases[look.depth]
        canvas.begin(box)
        self._brush.begin(look, canvas)
        return canvas

    def _draw_mirror(self, group: Group, look: Look, paper: Paper, box: Box) -> None:
        """What lies in one plane, with what it mirrors; nothing where the picture does not show it."""
        plane = _plane_towards(look.eye_m, group[0], look)
        if plane is None or _lies_in(look.mirror, group[0], look):
            return
        copies = paper.canvas.layers
        if look.depth == MIRRORS:
            for batch in group:
                self._brush.surface(batch, look, copies)
            return
        rough = [batch for batch in group if _is_rough(batch)]
        within = paper.whole if rough else box  # a rough one gathers from beyond a strip
        seen = visible_box(look.camera, _in_camera(group, look), within, near_m=NEAR_M)
        if seen is None:
            return
        self._reflect(look.through(plane), paper, seen)
        if rough:
            self._draw_haze(group, plane, look, paper)
        self._begin(look, paper, box)
        bind_layers(paper.canvases[look.depth + 1].colour)
        for batch in group:
            abilities = ("HAS_REFLECTION", "HAS_HAZE") if batch in rough else ("HAS_REFLECTION",)
            self._brush.surface(batch, look, copies, *abilities)

    def _reflect(self, look: Look, paper: Paper, box: Box) -> None:
        """What a mirror shows is painted as everything is, by way of one mirror more."""
        paper.canvases[look.depth].clear(box)
        self.paint(look, paper, box)

    def _draw_haze(self, group: Group, plane: Plane, look: Look, paper: Paper) -> None:
        """Spread the reflections in a plane, for the rough mirrors in it to look up."""
        program = self._brush.programs.settle()
        self._brush.begin(look, paper.canvas)
        paper.haze.settle(paper.canvases[look.depth + 1], program)
        for batch in group:
            self._brush.flat(batch, look, program)
        paper.haze.finish()
        for batch in filter(_is_rough, group):
            self._brush.haze(batch, look, [*plane.normal, plane.offset_m])
        paper.haze.bind()


def _among(in_sight: set[int], groups: Sequence[Group]) -> list[Group]:
    return [group for group in groups if any(batch.index in in_sight for batch in group)]


def _area_m2(batch: Batch) -> float:
    corner, along, _, up = np.moveaxis(batch.quads_m, 1, 0)
    return float(np.linalg.norm(np.cross(along - corner, up - corner), axis=-1).sum())


def _by_plane(batches: Iterable[Batch]) -> list[list[Batch]]:
    """Batches that lie in one plane of one thing, together."""
    groups: dict[tuple[object, ...], list[Batch]] = {}
    for batch in batches:
        if batch.plane is not None:
            groups.setdefault((batch.mover, batch.plane.key), []).append(batch)
    return list(groups.values())


def _is_rough(batch: Batch) -> bool:
    return isinstance(batch.material, Polished | Mirror) and batch.material.roughness > 0


def _plane_towards(eye_m: Array, batch: Batch, look: Look) -> Plane | None:
    """The plane of a batch with its normal towards the eye; None where its mirroring side is not seen."""
    if batch.plane is None:
        return None
    plane = look.plane(batch.plane, batch.mover)
    if plane.distance_m(eye_m) > 0:
        return plane
    return plane.flipped() if isinstance(batch.material, Glass) else None


def _lies_in(plane: Plane | None, batch: Batch, look: Look) -> bool:
    if plane is None or batch.plane is None:
        return False
    here = look.plane(batch.plane, batch.mover)
    return plane.key in (here.key, here.flipped().key)


def _in_camera(group: Group, look: Look) -> Array:
    """Corners (K, 4, 3) of a group's rectangles as the camera sees them."""
    T_camera_mover = look.T_camera_world @ look.pose(group[0].mover)
    return se3.apply(T_camera_mover, np.concatenate([batch.quads_m for batch in group]))


def _nearest_m(group: Group, look: Look) -> float:
    """How far away a group begins."""
    return float(np.linalg.norm(_in_camera(group, look), axis=-1).min())
