"""Cars and vans with glass all around, of several shapes. They stand on z = 0 and face x."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from vobench.asset import picture
from vobench.asset.furniture import BLACK, CHROME, DARK, GREY, Part, coated, matt, put, stood
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, cushion, lathe, sheet_arrays
from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit
from vobench.scene.material import Material
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

SIDES = (-1, 1)  # right and left, as factors of y
# Most cars are white, black, grey or silver.
PAINTS = (
    "#e4e4e1", "#dcdddb", "#17191b", "#22262a", "#5d6468", "#7b8084", "#b7bcc0", "#a9adb0", "#20334e", "#2f4a63",
    "#8d1f1c", "#2f3a34", "#6e2a22", "#c9b58a",
)  # fmt: skip
VAN_PAINTS = ("#e9e9e6", "#e4e4e1", "#d9dad7", "#b7bcc0", "#20334e", "#c8a23a")
GLASS = coated("#0c1013", roughness=0.05)
RUBBER = matt("#1b1c1d")
RIM = coated("#6b6f72", roughness=0.3)
HEADLAMP = coated("#c3cacd", roughness=0.06)
REAR_LAMP = coated("#7d100e", roughness=0.1)
INDICATOR = coated("#b4641a", roughness=0.1)
LETTERS = "ABCDEFGHKLMNPRSTVX"
SEAM_M = 0.006  # width of the gap around a door
TYRE_RADIUS_M = 0.315
CELLS = 3  # along each side of a patch
# Cuts between frames and panes, as shares of a patch: across or along the car, and upwards
SCREEN_CUTS_U = (0, 0.06, 0.94, 1)
SCREEN_CUTS_V = (0, 0.09, 0.93, 1)
SIDE_CUTS_U = (0.0, 0.13, 0.53, 0.57, 0.93, 1.0)
SIDE_CUTS_V = (0, 0.08, 0.88, 1)
SPOKES = 5
TYRE_PROFILE_M = (
    (0, -0.2),
    (0.2, -0.2),
    (TYRE_RADIUS_M - 0.03, -0.19),
    (TYRE_RADIUS_M, -0.17),
    (TYRE_RADIUS_M, -0.03),
    (TYRE_RADIUS_M - 0.02, -0.005),
    (0.225, 0),
    (0.22, -0.07),
    (0, -0.07),
)
RIM_PROFILE_M = ((0, -0.02), (0.222, -0.02), (0.224, -0.002), (0.2, -0.003), (0.195, -0.009), (0, -0.009))


@dataclass(frozen=True, slots=True)
class CarShape:
    """The side view of a car, in metres.

    bonnet_m is the distance from the nose to the foot of the windscreen, and screen_m the length along x that the
    windscreen covers; tail_m and rear_m are the same for the rear window. waist_m is the height of the foot of the
    windows. roof_share is the width of the roof relative to the body.
    """

    length_m: float
    width_m: float
    height_m: float
    waist_m: float
    bonnet_m: float
    screen_m: float
    tail_m: float
    rear_m: float
    nose_height_m: float
    roof_share: float = 0.68
    doors: int = 2  # on each side
    has_rear_glass: bool = True  # panel vans have none behind the front doors

    @property
    def wheels_x_m(self) -> tuple[float, float]:
        """The places of the axles."""
        half_m = self.length_m / 2
        return -half_m + 0.19 * self.length_m, half_m - 0.205 * self.length_m


SHAPES: dict[str, CarShape] = {
    "hatchback": CarShape(4.2, 1.79, 1.46, 0.93, 1.02, 0.72, 0.1, 0.5, 0.72),
    "city": CarShape(3.6, 1.66, 1.5, 0.95, 0.72, 0.7, 0.06, 0.34, 0.76),
    "saloon": CarShape(4.65, 1.82, 1.44, 0.92, 1.2, 0.78, 0.62, 0.66, 0.7),
    "estate": CarShape(4.6, 1.81, 1.48, 0.93, 1.16, 0.75, 0.08, 0.36, 0.71),
    "offroad": CarShape(4.5, 1.86, 1.68, 1.06, 1.05, 0.7, 0.08, 0.32, 0.86, roof_share=0.72),
    "van": CarShape(4.9, 1.94, 1.95, 1.14, 0.82, 0.66, 0.04, 0.1, 0.92, roof_share=0.84, has_rear_glass=False),
}


def parked_car(rng: Rng, shape: str = "", colour: str = "") -> list[Part]:
    """A car of one of SHAPES: body, windows on all sides, wheels, lamps, number plates and mirrors."""
    kind = shape or one_of(rng, "hatchback", "hatchback", "city", "saloon", "estate", "offroad", "van")
    car = SHAPES[kind]
    paints = VAN_PAINTS if kind == "van" else PAINTS
    paint = coated(colour or one_of(rng, *paints), roughness=0.1)
    letters = "".join(rng.choice([*LETTERS], 2))
    number = f"{letters} {rng.integers(100, 999)}"
    parts = [*_body(car, paint), *_cabin(car, paint)]
    for side in SIDES:
        parts += _wheels(car, side)
        parts += _side_fittings(car, paint, side)
    return [*parts, *_ends(car, number)]


# --- The body below the windows ---


def _body(car: CarShape, paint: Material) -> list[Part]:
    """The sides, bonnet and boot, the ends, and the floor."""
    sections = _sections(car)  # (S, 7, 3), from the right sill over the top to the left sill
    right = sheet_arrays(sections[:, :3])
    left = sheet_arrays(sections[:, 4:])
    top = sheet_arrays(sections[:, 2:5])
    skin = [_facing(right, (0, -1, 0)), _facing(left, (0, 1, 0)), _facing(top, (0, 0, 1))]
    skin += [_end(sections[0], -1.0), _end(sections[-1], 1.0)]
    floor_m = (car.length_m - 0.5, car.width_m - 0.3, 0.12)
    sill_m = (car.length_m - 2.1, car.width_m - 0.06, 0.1)
    return [
        Part(joined_arrays(skin), paint),
        stood(floor_m, BLACK, z=0.17, bevel=0),
        stood(sill_m, DARK, z=0.2, bevel=0.02),
    ]


def _sections(car: CarShape) -> Array:
    """Points (S, 7, 3) of cross sections from tail to nose: sill, bulge, shoulder, ridge, and back down."""
    half_m = car.length_m / 2
    from_end_m = np.array([0.0, 0.06, 0.16, 0.34, 0.62])
    x_m = np.concatenate([-half_m + from_end_m, [-0.35, 0.35], half_m - from_end_m[::-1]])
    width_share = np.array([0.8, 0.88, 0.935, 0.975, 0.995, 1.0, 1.0, 0.995, 0.975, 0.935, 0.88, 0.8])
    low_m = np.array([0.4, 0.33, 0.28, 0.25, 0.23, 0.22, 0.22, 0.23, 0.25, 0.27, 0.3, 0.36])

    foot_m = half_m - car.bonnet_m
    top_m = np.interp(x_m, [foot_m, half_m], [car.waist_m, car.nose_height_m])
    # The bonnet is rounded towards the nose, and the boot towards the tail.
    nose = np.clip((x_m - (half_m - 0.4)) / 0.4, 0, 1)
    tail = np.clip((-half_m + 0.3 - x_m) / 0.3, 0, 1)
    top_m = top_m - 0.07 * nose**2 - 0.08 * tail**2

    rings = []
    for x, share, low, top in zip(x_m, width_share, low_m, top_m, strict=True):
        half_width_m = share * car.width_m / 2
        sill = (0.93 * half_width_m, low)
        bulge = (half_width_m, low + 0.5 * (top - low))
        shoulder = (0.93 * half_width_m, top - 0.03)
        ridge = (0.0, top + 0.03)
        left_half = [sill, bulge, shoulder]
        right_half = [(-y, z) for y, z in left_half]
        ring = [*right_half, ridge, *left_half[::-1]]
        rings.append([(x, y, z) for y, z in ring])
    return np.array(rings)


def _facing(mesh: MeshArrays, direction: Sequence[float]) -> MeshArrays:
    """A mesh that is visible from a direction, or else the mesh with its faces turned."""
    a, b, c = mesh.corners_m.swapaxes(0, 1)
    area_vector = cross(b - a, c - a).sum(axis=0)
    return mesh if area_vector @ np.asarray(direction, float) > 0 else mesh.flipped()


def _end(ring_m: Array, side: float) -> MeshArrays:
    """The flat end of the body within a cross section (7, 3)."""
    count = len(ring_m)
    center_m = ring_m.mean(axis=0)
    vertices_m = np.concatenate([ring_m, center_m[None]])
    first = np.arange(count)
    second = (first + 1) % count
    middle = np.full(count, count)
    # Cross sections run clockwise as seen from the front, see `_sections`.
    order = [second, first, middle] if side > 0 else [first, second, middle]
    faces = np.column_stack(order)
    normals = np.tile([side, 0.0, 0.0], (count + 1, 1))
    return MeshArrays(vertices_m, faces, vertices_m[:, 1:], normals)


# --- Windows and roof ---


@dataclass(frozen=True, slots=True, eq=False)
class _BulgedSurface:
    """A slightly bulged surface between four corners (2, 2, 3): along u, then along v."""

    corners_m: Array
    bulge_m: float

    def part(self, u: tuple[float, float], v: tuple[float, float]) -> MeshArrays:
        """The part between two values of u and of v."""
        us = np.linspace(*u, CELLS + 1)[:, None]
        vs = np.linspace(*v, CELLS + 1)[None, :]
        weights = np.stack([(1 - us) * (1 - vs), (1 - us) * vs, us * (1 - vs), us * vs])  # bilinear
        flat_m = np.einsum("kuv,kj->uvj", weights, self.corners_m.reshape(4, 3))
        bulge_m = self.bulge_m * 16 * us * (1 - us) * vs * (1 - vs)  # 0 at the edges, largest in the middle
        return sheet_arrays(flat_m + bulge_m[..., None] * unit(_normal(self.corners_m)))

    def divided(self, u: Sequence[float], v: Sequence[float], is_glass: Array) -> tuple[MeshArrays, MeshArrays]:
        """The cells between the values of u and v that are not glass, and those that are."""
        frames = list[MeshArrays]()
        panes = list[MeshArrays]()
        for i, u_range in enumerate(pairwise(u)):
            for j, v_range in enumerate(pairwise(v)):
                cells = panes if is_glass[i, j] else frames
                cells.append(self.part(u_range, v_range))
        return joined_arrays(frames), joined_arrays(panes)


@dataclass(frozen=True, slots=True)
class _CabinEdges:
    """The places between which the windows stand: along x at the foot and at the roof, and across and upwards."""

    foot_front_m: float
    foot_rear_m: float
    roof_front_m: float
    roof_rear_m: float
    foot_y_m: float
    roof_y_m: float
    foot_z_m: float
    roof_z_m: float

    def screen_corners_m(self, foot_m: float, roof_m: float) -> Array:
        """The corners (2, 2, 3) of the windscreen or the rear window: from right to left, then upwards."""
        right = [[foot_m, -self.foot_y_m, self.foot_z_m], [roof_m, -self.roof_y_m, self.roof_z_m]]
        left = [[foot_m, self.foot_y_m, self.foot_z_m], [roof_m, self.roof_y_m, self.roof_z_m]]
        return np.array([right, left])

    def side_corners_m(self, side: int) -> Array:
        """The corners (2, 2, 3) of one side: from the rear to the front, then upwards."""
        foot_y_m = side * self.foot_y_m
        roof_y_m = side * self.roof_y_m
        rear = [[self.foot_rear_m, foot_y_m, self.foot_z_m], [self.roof_rear_m, roof_y_m, self.roof_z_m]]
        front = [[self.foot_front_m, foot_y_m, self.foot_z_m], [self.roof_front_m, roof_y_m, self.roof_z_m]]
        return np.array([rear, front])

    def roof_corners_m(self) -> Array:
        """The corners (2, 2, 3) of the roof: from the rear to the front, then from right to left."""
        rear = [[self.roof_rear_m, -self.roof_y_m, self.roof_z_m], [self.roof_rear_m, self.roof_y_m, self.roof_z_m]]
        front = [[self.roof_front_m, -self.roof_y_m, self.roof_z_m], [self.roof_front_m, self.roof_y_m, self.roof_z_m]]
        return np.array([rear, front])


def _cabin_edges(car: CarShape) -> _CabinEdges:
    half_m = car.length_m / 2
    foot_front_m = half_m - car.bonnet_m
    foot_rear_m = -half_m + car.tail_m
    return _CabinEdges(
        foot_front_m=foot_front_m,
        foot_rear_m=foot_rear_m,
        roof_front_m=foot_front_m - car.screen_m,
        roof_rear_m=foot_rear_m + car.rear_m,
        foot_y_m=0.9 * car.width_m / 2,
        roof_y_m=car.roof_share * car.width_m / 2,
        foot_z_m=car.waist_m - 0.03,
        roof_z_m=car.height_m - 0.05,
    )


def _cabin(car: CarShape, paint: Material) -> list[Part]:
    """Windscreen, rear window and side windows in frames of the body's colour, and the roof."""
    edges = _cabin_edges(car)
    frames = list[MeshArrays]()
    panes = list[MeshArrays]()

    has_pane = np.zeros((3, 3), bool)
    has_pane[1, 1] = True
    has_rear_pane = np.zeros((3, 3), bool)
    has_rear_pane[1, 1] = car.has_rear_glass
    windscreen_m = edges.screen_corners_m(edges.foot_front_m, edges.roof_front_m)
    rear_window_m = edges.screen_corners_m(edges.foot_rear_m, edges.roof_rear_m)
    for corners_m, is_glass, outward in (
        (windscreen_m, has_pane, (1.0, 0, 0.3)),
        (rear_window_m, has_rear_pane, (-1.0, 0, 0.3)),
    ):
        surface = _bulged_surface(corners_m, 0.05, outward)
        frame, pane = surface.divided(SCREEN_CUTS_U, SCREEN_CUTS_V, is_glass)
        frames.append(_facing(frame, outward))
        if is_glass.any():
            panes.append(_facing(pane, outward))

    has_side_panes = np.zeros((5, 3), bool)
    has_side_panes[1, 1] = car.has_rear_glass
    has_side_panes[3, 1] = True
    for side in SIDES:
        outward = (0, side, 0)
        surface = _bulged_surface(edges.side_corners_m(side), 0.02, outward)
        frame, pane = surface.divided(SIDE_CUTS_U, SIDE_CUTS_V, has_side_panes)
        frames.append(_facing(frame, outward))
        panes.append(_facing(pane, outward))

    upwards = (0, 0, 1)
    roof = _bulged_surface(edges.roof_corners_m(), 0.05, upwards).part((0, 1), (0, 1))
    frames.append(_facing(roof, upwards))
    return [Part(joined_arrays(frames), paint), Part(joined_arrays(panes), GLASS)]


