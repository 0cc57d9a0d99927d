"""glTF 2.0 files, .glb and .gltf: nodes, faces, materials, pictures and lights. Source: Khronos, glTF 2.0.

trimesh 5.2 reads zeros where an accessor is sparse or compressed, and leaves out fans, normalised integers, second
texture coordinates, lights, strengths of emission and instances; hence this reader.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.asset.gltf_file import MOST_FACES, GltfFile, Json, located, numbers, read_gltf_file
from vobench.asset.gltf_material import BARE, Look, MaterialReader
from vobench.errors import ModelError
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit
from vobench.scene.light import PointLight, SpotLight, Sun
from vobench.scene.material import WHITE, linear
from vobench.scene.mesh import MeshArrays

ModelLight = PointLight | SpotLight | Sun
MOST_INSTANCES = 100_000
MOST_NESTED = 256
# Modes of a primitive; the others are points and lines.
TRIANGLES = 4
STRIP = 5
FAN = 6


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A node, with the names, roles by their extras and T_model_node (4, 4) of its ancestors and, last, its own.

    Every instance of EXT_mesh_gpu_instancing has one. index: its number; source: its JSON.
    """

    names: tuple[str, ...]
    roles: tuple[str, ...]
    poses: tuple[Array, ...]
    index: int = 0
    source: Json = field(default_factory=dict)

    def __str__(self) -> str:
        return f"node '{self.names[-1]}'"


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """Faces of one look at a node, T_model_mesh (4, 4) of their frame, and linear colours (V, 3) of their vertices.

    Normals are 0 where the file has none; `dropped` faces had no area.
    """

    node: Node
    mesh: MeshArrays
    look: Look
    T_model_mesh: Array
    colours: Array | None = None
    notes: tuple[str, ...] = ()
    dropped: int = 0


def read_gltf(
    data: bytes,
    folder: Path,
    *,
    has_srgb_vertices: bool = False,
) -> "Gltf":
    """A file that is in a folder. Raises ModelError where it is incomplete or requires an unknown extension."""
    file = read_gltf_file(data, folder)
    return Gltf(file, MaterialReader(file), has_srgb_vertices)


