"""Parks by seed: lawns, hills and a pond, paths, trees, bushes, benches, lamps and people, in any daylight."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vobench.asset import meadow, picture
from vobench.asset.daylight import Daylight, lamp_colour, level_daylight
from vobench.asset.furniture import Part, coated, matt
from vobench.asset.park_furnishing import PIECE_SPACING_M, furnish_park
from vobench.asset.park_plan import STEP_M, ParkGround, ParkPlan, Path, park_plan
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import sheet_arrays
from vobench.asset.site import Site, Structure
from vobench.asset.street import asphalt
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import WATER_ETA, Material
from vobench.scene.mesh import as_mesh
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

# Each choice has a stream of random numbers of its own, so that a change of one leaves the others as they are.
PLAN_STREAM = 0
GROUND_STREAM = 1
DAYLIGHT_STREAM = 4
SUN_STREAM = 5

PANORAMAS = ("country", "suburb", "city")
PANORAMA_M = (60.0, 100.0)  # distance of what is behind the border
BODY_RADIUS_M = 0.4
STATION_M = 8.0  # between the places of the loop that a body has to reach

# Distances between samples of the light
PATH_SPACING_M = 0.16
NEAR_SPACING_M = 0.28
FAR_SPACING_M = 0.7
NEAR_M = 5.5  # from a path, within which samples of the lawn are dense

CELL_M = 0.5  # of the ground
LAWN_TINTS = ("#f4fae4", "#e4efd2", "#fff3cf", "#eef6e6", "#f6efc8")
LAWN_TINTS_PER_PARK = 3
GRAVEL_TINTS = ("#f2ece0", "#e6d6bc", "#d9d4cc", "#e8c9a4")
ASPHALT_TINTS = ("#ffffff", "#f0e4d8")
PAVING_TINTS = ("#f2eee6", "#d9c8b8", "#c9ccd0")
OVERLAP_M = 0.008  # height of a path above the next one, where they cross
WATER_TINTS = ("#1c241c", "#232a22", "#1a2426")
WATER_SHARE = 1.18  # extent of the mesh of the water relative to the shore, below the ground
WATER_SIDES = 48

LAMP_LM = 5200.0
LAMP_K = 3000
DARK_ABOVE = 0.8  # of the share of lamps that are on: evening and night


def generated_park(seed: int, lighting: str) -> Site:
    """The park of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    plan = park_plan(np.random.default_rng([seed, PLAN_STREAM]))
    ground_rng = np.random.default_rng([seed, GROUND_STREAM])
    ground = [*_paths(ground_rng, plan), *_lawn(ground_rng, plan), *_water(ground_rng, plan)]
    furnishing = furnish_park(plan, seed=seed)
    outside = level_daylight(
        np.random.default_rng([seed, DAYLIGHT_STREAM]),
        np.random.default_rng([seed, SUN_STREAM]),
        lighting,
        kinds=PANORAMAS,
        distance_m=PANORAMA_M,
    )
    loop = plan.loop
    stations = np.arange(0, len(loop.points_m) - 1, round(STATION_M / STEP_M))
    roads = [area for path in plan.paths for area in path.areas(plan.ground)]
    return Site(
        structures=(*ground, *furnishing.growth, *_unlit_globes(furnishing.bulbs, outside)),
        pieces=furnishing.pieces,
        lights=(*_lamps(furnishing.bulbs, outside), *outside.lights),
        ground=plan.ground,
        roads=tuple(roads),
        stations_m=loop.points_m[stations],
        body_radius_m=BODY_RADIUS_M,
    )


# --- The ground ---


def _paths(rng: Rng, plan: ParkPlan) -> Iterator[Structure]:
    """Strips with edges that sink into the ground. The loop is of another material than the rest in some parks."""
    loop_surface = _surface(rng)
    is_alike = rng.random() < 0.6
    other_surface = loop_surface if is_alike else _surface(rng)
    for number, path in enumerate(plan.paths):
        # Later paths lie a little lower, so that no two surfaces coincide where they cross.
        mesh = _strip(path, plan.ground, lower_m=OVERLAP_M * number)
        surface = loop_surface if number == 0 else other_surface
        yield Structure(f"path_{number}", (Part(mesh, surface),), PATH_SPACING_M)


def _surface(rng: Rng) -> Material:
    """The material of a path."""
    kind = one_of(rng, "gravel", "gravel", "gravel", "asphalt", "paving")
    if kind == "gravel":
        tint = one_of(rng, *GRAVEL_TINTS)
        return matt(tint, meadow.gravel(int(rng.integers(3))))
    if kind == "asphalt":
        tint = one_of(rng, *ASPHALT_TINTS)
        return matt(tint, asphalt(int(rng.integers(3)), tile_m=6.0))
    slabs = picture.masonry("paving", int(rng.integers(3)), 1024, 1.6, rows=8, columns=6)
    return matt(one_of(rng, *PAVING_TINTS), slabs)


def _strip(path: Path, ground: ParkGround, *, lower_m: float) -> MeshArrays:
    """The surface of a path: cambered, with edges below the ground beside it."""
    across = np.linspace(-0.5, 0.5, 9)  # share of the width
    offsets_m = across * path.widths_m[:, None]  # (N, 9)
    points_m = path.points_m[:, None] + offsets_m[..., None] * path.left[:, None]  # (N, 9, 2)
    camber_m = 0.035 - 0.12 * (2 * across) ** 6 - lower_m
    ground_m = ground.surface_m(points_m.reshape(-1, 2)).reshape(offsets_m.shape)
    height_m = ground_m + camber_m
    grid_m = np.concatenate([points_m, height_m[..., None]], axis=-1)
    right_to_left_m = grid_m[:, ::-1]
    return _with_level_uv(sheet_arrays(right_to_left_m))


