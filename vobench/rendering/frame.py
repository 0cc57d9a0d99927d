"""Pictures of a baked scene: for each sub-frame the light map is updated, movers are placed, and views are drawn."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.background import Background, even_sky
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.batch import geometry
from vobench.rendering.draw import BatchDraw
from vobench.rendering.gl_texture import LightTexture, PanoramaTexture
from vobench.rendering.glint import glints, lamp_parts
from vobench.rendering.illumination import AmbientLight, Illumination
from vobench.rendering.mover_shade import ShadedLight
from vobench.rendering.probe import Probe, room_probe
from vobench.rendering.rain_streaks import RainStreaks
from vobench.rendering.render_target import RenderTarget, render_target
from vobench.rendering.renderer import Radiance, View
from vobench.rendering.sample_pattern import FINE_GRID, FINE_SAMPLES, HALVES, PIXEL_CENTRE, ROTATED_GRID, SamplePattern
from vobench.rendering.view import NO_GLINTS, Box, PinholeView, pinhole_view
from vobench.rendering.warp import Warp, warp
from vobench.scene.fog import Fog
from vobench.scene.light import STEADY, Light, Steady
from vobench.scene.material import Rgb
from vobench.scene.rain import Rain
from vobench.scene.scene import Mover, triangles
from vobench.scene.swaying import in_wind
from vobench.scene.triangles import Triangles

AWAY_M = 1e6  # the depth below the scene at which movers are while the probe is drawn
HALVED_FRAMES = 4  # the least number of sub-frames that have half of the samples each


@dataclass(frozen=True, slots=True)
class _Pass:
    """One drawing of a sub-frame, by its index, with a pattern of samples."""

    index: int
    pattern: SamplePattern


class FrameRenderer:
    """Renders pictures in the OpenGL context that is current when it is created, and must be when it is used.

    Each pixel is the mean of `samples`, 4 or 16.
    """

    def __init__(self, baked: BakedScene, *, samples: int) -> None:
        self._is_fine = samples == FINE_SAMPLES
        self._illumination = Illumination(baked)
        self._background = Background(baked.scene.lights)
        self._ambient = AmbientLight(baked)
        faces, self._movers = _with_leaves(baked)
        self._rigid_count = len(baked.scene.movers)  # the movers before the leaves in wind
        self._lights = baked.scene.lights
        self._fog = baked.scene.fog
        self._rain = baked.scene.rain
        self._streaks = RainStreaks(baked.scene, self._rain) if self._rain and self._rain.rate_mm_per_h else None
        light_map = self._illumination.at(0, 0)
        is_shaded = bool(baked.scene.movers and self._lights)
        self._light = ShadedLight(baked, light_map) if is_shaded else LightTexture(light_map)
        drawn = geometry(faces, baked.light_uv, baked.scene.materials)
        panoramas = {index: PanoramaTexture(shown) for index, shown in self._background.panoramas.items()}
        self._draw = BatchDraw(drawn, self._light.id, panoramas)
        self._target = cache(partial(render_target, in_colour=self._draw.mirrors_in_colour))
        self._warp = cache(warp)
        self._lamp_parts = lamp_parts(self._lights) if self._draw.needs_probe else ()
        if self._draw.needs_probe:
            self._draw.use_probe(self._room_probe(baked, baked.faces))

    def picture(
        self,
        camera: Camera,
        views: Sequence[View],
        weights: Rgb | None,
    ) -> Radiance:
        """The picture of views that tile its rows and have equal numbers of sub-frames; see `Renderer`."""
        _require_tiling(camera, views)
        picture = self._without_streaks(camera, views, weights)
        return self._behind_drops(picture, camera, views, weights)

    def _without_streaks(
        self,
        camera: Camera,
        views: Sequence[View],
        weights: Rgb | None,
    ) -> Radiance:
        if isinstance(camera, Pinhole):
            return self._pinhole_picture(camera, views, weights)
        lens = self._warp(camera)
        views_in_order = sorted(views, key=lambda view: view.rows.start)
        return np.concatenate([self._strip(lens, view, weights) for view in views_in_order])

    def _behind_drops(
        self,
        picture: Radiance,
        camera: Camera,
        views: Sequence[View],
        weights: Rgb | None,
    ) -> Radiance:
        """A picture (H, W) or (H, W, 3) behind the drops of rain that are near the camera."""
        if self._streaks is None:
            return picture
        start_ns = int(views[0].start_ns[0])
        end_ns = int(views[-1].end_ns[-1])
        drop_cd_m2 = self._drop_cd_m2(start_ns, end_ns)
        cover = self._streaks.cover(camera, views)
        if weights is not None:
            drop = np.float32(drop_cd_m2 @ np.array(weights))
            return np.asarray(picture + cover * (drop - picture))
        return np.asarray(picture + cover[..., None] * (drop_cd_m2.astype(np.float32) - picture))

    def _drop_cd_m2(self, start_ns: int, end_ns: int) -> Array:
        """The luminance (3,) of drops: they refract light from nearly a half-space, whose upper half is the sky."""
        surfaces_cd_m2 = np.broadcast_to(self._ambient.cd_m2(self._illumination.at(start_ns, end_ns)), 3)
        return np.asarray((self._background.mean_cd_m2(start_ns, end_ns) + surfaces_cd_m2) / 2)

    def _pinhole_picture(
        self,
        camera: Pinhole,
        views: Sequence[View],
        weights: Rgb | None,
    ) -> Radiance:
        boxes = [(0, camera.width_px, view.rows.start, view.rows.stop) for view in views]
        passes = self._passes(len(views[0].start_ns))
        target = self._target(camera.width_px, camera.height_px, passes[0].pattern, weights)
        self._expose(target, passes, camera, views, boxes=boxes, around=target.total.whole)
        return target.total.read(target.total.whole)

    def _passes(self, frame_count: int) -> list[_Pass]:
        """How the sub-frames of a picture are drawn."""
        if self._is_fine:
            return [_Pass(index, pattern) for index in range(frame_count) for pattern in FINE_GRID]
        if frame_count >= HALVED_FRAMES and frame_count % 2 == 0:
            # Sub-frames alternate between the two halves of the samples, at half the cost.
            return [_Pass(index, HALVES[index % 2]) for index in range(frame_count)]
        return [_Pass(index, ROTATED_GRID) for index in range(frame_count)]

    def _room_probe(self, baked: BakedScene, faces: Triangles) -> Probe:
        """The probe of what is stationary, with lamps of variable level at level 1."""
        lights = tuple(_steady(light) for light in self._lights)
        skies = Background(lights).skies(0, 0)
        if all(isinstance(light.level, Steady) for light in self._lights):
            light_map = self._illumination.at(0, 0)
        else:
            steady_scene = replace(baked.scene, lights=lights, movers=())
            light_map = Illumination(replace(baked, scene=steady_scene)).at(0, 0)
        self._light.update(light_map)
        ambient_cd_m2 = np.broadcast_to(self._ambient.cd_m2(light_map), 3)
        T_world_away = se3.transform(np.eye(3), [0, 0, -AWAY_M])
        leaf_count = len(self._movers) - self._rigid_count
        T_world_movers = [T_world_away] * self._rigid_count + [np.eye(4)] * leaf_count

        def draw(camera: Pinhole, T_world_camera: Array) -> tuple[Radiance, Radiance]:
            target = self._target(camera.width_px, camera.height_px, ROTATED_GRID, None)
            whole = target.total.whole
            view = pinhole_view(camera, T_world_camera, T_world_movers, skies, ambient_cd_m2=ambient_cd_m2)
            target.total.clear(whole)
            target.framebuffer.clear(whole)
            self._draw.draw(view, target, whole)
            self._draw.add(target, target.total, whole, 1.0)
            return target.total.read(whole), target.framebuffer.reversed_depth()

        is_stationary = faces.mover < 0
        with_glints = sorted({part.light for part in self._lamp_parts})
        lamp_faces = np.flatnonzero(np.isin(faces.lamp[is_stationary], with_glints)).astype(np.int32)
        return room_probe(draw, faces.corners_m[is_stationary], lamp_faces, ambient_cd_m2)

    def _strip(
        self,
        lens: Warp,
        view: View,
        weights: Rgb | None,
    ) -> Radiance:
        """The rows of a view through a lens, resampled from pinhole pictures."""
        atlas = lens.blank(3 if weights is None else 1)
        pattern = ROTATED_GRID if self._is_fine else PIXEL_CENTRE
        passes = [_Pass(index, pattern) for index in range(len(view.start_ns))]
        for face in lens.faces:
            box = face.needed_for(view.rows)
            if box is None:
                continue
            target = self._target(face.camera.width_px, face.camera.height_px, pattern, weights)
            T_camera_face = se3.transform(face.R_camera_face, np.zeros(3))
            face_view = replace(view, T_world_camera=view.T_world_camera @ T_camera_face)
            self._expose(target, passes, face.camera, [face_view], boxes=[box], around=box)
            lens.put(atlas, face, box, target.total.read(box))
        return lens.picture(atlas, view.rows)

    def _expose(
        self,
        target: RenderTarget,
        passes: Sequence[_Pass],
        camera: Pinhole,
        views: Sequence[View],
        *,
        boxes: Sequence[Box],
        around: Box,
    ) -> None:
        """Draw the mean over passes of all views, each view in its box.

        The mean is in the total of the target, inside the box `around`.
        """
        target.total.clear(around)
        for each in passes:
            of_pass = target.with_pattern(each.pattern)
            of_pass.framebuffer.clear(around)
            for view, box in zip(views, boxes, strict=True):
                self._draw.draw(self._lit_view(camera, view, each.index, box), of_pass, box)
            self._draw.add(of_pass, target.total, around, 1 / len(passes))

    def _lit_view(
        self,
        camera: Pinhole,
        view: View,
        index: int,
        box: Box,
    ) -> PinholeView:
        """A sub-frame of a view. The texture of the light map is updated for it."""
        start_ns = int(view.start_ns[index])
        end_ns = int(view.end_ns[index])
        middle_ns = (start_ns + end_ns) / 2
        T_world_camera = view.T_world_camera[index]
        T_world_movers = [mover.path.pose(middle_ns) for mover in self._movers]
        light = self._illumination.at(start_ns, end_ns)
        shown_glints = NO_GLINTS
        if self._draw.needs_probe:
            shown_glints = glints(self._lights, self._lamp_parts, T_world_camera[:3, 3], start_ns, end_ns)
        pinhole = pinhole_view(
            camera,
            T_world_camera,
            T_world_movers,
            self._background.skies(start_ns, end_ns),
            ambient_cd_m2=np.broadcast_to(self._ambient.cd_m2(light), 3),
            glints=shown_glints,
        )
        if self._fog:
            pinhole = self._in_fog(pinhole, self._fog, start_ns, end_ns)
        if self._rain:
            pinhole = self._in_rain(pinhole, self._rain, start_ns, end_ns)
        if isinstance(self._light, ShadedLight):
            colours, suns_ns = self._illumination.lights_at(start_ns, end_ns)
            self._light.shade(light, middle_ns, suns_ns, colours, self._draw.views(pinhole, box))
        else:
            self._light.update(light)
        return pinhole

    def _in_fog(self, view: PinholeView, fog: Fog, start_ns: int, end_ns: int) -> PinholeView:
        """A view in fog, whose airlight takes the place of the sky."""
        airlight_cd_m2 = view.ambient_cd_m2
        if fog.airlight == "sky":
            airlight_cd_m2 = self._background.mean_cd_m2(start_ns, end_ns)
        return replace(
            view,
            skies=[even_sky(airlight_cd_m2)],
            extinction_per_m=fog.extinction_per_m,
            airlight_cd_m2=airlight_cd_m2,
        )

    def _in_rain(self, view: PinholeView, rain: Rain, start_ns: int, end_ns: int) -> PinholeView:
        """A view through distant drops, which are too small to be seen one by one, besides fog.

        The sky is seen as it is, because rain is not endless.
        """
        drops_per_m = rain.extinction_per_m
        extinction_per_m = view.extinction_per_m + drops_per_m
        if extinction_per_m == 0:
            return view
        share = drops_per_m / extinction_per_m
        airlight_cd_m2 = (1 - share) * view.airlight_cd_m2 + share * self._drop_cd_m2(start_ns, end_ns)
        return replace(view, extinction_per_m=extinction_per_m, airlight_cd_m2=airlight_cd_m2)


def _steady(light: Light) -> Light:
    """A light at level 1 if its level varies, otherwise as it is."""
    return light if isinstance(light.level, Steady) else replace(light, level=STEADY)


def _with_leaves(baked: BakedScene) -> tuple[Triangles, tuple[Mover, ...]]:
    """The faces that are drawn, and the movers: those of the scene, followed by the leaves that wind moves."""
    if baked.scene.wind is None:
        return baked.faces, baked.scene.movers
    swaying = in_wind(baked.scene, triangles(baked.scene))
    return replace(baked.faces, mover=swaying.faces.mover[baked.parts.parent]), swaying.movers


def _require_tiling(camera: Camera, views: Sequence[View]) -> None:
    """Raise ValueError if views leave out rows, overlap, or have different numbers of sub-frames."""
    edges = sorted((view.rows.start, view.rows.stop) for view in views)
    starts = [start for start, _ in edges]
    ends = [0, *(stop for _, stop in edges)]
    if starts != ends[:-1] or ends[-1] != camera.height_px:
        raise ValueError(f"views must tile the rows 0 to {camera.height_px}, these cover {edges}")
    frame_counts = {len(view.start_ns) for view in views}
    if len(frame_counts) != 1:
        raise ValueError("views of one image must have the same number of sub-frames")
