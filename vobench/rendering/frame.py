"""Pictures of one baked scene: its light brought up to date, its movers put in place, strips and sub-frames added."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.bake import BakedScene
from vobench.rendering.batch import geometry
from vobench.rendering.draw import BatchDraw
from vobench.rendering.illumination import AmbientLight, Background, Illumination
from vobench.rendering.opengl import CENTRE, HALVES, TURNED, LightTexture
from vobench.rendering.probe import Probe, glints, room_probe
from vobench.rendering.render_target import RenderTarget, render_target
from vobench.rendering.renderer import Radiance, View
from vobench.rendering.view import NO_GLINTS, Box, PinholeView, pinhole_view
from vobench.rendering.warp import Warp, warp
from vobench.scene.light import STEADY, Steady
from vobench.scene.material import Rgb
from vobench.scene.mesh import Triangles

AWAY_M = 1e6  # where movers are while the probe is drawn


class FrameRenderer:
    """Draws in the context that is current when it is made, and must be current when it is used."""

    def __init__(self, baked: BakedScene) -> None:
        self._illumination = Illumination(baked)
        self._background = Background(baked.scene.lights)
        self._ambient = AmbientLight(baked)
        self._movers = baked.scene.movers
        self._light = LightTexture(self._illumination.without_movers(0, 0))
        drawn = geometry(baked.faces, baked.light_uv, baked.scene.materials)
        self._draw = BatchDraw(drawn, self._light)
        self._lights = baked.scene.lights
        self._target = cache(partial(render_target, in_colour=self._draw.mirrors_in_colour))
        self._warp = cache(warp)
        if self._draw.needs_probe:
            self._draw.use_probe(self._room_probe(baked, baked.faces))

    def picture(self, camera: Camera, views: Sequence[View], weights: Rgb | None) -> Radiance:
        """Luminance of views that tile a picture's rows, each with the same number of sub-frames; see `Renderer`."""
        _check(camera, views)
        if isinstance(camera, Pinhole):
            boxes = [(0, camera.width_px, view.rows.start, view.rows.stop) for view in views]
            count = len(views[0].start_ns)
            # Sub-frames of even number, four or more, share the samples between them at half the cost.
            grids = HALVES if count >= 4 and count % 2 == 0 else (TURNED,)
            targets = [self._target(camera.width_px, camera.height_px, grid, weights) for grid in grids]
            self._expose(targets, camera, views, boxes, targets[0].total.whole)
            return targets[0].total.read(targets[0].total.whole)
        lens = self._warp(camera)
        ordered = sorted(views, key=lambda v: v.rows.start)
        return np.concatenate([self._strip(lens, view, weights) for view in ordered])

    def _room_probe(self, baked: BakedScene, faces: Triangles) -> Probe:
        """The probe of what stands still, with every lamp that varies at level 1."""
        lights = tuple(one if isinstance(one.level, Steady) else replace(one, level=STEADY) for one in self._lights)
        light = self._illumination.without_movers(0, 0)
        skies = _skies(Background(lights), 0, 0)
        if not all(isinstance(one.level, Steady) for one in self._lights):
            light = Illumination(replace(baked, scene=replace(baked.scene, lights=lights, movers=()))).at(0, 0)
        self._light.update(light)
        ambient_cd_m2 = np.broadcast_to(self._ambient.cd_m2(light), 3)
        away = [se3.transform(np.eye(3), [0, 0, -AWAY_M])] * len(self._movers)

        def draw(camera: Pinhole, T_world_camera: Array) -> tuple[Radiance, Radiance]:
            target = self._target(camera.width_px, camera.height_px, TURNED, None)
            view = pinhole_view(camera, T_world_camera, away, skies, ambient_cd_m2=ambient_cd_m2)
            for one in (target.total, target.canvas):
                one.clear(target.total.whole)
            self._draw.draw(view, target, target.total.whole)
            self._draw.add(target, target.total, target.total.whole, 1.0)
            return target.total.read(target.total.whole), target.canvas.nearness()

        return room_probe(draw, faces.corners_m[faces.mover < 0], ambient_cd_m2)

    def _strip(self, lens: Warp, view: View, weights: Rgb | None) -> Radiance:
        atlas = lens.blank(3 if weights is None else 1)
        for face in lens.faces:
            box = face.needed_for(view.rows)
            if box is None:
                continue
            target = self._target(face.camera.width_px, face.camera.height_px, CENTRE, weights)
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
        count = len(views[0].start_ns)
        total = targets[0].total
        total.clear(around)
        for index in range(count):
            target = targets[index % len(targets)]
            target.canvas.clear(around)
            for view, box in zip(views, boxes, strict=True):
                self._draw.draw(self._view(camera, view, index, box), target, box)
            self._draw.add(target, total, around, 1 / count)

    def _view(self, camera: Pinhole, view: View, index: int, box: Box) -> PinholeView:
        """A sub-frame of a view, its light on the graphics side."""
        start_ns = int(view.start_ns[index])
        end_ns = int(view.end_ns[index])
        poses = [mover.path.pose((start_ns + end_ns) / 2) for mover in self._movers]
        light = self._illumination.without_movers(start_ns, end_ns)
        ambient_cd_m2 = np.broadcast_to(self._ambient.cd_m2(light), 3)
        skies = _skies(self._background, start_ns, end_ns)
        T_world_camera = view.T_world_camera[index]
        shining = glints(self._lights, T_world_camera[:3, 3], start_ns, end_ns) if self._draw.needs_probe else NO_GLINTS
        drawn = pinhole_view(camera, T_world_camera, poses, skies, ambient_cd_m2=ambient_cd_m2, glints=shining)
        if self._movers:
            light = self._illumination.at(start_ns, end_ns, self._draw.views(drawn, box))
        self._light.update(light)
        return drawn


def _skies(background: Background, start_ns: int, end_ns: int) -> Array:
    """The shader's coefficients (S, 4, 4) of every sky, its colour the last."""
    colours = np.array([[[*sky.colour, 0.0]] for sky in background.skies]).reshape(-1, 1, 4)
    return np.concatenate([background.coefficients(start_ns, end_ns), colours], 1)


def _check(camera: Camera, views: Sequence[View]) -> None:
    edges = sorted((view.rows.start, view.rows.stop) for view in views)
    ends = [0, *(stop for _, stop in edges)]
    if [start for start, _ in edges] != ends[:-1] or ends[-1] != camera.height_px:
        raise ValueError(f"views must tile the rows 0 to {camera.height_px}, these cover {edges}")
    if len({len(view.start_ns) for view in views}) != 1:
        raise ValueError("views of one picture must have the same number of sub-frames")
