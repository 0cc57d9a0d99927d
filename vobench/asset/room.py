"""Builds interiors: walls with windows, their finishes, and pieces of furniture."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal
from zlib import crc32

import numpy as np

from vobench.asset import fitting, furniture, household, outdoors, picture
from vobench.asset.furniture import Part, matt
from vobench.asset.picture import LazyTexture
from vobench.asset.shape import at
from vobench.asset.wall import Hole, pierced, planked, reveal
from vobench.geometry.se3 import Array
from vobench.scene.material import Material
from vobench.scene.mesh import as_mesh
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays
from vobench.scene.triangles import Thing
from vobench.setting import Triple

if TYPE_CHECKING:
    from trimesh import Trimesh

Instance = tuple[str, Sequence[Part]]
Wall = Literal["east", "north", "west", "south"]
OUTWARD: dict[Wall, tuple[float, float]] = {"east": (1, 0), "north": (0, 1), "west": (-1, 0), "south": (0, -1)}

# The modules with functions that make furniture, and the names of the functions.
_MODULES: dict[ModuleType, str] = {
    furniture: """
        desk chair shelf book_stack papers monitor keyboard mouse mug pens desk_lamp cables plant carton
        crate sofa waste_bin cabinet bench pillar
    """,
    fitting: """
        door window_frame blind curtain radiator socket skirting framed noticeboard glass_wall pipe
        lamp_housing spot_housing
    """,
    household: "dining_chair floor_lamp fruit_bowl low_board pendant rug table television",
    outdoors: "bollard bush car park_bench park_lamp person rock street_lamp tree",
}
KINDS: dict[str, Callable[..., list[Part]]] = {}
for _module, _names in _MODULES.items():
    for _name in _names.split():
        KINDS[_name] = getattr(_module, _name)

# The materials that a scene can refer to by name.
FINISHES: dict[str, Callable[[], Material]] = {
    "terrazzo": lambda: Material(texture=picture.terrazzo(), eta=1.5),
    "oak_floor": lambda: matt(texture=picture.boards("oak", 1, 2048, 2.0, rows=14, joint_m=0.002)),
    "carpet": lambda: matt(texture=picture.ground("carpet")),
    "white_plaster": lambda: matt("#f0ece3", picture.ground("plaster", 0, 1280, 1.6)),
    "sage_plaster": lambda: matt("#b9c4bb", picture.ground("plaster", 0, 1280, 1.6)),
    "concrete": lambda: matt(texture=picture.ground("concrete")),
    "brick": lambda: matt(texture=picture.masonry("brick")),
    "paving": lambda: matt(texture=picture.masonry("paving", rows=4, columns=4)),
    "ceiling_tiles": lambda: matt(texture=picture.masonry("tile", tile_m=1.2, rows=2, columns=2, bond=0.0)),
    "paint": lambda: furniture.WHITE,
    "pane": lambda: fitting.PANE,
    "mirror": lambda: fitting.MIRROR,
}


def piece_rng(name: str, seed: int = 0) -> np.random.Generator:
    """The random generator of the piece with a name, in a scene with a seed."""
    name_hash = crc32(name.encode())
    return np.random.default_rng(np.random.SeedSequence([seed, name_hash]))


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of furniture of one of KINDS. Its random choices depend only on its name and the seed of the scene."""

    kind: str
    name: str
    at_m: tuple[float, float, float]
    yaw_deg: float = 0.0
    pitch_deg: float = 0.0
    size: Mapping[str, Any] = field(default_factory=dict)

    def rng(self, seed: int = 0) -> np.random.Generator:
        """The random generator of the piece."""
        return piece_rng(self.name, seed)

    def build(self, seed: int = 0) -> Instance:
        """The name of the piece, and its parts in the frame of the scene."""
        make = KINDS[self.kind]
        T_world_piece = at(*self.at_m, yaw=self.yaw_deg, pitch=self.pitch_deg)
        parts = make(self.rng(seed), **self.size)
        return self.name, [part.moved(T_world_piece) for part in parts]


