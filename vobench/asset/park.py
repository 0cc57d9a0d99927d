"""Parks by seed: lawns, hills and a pond, paths, trees, bushes, benches, lamps and people, in any daylight."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from vobench.asset import branching_tree, conifer, furniture, household, meadow, outdoors, picture
from vobench.asset.daylight import Daylight, lamp_colour, level_daylight
from vobench.asset.furniture import Part, coated, matt, put, stood, wood
from vobench.asset.park_plan import STEP_M, ParkGround, ParkPlan, Path, park_plan
from vobench.asset.picture import NAVY, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, lathe, sheet_arrays, tube_arrays
from vobench.asset.site import Footprint, Site, SitePiece, Structure, footprint
from vobench.asset.street import asphalt
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays, as_mesh
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

PANORAMAS = ("country", "suburb", "city")
PANORAMA_M = (60.0, 100.0)
BODY_RADIUS_M = 0.4
STATION_M = 8.0  # between the places of the loop that a body has to reach
CELL_M = 0.5  # of the ground
NEAR_M = 5.5  # from a path, within which samples of the light are dense
PATH_SPACING_M = 0.16  # between samples of the light
NEAR_SPACING_M = 0.28
FAR_SPACING_M = 0.7
TREE_SPACING_M = 0.9
BUSH_SPACING_M = 0.4
PIECE_SPACING_M = 0.16
LAMP_M = 3.3
LAMP_LM = 5200.0
CLOSE_M = 0.01  # that footprints may share
PASSAGE_M = 1.2  # of a path, which a person on it leaves free on one side
TREE_FACES = 135_000  # of all trees, at most
VARIETIES = 7  # of trees of a park, each of which stands there several times
LAWN_TINTS = ("#f4fae4", "#e4efd2", "#fff3cf", "#eef6e6", "#f6efc8")


def generated_park(seed: int, lighting: str) -> Site:
    """The park of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    # Each choice has a random generator of its own, so that a change of one leaves the others as they are.
    plan = park_plan(np.random.default_rng([seed, 0]))
    look = np.random.default_rng([seed, 1])
    structures = [*_paths(look, plan), *_lawn(look, plan), *_water(look, plan)]
    planting = _Planting(plan, seed)
    pieces = planting.pieces()
    structures += planting.growth(pieces)
    outside = level_daylight(
        np.random.default_rng([seed, 4]),
        np.random.default_rng([seed, 5]),
        lighting,
        kinds=PANORAMAS,
        distance_m=PANORAMA_M,
    )
    bulbs = [planting.bulbs[piece.name] for piece in pieces if piece.name in planting.bulbs]
    loop = plan.loop
    stations = np.arange(0, len(loop.points_m) - 1, round(STATION_M / STEP_M))
    return Site(
        structures=(*structures, *_globes(bulbs, outside)),
        pieces=tuple(pieces),
        lights=(*_lamps(bulbs, outside), *outside.lights),
        ground=plan.ground,
        roads=tuple(area for path in plan.paths for area in path.areas(plan.ground)),
        stations_m=loop.points_m[stations],
        body_radius_m=BODY_RADIUS_M,
    )


# --- The ground ---


def _paths(rng: Rng, plan: ParkPlan) -> Iterator[Structure]:
    """Strips with edges that sink into the ground. The loop is of another material than the rest in some parks."""
    main = _surface(rng)
    other = main if rng.random() < 0.6 else _surface(rng)
    for number, path in enumerate(plan.paths):
        # Later paths lie a little lower, so that no two surfaces coincide where they cross.
        mesh = _strip(path, plan.ground, lower_m=0.008 * number)
        yield Structure(f"path_{number}", (Part(mesh, other if number else main),), PATH_SPACING_M)


def _surface(rng: Rng) -> Material:
    """What a path is made of."""
    kind = one_of(rng, "gravel", "gravel", "gravel", "asphalt", "paving")
    if kind == "gravel":
        tint = one_of(rng, "#f2ece0", "#e6d6bc", "#d9d4cc", "#e8c9a4")
        return matt(tint, meadow.gravel(int(rng.integers(3))))
    if kind == "asphalt":
        return matt(one_of(rng, "#ffffff", "#f0e4d8"), asphalt(int(rng.integers(3)), tile_m=6.0))
    slabs = picture.masonry("paving", int(rng.integers(3)), 1024, 1.6, rows=8, columns=6)
    return matt(one_of(rng, "#f2eee6", "#d9c8b8", "#c9ccd0"), slabs)


