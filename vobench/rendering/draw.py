"""One picture drawn: batches of triangles, mirrors, background, panes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from OpenGL import GL

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.culling import PROBE_MOST, Batch, CullingSet, Geometry, Mirror, Runs
from vobench.rendering.opengl import (
    Blocks,
    Canvas,
    Elements,
    FlatTarget,
    Grid,
    LightTexture,
    Program,
    SurfaceTexture,
    bind,
    canvas,
    flat_target,
)
from vobench.rendering.probe import Probe, level_of
from vobench.rendering.view import Box, PinholeView, Plane, visible_boxes, within
from vobench.scene.material import LUMINANCE, Rgb, emitted_cd_m2, inner_reflectance

# As the shaders say.
BODY_UNIT, LIGHT_UNIT, LAYERS_UNIT, EMISSION_UNIT, PROBE_UNIT = (GL.GL_TEXTURE0 + unit for unit in range(5))
LAYERS = GL.GL_TEXTURE_2D_ARRAY
PASS_BINDING = 0
BATCH_BINDING = 1
PASS_FLOATS = 116
MIRRORS = 3  # followed, each seen in the one before
FOLLOWED = (6, 3, 2)  # planes at each depth, those that show most; the others mirror by the probe
LEAST_SHARE = 5e-4  # of the picture, times what it mirrors, that a mirror is followed for


FADE = 0.1  # of roughness, over which the probe gives way


@dataclass(frozen=True, slots=True)
class RenderTarget:
    """The picture's canvas and one for each mirror behind a mirror; the total of sub-frames.

    weights (3,) of linear red, green and blue where the total has one channel.
    """

    canvases: tuple[Canvas, ...]
    total: FlatTarget
    weights: Rgb

    @property
    def canvas(self) -> Canvas:
        """What the picture itself is drawn on."""
        return self.canvases[0]


def render_target(width_px: int, height_px: int, grid: Grid, weights: Rgb | None, *, in_colour: bool) -> RenderTarget:
    """Target for pictures of some size and grid of samples, with one channel or, without weights, three.

    in_colour: whether samples have three channels all the same, as where light is mirrored in colours.
    """
    size = (width_px, height_px)
    channels = 3 if weights is None else 1
    canvases = tuple(canvas(*size, grid, 3 if in_colour else channels) for _ in range(1 + MIRRORS))
    return RenderTarget(canvases, flat_target(*size, channels), weights or LUMINANCE)


class DrawCalls:
    """Single draw calls, with the programs and state they share, as long as their context is current."""

    def __init__(self, geometry: Geometry, light: LightTexture) -> None:
        self._program = cache(Program)
        self._light = light
        self._batches = geometry.batches
        self._poses = b""
        self._textures = _textures(geometry.batches)
        self._elements = Elements(geometry.vertices, geometry.indices)
        self._pass = Blocks(PASS_BINDING, np.zeros((1, PASS_FLOATS), np.float32))
        own = [(batch, self._textures.get(id(batch.material.texture))) for batch in self._batches]
        self.abilities = [_abilities(batch, texture) for batch, texture in own]
        self._rows = np.array([_numbers(batch, texture) for batch, texture in own], np.float32)
        self._block = Blocks(BATCH_BINDING, self._rows)
        self._vertices = GL.glGenVertexArrays(1)
        for ability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
            GL.glEnable(ability)
        # Nearness instead of depth: see view.
        GL.glClipControl(GL.GL_LOWER_LEFT, GL.GL_ZERO_TO_ONE)
        GL.glDepthFunc(GL.GL_GEQUAL)
        GL.glClearDepth(0.0)

    def begin(self, view: PinholeView, canvas: Canvas, weights: Rgb, probe: Probe | None) -> None:
        """Set what all draw calls of one view share."""
        shared = np.zeros(PASS_FLOATS, np.float32)
        shared[:16] = view.direct.T.ravel()
        shared[16:19] = view.eye_m
        if view.mirror is not None:
            # Cut an eighth of a pixel behind the mirror: what goes through it leaves no gap along the cut.
            pixel_m = view.view_projection[3] / min(view.camera.fx_px, view.camera.fy_px)
            shared[20:24] = [*view.mirror.normal, view.mirror.offset_m] + pixel_m / 8
        shared[24 : 24 + canvas.layers] = canvas.grid.lod_bias
        for index, plane in enumerate(view.mirrors):
            shared[28 + 4 * index : 32 + 4 * index] = *plane.normal, plane.offset_m
        shared[40:43] = view.ambient_cd_m2
        shared[44:48] = [*weights, 1 / sum(weights)]
        if probe:
            places = [probe.centre_m, probe.low_m, probe.high_m]
            shared[48:60] = np.concatenate([[*place, 0] for place in places])
            shared[60:64] = probe.light
            shared[64:67] = view.ambient_cd_m2 / np.maximum(probe.ambient_cd_m2, 1e-12)
            shared[67] = len(view.glints)
            shared[68 : 68 + view.glints.size] = view.glints.ravel()
            bind(PROBE_UNIT, probe.texture.id, GL.GL_TEXTURE_CUBE_MAP)
        self._pass.update(0, shared)
        self._pass.use(0)
        self._move(view)
        # Each mirror swaps left and right.
        GL.glFrontFace(GL.GL_CW if view.depth % 2 else GL.GL_CCW)
        bind(LIGHT_UNIT, self._light.id)

    def _move(self, view: PinholeView) -> None:
        """Put movers where they are."""
        poses = np.array(view.T_world_movers).tobytes()
        for batch in self._batches if poses != self._poses else ():
            if batch.mover >= 0:
                row = self._rows[batch.index]
                row[:16] = view.pose(batch.mover).T.ravel()
                if batch.mirror:
                    plane = view.plane(batch.mirror.plane, batch.mover)
                    row[24:28] = *plane.normal, plane.offset_m
                self._block.update(batch.index, row)
        self._poses = poses

    def surface(self, batch: Batch, visible: Runs, view: PinholeView, canvas: Canvas, *abilities: str) -> None:
        """What is visible of a batch; the reflections that it is able to show must be bound."""
        names = [*abilities, "IS_MIRRORED"] if view.mirror else abilities
        program = self._program("surface", "surface", *names, *self.abilities[batch.index], *canvas.abilities)
        program.use()
        self._block.use(batch.index)
        for unit, texture in ((BODY_UNIT, batch.material.texture), (EMISSION_UNIT, batch.material.emission_texture)):
            if texture:
                bind(unit, self._textures[id(texture)].id)
        runs = visible.get(batch.index, ())
        if batch.is_pane:
            self._pane(runs, canvas.layers, is_grey="IS_GREY" in self.abilities[batch.index])
        else:
            self._elements.draw(runs, canvas.layers)

    def background(self, view: PinholeView, canvas: Canvas, weights: Rgb) -> None:
        """The skies, wherever nothing has been drawn."""
        # Nothing has been drawn there yet, so that several skies add up.
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        for gradation, scatter, sun, colour in view.skies:
            program = self._program("background", "background")
            shown = colour if canvas.abilities == () else np.array([colour[:3] @ weights, 0, 0, 0])
            program.use(
                world_from_screen=view.world_from_screen, gradation=gradation, scatter=scatter, sun=sun, colour=shown
            )
            self._cover(canvas.layers)
        GL.glDisable(GL.GL_BLEND)

    def add(self, target: RenderTarget, total: FlatTarget, box: Box, share: float) -> None:
        """Add the mean of a target's samples in a box, times a share, to a total."""
        total.begin(box)
        canvas = target.canvas
        bind(LAYERS_UNIT, canvas.colour, LAYERS)
        is_mixed = total.channels == 1 and canvas.abilities == ()
        weights = target.weights if is_mixed else np.ones(3)
        program = self._program("fullscreen", "mean", *(["IS_MONO"] if is_mixed else []))
        program.use(count=canvas.layers, weight=share / canvas.layers * np.array([*weights, 0.0]))
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_ONE)
        GL.glDisable(GL.GL_DEPTH_TEST)
        self._cover(1)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDisable(GL.GL_BLEND)

    def _cover(self, copies: int) -> None:
        """A triangle over the whole picture, in the program in use."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glBindVertexArray(self._vertices)
        GL.glDrawArraysInstanced(GL.GL_TRIANGLES, 0, 3, copies)
        GL.glEnable(GL.GL_CULL_FACE)

    def _pane(self, runs: Sequence[tuple[int, int]], copies: int, *, is_grey: bool) -> None:
        """Seen from both sides, and what is behind it shines through: alpha, or the second colour, is the share."""
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDepthMask(GL.GL_FALSE)
        GL.glEnable(GL.GL_BLEND)
        GL.glBlendFunc(GL.GL_ONE, GL.GL_SRC_ALPHA if is_grey else GL.GL_SRC1_COLOR)
        self._elements.draw(runs, copies)
        GL.glDisable(GL.GL_BLEND)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glEnable(GL.GL_CULL_FACE)


MOST_TEXELS = 1 << 26  # of all textures: half a gigabyte in colour


def _textures(batches: Sequence[Batch]) -> dict[int, SurfaceTexture]:
    """Every texture by its identity, made once; the finest of them coarser where all together are too large."""
    looks = [batch.material for batch in batches]
    used = {id(t): t for look in looks for t in (look.texture, look.emission_texture) if t}
    pixels = {key: texture.pixels() for key, texture in used.items()}
    sizes = np.array([p.shape[0] * p.shape[1] for p in pixels.values()], float)
    shrink = np.zeros(len(pixels), int)
    while (sizes / 4.0**shrink).sum() > MOST_TEXELS:
        shrink[np.argmax(sizes / 4.0**shrink)] += 1
    return {key: SurfaceTexture(pixels[key], shrink=int(n)) for key, n in zip(pixels, shrink, strict=True)}


def _abilities(batch: Batch, texture: SurfaceTexture | None) -> tuple[str, ...]:
    """What the shader needs to know of a batch."""
    material = batch.material
    is_grey = len({*material.colour}) == 1 and (texture is None or texture.is_grey)
    is_body = material.kind == "body"
    names = {
        "IS_PLANAR": batch.mirror is not None,
        "IS_PANE": batch.is_pane,
        "IS_MIRROR": material.kind == "mirror" and not batch.is_lamp,
        "IS_LAMP": batch.is_lamp,
        "IS_GREY": is_grey,
        "HAS_GLOSS": batch.has_gloss,
        "HAS_METAL": material.metal > 0,
        "HAS_TEXTURE": is_body and material.texture is not None and not batch.is_lamp,
        "HAS_LIGHT": is_body or batch.is_lamp,
        "HAS_CUTOUT": material.cutout is not None,
        "HAS_EMISSION": batch.is_lamp or max(material.emission_cd_m2) > 0,
        "HAS_EMISSION_TEXTURE": material.emission_texture is not None,
    }
    return tuple(name for name, has in names.items() if has)


def _numbers(batch: Batch, texture: SurfaceTexture | None) -> Array:
    """The numbers of the shader's block."""
    material = batch.material
    is_body = material.kind == "body"
    eta = material.eta
    inner = inner_reflectance(eta)
    # A lamp's light is on the map: its texture only says how that is spread.
    spread = np.divide(
        material.emission_cd_m2, emitted_cd_m2(material), out=np.ones(3), where=emitted_cd_m2(material) > 0
    )
    glow = spread if batch.is_lamp else material.emission_cd_m2
    repeats = material.tile_m / material.emission_texture.tile_m if material.emission_texture else 1.0
    texture_scale = texture.scale if texture else 1.0
    scale = texture_scale if is_body else material.tint
    plane = [*batch.mirror.plane.normal, batch.mirror.plane.offset_m] if batch.mirror else np.zeros(4)
    colour = [*(scale * np.array(material.colour)), material.tint]
    coat = [eta, inner, 1 / eta**2, 1 / ((1 - inner) * eta**2)]
    # How far a rough coat's facets let it rise towards grazing: Lagarde (2011).
    straight = ((1 - eta) / (1 + eta)) ** 2
    dull = 0.0 if batch.mirror else np.sqrt(material.roughness)
    rise = (max(1 - dull, straight) - straight) / (1 - straight)
    finish = [material.metal, rise, material.cutout or 0.0, material.roughness]
    blur = [level_of(material.roughness), _probed(batch), straight, 0.0]
    return np.concatenate([np.eye(4).ravel(), colour, [*glow, repeats], plane, coat, finish, blur])


