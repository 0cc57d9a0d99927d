"""Reads glTF, OBJ, STL and PLY files as things, materials, lights and movers of a scene."""

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
Z_UP_SUFFIXES = (".stl", ".ply")  # by custom: these formats do not define an axis
SILVER_TINT = 0.9  # of a mirror whose material is not a metal
LEAST_M2 = 1e-12  # smaller faces count as faces without area
# A camera cannot enter a closed body of at most this size, so that the backs of its faces are never seen.
CLOSED_M = 1.0
# A model outside of these limits is probably in another unit, or damaged. Most models are about TYPICAL_M across.
SMALLEST_M = 0.05
PLACE_M = 3.0
TYPICAL_M = 5.0
LARGEST_M = 500.0
FARTHEST_M = 1e7
LYING = 2.0  # ratio of the areas that face along the other axis and up or down, above which a model lies
FLAT = 0.5  # the height of a place is usually less than this share of its length and of its width
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # T_model_file of a file with y up


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Things that move together. Their frame has the axes of the model and its origin at at_m (3,), their node."""

    name: str
    at_m: Array
    things: tuple[Thing, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """The contents of a file in metres, with z up.

    lamps: names of the things that are lamps. notes: differences from the file, and doubts about it. dropped: the
    number of faces without area that were removed.
    """

    things: tuple[Thing, ...]
    materials: dict[str, Material]
    lights: tuple[ModelLight, ...] = ()
    movers: tuple[Moving, ...] = ()
    lamps: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    dropped: int = 0

    @property
    def everything(self) -> list[Thing]:
        """All things at their positions in the file, including those of movers."""
        moving = [_shifted(thing, mover.at_m) for mover in self.movers for thing in mover.things]
        return [*self.things, *moving]


def read_model(
    path: Path | str,
    *,
    scale: float = 1.0,
    roles: Mapping[str, str] = {},
    up: str | None = None,
) -> Model:
    """The contents of a glTF, OBJ, STL or PLY file whose unit is `scale` metres.

    roles: a role for each glob of node names; it replaces the role that the file gives (extras: {"vobench": "mirror"}).
    A node without a role has that of its nearest ancestor with one. up: "y" or "z"; by default that of the format.
    An emission of 1 is 1 cd/m², and lights are in cd and lx, as in glTF; `scale` does not change them.
    Raises ModelError with the file, the node and advice.
    """
    path = Path(path)
    with located(str(path)), np.errstate(all="ignore"):
        _require_file(path)
        kind = path.suffix.lower()
        axis = up or ("z" if kind in Z_UP_SUFFIXES else "y")
        T_model_file = np.diag([scale, scale, scale, 1.0]) @ (Y_UP if axis == "y" else np.eye(4))

        is_gltf = kind in GLTF_SUFFIXES
        notes = [] if is_gltf else [f"{kind} has no unit and no axes: read as {scale:g} m each, {axis} up"]
        if is_gltf:
            data = path.read_bytes()
        else:
            data, missing = read_as_glb(path)
            notes += missing
        file = read_gltf(data, path.parent, has_srgb_vertices=not is_gltf)

        nodes = sorted(file.nodes(T_model_file), key=lambda node: node.names)
        _require_matched(roles, nodes)
        shown = [node for node in nodes if _role(node, roles).name != "ignored"]
        file.require_few(shown)

        poses = {node.index: node.poses[-1] for node in nodes}
        primitives: list[Primitive] = []
        lights: list[ModelLight] = []
        for node in shown:
            with located(str(node)):
                primitives += [_sound(primitive) for primitive in file.primitives(node, poses)]
                lights += file.lights(node)

        model = _model(primitives, lights, roles)
        notes += _notes_of_file(file, primitives)
        if not up:  # else the user has decided
            notes += _doubt_of_axis(model, path, axis)
        notes += _doubt_of_unit(model)
        return replace(model, notes=tuple(dict.fromkeys(notes)))


def _notes_of_file(file: Gltf, primitives: Sequence[Primitive]) -> list[str]:
    """Notes on what is read differently from the file."""
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
    """The model of a file: names are unique, roles are applied, and movers are separated from stationary things."""
    solid = [primitive for primitive in primitives if len(primitive.mesh.faces)]
    if not solid:
        raise ModelError("has no faces to see: are its nodes empty, of points or lines, without area, or ignored?")
    names = _unique_names({primitive.node: primitive.node.names[-1] for primitive in solid})
    role = {node: _role(node, roles) for node in names}

    named_materials = [_in_role(primitive.look, role[primitive.node].name) for primitive in solid]
    material_names = _unique_names({named: named[0] for named in named_materials})
    stationary = []
    moving = []
    bright = {}
    for primitive, named_material in zip(solid, named_materials, strict=True):
        node = primitive.node
        _, material = named_material
        thing = Thing(names[node], primitive.mesh.mesh(), material_names[named_material])
        mover = role[node].mover
        if mover is None:
            stationary.append(thing)
        else:
            moving.append((node, mover, thing))
        if max(material.emission_cd_m2) > 0:
            bright[node] = names[node]

    return Model(
        things=tuple(stationary),
        materials={name: material for (_, material), name in material_names.items()},
        lights=_renamed(lights),
        movers=_movers(moving),
        lamps=_lamps([node for node in names if role[node].name == "lamp"], bright),
        dropped=sum(primitive.dropped for primitive in primitives),
    )


def _renamed(lights: Sequence[ModelLight]) -> tuple[ModelLight, ...]:
    """The lights with unique names."""
    names = _unique_names({nth: light.name for nth, light in enumerate(lights)})
    return tuple(replace(light, name=names[nth]) for nth, light in enumerate(lights))


def _lamps(
    lamps: Sequence[Node],
    bright: Mapping[Node, str],
) -> tuple[str, ...]:
    """The names of the things of lamps that emit light. Raises ModelError if there are lamps, but none emits."""
    shining = tuple(bright[node] for node in lamps if node in bright)
    if lamps and not shining:
        raise ModelError(f"{lamps[0]}: is a lamp without light; set its emissiveFactor and emissiveStrength (cd/m²)")
    return shining


def _movers(moving: Sequence[tuple[Node, int, Thing]]) -> tuple[Moving, ...]:
    """Things grouped by the ancestor that moves them, which is given by its place in the names of the node."""
    gathered: dict[tuple[tuple[float, ...], tuple[str, ...]], list[Thing]] = {}
    for node, nth, thing in moving:
        origin_m = node.poses[nth + 1][:3, 3]
        key = (tuple(origin_m), node.names[: nth + 1])
        gathered.setdefault(key, []).append(_shifted(thing, -origin_m))
    names = _unique_names({key: key[1][-1] for key in gathered})
    return tuple(Moving(names[key], np.array(key[0]), tuple(things)) for key, things in gathered.items())


def _shifted(thing: Thing, by_m: Array) -> Thing:
    original = arrays(thing.mesh)
    shifted = replace(original, vertices_m=original.vertices_m + by_m)
    return replace(thing, mesh=shifted.mesh())


def _unique_names(wanted: Mapping[Key, str]) -> dict[Key, str]:
    """A name for each key, none of them twice: a second 'chair' is 'chair_2'."""
    reserved = set(wanted.values())
    given: set[str] = set()
    unique_names: dict[Key, str] = {}
    for key, name in wanted.items():
        unique = name if name not in given else next(_free_names(name, reserved))
        reserved.add(unique)
        given.add(unique)
        unique_names[key] = unique
    return unique_names


def _free_names(name: str, taken: set[str]) -> Iterator[str]:
    """name_2, name_3 and so on, without the taken ones."""
    numbered = (f"{name}_{n}" for n in count(2))
    return (candidate for candidate in numbered if candidate not in taken)


@dataclass(frozen=True, slots=True)
class _Role:
    """The role of a node. mover: the place, in the names of the node, of the ancestor that moves it."""

    name: str
    mover: int | None


def _role(node: Node, roles: Roles) -> _Role:
    """The role of a node: that of its nearest ancestor with one. `ignored` and `mover` apply to all descendants."""
    names = [_own_role(name, in_file, roles) for name, in_file in zip(node.names, node.roles, strict=True)]
    for name in names:
        if name and name not in ROLES:
            raise ModelError(f"{node}: {unknown_name_sentence('role', name, [*ROLES])}")
    mover = names.index("mover") if "mover" in names else None
    if "ignored" in names:
        return _Role("ignored", mover)
    looks = [name for name in names if name not in ("", "mover")]
    return _Role(looks[-1] if looks else "", mover)


def _own_role(node_name: str, role_in_file: str, roles: Roles) -> str:
    """The role of the first glob that matches the name of a node; without one, the role in the file."""
    matching = (role for glob, role in roles.items() if fnmatchcase(node_name, glob))
    return next(matching, role_in_file)


def _in_role(look: Look, role: str) -> tuple[str, Material]:
    """The name and material of a look in a role; a mirror keeps the tone of a metal, or is silver."""
    material = look.material
    if role == "mirror":
        is_metal = material.metal > 0.5
        tint = float(np.array(material.colour) @ LUMINANCE) if is_metal else SILVER_TINT
        return f"{look.name}_mirror", Material("mirror", tint=tint)
    if role == "pane" and material.kind != "pane":
        return f"{look.name}_pane", Material("pane", eta=1.5)
    return look.name, material


def _doubt_of_axis(model: Model, path: Path, axis: str) -> list[str]:
    """A note if a model, read with `axis` up, is likely a place that lies on its side, its floor upright as a wall.

    Signs of it: most of its area faces along the other axis, or it is flat along that axis, as rooms are in height.
    """
    corners_m = np.concatenate([corners(thing.mesh) for thing in model.everything])
    width_m, depth_m, height_m = np.ptp(corners_m, axis=(0, 1))
    projected_m2 = areas_m2(corners_m) @ np.abs(face_normals(corners_m))  # (3,), along x, y and z
    _, sideways_m2, up_m2 = projected_m2

    is_place = max(width_m, depth_m, height_m) > PLACE_M
    faces_sideways = sideways_m2 > LYING * up_m2
    has_large_sides = LYING * sideways_m2 > up_m2
    is_flat_sideways = depth_m < FLAT * min(width_m, height_m) and height_m > PLACE_M and has_large_sides
    if not (is_place and (faces_sideways or is_flat_sideways)):
        return []
    other = "z" if axis == "y" else "y"
    return [
        f"stands on its side? It is read with {axis} up; if {other} is up, say so in a scene's YAML: "
        f"meshes: [{{file: {path.name}, up: {other}}}]"
    ]


def _doubt_of_unit(model: Model) -> list[str]:
    """A note if the unit of a model is probably not the metre."""
    corners_m = np.concatenate([corners(thing.mesh) for thing in model.everything])
    span = float(np.ptp(corners_m, axis=(0, 1)).max())
    if SMALLEST_M <= span <= LARGEST_M:
        return []
    units = {0.001: "in millimetres?", 0.01: "in centimetres?", 100.0: "shrunk twice?", 1000.0: "shrunk twice?"}
    factor = min(units, key=lambda unit: abs(np.log(max(span, 1e-9) * unit / TYPICAL_M)))
    return [f"spans {span:,.4g} m: {units[factor]} scale: {factor:g}"]


def _sound(primitive: Primitive) -> Primitive:
    """A primitive of separate faces in the frame of the model, with area and normals, and with visible backs."""
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
    solid = _separate_faces(mesh, mesh.faces[has_area])
    look = primitive.look
    if primitive.colours is not None and has_area.any():
        solid, look = painted(solid, primitive.colours[mesh.faces[has_area]], look)
    shows_backs = look.two_sided and look.material.kind == "body"
    if shows_backs and not _is_small_and_closed(solid):
        solid = solid.two_sided()
    dropped = int(np.count_nonzero(~has_area))
    return replace(primitive, mesh=solid, look=look, colours=None, notes=notes, dropped=dropped)


def _separate_faces(mesh: MeshArrays, faces: Faces) -> MeshArrays:
    """Faces (F, 3) of a mesh without shared vertices; a vertex without a normal has that of its face."""
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