def _strip(path: Path, ground: ParkGround, *, lower_m: float) -> MeshArrays:
    """The surface of a path: cambered, with edges below the ground beside it."""
    across = np.linspace(-0.5, 0.5, 9)
    offsets_m = across * path.widths_m[:, None]  # (N, 9)
    points_m = path.points_m[:, None] + offsets_m[..., None] * path.left[:, None]
    camber_m = 0.035 - 0.12 * (2 * across) ** 6 - lower_m
    flat_m = points_m.reshape(-1, 2)
    height_m = ground.surface_m(flat_m).reshape(offsets_m.shape) + camber_m
    grid_m = np.concatenate([points_m, height_m[..., None]], axis=-1)
    strip = sheet_arrays(grid_m[:, ::-1])
    return replace(strip, uv=strip.vertices_m[:, :2])


def _lawn(rng: Rng, plan: ParkPlan) -> Iterator[Structure]:
    """The ground as grass in three tints, near the paths and far from them."""
    x_m, y_m = plan.half_m
    grid_x, grid_y = np.meshgrid(np.arange(-x_m, x_m + CELL_M, CELL_M), np.arange(-y_m, y_m + CELL_M, CELL_M))
    mesh = _ground_mesh(plan.ground, grid_x, grid_y)
    middles_m = mesh.corners_m.mean(axis=1)[:, :2]
    phases_rad = rng.uniform(0, 2 * np.pi, 3)
    lengths_m = rng.uniform([4, 4, 1.6], [8, 8, 3])
    tint = (
        np.sin(middles_m[:, 0] / lengths_m[0] + phases_rad[0])
        + np.sin(middles_m[:, 1] / lengths_m[1] + phases_rad[1])
        + 0.8 * np.sin((middles_m[:, 0] - middles_m[:, 1]) / lengths_m[2] + phases_rad[2])
    )
    kind = np.digitize(tint, [-0.9, 0.9])
    is_near = plan.path_tree().query(middles_m)[0] < NEAR_M
    grass = meadow.lawn(int(rng.integers(3)))
    tints = rng.permutation(LAWN_TINTS).tolist()[:3]
    looks = [matt(colour, grass) for colour in tints]
    for name, mask, spacing_m in (("near", is_near, NEAR_SPACING_M), ("far", ~is_near, FAR_SPACING_M)):
        parts = [Part(_faces_of(mesh, (kind == index) & mask), looks[index]) for index in range(3)]
        yield Structure(f"grass_{name}", tuple(part for part in parts if len(part.arrays.faces)), spacing_m)


def _ground_mesh(ground: ParkGround, grid_x: Array, grid_y: Array) -> MeshArrays:
    """The ground over a grid of points, with x and y as texture coordinates."""
    points_m = np.stack([grid_x, grid_y], axis=-1)
    height_m = ground.surface_m(points_m.reshape(-1, 2)).reshape(grid_x.shape)
    mesh = sheet_arrays(np.concatenate([points_m, height_m[..., None]], axis=-1))
    return replace(mesh, uv=mesh.vertices_m[:, :2])


def _faces_of(mesh: MeshArrays, is_wanted: Array) -> MeshArrays:
    """A mesh of some of the faces of another one."""
    used, index = np.unique(mesh.faces[is_wanted], return_inverse=True)
    return MeshArrays(mesh.vertices_m[used], index.reshape(-1, 3), mesh.uv[used], mesh.normals[used])


def _water(rng: Rng, plan: ParkPlan) -> Iterator[Structure]:
    """Still water, whose edge is below the ground around it."""
    pond = plan.ground.pond
    if pond is None:
        return
    bearings_rad = np.linspace(0, 2 * np.pi, 49)
    outward = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=-1)
    shore_m = pond.center_m + 1.18 * pond.shore_m(bearings_rad)[:, None] * outward
    center_m = np.broadcast_to(pond.center_m, shore_m.shape)
    rows_m = np.stack([center_m, shore_m])
    height_m = np.full((*rows_m.shape[:2], 1), plan.ground.water_m)
    mesh = sheet_arrays(np.concatenate([rows_m, height_m], axis=-1)[::-1])
    mesh = replace(mesh, normals=np.tile([0.0, 0.0, 1.0], (len(mesh.vertices_m), 1)), uv=mesh.vertices_m[:, :2])
    tint = one_of(rng, "#1c241c", "#232a22", "#1a2426")
    look = replace(coated(tint), eta=1.33, roughness=0.0)
    yield Structure("pond", (Part(mesh, look),), FAR_SPACING_M)


