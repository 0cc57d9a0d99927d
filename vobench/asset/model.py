"""Reads the things, materials, lights and movers of a scene from glTF, OBJ, STL and PLY files."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import count
from pathlib import Path
from typing import TypeVar

import numpy as np

from vobench.asset.gltf import Gltf, ModelLight, Node, Primitive, read_gltf
from vobench.asset.gltf_file import MOST_BYTES, located
from vobench.asset.gltf_material import Look
from vobench.asset.mesh_file import read_as_glb
from vobench.asset.vertex_colour import painted
from vobench.errors import ModelError, unknown_name_sentence
from vobench.geometry.se3 import Array
from vobench.scene.material import LUMINANCE, Material
from vobench.scene.mesh import (
    Faces,
    MeshArrays,
    Thing,
    areas_m2,
    arrays,
    corners,
    face_normals,
    is_closed_body,
)

Roles = Mapping[str, str]
Key = TypeVar("Key")
ROLES = ("mirror", "pane", "lamp", "mover", "ignored")
GLTF_SUFFIXES = (".glb", ".gltf")
Z_UP_SUFFIXES = (".stl", ".ply")  # by convention, because these formats do not define the up axis
SILVER_TINT = 0.9  # the reflectance of a mirror whose material is not a metal
LEAST_M2 = 1e-12  # the smallest area of a face; smaller faces are removed
CLOSED_M = 1.0  # the largest extent of a closed body that cannot contain a camera, so its back faces are never seen
SMALLEST_M = 0.05  # a smaller model is probably in another unit
PLACE_M = 3.0  # a larger model may be a place, such as a room, instead of an object
TYPICAL_M = 5.0  # the extent of most models
LARGEST_M = 500.0  # a larger model is probably in another unit
FARTHEST_M = 1e7  # a model with vertices farther from the origin is probably damaged
LYING = 2.0  # the ratio of sideways-facing area to upward-facing area above which a place probably lies on its side
FLAT = 0.5  # the height of a place is usually less than this share of its width and of its depth
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # T_model_file of a file with y up


@dataclass(frozen=True, slots=True, eq=False)
class ModelMover:
    """Things that move together, in a frame with the axes of the model and the origin `origin_m` (3,)."""

    name: str
    origin_m: Array
    things: tuple[Thing, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """The contents of a model file in metres, with z up.

    `lamps` lists the names of the things that are lamps.
    `notes` are sentences about what was read differently from the file, and about probable mistakes in the file.
    `dropped` is the number of faces that were removed because they have no area.
    """

    things: tuple[Thing, ...]
    materials: dict[str, Material]
    lights: tuple[ModelLight, ...] = ()
    movers: tuple[ModelMover, ...] = ()
    lamps: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    dropped: int = 0

    @property
    def everything(self) -> list[Thing]:
        """All things at their positions in the file, including those of movers."""
        moving = [_shifted(thing, mover.origin_m) for mover in self.movers for thing in mover.things]
        return [*self.things, *moving]


@dataclass(frozen=True, slots=True)
class _Role:
    """The role of a node.

    `name` is "" for a node without a role.
    `mover` is the index, in the names of the node, of the ancestor that moves the node; None if it is stationary.
    """

    name: str
    mover: int | None


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The thing that a primitive of a node becomes, and the role of the node."""

    node: Node
    role: _Role
    thing: Thing
    emits_light: bool


def read_model(
    path: Path | str,
    *,
    scale: float = 1.0,
    roles: Mapping[str, str] = {},
    up: str | None = None,
) -> Model:
    """Read a glTF, OBJ, STL or PLY file.

    `scale` is the length of one unit of the file in metres.
    `roles` maps a glob pattern for node names to a role. It overrides the role in the file, which is stored as
    extras: {"vobench": "mirror"}. A node without a role inherits that of its nearest ancestor with a role.
    `up` is the axis of the file that points up, "y" or "z". By default it is that of the format.
    As in glTF, an emission of 1 is 1 cd/m², and lights are given in cd or lx. `scale` does not change these values.
    Raises ModelError, whose message names the file and the node and says how to correct them.
    """
    path = Path(path)
    with located(str(path)), np.errstate(all="ignore"):
        _require_file(path)
        suffix = path.suffix.lower()
        up_axis = up or _default_up_axis(suffix)
        notes = []
        if suffix not in GLTF_SUFFIXES:
            notes.append(f"{suffix} has no unit and no axes: read as {scale:g} m each, {up_axis} up")
        file, missing = _gltf(path, is_gltf=suffix in GLTF_SUFFIXES)
        notes += missing
        primitives, lights = _shown(file, _T_model_file(scale, up_axis), roles)
        model = _model(primitives, lights, roles)

        notes += _notes_on_reading(file, primitives)
        if not up:  # otherwise the user has chosen the axis
            notes += _note_on_axis(model, path, up_axis)
        notes += _note_on_unit(model)
        return replace(model, notes=tuple(dict.fromkeys(notes)))


