"""glTF 2.0 files, .glb and .gltf: nodes, faces, materials, pictures and lights. Source: Khronos, glTF 2.0.

trimesh 5.2 reads zeros where an accessor is sparse or compressed, and leaves out fans, normalised integers, second
texture coordinates, lights, strengths of emission and instances; hence this reader.
"""

import base64
import json
import struct
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vobench.errors import ModelError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.light import PointLight, SpotLight, Sun
from vobench.scene.material import LUMINANCE, WHITE, Material, Picture, linear
from vobench.scene.mesh import Mesh, unit

Json = dict[str, Any]
ModelLight = PointLight | SpotLight | Sun
# More is refused before memory is taken; two cores could not light more faces.
MOST_FACES = 1_000_000
MOST_BYTES = 1 << 30
MOST_PIXELS = 1 << 26
MOST_INSTANCES = 100_000
MOST_NESTED = 256
# Pictures are reduced to this side, and further where there are many, to so many texels in all.
MOST_SIDE = 4096
MOST_TEXELS = 1 << 27
# GGX alpha from which on nothing is seen mirrored: a coat or metal this rough is read as matt, in its colour.
MATT_ALPHA = 0.4
# Opacity below which a blended material is a pane, and below which it is not there.
CLEAR = 0.5
NOTHING = 0.02

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
TRIANGLES = 4
STRIP = 5
FAN = 6
DECOMPRESS = "decompress it: gltf-transform cp in.glb out.glb"
EXTENSIONS = {
    "KHR_draco_mesh_compression": f"is compressed by Draco; {DECOMPRESS}",
    "EXT_meshopt_compression": f"is compressed by meshopt; {DECOMPRESS}",
    "KHR_texture_basisu": "has KTX2 pictures; make them PNG: gltf-transform ktxdecompress in.glb out.glb",
    "KHR_materials_pbrSpecularGlossiness": "has materials of an old kind; gltf-transform metalrough in.glb out.glb",
    **dict.fromkeys(("KHR_lights_punctual", "KHR_mesh_quantization", "KHR_texture_transform"), ""),
    **dict.fromkeys((f"KHR_materials_{x}" for x in ("emissive_strength", "ior", "transmission", "unlit")), ""),
    **dict.fromkeys(("EXT_mesh_gpu_instancing", "EXT_texture_webp"), ""),
}
MALFORMED = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error)


@contextmanager
def told(where: str) -> Iterator[None]:
    """Says where an error is, and in one sentence that something is no glTF."""
    try:
        yield
    except ModelError as error:
        raise ModelError(" ".join(f"{where}: {error}".split())) from None
    except MALFORMED as error:
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise ModelError(f"{where}: is not as glTF 2.0 has it; export it again ({said})") from error


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A node: names, roles by their extras and T_model_node (4, 4) of those that lead to it and, last, its own.

    Every instance of EXT_mesh_gpu_instancing has one. index, source: its number, and what the file says of it.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    poses: tuple[Array, ...]
    index: int = 0
    source: Json = field(default_factory=dict)

    def __str__(self) -> str:
        return f"node '{self.names[-1]}'"


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A material, the texture coordinates that its pictures take, and T_uv (2, 3) from these to uv."""

    name: str
    material: Material
    two_sided: bool = False
    uv_set: int = 0
    T_uv: Array = field(default_factory=lambda: np.eye(2, 3))
    notes: tuple[str, ...] = ()


# glTF's default is white; in a room of nothing else light would pile up, and every picture be burnt.
BARE = Look("default", Material(colour=(0.5, 0.5, 0.5)), notes=("what has no material is read as grey and matt",))


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Faces of one look at a place, T_model_mesh (4, 4) from where they are; linear colours (V, 3) of their vertices.

    Normals are 0 where the file has none; `dropped` faces had no area.
    """

    place: Place
    mesh: Mesh
    look: Look
    T_model_mesh: Array
    colours: Array | None = None
    notes: tuple[str, ...] = ()
    dropped: int = 0


def numbers(values: Any, *shape: int) -> Array:
    """Finite numbers of a shape; ModelError for anything else."""
    found = np.asarray(values, float)
    if found.shape != shape or not np.isfinite(found).all():
        raise ModelError(f"{str(values)[:60]} stands where {(*shape, 1)[0]} finite numbers should")
    return found