# --- What grows and stands ---


class _Planting:
    """Places what stands in a park, from what people need along the paths to the trees at the border."""

    def __init__(self, plan: ParkPlan, seed: int) -> None:
        self.plan = plan
        self.seed = seed
        self.rng = np.random.default_rng([seed, 2])
        self.near = plan.path_tree()
        self.bulbs: dict[str, MeshArrays] = {}  # the globes of lamps by the name of their post
        self.counts: dict[str, int] = {}

    def pieces(self) -> list[SitePiece]:
        """Everything that stands, without what meets something earlier."""
        loop = self.plan.loop
        found = list(self._centre())
        found += self._people()
        found += self._along(loop, "lamp", float(self.rng.uniform(11, 17)), 0.55)
        found += self._along(loop, "bench", float(self.rng.uniform(13, 26)), -0.75)
        found += self._trees()
        found += self._bushes()
        found += self._rocks()
        return self._without_overlaps(found)

    def _without_overlaps(self, pieces: Sequence[SitePiece]) -> list[SitePiece]:
        """The pieces that meet no earlier one and do not stand in deep water."""
        kept: list[SitePiece] = []
        taken: list[Footprint] = []
        for piece in pieces:
            place = footprint(piece)
            is_dry = not np.isnan(self.plan.ground.heights_m(place.corners_m)).any()
            leaves_room = all(_leaves_room(piece, place, path) for path in self.plan.paths)
            if is_dry and leaves_room and all(place.overlap_depth_m(other, CLOSE_M) == 0 for other in taken):
                kept.append(piece)
                taken.append(place)
        return kept

    def _standing(
        self, kind: str, parts: Sequence[Part], x_m: float, y_m: float, *, yaw_deg: float, spacing_m: float
    ) -> SitePiece:
        """A piece that stands on the lowest ground below it, so that no side of it floats."""
        number = self.counts.get(kind, 0)
        self.counts[kind] = number + 1
        name = f"{kind}_{number}"
        upright = SitePiece(name, tuple(part.moved(at(x_m, y_m, yaw=yaw_deg)) for part in parts), spacing_m)
        place = footprint(upright)
        below_m = self.plan.ground.surface_m(np.vstack([place.corners_m, place.corners_m.mean(axis=0)]))
        lowest_m = float(below_m.min())
        z_m = lowest_m - 0.02
        sunk_m = float(below_m[-1]) - z_m - min(place.low_m, 0.0)
        moved = tuple(part.moved(at(z_m=z_m)) for part in upright.parts)
        return SitePiece(name, moved, spacing_m, sunk_m=sunk_m + 0.01)

    def _spots(self, count: int, *, clear_m: float, apart_m: float, reach: float = 0.94) -> list[tuple[float, float]]:
        """Places on dry ground, clear of the paths and apart from one another."""
        chosen: list[tuple[float, float]] = []
        pond = self.plan.ground.pond
        candidates_m = self.rng.uniform(-reach, reach, (40 * count, 2)) * self.plan.half_m
        to_path_m = self.near.query(candidates_m)[0]
        is_dry = np.ones(len(candidates_m), bool) if pond is None else pond.share(candidates_m) > 1.2
        for x_m, y_m in candidates_m[(to_path_m > clear_m) & is_dry].tolist():
            if all(np.hypot(x_m - other_x, y_m - other_y) > apart_m for other_x, other_y in chosen):
                chosen.append((x_m, y_m))
            if len(chosen) == count:
                break
        return chosen

    def _centre(self) -> Iterator[SitePiece]:
        """A board with a map beside the loop, and a monument or a pavilion on a lawn."""
        loop = self.plan.loop
        half_m = float(loop.widths_m.max()) / 2
        start = int(self.rng.integers(len(loop.points_m)))
        x_m, y_m = (loop.points_m[start] + (half_m + 0.5) * loop.left[start]).tolist()
        facing_deg = _bearing_deg(-loop.left[start])
        board = _map_board(int(self.rng.integers(40, 90)))
        yield self._standing("map", board, x_m, y_m, yaw_deg=facing_deg, spacing_m=PIECE_SPACING_M)
        kind = one_of(self.rng, "monument", "pavilion", "none")
        if kind == "none":
            return
        for x_m, y_m in self._spots(1, clear_m=4.5, apart_m=5.0, reach=0.7):
            parts = _monument(self.rng) if kind == "monument" else _pavilion(self.rng)
            yaw_deg = float(self.rng.uniform(0, 360))
            yield self._standing(kind, parts, x_m, y_m, yaw_deg=yaw_deg, spacing_m=PIECE_SPACING_M)

    def _people(self) -> Iterator[SitePiece]:
        """People at the edges of the paths, so that others get past, and on the lawns."""
        rng = self.rng
        for _ in range(int(rng.integers(2, 7))):
            path = self.plan.paths[int(rng.integers(len(self.plan.paths)))]
            index = int(rng.integers(4, len(path.points_m) - 4))
            side = float(rng.choice([-1.0, 1.0]))
            from_middle_m = path.widths_m[index] / 2 - float(rng.uniform(-0.4, 0.15))
            x_m, y_m = (path.points_m[index] + side * from_middle_m * path.left[index]).tolist()
            along_deg = _bearing_deg(path.directions[index])
            yaw_deg = along_deg + float(rng.choice([0.0, 180.0])) + float(rng.normal(0, 25))
            yield self._person(x_m, y_m, yaw_deg)
        for x_m, y_m in self._spots(int(rng.integers(0, 4)), clear_m=1.5, apart_m=2.0, reach=0.8):
            yield self._person(x_m, y_m, float(rng.uniform(0, 360)))

    def _person(self, x_m: float, y_m: float, yaw_deg: float) -> SitePiece:
        rng = np.random.default_rng([self.seed, 11, self.counts.get("person", 0)])
        parts = outdoors.person(rng, float(rng.uniform(1.55, 1.88)))
        return self._standing("person", parts, x_m, y_m, yaw_deg=yaw_deg, spacing_m=PIECE_SPACING_M)

    def _along(self, path: Path, kind: str, every_m: float, beside_m: float) -> Iterator[SitePiece]:
        """Lamps, or benches with bins, beside a path; a negative distance is on the right side."""
        side = float(np.sign(beside_m))
        step = max(1, round(every_m / STEP_M))
        for index in range(step // 2, len(path.points_m) - 8, step):
            left = path.left[index]
            out_m = side * (path.widths_m[index] / 2 + abs(beside_m))
            x_m, y_m = (path.points_m[index] + out_m * left).tolist()
            facing_deg = _bearing_deg(-side * left)
            if kind == "lamp":
                yield self._lamp(x_m, y_m, facing_deg)
                continue
            bench = outdoors.park_bench(self.rng, float(self.rng.choice([1.5, 1.8, 2.1])))
            yield self._standing("bench", bench, x_m, y_m, yaw_deg=facing_deg, spacing_m=PIECE_SPACING_M)
            if self.rng.random() < 0.6:
                bin_x_m, bin_y_m = (np.array([x_m, y_m]) + 1.6 * path.directions[index]).tolist()
                bin_parts = furniture.waste_bin(self.rng, width_m=0.42, height_m=0.75)
                yield self._standing("bin", bin_parts, bin_x_m, bin_y_m, yaw_deg=0.0, spacing_m=PIECE_SPACING_M)

    def _lamp(self, x_m: float, y_m: float, facing_deg: float) -> SitePiece:
        parts = outdoors.park_lamp(self.rng, LAMP_M)
        post = self._standing("lamp", parts, x_m, y_m, yaw_deg=facing_deg, spacing_m=PIECE_SPACING_M)
        foot_m = footprint(post).low_m
        self.bulbs[post.name] = as_arrays(household.bulb(x_m, y_m, foot_m + LAMP_M, 0.26))
        return post

    def _trees(self) -> Iterator[SitePiece]:
        """Trees on the lawns and, denser, along the border, of a few varieties that stand there in several sizes."""
        rng = self.rng
        varieties = [_tree(np.random.default_rng([self.seed, 12, number])) for number in range(VARIETIES)]
        in_park = self._spots(int(rng.integers(12, 30)), clear_m=2.7, apart_m=4.6, reach=0.84)
        faces = 0
        for x_m, y_m in [*in_park, *self._border(float(rng.uniform(4.4, 7.0)), 2.4)]:
            size = float(rng.uniform(0.85, 1.2))
            scaled = np.diag([size, size, size, 1.0])
            parts = [part.moved(scaled) for part in varieties[int(rng.integers(VARIETIES))]]
            faces += sum(len(part.arrays.faces) for part in parts)
            if faces > TREE_FACES:
                return
            yaw_deg = float(rng.uniform(0, 360))
            yield self._standing("tree", parts, x_m, y_m, yaw_deg=yaw_deg, spacing_m=TREE_SPACING_M)

    def _border(self, every_m: float, inside_m: float) -> list[tuple[float, float]]:
        """Places in rows inside of the border that are not on a path, in random order."""
        rng = self.rng
        x_m, y_m = self.plan.half_m
        found: list[Array] = []
        for side in (-1, 1):
            along_y = np.arange(-y_m + 2, y_m - 1, every_m)
            found.append(np.column_stack([np.full(len(along_y), side * (x_m - inside_m)), along_y]))
            along_x = np.arange(-x_m + 4, x_m - 3, every_m)
            found.append(np.column_stack([along_x, np.full(len(along_x), side * (y_m - inside_m))]))
        in_line_m = np.concatenate(found)
        places_m = rng.permutation(in_line_m + rng.normal(0, 0.3 * inside_m, in_line_m.shape))
        is_clear = self.near.query(places_m)[0] > 2.4
        return [(x, y) for x, y in places_m[is_clear].tolist()]

    def _bushes(self) -> Iterator[SitePiece]:
        rng = self.rng
        on_lawn = self._spots(int(rng.integers(14, 36)), clear_m=2.1, apart_m=2.2)
        for x_m, y_m in [*on_lawn, *self._border(float(rng.uniform(1.9, 3.5)), 1.3)]:
            height_m = float(rng.uniform(0.7, 1.7))
            width_m = float(rng.uniform(1.1, 2.2))
            parts = outdoors.bush(rng, height_m, width_m)
            yaw_deg = float(rng.uniform(0, 360))
            yield self._standing("bush", parts, x_m, y_m, yaw_deg=yaw_deg, spacing_m=BUSH_SPACING_M)

    def _rocks(self) -> Iterator[SitePiece]:
        """Boulders on the lawns, and more of them at the shore."""
        rng = self.rng
        places = self._spots(int(rng.integers(6, 26)), clear_m=1.9, apart_m=1.2)
        pond = self.plan.ground.pond
        if pond is not None:
            for bearing_rad in rng.uniform(0, 2 * np.pi, int(rng.integers(6, 22))):
                distance_m = pond.shore_m(np.array([bearing_rad])) * float(rng.uniform(1.0, 1.25))
                x_m, y_m = (pond.center_m + distance_m * [np.cos(bearing_rad), np.sin(bearing_rad)]).tolist()
                places.append((x_m, y_m))
        for x_m, y_m in places:
            parts = outdoors.rock(rng, size_m=float(0.25 + np.minimum(rng.exponential(0.22), 1.0)))
            yield self._standing("rock", parts, x_m, y_m, yaw_deg=0.0, spacing_m=PIECE_SPACING_M)

    def growth(self, pieces: Sequence[SitePiece]) -> Iterator[Structure]:
        """Tufts of long grass beside the paths and at the shore, and flowers in beds."""
        rng = np.random.default_rng([self.seed, 3])
        x_m, y_m = self.plan.half_m
        places_m = rng.uniform(-0.95, 0.95, (12000, 2)) * [x_m, y_m]
        to_middle_m, number = self.near.query(places_m)
        widths_m = np.concatenate([path.widths_m for path in self.plan.paths])
        to_edge_m = to_middle_m - widths_m[number] / 2
        chance = 0.03 + float(rng.uniform(0.2, 0.6)) * np.exp(-(((to_edge_m - 0.1) / 0.22) ** 2))
        pond = self.plan.ground.pond
        if pond is not None:
            share = pond.share(places_m)
            chance = np.where(share < 0.96, 0.0, np.where(share < 1.25, 0.75, chance))
        is_grass = (rng.random(len(places_m)) < chance) & (to_edge_m > 0.06)
        tint = one_of(rng, "#f4f6e0", "#fff0c4", "#e6f0d0")
        grass = meadow.cut_out(tint, meadow.blades(int(rng.integers(3))))
        yield Structure("tufts", (meadow.tufts(rng, self._on_ground(places_m[is_grass]), (0.1, 0.28), grass),), 0.5)
        yield from self._beds(rng, pieces)

    def _beds(self, rng: Rng, pieces: Sequence[SitePiece]) -> Iterator[Structure]:
        """Beds of flowers of one colour each."""
        standing = [footprint(piece).corners_m.mean(axis=0) for piece in pieces]
        for number, (x_m, y_m) in enumerate(self._spots(int(rng.integers(0, 5)), clear_m=2.6, apart_m=6.0, reach=0.8)):
            radius_m = float(rng.uniform(0.7, 1.4))
            away_m = min(float(np.hypot(x - x_m, y - y_m)) for x, y in standing)
            if away_m < radius_m + 1.2:
                continue
            count = int(70 * radius_m**2)
            distances_m = radius_m * np.sqrt(rng.random(count))
            bearings_rad = rng.uniform(0, 2 * np.pi, count)
            offsets_m = distances_m[:, None] * np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=1)
            look = meadow.cut_out("#ffffff", meadow.flowers(int(rng.integers(len(meadow.FLOWER_INKS)))))
            feet_m = self._on_ground(np.array([x_m, y_m]) + offsets_m)
            yield Structure(f"bed_{number}", (meadow.tufts(rng, feet_m, (0.18, 0.34), look),), 0.3)

    def _on_ground(self, places_m: Array) -> Array:
        """Places (N, 2) with the height of the ground, (N, 3)."""
        return np.column_stack([places_m, self.plan.ground.surface_m(places_m)])


