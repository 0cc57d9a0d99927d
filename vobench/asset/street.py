"""Streets by seed: houses with shops and homes, parked cars, trees, lamps, signs and people, in any daylight."""

from collections.abc import Iterator, Sequence

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import facade, picture
from vobench.asset.daylight import Daylight, lamp_colour, level_daylight
from vobench.asset.facade import House
from vobench.asset.furniture import Part, matt
from vobench.asset.picture import Draw, Rng, one_of
from vobench.asset.shape import at, block_arrays, lathe
from vobench.asset.site import Area, LevelAreas, Site, Structure
from vobench.asset.street_furnishing import LAMP_HEIGHT_M, LAMP_REACH_M, furnish_street
from vobench.asset.street_layout import street_plan
from vobench.asset.street_plan import KERB_M, PARKING_M, Crossing, Kerb, Lot, StreetPlan, StreetSegment
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import as_arrays, as_mesh
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

# Each choice has a stream of random numbers of its own, so that a change of one leaves the others as they are.
PLAN_STREAM = 0
KIND_STREAM = 1
GROUND_STREAM = 2
FURNISHING_STREAM = 3
DAYLIGHT_STREAM = 4
SUN_STREAM = 5
LIGHT_STREAM = 6
HOUSE_STREAM = 10  # followed by the number of the house

CAR_RADIUS_M = 1.2  # of the body that drives through the street
PANORAMAS = ("city", "city", "suburb")
PANORAMA_M = (110.0, 160.0)  # distance of what is behind the last houses

# Distances between samples of the light
GROUND_SPACING_M = 0.3
NEAR_SPACING_M = 0.5  # on houses along the street
FAR_SPACING_M = 0.9  # on houses that are only seen from a distance
SHOP_SPACING_M = 0.3

SHOP_SHARE = {"shops": 0.95, "mixed": 0.5, "homes": 0.12}  # of houses, by kind of street
LEAST_SHOP_WIDTH_M = 5.0  # of a house

ROAD_TINTS = ("#ffffff", "#e6e6ea", "#fff8f0", "#d6d6d8")
PAVING_TINTS = ("#f2eee6", "#d9d6d0", "#e6d2c4", "#c9ccd0")
KERB_TINT = "#b9b5ab"
LINE_TINT = "#d2d1ca"
LID = matt("#4a4b4b")
ASPHALT_SEEDS = 3
PATCHES = 4  # of a tile of asphalt
PATCHED_SHARE = 0.55  # of the places with a crack
KERB_WIDTH_M = 0.15
KERB_STONE_M = 0.3  # height of a kerb stone, most of which is in the ground
KERB_ABOVE_M = 0.002  # the pavement
PAINT_M = 0.004  # height of paint above the road
DASH_M = 2.0
LINE_WIDTH_M = 0.12  # of the middle line
CROSSING_WIDTH_M = 3.2
STRIPE_M = 0.5  # width of a stripe of a crossing, and of the gap beside it
LID_M = 0.003  # height of lids above the road
LID_PITCH_M = 13.0
LID_PROFILE_M = (
    (0, -0.01),
    (0.32, -0.01),
    (0.32, 0.004),
    (0.29, 0.004),
    (0.28, 0.0),
    (0.2, 0.0),
    (0.19, 0.004),
    (0, 0.004),
)

LAMP_LM = 6000.0
LAMP_K = 3200
SHOP_LAMP_LM = 2600.0
SHOP_LAMP_K = 3600
WINDOW_LM = 250.0
WINDOW_K = 2900
LIT_WINDOW_SHARE = 0.22  # at night
SHOPS_LIT_ABOVE = 0.2  # of the share of lamps that are on: all lightings but day
DARK_ABOVE = 0.8  # likewise: evening and night


def generated_street(seed: int, lighting: str) -> Site:
    """The street of a seed under a lighting, one of `daylight.LIGHTINGS`."""
    plan = street_plan(_stream(seed, PLAN_STREAM))
    kind = one_of(_stream(seed, KIND_STREAM), "shops", "shops", "mixed", "homes")
    houses = list(_houses(plan, kind, seed))
    ground = list(_ground(_stream(seed, GROUND_STREAM), plan))
    furnishing = furnish_street(plan, seed=seed, rng=_stream(seed, FURNISHING_STREAM))
    outside = level_daylight(
        _stream(seed, DAYLIGHT_STREAM),
        _stream(seed, SUN_STREAM),
        lighting,
        kinds=PANORAMAS,
        distance_m=PANORAMA_M,
    )
    lamps = _lamps(houses, furnishing.lamp_poses, outside, _stream(seed, LIGHT_STREAM))

    structures = list(ground)
    for house in houses:
        structures += house.structures
    return Site(
        structures=tuple(structures),
        pieces=furnishing.pieces,
        lights=(*lamps, *outside.lights),
        ground=LevelAreas((*plan.roads, *plan.pavements)),
        roads=plan.roads,
        stations_m=plan.stations_m,
        body_radius_m=CAR_RADIUS_M,
        walls=tuple(lot.corners_m for lot in plan.lots),
    )


