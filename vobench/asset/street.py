"""Streets by seed: houses with shops and homes, parked cars, trees, lamps, signs and people, in any daylight."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import branching_tree, facade, furniture, outdoors, picture, vehicle
from vobench.asset.daylight import Daylight, lamp_colour, level_daylight
from vobench.asset.facade import House
from vobench.asset.furniture import STEEL, Part, matt, put
from vobench.asset.picture import NAVY, Rng, one_of
from vobench.asset.plan_frame import PlanFrame
from vobench.asset.shape import at, block_arrays, card_arrays, lathe, tube
from vobench.asset.site import Area, Footprint, LevelAreas, Site, SitePiece, Structure, footprint, overlap_m
from vobench.asset.street_layout import street_plan
from vobench.asset.street_plan import (
    KERB_M,
    LEFT,
    PARKING_M,
    Footway,
    Lot,
    StreetPlan,
    StreetSegment,
)
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import as_arrays, as_mesh
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

PANORAMAS = ("city", "city", "suburb")
PANORAMA_M = (110.0, 160.0)  # distance of what is behind the last houses
CAR_RADIUS_M = 1.2
GROUND_SPACING_M = 0.3  # between samples of the light
NEAR_SPACING_M = 0.5  # of houses along the street
FAR_SPACING_M = 0.9
SHOP_SPACING_M = 0.3
PIECE_SPACING_M = 0.2
TREE_SPACING_M = 0.8
LAMP_HEIGHT_M = 5.0
LAMP_REACH_M = 1.2
LAMP_LM = 6000.0
WINDOW_LM = 250.0
SHOP_LAMP_LM = 2600.0
CLOSE_M = 0.01  # that footprints may share
LIT_SHARE = 0.22  # of windows at night
KERB_WIDTH_M = 0.15
SHOP_SHARE = {"shops": 0.95, "mixed": 0.5, "homes": 0.12}
SIGNS = (
    ("30", "#b3241c"),
    ("P", NAVY),
    ("ZONE", NAVY),
    ("ONE WAY", NAVY),
    ("TAXI", "#2f4a36"),
    ("NO ENTRY", "#b3241c"),
)


def generated_street(seed: int, lighting: str) -> Site:
    """The street of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    # Each choice has a random generator of its own, so that a change of one leaves the others as they are.
    plan = street_plan(np.random.default_rng([seed, 0]))
    rng = np.random.default_rng([seed, 1])
    kind = one_of(rng, "shops", "shops", "mixed", "homes")
    houses = list(_houses(plan, kind, seed))
    ground = list(_ground(np.random.default_rng([seed, 2]), plan))
    furnishing = _Furnishing(plan, seed, np.random.default_rng([seed, 3]))
    pieces = furnishing.pieces()
    outside = level_daylight(
        np.random.default_rng([seed, 4]),
        np.random.default_rng([seed, 5]),
        lighting,
        kinds=PANORAMAS,
        distance_m=PANORAMA_M,
    )
    structures = [*ground, *(part for house in houses for part in house.structures)]
    arms = [furnishing.arms[piece.name] for piece in pieces if piece.name in furnishing.arms]
    lights = _lights(houses, arms, outside, np.random.default_rng([seed, 6]))
    roads = plan.roads
    return Site(
        structures=tuple(structures),
        pieces=tuple(pieces),
        lights=(*lights, *outside.lights),
        ground=LevelAreas((*roads, *plan.pavements)),
        roads=roads,
        stations_m=plan.stations_m,
        body_radius_m=CAR_RADIUS_M,
        walls=tuple(lot.corners_m for lot in plan.lots),
    )


# --- Houses ---


class _PlacedHouse:
    """A house on its lot, in the frame of the place."""

    def __init__(self, name: str, lot: Lot, house: House) -> None:
        frame = lot.frame
        T = at(frame.x_m, frame.y_m, yaw=frame.heading_deg)
        spacing_m = FAR_SPACING_M if lot.is_far else NEAR_SPACING_M
        self.structures = [Structure(name, tuple(part.moved(T) for part in house.parts), spacing_m)]
        if house.shop_parts:
            inside = tuple(part.moved(T) for part in house.shop_parts)
            self.structures.append(Structure(f"{name}_shop", inside, SHOP_SPACING_M))
        self.shop_lamps = [lamp.moved(T) for lamp in house.shop_lamps]
        self.windows = [window.moved(T) for window in house.windows]


