"""The stock pyrender engine: a scene in pyrender's own materials, lights and shadows, drawn by it in 8 bits.

It has no bounces, no mirrors and no shadows of points. What is brighter than white is cut off, and a picture is
linear only after pyrender's power of 1/2.2 is undone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.errors import MissingDependencyError
from vobench.geometry import se3
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.geometry.vector import cross, unit
from vobench.rendering.context import create_context
from vobench.rendering.pyrender_ambient import MeanLight, mean_light
from vobench.rendering.pyrender_material import (
    TILE_EDGES_M,
    lamp_material,
    pyrender_material,
    require_pyrender,
    texture_tile_m,
)
from vobench.rendering.renderer import Radiance, View
from vobench.rendering.view import NEAR_M, T_CV_GL, Box
from vobench.rendering.warp import warp
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import LUMINANCE, Rgb
from vobench.scene.mesh import as_arrays, face_corners
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing
from vobench.scene.weld import open_edges, welded

GAMMA = 2.2  # pyrender stores linear ** (1 / 2.2)
DECODED = ((np.arange(256) / 255) ** GAMMA).astype(np.float32)
# As many of a kind as pyrender's shader takes where no shadow map limits it.
MOST_SPOTS = 4
MOST_POINTS = 4
LEAST_FAR_M = 100.0
FAR_SCALES = 3.0
# A spot that stands for a panel, as bright straight ahead. Wider ones stripe walls with the texels of their shadow map.
PANEL_INNER_RAD = np.deg2rad(50)
PANEL_OUTER_RAD = np.deg2rad(68)
# Before its panel: pyrender divides by the distance ahead of the spot, which is 0 on the panel itself.
SPOT_AHEAD_M = 0.01
# Welds corners where edges are compared, in digits after the point of a metre.
# A lamp whose normals cancel out further than this shines to all sides.
LEAST_AHEAD = 0.5


@dataclass(frozen=True, slots=True)
class PyrenderMoment:
    """The parts of a scene that change: each light's level (L,), and the instant of movers and suns."""

    levels: tuple[float, ...]
    t_ns: float


class PyrenderRenderer:
    """Pictures of a scene by stock pyrender; radiance is its picture as a share of the scene's white.

    white_cd_m2: the luminance that is stored as 255.

    Raises MissingDependencyError where this machine cannot draw, or the module pyrender is one that does not work.
    """

    def __init__(self, scene: Scene, *, white_cd_m2: float) -> None:
        # First, for a machine that cannot draw is no fault of pyrender's.
        self._context = create_context()
        try:
            require_pyrender()
        except MissingDependencyError:
            self._context.release()
            raise
        import pyrender

        self._lights = scene.lights
        self._white_cd_m2 = np.float32(white_cd_m2)
        self._scene = PyrenderScene(scene, white_cd_m2)
        self._renderer = pyrender.Renderer(1, 1)
        self._warp = cache(warp)

    def radiance(
        self,
        camera: Camera,
        views: Sequence[View],
        *,
        weights: Rgb | None = LUMINANCE,
    ) -> Radiance:
        """Luminance (H, W) in cd/m² of weighted channels, or (H, W, 3) without weights; see `Renderer`."""
        self._context.make_current()
        rows_in_order = sorted(views, key=lambda view: view.rows.start)
        strips = [self._exposed(camera, view) for view in rows_in_order]
        picture = self._white_cd_m2 * np.concatenate(strips)
        if weights is None:
            return picture
        return np.asarray(picture @ np.asarray(weights, np.float32))

    def close(self) -> None:
        """Free the OpenGL context and all in it."""
        self._context.make_current()
        self._renderer.delete()
        self._context.release()

    def _exposed(self, camera: Camera, view: View) -> Radiance:
        """The rows (R, W, 3) of a view, the mean of its sub-frames, white at 1."""
        count = len(view.start_ns)
        total: Radiance | None = None
        for index in range(count):
            moment = self._moment(int(view.start_ns[index]), int(view.end_ns[index]))
            self._scene.become(moment)
            rows = self._rows(camera, view.T_world_camera[index], view.rows)
            total = rows if total is None else total + rows
        if total is None:
            raise ValueError("a view needs one sub-frame or more, got none")
        return total / np.float32(count)

    def _moment(self, start_ns: int, end_ns: int) -> PyrenderMoment:
        levels = tuple(light.level.mean(start_ns, end_ns) for light in self._lights)
        return PyrenderMoment(levels, (start_ns + end_ns) / 2)

    def _rows(self, camera: Camera, T_world_camera: Array, rows: slice) -> Radiance:
        """Rows (R, W, 3) of one sub-frame; a lens other than a pinhole is resampled from pinhole faces."""
        if isinstance(camera, Pinhole):
            return self._pinhole(camera, T_world_camera)[rows]
        lens = self._warp(camera)
        atlas = lens.blank(3)
        for face in lens.faces:
            box = face.needed_for(rows)
            if box is not None:
                T_world_face = T_world_camera @ se3.transform(face.R_camera_face, np.zeros(3))
                lens.put(atlas, face, box, _cut(self._pinhole(face.camera, T_world_face), box))
        return lens.picture(atlas, rows)

    def _pinhole(self, camera: Pinhole, T_world_camera: Array) -> Radiance:
        """The whole picture (H, W, 3), white at 1."""
        self._scene.look(camera, T_world_camera)
        self._renderer.viewport_width = camera.width_px
        self._renderer.viewport_height = camera.height_px
        stored, _ = self._renderer.render(self._scene.pyrender_scene, self._scene.flags)
        return np.asarray(DECODED[stored[..., :3]])