def _stream(seed: int, *stream: int) -> Rng:
    """The random generator of a stream of a street."""
    return np.random.default_rng([seed, *stream])


# --- Houses ---


class _PlacedHouse:
    """A house on its lot, in the frame of the place."""

    def __init__(self, name: str, lot: Lot, house: House) -> None:
        frame = lot.frame
        T_world_lot = at(frame.x_m, frame.y_m, yaw=frame.heading_deg)
        spacing_m = FAR_SPACING_M if lot.is_far else NEAR_SPACING_M
        parts = tuple(part.moved(T_world_lot) for part in house.parts)
        self.structures = [Structure(name, parts, spacing_m)]
        if house.shop_parts:
            shop_parts = tuple(part.moved(T_world_lot) for part in house.shop_parts)
            self.structures.append(Structure(f"{name}_shop", shop_parts, SHOP_SPACING_M))
        self.shop_lamps = [lamp.moved(T_world_lot) for lamp in house.shop_lamps]
        self.windows = [window.moved(T_world_lot) for window in house.windows]


def _houses(plan: StreetPlan, kind: str, seed: int) -> Iterator[_PlacedHouse]:
    """A house for each lot. On far lots and narrow ones there are no shops."""
    for number, lot in enumerate(plan.lots):
        rng = _stream(seed, HOUSE_STREAM, number)
        wants_shop = bool(rng.random() < SHOP_SHARE[kind])
        has_shop = wants_shop and not lot.is_far and lot.width_m > LEAST_SHOP_WIDTH_M
        house_number = 2 * number + 3  # odd, as on one side of a street
        house = facade.house(rng, lot, has_shop=has_shop, number=house_number)
        yield _PlacedHouse(f"house_{number}", lot, house)


# --- Road and pavement ---


@picture.painted
def asphalt(seed: int = 0, px: int = 2048, tile_m: float = 10.0) -> Picture:
    """Asphalt with patches where it was dug up, and cracks filled with tar."""
    rng = np.random.default_rng([seed, 5])
    blotches = 8 * picture.noise(rng, px, 2, 20, slope=1.0)
    stones = 13 * picture.noise(rng, px, 80, 900, slope=0.1)
    grey = np.clip(84 + blotches + stones, 20, 200).astype(np.uint8)
    image = Image.fromarray(grey).convert("RGB")

    draw = ImageDraw.Draw(image)
    for _ in range(PATCHES):
        _draw_patch(draw, rng, px)

    grain = 1 + 0.1 * picture.noise(rng, px, 200, 1000, slope=0.0)
    pixels = np.clip(np.asarray(image) * grain[..., None], 0, 255).astype(np.uint8)
    return Picture(pixels, tile_m)


def _draw_patch(draw: Draw, rng: Rng, px: int) -> None:
    """Draw a crack filled with tar, which begins at a corner of a rectangular patch at some places."""
    x, y = rng.uniform(0, 0.75 * px, 2).tolist()
    width, height = rng.uniform(90, 460, 2).tolist()
    shade = int(rng.uniform(62, 78))
    has_patch = rng.random() < PATCHED_SHARE
    if has_patch:
        fill = (shade, shade, shade + 1)
        draw.rectangle([x, y, x + width, y + height], fill=fill, outline=(48, 48, 49), width=4)

    # The crack is a random walk that drifts to the right.
    steps_px = rng.normal([7, 0], [6, 9], (40, 2))
    crack_px = np.cumsum(steps_px, axis=0) + np.array([x, y])
    points_px = [tuple(point) for point in crack_px.tolist()]
    draw.line(points_px, fill=(50, 50, 51), width=3)


