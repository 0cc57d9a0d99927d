"""Reads the things, materials, lights and movers of a scene from glTF, OBJ, STL and PLY files."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple, TypeVar

import numpy as np

from vobench.asset.gltf import Gltf, ModelLight, Node, Primitive, read_gltf
from vobench.asset.gltf_file import MOST_BYTES, located
from vobench.asset.mesh_file import read_as_glb
from vobench.asset.mesh_repair import repaired
from vobench.asset.model_check import axis_notes, unit_notes
from vobench.asset.node_role import (
    NamedMaterial,
    NodeRole,
    RoleByGlob,
    material_in_role,
    node_role,
    require_matching_nodes,
)
from vobench.errors import ModelError
from vobench.geometry.se3 import Array
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays, as_mesh, face_corners
from vobench.scene.triangles import Thing

Key = TypeVar("Key")
GLTF_SUFFIXES = (".glb", ".gltf")
Z_UP_SUFFIXES = (".stl", ".ply")  # by convention, because these formats do not define the up axis
NO_ROLES: Mapping[str, str] = MappingProxyType({})
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
    `dropped_faces` is the number of faces that were removed because they have no area.
    """

    things: tuple[Thing, ...]
    materials: dict[str, Material]
    lights: tuple[ModelLight, ...] = ()
    movers: tuple[ModelMover, ...] = ()
    lamps: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    dropped_faces: int = 0

    @property
    def all_things(self) -> list[Thing]:
        """All things at their positions in the file, including those of movers."""
        moving = [_shifted(thing, mover.origin_m) for mover in self.movers for thing in mover.things]
        return [*self.things, *moving]


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The thing that a primitive of a node becomes, and the role of the node."""

    node: Node
    role: NodeRole
    thing: Thing
    emits_light: bool


class _Content(NamedTuple):
    """The primitives and lights of the nodes of a file, in the frame of the model."""

    primitives: tuple[Primitive, ...]
    lights: tuple[ModelLight, ...]


class _Ancestor(NamedTuple):
    """The node that moves its descendants: its origin in the frame of the model, and the names from the root to it."""

    origin_m: tuple[float, ...]
    names: tuple[str, ...]


def read_model(
    path: Path | str,
    *,
    scale: float = 1.0,
    roles: Mapping[str, str] = NO_ROLES,
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
            notes.append(f"{suffix} has no unit and no axes: one unit was read as {scale:g} m, and {up_axis} as up")
        gltf, notes_on_missing_files = _read_gltf(path, is_gltf=suffix in GLTF_SUFFIXES)
        notes += notes_on_missing_files
        content = _visible_content(gltf, _T_model_file(scale, up_axis), roles)
        model = _model(content, roles)

        notes += _notes_on_reading(gltf, content.primitives)
        corners_m = np.concatenate([face_corners(thing.mesh) for thing in model.all_things])  # (F, 3, 3)
        if not up:  # otherwise the user has chosen the axis
            notes += axis_notes(corners_m, file_name=path.name, up_axis=up_axis)
        notes += unit_notes(corners_m)
        return replace(model, notes=tuple(dict.fromkeys(notes)))


def _default_up_axis(suffix: str) -> str:
    """The axis that points up in files of a format."""
    return "z" if suffix in Z_UP_SUFFIXES else "y"


def _T_model_file(scale: float, up_axis: str) -> Array:
    """The transform (4, 4) from the coordinates of a file to metres with z up."""
    R_model_file = Y_UP if up_axis == "y" else np.eye(4)
    T_model_file: Array = np.diag([scale, scale, scale, 1.0]) @ R_model_file
    return T_model_file


def _read_gltf(path: Path, *, is_gltf: bool) -> tuple[Gltf, list[str]]:
    """The glTF content of a file, and notes on missing files. A file in another format is converted to glTF first."""
    if is_gltf:
        return read_gltf(path.read_bytes(), path.parent, has_srgb_vertices=False), []
    data, missing = read_as_glb(path)
    return read_gltf(data, path.parent, has_srgb_vertices=True), missing


def _visible_content(gltf: Gltf, T_model_file: Array, roles: RoleByGlob) -> _Content:
    """The content of all nodes that are not ignored."""
    nodes = sorted(gltf.nodes(T_model_file), key=lambda node: node.names)
    require_matching_nodes(roles, nodes)
    visible_nodes = [node for node in nodes if node_role(node, roles).name != "ignored"]
    gltf.require_few_faces(visible_nodes)

    poses = {node.index: node.poses[-1] for node in nodes}
    primitives: list[Primitive] = []
    lights: list[ModelLight] = []
    for node in visible_nodes:
        with located(str(node)):
            primitives.extend(repaired(primitive) for primitive in gltf.primitives(node, poses))
            lights.extend(gltf.lights(node))
    return _Content(tuple(primitives), tuple(lights))


def _notes_on_reading(gltf: Gltf, primitives: Sequence[Primitive]) -> list[str]:
    """Notes on what was read differently from the file."""
    notes = []
    reduced = len(gltf.materials.reduced)
    if reduced:
        notes.append(f"{reduced} of its textures are reduced to fit into memory")
    notes += gltf.file.notes
    for primitive in primitives:
        notes += [*primitive.look.notes, *primitive.notes]
    return notes


def _require_file(path: Path) -> None:
    if not path.is_file():
        raise ModelError("there is no such file")
    size_bytes = path.stat().st_size
    if size_bytes == 0:
        raise ModelError("is empty")
    if size_bytes > MOST_BYTES:
        raise ModelError(f"has {size_bytes:,} bytes, more than {MOST_BYTES:,}")


def _model(content: _Content, roles: RoleByGlob) -> Model:
    """The model that consists of a file's content, with unique names. Raises ModelError if it has no faces."""
    visible = [primitive for primitive in content.primitives if len(primitive.mesh.faces)]
    if not visible:
        raise ModelError(
            "has no visible faces: its nodes are empty, consist of points or lines, have no area, or are ignored"
        )
    parts, materials = _parts(visible, roles)
    return Model(
        things=tuple(part.thing for part in parts if part.role.mover is None),
        materials=materials,
        lights=_renamed(content.lights),
        movers=_movers(parts),
        lamps=_lamps(parts),
        dropped_faces=sum(primitive.dropped for primitive in content.primitives),
    )