def _leaves_room(piece: SitePiece, place: Footprint, path: Path) -> bool:
    """Whether a piece stands beside a path, or, if it is a person, leaves room to get past."""
    middle_m = place.corners_m.mean(axis=0)
    reach_m = float(np.linalg.norm(place.corners_m - middle_m, axis=1).max())
    distances_m = np.linalg.norm(path.points_m - middle_m, axis=1)
    nearest = int(distances_m.argmin())
    half_m = float(path.widths_m[nearest]) / 2
    if distances_m[nearest] > half_m + reach_m:
        return True
    if piece.name.startswith("person"):
        return bool(distances_m[nearest] + half_m - reach_m > PASSAGE_M)
    to_corners_m = np.linalg.norm(path.points_m[:, None] - place.corners_m, axis=2).min()
    return bool(to_corners_m > half_m + CLOSE_M)


def _bearing_deg(direction: Array) -> float:
    """The bearing of a direction (2,), counter-clockwise from x."""
    return float(np.rad2deg(np.arctan2(direction[1], direction[0])))


def _tree(rng: Rng) -> list[Part]:
    """A tree of some kind: broad, slender or a conifer."""
    kind = one_of(rng, "broad", "broad", "slender", "conifer")
    if kind == "conifer":
        return conifer.conifer(rng, float(rng.uniform(6.5, 10.5)), float(rng.uniform(0.17, 0.28)))
    if kind == "slender":
        return branching_tree.branching_tree(rng, float(rng.uniform(7.0, 9.5)), float(rng.uniform(0.2, 0.26)), 0.6)
    return branching_tree.branching_tree(rng, float(rng.uniform(5.4, 8.2)), float(rng.uniform(0.34, 0.46)))