def _ground(rng: Rng, plan: StreetPlan) -> Iterator[Structure]:
    """Roads, pavements, kerbs, and what is painted on the roads or let into them."""
    road_tint = one_of(rng, *ROAD_TINTS)
    asphalt_seed = int(rng.integers(ASPHALT_SEEDS))
    road = matt(road_tint, asphalt(asphalt_seed))
    paving = _paving(rng)
    stone = matt(KERB_TINT, picture.ground("concrete", seed=4))
    paint = matt(LINE_TINT, picture.ground("concrete", seed=6))

    kerbs = [_kerb_stone(kerb) for kerb in plan.kerbs]
    lines = list(_lines(rng, plan))
    lids = list(_lids(rng, plan))
    yield _ground_structure("road", _level_mesh(plan.roads, plan), road)
    yield _ground_structure("pavement", _level_mesh(plan.pavements, plan), paving)
    yield _ground_structure("kerb", joined_arrays(kerbs), stone)
    yield _ground_structure("lines", joined_arrays(lines), paint)
    yield _ground_structure("lids", joined_arrays(lids), LID)


def _ground_structure(name: str, mesh: MeshArrays, material: Material) -> Structure:
    """A structure of one mesh on the ground."""
    return Structure(name, (Part(mesh, material),), GROUND_SPACING_M)


def _paving(rng: Rng) -> Material:
    """Slabs or blocks of one of three formats, in a random tint."""
    slabs = picture.masonry("paving", seed=2, tile_m=2.4, rows=6, columns=4)  # of 0.4 m by 0.6 m
    blocks = picture.masonry("paving", seed=1, tile_m=1.6, rows=16, columns=8)  # of 0.1 m by 0.2 m
    squares = picture.masonry("paving", seed=0, tile_m=3.0, rows=4, columns=4, bond=0.0)  # of 0.75 m
    formats = (slabs, blocks, squares)
    texture = formats[int(rng.integers(len(formats)))]
    tint = one_of(rng, *PAVING_TINTS)
    return matt(tint, texture)


def _level_mesh(areas: Sequence[Area], plan: StreetPlan) -> MeshArrays:
    """A mesh of level areas, with texture coordinates along the first segment of the street."""
    heading_rad = np.deg2rad(plan.segments[0].frame.heading_deg)
    cosine = np.cos(heading_rad)
    sine = np.sin(heading_rad)
    R_world_street = np.array([[cosine, -sine], [sine, cosine]])
    two_triangles = np.array([[0, 1, 2], [0, 2, 3]])
    upwards = np.tile([0.0, 0.0, 1.0], (4, 1))
    meshes = []
    for area in areas:
        heights_m = np.full((4, 1), area.height_m)
        vertices_m = np.hstack([area.corners_m, heights_m])
        uv_m = area.corners_m @ R_world_street  # rows: each is multiplied by the inverse rotation
        meshes.append(MeshArrays(vertices_m, two_triangles, uv_m, upwards))
    return joined_arrays(meshes)


def _kerb_stone(kerb: Kerb) -> MeshArrays:
    """A kerb stone along a line, a little above the pavement."""
    along_m = kerb.end_m - kerb.start_m
    length_m = float(np.linalg.norm(along_m))
    yaw_deg = float(np.rad2deg(np.arctan2(along_m[1], along_m[0])))
    x_m, y_m = ((kerb.start_m + kerb.end_m) / 2).tolist()
    z_m = KERB_M + KERB_ABOVE_M - KERB_STONE_M / 2
    stone = block_arrays((length_m, KERB_WIDTH_M, KERB_STONE_M), bevel_m=0.015)
    return stone.moved(at(x_m, y_m, z_m, yaw=yaw_deg))


def _painted(segment: StreetSegment, x0: float, x1: float, y0: float, y1: float) -> MeshArrays:
    """A rectangle of paint on the road, in the frame of a segment."""
    frame = segment.frame
    corner = frame.point(x0, y0)
    along = frame.point(x1, y0) - corner
    across = frame.point(x0, y1) - corner
    return quad_arrays((*corner, PAINT_M), (*along, 0), (*across, 0))


def _lines(rng: Rng, plan: StreetPlan) -> Iterator[MeshArrays]:
    """A dashed middle line, a pedestrian crossing, and the edges of parking bays."""
    pitch_m = float(rng.uniform(4.0, 6.5))
    for index, segment in enumerate(plan.segments):
        has_crossing = plan.crossing is not None and plan.crossing.segment == index
        crossing = plan.crossing if has_crossing else None
        yield from _middle_line(plan, segment, crossing, pitch_m)
        if crossing:
            yield from _stripes(plan, segment, crossing)
        yield from _bay_edges(plan, segment)