def _houses(plan: StreetPlan, kind: str, seed: int) -> Iterator[_PlacedHouse]:
    """A house for each lot. On far lots and narrow ones there are no shops."""
    for number, lot in enumerate(plan.lots):
        rng = np.random.default_rng([seed, 10, number])
        wants_shop = bool(rng.random() < SHOP_SHARE[kind])
        has_shop = wants_shop and not lot.is_far and lot.width_m > 5.0
        house = facade.house(rng, lot, has_shop=has_shop, number=2 * number + 3)
        yield _PlacedHouse(f"house_{number}", lot, house)


# --- The ground ---


@picture.painted
def asphalt(seed: int = 0, px: int = 2048, tile_m: float = 10.0) -> Picture:
    """Asphalt with patches where it was dug up, and cracks filled with tar."""
    rng = np.random.default_rng([seed, 5])
    tone = 84 + 8 * picture.noise(rng, px, 2, 20, slope=1.0) + 13 * picture.noise(rng, px, 80, 900, slope=0.1)
    image = Image.fromarray(np.clip(tone, 20, 200).astype(np.uint8)).convert("RGB")
    draw = ImageDraw.Draw(image)
    for _ in range(4):
        x, y = rng.uniform(0, 0.75 * px, 2).tolist()
        w, h = rng.uniform(90, 460, 2).tolist()
        shade = int(rng.uniform(62, 78))
        if rng.random() < 0.55:
            draw.rectangle([x, y, x + w, y + h], fill=(shade, shade, shade + 1), outline=(48, 48, 49), width=4)
        crack_px = np.cumsum(rng.normal([7, 0], [6, 9], (40, 2)), axis=0) + np.array([x, y])
        draw.line([tuple(point) for point in crack_px.tolist()], fill=(50, 50, 51), width=3)
    grain = 1 + 0.1 * picture.noise(rng, px, 200, 1000, slope=0.0)[..., None]
    return Picture(np.clip(np.asarray(image) * grain, 0, 255).astype(np.uint8), tile_m)


def _ground(rng: Rng, plan: StreetPlan) -> Iterator[Structure]:
    """Roads, pavements, kerbs, and what is painted on the roads or let into them."""
    tint = one_of(rng, "#ffffff", "#e6e6ea", "#fff8f0", "#d6d6d8")
    road = matt(tint, asphalt(int(rng.integers(3))))
    slabs = (
        picture.masonry("paving", 2, 1024, 2.4, rows=6, columns=4),
        picture.masonry("paving", 1, 1024, 1.6, rows=16, columns=8),
        picture.masonry("paving", 0, 1024, 3.0, rows=4, columns=4, bond=0.0),
    )[int(rng.integers(3))]
    paving = matt(one_of(rng, "#f2eee6", "#d9d6d0", "#e6d2c4", "#c9ccd0"), slabs)
    stone = matt("#b9b5ab", picture.ground("concrete", 4))
    line = matt("#d2d1ca", picture.ground("concrete", 6))
    yield Structure("road", (Part(_flat(plan.roads, plan), road),), GROUND_SPACING_M)
    yield Structure("pavement", (Part(_flat(plan.pavements, plan), paving),), GROUND_SPACING_M)
    kerbs = [_kerb(kerb.start_m, kerb.end_m) for kerb in plan.kerbs]
    yield Structure("kerb", (Part(joined_arrays(kerbs), stone),), GROUND_SPACING_M)
    yield Structure("lines", (Part(joined_arrays(list(_lines(rng, plan))), line),), GROUND_SPACING_M)
    yield Structure("lids", (Part(joined_arrays(list(_lids(rng, plan))), matt("#4a4b4b")),), GROUND_SPACING_M)


def _flat(areas: Sequence[Area], plan: StreetPlan) -> MeshArrays:
    """The areas as meshes, with texture coordinates along the first segment of the street."""
    heading_rad = np.deg2rad(plan.segments[0].frame.heading_deg)
    turn = np.array([[np.cos(heading_rad), -np.sin(heading_rad)], [np.sin(heading_rad), np.cos(heading_rad)]])
    meshes = []
    for area in areas:
        heights_m = np.full((4, 1), area.height_m)
        vertices_m = np.hstack([area.corners_m, heights_m])
        normals = np.tile([0.0, 0.0, 1.0], (4, 1))
        meshes.append(MeshArrays(vertices_m, np.array([[0, 1, 2], [0, 2, 3]]), area.corners_m @ turn, normals))
    return joined_arrays(meshes)