def _map_board(seed: int) -> list[Part]:
    """A board with a map of the park; it faces x."""
    posts = [stood((0.09, 0.09, 1.9), wood("walnut"), 0, side * 0.62) for side in (-1, 1)]
    sheet = put(card_arrays((1.15, 0.8)), matt(texture=picture.poster("circles", seed, 1000, 700)), 0.021, 0, 1.35)
    back = stood((0.04, 1.2, 0.86), wood("walnut"), 0, 0, 0.92)
    roof = stood((0.3, 1.5, 0.05), wood("walnut"), 0.03, 0, 1.9)
    title = put(card_arrays((0.6, 0.3)), matt(texture=picture.sign("PARK", NAVY)), 0.0465, 0, 1.65)
    return [*posts, sheet, back, roof, title]


def _monument(rng: Rng) -> list[Part]:
    """Steps and a plinth with an obelisk, an urn or a sphere on it."""
    tint = one_of(rng, "#cfc8ba", "#a8a49a", "#c9b49a", "#8f938f")
    stone = matt(tint, picture.ground("concrete", int(rng.integers(4)), 1024, 1.4))
    width_m = float(rng.uniform(0.8, 1.3))
    height_m = float(rng.uniform(0.8, 1.5))
    foot_m = 0.5
    base = [
        stood((2.2 * width_m, 2.2 * width_m, foot_m), stone, z=-0.25, bevel=0.02),
        stood((1.5 * width_m, 1.5 * width_m, 0.2), stone, z=0.25, bevel=0.02),
        stood((width_m, width_m, height_m), stone, z=0.45, bevel=0.03, u=float(rng.uniform(0, 1))),
        stood((1.2 * width_m, 1.2 * width_m, 0.12), stone, z=0.45 + height_m, bevel=0.03),
    ]
    plate = put(
        card_arrays((0.6 * width_m, 0.3 * width_m)), matt(texture=picture.sign(f"{int(rng.integers(1780, 1960))}"))
    )
    base.append(plate.moved(at(width_m / 2 + 0.004, 0, 0.45 + 0.6 * height_m)))
    profiles = {
        "obelisk": np.array([[0, 0], [0.3, 0], [0.2, 2.0], [0, 2.3]]),
        "urn": np.array([[0, 0], [0.22, 0], [0.1, 0.12], [0.3, 0.4], [0.34, 0.62], [0.2, 0.74], [0.28, 0.8], [0, 0.8]]),
        "sphere": np.array([[0, 0.0], [0.2, 0.04], [0.37, 0.22], [0.42, 0.42], [0.37, 0.62], [0.2, 0.8], [0, 0.84]]),
    }
    kind = one_of(rng, *profiles)
    sections = 4 if kind == "obelisk" else 24
    top = lathe(profiles[kind] * (0.8 * width_m), sections=sections)
    return [*base, put(top, stone, z=0.57 + height_m, yaw=45)]


