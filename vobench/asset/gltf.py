"""Reads the nodes, faces, materials, textures and lights in glTF 2.0 files. Source: Khronos, glTF 2.0.

This reader exists because trimesh 5.2 reads sparse and compressed accessors as zeros, and ignores triangle fans,
normalised integers, second texture coordinates, lights, emission strengths and instances.
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
from vobench.scene.mesh_arrays import MeshArrays

ModelLight = PointLight | SpotLight | Sun
MOST_INSTANCES = 100_000
MOST_NESTED = 256
JOINTS_PER_VERTEX = 4
LEAST_WEIGHT = 1e-9  # the smallest total weight of the joints of a vertex
LEAST_CONE_DEG = 0.1
# Modes of a primitive; the other modes are points and lines.
TRIANGLES = 4
STRIP = 5
FAN = 6


@dataclass(frozen=True, slots=True, eq=False)
class Node:
    """A node of the scene, or one instance of a node with EXT_mesh_gpu_instancing.

    `names`, `roles` and `poses` are those of its ancestors, from the root on, followed by its own. A role is the value
    of `vobench` in the extras of a node. A pose is T_model_node (4, 4); `poses` begins with T_model_file.
    `index` is the index of the node in the file, and `source` is its JSON.
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
    """The faces of a node that have the same look.

    `mesh` has normals of 0 if the file has none.
    `T_model_mesh` (4, 4) is the pose of the mesh.
    `colours` (V, 3) are linear colours of the vertices.
    `dropped` is the number of faces without area that were removed.
    """

    node: Node
    mesh: MeshArrays
    look: Look
    T_model_mesh: Array
    colours: Array | None = None
    notes: tuple[str, ...] = ()
    dropped: int = 0


def read_gltf(data: bytes, folder: Path, *, has_srgb_vertices: bool = False) -> "Gltf":
    """A reader of the content of a file. Raises ModelError if it is incomplete or requires an unknown extension.

    `folder` is the folder that contains the file.
    """
    file = read_gltf_file(data, folder)
    return Gltf(file, MaterialReader(file), has_srgb_vertices)


