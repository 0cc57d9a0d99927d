"""Ground that rain has wetted: a film of water on what lies open to the sky, and puddles on level ground.

Water is a coat with the refractive index 1.33. It mirrors by Fresnel's law, and the body below it looks darker because
part of the light that leaves it is reflected back at the surface of the water and absorbed (Ångström, 1925; Lekner and
Dorf, 1988). The geometry does not change: a puddle is a part of the faces of the ground.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.geometry.vector import cross_2d
from vobench.rendering.array_types import Mask, Rows
from vobench.rendering.geometry import FAR_M, RayCaster, offset_from_surface
from vobench.scene.material import WATER_ETA, Material
from vobench.scene.mesh import as_arrays, as_mesh
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays
from vobench.scene.rain import Rain
from vobench.scene.scene import Scene, triangles

FILM_ROUGHNESS = 0.25  # GGX alpha of a film that follows the grain of asphalt; an assumption
WET_COSINE = 0.8  # of the slope up to which the film stays
LEVEL_COSINE = np.cos(np.deg2rad(0.5))  # of the slope up to which puddles form
LEAST_LEVEL_M2 = 1.0  # the area of a face that can have puddles

# Radii of puddles: evenly distributed on a scale of logarithms. They are longer than wide, with a wavy outline.
LEAST_RADIUS_M = 0.15
LARGEST_RADIUS_M = 1.6
LONGEST = 2.5
WAVES = 5
WAVE_SHARE = 0.18  # of the radius, for the longest wave
SPACING_M = 0.12  # between points of an outline
FEWEST_POINTS = 24
EDGE_STEP_M = 0.02  # between points of an edge of the ground at which puddles are looked for
LEAST_FACE_M2 = 1e-8  # of a part of a face
SEED_STREAM = 1000  # of the places of puddles; those of drops are the numbers of their classes


@dataclass(frozen=True, slots=True)
class Puddles:
    """Outlines of N puddles: ellipses with middles (N, 2), radii (N, 2) and directions, whose radius varies by waves.

    `waves` (N, WAVES) are the amplitudes of the waves, in shares of the radius, and `phases_rad` (N, WAVES) their
    phases.
    """

    middles_m: Array
    radii_m: Array
    directions_rad: Array
    waves: Array
    phases_rad: Array

    def __len__(self) -> int:
        return len(self.middles_m)

    @property
    def reach_m(self) -> Array:
        """Distances (N,) from the middles beyond which no puddle extends."""
        return np.asarray(self.radii_m.max(axis=1, initial=0) * (1 + np.abs(self.waves).sum(axis=1)))

    def near(self, low_m: Array, high_m: Array) -> "Puddles":
        """The puddles that may extend into a rectangle with these corners (2,)."""
        reach_m = self.reach_m[:, None]
        is_near = ((self.middles_m + reach_m > low_m) & (self.middles_m - reach_m < high_m)).all(1)
        return Puddles(
            self.middles_m[is_near],
            self.radii_m[is_near],
            self.directions_rad[is_near],
            self.waves[is_near],
            self.phases_rad[is_near],
        )

    def cover(self, points_m: Array) -> Mask:
        """Whether each point (P, 2) is in a puddle."""
        is_covered = np.zeros(len(points_m), bool)
        reach_m = self.reach_m
        for index in range(len(self)):
            offsets_m = points_m - self.middles_m[index]
            near = np.flatnonzero((np.abs(offsets_m) < reach_m[index]).all(1))
            along, across = self._in_radii(index, offsets_m[near])
            distance = np.hypot(along, across)
            is_covered[near] |= distance < self._outline(index, np.arctan2(across, along))
        return is_covered

    def outline_m(self, index: int) -> Array:
        """Points (K, 2) on the outline of a puddle."""
        length_m = 2 * np.pi * float(self.radii_m[index].max())
        count = max(FEWEST_POINTS, int(np.ceil(length_m / SPACING_M)))
        angles_rad = 2 * np.pi * np.arange(count) / count
        distance = self._outline(index, angles_rad)
        along_m = self.radii_m[index, 0] * distance * np.cos(angles_rad)
        across_m = self.radii_m[index, 1] * distance * np.sin(angles_rad)
        cosine = np.cos(self.directions_rad[index])
        sine = np.sin(self.directions_rad[index])
        right_m = cosine * along_m - sine * across_m
        up_m = sine * along_m + cosine * across_m
        return np.asarray(self.middles_m[index] + np.stack([right_m, up_m], -1))

    def _in_radii(self, index: int, offsets_m: Array) -> Array:
        """Offsets (K, 2) from the middle of a puddle along its axes, in its radii: (2, K)."""
        cosine = np.cos(self.directions_rad[index])
        sine = np.sin(self.directions_rad[index])
        along_m = cosine * offsets_m[:, 0] + sine * offsets_m[:, 1]
        across_m = cosine * offsets_m[:, 1] - sine * offsets_m[:, 0]
        return np.stack([along_m / self.radii_m[index, 0], across_m / self.radii_m[index, 1]])

    def _outline(self, index: int, angles_rad: Array) -> Array:
        """The distance (K,) of the outline from the middle of a puddle in its radii, at angles (K,)."""
        orders = np.arange(2, 2 + WAVES)
        phases = np.outer(angles_rad, orders) + self.phases_rad[index]
        return np.asarray(1 + np.cos(phases) @ self.waves[index])


def wetted(scene: Scene) -> Scene:
    """A scene with its ground wet, if it has rain; otherwise the scene as it is.

    What lies under a roof stays dry, as do movers, and what has a coat, a mirror or holes in its texture.
    """
    rain = scene.rain
    if rain is None:
        return scene
    meshes = [as_arrays(thing.mesh) for thing in scene.things]
    takers = [index for index, thing in enumerate(scene.things) if _takes_water(scene.materials.get(thing.material))]
    is_open = _open_faces(scene, [meshes[index] for index in takers])
    is_level = [_is_level(meshes[index]) & is_open[nth] for nth, index in enumerate(takers)]
    level_m = [meshes[index].corners_m[is_level[nth]] for nth, index in enumerate(takers)]
    puddles = random_puddles(rain, np.concatenate([np.zeros((0, 3, 3)), *level_m]))

    materials = dict(scene.materials)
    things = []
    for index, thing in enumerate(scene.things):
        if index not in takers:
            things.append(thing)
            continue
        material = scene.materials[thing.material]
        nth = takers.index(index)
        for surface, part in _parts(meshes[index], is_open[nth], is_level[nth], puddles):
            name = thing.material if surface == DRY else f"{thing.material} ({surface})"
            materials.setdefault(name, _wet_material(material, surface))
            things.append(replace(thing, mesh=as_mesh(part), material=name))
    return replace(scene, things=tuple(things), materials=materials)


DRY = "dry"
FILM = "wet"
PUDDLE = "puddle"


def _takes_water(material: Material | None) -> bool:
    """Whether a film of water on a material can be drawn as its coat."""
    if material is None:
        return False
    is_bare = material.kind == "body" and not material.is_coated
    return is_bare and material.cutout is None and not any(material.emission_cd_m2)


def _wet_material(material: Material, surface: str) -> Material:
    """The material as it is, below a film, or below a puddle."""
    if surface == DRY:
        return material
    roughness = FILM_ROUGHNESS if surface == FILM else 0.0
    return replace(material, eta=WATER_ETA, roughness=roughness)


def random_puddles(rain: Rain, level_m: Array) -> Puddles:
    """Puddles on level faces (F, 3, 3), which cover a share of them on average.

    Puddles may overlap. They cover 1 - exp(-n) of the ground if their areas add up to n times its area (the Boolean
    model, Matheron 1975). The first puddles of a larger share are those of a smaller one.
    """
    rng = np.random.default_rng(np.random.SeedSequence(rain.seed, spawn_key=(SEED_STREAM,)))
    rows: list[tuple[Array, Array, float, Array, Array]] = []
    if len(level_m):
        low_m = level_m.min((0, 1))[:2] - LARGEST_RADIUS_M
        high_m = level_m.max((0, 1))[:2] + LARGEST_RADIUS_M
        wanted_m2 = -np.log1p(-rain.puddles) * float(np.prod(high_m - low_m))
        area_m2 = 0.0
        while area_m2 < wanted_m2:
            rows.append(_random_puddle(rng, low_m, high_m))
            area_m2 += np.pi * float(np.prod(rows[-1][1]))
    middles_m, radii_m, directions_rad, waves, phases_rad = zip(*rows, strict=True) if rows else ((),) * 5
    return Puddles(
        np.array(middles_m).reshape(-1, 2),
        np.array(radii_m).reshape(-1, 2),
        np.array(directions_rad),
        np.array(waves).reshape(-1, WAVES),
        np.array(phases_rad).reshape(-1, WAVES),
    )


def _random_puddle(rng: np.random.Generator, low_m: Array, high_m: Array) -> tuple[Array, Array, float, Array, Array]:
    """The middle (2,), radii (2,), direction, waves and phases of a puddle; see `Puddles`."""
    middle_m = rng.uniform(low_m, high_m)
    width_m = LEAST_RADIUS_M * (LARGEST_RADIUS_M / LEAST_RADIUS_M) ** rng.uniform()
    ratio = rng.uniform(1, LONGEST)
    radii_m = width_m * np.array([np.sqrt(ratio), 1 / np.sqrt(ratio)])
    direction_rad = rng.uniform(0, np.pi)
    waves = WAVE_SHARE * rng.uniform(-1, 1, WAVES) / np.arange(1, 1 + WAVES)
    phases_rad = rng.uniform(0, 2 * np.pi, WAVES)
    return middle_m, radii_m, direction_rad, waves, phases_rad


def _open_faces(scene: Scene, meshes: list[MeshArrays]) -> list[Mask]:
    """Whether each face of each mesh faces upwards with nothing above its middle."""
    if not meshes:
        return []
    corners_m = np.concatenate([mesh.corners_m for mesh in meshes])
    normals = face_normals(corners_m)
    is_upward = normals[:, 2] > WET_COSINE
    middles_m = offset_from_surface(corners_m[is_upward].mean(1), normals[is_upward])
    towards_sky = np.broadcast_to([0.0, 0.0, FAR_M], middles_m.shape)
    stationary = replace(scene, movers=())
    is_sheltered = RayCaster(triangles(stationary)).stops(middles_m, towards_sky)
    is_open = is_upward.copy()
    is_open[is_upward] = ~is_sheltered
    ends = np.cumsum([len(mesh.faces) for mesh in meshes])
    return np.split(is_open, ends[:-1])


def _is_level(mesh: MeshArrays) -> Mask:
    """Whether each face of a mesh is level, and large enough for puddles."""
    corners_m = mesh.corners_m
    is_level = face_normals(corners_m)[:, 2] > LEVEL_COSINE
    return np.asarray(is_level & (areas_m2(corners_m) > LEAST_LEVEL_M2))


def _parts(mesh: MeshArrays, is_open: Mask, is_level: Mask, puddles: Puddles) -> Iterator[tuple[str, MeshArrays]]:
    """The dry, the wet and the flooded part of a mesh, of those that it has."""
    films = [_with_faces(mesh, is_open & ~is_level)]
    flooded = []
    for face in np.flatnonzero(is_level).tolist():
        film, under_water = _divided(mesh, face, puddles)
        films.append(film)
        flooded.append(under_water)
    parts = {
        DRY: _with_faces(mesh, ~is_open),
        FILM: joined_arrays(films),
        PUDDLE: joined_arrays(flooded),
    }
    for surface, part in parts.items():
        if len(part.faces):
            yield surface, part


def _with_faces(mesh: MeshArrays, rows: Mask | Rows) -> MeshArrays:
    """Some faces of a mesh, with the vertices that they use."""
    used, faces = np.unique(mesh.faces[rows], return_inverse=True)
    return MeshArrays(mesh.vertices_m[used], faces.reshape(-1, 3), mesh.uv[used], mesh.normals[used])


def _divided(mesh: MeshArrays, face: int, puddles: Puddles) -> tuple[MeshArrays, MeshArrays]:
    """The parts of a level face outside and inside of puddles.

    Both are triangles of a Delaunay triangulation of the corners and of points on the outlines of puddles, so outlines
    are polygons. A triangle belongs to the part in which its middle is.
    """
    corners = mesh.faces[face]
    corners_m = mesh.vertices_m[corners, :2]
    puddles = puddles.near(corners_m.min(0), corners_m.max(0))
    points_m = np.concatenate([corners_m, _crossings(corners_m, puddles), _outlines_within(corners_m, puddles)])
    triangles = np.asarray(scipy.spatial.Delaunay(points_m).simplices)
    weights = _barycentric(corners_m, points_m)
    divided = MeshArrays(
        weights @ mesh.vertices_m[corners],
        _counter_clockwise(points_m, triangles),
        weights @ mesh.uv[corners],
        weights @ mesh.normals[corners],
    )
    divided = _with_faces(divided, areas_m2(divided.corners_m) > LEAST_FACE_M2)
    is_flooded = puddles.cover(divided.corners_m.mean(1)[:, :2])
    return _with_faces(divided, ~is_flooded), _with_faces(divided, is_flooded)


def _crossings(corners_m: Array, puddles: Puddles) -> Array:
    """The points (K, 2) at which outlines of puddles cross the edges of a triangle (3, 2).

    Two triangles with a common edge get the same points, because the edge is followed in the same direction.
    """
    crossings = [np.zeros((0, 2))]
    for start, end in ((0, 1), (1, 2), (2, 0)):
        first_m, last_m = sorted([tuple(corners_m[start]), tuple(corners_m[end])])
        count = int(np.ceil(np.hypot(last_m[0] - first_m[0], last_m[1] - first_m[1]) / EDGE_STEP_M)) + 1
        along_m = np.linspace(first_m, last_m, count)
        is_covered = puddles.cover(along_m)
        changes = np.flatnonzero(is_covered[1:] != is_covered[:-1])
        crossings.append((along_m[changes] + along_m[changes + 1]) / 2)
    return np.concatenate(crossings)


def _outlines_within(corners_m: Array, puddles: Puddles) -> Array:
    """The points (K, 2) on outlines of puddles that are inside a triangle (3, 2), and not at its border."""
    outlines_m = [puddles.outline_m(index) for index in range(len(puddles))]
    points_m = np.concatenate([np.zeros((0, 2)), *outlines_m])
    opposite_edges_m = np.roll(corners_m, -1, axis=0) - np.roll(corners_m, 1, axis=0)
    heights_m = np.abs(_double_area(corners_m)) / np.linalg.norm(opposite_edges_m, axis=1)
    distances_m = _barycentric(corners_m, points_m) * heights_m  # (K, 3), from the edge opposite of each corner
    return np.asarray(points_m[(distances_m > EDGE_STEP_M).all(1)])


def _barycentric(corners_m: Array, points_m: Array) -> Array:
    """The weights (K, 3) of the corners of a triangle (3, 2) at points (K, 2)."""
    a, b, c = corners_m
    whole = _double_area(corners_m)
    from_a_m = points_m - a
    second = cross_2d(from_a_m, np.broadcast_to(c - a, from_a_m.shape)) / whole
    third = cross_2d(np.broadcast_to(b - a, from_a_m.shape), from_a_m) / whole
    return np.stack([1 - second - third, second, third], -1)


def _double_area(corners_m: Array) -> float:
    """Twice the area of a triangle (3, 2), negative if its corners are clockwise."""
    a, b, c = corners_m
    return float(cross_2d(b - a, c - a))


def _counter_clockwise(points_m: Array, faces: NDArray[Any]) -> NDArray[np.int64]:
    """Triangles (F, 3) of points (P, 2), the corners of each in counter-clockwise order."""
    a, b, c = points_m[faces].swapaxes(0, 1)
    is_clockwise = cross_2d(b - a, c - a) < 0
    turned = np.where(is_clockwise[:, None], faces[:, ::-1], faces)
    return turned.astype(np.int64)
