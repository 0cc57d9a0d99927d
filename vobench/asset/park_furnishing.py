"""The furnishing of parks: what people need along the paths, trees, bushes, rocks, tufts of grass and flowers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.asset import branching_tree, conifer, furniture, household, meadow, outdoors
from vobench.asset.furniture import Part
from vobench.asset.park_furniture import map_board, monument, pavilion
from vobench.asset.park_plan import STEP_M, ParkPlan, Path
from vobench.asset.picture import Rng, one_of
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.shape import at
from vobench.asset.site import Footprint, SitePiece, Structure, footprint
from vobench.geometry.se3 import Array
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays

# Streams of random numbers
PIECE_STREAM = 2
GROWTH_STREAM = 3
PERSON_STREAM = 11  # followed by the number of the person
TREE_STREAM = 12  # followed by the number of the variety

# Distances between samples of the light
PIECE_SPACING_M = 0.16
BUSH_SPACING_M = 0.4
TREE_SPACING_M = 0.9
TUFT_SPACING_M = 0.5
BED_SPACING_M = 0.3

CLOSE_M = 0.01  # that footprints may share
PASSAGE_M = 0.45  # on both sides of the middle of a path, which a person on it leaves free
SUNK_M = 0.02  # of a piece below the lowest ground under it
DRY_SHARE = 1.2  # distance from the middle of the pond relative to the shore, beyond which the ground is dry

LAMP_M = 3.3
BULB_M = 0.26  # diameter
LAMP_TO_PATH_M = 0.55  # from the edge of the path
BENCH_TO_PATH_M = 0.75
BENCH_WIDTHS_M = (1.5, 1.8, 2.1)
BIN_TO_BENCH_M = 1.6
BIN_SHARE = 0.6  # of benches
PERSON_M = (1.55, 1.88)  # height
TREE_FACES = 135_000  # of all trees, at most
VARIETIES = 7  # of trees of a park, each of which stands there several times
TREE_TO_PATH_M = 2.4  # for trees along the border

TUFT_PLACES = 12_000  # at which a tuft may grow
TUFT_TINTS = ("#f4f6e0", "#fff0c4", "#e6f0d0")
TUFT_M = (0.1, 0.28)  # height
FLOWER_M = (0.18, 0.34)  # height
FLOWERS_PER_M2 = 70  # of the square of the radius of a bed

Place = tuple[float, float]  # x and y in metres


@dataclass(frozen=True, slots=True)
class ParkFurnishing:
    """What stands and grows in a park.

    `growth` are tufts of grass and beds of flowers.
    `bulbs` are the globes of the lamps among the pieces.
    """

    pieces: tuple[SitePiece, ...]
    growth: tuple[Structure, ...]
    bulbs: tuple[MeshArrays, ...]


def furnish_park(plan: ParkPlan, *, seed: int) -> ParkFurnishing:
    """Place what stands in a park, so that nothing overlaps, and let grass and flowers grow."""
    furnisher = _Furnisher(plan, seed)
    pieces = _without_overlaps(furnisher.candidates(), plan)
    growth = tuple(furnisher.growth(pieces))
    bulbs = [furnisher.bulbs[piece.name] for piece in pieces if piece.name in furnisher.bulbs]
    return ParkFurnishing(tuple(pieces), growth, tuple(bulbs))


def _without_overlaps(candidates: Sequence[SitePiece], plan: ParkPlan) -> list[SitePiece]:
    """The pieces that overlap no earlier one, do not stand in deep water, and leave the paths free."""
    selected: list[SitePiece] = []
    occupied: list[Footprint] = []
    for piece in candidates:
        ground = footprint(piece)
        is_in_deep_water = np.isnan(plan.ground.heights_m(ground.corners_m)).any()
        if is_in_deep_water or not all(_leaves_room(piece, ground, path) for path in plan.paths):
            continue
        if all(ground.overlap_depth_m(other, CLOSE_M) == 0 for other in occupied):
            selected.append(piece)
            occupied.append(ground)
    return selected


def _leaves_room(piece: SitePiece, ground: Footprint, path: Path) -> bool:
    """Whether a piece stands beside a path, or, if it is a person, leaves its middle free."""
    middle_m = ground.corners_m.mean(axis=0)
    reach_m = float(np.linalg.norm(ground.corners_m - middle_m, axis=1).max())
    distances_m = np.linalg.norm(path.points_m - middle_m, axis=1)
    nearest = int(distances_m.argmin())
    half_width_m = float(path.widths_m[nearest]) / 2
    is_beside = distances_m[nearest] > half_width_m + reach_m
    if is_beside:
        return True
    if piece.name.startswith("person"):
        return bool(distances_m[nearest] - reach_m > PASSAGE_M)
    # The circle around the piece meets the path, but its corners may not.
    nearest_corner_m = np.linalg.norm(path.points_m[:, None] - ground.corners_m, axis=2).min()
    return bool(nearest_corner_m > half_width_m + CLOSE_M)


class _Furnisher:
    """Creates pieces, from what people need along the paths to the trees at the border. They may overlap."""

    def __init__(self, plan: ParkPlan, seed: int) -> None:
        self.plan = plan
        self.seed = seed
        self.rng = np.random.default_rng([seed, PIECE_STREAM])
        self.path_points = plan.path_tree()
        self.bulbs: dict[str, MeshArrays] = {}  # the globes of lamps by the name of their post
        self.counts: dict[str, int] = {}  # of pieces, by kind

    def candidates(self) -> list[SitePiece]:
        """The pieces, in the order in which they claim their places."""
        pieces = [self._map()]
        pieces += self._landmark()
        pieces += self._people()
        pieces += self._lamps()
        pieces += self._benches()
        pieces += self._trees()
        pieces += self._bushes()
        pieces += self._rocks()
        return pieces

    def _standing(
        self,
        kind: str,
        parts: Sequence[Part],
        place: PlanFrame,
        *,
        spacing_m: float = PIECE_SPACING_M,
    ) -> SitePiece:
        """The next piece of a kind. It stands on the lowest ground below it, so that no side of it floats."""
        number = self.counts.get(kind, 0)
        self.counts[kind] = number + 1
        name = f"{kind}_{number}"
        T_world_piece = at(place.x_m, place.y_m, yaw=place.heading_deg)
        level_parts = tuple(part.moved(T_world_piece) for part in parts)
        ground = footprint(SitePiece(name, level_parts, spacing_m))

        middle_m = ground.corners_m.mean(axis=0)
        corner_heights_m = self.plan.ground.surface_m(np.vstack([ground.corners_m, middle_m]))
        middle_height_m = float(corner_heights_m[-1])
        z_m = float(corner_heights_m.min()) - SUNK_M
        sunk_m = middle_height_m - z_m - min(ground.low_m, 0.0)
        moved_parts = tuple(part.moved(at(z_m=z_m)) for part in level_parts)
        return SitePiece(name, moved_parts, spacing_m, sunk_m=sunk_m + 0.01)

    def _spots(self, count: int, *, clear_m: float, apart_m: float, reach: float = 0.94) -> list[Place]:
        """At most `count` random places on dry ground.

        They are `clear_m` away from the middle of the paths and `apart_m` from one another. `reach` is the share of the
        extent of the park in which they are.
        """
        pond = self.plan.ground.pond
        candidates_m = self.rng.uniform(-reach, reach, (40 * count, 2)) * self.plan.half_m
        to_path_m = self.path_points.query(candidates_m)[0]
        is_dry = np.ones(len(candidates_m), bool)
        if pond is not None:
            is_dry = pond.share(candidates_m) > DRY_SHARE

        chosen: list[Place] = []
        for x_m, y_m in candidates_m[(to_path_m > clear_m) & is_dry].tolist():
            if all(np.hypot(x_m - other_x, y_m - other_y) > apart_m for other_x, other_y in chosen):
                chosen.append((x_m, y_m))
            if len(chosen) == count:
                break
        return chosen

    def _random_heading(self, place: Place) -> PlanFrame:
        """A frame at a place with a random heading."""
        x_m, y_m = place
        return PlanFrame(x_m, y_m, float(self.rng.uniform(0, 360)))

    # --- Along the paths ---

    def _map(self) -> SitePiece:
        """A board with a map beside the loop."""
        loop = self.plan.loop
        index = int(self.rng.integers(len(loop.points_m)))
        half_width_m = float(loop.widths_m.max()) / 2
        left = loop.left[index]
        x_m, y_m = (loop.points_m[index] + (half_width_m + 0.5) * left).tolist()
        board = map_board(seed=int(self.rng.integers(40, 90)))
        return self._standing("map", board, PlanFrame(x_m, y_m, _bearing_deg(-left)))

    def _landmark(self) -> Iterator[SitePiece]:
        """A monument or a pavilion on a lawn, in most parks."""
        kind = one_of(self.rng, "monument", "pavilion", "none")
        if kind == "none":
            return
        for place in self._spots(1, clear_m=4.5, apart_m=5.0, reach=0.7):
            parts = monument(self.rng) if kind == "monument" else pavilion(self.rng)
            yield self._standing(kind, parts, self._random_heading(place))

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
            walking_deg = along_deg + float(rng.choice([0.0, 180.0])) + float(rng.normal(0, 25))
            yield self._person(PlanFrame(x_m, y_m, walking_deg))
        for place in self._spots(int(rng.integers(0, 4)), clear_m=1.5, apart_m=2.0, reach=0.8):
            yield self._person(self._random_heading(place))

    def _person(self, place: PlanFrame) -> SitePiece:
        number = self.counts.get("person", 0)
        rng = np.random.default_rng([self.seed, PERSON_STREAM, number])
        height_m = float(rng.uniform(*PERSON_M))
        return self._standing("person", outdoors.person(rng, height_m), place)

    def _lamps(self) -> Iterator[SitePiece]:
        """Lamps on the left side of the loop."""
        loop = self.plan.loop
        pitch_m = float(self.rng.uniform(11, 17))
        for index in _indices(loop, pitch_m):
            place = _place_beside(loop, index, LAMP_TO_PATH_M, side=1)
            post = self._standing("lamp", outdoors.park_lamp(self.rng, LAMP_M), place)
            foot_m = footprint(post).low_m
            self.bulbs[post.name] = as_arrays(household.bulb(place.x_m, place.y_m, foot_m + LAMP_M, BULB_M))
            yield post

    def _benches(self) -> Iterator[SitePiece]:
        """Benches, some of them with a bin, on the right side of the loop."""
        loop = self.plan.loop
        pitch_m = float(self.rng.uniform(13, 26))
        for index in _indices(loop, pitch_m):
            place = _place_beside(loop, index, BENCH_TO_PATH_M, side=-1)
            width_m = float(self.rng.choice(BENCH_WIDTHS_M))
            yield self._standing("bench", outdoors.park_bench(self.rng, width_m), place)
            has_bin = self.rng.random() < BIN_SHARE
            if has_bin:
                bench_m = np.array([place.x_m, place.y_m])
                bin_x_m, bin_y_m = (bench_m + BIN_TO_BENCH_M * loop.directions[index]).tolist()
                bin_parts = furniture.waste_bin(self.rng, width_m=0.42, height_m=0.75)
                yield self._standing("bin", bin_parts, PlanFrame(bin_x_m, bin_y_m, 0.0))

    # --- Plants and rocks ---

    def _trees(self) -> Iterator[SitePiece]:
        """Trees on the lawns and, denser, along the border, of a few varieties that stand there in several sizes."""
        rng = self.rng
        generators = [np.random.default_rng([self.seed, TREE_STREAM, number]) for number in range(VARIETIES)]
        varieties = [_tree(generator) for generator in generators]
        places = self._spots(int(rng.integers(12, 30)), clear_m=2.7, apart_m=4.6, reach=0.84)
        places += self._border(float(rng.uniform(4.4, 7.0)), inside_m=2.4)
        face_count = 0
        for place in places:
            size = float(rng.uniform(0.85, 1.2))
            scale = np.diag([size, size, size, 1.0])
            variety = varieties[int(rng.integers(VARIETIES))]
            parts = [part.moved(scale) for part in variety]
            face_count += sum(len(part.arrays.faces) for part in parts)
            if face_count > TREE_FACES:
                return
            yield self._standing("tree", parts, self._random_heading(place), spacing_m=TREE_SPACING_M)

    def _border(self, pitch_m: float, *, inside_m: float) -> list[Place]:
        """Places in rows along the border that are not on a path, in random order.

        The rows are `inside_m` away from the border, and the places about `pitch_m` from one another.
        """
        rng = self.rng
        half_x_m, half_y_m = self.plan.half_m
        along_y_m = np.arange(-half_y_m + 2, half_y_m - 1, pitch_m)
        along_x_m = np.arange(-half_x_m + 4, half_x_m - 3, pitch_m)
        rows_m: list[Array] = []
        for side in (-1, 1):
            row_x_m = np.full(len(along_y_m), side * (half_x_m - inside_m))
            row_y_m = np.full(len(along_x_m), side * (half_y_m - inside_m))
            rows_m.append(np.column_stack([row_x_m, along_y_m]))
            rows_m.append(np.column_stack([along_x_m, row_y_m]))
        in_rows_m = np.concatenate(rows_m)
        places_m = rng.permutation(in_rows_m + rng.normal(0, 0.3 * inside_m, in_rows_m.shape))
        is_clear = self.path_points.query(places_m)[0] > TREE_TO_PATH_M
        return [(x_m, y_m) for x_m, y_m in places_m[is_clear].tolist()]

    def _bushes(self) -> Iterator[SitePiece]:
        """Bushes on the lawns and along the border."""
        rng = self.rng
        places = self._spots(int(rng.integers(14, 36)), clear_m=2.1, apart_m=2.2)
        places += self._border(float(rng.uniform(1.9, 3.5)), inside_m=1.3)
        for place in places:
            height_m = float(rng.uniform(0.7, 1.7))
            width_m = float(rng.uniform(1.1, 2.2))
            parts = outdoors.bush(rng, height_m, width_m)
            yield self._standing("bush", parts, self._random_heading(place), spacing_m=BUSH_SPACING_M)

    def _rocks(self) -> Iterator[SitePiece]:
        """Boulders on the lawns, and more of them at the shore."""
        rng = self.rng
        places = self._spots(int(rng.integers(6, 26)), clear_m=1.9, apart_m=1.2)
        pond = self.plan.ground.pond
        if pond is not None:
            for bearing_rad in rng.uniform(0, 2 * np.pi, int(rng.integers(6, 22))):
                distance_m = pond.shore_m(np.array([bearing_rad])) * float(rng.uniform(1.0, 1.25))
                direction = [np.cos(bearing_rad), np.sin(bearing_rad)]
                x_m, y_m = (pond.center_m + distance_m * direction).tolist()
                places.append((x_m, y_m))
        for x_m, y_m in places:
            size_m = float(0.25 + np.minimum(rng.exponential(0.22), 1.0))
            yield self._standing("rock", outdoors.rock(rng, size_m=size_m), PlanFrame(x_m, y_m, 0.0))

    # --- Grass and flowers ---

    def growth(self, pieces: Sequence[SitePiece]) -> Iterator[Structure]:
        """Tufts of long grass beside the paths and at the shore, and flowers in beds."""
        rng = np.random.default_rng([self.seed, GROWTH_STREAM])
        yield self._tufts(rng)
        yield from self._beds(rng, pieces)

    def _tufts(self, rng: Rng) -> Structure:
        """Tufts of long grass: few on the lawns, and many along the edges of paths and at the shore."""
        places_m = rng.uniform(-0.95, 0.95, (TUFT_PLACES, 2)) * self.plan.half_m
        to_middle_m, nearest = self.path_points.query(places_m)
        widths_m = np.concatenate([path.widths_m for path in self.plan.paths])
        to_edge_m = to_middle_m - widths_m[nearest] / 2
        chance_at_edge = float(rng.uniform(0.2, 0.6))
        chance = 0.03 + chance_at_edge * np.exp(-(((to_edge_m - 0.1) / 0.22) ** 2))
        pond = self.plan.ground.pond
        if pond is not None:
            share = pond.share(places_m)  # 1 on the shore
            is_shore = share < 1.25
            is_water = share < 0.96
            chance = np.where(is_shore, 0.75, chance)
            chance = np.where(is_water, 0.0, chance)
        is_beside_path = to_edge_m > 0.06
        has_tuft = (rng.random(len(places_m)) < chance) & is_beside_path

        tint = one_of(rng, *TUFT_TINTS)
        grass = meadow.cut_out(tint, meadow.blades(int(rng.integers(3))))
        tufts = meadow.tufts(rng, self._on_ground(places_m[has_tuft]), TUFT_M, grass)
        return Structure("tufts", (tufts,), TUFT_SPACING_M)

    def _beds(self, rng: Rng, pieces: Sequence[SitePiece]) -> Iterator[Structure]:
        """Round beds of flowers of one colour each, where no piece is near."""
        pieces_m = [footprint(piece).corners_m.mean(axis=0) for piece in pieces]
        spots = self._spots(int(rng.integers(0, 5)), clear_m=2.6, apart_m=6.0, reach=0.8)
        for number, (x_m, y_m) in enumerate(spots):
            radius_m = float(rng.uniform(0.7, 1.4))
            nearest_piece_m = min(float(np.hypot(piece_x - x_m, piece_y - y_m)) for piece_x, piece_y in pieces_m)
            if nearest_piece_m < radius_m + 1.2:
                continue
            count = int(FLOWERS_PER_M2 * radius_m**2)
            distances_m = radius_m * np.sqrt(rng.random(count))  # uniform in the disc
            bearings_rad = rng.uniform(0, 2 * np.pi, count)
            directions = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=1)
            places_m = np.array([x_m, y_m]) + distances_m[:, None] * directions
            kind = int(rng.integers(len(meadow.FLOWER_INKS)))
            look = meadow.cut_out("#ffffff", meadow.flowers(kind))
            flowers = meadow.tufts(rng, self._on_ground(places_m), FLOWER_M, look)
            yield Structure(f"bed_{number}", (flowers,), BED_SPACING_M)

    def _on_ground(self, places_m: Array) -> Array:
        """Places (N, 2) with the height of the ground, (N, 3)."""
        return np.column_stack([places_m, self.plan.ground.surface_m(places_m)])


def _indices(path: Path, pitch_m: float) -> range:
    """The indices of points of a path at a distance from one another."""
    step = max(1, round(pitch_m / STEP_M))
    return range(step // 2, len(path.points_m) - 8, step)


def _place_beside(path: Path, index: int, distance_m: float, *, side: int) -> PlanFrame:
    """A place at a distance from the edge of a path, on its left (1) or right (-1) side, that faces the path."""
    left = path.left[index]
    from_middle_m = side * (path.widths_m[index] / 2 + distance_m)
    x_m, y_m = (path.points_m[index] + from_middle_m * left).tolist()
    return PlanFrame(x_m, y_m, _bearing_deg(-side * left))


def _bearing_deg(direction: Array) -> float:
    """The bearing of a direction (2,), counter-clockwise from x."""
    return float(np.rad2deg(np.arctan2(direction[1], direction[0])))


def _tree(rng: Rng) -> list[Part]:
    """A tree of some kind: broad, slender or a conifer."""
    kind = one_of(rng, "broad", "broad", "slender", "conifer")
    if kind == "conifer":
        height_m = float(rng.uniform(6.5, 10.5))
        spread = float(rng.uniform(0.17, 0.28))
        return conifer.conifer(rng, height_m, spread)
    if kind == "slender":
        height_m = float(rng.uniform(7.0, 9.5))
        spread = float(rng.uniform(0.2, 0.26))
        return branching_tree.branching_tree(rng, height_m, spread, density=0.6)
    height_m = float(rng.uniform(5.4, 8.2))
    spread = float(rng.uniform(0.34, 0.46))
    return branching_tree.branching_tree(rng, height_m, spread)