def _cut(picture: Radiance, box: Box) -> Radiance:
    first, end, top, bottom = box
    return picture[top:bottom, first:end]


class PyrenderScene:
    """A scene as a pyrender.Scene, in a unit of radiance that puts white at 1."""

    def __init__(self, scene: Scene, white_cd_m2: float) -> None:
        import pyrender

        self.pyrender_scene = pyrender.Scene(ambient_light=np.zeros(3), bg_color=np.zeros(4))
        self._scene = scene
        self._white_cd_m2 = white_cd_m2
        self._moment: PyrenderMoment | None = None
        self._materials = cache(lambda name: pyrender_material(scene.materials[name], white_cd_m2))

        suns = [light.direction(0) for light in scene.lights if isinstance(light, Sun)]
        self._add_things(scene.things, sun=suns[0] if suns else None)
        if suns:
            self._add_backs(scene.things)
        self._movers = [(mover, self._add_things(mover.things)) for mover in scene.movers]
        self._lamp_faces = {}
        for index, light in enumerate(scene.lights):
            if isinstance(light, AreaLight):
                self._lamp_faces[index] = self._add_lamp_faces(light)
        chosen = _chosen(scene.lights)
        self._light_nodes = {index: self._add_light(scene.lights[index]) for index in chosen}
        self._mean_light: MeanLight = mean_light(scene, drawn=chosen)

        far_m = max(LEAST_FAR_M, FAR_SCALES * float(self.pyrender_scene.scale))
        self._camera = pyrender.IntrinsicsCamera(1.0, 1.0, 0.0, 0.0, NEAR_M, far_m)
        self._camera_node = self.pyrender_scene.add(self._camera)
        self.flags = self._flags()

    def _flags(self) -> int:
        """Four bytes a pixel, whose rows need no padding, and the shadows of those kinds of light that there are."""
        from pyrender import RenderFlags

        flags = RenderFlags.OFFSCREEN | RenderFlags.RGBA
        if self.pyrender_scene.directional_light_nodes:
            flags |= RenderFlags.SHADOWS_DIRECTIONAL
        if self.pyrender_scene.spot_light_nodes:
            flags |= RenderFlags.SHADOWS_SPOT
        return int(flags)

    def look(self, camera: Pinhole, T_world_camera: Array) -> None:
        """Place the camera. OpenGL counts pixels from the corner of the top-left one, we from its centre."""
        self._camera.fx = camera.fx_px
        self._camera.fy = camera.fy_px
        self._camera.cx = camera.cx_px + 0.5
        self._camera.cy = camera.cy_px + 0.5
        self.pyrender_scene.set_pose(self._camera_node, T_world_camera @ T_CV_GL)

    def become(self, wanted: PyrenderMoment) -> None:
        """Set every light's level, and move suns and movers to where they are."""
        if wanted == self._moment:
            return
        for mover, nodes in self._movers:
            for node in nodes:
                self.pyrender_scene.set_pose(node, mover.path.pose(wanted.t_ns))
        for index, level in enumerate(wanted.levels):
            self._shine(index, level, wanted.t_ns)
        self.pyrender_scene.ambient_light = self._mean_light.radiance(wanted.levels) / self._white_cd_m2
        self.pyrender_scene.bg_color = self._background(wanted.levels)
        self._moment = wanted

    def _shine(self, index: int, level: float, t_ns: float) -> None:
        light = self._scene.lights[index]
        if index in self._light_nodes:
            node = self._light_nodes[index]
            node.light.intensity = level * _strength(light) / self._white_cd_m2
            if isinstance(light, Sun) and light.moves:
                self.pyrender_scene.set_pose(node, _shining_along(-light.direction(t_ns), np.zeros(3)))
        if isinstance(light, AreaLight):
            material, nominal = self._lamp_faces[index]
            # pyrender multiplies by the factor twice.
            material.emissiveFactor = np.sqrt(level * nominal)

    def _background(self, levels: Sequence[float]) -> Array:
        """Stored red, green, blue and alpha (4,) where nothing is: the mean of the sky above the horizon.

        For a panorama, it is the mean of the band within 30 degrees of the horizon.
        """
        colour = np.zeros(3)
        for light, level in zip(self._scene.lights, levels, strict=True):
            if isinstance(light, Sky):
                mean_cd_m2 = light.illuminance_lx / np.pi * np.array(light.colour)
                if light.panorama is not None:
                    mean_cd_m2 = light.illuminance_lx * light.panorama.map_under(light).around_horizon
                colour += level * mean_cd_m2 / self._white_cd_m2
        return np.append(np.clip(colour, 0, 1) ** (1 / GAMMA), 1.0)

    def _add_things(
        self,
        things: Sequence[Thing],
        *,
        sun: Array | None = None,
    ) -> list[Any]:
        """One node for each material of things, in their common frame; panes let the sun (3,) through."""
        by_material = dict[str, list[MeshArrays]]()
        for thing in things:
            by_material.setdefault(thing.material, []).append(as_arrays(thing.mesh))
        nodes = []
        for name, meshes in by_material.items():
            tile_m = texture_tile_m(self._scene.materials[name])
            mesh = joined_arrays(meshes)
            if sun is not None and self._scene.materials[name].kind == "pane":
                mesh = _turned_away(mesh, sun)
            nodes += self._add_mesh(mesh, self._materials(name), tile_m)
        return nodes

    def _add_backs(self, things: Sequence[Thing]) -> None:
        """The backs of walls and other sheets, for pyrender's shadow maps leave out faces seen from behind."""
        import pyrender

        solid = [thing for thing in things if self._scene.materials[thing.material].kind != "pane"]
        sheets = [as_arrays(thing.mesh).flipped() for thing in solid if _is_open(as_arrays(thing.mesh))]
        material = pyrender.MetallicRoughnessMaterial(
            baseColorFactor=[0.2, 0.2, 0.2, 1.0], metallicFactor=0.0, roughnessFactor=1.0
        )
        self._add_mesh(joined_arrays(sheets), material, TILE_EDGES_M)

    def _add_mesh(
        self,
        mesh: MeshArrays,
        material: Any,
        tile_m: float,
    ) -> list[Any]:
        import pyrender

        if not len(mesh.faces):
            return []
        u, v = (mesh.uv / tile_m).T
        primitive = pyrender.Primitive(
            positions=mesh.vertices_m,
            normals=mesh.normals,
            # pyrender turns pictures over as it uploads them: row 0 is at v = 1.
            texcoord_0=np.stack([u, 1 - v], -1),
            indices=mesh.faces,
            material=material,
            mode=pyrender.GLTF.TRIANGLES,
        )
        return [self.pyrender_scene.add(pyrender.Mesh([primitive]))]

    def _add_lamp_faces(self, light: AreaLight) -> tuple[Any, Array]:
        """The faces of a lamp, their material, and what they emit (3,) at level 1, white at 1."""
        look = self._scene.materials.get(light.material)
        material, emitted, tile_m = lamp_material(light, look)
        self._add_mesh(as_arrays(light.mesh), material, tile_m)
        return material, emitted / self._white_cd_m2

    def _add_light(self, light: Light) -> Any:
        """The node of a light that pyrender draws, at level 1."""
        import pyrender

        colour = np.array(light.colour, float)
        intensity = _strength(light) / self._white_cd_m2
        match light:
            case Sun():
                node_light = pyrender.DirectionalLight(color=colour, intensity=intensity)
                pose = _shining_along(-light.direction(0), np.zeros(3))
            case SpotLight():
                inner_rad, outer_rad = np.deg2rad([light.inner_deg, light.outer_deg])
                node_light = _spot(colour, intensity, inner_rad=inner_rad, outer_rad=outer_rad)
                pose = _shining_along(light.direction, light.position_m)
            case AreaLight() if _is_ahead(light):
                node_light = _spot(colour, intensity, inner_rad=PANEL_INNER_RAD, outer_rad=PANEL_OUTER_RAD)
                ahead = _mean_normal(light)
                pose = _shining_along(ahead, _middle_m(light) + SPOT_AHEAD_M * ahead)
            case AreaLight():
                node_light = pyrender.PointLight(color=colour, intensity=intensity)
                pose = se3.transform(np.eye(3), _middle_m(light))
            case PointLight():
                node_light = pyrender.PointLight(color=colour, intensity=intensity)
                pose = se3.transform(np.eye(3), light.position_m)
            case Sky():
                raise ValueError("pyrender has no light for the sky")
        return self.pyrender_scene.add(node_light, pose=pose)