def _default_up_axis(suffix: str) -> str:
    """The axis that points up in files of a format."""
    return "z" if suffix in Z_UP_SUFFIXES else "y"


def _T_model_file(scale: float, up_axis: str) -> Array:
    """The transform (4, 4) from the coordinates of a file to metres with z up."""
    R_model_file = Y_UP if up_axis == "y" else np.eye(4)
    T_model_file: Array = np.diag([scale, scale, scale, 1.0]) @ R_model_file
    return T_model_file


def _gltf(path: Path, *, is_gltf: bool) -> tuple[Gltf, list[str]]:
    """The glTF content of a file, and notes on missing files. A file in another format is converted to glTF first."""
    if is_gltf:
        return read_gltf(path.read_bytes(), path.parent, has_srgb_vertices=False), []
    data, missing = read_as_glb(path)
    return read_gltf(data, path.parent, has_srgb_vertices=True), missing


def _shown(file: Gltf, T_model_file: Array, roles: Roles) -> tuple[list[Primitive], list[ModelLight]]:
    """The primitives and lights of all nodes that are not ignored."""
    nodes = sorted(file.nodes(T_model_file), key=lambda node: node.names)
    _require_matched(roles, nodes)
    shown_nodes = [node for node in nodes if _role(node, roles).name != "ignored"]
    file.require_few(shown_nodes)

    poses = {node.index: node.poses[-1] for node in nodes}
    primitives: list[Primitive] = []
    lights: list[ModelLight] = []
    for node in shown_nodes:
        with located(str(node)):
            primitives += [_cleaned(primitive) for primitive in file.primitives(node, poses)]
            lights += file.lights(node)
    return primitives, lights


def _notes_on_reading(file: Gltf, primitives: Sequence[Primitive]) -> list[str]:
    """Notes on what was read differently from the file."""
    notes = []
    reduced = len(file.materials.reduced)
    if reduced:
        notes.append(f"{reduced} of its pictures are reduced to fit into memory")
    notes += file.file.notes
    for primitive in primitives:
        notes += [*primitive.look.notes, *primitive.notes]
    return notes


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise ModelError("there is no such file")
    if not 0 < path.stat().st_size <= MOST_BYTES:
        raise ModelError("is empty or too large")


def _require_matched(roles: Roles, nodes: Sequence[Node]) -> None:
    """Raise ModelError for a glob in `roles` that matches no node."""
    names = sorted({name for node in nodes for name in node.names})
    for glob in roles:
        if not any(fnmatchcase(name, glob) for name in names):
            raise ModelError(unknown_name_sentence("node", glob, names))


def _model(primitives: Sequence[Primitive], lights: Sequence[ModelLight], roles: Roles) -> Model:
    """The model that consists of primitives and lights, with unique names. Raises ModelError if it has no faces."""
    visible = [primitive for primitive in primitives if len(primitive.mesh.faces)]
    if not visible:
        raise ModelError("has no faces to see: are its nodes empty, of points or lines, without area, or ignored?")
    parts, materials = _parts(visible, roles)
    return Model(
        things=tuple(part.thing for part in parts if part.role.mover is None),
        materials=materials,
        lights=_renamed(lights),
        movers=_movers(parts),
        lamps=_lamps(parts),
        dropped=sum(primitive.dropped for primitive in primitives),
    )


def _parts(primitives: Sequence[Primitive], roles: Roles) -> tuple[list[_Part], dict[str, Material]]:
    """The parts of a model, one for each primitive, and a mapping from unique names to their materials."""
    node_names = _unique_names({primitive.node: primitive.node.names[-1] for primitive in primitives})
    role_by_node = {node: _role(node, roles) for node in node_names}
    named_materials = [_in_role(primitive.look, role_by_node[primitive.node].name) for primitive in primitives]
    material_names = _unique_names({named: named[0] for named in named_materials})

    parts = []
    for primitive, named_material in zip(primitives, named_materials, strict=True):
        node = primitive.node
        _, material = named_material
        thing = Thing(node_names[node], primitive.mesh.mesh(), material_names[named_material])
        emits_light = max(material.emission_cd_m2) > 0
        parts.append(_Part(node, role_by_node[node], thing, emits_light))
    return parts, {name: material for (_, material), name in material_names.items()}