def _middle_line(
    plan: StreetPlan,
    segment: StreetSegment,
    crossing: Crossing | None,
    pitch_m: float,
) -> Iterator[MeshArrays]:
    """Dashes between the lanes of a segment, except near its crossing."""
    # A parking lane at one side shifts the driving lanes to the other side.
    middle_m = sum(-side * PARKING_M / 2 for side in plan.parking)
    right_m = middle_m - LINE_WIDTH_M / 2
    left_m = middle_m + LINE_WIDTH_M / 2
    for x_m in np.arange(3.0, segment.length_m - 4.5, pitch_m).tolist():
        is_near_crossing = crossing is not None and abs(x_m + DASH_M / 2 - crossing.x_m) <= 4.0
        if not is_near_crossing:
            yield _painted(segment, x_m, x_m + DASH_M, right_m, left_m)


def _stripes(plan: StreetPlan, segment: StreetSegment, crossing: Crossing) -> Iterator[MeshArrays]:
    """The stripes of a pedestrian crossing, along the road."""
    half_road_m = plan.road_m / 2
    start_m = crossing.x_m - CROSSING_WIDTH_M / 2
    end_m = crossing.x_m + CROSSING_WIDTH_M / 2
    for y_m in np.arange(-half_road_m + 0.3, half_road_m - 0.6, 2 * STRIPE_M).tolist():
        yield _painted(segment, start_m, end_m, y_m, y_m + STRIPE_M)


def _bay_edges(plan: StreetPlan, segment: StreetSegment) -> Iterator[MeshArrays]:
    """The lines between a driving lane and the parking bays beside it."""
    for side in plan.parking:
        y_m = side * (plan.road_m / 2 - PARKING_M + 0.05)
        yield _painted(segment, 2.5, segment.length_m - 2.5, y_m - 0.05, y_m + 0.05)


def _lids(rng: Rng, plan: StreetPlan) -> Iterator[MeshArrays]:
    """Manhole covers near the middle of the road, and gullies at both edges."""
    cover = as_arrays(lathe(LID_PROFILE_M))
    gully = block_arrays((0.45, 0.4, 0.01), bevel_m=0.003)
    for segment in plan.segments:
        frame = segment.frame
        for x_m in np.arange(5.0, segment.length_m - 4, LID_PITCH_M).tolist():
            cover_x_m = x_m + float(rng.uniform(-2, 2))
            cover_y_m = float(rng.uniform(-1, 1))
            cover_place = frame.frame(cover_x_m, cover_y_m)
            yield cover.moved(at(cover_place.x_m, cover_place.y_m, LID_M))
            for side in (-1, 1):
                gully_place = frame.frame(x_m, side * (plan.road_m / 2 - 0.32))
                yield gully.moved(at(gully_place.x_m, gully_place.y_m, LID_M, yaw=frame.heading_deg))


# --- Lights ---


def _lamps(
    houses: Sequence[_PlacedHouse],
    lamp_poses: Sequence[Array],
    outside: Daylight,
    rng: Rng,
) -> list[Light]:
    """Shops, lit unless it is a sunny day; street lamps and some of the windows, lit when it is dark."""
    lamps: list[Light] = []
    has_lit_shops = outside.lamp_share > SHOPS_LIT_ABOVE
    if has_lit_shops:
        shop_faces = [face for house in houses for face in house.shop_lamps]
        lamps += _area_light("shops", shop_faces, SHOP_LAMP_LM, SHOP_LAMP_K)
    is_dark = outside.lamp_share > DARK_ABOVE
    if is_dark:
        lamp_faces = [_lamp_face(T_world_lamp) for T_world_lamp in lamp_poses]
        windows = [window for house in houses for window in house.windows]
        lit_windows = [window for window in windows if rng.random() < LIT_WINDOW_SHARE]
        lamps += _area_light("street_lamps", lamp_faces, LAMP_LM, LAMP_K)
        lamps += _area_light("windows", lit_windows, WINDOW_LM, WINDOW_K)
    return lamps


def _area_light(name: str, faces: Sequence[MeshArrays], flux_lm: float, temperature_k: float) -> list[Light]:
    """One light of several faces, `flux_lm` each; none if there are no faces."""
    if not faces:
        return []
    mesh = as_mesh(joined_arrays(faces))
    return [AreaLight(name, mesh, flux_lm * len(faces), colour=lamp_colour(temperature_k))]


def _lamp_face(T_world_lamp: Array) -> MeshArrays:
    """The luminous face below the head of a street lamp."""
    face = quad_arrays((-0.27, -0.09, 0), (0, 0.18, 0), (0.54, 0, 0))
    T_lamp_head = at(LAMP_REACH_M, 0, LAMP_HEIGHT_M)
    return face.moved(T_world_lamp @ T_lamp_head)
