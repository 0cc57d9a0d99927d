"""Pictures of one baked scene: its light brought up to date, its movers put in place, strips and sub-frames added."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.render.bake import BakedScene
from vobench.render.culling import batches
from vobench.render.draw import BatchDraw, RenderTarget, render_target
from vobench.render.illumination import AmbientLight, Background, Illumination
from vobench.render.opengl import CENTRE, HALVES, TURNED, FloatTexture
from vobench.render.renderer import Radiance, View
from vobench.render.view import Box, PinholeView, pinhole_view
from vobench.render.warp import Warp, warp


class FrameRenderer:
    """Draws in the context that is current when it is made, and must be current when it is used."""

    def __init__(self, baked: BakedScene) -> None:
        self._illumination, self._background = Illumination(baked), Background(baked.scene.lights)
        self._ambient, self._movers = AmbientLight(baked), baked.scene.movers
        self._light = FloatTexture(self._illumination.at(0, 0))
        self._draw = BatchDraw(batches(baked, copies=len(TURNED.points)), self._light)
        self._target, self._warp = cache(render_target), cache(warp)

    def picture(self, camera: Camera, views: Sequence[View]) -> Radiance:
        """Luminance (H, W) of views that tile a picture's rows, each with the same number of sub-frames."""
        _check(camera, views)
        if isinstance(camera, Pinhole):
            boxes = [(0, camera.width_px, view.rows.start, view.rows.stop) for view in views]
            count = len(views[0].start_ns)
            # Sub-frames of even number, four or more, share the samples between them at half the cost.
            grids = HALVES if count >= 4 and count % 2 == 0 else (TURNED,)
            targets = [self._target(camera.width_px, camera.height_px, grid) for grid in grids]
            self._expose(targets, camera, views, boxes, targets[0].total.whole)
            return targets[0].total.read(targets[0].total.whole)
        lens = self._warp(camera)
        return np.concatenate([self._strip(lens, view) for view in sorted(views, key=lambda v: v.rows.start)])

    def _strip(self, lens: Warp, view: View) -> Radiance:
        atlas = lens.blank()
        for face in lens.faces:
            box = face.needed_for(view.rows)
            if box is None:
                continue
            target = self._target(face.camera.width_px, face.camera.height_px, CENTRE)
            T_world_face = view.T_world_camera @ se3.transform(face.R_camera_face, np.zeros(3))
            self._expose([target], face.camera, [replace(view, T_world_camera=T_world_face)], [box], box)
            lens.put(atlas, face, box, target.total.read(box))
        return lens.picture(atlas, view.rows)

    def _expose(
        self, targets: Sequence[RenderTarget], camera: Pinhole, views: Sequence[View], boxes: Sequence[Box], around: Box
    ) -> None:
        """The mean over sub-frames, drawn on the targets by turns, of all views, each in its box.

        It is in the first target's total, in the box around all boxes.
        """
        count, total = len(views[0].start_ns), targets[0].total
        total.clear(around)
        for index in range(count):
            target = targets[index % len(targets)]
            target.canvas.clear(around)
            for view, box in zip(views, boxes, strict=True):
                self._draw.draw(self._view(camera, view, index), target, box)
            self._draw.add(target, total, around, 1 / count)

    def _view(self, camera: Pinhole, view: View, index: int) -> PinholeView:
        start_ns, end_ns = int(view.start_ns[index]), int(view.end_ns[index])
        light = self._illumination.at(start_ns, end_ns)
        self._light.update(light)
        poses = [mover.path.pose((start_ns + end_ns) / 2) for mover in self._movers]
        skies = self._background.coefficients(start_ns, end_ns)
        return pinhole_view(camera, view.T_world_camera[index], poses, skies, self._ambient.cd_m2(light))


def _check(camera: Camera, views: Sequence[View]) -> None:
    edges = sorted((view.rows.start, view.rows.stop) for view in views)
    ends = [0, *(stop for _, stop in edges)]
    if [start for start, _ in edges] != ends[:-1] or ends[-1] != camera.height_px:
        raise ValueError(f"views must tile the rows 0 to {camera.height_px}, these cover {edges}")
    if len({len(view.start_ns) for view in views}) != 1:
        raise ValueError("views of one picture must have the same number of sub-frames")
