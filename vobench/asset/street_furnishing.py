"""The furnishing of streets: parked cars, what stands along the kerbs, and people and plants on the pavements."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.asset import branching_tree, furniture, outdoors, vehicle
from vobench.asset.furniture import Part
from vobench.asset.picture import Rng
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.shape import at
from vobench.asset.site import Footprint, SitePiece, footprint, overlap_m
from vobench.asset.street_furniture import bicycle_hoop, cable_cabinet, traffic_sign
from vobench.asset.street_plan import KERB_M, LEFT, Footway, StreetPlan, StreetSegment
from vobench.geometry.se3 import Array

CAR_STREAM = 11  # of random numbers, followed by the number of the car

PIECE_SPACING_M = 0.2  # between samples of the light
TREE_SPACING_M = 0.8
PIECE_SUNK_M = 0.01  # how far pieces may reach into the ground
TREE_SUNK_M = 0.1
CLOSE_M = 0.01  # that footprints may share

CAR_PITCH_M = (5.6, 6.6)  # between the middles of parking bays
CAR_FROM_START_M = 6.0  # of a segment
CAR_TO_END_M = 6.5
HALF_BAY_M = 3.0
CAR_TO_KERB_M = 1.14  # from the middle of a car
CLEAR_OF_CROSSING_M = 6.0
CLEAR_OF_SIDE_STREET_M = 5.0
TURNED_SHARE = 0.1  # of cars that are parked against the direction of their lane

KERB_PITCH_M = 2.9  # between the slots along a kerb
KERB_PIECE_M = 0.55  # from the kerb to the middle of what stands along it
LAMP_SLOTS = 6  # from a lamp to the next one
TREE_SLOTS = 3
TREE_SHARE = 0.85  # of the slots for trees
EMPTY_SHARE = 0.3  # of the other slots
KERB_KINDS = ("bollard", "bollard", "sign", "bin", "box")
WIDE_KERB_KINDS = (*KERB_KINDS, "bench", "bicycles")
WIDE_KERB_M = 2.8  # width of a pavement from which on benches and bicycles stand there
KERB_TURNS_DEG = {"sign": 90.0, "bench": 180.0}  # from facing the road; 0 for other kinds, random for trees

LAMP_HEIGHT_M = 5.0
LAMP_REACH_M = 1.2  # from the mast to the middle of the head
PERSON_M = (1.55, 1.88)  # height
MOST_PEOPLE = 10  # in a street; each has some 4,400 faces
PLANT_M = (0.8, 1.3)  # height
PLANT_TO_HOUSE_M = 0.42  # from the middle of a tub
WIDE_FOR_PLANTS_M = 2.6  # width of a pavement


@dataclass(frozen=True, slots=True)
class StreetFurnishing:
    """What stands in a street.

    `lamp_poses` are the poses (4, 4) of the street lamps among the pieces, at the foot of the mast. The arm is along x.
    """

    pieces: tuple[SitePiece, ...]
    lamp_poses: tuple[Array, ...]


def furnish_street(plan: StreetPlan, *, seed: int, rng: Rng) -> StreetFurnishing:
    """Place parked cars, trees, lamps, signs and people, so that nothing overlaps."""
    furnisher = _Furnisher(plan, seed, rng)
    pieces = _without_overlaps(furnisher.candidates(), plan)
    lamp_poses = [furnisher.lamp_poses[piece.name] for piece in pieces if piece.name in furnisher.lamp_poses]
    return StreetFurnishing(tuple(pieces), tuple(lamp_poses))


def _without_overlaps(candidates: Sequence[SitePiece], plan: StreetPlan) -> list[SitePiece]:
    """The pieces that overlap no earlier one and no house."""
    selected: list[SitePiece] = []
    occupied: list[Footprint] = []
    for piece in candidates:
        ground = footprint(piece)
        is_clear_of_pieces = all(ground.overlap_depth_m(other, CLOSE_M) == 0 for other in occupied)
        if not is_clear_of_pieces:
            continue
        is_clear_of_houses = all(overlap_m(ground.corners_m, lot.corners_m) < CLOSE_M for lot in plan.lots)
        if is_clear_of_houses:
            selected.append(piece)
            occupied.append(ground)
    return selected


class _Furnisher:
    """Creates pieces from the road to the house fronts. They may overlap."""

    def __init__(self, plan: StreetPlan, seed: int, rng: Rng) -> None:
        self.plan = plan
        self.seed = seed
        self.rng = rng
        self.lamp_poses: dict[str, Array] = {}  # (4, 4), by the name of the piece
        self.counts: dict[str, int] = {}  # of pieces, by kind

    def candidates(self) -> list[SitePiece]:
        """The pieces, in the order in which they claim their places."""
        pieces = list(self._cars())
        has_trees_left = bool(self.rng.random() < 0.65)
        has_trees_right = bool(self.rng.random() < 0.65)
        tree_m = float(self.rng.uniform(5.5, 8.0))
        for number, footway in enumerate(self.plan.footways):
            has_trees = has_trees_right if footway.is_mirrored else has_trees_left
            pieces += self._kerbside(footway, number, has_trees=has_trees, tree_m=tree_m)
        for footway in self.plan.footways:
            pieces += self._pavement(footway)
        return pieces

    def _number(self, kind: str) -> int:
        """The number of the next piece of a kind."""
        return self.counts.get(kind, 0)

    def _standing(self, kind: str, parts: Sequence[Part], place: PlanFrame, *, z_m: float, yaw_deg: float) -> SitePiece:
        """The next piece of a kind, at the origin of a frame, turned by yaw_deg in the plan."""
        name = f"{kind}_{self._number(kind)}"
        self.counts[kind] = self._number(kind) + 1
        T_world_piece = at(place.x_m, place.y_m, z_m, yaw=yaw_deg)
        moved_parts = tuple(part.moved(T_world_piece) for part in parts)
        if kind == "tree":
            return SitePiece(name, moved_parts, TREE_SPACING_M, sunk_m=TREE_SUNK_M)
        return SitePiece(name, moved_parts, PIECE_SPACING_M, sunk_m=PIECE_SUNK_M)

    def _cars(self) -> Iterator[SitePiece]:
        """Parked cars on the sides with bays, clear of side streets and the crossing."""
        half_road_m = self.plan.road_m / 2
        occupied_share = float(self.rng.uniform(0.45, 0.95))
        for index, segment in enumerate(self.plan.segments):
            for side in self.plan.parking:
                first_m, last_m = segment.reach_m(side * half_road_m)
                end_m = min(segment.length_m, last_m) - CAR_TO_END_M
                x_m = CAR_FROM_START_M
                while x_m < end_m:
                    begins_after_bend = x_m - HALF_BAY_M > first_m
                    is_bay = begins_after_bend and not self._is_kept_clear(index, side, x_m)
                    if is_bay and self.rng.random() < occupied_share:
                        yield self._car(segment, side, x_m)
                    x_m += float(self.rng.uniform(*CAR_PITCH_M))

    def _is_kept_clear(self, segment: int, side: int, x_m: float) -> bool:
        """Whether a car at x would block the crossing or a side street."""
        crossing = self.plan.crossing
        if crossing and crossing.segment == segment and abs(crossing.x_m - x_m) < CLEAR_OF_CROSSING_M:
            return True
        for street in self.plan.side_streets:
            is_on_this_side = street.segment == segment and street.side == side
            if is_on_this_side and abs(street.x_m - x_m) < street.road_m / 2 + CLEAR_OF_SIDE_STREET_M:
                return True
        return False

    def _car(self, segment: StreetSegment, side: int, x_m: float) -> SitePiece:
        """A car in a parking bay. It stands a little askew, as drivers leave it."""
        rng = np.random.default_rng([self.seed, CAR_STREAM, self._number("car")])
        parts = vehicle.parked_car(rng)
        lateral_error_m = float(rng.normal(0, 0.03))
        longitudinal_error_m = float(np.clip(rng.normal(0, 0.12), -0.25, 0.25))
        is_turned = rng.random() < TURNED_SHARE
        yaw_error_deg = float(np.clip(rng.normal(0, 0.7), -1.5, 1.5))

        y_m = side * (self.plan.road_m / 2 - CAR_TO_KERB_M) + lateral_error_m
        place = segment.frame.frame(x_m + longitudinal_error_m, y_m)
        lane_is_oncoming = side == LEFT
        facing_deg = 180.0 if lane_is_oncoming != is_turned else 0.0
        yaw_deg = place.heading_deg + facing_deg + yaw_error_deg
        return self._standing("car", parts, place, z_m=0.0, yaw_deg=yaw_deg)

    def _kerbside(self, footway: Footway, number: int, *, has_trees: bool, tree_m: float) -> Iterator[SitePiece]:
        """Lamps, trees, signs, bins, bollards, benches and bicycles along the kerb.

        `tree_m` is the mean height of trees.
        """
        rng = self.rng
        house_side = -1 if footway.is_mirrored else 1  # the sign of y towards the houses
        towards_road_deg = -90.0 * house_side
        is_wide = footway.width_m > WIDE_KERB_M
        first_slot = LAMP_SLOTS // 2 * number  # so that lamps of neighbouring footways are not opposite each other
        for slot, slot_m in enumerate(np.arange(1.4, footway.length_m - 1.2, KERB_PITCH_M).tolist(), first_slot):
            place = footway.frame.frame(slot_m + float(rng.uniform(-0.25, 0.25)), house_side * KERB_PIECE_M)
            choice = float(rng.random())
            kind = _kind_of_slot(slot, choice, has_trees=has_trees, is_wide=is_wide)
            if kind is None:
                continue
            parts, turn_deg = _kerb_piece(rng, kind, tree_m)
            yaw_deg = place.heading_deg + towards_road_deg + turn_deg
            piece = self._standing(kind, parts, place, z_m=KERB_M, yaw_deg=yaw_deg)
            if kind == "lamp":
                self.lamp_poses[piece.name] = at(place.x_m, place.y_m, KERB_M, yaw=yaw_deg)
            yield piece

    def _pavement(self, footway: Footway) -> Iterator[SitePiece]:
        """People in the middle of the pavement, and tubs with plants along the house fronts."""
        rng = self.rng
        house_side = -1 if footway.is_mirrored else 1  # the sign of y towards the houses
        x_m = float(rng.uniform(2, 5))
        while x_m < footway.length_m - 2:
            has_room_for_people = self._number("person") < MOST_PEOPLE
            if rng.random() < 0.35 and has_room_for_people:
                free_width_m = max(footway.width_m - 2.3, 0.02)
                y_m = 1.15 + float(rng.uniform(0, free_width_m))
                place = footway.frame.frame(x_m, house_side * y_m)
                walking_deg = float(rng.choice([0.0, 180.0]) + rng.normal(0, 14))
                person = outdoors.person(rng, float(rng.uniform(*PERSON_M)))
                yaw_deg = place.heading_deg + walking_deg
                yield self._standing("person", person, place, z_m=KERB_M, yaw_deg=yaw_deg)
            elif footway.width_m > WIDE_FOR_PLANTS_M and rng.random() < 0.5:
                place = footway.frame.frame(x_m, house_side * (footway.width_m - PLANT_TO_HOUSE_M))
                plant = branching_tree.tub_plant(rng, float(rng.uniform(*PLANT_M)))
                yield self._standing("plant", plant, place, z_m=KERB_M, yaw_deg=place.heading_deg)
            x_m += float(rng.uniform(2.6, 7.0))


def _kind_of_slot(slot: int, choice: float, *, has_trees: bool, is_wide: bool) -> str | None:
    """What stands at a slot of the kerb; None for nothing. `choice` is a random number from 0 to 1."""
    if slot % LAMP_SLOTS == 0:
        return "lamp"
    is_for_tree = has_trees and slot % TREE_SLOTS == 1
    if is_for_tree and choice < TREE_SHARE:
        return "tree"
    if choice < EMPTY_SHARE:
        return None
    kinds = WIDE_KERB_KINDS if is_wide else KERB_KINDS
    # The leading digits of the choice have been used; those after them are as good as another random number.
    fine_digits = int(choice * 997)
    return kinds[fine_digits % len(kinds)]


def _kerb_piece(rng: Rng, kind: str, tree_m: float) -> tuple[list[Part], float]:
    """The parts of what stands at a kerb, and its turn from facing the road, in degrees."""
    match kind:
        case "tree":
            height_m = tree_m * float(rng.uniform(0.85, 1.15))
            parts = branching_tree.branching_tree(rng, height_m=height_m)
        case "lamp":
            parts = outdoors.street_lamp(rng, LAMP_HEIGHT_M, LAMP_REACH_M)
        case "sign":
            parts = traffic_sign(rng)
        case "bin":
            parts = furniture.waste_bin(rng, width_m=0.45, height_m=0.85)
        case "bench":
            parts = outdoors.park_bench(rng, 1.7)
        case "bollard":
            parts = outdoors.bollard(rng)
        case "box":
            parts = cable_cabinet(rng)
        case _:
            parts = bicycle_hoop(rng)
    turn_deg = float(rng.uniform(0, 360)) if kind == "tree" else KERB_TURNS_DEG.get(kind, 0.0)
    return parts, turn_deg