def _probed(batch: Batch) -> float:
    """How much a batch shows of the probe instead of what lights it."""
    return (
        float(np.clip((PROBE_MOST - batch.material.roughness) / FADE, 0, 1)) if batch.material.kind == "body" else 1.0
    )


class BatchDraw:
    """Draws batches onto targets, as long as its context is current."""

    def __init__(self, geometry: Geometry, light: LightTexture) -> None:
        self._calls = DrawCalls(geometry, light)
        self._culling = CullingSet(geometry.clusters)
        # Small things first: they hide much of what is large, which is then not shaded there.
        plain = [batch for batch in geometry.batches if batch.mirror is None and not batch.is_pane]
        self._plain = sorted(plain, key=lambda batch: batch.area_m2)
        self._loose = [batch for batch in geometry.batches if batch.mirror is None and batch.is_pane]
        self._mirrors = geometry.mirrors
        self._in = {m.index: [b for b in geometry.batches if b.mirror is m] for m in geometry.mirrors}
        has_rough = any(batch.has_gloss and batch.mirror is None for batch in geometry.batches)
        self.needs_probe = has_rough or len(self._mirrors) > min(FOLLOWED)
        self._probe: Probe | None = None

    @property
    def mirrors_in_colour(self) -> bool:
        """Whether something shows what is before it, or behind it, in another colour."""
        tinted = ("IS_MIRROR", "IS_PANE", "HAS_METAL")
        planar = [names for names in self._calls.abilities if {"IS_PLANAR", "IS_PANE"} & {*names}]
        return any("IS_GREY" not in names and {*tinted} & {*names} for names in planar)

    def use_probe(self, probe: Probe) -> None:
        """Show a probe from now on where no mirror is followed."""
        self._probe = probe

    def views(self, view: PinholeView, box: Box) -> list[tuple[PinholeView, Box]]:
        """All views that a picture is drawn from, those into mirrors among them, each with its box."""
        visible = self._culling.visible(view, box)
        found = [(view, box)]
        for index, seen in self._followed(view, self._boxes(view, visible), box).items():
            plane = _plane_towards(self._mirrors[index], view)
            if plane and self._shown(self._mirrors[index], visible):
                found += self.views(view.through(plane), seen)
        return found

    def draw(self, view: PinholeView, target: RenderTarget, box: Box) -> None:
        """Fill a box of the target's canvas for as many mirrors as the view goes by, which must be clear there."""
        visible = self._culling.visible(view, box)
        canvas = self._begin(view, target, box)
        for batch in self._plain:
            if batch.index in visible:
                self._calls.surface(batch, visible, view, canvas, *self._unfollowed(batch))
        boxes = self._boxes(view, visible)
        seen = self._followed(view, boxes, box)
        shown = [self._mirrors[n] for n in boxes if self._shown(self._mirrors[n], visible)]
        for mirror in shown:
            if not mirror.is_pane:
                self._draw_mirror(mirror, view, target, box=box, visible=visible, seen=seen.get(mirror.index))
        self._calls.background(view, canvas, target.weights)
        for batch in self._loose:
            if batch.index in visible:
                self._calls.surface(batch, visible, view, canvas, *self._unfollowed(batch))
        panes = [mirror for mirror in shown if mirror.is_pane]
        for mirror in sorted(panes, key=lambda m: -_distance_m(m, view)):
            self._draw_mirror(mirror, view, target, box=box, visible=visible, seen=seen.get(mirror.index))

    def add(self, target: RenderTarget, total: FlatTarget, box: Box, share: float) -> None:
        """Add the mean of a target's samples in a box, times a share, to a total."""
        self._calls.add(target, total, box, share)

    def _begin(self, view: PinholeView, target: RenderTarget, box: Box) -> Canvas:
        canvas = target.canvases[view.depth]
        canvas.begin(box)
        self._calls.begin(view, canvas, target.weights, self._probe)
        return canvas

    def _unfollowed(self, batch: Batch) -> tuple[str, ...]:
        """What a batch mirrors that is not drawn again from behind."""
        return ("HAS_PROBE",) if self._probe and batch.has_gloss and _probed(batch) > 0 else ()

    def _boxes(self, view: PinholeView, visible: Runs) -> dict[int, Box]:
        """Mirrors whose mirroring side is seen, all or those of which something is visible: boxes in the picture.

        Where they are more than are followed, the choice must be the same whatever part of a picture is drawn.
        """
        is_choice = len(self._mirrors) > FOLLOWED[min(view.depth, MIRRORS - 1)]
        some = self._mirrors if is_choice else [m for m in self._mirrors if self._shown(m, visible)]
        some = [mirror for mirror in some if _plane_towards(mirror, view)]
        if not some:
            return {}
        T_camera_world = se3.inverse(view.T_world_camera) @ view.images
        T = np.array([T_camera_world @ view.pose(mirror.mover) for mirror in some])
        outlines = np.array([m.outline_m for m in some]) @ T[:, :3, :3].swapaxes(1, 2) + T[:, None, :3, 3]
        whole = (0, view.camera.width_px, 0, view.camera.height_px)
        boxes = zip(some, visible_boxes(view.camera, outlines).tolist(), strict=True)
        found = {mirror.index: within(box, whole) for mirror, box in boxes}
        return {index: box for index, box in found.items() if box}

    def _shown(self, mirror: Mirror, visible: Runs) -> bool:
        return any(batch.index in visible for batch in self._in[mirror.index])

    def _followed(self, view: PinholeView, boxes: dict[int, Box], box: Box) -> dict[int, Box]:
        """Mirrors in a picture that are drawn again from behind, those that show most, and where in a box of it."""
        if view.depth == MIRRORS or (self.needs_probe and not self._probe):
            return {}
        least = LEAST_SHARE * view.camera.width_px * view.camera.height_px
        shown = [((u1 - u0) * (v1 - v0) * self._mirrors[n].strength, n) for n, (u0, u1, v0, v1) in boxes.items()]
        most = [n for size, n in sorted(shown, reverse=True)[: FOLLOWED[view.depth]] if size > least]
        return {n: part for n in most if (part := within(boxes[n], box))}

    def _draw_mirror(
        self, mirror: Mirror, view: PinholeView, target: RenderTarget, *, box: Box, visible: Runs, seen: Box | None
    ) -> None:
        """What lies in one plane, with what it mirrors in the box that is given, or with what the probe shows."""
        canvas = target.canvases[view.depth]
        plane = _plane_towards(mirror, view)
        abilities = ("IS_LAST",) if view.depth == MIRRORS or not self._probe else ("HAS_PROBE",)
        if seen and plane:
            reflections = target.canvases[view.depth + 1]
            reflections.clear(seen)
            self.draw(view.through(plane), target, seen)
            self._begin(view, target, box)
            bind(LAYERS_UNIT, reflections.colour, LAYERS)
            abilities = ("HAS_REFLECTION",)
        for batch in self._in[mirror.index]:
            if batch.index in visible:
                self._calls.surface(batch, visible, view, canvas, *abilities)


def _plane_towards(mirror: Mirror, view: PinholeView) -> Plane | None:
    """The plane of a mirror with its normal towards the eye.

    None where its mirroring side is not seen, or where it is the mirror that is looked into.
    """
    plane = view.plane(mirror.plane, mirror.mover)
    if plane.distance_m(view.eye_m) <= 0:
        plane = plane.flipped()
        if not mirror.is_pane:
            return None
    return None if view.mirror and view.mirror.key in (plane.key, plane.flipped().key) else plane


def _distance_m(mirror: Mirror, view: PinholeView) -> float:
    """How far the nearest corner of a mirror is from the camera."""
    T_camera_world = se3.inverse(view.T_world_camera) @ view.images
    corners_m = se3.apply(T_camera_world @ view.pose(mirror.mover), mirror.outline_m)
    return float(np.linalg.norm(corners_m, axis=-1).min())