@dataclass(frozen=True, slots=True, eq=False)
class Gltf:
    """Reads the nodes, primitives and lights of a file.

    `has_srgb_vertices` says that vertex colours are in sRGB, as in PLY files, instead of linear.
    """

    file: GltfFile
    materials: MaterialReader
    has_srgb_vertices: bool = False

    def nodes(self, T_model_file: Array) -> Iterator[Node]:
        """All nodes of the scene, parents before children."""
        root = Node((), (), (T_model_file,))
        stack = [(index, root) for index in reversed(self._roots())]
        visited: set[int] = set()
        while stack:
            index, parent = stack.pop()
            source = self.file.entry("nodes", index)
            node = _child(parent, index, source)
            with located(str(node)):
                is_too_deep = len(node.names) > MOST_NESTED
                if index in visited or is_too_deep:
                    raise ModelError("is in the tree twice or too deep; export it again")
                visited.add(index)

                T_model_node = parent.poses[-1] @ _local(source)
                for T_model_instance in T_model_node @ self._instances(source):
                    yield replace(node, poses=(*parent.poses, T_model_instance))

                node = replace(node, poses=(*parent.poses, T_model_node))
                children = source.get("children", [])
                stack += [(child, node) for child in reversed(children)]

    def _roots(self) -> Sequence[int]:
        """The root nodes of the default scene; without scenes, all nodes that are not children of others."""
        tree = self.file.tree
        if tree.get("scenes"):
            scene = self.file.entry("scenes", tree.get("scene", 0))
            return list(scene.get("nodes", []))
        nodes = tree.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        return [index for index in range(len(nodes)) if index not in children]

    def _instances(self, source: Json) -> Array:
        """The poses T_node_instance (N, 4, 4) of the instances of a node's mesh."""
        extension = source.get("extensions", {}).get("EXT_mesh_gpu_instancing", {})
        attributes = extension.get("attributes")
        if not attributes:
            return np.eye(4)[None]
        count = max(self.file.rows(index) for index in attributes.values())
        if count > MOST_INSTANCES:
            raise ModelError(f"has more than {MOST_INSTANCES:,} instances; export fewer")
        parts = {name: self.file.accessor(index) for name, index in attributes.items()}
        return _transforms(parts)

    def require_few_faces(self, nodes: Sequence[Node]) -> None:
        """Raise ModelError if the nodes have too many faces. The faces are counted before any of them is read."""
        faces = 0
        for node in nodes:
            for source in self._primitives(node):
                faces += self._most_faces(source)
        if faces > MOST_FACES:
            raise ModelError(f"has {faces:,} faces, more than {MOST_FACES:,}; gltf-transform simplify in.glb out.glb")

    def _most_faces(self, source: Json) -> int:
        """An upper limit of the number of faces of a primitive, from the number of rows of its accessors."""
        vertices = self.file.rows(source["attributes"]["POSITION"])
        corners = self.file.rows(source["indices"]) if "indices" in source else vertices
        corners_per_face = 3 if source.get("mode", TRIANGLES) == TRIANGLES else 1
        return max(corners // corners_per_face, vertices // 3)

    def _primitives(self, node: Node) -> list[Json]:
        """The JSON of the primitives of a node's mesh."""
        if "mesh" not in node.source:
            return []
        mesh = self.file.entry("meshes", node.source["mesh"])
        return list(mesh["primitives"])

    def primitives(self, node: Node, poses: Mapping[int, Array]) -> list[Primitive]:
        """The primitives of a node's mesh. `poses` has T_model_node of every node by its index, for skins."""
        return [self._primitive(node, source, poses) for source in self._primitives(node)]

    def _primitive(
        self,
        node: Node,
        source: Json,
        poses: Mapping[int, Array],
    ) -> Primitive:
        attributes = source["attributes"]
        mode = source.get("mode", TRIANGLES)
        notes = []
        if mode not in (TRIANGLES, STRIP, FAN):
            notes.append("points and lines left out")
        if source.get("targets"):
            notes.append("morph targets left out")

        vertices = self.file.accessor(attributes["POSITION"]).astype(float)
        count = len(vertices)
        look = self._look(source)
        faces = self._faces(source, mode, count)
        normals = np.zeros((count, 3))
        if "NORMAL" in attributes:
            normals = self.file.accessor(attributes["NORMAL"], count).astype(float)

        # The joints of a skin move its vertices to the frame of the model.
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

    def _look(self, source: Json) -> Look:
        """The look of a primitive; BARE if it has neither a material nor vertex colours."""
        material = source.get("material")
        is_bare = material is None and "COLOR_0" not in source["attributes"]
        return BARE if is_bare else self.materials.look(material)

    def _faces(self, source: Json, mode: int, count: int) -> NDArray[np.int64]:
        """Faces (F, 3) of a primitive with `count` vertices."""
        vertices = np.arange(count)
        if "indices" in source:
            vertices = self.file.accessor(source["indices"])[:, 0].astype(np.int64)
        faces = _triangles(vertices, mode)
        if faces.size and not 0 <= faces.min() <= faces.max() < count:
            raise ModelError(f"a face has vertex {faces.max():,} of {count:,}; export it again")
        return faces

    def _uv(self, attributes: Json, look: Look, count: int) -> Array:
        """Texture coordinates (V, 2) with the texture transform of the look; 0 if the file has none."""
        name = f"TEXCOORD_{look.uv_set}"
        if name not in attributes:
            return np.zeros((count, 2))
        coordinates = self.file.accessor(attributes[name], count)
        scale_and_rotation = look.T_uv[:, :2]
        offset = look.T_uv[:, 2]
        return np.asarray(coordinates @ scale_and_rotation.T + offset)

    def _colours(self, attributes: Json, count: int) -> Array | None:
        """Linear colours (V, 3) of the vertices, if the file has any."""
        if "COLOR_0" not in attributes:
            return None
        rgba = self.file.accessor(attributes["COLOR_0"], count)
        colours = np.clip(rgba[:, :3], 0, 1)
        if self.has_srgb_vertices:
            return np.asarray(linear(colours), float)
        return np.asarray(colours)

    def _blend(self, index: Any, attributes: Json, poses: Mapping[int, Array], count: int) -> Array:
        """The transforms T_model_vertex (V, 4, 4) of a skin's vertices, by linear blend skinning with four joints."""
        skin = self.file.entry("skins", index)
        T_joints = np.stack([poses[node] for node in skin["joints"]])
        if "inverseBindMatrices" in skin:
            columns = self.file.accessor(skin["inverseBindMatrices"], len(T_joints))
            T_joints = T_joints @ columns.reshape(-1, 4, 4).swapaxes(1, 2)

        weights = self.file.accessor(attributes["WEIGHTS_0"], count).astype(float)
        joints = self.file.accessor(attributes["JOINTS_0"], count)
        weights = weights / np.maximum(weights.sum(1, keepdims=True), LEAST_WEIGHT)
        weighted = []
        for n in range(JOINTS_PER_VERTEX):
            T_vertices = T_joints[joints[:, n]]
            weighted.append(weights[:, n, None, None] * T_vertices)
        return np.asarray(sum(weighted))

    def lights(self, node: Node) -> list[ModelLight]:
        """The light of a node by KHR_lights_punctual; empty if the node has none.

        The intensity of a spot light decreases linearly with the angle between its inner and outer cone.
        """
        extension = node.source.get("extensions", {}).get("KHR_lights_punctual")
        if not extension:
            return []
        lights = self.file.tree["extensions"]["KHR_lights_punctual"]["lights"]
        source = lights[extension["light"]]
        return [_light(node, source)]


def _child(parent: Node, index: int, source: Json) -> Node:
    """A child of a node. Its own pose is not yet set."""
    extras = source.get("extras")
    role = str(extras.get("vobench", "")) if isinstance(extras, dict) else ""
    name = str(source.get("name") or f"node_{index}")
    return Node((*parent.names, name), (*parent.roles, role), (), index, source)


def _light(node: Node, source: Json) -> ModelLight:
    """A light that shines along the -z axis of its node."""
    T_model_node = node.poses[-1]
    name = node.names[-1]
    position_m = T_model_node[:3, 3]
    backwards = unit(T_model_node[:3, 2])
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

    cones = source.get("spot", {})
    outer_rad = numbers(cones.get("outerConeAngle", np.pi / 4))
    inner_rad = numbers(cones.get("innerConeAngle", 0.0))
    outer_deg = float(np.clip(np.rad2deg(outer_rad), LEAST_CONE_DEG, 90))
    inner_deg = float(np.clip(np.rad2deg(inner_rad), 0, outer_deg))
    one_lumen = SpotLight(name, position_m, -backwards, 1.0, inner_deg, outer_deg, colour=colour)
    return replace(one_lumen, power_lm=intensity / one_lumen.peak_cd)


def _applied(T: Array, vectors: Array) -> Array:
    """The vectors (N, 3), each transformed by the linear part of the T (N, 4, 4) with the same index."""
    columns = T[:, :3, :3] @ vectors[..., None]
    return np.asarray(columns[..., 0])


def _local(source: Json) -> Array:
    """T_parent_node (4, 4) of a node, from its matrix or from its translation, rotation and scale."""
    if "matrix" in source:
        by_column = numbers(source["matrix"], 16).reshape(4, 4)
        return by_column.T

    widths = {"translation": 3, "rotation": 4, "scale": 3}
    parts = {key.upper(): numbers(source[key], width) for key, width in widths.items() if key in source}
    return numbers(_transforms(parts), 4, 4)


def _transforms(parts: Mapping[str, Array]) -> Array:
    """The transforms (..., 4, 4) with TRANSLATION (..., 3), ROTATION (..., 4), scalar last, and SCALE (..., 3)."""
    quaternion = np.asarray(parts.get("ROTATION", (0, 0, 0, 1)), float)
    norm = np.linalg.norm(quaternion, axis=-1, keepdims=True)
    R = se3.from_quaternion(quaternion / norm)
    scale = np.asarray(parts.get("SCALE", (1, 1, 1)), float)
    translation = parts.get("TRANSLATION", (0, 0, 0))
    return se3.transform(R * scale[..., None, :], translation)


def _triangles(vertices: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Triangles (F, 3) of a list, strip or fan of vertices; none for points and lines. Source: section 3.7.2.1."""
    if mode == TRIANGLES:
        complete = len(vertices) // 3 * 3
        return vertices[:complete].reshape(-1, 3)
    if mode not in (STRIP, FAN):
        return np.zeros((0, 3), np.int64)

    n = np.arange(max(len(vertices) - 2, 0))
    if mode == FAN:
        corners = np.stack([n + 1, n + 2, 0 * n], axis=1)
    else:
        # Every second triangle of a strip has the opposite orientation.
        is_odd = n % 2
        corners = np.stack([n, n + 1 + is_odd, n + 2 - is_odd], axis=1)
    return np.asarray(vertices[corners])
