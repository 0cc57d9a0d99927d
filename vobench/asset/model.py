"""Models from files: what stands in a glTF, OBJ, STL or PLY file, as things, materials, lights and movers."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vobench.asset.gltf import MOST_BYTES, MOST_FACES, Look, ModelLight, Part, Place, read_gltf, told
from vobench.errors import ModelError, unknown
from vobench.geometry.se3 import Array
from vobench.scene.material import LUMINANCE, Map, Material, Picture, srgb
from vobench.scene.mesh import Mesh, Thing, areas_m2, face_normals

Roles = Mapping[str, str]
Key = TypeVar("Key")
ROLES = ("mirror", "pane", "lamp", "mover", "ignored")
# Faces smaller have no area; corners nearer are one.
LEAST_M2 = 1e-12
WELD_M = 1e-5
# No camera gets into a closed body this small: its backs are never seen.
CLOSED_M = 1.0
# Beyond these a model is likely in another unit, or damaged; most are about TYPICAL_M across.
SMALLEST_M = 0.05
PLACE_M = 3.0
TYPICAL_M = 5.0
LARGEST_M = 500.0
FARTHEST_M = 1e7
LYING = 2.0  # times as much area that looks along the other axis as up and down
FLAT = 0.5  # a place is likely less high than this share of its length and of its width
Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Things that move as one, in axes like the model's whose origin is at at_m (3,), that of their node."""

    name: str
    at_m: Array
    things: tuple[Thing, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """What stands in a file, in metres, z up. Of its things, those named in `lamps` are to shine as lamps do.

    dropped: how many faces had no area; notes: what is otherwise than the file has it, or in doubt.
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
        """Every thing where it is in the file, movers' too."""
        return [*self.things, *(_shifted(thing, mover.at_m) for mover in self.movers for thing in mover.things)]


def read_model(path: Path | str, *, scale: float = 1.0, roles: Mapping[str, str] = {}, up: str | None = None) -> Model:
    """What stands in a glTF, OBJ, STL or PLY file whose unit is `scale` metres.

    roles: by glob of node names, before what nodes say of themselves (extras: {"vobench": "mirror"}); nodes below have
    the role of the one above. up: "y" or "z", else as the format has it. Emission of 1 is 1 cd/m² and lights are in cd
    and lx, as in glTF, whatever the scale. Raises ModelError with file, node and what would help.
    """
    path = Path(path)
    kind = path.suffix.lower()
    with told(str(path)), np.errstate(all="ignore"):
        if not path.is_file() or not 0 < path.stat().st_size <= MOST_BYTES:
            raise ModelError("is empty or too large" if path.is_file() else "there is no such file")
        axis = up or ("z" if kind in (".stl", ".ply") else "y")
        notes = []
        if kind not in (".glb", ".gltf"):
            notes = [f"{kind} knows no unit and no axes: read as {scale:g} m each, {axis} up"]
        T_model_file = np.diag([scale, scale, scale, 1.0]) @ (Z_UP if axis == "y" else np.eye(4))
        file = read_gltf(_through_trimesh(path) if notes else path.read_bytes(), path.parent)
        file = replace(file, has_srgb_vertices=bool(notes))
        places = sorted(file.places(T_model_file), key=lambda place: place.names)
        poses = {place.index: place.poses[-1] for place in places}
        names = sorted({name for place in places for name in place.names})
        if unmatched := [glob for glob in roles if not any(fnmatchcase(name, glob) for name in names)]:
            raise ModelError(unknown("node", unmatched[0], names))
        shown = [place for place in places if _role(place, roles)[0] != "ignored"]
        file.require_few(shown)
        parts = list[Part]()
        lights = list[ModelLight]()
        for place in shown:
            with told(str(place)):
                parts += map(_sound, file.parts(place, poses))
                lights += file.light(place)
        notes += [f"{len(file.reduced)} of its pictures are reduced to fit into memory"] if file.reduced else []
        model = _model(parts, lights, roles)
        # Who gave the axis has been asked already.
        on_its_side = [] if up else _doubt_of_axis(model, path, axis)
        said = [note for part in parts for note in (*part.look.notes, *part.notes)]
        all_notes = [*notes, *file.notes, *said, *on_its_side, *_doubt_of_unit(model)]
        return replace(model, notes=tuple(dict.fromkeys(all_notes)))


def _model(parts: Sequence[Part], lights: Sequence[ModelLight], roles: Roles) -> Model:
    """Things, materials and lights with names of their own, in their roles, movers apart from what stands."""
    solid = [part for part in parts if len(part.mesh.faces)]
    if not solid:
        raise ModelError("has no faces to see: are its nodes empty, of points or lines, without area, or ignored?")
    names = _apart({part.place: part.place.names[-1] for part in solid})
    role = {place: _role(place, roles) for place in names}
    looks = [_in_role(part.look, role[part.place][0]) for part in solid]
    material = _apart({look: look[0] for look in looks})
    pairs = list(zip(solid, looks, strict=True))
    things = [(part.place, Thing(names[part.place], part.mesh, material[look])) for part, look in pairs]
    bright = {part.place: names[part.place] for part, (_, look) in pairs if max(look.emission_cd_m2) > 0}
    lamps = [place for place in names if role[place][0] == "lamp"]
    if lamps and not bright.keys() & lamps:
        raise ModelError(f"{lamps[0]}: is a lamp without light; set its emissiveFactor and emissiveStrength (cd/m²)")
    own = _apart({nth: light.name for nth, light in enumerate(lights)})
    return Model(
        things=tuple(thing for place, thing in things if role[place][1] is None),
        materials={name: look for (_, look), name in material.items()},
        lights=tuple(replace(light, name=own[nth]) for nth, light in enumerate(lights)),
        movers=_movers([(place, nth, thing) for place, thing in things if (nth := role[place][1]) is not None]),
        lamps=tuple(bright[place] for place in lamps if place in bright),
        dropped=sum(part.dropped for part in parts),
    )


def _movers(moving: Sequence[tuple[Place, int, Thing]]) -> tuple[Moving, ...]:
    """Things gathered by the nth of the nodes that lead to each."""
    found: dict[tuple[Any, ...], list[Thing]] = {}
    for place, nth, thing in moving:
        at = place.poses[nth + 1][:3, 3]
        found.setdefault((tuple(at), *place.names[: nth + 1]), []).append(_shifted(thing, -at))
    names = _apart({key: key[-1] for key in found})
    return tuple(Moving(names[key], np.array(key[0]), tuple(things)) for key, things in found.items())


def _shifted(thing: Thing, by_m: Array) -> Thing:
    return replace(thing, mesh=replace(thing.mesh, vertices_m=thing.mesh.vertices_m + by_m))


def _apart(wanted: Mapping[Key, str]) -> dict[Key, str]:
    """Names that differ: a second 'chair' is 'chair_2'."""
    taken = set(wanted.values())
    found = dict[str, Key]()
    for key, name in wanted.items():
        free = (f"{name}_{n}" for n in count(2))
        own = name if name not in found else next(other for other in free if other not in taken)
        taken.add(own)
        found[own] = key
    return {key: name for name, key in found.items()}


def _role(place: Place, roles: Roles) -> tuple[str, int | None]:
    """The role of a place, which is that of the nearest node with one, and which of the nodes to it moves first."""
    own = zip(place.names, place.roles, strict=True)
    found = [next((role for glob, role in roles.items() if fnmatchcase(name, glob)), said) for name, said in own]
    for role in filter(None, found):
        if role not in ROLES:
            raise ModelError(f"{place}: {unknown('role', role, [*ROLES])}")
    nearest = next((role for role in reversed(found) if role not in ("", "mover")), "")
    return "ignored" if "ignored" in found else nearest, found.index("mover") if "mover" in found else None


def _in_role(look: Look, role: str) -> tuple[str, Material]:
    """The name and material that a role makes of one; a mirror is in its metal's tone, or of silver."""
    material = look.material
    if role == "mirror":
        tint = float(np.array(material.colour) @ LUMINANCE) if material.metal > 0.5 else 0.9
        return f"{look.name}_mirror", Material("mirror", tint=tint)
    if role == "pane" and material.kind != "pane":
        return f"{look.name}_pane", Material("pane", eta=1.5)
    return look.name, material


def _doubt_of_axis(model: Model, path: Path, axis: str) -> list[str]:
    """Whether a model is likely a place that lies on its side, with its floor as a wall, as it is read with `axis` up.

    Either most of its faces look along the other axis, or it is flat along that axis, as rooms are in height.
    """
    corners_m = np.concatenate([thing.mesh.corners_m for thing in model.everything])
    width_m, depth_m, height_m = np.ptp(corners_m, axis=(0, 1))
    _, along_m2, up_m2 = areas_m2(corners_m) @ np.abs(face_normals(corners_m))

    is_place = max(width_m, depth_m, height_m) > PLACE_M
    looks_sideways = along_m2 > LYING * up_m2
    is_flat = depth_m < FLAT * min(width_m, height_m) and height_m > PLACE_M and LYING * along_m2 > up_m2
    if not (is_place and (looks_sideways or is_flat)):
        return []
    other = "z" if axis == "y" else "y"
    return [
        f"stands on its side? It is read with {axis} up; if {other} is up, say so in a scene's YAML: "
        f"meshes: [{{file: {path.name}, up: {other}}}]"
    ]


def _doubt_of_unit(model: Model) -> list[str]:
    """Whether a model is likely of another unit than metres."""
    corners_m = np.concatenate([thing.mesh.corners_m for thing in model.everything])
    span = float(np.ptp(corners_m, axis=(0, 1)).max())
    if SMALLEST_M <= span <= LARGEST_M:
        return []
    units = {0.001: "in millimetres?", 0.01: "in centimetres?", 100.0: "shrunk twice?", 1000.0: "shrunk twice?"}
    factor = min(units, key=lambda unit: abs(np.log(max(span, 1e-9) * unit / TYPICAL_M)))
    return [f"spans {span:,.4g} m: {units[factor]} scale: {factor:g}"]


def _sound(part: Part) -> Part:
    """Faces of some area in the model's frame, with vertices and normals of their own, with backs if these are seen."""
    mesh = part.mesh
    T = part.T_model_mesh
    if not np.isfinite(mesh.vertices_m).all():
        raise ModelError("has vertices at NaN or infinity; mend it where it was made")
    if not np.linalg.det(T[:3, :3]):
        return replace(part, mesh=replace(mesh, faces=mesh.faces[:0]), dropped=len(mesh.faces))
    notes = () if np.isfinite(mesh.uv).all() else (f"{part.place}: NaN in its texture coordinates read as 0",)
    mesh = replace(mesh, uv=np.nan_to_num(mesh.uv, posinf=0, neginf=0)).moved(T)
    if np.abs(mesh.vertices_m).max(initial=0) > FARTHEST_M:
        raise ModelError(f"reaches {np.abs(mesh.vertices_m).max():.3g} m; is it damaged, or of another unit?")
    faces = mesh.faces[areas_m2(mesh.corners_m) > LEAST_M2]
    normals = np.nan_to_num(mesh.normals)[faces]
    planes = face_normals(mesh.vertices_m[faces])[:, None]
    normals = np.where(np.linalg.norm(normals, axis=2, keepdims=True) > 0.5, normals, planes).reshape(-1, 3)
    own = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    solid = Mesh(mesh.vertices_m[faces].reshape(-1, 3), own, mesh.uv[faces].reshape(-1, 2), normals)
    look = part.look
    if part.colours is not None and len(faces):
        solid, look = _painted(solid, part.colours[faces], look)
    if look.two_sided and look.material.kind == "body" and not _is_small_and_closed(solid):
        solid = solid.two_sided()
    dropped = len(mesh.faces) - len(faces)
    return replace(part, mesh=solid, look=look, colours=None, notes=part.notes + notes, dropped=dropped)


def _painted(mesh: Mesh, colours: Array, look: Look) -> tuple[Mesh, Look]:
    """Linear colours (F, 3, 3) of corners: the material's where there is but one, else a picture with a patch for each.

    Over a texture only their mean is taken. In a patch colours run straight from corner to corner.
    """
    material = look.material
    if material.texture or np.ptp(colours, axis=(0, 1)).max() < 1 / 255:
        notes = (f"material '{look.name}': colours by vertex read as their mean",) if material.texture else ()
        r, g, b = np.round(colours.mean((0, 1)) * material.colour, 6).tolist()
        return mesh, replace(look, material=replace(material, colour=(r, g, b)), notes=look.notes + notes)
    kinds, which = np.unique(np.round(colours.reshape(-1, 9) * 4095).astype(np.int16), axis=0, return_inverse=True)
    size, first, last = (8, 1, 6) if len(kinds) < 1 << 16 else (4, 0, 3)
    columns = int(np.ceil(np.sqrt(len(kinds))))
    chunks = np.array_split((kinds / 4095).astype(np.float32), len(kinds) // 65_536 + 1)
    patches = np.concatenate([_patches(chunk.reshape(-1, 3, 1, 1, 3), size, first, last) for chunk in chunks])
    pixels = np.resize(patches, (columns, columns, size, size, 3))
    whole = pixels.swapaxes(1, 2).reshape(columns * size, columns * size, 3)
    corner = np.stack(np.divmod(which.reshape(-1), columns)[::-1], 1)[:, None] * size + 0.5
    uv = (corner + np.array([[first, first], [last, first], [first, last]])) / (columns * size)
    return replace(mesh, uv=uv.reshape(-1, 2)), replace(look, material=replace(material, texture=Picture(whole)))


def _patches(colours: Map, size: int, first: int, last: int) -> NDArray[np.uint8]:
    """Squares (N, size, size, 3) whose texels first and last hold colours (N, 3, 1, 1, 3): corner, right, below."""
    a, b, c = np.moveaxis(colours, 1, 0)
    along = (np.arange(size, dtype=np.float32)[:, None] - first) / (last - first)
    is_beyond = along + along[:, None] > 1.01 + 1 / (last - first)  # seen from far away alone
    return srgb(np.where(is_beyond, (a + b + c) / 3, a + along * (b - a) + along[:, None] * (c - a)))


def _numbered(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers (N,) from 0 on that are equal where rows (N, K) are."""
    number = np.zeros(len(rows), np.int64)
    for column in rows.T:
        rank = np.unique(column, return_inverse=True)[1]
        number = np.unique(number * (rank.max(initial=0) + 1) + rank, return_inverse=True)[1]
    return number


def _welded(mesh: Mesh) -> NDArray[np.int64]:
    """Numbers (F, 3) of the places at which the corners of faces lie."""
    return _numbered(np.round(mesh.vertices_m / WELD_M).astype(np.int64))[mesh.faces]


def _open_edges(mesh: Mesh) -> int:
    """How many edges have more faces on one side than on the other."""
    welded = _welded(mesh)
    start = welded.ravel()
    end = np.roll(welded, -1, axis=1).ravel()
    edges = np.minimum(start, end) * (welded.max(initial=0) + 1) + np.maximum(start, end)
    return int(np.count_nonzero(np.bincount(np.unique(edges, return_inverse=True)[1], np.sign(end - start))))


def _is_small_and_closed(mesh: Mesh) -> bool:
    """Whether a mesh is a body seen from outside into which no camera gets."""
    if np.ptp(mesh.vertices_m, axis=0).max(initial=0) > CLOSED_M or _open_edges(mesh):
        return False
    a, b, c = np.moveaxis(mesh.corners_m, 1, 0)
    return bool((a * np.cross(b, c)).sum() > 0)


def _through_trimesh(path: Path) -> bytes:
    """A file as the .glb that trimesh makes of it: matt or coated, never metal, pictures in their own colours."""
    import trimesh

    _require_few_and_whole(path)
    try:
        scene = trimesh.load_scene(path, process=False)
        for visual in [mesh.visual for mesh in scene.geometry.values()]:
            if visual.kind == "texture":
                name = getattr(visual.material, "name", None)
                visual.material = visual.material.to_pbr()
                visual.material.name = name
                visual.material.metallicFactor = 0.0
                if visual.material.baseColorTexture is not None:
                    visual.material.baseColorFactor = None
        return bytes(trimesh.exchange.gltf.export_glb(scene))  # type: ignore[no-untyped-call]
    except Exception as error:  # trimesh raises all kinds
        raise ModelError(f"trimesh cannot read it ({error or type(error).__name__}); export it as .glb") from error


def _require_few_and_whole(path: Path) -> None:
    """Refuse too many faces before trimesh reads any, and an OBJ whose materials or pictures are lost."""
    data = path.read_bytes()
    kind = path.suffix.lower()
    if kind == ".obj":
        faces = data.count(b"\nf ")
        files = re.findall(rb"^mtllib\s+(.+?)\s*$", data, re.M)
        for file in [path.parent / name.decode("utf-8", "replace") for name in files]:
            files += re.findall(rb"^\s*map_Kd\s+(?:.*\s)?(\S+)\s*$", file.read_bytes(), re.M) if file.is_file() else []
        for name in [name.decode("utf-8", "replace") for name in files]:
            if not (path.parent / name).is_file():
                raise ModelError(f"needs '{name}', which is not beside it; put it there, or export one .glb")
    elif kind == ".stl":
        faces = data.count(b"facet normal") or int.from_bytes(data[80:84], "little")
    elif kind == ".ply":
        faces = max((int(n) for n in re.findall(rb"element (?:face|vertex) (\d+)", data[:65536])), default=0) // 2
    else:
        raise ModelError("is of no format that is read: .glb, .gltf, .obj, .stl, .ply")
    if faces > MOST_FACES:
        raise ModelError(f"has {faces:,} faces, more than {MOST_FACES:,}; make them fewer, as by Blender's Decimate")