def _pavilion(rng: Rng) -> list[Part]:
    """A roof on six posts above a floor of boards, with a bench around."""
    radius_m = float(rng.uniform(1.6, 2.3))
    eaves_m = 2.45
    timber = wood(one_of(rng, "oak", "walnut"))
    paint = coated(one_of(rng, "#e4e2dc", "#5f7468", "#6d6472", "#46586a"), roughness=0.4)
    roof_look = matt(one_of(rng, "#8d4a36", "#4f5a58", "#5a5142"), picture.boards("walnut", 3, 512, 0.8))
    floor = lathe(np.array([[0, -0.3], [radius_m + 0.2, -0.3], [radius_m + 0.2, 0.12], [0, 0.12]]), sections=6)
    roof = lathe(
        np.array([[0, eaves_m], [radius_m + 0.5, eaves_m], [radius_m + 0.5, eaves_m + 0.08], [0, eaves_m + 1.3]]),
        sections=6,
    )
    posts = []
    for number in range(6):
        angle_rad = np.deg2rad(60 * number)
        x_m, y_m = (radius_m * np.array([np.cos(angle_rad), np.sin(angle_rad)])).tolist()
        posts.append(block_arrays((0.12, 0.12, eaves_m), bevel_m=0.01).moved(at(x_m, y_m, eaves_m / 2 + 0.1)))
    rails: list[MeshArrays] = []
    for number in range(1, 6):  # one side is the entrance
        bearings_rad = np.deg2rad([60 * number, 60 * (number + 1)])
        ends_m = radius_m * np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=1)
        rails += [tube_arrays(np.column_stack([ends_m, [z_m, z_m]]), 0.03, sections=6) for z_m in (0.5, 1.0)]
    return [
        put(floor, timber),
        put(roof, roof_look),
        Part(joined_arrays(posts), paint),
        Part(joined_arrays(rails), paint),
    ]


# --- Lights ---


def _is_dark(outside: Daylight) -> bool:
    return outside.lamp_share > 0.8


def _lamps(bulbs: Sequence[MeshArrays], outside: Daylight) -> list[Light]:
    """The globes of the lamps, if it is dark."""
    if not bulbs or not _is_dark(outside):
        return []
    mesh = as_mesh(joined_arrays(list(bulbs)))
    return [AreaLight("lamps", mesh, LAMP_LM * len(bulbs), colour=lamp_colour(3000))]


def _globes(bulbs: Sequence[MeshArrays], outside: Daylight) -> Iterator[Structure]:
    """The globes of the lamps while they are off."""
    if bulbs and not _is_dark(outside):
        yield Structure(
            "globes", (Part(joined_arrays(list(bulbs)), coated("#e6e4dc", roughness=0.2)),), PIECE_SPACING_M
        )