def _kerb(start_m: Array, end_m: Array) -> MeshArrays:
    """A kerb stone along a line, a little above the pavement."""
    step = end_m - start_m
    length_m = float(np.linalg.norm(step))
    x, y = ((start_m + end_m) / 2).tolist()
    yaw_deg = float(np.rad2deg(np.arctan2(step[1], step[0])))
    height_m = 0.3
    return block_arrays((length_m, KERB_WIDTH_M, height_m), bevel_m=0.015).moved(
        at(x, y, KERB_M + 0.002 - height_m / 2, yaw=yaw_deg)
    )


def _painted(segment: StreetSegment, x0: float, x1: float, y0: float, y1: float) -> MeshArrays:
    """A rectangle of paint on the road."""
    frame = segment.frame
    corner = frame.point(x0, y0)
    along = frame.point(x1, y0) - corner
    across = frame.point(x0, y1) - corner
    return quad_arrays((*corner, 0.004), (*along, 0), (*across, 0))


def _lines(rng: Rng, plan: StreetPlan) -> Iterator[MeshArrays]:
    """A dashed middle line, the edges of parking bays, a pedestrian crossing and stop lines."""
    half_m = plan.road_m / 2
    shift_m = sum(-side * PARKING_M / 2 for side in plan.parking)
    pitch_m = float(rng.uniform(4.0, 6.5))
    for index, segment in enumerate(plan.segments):
        crossing_m = plan.crossing.x_m if plan.crossing and plan.crossing.segment == index else None
        for x in np.arange(3.0, segment.length_m - 4.5, pitch_m).tolist():
            if crossing_m is None or abs(x + 1 - crossing_m) > 4.0:
                yield _painted(segment, x, x + 2.0, shift_m - 0.06, shift_m + 0.06)
        if crossing_m is not None:
            for y in np.arange(-half_m + 0.3, half_m - 0.6, 1.0).tolist():
                yield _painted(segment, crossing_m - 1.6, crossing_m + 1.6, y, y + 0.5)
        for side in plan.parking:
            y = side * (half_m - PARKING_M + 0.05)
            yield _painted(segment, 2.5, segment.length_m - 2.5, y - 0.05, y + 0.05)


def _lids(rng: Rng, plan: StreetPlan) -> Iterator[MeshArrays]:
    """Manhole covers and gullies."""
    profile = [
        [0, -0.01],
        [0.32, -0.01],
        [0.32, 0.004],
        [0.29, 0.004],
        [0.28, 0.0],
        [0.2, 0.0],
        [0.19, 0.004],
        [0, 0.004],
    ]
    lid = as_arrays(lathe(profile))
    gully = block_arrays((0.45, 0.4, 0.01), bevel_m=0.003)
    for segment in plan.segments:
        for x in np.arange(5.0, segment.length_m - 4, 13.0).tolist():
            spot = segment.frame.point(x + float(rng.uniform(-2, 2)), float(rng.uniform(-1, 1)))
            yield lid.moved(at(float(spot[0]), float(spot[1]), 0.003))
            for side in (-1, 1):
                edge = segment.frame.point(x, side * (plan.road_m / 2 - 0.32))
                yield gully.moved(at(float(edge[0]), float(edge[1]), 0.003, yaw=segment.frame.heading_deg))


# --- What stands in the street ---