def read_gltf(data: bytes, folder: Path) -> "Gltf":
    """A file that lies in a folder; its JSON is whole and asks for nothing that is unknown here."""
    text, blob = _chunks(data) if data[:4] == b"glTF" else (data, b"")
    if not text.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        raise ModelError("begins like neither .glb nor .gltf; is it of another format?")
    tree = json.loads(text.decode("utf-8-sig"))
    if not str(tree["asset"]["version"]).startswith("2."):
        raise ModelError(f"is glTF {tree['asset']['version']}, not 2; gltf-pipeline -i old.gltf -o new.glb converts it")
    for name in tree.get("extensionsRequired", []):
        if fault := EXTENSIONS.get(name, f"needs the extension {name}, which is unknown here; export it without"):
            raise ModelError(fault)
    left = [f"{name} is not read" for name in sorted(tree.get("extensionsUsed", [])) if EXTENSIONS.get(name, name)]
    left += ["animations are not played"] if tree.get("animations") else []
    buffers = [_data(folder, buffer["uri"]) if "uri" in buffer else blob for buffer in tree.get("buffers", [])]
    return Gltf(folder, tree, tuple(map(memoryview, buffers)), tuple(left))


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    """The JSON and the numbers of a .glb."""
    version, length, size, kind = struct.unpack_from("<III4s", data, 4)
    if version != 2:
        raise ModelError(f"is glTF {version}, not 2; export it again as glTF 2.0")
    if length > len(data) or 20 + size > length or kind != b"JSON":
        raise ModelError(f"has {len(data):,} of {length:,} bytes, or they are damaged; copy or export it again")
    rest = data[20 + size : length]
    return data[20 : 20 + size], rest[8 : 8 + struct.unpack_from("<I", rest)[0]] if len(rest) > 8 else b""


def _data(folder: Path, uri: str) -> bytes:
    """The bytes that an address holds itself, or a file beside the model."""
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2], validate=True)
    name = unquote(uri)
    file = folder / name
    if Path(name).is_absolute() or not file.is_file() or file.stat().st_size > MOST_BYTES:
        raise ModelError(f"needs '{name[:80]}', which is not beside it; put it there, or export one .glb")
    return file.read_bytes()