def _spot(
    colour: Array,
    intensity: float,
    *,
    inner_rad: float,
    outer_rad: float,
) -> Any:
    import pyrender

    widest_rad = min(outer_rad, np.pi / 2)
    narrow_rad = min(inner_rad, widest_rad)
    return pyrender.SpotLight(color=colour, intensity=intensity, innerConeAngle=narrow_rad, outerConeAngle=widest_rad)


def _turned_away(mesh: MeshArrays, sun: Array) -> MeshArrays:
    """A mesh whose faces all show the sun (3,) their backs, which its shadow map leaves out; normals stay."""
    faces = mesh.faces.copy()
    towards = face_normals(mesh.corners_m) @ sun > 0
    faces[towards] = faces[towards][:, ::-1]
    return replace(mesh, faces=faces)


def _is_open(mesh: MeshArrays) -> bool:
    """Whether a mesh has an edge with a face on one side only, as a sheet has and a box has not."""
    point = welded(mesh.vertices_m).inverse
    return len(open_edges(point[mesh.faces])) > 0


def _chosen(lights: Sequence[Light]) -> list[int]:
    """Which lights pyrender draws: suns, and the strongest spots and points; panels are one or the other."""
    suns = [index for index, light in enumerate(lights) if isinstance(light, Sun)]
    spots = list[tuple[float, int]]()
    points = list[tuple[float, int]]()
    for index, light in enumerate(lights):
        if isinstance(light, Sun | Sky):
            continue
        is_panel = isinstance(light, AreaLight) and _is_ahead(light)
        kind = spots if isinstance(light, SpotLight) or is_panel else points
        kind.append((-light.power_lm, index))
    strongest = [*sorted(spots)[:MOST_SPOTS], *sorted(points)[:MOST_POINTS]]
    return sorted(suns + [index for _, index in strongest])