def _lawn(rng: Rng, plan: ParkPlan) -> Iterator[Structure]:
    """The ground as grass in three tints, near the paths and far from them."""
    mesh = _ground_mesh(plan)
    middles_m = mesh.corners_m.mean(axis=1)[:, :2]  # (F, 2)
    kinds = _lawn_kinds(rng, middles_m)
    is_near = plan.path_tree().query(middles_m)[0] < NEAR_M
    grass = meadow.lawn(int(rng.integers(3)))
    tints = rng.permutation(LAWN_TINTS).tolist()[:LAWN_TINTS_PER_PARK]
    materials = [matt(tint, grass) for tint in tints]
    yield Structure("grass_near", _lawn_parts(mesh, kinds, is_near, materials), NEAR_SPACING_M)
    yield Structure("grass_far", _lawn_parts(mesh, kinds, ~is_near, materials), FAR_SPACING_M)


def _lawn_kinds(rng: Rng, places_m: Array) -> Array:
    """Which of three tints the grass has at places (N, 2): a sum of three waves, cut at two levels."""
    phases_rad = rng.uniform(0, 2 * np.pi, 3)
    lengths_m = rng.uniform([4, 4, 1.6], [8, 8, 3])
    x = places_m[:, 0]
    y = places_m[:, 1]
    wave_along_x = np.sin(x / lengths_m[0] + phases_rad[0])
    wave_along_y = np.sin(y / lengths_m[1] + phases_rad[1])
    oblique_wave = np.sin((x - y) / lengths_m[2] + phases_rad[2])
    return np.asarray(np.digitize(wave_along_x + wave_along_y + 0.8 * oblique_wave, [-0.9, 0.9]))


def _lawn_parts(mesh: MeshArrays, kinds: Array, is_selected: Array, materials: Sequence[Material]) -> tuple[Part, ...]:
    """The selected faces (F,) of the lawn, by their material."""
    parts = []
    for kind, material in enumerate(materials):
        is_of_kind = (kinds == kind) & is_selected
        if is_of_kind.any():
            parts.append(Part(_submesh(mesh, is_of_kind), material))
    return tuple(parts)


def _ground_mesh(plan: ParkPlan) -> MeshArrays:
    """The ground of a park as a grid."""
    half_x_m, half_y_m = plan.half_m
    along_x_m = np.arange(-half_x_m, half_x_m + CELL_M, CELL_M)
    along_y_m = np.arange(-half_y_m, half_y_m + CELL_M, CELL_M)
    points_m = np.stack(np.meshgrid(along_x_m, along_y_m), axis=-1)  # (rows, columns, 2)
    height_m = plan.ground.surface_m(points_m.reshape(-1, 2)).reshape(points_m.shape[:2])
    return _with_level_uv(sheet_arrays(np.concatenate([points_m, height_m[..., None]], axis=-1)))


def _submesh(mesh: MeshArrays, is_selected: Array) -> MeshArrays:
    """The mesh of the selected faces (F,) of another one."""
    vertices, faces = np.unique(mesh.faces[is_selected], return_inverse=True)
    return MeshArrays(mesh.vertices_m[vertices], faces.reshape(-1, 3), mesh.uv[vertices], mesh.normals[vertices])


def _with_level_uv(mesh: MeshArrays) -> MeshArrays:
    """A mesh with x and y as texture coordinates."""
    return replace(mesh, uv=mesh.vertices_m[:, :2])


def _water(rng: Rng, plan: ParkPlan) -> Iterator[Structure]:
    """Still water, whose edge is below the ground around it."""
    pond = plan.ground.pond
    if pond is None:
        return
    bearings_rad = np.linspace(0, 2 * np.pi, WATER_SIDES + 1)
    outward = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=-1)
    edge_m = pond.center_m + WATER_SHARE * pond.shore_m(bearings_rad)[:, None] * outward
    center_m = np.broadcast_to(pond.center_m, edge_m.shape)
    rows_m = np.stack([edge_m, center_m])  # (2, N, 2)
    height_m = np.full((*rows_m.shape[:2], 1), plan.ground.water_m)
    sheet = _with_level_uv(sheet_arrays(np.concatenate([rows_m, height_m], axis=-1)))
    upwards = np.tile([0.0, 0.0, 1.0], (len(sheet.vertices_m), 1))
    tint = one_of(rng, *WATER_TINTS)
    water = replace(coated(tint), eta=WATER_ETA, roughness=0.0)
    yield Structure("pond", (Part(replace(sheet, normals=upwards), water),), FAR_SPACING_M)


# --- Lights ---


def _is_dark(outside: Daylight) -> bool:
    return outside.lamp_share > DARK_ABOVE


def _lamps(bulbs: Sequence[MeshArrays], outside: Daylight) -> list[Light]:
    """The globes of the lamps as a light, if it is dark."""
    if not bulbs or not _is_dark(outside):
        return []
    mesh = as_mesh(joined_arrays(bulbs))
    return [AreaLight("lamps", mesh, LAMP_LM * len(bulbs), colour=lamp_colour(LAMP_K))]


def _unlit_globes(bulbs: Sequence[MeshArrays], outside: Daylight) -> list[Structure]:
    """The globes of the lamps as things, unless it is dark."""
    if not bulbs or _is_dark(outside):
        return []
    glass = coated("#e6e4dc", roughness=0.2)
    return [Structure("globes", (Part(joined_arrays(bulbs), glass),), PIECE_SPACING_M)]