def _renamed(lights: Sequence[ModelLight]) -> tuple[ModelLight, ...]:
    """The lights with unique names."""
    names = _unique_names({index: light.name for index, light in enumerate(lights)})
    return tuple(replace(light, name=names[index]) for index, light in enumerate(lights))


def _lamps(parts: Sequence[_Part]) -> tuple[str, ...]:
    """The names of the lamps that emit light. Raises ModelError if there are lamps, but none of them emits light."""
    lamps = [part for part in parts if part.role.name == "lamp"]
    names = dict.fromkeys(part.thing.name for part in lamps if part.emits_light)
    if lamps and not names:
        node = lamps[0].node
        raise ModelError(f"{node}: is a lamp without light; set its emissiveFactor and emissiveStrength (cd/m²)")
    return tuple(names)


def _movers(parts: Sequence[_Part]) -> tuple[ModelMover, ...]:
    """The movers of a model: the moving parts, grouped by the ancestor that moves them."""
    things_by_ancestor: dict[tuple[tuple[float, ...], tuple[str, ...]], list[Thing]] = {}
    for part in parts:
        mover = part.role.mover
        if mover is None:
            continue
        origin_m = part.node.poses[mover + 1][:3, 3]  # poses[0] is that of the root, which has no name
        ancestor = (tuple(origin_m), part.node.names[: mover + 1])
        things_by_ancestor.setdefault(ancestor, []).append(_shifted(part.thing, -origin_m))

    unique_names = _unique_names({ancestor: ancestor[1][-1] for ancestor in things_by_ancestor})
    movers = []
    for ancestor, things in things_by_ancestor.items():
        origin, _ = ancestor
        movers.append(ModelMover(unique_names[ancestor], np.array(origin), tuple(things)))
    return tuple(movers)


def _shifted(thing: Thing, offset_m: Array) -> Thing:
    original = arrays(thing.mesh)
    shifted = replace(original, vertices_m=original.vertices_m + offset_m)
    return replace(thing, mesh=shifted.mesh())


def _unique_names(wanted: Mapping[Key, str]) -> dict[Key, str]:
    """A unique name for each key: the wanted name, with a number appended if it is already in use, as in 'chair_2'."""
    reserved = set(wanted.values())
    used: set[str] = set()
    unique_names: dict[Key, str] = {}
    for key, name in wanted.items():
        unique = name if name not in used else next(_free_names(name, reserved))
        reserved.add(unique)
        used.add(unique)
        unique_names[key] = unique
    return unique_names


def _free_names(name: str, reserved: set[str]) -> Iterator[str]:
    """The names name_2, name_3 and so on that are not reserved."""
    numbered = (f"{name}_{number}" for number in count(2))
    return (candidate for candidate in numbered if candidate not in reserved)


def _role(node: Node, roles: Roles) -> _Role:
    """The role of a node; without a role of its own, that of its nearest ancestor with a role.

    The roles `ignored` and `mover` apply to all descendants, even to those with another role.
    """
    names = [_own_role(name, in_file, roles) for name, in_file in zip(node.names, node.roles, strict=True)]
    for name in names:
        if name and name not in ROLES:
            raise ModelError(f"{node}: {unknown_name_sentence('role', name, [*ROLES])}")
    mover = names.index("mover") if "mover" in names else None
    if "ignored" in names:
        return _Role("ignored", mover)
    appearances = [name for name in names if name not in ("", "mover")]
    return _Role(appearances[-1] if appearances else "", mover)


def _own_role(node_name: str, role_in_file: str, roles: Roles) -> str:
    """The role of the first glob that matches the name of a node; if none matches, the role in the file."""
    matching_roles = (role for glob, role in roles.items() if fnmatchcase(node_name, glob))
    return next(matching_roles, role_in_file)


def _in_role(look: Look, role: str) -> tuple[str, Material]:
    """The name and the material of a look for an object with a role.

    The reflectance of a mirror is the luminance of its metal's colour; if it is not a metal, it is that of silver.
    """
    material = look.material
    if role == "mirror":
        is_metal = material.metal > 0.5
        tint = float(np.array(material.colour) @ LUMINANCE) if is_metal else SILVER_TINT
        return f"{look.name}_mirror", Material("mirror", tint=tint)
    if role == "pane" and material.kind != "pane":
        return f"{look.name}_pane", Material("pane", eta=1.5)
    return look.name, material