@dataclass(frozen=True, slots=True, eq=False)
class Gltf:
    """Nodes, primitives and lights of a file.

    has_srgb_vertices: whether colours by vertex are sRGB, as in PLY, not linear.
    """

    file: GltfFile
    materials: MaterialReader
    has_srgb_vertices: bool = False

    def nodes(self, T_model_file: Array) -> Iterator[Node]:
        """Every node of the scene, parents before children."""
        root = Node((), (), (T_model_file,))
        waiting = [(index, root) for index in reversed(self._roots())]
        visited: set[int] = set()
        while waiting:
            index, parent = waiting.pop()
            source = self.file.entry("nodes", index)
            node = _child(parent, index, source)
            with located(str(node)):
                if index in visited or len(node.names) > MOST_NESTED:
                    raise ModelError("is in the tree twice or too deep; export it again")
                visited.add(index)
                T_model_node = parent.poses[-1] @ _local(source)
                for T_model_instance in T_model_node @ self._instances(source):
                    yield replace(node, poses=(*parent.poses, T_model_instance))
                node = replace(node, poses=(*parent.poses, T_model_node))
                waiting += [(child, node) for child in reversed(source.get("children", []))]

    def _roots(self) -> Sequence[int]:
        """The nodes of the scene that is shown, else all that are no children."""
        tree = self.file.tree
        if tree.get("scenes"):
            scene = self.file.entry("scenes", tree.get("scene", 0))
            return list(scene.get("nodes", []))
        nodes = tree.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        return [index for index in range(len(nodes)) if index not in children]

    def _instances(self, source: Json) -> Array:
        """T_node_instance (N, 4, 4) of a node's mesh."""
        extension = source.get("extensions", {}).get("EXT_mesh_gpu_instancing", {})
        attributes = extension.get("attributes")
        if not attributes:
            return np.eye(4)[None]
        if max(map(self.file.rows, attributes.values())) > MOST_INSTANCES:
            raise ModelError(f"has more than {MOST_INSTANCES:,} instances; export fewer")
        return _transforms({name: self.file.accessor(index) for name, index in attributes.items()})

    def require_few(self, nodes: Sequence[Node]) -> None:
        """Refuse too many faces, or vertices for as many, before any is read."""
        faces = 0
        for node in nodes:
            for source in self._primitives(node):
                faces += self._most_faces(source)
        if faces > MOST_FACES:
            raise ModelError(f"has {faces:,} faces, more than {MOST_FACES:,}; gltf-transform simplify in.glb out.glb")

    def _most_faces(self, source: Json) -> int:
        """The most faces that a primitive may have, by the rows of its accessors."""
        vertices = self.file.rows(source["attributes"]["POSITION"])
        corners = self.file.rows(source["indices"]) if "indices" in source else vertices
        corners_per_face = 3 if source.get("mode", TRIANGLES) == TRIANGLES else 1
        return max(corners // corners_per_face, vertices // 3)

    def _primitives(self, node: Node) -> list[Json]:
        if "mesh" not in node.source:
            return []
        mesh = self.file.entry("meshes", node.source["mesh"])
        return list(mesh["primitives"])

    def primitives(self, node: Node, poses: Mapping[int, Array]) -> list[Primitive]:
        """The primitives of a node's mesh; poses: T_model_node of every node, for skins."""
        return [self._primitive(node, source, poses) for source in self._primitives(node)]

    def _primitive(
        self,
        node: Node,
        source: Json,
        poses: Mapping[int, Array],
    ) -> Primitive:
        attributes = source["attributes"]
        mode = source.get("mode", TRIANGLES)
        vertices = self.file.accessor(attributes["POSITION"]).astype(float)
        count = len(vertices)
        is_bare = source.get("material") is None and "COLOR_0" not in attributes
        look = BARE if is_bare else self.materials.look(source.get("material"))
        faces = self._faces(source, mode, count)
        normals = np.zeros((count, 3))
        if "NORMAL" in attributes:
            normals = self.file.accessor(attributes["NORMAL"], count).astype(float)

        notes = []
        if mode not in (TRIANGLES, STRIP, FAN):
            notes.append("points and lines left out")
        if source.get("targets"):
            notes.append("morph targets left out")

        T_model_mesh = node.poses[-1]
        if "skin" in node.source and "JOINTS_0" in attributes:
            blend = self._blend(node.source["skin"], attributes, poses, count)
            vertices = _applied(blend, vertices) + blend[:, :3, 3]
            normals = unit(_applied(blend, normals))
            T_model_mesh = np.eye(4)
            notes.append("skin read in the pose of the file")

        uv = self._uv(attributes, look, count)
        return Primitive(
            node,
            MeshArrays(vertices, faces, uv, normals),
            look,
            T_model_mesh,
            colours=self._colours(attributes, count),
            notes=tuple(f"{node}: {note}" for note in notes),
        )

    def _faces(
        self,
        source: Json,
        mode: int,
        count: int,
    ) -> NDArray[np.int64]:
        """Faces (F, 3) of a primitive with that many vertices."""
        index = np.arange(count)
        if "indices" in source:
            index = self.file.accessor(source["indices"])[:, 0].astype(np.int64)
        faces = _triangles(index, mode)
        if faces.size and not 0 <= faces.min() <= faces.max() < count:
            raise ModelError(f"a face has vertex {faces.max():,} of {count:,}; export it again")
        return faces

    def _uv(self, attributes: Json, look: Look, count: int) -> Array:
        """Texture coordinates (V, 2) as a look uses them, 0 where there are none."""
        name = f"TEXCOORD_{look.uv_set}"
        if name not in attributes:
            return np.zeros((count, 2))
        coordinates = self.file.accessor(attributes[name], count)
        return np.asarray(coordinates @ look.T_uv[:, :2].T + look.T_uv[:, 2])

    def _colours(self, attributes: Json, count: int) -> Array | None:
        """Linear colours (V, 3)."""
        if "COLOR_0" not in attributes:
            return None
        colours = np.clip(self.file.accessor(attributes["COLOR_0"], count)[:, :3], 0, 1)
        return linear(colours).astype(float) if self.has_srgb_vertices else colours

    def _blend(
        self,
        index: Any,
        attributes: Json,
        poses: Mapping[int, Array],
        count: int,
    ) -> Array:
        """T_model_vertex (V, 4, 4) of a skin's vertices, the weighted sums over the joints that move them."""
        skin = self.file.entry("skins", index)
        joints = np.stack([poses[joint] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            binds = self.file.accessor(skin["inverseBindMatrices"], len(joints))
            joints = joints @ binds.reshape(-1, 4, 4).swapaxes(1, 2)

        weights = self.file.accessor(attributes["WEIGHTS_0"], count).astype(float)
        joint = self.file.accessor(attributes["JOINTS_0"], count)
        weights = weights / np.maximum(weights.sum(1, keepdims=True), 1e-9)
        weighted = (weights[:, n, None, None] * joints[joint[:, n]] for n in range(4))
        return np.asarray(sum(weighted))

    def lights(self, node: Node) -> list[ModelLight]:
        """The light of KHR_lights_punctual at a node; a spot falls linearly in the angle from one cone to the other."""
        extension = node.source.get("extensions", {}).get("KHR_lights_punctual")
        if not extension:
            return []
        lights = self.file.tree["extensions"]["KHR_lights_punctual"]["lights"]
        return [_light(node, lights[extension["light"]])]


def _child(parent: Node, index: int, source: Json) -> Node:
    """A node below another, still without poses."""
    extras = source.get("extras")
    role = str(extras.get("vobench", "")) if isinstance(extras, dict) else ""
    name = str(source.get("name") or f"node_{index}")
    return Node((*parent.names, name), (*parent.roles, role), (), index, source)


def _light(node: Node, source: Json) -> ModelLight:
    """A light that shines along the -z axis of its node."""
    T = node.poses[-1]
    name = node.names[-1]
    position_m = T[:3, 3]
    backwards = unit(T[:3, 2])
    intensity = max(float(numbers(source.get("intensity", 1.0))), 0.0)
    red, green, blue = np.clip(numbers(source.get("color", WHITE), 3), 0, None).tolist()
    colour = (red, green, blue)

    if source["type"] == "point":
        return PointLight(name, position_m, 4 * np.pi * intensity, colour=colour)
    if source["type"] == "directional":
        azimuth = float(np.rad2deg(np.arctan2(backwards[1], backwards[0])))
        elevation = float(np.rad2deg(np.arcsin(np.clip(backwards[2], -1, 1))))
        return Sun(name, intensity, (0.0,), (azimuth,), (elevation,), colour=colour)
    if source["type"] != "spot":
        raise ModelError(f"has a light of type '{source['type']}', which glTF does not know")

    cone = source.get("spot", {})
    outer_deg = np.rad2deg(numbers(cone.get("outerConeAngle", np.pi / 4)))
    inner_deg = np.rad2deg(numbers(cone.get("innerConeAngle", 0.0)))
    outer = float(np.clip(outer_deg, 0.1, 90))
    inner = float(np.clip(inner_deg, 0, outer))
    of_one_lumen = SpotLight(name, position_m, -backwards, 1.0, inner, outer, colour=colour)
    return replace(of_one_lumen, power_lm=intensity / of_one_lumen.peak_cd)


def _applied(T: Array, vectors: Array) -> Array:
    """Vectors (N, 3), each transformed by the linear part of its own T (N, 4, 4)."""
    return np.asarray((T[:, :3, :3] @ vectors[..., None])[..., 0])


def _local(source: Json) -> Array:
    """T_parent_node (4, 4)."""
    if "matrix" in source:
        return numbers(source["matrix"], 16).reshape(4, 4).T
    widths = {"translation": 3, "rotation": 4, "scale": 3}
    parts = {key.upper(): numbers(source[key], width) for key, width in widths.items() if key in source}
    return numbers(_transforms(parts), 4, 4)


def _transforms(parts: Mapping[str, Array]) -> Array:
    """Transforms (..., 4, 4) of translations (..., 3), quaternions (..., 4), scalar last, and scales (..., 3)."""
    quaternion = np.asarray(parts.get("ROTATION", (0, 0, 0, 1)), float)
    R = se3.from_quaternion(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True))
    scale = np.asarray(parts.get("SCALE", (1, 1, 1)), float)
    return se3.transform(R * scale[..., None, :], parts.get("TRANSLATION", (0, 0, 0)))


def _triangles(
    index: NDArray[np.int64],
    mode: int,
) -> NDArray[np.int64]:
    """Triangles (F, 3) of a list, strip or fan of vertices, none of points and lines. Source: section 3.7.2.1."""
    if mode == TRIANGLES:
        return index[: len(index) // 3 * 3].reshape(-1, 3)
    if mode not in (STRIP, FAN):
        return index[:0].reshape(0, 3)
    n = np.arange(max(len(index) - 2, 0))
    if mode == FAN:
        return np.asarray(index[np.stack([n + 1, n + 2, 0 * n], 1)])
    is_odd = n % 2
    return np.asarray(index[np.stack([n, n + 1 + is_odd, n + 2 - is_odd], 1)])