def _bulged_surface(corners_m: Array, bulge_m: float, outward: Sequence[float]) -> _BulgedSurface:
    """A patch that bulges outwards."""
    is_outward = _normal(corners_m) @ np.asarray(outward, float) > 0
    return _BulgedSurface(corners_m, bulge_m if is_outward else -bulge_m)


def _normal(corners_m: Array) -> Array:
    """A normal (3,) of a patch with corners (2, 2, 3), not of unit length."""
    along_u = corners_m[1, 0] - corners_m[0, 0]
    along_v = corners_m[0, 1] - corners_m[0, 0]
    return cross(along_u, along_v)


# --- What is fixed to the body ---


@cache
def _wheel() -> tuple[Part, ...]:
    """A wheel whose axis is z, with its outer side up at z = 0."""
    tyre = lathe(TYRE_PROFILE_M, sections=16)
    rim = lathe(RIM_PROFILE_M, sections=16)
    spoke = put(block_arrays((0.15, 0.05, 0.014), bevel_m=0.004), GREY, 0.12, 0, -0.006)
    spokes = []
    for number in range(SPOKES):
        yaw_deg = 360.0 / SPOKES * number
        spokes.append(spoke.moved(at(yaw=yaw_deg)).arrays)
    return (Part(tyre, RUBBER), Part(rim, RIM), Part(joined_arrays(spokes), GREY))


