"""Draws the views of a picture: batches of triangles, mirrors with their reflections, the background, and panes."""

from collections.abc import Mapping, Sequence

import numpy as np
from OpenGL import GL

from vobench.geometry import se3
from vobench.rendering.batch import Batch, Geometry
from vobench.rendering.culling import CullingSet, TriangleRuns
from vobench.rendering.draw_call import LAYERS_UNIT, DrawCalls
from vobench.rendering.framebuffer import Framebuffer, LayeredFramebuffer
from vobench.rendering.gl_texture import PanoramaTexture, bind
from vobench.rendering.planar_mirror import PlanarMirror
from vobench.rendering.probe import Probe, probe_share
from vobench.rendering.render_target import MIRRORS, RenderTarget
from vobench.rendering.shader_define import ShaderDefine
from vobench.rendering.view import Box, PinholeView, Plane, visible_boxes, within

# The largest number of mirrors whose reflections are drawn, at each depth of reflection. Other mirrors show the probe.
FOLLOWED = (6, 3, 2)
# The smallest share of the picture, times the reflectance of all mirrors on the way, for which a reflection is drawn.
LEAST_SHARE = 5e-4


class BatchDraw:
    """Draws batches of triangles onto targets. The OpenGL context must be current."""

    def __init__(
        self,
        geometry: Geometry,
        light: int,
        panoramas: Mapping[int, PanoramaTexture],
    ) -> None:
        self._calls = DrawCalls(geometry, light, panoramas)
        self._culling = CullingSet(geometry.clusters)
        self._mirrors = geometry.mirrors
        unmirrored = [batch for batch in geometry.batches if batch.mirror is None]
        # Small things are drawn first, so that the parts of large things behind them are not shaded.
        opaque = [batch for batch in unmirrored if not batch.is_pane]
        smallest_first = sorted(opaque, key=lambda batch: batch.area_m2)
        self._opaque = [batch for batch in smallest_first if not batch.has_holes]
        self._with_holes = [batch for batch in smallest_first if batch.has_holes]
        self._panes = [batch for batch in unmirrored if batch.is_pane]
        self._batches_of = {mirror.index: list[Batch]() for mirror in geometry.mirrors}
        for batch in geometry.batches:
            if batch.mirror is not None:
                self._batches_of[batch.mirror.index].append(batch)
        has_rough = any(batch.has_gloss for batch in unmirrored)
        self.needs_probe = has_rough or len(self._mirrors) > min(FOLLOWED)
        self._probe: Probe | None = None

    @property
    def mirrors_in_colour(self) -> bool:
        """Whether a surface tints its reflections or the light that it transmits."""
        for defines in self._calls.shader_defines:
            shows_others = bool(defines & {ShaderDefine.IS_PLANAR, ShaderDefine.IS_PANE})
            is_tinting = bool(defines & {ShaderDefine.IS_MIRROR, ShaderDefine.IS_PANE, ShaderDefine.HAS_METAL})
            if shows_others and is_tinting and ShaderDefine.IS_GREY not in defines:
                return True
        return False

    def use_probe(self, probe: Probe) -> None:
        """Use a probe, from now on, where the reflections of a mirror are not drawn."""
        self._probe = probe

    def views(self, view: PinholeView, box: Box) -> list[tuple[PinholeView, Box]]:
        """All views from which a picture is drawn, including those into mirrors, each with its box in the picture."""
        visible = self._culling.visible(view, box)
        views = [(view, box)]
        followed = self._followed(view, self._boxes(view, visible), box)
        for index, mirror_box in followed.items():
            mirror = self._mirrors[index]
            plane = _plane_towards(mirror, view)
            if plane and self._is_visible(mirror, visible):
                views += self.views(view.through(plane, strength=mirror.strength), mirror_box)
        return views

    def draw(self, view: PinholeView, target: RenderTarget, box: Box) -> None:
        """Draw a view in a box of the target's framebuffer for the depth of the view. The box must be clear."""
        visible = self._culling.visible(view, box)
        framebuffer = self._begin(view, target, box)
        self._draw_unmirrored(self._with_holes, visible, view, framebuffer, ShaderDefine.IS_SOLID)
        self._draw_unmirrored(self._opaque, visible, view, framebuffer)

        boxes = self._boxes(view, visible)
        followed = self._followed(view, boxes, box)
        mirrors = [self._mirrors[index] for index in boxes if self._is_visible(self._mirrors[index], visible)]
        for mirror in mirrors:
            if not mirror.is_pane:
                part = followed.get(mirror.index)
                self._draw_mirror(mirror, view, target, box=box, visible=visible, part=part)

        self._calls.draw_background(view, framebuffer, target.weights)
        # The rims of holes are blended over the background. The result does not depend on their order.
        self._draw_unmirrored(self._with_holes, visible, view, framebuffer, ShaderDefine.IS_RIM)
        self._draw_unmirrored(self._panes, visible, view, framebuffer)
        panes = [mirror for mirror in mirrors if mirror.is_pane]
        for mirror in sorted(panes, key=lambda pane: -_distance_m(pane, view)):
            part = followed.get(mirror.index)
            self._draw_mirror(mirror, view, target, box=box, visible=visible, part=part)

    def add(
        self,
        target: RenderTarget,
        total: Framebuffer,
        box: Box,
        share: float,
    ) -> None:
        """Add the mean of a target's samples in a box, times a share, to a total."""
        self._calls.add_mean(target, total, box, share)

    def _begin(self, view: PinholeView, target: RenderTarget, box: Box) -> LayeredFramebuffer:
        framebuffer = target.framebuffers[view.depth]
        framebuffer.bind(box)
        self._calls.begin_view(view, framebuffer, target.weights, self._probe)
        return framebuffer

    def _draw_unmirrored(
        self,
        batches: Sequence[Batch],
        visible: TriangleRuns,
        view: PinholeView,
        framebuffer: LayeredFramebuffer,
        *defines: ShaderDefine,
    ) -> None:
        """Draw the visible ones of batches that are not in the plane of a mirror. Glossy ones reflect the probe.

        `defines` are further preprocessor names for the shader.
        """
        for batch in batches:
            if batch.index in visible:
                shows_probe = self._probe and batch.has_gloss and probe_share(batch.material) > 0
                probe_defines = [ShaderDefine.HAS_PROBE] if shows_probe else []
                self._calls.draw_surface(batch, visible, view, framebuffer, frozenset([*probe_defines, *defines]))

    def _boxes(self, view: PinholeView, visible: TriangleRuns) -> dict[int, Box]:
        """The boxes in the picture of the mirrors whose reflecting side faces the camera.

        Invisible mirrors are omitted, unless there are more mirrors than are followed. Then the selection must be the
        same for every part of a picture.
        """
        is_choice = len(self._mirrors) > FOLLOWED[min(view.depth, MIRRORS - 1)]
        candidates = [mirror for mirror in self._mirrors if is_choice or self._is_visible(mirror, visible)]
        mirrors = [mirror for mirror in candidates if _plane_towards(mirror, view)]
        if not mirrors:
            return {}

        T_camera_world = se3.inverse(view.T_world_camera) @ view.images
        T_camera_movers = np.array([T_camera_world @ view.pose(mirror.mover) for mirror in mirrors])
        R_movers_camera = T_camera_movers[:, :3, :3].swapaxes(1, 2)
        outlines_m = np.array([mirror.outline_m for mirror in mirrors])
        outlines_camera_m = outlines_m @ R_movers_camera + T_camera_movers[:, None, :3, 3]

        whole = (0, view.camera.width_px, 0, view.camera.height_px)
        boxes = {}
        outline_boxes = visible_boxes(view.camera, outlines_camera_m).tolist()
        for mirror, outline_box in zip(mirrors, outline_boxes, strict=True):
            box = within(outline_box, whole)
            if box:
                boxes[mirror.index] = box
        return boxes

    def _is_visible(self, mirror: PlanarMirror, visible: TriangleRuns) -> bool:
        return any(batch.index in visible for batch in self._batches_of[mirror.index])

    def _followed(
        self,
        view: PinholeView,
        boxes: dict[int, Box],
        box: Box,
    ) -> dict[int, Box]:
        """The mirrors in a picture whose reflections are drawn, largest first, each with its box of pixels."""
        if view.depth == MIRRORS or (self.needs_probe and not self._probe):
            return {}
        least_px = LEAST_SHARE * view.camera.width_px * view.camera.height_px
        ranked = []
        for index, (u0, u1, v0, v1) in boxes.items():
            box_px = (u1 - u0) * (v1 - v0)
            shown_px = box_px * self._mirrors[index].strength * view.reflected_share
            ranked.append((shown_px, index))
        ranked.sort(reverse=True)

        followed = {}
        for shown_px, index in ranked[: FOLLOWED[view.depth]]:
            part = within(boxes[index], box)
            if shown_px > least_px and part:
                followed[index] = part
        return followed

    def _draw_mirror(
        self,
        mirror: PlanarMirror,
        view: PinholeView,
        target: RenderTarget,
        *,
        box: Box,
        visible: TriangleRuns,
        part: Box | None,
    ) -> None:
        """Draw the batches in the plane of a mirror.

        They reflect the scene in a part of the picture. If the part is None, they reflect the probe.
        """
        framebuffer = target.framebuffers[view.depth]
        plane = _plane_towards(mirror, view)
        is_last = view.depth == MIRRORS or not self._probe
        reflected = ShaderDefine.IS_LAST if is_last else ShaderDefine.HAS_PROBE
        if part and plane:
            reflections = target.framebuffers[view.depth + 1]
            reflections.clear(part)
            self.draw(view.through(plane, strength=mirror.strength), target, part)
            self._begin(view, target, box)
            bind(LAYERS_UNIT, reflections.colour_texture, GL.GL_TEXTURE_2D_ARRAY)
            reflected = ShaderDefine.HAS_REFLECTION
        for batch in self._batches_of[mirror.index]:
            if batch.index in visible:
                self._calls.draw_surface(batch, visible, view, framebuffer, frozenset({reflected}))


def _plane_towards(mirror: PlanarMirror, view: PinholeView) -> Plane | None:
    """The plane of a mirror, with its normal towards the camera.

    None if its reflecting side faces away, or if the view is the one into this mirror.
    """
    plane = view.plane(mirror.plane, mirror.mover)
    if plane.distance_m(view.eye_m) <= 0:
        plane = plane.flipped()
        if not mirror.is_pane:
            return None
    keys = (plane.key, plane.flipped().key)
    is_looked_into = view.mirror and view.mirror.key in keys
    return None if is_looked_into else plane


def _distance_m(mirror: PlanarMirror, view: PinholeView) -> float:
    """The distance of the nearest corner of a mirror from the camera."""
    T_camera_world = se3.inverse(view.T_world_camera) @ view.images
    T_camera_mover = T_camera_world @ view.pose(mirror.mover)
    corners_m = se3.apply(T_camera_mover, mirror.outline_m)
    return float(np.linalg.norm(corners_m, axis=-1).min())