def _note_on_axis(model: Model, path: Path, axis: str) -> list[str]:
    """A note if a model that was read with `axis` up is probably a place that lies on its side.

    There are two signs: the area that faces along y is more than twice that along z, or the place is much shorter along
    y than along x and z. Rooms are usually shortest along z.
    """
    corners_m = np.concatenate([corners(thing.mesh) for thing in model.everything])
    width_m, depth_m, height_m = np.ptp(corners_m, axis=(0, 1))
    projected_m2 = areas_m2(corners_m) @ np.abs(face_normals(corners_m))  # (3,), along x, y and z
    _, sideways_m2, up_m2 = projected_m2

    is_place = max(width_m, depth_m, height_m) > PLACE_M
    faces_sideways = sideways_m2 > LYING * up_m2
    has_large_sides = LYING * sideways_m2 > up_m2
    is_flat_along_y = depth_m < FLAT * min(width_m, height_m)
    is_tall_slab = is_flat_along_y and height_m > PLACE_M and has_large_sides
    if not (is_place and (faces_sideways or is_tall_slab)):
        return []
    other_axis = "z" if axis == "y" else "y"
    return [
        f"stands on its side? It is read with {axis} up; if {other_axis} is up, say so in a scene's YAML: "
        f"meshes: [{{file: {path.name}, up: {other_axis}}}]"
    ]


def _note_on_unit(model: Model) -> list[str]:
    """A note if the unit of a model is probably not the metre."""
    corners_m = np.concatenate([corners(thing.mesh) for thing in model.everything])
    span_m = float(np.ptp(corners_m, axis=(0, 1)).max())
    if SMALLEST_M <= span_m <= LARGEST_M:
        return []

    questions = {0.001: "in millimetres?", 0.01: "in centimetres?", 100.0: "shrunk twice?", 1000.0: "shrunk twice?"}
    positive_span_m = max(span_m, 1e-9)
    likeliest_scale = min(questions, key=lambda scale: abs(np.log(positive_span_m * scale / TYPICAL_M)))
    return [f"spans {span_m:,.4g} m: {questions[likeliest_scale]} scale: {likeliest_scale:g}"]


def _cleaned(primitive: Primitive) -> Primitive:
    """The primitive, transformed to the frame of the model and repaired.

    Faces without area are removed, and missing normals are computed. Faces whose backs are visible are doubled.
    Raises ModelError for vertices that are not finite, or too far from the origin.
    """
    mesh = primitive.mesh
    T_model_mesh = primitive.T_model_mesh
    if not np.isfinite(mesh.vertices_m).all():
        raise ModelError("has vertices at NaN or infinity; repair it where it was made")
    is_singular = not np.linalg.det(T_model_mesh[:3, :3])
    if is_singular:
        return replace(primitive, mesh=replace(mesh, faces=mesh.faces[:0]), dropped=len(mesh.faces))

    notes = primitive.notes
    if not np.isfinite(mesh.uv).all():
        notes = (*notes, f"{primitive.node}: NaN in its texture coordinates read as 0")
    finite_uv = np.nan_to_num(mesh.uv, posinf=0, neginf=0)
    mesh = replace(mesh, uv=finite_uv).moved(T_model_mesh)
    farthest_m = np.abs(mesh.vertices_m).max(initial=0)
    if farthest_m > FARTHEST_M:
        raise ModelError(f"reaches {farthest_m:.3g} m; is it damaged, or of another unit?")

    has_area = areas_m2(mesh.corners_m) > LEAST_M2
    faces = mesh.faces[has_area]
    separate = _separate_faces(mesh, faces)
    look = primitive.look
    if primitive.colours is not None and has_area.any():
        separate, look = painted(separate, primitive.colours[faces], look)
    shows_backs = look.two_sided and look.material.kind == "body"
    if shows_backs and not _is_small_and_closed(separate):
        separate = separate.two_sided()
    dropped = int(np.count_nonzero(~has_area))
    return replace(primitive, mesh=separate, look=look, colours=None, notes=notes, dropped=dropped)


def _separate_faces(mesh: MeshArrays, faces: Faces) -> MeshArrays:
    """The given faces (F, 3) of a mesh, each with three vertices of its own.

    A vertex without a normal gets the normal of its face.
    """
    normals = np.nan_to_num(mesh.normals)[faces]
    flat_normals = face_normals(mesh.vertices_m[faces])[:, None]
    has_normal = np.linalg.norm(normals, axis=2, keepdims=True) > 0.5
    complete = np.where(has_normal, normals, flat_normals)
    separate = np.arange(faces.size).reshape(-1, 3)
    return MeshArrays(
        mesh.vertices_m[faces].reshape(-1, 3),
        separate,
        mesh.uv[faces].reshape(-1, 2),
        complete.reshape(-1, 3),
    )


def _is_small_and_closed(mesh: MeshArrays) -> bool:
    """Whether a mesh is a closed body that is too small for a camera to be inside."""
    extent_m = np.ptp(mesh.vertices_m, axis=0).max(initial=0)
    return bool(extent_m <= CLOSED_M) and is_closed_body(mesh)