@dataclass(frozen=True, slots=True, eq=False)
class Gltf:
    """A file: its JSON and buffers; what of it is not read; materials and pictures that have been, and those reduced.

    has_srgb_vertices: whether colours by vertex are sRGB, as in PLY, not linear.
    """

    folder: Path
    tree: Json
    buffers: tuple[memoryview, ...]
    notes: tuple[str, ...]
    has_srgb_vertices: bool = False
    looks: dict[int | None, Look] = field(default_factory=dict)
    pictures: dict[tuple[int, int], Picture] = field(default_factory=dict)
    reduced: set[int] = field(default_factory=set)

    def entry(self, kind: str, index: Any) -> Json:
        """One of a numbered kind."""
        entries = self.tree.get(kind, [])
        if type(index) is not int or not 0 <= index < len(entries):
            raise ModelError(f"number {index} of {len(entries)} {kind} is asked for; export it again")
        return dict(entries[index])

    def places(self, T_model_file: Array) -> Iterator[Place]:
        """Every node of the scene, those above before those below."""
        nodes = self.tree.get("nodes", [])
        below = {child for node in nodes for child in node.get("children", [])}
        roots = [index for index in range(len(nodes)) if index not in below]
        if self.tree.get("scenes"):
            roots = self.entry("scenes", self.tree.get("scene", 0)).get("nodes", [])
        waiting = [(root, Place((), (), (T_model_file,))) for root in reversed(roots)]
        seen = set()
        while waiting:
            index, above = waiting.pop()
            node = self.entry("nodes", index)
            extras = node.get("extras")
            role = str(extras.get("vobench", "")) if isinstance(extras, dict) else ""
            names = (*above.names, str(node.get("name") or f"node_{index}"))
            here = Place(names, (*above.roles, role), (), index, node)
            with told(str(here)):
                if index in seen or len(here.names) > MOST_NESTED:
                    raise ModelError("hangs in the tree twice or too deep; export it again")
                seen.add(index)
                T = above.poses[-1] @ _local(node)
                yield from (replace(here, poses=(*above.poses, each)) for each in T @ self._instances(node))
                here = replace(here, poses=(*above.poses, T))
                waiting += [(child, here) for child in reversed(node.get("children", []))]

    def _instances(self, node: Json) -> Array:
        """Where a node's mesh stands in its frame (N, 4, 4)."""
        at = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes")
        if not at:
            return np.eye(4)[None]
        if max(map(self.rows, at.values())) > MOST_INSTANCES:
            raise ModelError(f"has more than {MOST_INSTANCES:,} instances; export fewer")
        return _placed({key: self.accessor(index) for key, index in at.items()})

    def rows(self, index: Any) -> int:
        """How many rows an accessor has."""
        count = self.entry("accessors", index)["count"]
        if type(count) is not int or count < 0:
            raise ModelError(f"accessor {index} has {count} rows; export it again")
        return count

    def accessor(self, index: Any, rows: int | None = None) -> NDArray[Any]:
        """Numbers (rows, width), as many as asked for; floats where they are normalised."""
        count = self.rows(index)
        accessor = self.entry("accessors", index)
        if count > 3 * MOST_FACES or rows not in (None, count):
            raise ModelError(f"accessor {index} has {count:,} rows, and should have {rows or 3 * MOST_FACES:,}")
        if "bufferView" not in accessor and "sparse" not in accessor:
            raise ModelError(f"accessor {index} has no data; where it is compressed, {DECOMPRESS}")
        kind = np.dtype(COMPONENTS[accessor["componentType"]])
        width = WIDTHS[accessor["type"]]
        values = np.zeros((count, width), kind)
        if "bufferView" in accessor:
            values = self._rows(accessor, count, kind, width)
        if sparse := accessor.get("sparse"):
            at = sparse["indices"]
            new = sparse["values"]
            where = self._rows(at, min(sparse["count"], count), np.dtype(COMPONENTS[at["componentType"]]), 1)
            values = values.copy()
            values[where[:, 0]] = self._rows(new, len(where), kind, width)
        if accessor.get("normalized") and kind.kind != "f":
            return np.asarray(np.maximum(values / np.iinfo(kind).max, -1.0))
        return values

    def _rows(self, at: Json, count: int, kind: np.dtype[Any], width: int) -> NDArray[Any]:
        """Numbers (count, width) from an offset of a buffer view on."""
        data = self._view(at["bufferView"])
        offset = at.get("byteOffset", 0)
        row = kind.itemsize * width
        stride = self.entry("bufferViews", at["bufferView"]).get("byteStride") or row
        end = offset + (count - 1) * stride + row
        if offset < 0 or stride < row or end > len(data):
            raise ModelError(f"byte {end:,} of {len(data):,} is asked for; copy or export it again")
        return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))

    def _view(self, index: Any) -> memoryview:
        view = self.entry("bufferViews", index)
        self.entry("buffers", view["buffer"])
        data = self.buffers[view["buffer"]]
        start = view.get("byteOffset", 0)
        end = start + view["byteLength"]
        if not 0 <= start <= end <= len(data):
            raise ModelError(f"byte {end:,} of {len(data):,} is asked for; copy or export it again")
        return data[start:end]

    def require_few(self, places: Sequence[Place]) -> None:
        """Refuse too many faces, or vertices for as many, before any is read."""
        faces = 0
        for place in places:
            for primitive in self.entry("meshes", place.source["mesh"])["primitives"] if "mesh" in place.source else ():
                vertices = self.rows(primitive["attributes"]["POSITION"])
                corners = self.rows(primitive["indices"]) if "indices" in primitive else vertices
                faces += max(corners // (3 if primitive.get("mode", TRIANGLES) == TRIANGLES else 1), vertices // 3)
        if faces > MOST_FACES:
            raise ModelError(f"has {faces:,} faces, more than {MOST_FACES:,}; gltf-transform simplify in.glb out.glb")

    def parts(self, place: Place, poses: Mapping[int, Array]) -> list[Part]:
        """The primitives of a node's mesh; poses: T_model_node of every node, for skins."""
        mesh = self.entry("meshes", place.source["mesh"]) if "mesh" in place.source else {"primitives": []}
        return [self._part(place, primitive, poses) for primitive in mesh["primitives"]]

    def _part(self, place: Place, primitive: Json, poses: Mapping[int, Array]) -> Part:
        at = primitive["attributes"]
        mode = primitive.get("mode", TRIANGLES)
        T = place.poses[-1]
        vertices = self.accessor(at["POSITION"]).astype(float)
        is_bare = primitive.get("material") is None and "COLOR_0" not in at
        count = len(vertices)
        look = BARE if is_bare else self.look(primitive.get("material"))
        index = self.accessor(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(count)
        faces = _faces(index.astype(np.int64), mode)
        if faces.size and not 0 <= faces.min() <= faces.max() < count:
            raise ModelError(f"a face asks for vertex {faces.max():,} of {count:,}; export it again")
        normals = self.accessor(at["NORMAL"], count).astype(float) if "NORMAL" in at else np.zeros((count, 3))
        uv = np.zeros((count, 2))
        if (key := f"TEXCOORD_{look.uv_set}") in at:
            uv = self.accessor(at[key], count) @ look.T_uv[:, :2].T + look.T_uv[:, 2]
        colours = np.clip(self.accessor(at["COLOR_0"], count)[:, :3], 0, 1) if "COLOR_0" in at else None
        colours = linear(colours).astype(float) if colours is not None and self.has_srgb_vertices else colours
        notes = ["points and lines left out"] if mode not in (TRIANGLES, STRIP, FAN) else []
        notes += ["morph targets left out"] if primitive.get("targets") else []
        if "skin" in place.source and "JOINTS_0" in at:
            blend = self._joints(place.source["skin"], at, poses, count)
            vertices = (blend[:, :3, :3] @ vertices[..., None])[..., 0] + blend[:, :3, 3]
            normals = unit((blend[:, :3, :3] @ normals[..., None])[..., 0])
            T = np.eye(4)
            notes.append("skin taken in the pose of the file")
        said = tuple(f"{place}: {note}" for note in notes)
        return Part(place, Mesh(vertices, faces.astype(np.int32), uv, normals), look, T, colours, said)

    def _joints(self, index: Any, at: Json, poses: Mapping[int, Array], count: int) -> Array:
        """T_model_vertex (V, 4, 4) of a skin's vertices, blended of the joints that move them."""
        skin = self.entry("skins", index)
        joints = np.stack([poses[joint] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            binds = self.accessor(skin["inverseBindMatrices"], len(joints))
            joints = joints @ binds.reshape(-1, 4, 4).swapaxes(1, 2)
        weights = self.accessor(at["WEIGHTS_0"], count).astype(float)
        which = self.accessor(at["JOINTS_0"], count)
        weights = weights / np.maximum(weights.sum(1, keepdims=True), 1e-9)
        return np.asarray(sum(weights[:, n, None, None] * joints[which[:, n]] for n in range(4)))

    def light(self, place: Place) -> list[ModelLight]:
        """The light of KHR_lights_punctual at a node; a spot falls linearly in the angle from one cone to the other."""
        at = place.source.get("extensions", {}).get("KHR_lights_punctual")
        if not at:
            return []
        source = self.tree["extensions"]["KHR_lights_punctual"]["lights"][at["light"]]
        T = place.poses[-1]
        name = place.names[-1]
        strength = max(float(numbers(source.get("intensity", 1.0))), 0.0)
        r, g, b = np.clip(numbers(source.get("color", WHITE), 3), 0, None).tolist()
        backwards = unit(T[:3, 2])
        if source["type"] == "point":
            return [PointLight(name, T[:3, 3], 4 * np.pi * strength, colour=(r, g, b))]
        if source["type"] == "directional":
            azimuth = np.arctan2(backwards[1], backwards[0])
            elevation = np.arcsin(np.clip(backwards[2], -1, 1))
            azimuth = float(np.rad2deg(azimuth))
            elevation = float(np.rad2deg(elevation))
            return [Sun(name, strength, (0.0,), (azimuth,), (elevation,), colour=(r, g, b))]
        if source["type"] != "spot":
            raise ModelError(f"has a light of type '{source['type']}', which glTF does not know")
        cone = source.get("spot", {})
        outer = float(np.clip(np.rad2deg(numbers(cone.get("outerConeAngle", np.pi / 4))), 0.1, 90))
        inner = float(np.clip(np.rad2deg(numbers(cone.get("innerConeAngle", 0.0))), 0, outer))
        spot = SpotLight(name, T[:3, 3], -backwards, 1.0, inner, outer, colour=(r, g, b))
        return [replace(spot, power_lm=strength / spot.peak_cd)]

    def look(self, index: int | None) -> Look:
        """A material; that of glTF's defaults for None."""
        if index not in self.looks:
            source = {} if index is None else self.entry("materials", index)
            name = "default" if index is None else str(source.get("name") or f"material_{index}")
            with told(f"material '{name}'"):
                self.looks[index] = self._look(name, source)
        return self.looks[index]

    def _look(self, name: str, source: Json) -> Look:
        """F0 by the index of refraction and GGX alpha = roughness², as glTF's appendix B has them."""
        surface = source.get("pbrMetallicRoughness", {})
        more = source.get("extensions", {})
        r, g, b, alpha = np.clip(numbers(surface.get("baseColorFactor", (1, 1, 1, 1)), 4), 0, 1).tolist()
        info = surface.get("baseColorTexture")
        glow = source.get("emissiveTexture")
        rough, metal = (float(numbers(surface.get(key, 1.0))) for key in ("roughnessFactor", "metallicFactor"))
        if means := self._picture(surface.get("metallicRoughnessTexture")):
            rough, metal = np.array([rough, metal]) * means.values[..., 1:].mean((0, 1)) / 255
        is_matt = rough**2 > MATT_ALPHA or "KHR_materials_unlit" in more
        strength = numbers(more.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0))
        red, green, blue = np.clip(numbers(source.get("emissiveFactor", (0, 0, 0)), 3) * strength, 0, None).tolist()
        material = Material(
            colour=(r, g, b),
            texture=self._picture(info, 3 if source.get("alphaMode", "OPAQUE") == "OPAQUE" else 4),
            eta=1.0 if is_matt else max(float(more.get("KHR_materials_ior", {}).get("ior", 1.5)), 1.0),
            roughness=0.0 if is_matt else float(rough**2),
            metal=0.0 if is_matt else float(metal),
            emission_cd_m2=(red, green, blue),
            emission_texture=self._picture(glow) if red + green + blue else None,
        )
        notes = [f"is {metal:.0%} metal and {rough:.0%} rough, the means of its texture"] if means else []
        if 0 < red + green + blue <= 3:
            notes += [f"gives {max(red, green, blue):.3g} cd/m², little in a lit room; set its emissiveStrength"]
        if info and glow and {**info, "index": 0} != {**glow, "index": 0}:
            notes += ["has its emission where its colour lies"]
        if more.get("KHR_materials_transmission", {}).get("transmissionFactor", 0) > CLEAR:
            material = Material("pane", eta=max(material.eta, 1.5), tint=float(np.dot((r, g, b), LUMINANCE)))
        material, seen = _opacity(material, source, alpha)
        said = tuple(f"material '{name}' {note}" for note in (*notes, *seen))
        return Look(name, material, bool(source.get("doubleSided")), *_uv_of(info or glow or {}), said)

    def _picture(self, texture: Json | None, channels: int = 3) -> Picture | None:
        """The pixels of a texture (H, W, 3), or 4 where it has opacity and it is asked for."""
        if not texture:
            return None
        source = self.entry("textures", texture["index"])
        extensions = source.get("extensions", {})
        if "source" not in source and "KHR_texture_basisu" in extensions:
            raise ModelError(EXTENSIONS["KHR_texture_basisu"])
        key = source.get("source", extensions.get("EXT_texture_webp", {}).get("source")), channels
        if key not in self.pictures:
            self.pictures[key] = Picture(np.ascontiguousarray(self._pixels(key[0])[..., :channels]))
        return self.pictures[key]

    def _pixels(self, index: Any) -> NDArray[np.uint8]:
        """An image (H, W, 3), or 4 where it is not opaque, no wider than there is room for."""
        image = self.entry("images", index)
        side = min(MOST_SIDE, 2 ** int(np.log2(MOST_TEXELS / len(self.tree["images"])) / 2))
        with told(f"picture '{str(image.get('name') or image.get('uri') or index)[:60]}'"):
            data = self._view(image["bufferView"]) if "bufferView" in image else _data(self.folder, image["uri"])
            try:
                with warnings.catch_warnings(action="ignore"):
                    opened = Image.open(BytesIO(data), formats=("PNG", "JPEG", "WEBP"))
                    if opened.width * opened.height > MOST_PIXELS:
                        raise ValueError(f"{opened.width} x {opened.height} pixels")
                    deep = opened.mode.startswith("I")  # 16 bits of grey
                    image8 = opened.point(lambda grey: grey * (1 / 257)).convert("L") if deep else opened
                    whole = image8.convert("RGBA" if opened.has_transparency_data else "RGB")
                    self.reduced.update([index] if max(whole.size) > side else [])
                    return np.asarray(whole.reduce(-(-max(whole.size) // side)))
            except Exception as error:  # decoders raise all kinds
                raise ModelError(
                    f"cannot be read ({error}); save it as PNG of {MOST_PIXELS:,} pixels at most"
                ) from None


def _local(node: Json) -> Array:
    """T_parent_node (4, 4)."""
    if "matrix" in node:
        return numbers(node["matrix"], 16).reshape(4, 4).T
    widths = {"translation": 3, "rotation": 4, "scale": 3}
    return numbers(_placed({key.upper(): numbers(node[key], n) for key, n in widths.items() if key in node}), 4, 4)


def _placed(parts: Mapping[str, Array]) -> Array:
    """Transforms (..., 4, 4) of translations (..., 3), quaternions (..., 4), scalar last, and scales (..., 3)."""
    rotation = np.asarray(parts.get("ROTATION", (0, 0, 0, 1)), float)
    R = se3.from_quaternion(rotation / np.linalg.norm(rotation, axis=-1, keepdims=True))
    scale = np.asarray(parts.get("SCALE", (1, 1, 1)), float)
    return se3.transform(R * scale[..., None, :], parts.get("TRANSLATION", (0, 0, 0)))


def _faces(index: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Triangles (F, 3) of a list, strip or fan of vertices. Source: glTF 2.0, section 3.7.2.1."""
    if mode == TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    n = np.arange(max(len(index) - 2, 0)) if mode in (STRIP, FAN) else np.zeros(0, int)
    turn = n % 2
    which = np.stack([n, n + 1 + turn, n + 2 - turn] if mode == STRIP else [n + 1, n + 2, 0 * n], 1)
    return np.asarray(index[which])


def _uv_of(texture: Json) -> tuple[int, Array]:
    """Which coordinates a texture takes, and T_uv (2, 3) of these by KHR_texture_transform."""
    change = texture.get("extensions", {}).get("KHR_texture_transform", {})
    turn = se3.rotation_z(-numbers(change.get("rotation", 0.0)))[:2, :2]
    T_uv = np.column_stack([turn * numbers(change.get("scale", (1, 1)), 2), numbers(change.get("offset", (0, 0)), 2)])
    return change.get("texCoord", texture.get("texCoord", 0)), T_uv


def _opacity(material: Material, source: Json, alpha: float) -> tuple[Material, list[str]]:
    """A material with the holes, or as the pane, that its opacity makes of it."""
    mode = source.get("alphaMode", "OPAQUE")
    texture = material.texture
    if mode == "OPAQUE" or material.kind == "pane":
        return material, []
    pixels = texture.pixels() if texture else np.zeros((1, 1, 3), np.uint8)
    share = pixels[..., 3] / np.float32(255) * alpha if pixels.shape[-1] == 4 else np.full((1, 1), alpha)
    cutoff = float(numbers(source.get("alphaCutoff", 0.5))) if mode == "MASK" else 0.5
    if share.max() < (cutoff if mode == "MASK" else NOTHING):
        return Material("pane"), ["is wholly clear: an open pane"]
    if share.min() < cutoff and (mode == "MASK" or ((share < 0.1) | (share > 0.9)).mean() > 0.8):
        seen = [] if mode == "MASK" else ["is blended: cut out where it is less than half opaque"]
        return replace(material, cutout=min(cutoff / alpha, 1.0)), seen
    if mode == "BLEND" and share.mean() < CLEAR:
        return Material("pane", eta=1.5, tint=float(1 - share.mean())), [f"is {share.mean():.0%} opaque: a pane"]
    return material, ["is blended: read as solid"] * (mode == "BLEND" and bool(share.min() < 1))