def _wheels(car: CarShape, side: int) -> list[Part]:
    """The front and the rear wheel of one side, each in its arch."""
    arch = lathe([[0, -0.22], [0.36, -0.22], [0.36, 0.0], [0, 0.0]], sections=16)
    parts = []
    for x_m in car.wheels_x_m:
        parts.append(put(arch, BLACK, x_m, side * (car.width_m / 2 + 0.003), 0.37, roll=-90 * side))
        T_car_wheel = at(x_m, side * (car.width_m / 2 + 0.013), TYRE_RADIUS_M, roll=-90 * side)
        parts += [part.moved(T_car_wheel) for part in _wheel()]
    return parts


def _side_fittings(car: CarShape, paint: Material, side: int) -> list[Part]:
    """Mirror, door gaps and handles, and the lamps of one side."""
    half_width_m = car.width_m / 2
    y_m = side * half_width_m
    foot_m = car.length_m / 2 - car.bonnet_m
    front_gap_m = foot_m - 0.12
    rear_gap_m = foot_m - 0.12 - 1.05
    handle_z_m = car.waist_m - 0.12
    mirror = cushion((0.11, 0.2, 0.13), power=4, cells=4)
    gap = block_arrays((SEAM_M, 0.012, car.waist_m - 0.34), bevel_m=0)
    gap_z_m = 0.22 + (car.waist_m - 0.22) / 2
    handle = block_arrays((0.16, 0.02, 0.026), bevel_m=0.006)
    parts = [
        put(mirror, paint, foot_m - 0.32, side * (half_width_m + 0.09), car.waist_m + 0.06),
        put(gap, BLACK, front_gap_m, 0.994 * y_m, gap_z_m),
        put(gap, BLACK, rear_gap_m, 0.994 * y_m, gap_z_m),
        put(handle, CHROME, rear_gap_m + 0.14, 0.992 * y_m, handle_z_m),
        *_lamps(car, side),
    ]
    if car.doors > 1:
        parts.append(put(handle, CHROME, rear_gap_m - 0.8, 0.99 * y_m, handle_z_m))
    return parts