def _strength(light: Light) -> float:
    """Strength at level 1 in the unit of pyrender's light: candela, lux of the sun."""
    match light:
        case Sun():
            return light.illuminance_lx
        case SpotLight():
            return light.peak_cd
        case AreaLight() if _is_ahead(light):
            return light.power_lm / np.pi
        case AreaLight() | PointLight():
            return light.power_lm / (4 * np.pi)
        case Sky():
            raise ValueError("pyrender has no light for the sky")


def _is_ahead(light: AreaLight) -> bool:
    """Whether a panel shines to one side."""
    return bool(np.linalg.norm(_summed_normal(light)) > LEAST_AHEAD)


def _mean_normal(light: AreaLight) -> Array:
    return unit(_summed_normal(light))


def _summed_normal(light: AreaLight) -> Array:
    """The mean (3,) of a panel's normals by area, shorter than 1 where they differ."""
    corners_m = face_corners(light.mesh)
    areas = areas_m2(corners_m)
    return np.asarray(areas @ face_normals(corners_m) / areas.sum())


def _middle_m(light: AreaLight) -> Array:
    """The centroid (3,) of a panel's faces."""
    corners_m = face_corners(light.mesh)
    areas = areas_m2(corners_m)
    return np.asarray(areas @ corners_m.mean(1) / areas.sum())


def _shining_along(direction: Array, position_m: Array) -> NDArray[np.float64]:
    """T_world_light (4, 4) of a light that shines along a unit vector (3,): pyrender's shine along their -z."""
    z = -unit(direction)
    is_along_x = abs(z[0]) >= 0.9
    sideways = np.array([0, 1.0, 0]) if is_along_x else np.array([1.0, 0, 0])
    x = unit(cross(sideways, z))
    R_world_light = np.stack([x, cross(z, x), z], -1)
    return se3.transform(R_world_light, position_m)
