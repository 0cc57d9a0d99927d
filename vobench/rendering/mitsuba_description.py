"""A scene as Mitsuba describes it: meshes with materials, and lights."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from vobench.rendering.array_types import Mask, Pixels
from vobench.rendering.back_face import back_faces
from vobench.rendering.mitsuba_light import emitter_plugin, light_key, nominal_strength
from vobench.rendering.mitsuba_material import Plugin, area_emitter, bsdf_plugin, grey, rgb
from vobench.rendering.mitsuba_sun import register_sun
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Material
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles


@dataclass(frozen=True, slots=True)
class MeshGroup:
    """Faces that become one mesh of Mitsuba.

    `mover` is the index of the mover to which all of them belong, -1 for none.
    `material` is the name of their material.
    `two_sided` is whether they are visible from both sides.
    `faces` (K,) are their indices.
    """

    mover: int
    material: str
    two_sided: bool
    faces: Pixels

    @property
    def key(self) -> str:
        """The name of the mesh in the scene of Mitsuba."""
        return f"mesh_{self.mover + 1}_{self.faces[0]}"


def mesh_groups(scene: Scene, faces: Triangles) -> list[MeshGroup]:
    """Divide all faces, except those of lamps, into meshes.

    Two faces back to back are represented by the first one, which is visible from both sides. If they emit light, both
    are included, because an emitter of Mitsuba has one side.
    """
    back = back_faces(faces)[:-1]  # (F,), -1 for none; the last entry of `back_faces` is not that of a face
    is_two_sided = (back >= 0) & ~_emits_light(scene, faces)
    is_first = back > np.arange(len(back))
    is_included = (faces.lamp < 0) & (~is_two_sided | is_first)

    # The faces of a thing are consecutive, and belong to the same mover.
    starts = np.searchsorted(faces.thing, np.arange(len(faces.things) + 1))
    parts_by_group = dict[tuple[int, str, bool], list[Pixels]]()
    for thing, (start, end) in zip(faces.things, pairwise(starts), strict=True):
        included = start + np.flatnonzero(is_included[start:end])
        for two_sided in (False, True):
            selected = included[is_two_sided[included] == two_sided]
            if len(selected):
                group = (int(faces.mover[start]), thing.material, two_sided)
                parts_by_group.setdefault(group, []).append(selected)

    groups = []
    for (mover, material, two_sided), parts in parts_by_group.items():
        groups.append(MeshGroup(mover, material, two_sided, faces=np.concatenate(parts)))
    return groups


def _emits_light(scene: Scene, faces: Triangles) -> Mask:
    """Whether the material of each face (F,) emits light."""
    emitting = {name for name, material in scene.materials.items() if any(material.emission_cd_m2)}
    thing_emits = np.array([thing.material in emitting for thing in faces.things], bool)
    return np.asarray(thing_emits[faces.thing])


def load_scene(mi: Any, scene: Scene) -> Any:
    """Load a scene into Mitsuba at time 0, with all lights at level 1. The variant of Mitsuba must be set."""
    register_sun()
    bodies = triangles(scene)
    poses = [mover.path.pose(0) for mover in scene.movers]
    faces = bodies.with_movers_at(poses)

    plugins: Plugin = {"type": "scene"}
    bsdfs = dict[tuple[str, bool], Any]()  # by name of the material, and whether it is visible from both sides
    for group in mesh_groups(scene, bodies):
        material = scene.materials[group.material]
        bsdf_key = (group.material, group.two_sided)
        if bsdf_key not in bsdfs:
            bsdfs[bsdf_key] = mi.load_dict(bsdf_plugin(mi, material, two_sided=group.two_sided))
        emits_light = any(material.emission_cd_m2)
        plugins[group.key] = _mesh(
            mi,
            group.key,
            faces,
            group.faces,
            bsdf=bsdfs[bsdf_key],
            emitter=area_emitter(mi, material) if emits_light else None,
            tile_m=material.tile_m,
        )

    black = mi.load_dict({"type": "diffuse", "reflectance": grey(0)})
    for index, light in enumerate(scene.lights):
        key = light_key(index)
        lamp_faces = np.flatnonzero(faces.lamp == index)
        if len(lamp_faces):
            emitter, tile_m = _lamp_emitter(mi, scene, light)
            plugins[key] = _mesh(mi, key, faces, lamp_faces, bsdf=black, emitter=emitter, tile_m=tile_m)
        else:
            plugins[key] = emitter_plugin(mi, light)
    return mi.load_dict(plugins, optimize=False)


def _lamp_emitter(mi: Any, scene: Scene, light: Light) -> tuple[Any, float]:
    """The emitter of the faces of a lamp, and the side in metres of a tile of its texture; 1 without a texture."""
    material = textured_material(scene, light)
    if material and material.emission_texture:
        return area_emitter(mi, material), material.emission_texture.tile_m
    uniform = {"type": "area", "radiance": rgb(nominal_strength(light))}
    return mi.load_dict(uniform), 1.0


def textured_material(scene: Scene, light: Light) -> Material | None:
    """The material of a lamp if it has a texture of emitted light, otherwise None."""
    if not isinstance(light, AreaLight):
        return None
    material = scene.materials.get(light.material)
    return material if material and material.emission_texture else None


def _mesh(
    mi: Any,
    name: str,
    faces: Triangles,
    rows: Pixels,
    *,
    bsdf: Any,
    emitter: Any,
    tile_m: float,
) -> Any:
    """The mesh of the faces with the indices `rows` (K,). Each face has its own three vertices.

    `emitter` is None for faces that emit no light. `tile_m` is the side of a tile of the texture.
    """
    properties = mi.Properties()
    properties["mesh_bsdf"] = bsdf
    if emitter:
        properties["mesh_emitter"] = emitter
    vertex_count = 3 * len(rows)
    mesh = mi.Mesh(
        name,
        vertex_count=vertex_count,
        face_count=len(rows),
        props=properties,
        has_vertex_normals=True,
        has_vertex_texcoords=True,
    )
    parameters = mi.traverse(mesh)
    parameters["faces"] = np.arange(vertex_count, dtype=np.uint32)
    parameters["vertex_positions"] = faces.corners_m[rows].ravel().astype(np.float32)
    parameters["vertex_normals"] = faces.normals[rows].ravel().astype(np.float32)
    parameters["vertex_texcoords"] = (faces.uv[rows] / tile_m).ravel().astype(np.float32)
    parameters.update()
    return mesh


def one_sided_shapes(mi: Any, scene: Scene, loaded: Any) -> Any:
    """Whether each shape of a loaded scene, by its index in Mitsuba, is visible from its front only."""
    import drjit as dr

    visible_from_behind = set[str]()
    for group in mesh_groups(scene, triangles(scene)):
        if group.two_sided or scene.materials[group.material].kind == "pane":
            visible_from_behind.add(group.key)

    is_one_sided = dict[int, bool]()
    for shape in loaded.shapes():
        # Dr.Jit stores a pointer to a shape as the index of the shape in its registry.
        pointer = mi.ShapePtr(shape)
        index = int(dr.reinterpret_array(mi.UInt32, pointer)[0])
        is_one_sided[index] = shape.id() not in visible_from_behind
    count = max(is_one_sided, default=0) + 1
    return mi.Bool([is_one_sided.get(index, False) for index in range(count)])