def things(
    instances: Iterable[Instance],
    known: Mapping[str, Material] = {},
) -> tuple[tuple[Thing, ...], dict[str, Material]]:
    """The things of all instances, one per material of an instance, and the materials by name.

    A material without a name in `known` is named after the first instance that has it.
    """
    names = {material: name for name, material in known.items()}
    result = []
    for name, parts in instances:
        for k, (material, meshes) in enumerate(_by_material(parts).items()):
            material_name = names.setdefault(material, f"{name}.{k}")
            result.append(Thing(name, as_mesh(joined_arrays(meshes)), material_name))
    return tuple(result), {name: material for material, name in names.items()}


def _by_material(parts: Sequence[Part]) -> dict[Material, list[MeshArrays]]:
    meshes: dict[Material, list[MeshArrays]] = {}
    for part in parts:
        meshes.setdefault(part.material, []).append(part.arrays)
    return meshes


@dataclass(frozen=True, slots=True)
class Opening:
    """A window.

    `center_m` is its position along the wall (world x or y) and above the floor. `depth_m` is the distance of its pane
    from the face of the wall.
    """

    wall: Wall
    center_m: tuple[float, float]
    size_m: tuple[float, float]
    depth_m: float = 0.15


def shell(
    size_m: tuple[float, float, float],
    openings: Sequence[Opening] = (),
    *,
    floor: Material,
    ceiling: Material,
    walls: Mapping[Wall, Material],
    frame: Material = furniture.WHITE,
    pane: Material = fitting.PANE,
) -> Iterator[Instance]:
    """The floor, ceiling, walls and windows of a room whose floor is centred at the origin.

    The instances are called `floor`, `ceiling`, `wall_east` and so on, and `window_0` and so on. A window consists of
    its reveals and its pane.
    """
    x, y, z = size_m
    floor_mesh = _floor((-x / 2, -y / 2, 0), (x, 0, 0), (0, y, 0), floor)
    ceiling_mesh = pierced((-x / 2, -y / 2, z), (0, y, 0), (x, 0, 0))
    yield "floor", [Part(floor_mesh, floor)]
    yield "ceiling", [Part(ceiling_mesh, ceiling)]

    for name, (outward_x, outward_y) in OUTWARD.items():
        outward = np.array([outward_x, outward_y, 0.0])
        right = np.array([outward_y, -outward_x, 0.0])
        corner = (outward - right) * [x / 2, y / 2, 0]
        edge = right * [x, y, 0]
        up = (0.0, 0.0, z)
        holes = {k: _hole(opening, edge) for k, opening in enumerate(openings) if opening.wall == name}
        wall_mesh = pierced(corner, edge, up, list(holes.values()))
        yield f"wall_{name}", [Part(wall_mesh, walls[name])]

        for k, hole in holes.items():
            u0, u1, v0, v1 = hole
            depth = openings[k].depth_m
            pane_corner = corner + right * u0 + [0, 0, v0] + outward * depth
            pane_edge = right * (u1 - u0)
            pane_mesh = quad_arrays(pane_corner, pane_edge, (0, 0, v1 - v0))
            reveal_mesh = reveal(corner, edge, up, hole, depth)
            yield f"window_{k}", [Part(reveal_mesh, frame), Part(pane_mesh, pane)]


def _floor(corner: Triple, edge_u: Triple, edge_v: Triple, material: Material) -> "Trimesh":
    """A rectangle, in planks where the texture has some."""
    texture = material.texture
    if isinstance(texture, LazyTexture) and texture.planks:
        return planked(corner, edge_u, edge_v, texture.planks, texture.tile_m)
    return pierced(corner, edge_u, edge_v)


def _hole(opening: Opening, edge_m: Array) -> Hole:
    """The hole of an opening in a wall whose lower edge is the vector edge_m, centred at x = 0 or y = 0."""
    along, up = opening.center_m
    width, height = opening.size_m
    half_length = np.abs(edge_m).sum() / 2
    u = float(half_length + along * np.sign(edge_m.sum()))
    return u - width / 2, u + width / 2, up - height / 2, up + height / 2