class _Furnishing:
    """Places what stands in a street, from kerb to house fronts, so that nothing meets."""

    def __init__(self, plan: StreetPlan, seed: int, rng: Rng) -> None:
        self.plan = plan
        self.seed = seed
        self.rng = rng
        self.arms: dict[str, Array] = {}  # the poses (4, 4) of street lamps by name
        self.counts: dict[str, int] = {}

    def pieces(self) -> list[SitePiece]:
        """Cars, and what stands on the pavements."""
        found = list(self._cars())
        has_trees = (bool(self.rng.random() < 0.65), bool(self.rng.random() < 0.65))
        tree_m = float(self.rng.uniform(5.5, 8.0))
        for number, footway in enumerate(self.plan.footways):
            found += self._kerbside(footway, number, has_trees=has_trees[footway.is_mirrored], tree_m=tree_m)
        for footway in self.plan.footways:
            found += self._house_side(footway)
        return self._without_overlaps(found)

    def _without_overlaps(self, pieces: Sequence[SitePiece]) -> list[SitePiece]:
        """The pieces that meet no earlier one and no house."""
        kept: list[SitePiece] = []
        taken: list[Footprint] = []
        walls = [lot.corners_m for lot in self.plan.lots]
        for piece in pieces:
            place = footprint(piece)
            is_free = all(place.overlap_depth_m(other, CLOSE_M) == 0 for other in taken)
            if is_free and all(overlap_m(place.corners_m, wall) < CLOSE_M for wall in walls):
                kept.append(piece)
                taken.append(place)
        return kept

    def _name(self, kind: str) -> str:
        number = self.counts.get(kind, 0)
        self.counts[kind] = number + 1
        return f"{kind}_{number}"

    def _standing(self, kind: str, parts: Sequence[Part], place: PlanFrame, *, z_m: float, yaw_deg: float) -> SitePiece:
        T = at(place.x_m, place.y_m, z_m, yaw=yaw_deg)
        spacing_m = TREE_SPACING_M if kind == "tree" else PIECE_SPACING_M
        sunk_m = 0.1 if kind == "tree" else 0.01
        return SitePiece(self._name(kind), tuple(part.moved(T) for part in parts), spacing_m, sunk_m=sunk_m)

    def _cars(self) -> Iterator[SitePiece]:
        """Parked cars on the sides with bays, clear of side streets and the crossing."""
        half_m = self.plan.road_m / 2
        share = float(self.rng.uniform(0.45, 0.95))
        for index, segment in enumerate(self.plan.segments):
            for side in self.plan.parking:
                x = 6.0
                near, far = segment.reach_m(side * half_m)
                while x < min(segment.length_m, far) - 6.5:
                    is_free = x - 3 > near and not self._is_kept_clear(index, side, x)
                    if is_free and self.rng.random() < share:
                        yield self._car(segment, side, x)
                    x += float(self.rng.uniform(5.6, 6.6))

    def _is_kept_clear(self, segment: int, side: int, x_m: float) -> bool:
        """Whether a car at x would block the crossing or a side street."""
        crossing = self.plan.crossing
        at_crossing = crossing is not None and crossing.segment == segment and abs(crossing.x_m - x_m) < 6.0
        at_street = any(
            street.segment == segment and street.side == side and abs(street.x_m - x_m) < street.road_m / 2 + 5
            for street in self.plan.side_streets
        )
        return at_crossing or at_street

    def _car(self, segment: StreetSegment, side: int, x_m: float) -> SitePiece:
        rng = np.random.default_rng([self.seed, 11, self.counts.get("car", 0)])
        parts = vehicle.parked_car(rng)
        y_m = side * (self.plan.road_m / 2 - 1.14) + float(rng.normal(0, 0.03))
        place = segment.frame.frame(x_m + float(np.clip(rng.normal(0, 0.12), -0.25, 0.25)), y_m)
        against = 180.0 if (side == LEFT) ^ (rng.random() < 0.1) else 0.0
        yaw_deg = place.heading_deg + against + float(np.clip(rng.normal(0, 0.7), -1.5, 1.5))
        return self._standing("car", parts, place, z_m=0.0, yaw_deg=yaw_deg)

    def _kerbside(self, footway: Footway, number: int, *, has_trees: bool, tree_m: float) -> Iterator[SitePiece]:
        """Lamps, trees, signs, bins, bollards, benches and bicycles along the kerb."""
        rng = self.rng
        sign = -1 if footway.is_mirrored else 1
        facing_deg = -90.0 * sign  # towards the road
        lamp_every = 6
        for slot, x in enumerate(np.arange(1.4, footway.length_m - 1.2, 2.9).tolist()):
            place = footway.frame.frame(x + float(rng.uniform(-0.25, 0.25)), sign * 0.55)
            yaw_deg = place.heading_deg + facing_deg
            choice = float(rng.random())
            kind_here = self._kind(slot + 3 * number, lamp_every, has_trees, choice, footway.width_m)
            if kind_here == "":
                continue
            parts, turn_deg = _kerb_piece(rng, kind_here, tree_m)
            yaw_deg += turn_deg
            if kind_here == "lamp":
                self.arms[f"lamp_{self.counts.get('lamp', 0)}"] = at(place.x_m, place.y_m, KERB_M, yaw=yaw_deg)
            yield self._standing(kind_here, parts, place, z_m=KERB_M, yaw_deg=yaw_deg)

    @staticmethod
    def _kind(slot: int, lamp_every: int, has_trees: bool, choice: float, width_m: float) -> str:
        """What stands at a slot of the kerb; nothing at some."""
        if slot % lamp_every == 0:
            return "lamp"
        if has_trees and slot % 3 == 1 and choice < 0.85:
            return "tree"
        if choice < 0.3:
            return ""
        others = ("bollard", "bollard", "sign", "bin", "box")
        wide: tuple[str, ...] = ("bench", "bicycles") if width_m > 2.8 else ()
        all_kinds: tuple[str, ...] = (*others, *wide)
        return all_kinds[int(choice * 997) % len(all_kinds)]

    def _house_side(self, footway: Footway) -> Iterator[SitePiece]:
        """People in the middle of the pavement, and tubs with plants along the house fronts."""
        rng = self.rng
        sign = -1 if footway.is_mirrored else 1
        x = float(rng.uniform(2, 5))
        while x < footway.length_m - 2:
            if rng.random() < 0.35:
                y_m = 1.15 + float(rng.uniform(0, max(footway.width_m - 2.3, 0.02)))
                place = footway.frame.frame(x, sign * y_m)
                yaw_deg = place.heading_deg + float(rng.choice([0.0, 180.0]) + rng.normal(0, 14))
                height_m = float(rng.uniform(1.55, 1.88))
                yield self._standing("person", outdoors.person(rng, height_m), place, z_m=KERB_M, yaw_deg=yaw_deg)
            elif footway.width_m > 2.6 and rng.random() < 0.5:
                place = footway.frame.frame(x, sign * (footway.width_m - 0.42))
                plant = branching_tree.tub_plant(rng, float(rng.uniform(0.8, 1.3)))
                yield self._standing("plant", plant, place, z_m=KERB_M, yaw_deg=place.heading_deg)
            x += float(rng.uniform(2.6, 7.0))