def _parts(primitives: Sequence[Primitive], roles: RoleByGlob) -> tuple[list[_Part], dict[str, Material]]:
    """The parts of a model, one for each primitive, and a mapping from unique names to their materials."""
    node_names = _unique_names({primitive.node: primitive.node.names[-1] for primitive in primitives})
    role_by_node = {node: node_role(node, roles) for node in node_names}
    named_materials: list[NamedMaterial] = []
    for primitive in primitives:
        role = role_by_node[primitive.node]
        named_materials.append(material_in_role(primitive.look, role.name))
    material_names = _unique_names({named: named.name for named in named_materials})

    parts = []
    for primitive, named in zip(primitives, named_materials, strict=True):
        node = primitive.node
        thing = Thing(node_names[node], as_mesh(primitive.mesh), material_names[named])
        emits_light = max(named.material.emission_cd_m2) > 0
        parts.append(_Part(node, role_by_node[node], thing, emits_light))
    return parts, {name: named.material for named, name in material_names.items()}


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
    things_by_ancestor: dict[_Ancestor, list[Thing]] = {}
    for part in parts:
        mover = part.role.mover
        if mover is None:
            continue
        origin_m = part.node.poses[mover + 1][:3, 3]  # poses[0] is that of the root, which has no name
        ancestor = _Ancestor(tuple(origin_m), part.node.names[: mover + 1])
        things_by_ancestor.setdefault(ancestor, []).append(_shifted(part.thing, -origin_m))

    unique_names = _unique_names({ancestor: ancestor.names[-1] for ancestor in things_by_ancestor})
    movers = []
    for ancestor, things in things_by_ancestor.items():
        movers.append(ModelMover(unique_names[ancestor], np.array(ancestor.origin_m), tuple(things)))
    return tuple(movers)


def _shifted(thing: Thing, offset_m: Array) -> Thing:
    original = as_arrays(thing.mesh)
    shifted = replace(original, vertices_m=original.vertices_m + offset_m)
    return replace(thing, mesh=as_mesh(shifted))


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