def _lamps(car: CarShape, side: int) -> list[Part]:
    """Headlamp, rear lamp and indicator of one side."""
    half_m = car.length_m / 2
    half_width_m = car.width_m / 2
    rear_lamp_m = 0.2 if car.tail_m < 0.3 else 0.13  # its height; a boot leaves less room
    headlamp = block_arrays((0.3, 0.36, 0.13), bevel_m=0.03)
    rear_lamp = block_arrays((0.1, 0.3, rear_lamp_m), bevel_m=0.02)
    indicator = block_arrays((0.03, 0.14, 0.03), bevel_m=0)
    headlamp_y_m = side * (0.92 * half_width_m - 0.2)
    rear_lamp_y_m = side * (0.8 * half_width_m - 0.1)
    return [
        put(headlamp, HEADLAMP, half_m - 0.2, headlamp_y_m, car.nose_height_m - 0.1, yaw=-side * 16.0),
        put(rear_lamp, REAR_LAMP, -half_m + 0.035, rear_lamp_y_m, car.waist_m - 0.2, yaw=side * 12.0),
        put(indicator, INDICATOR, half_m + 0.002, side * 0.55, 0.5),
    ]


def _ends(car: CarShape, number: str) -> list[Part]:
    """Grille, lower bumpers and number plates."""
    half_m = car.length_m / 2
    plate = card_arrays((0.48, 0.11))
    look = matt(texture=picture.sign(number))
    grille_m = (0.03, 0.62 * car.width_m, 0.1)
    intake_m = (0.03, 0.56 * car.width_m, 0.1)
    return [
        stood(grille_m, BLACK, half_m - 0.005, z=car.nose_height_m - 0.2, bevel=0.01),
        stood(intake_m, BLACK, half_m - 0.005, z=0.36, bevel=0.01),
        stood((0.04, 0.7 * car.width_m, 0.09), DARK, -half_m + 0.005, z=0.37, bevel=0.015),
        put(plate, look, half_m + 0.013, 0, 0.52),
        put(plate, look, -half_m - 0.02, 0, 0.62, yaw=180),
    ]