def _kerb_piece(rng: Rng, kind: str, tree_m: float) -> tuple[list[Part], float]:
    """The parts of what stands at a kerb, and its turn from facing the road, in degrees."""
    if kind == "tree":
        tree = branching_tree.branching_tree(rng, height_m=tree_m * float(rng.uniform(0.85, 1.15)))
        return tree, float(rng.uniform(0, 360))
    if kind == "lamp":
        return outdoors.street_lamp(rng, LAMP_HEIGHT_M, LAMP_REACH_M), 0.0
    if kind == "sign":
        text, ink = SIGNS[int(rng.integers(len(SIGNS)))]
        return _sign(text, ink), 90.0
    if kind == "bin":
        return furniture.waste_bin(rng, width_m=0.45, height_m=0.85), 0.0
    if kind == "bench":
        return outdoors.park_bench(rng, 1.7), 180.0
    makers: dict[str, Callable[[Rng], list[Part]]] = {
        "bollard": outdoors.bollard,
        "box": _cabinet,
        "bicycles": _bicycles,
    }
    return makers[kind](rng), 0.0


def _sign(text: str, ink: str) -> list[Part]:
    """A traffic sign on a pole."""
    plate = matt(texture=picture.sign(text, ink))
    pole = put(tube(np.array([[0, 0, 0], [0, 0, 2.7]]), 0.03), STEEL)
    body = put(block_arrays((0.06, 0.63, 0.32), bevel_m=0.004), STEEL, 0, 0, 2.4)
    faces = [put(card_arrays((0.62, 0.31)), plate, side * 0.034, 0, 2.4, yaw=90 * (1 - side)) for side in (-1, 1)]
    return [pole, body, *faces]


def _cabinet(rng: Rng) -> list[Part]:
    """A cabinet of the telephone company."""
    paint = furniture.coated(one_of(rng, "#4c5a50", "#8d9092", "#6d6a62"), roughness=0.4)
    return [
        furniture.stood((0.4, 0.9, 1.15), paint, bevel=0.015),
        furniture.stood((0.46, 0.96, 0.05), paint, z=1.15, bevel=0.01),
        furniture.stood((0.41, 0.01, 1.0), furniture.DARK, z=0.08, bevel=0),
    ]


def _bicycles(rng: Rng) -> list[Part]:
    """Two bicycles side by side at a hoop, across the pavement."""
    parts = [put(tube([[-0.3, 0, 0], [-0.3, 0, 0.75], [0.3, 0, 0.75], [0.3, 0, 0]], 0.024), STEEL)]
    for side in (-1, 1):
        paint = furniture.coated(one_of(rng, "#8d1f1c", "#20334e", "#17191b", "#3f6c87", "#d9dad7"), roughness=0.2)
        T = at(0.0, side * 0.19)
        parts += [part.moved(T) for part in _bicycle(paint)]
    return parts


def _bicycle(paint: Material) -> list[Part]:
    """A bicycle along x."""
    turns = np.linspace(0, 2 * np.pi, 25)
    circle = np.column_stack([0.33 * np.cos(turns), 0 * turns, 0.33 * np.sin(turns) + 0.345])
    tyres = []
    spokes = []
    for x in (-0.52, 0.52):
        tyres.append(tube(circle + np.array([x, 0, 0]), 0.015, sections=5))
        for angle in np.deg2rad(np.arange(0, 180, 30)):
            arm = 0.32 * np.array([np.cos(angle), 0, np.sin(angle)])
            middle = np.array([x, 0, 0.345])
            spokes.append(tube(np.stack([middle - arm, middle + arm]), 0.002, sections=3))
    hub = (-0.52, 0, 0.345)
    crank = (-0.08, 0, 0.32)
    seat = (-0.17, 0, 0.78)
    head = (0.34, 0, 0.85)
    bar = (0.33, 0, 1.0)
    lines = (
        (hub, crank),
        (crank, (-0.2, 0, 0.9)),
        (hub, seat),
        (crank, (0.36, 0, 0.8)),
        (seat, head),
        ((0.52, 0, 0.345), bar),
        ((0.33, -0.26, 1.0), (0.33, 0.26, 1.0)),
    )
    frame = [tube([start, end], 0.017, sections=6) for start, end in lines]
    return [
        Part(joined_arrays([as_arrays(mesh) for mesh in tyres]), vehicle.RUBBER),
        Part(joined_arrays([as_arrays(mesh) for mesh in spokes]), STEEL),
        Part(joined_arrays([as_arrays(mesh) for mesh in frame]), paint),
        put(block_arrays((0.26, 0.14, 0.05), bevel_m=0.02), furniture.BLACK, -0.21, 0, 0.93),
    ]


# --- Lights ---


def _lights(houses: Sequence[_PlacedHouse], arms: Sequence[Array], outside: Daylight, rng: Rng) -> list[Light]:
    """Street lamps, lit windows and shops. By day only some of the shops are lit."""
    found: list[Light] = []
    is_dark = outside.lamp_share > 0.8
    shop_lamps = [lamp for house in houses for lamp in house.shop_lamps]
    if shop_lamps and outside.lamp_share > 0.2:
        mesh = as_mesh(joined_arrays(shop_lamps))
        found.append(AreaLight("shops", mesh, SHOP_LAMP_LM * len(shop_lamps), colour=lamp_colour(3600)))
    if not is_dark:
        return found
    heads = [_lamp_head(T) for T in arms]
    if heads:
        mesh = as_mesh(joined_arrays(heads))
        found.append(AreaLight("street_lamps", mesh, LAMP_LM * len(heads), colour=lamp_colour(3200)))
    windows = [window for house in houses for window in house.windows]
    lit = [window for window in windows if rng.random() < LIT_SHARE]
    if lit:
        mesh = as_mesh(joined_arrays(lit))
        found.append(AreaLight("windows", mesh, WINDOW_LM * len(lit), colour=lamp_colour(2900)))
    return found


def _lamp_head(T_world_lamp: Array) -> MeshArrays:
    """The face that shines below the head of a street lamp."""
    face = quad_arrays((-0.27, -0.09, 0), (0, 0.18, 0), (0.54, 0, 0))
    return face.moved(T_world_lamp @ at(LAMP_REACH_M, 0, LAMP_HEIGHT_M))
