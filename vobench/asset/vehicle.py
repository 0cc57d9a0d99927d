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
        half = [
            (0.93 * half_width_m, low),
            (half_width_m, low + 0.5 * (top - low)),
            (0.93 * half_width_m, top - 0.03),
        ]
        ring = [(-y, z) for y, z in half] + [(0.0, top + 0.03)] + half[::-1]
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
    faces = np.column_stack([first, second, np.full(count, count)])
    normals = np.tile([side, 0.0, 0.0], (count + 1, 1))
    return _facing(MeshArrays(vertices_m, faces, vertices_m[:, 1:], normals), (side, 0, 0))


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
        c = self.corners_m
        weights = np.stack([(1 - us) * (1 - vs), (1 - us) * vs, us * (1 - vs), us * vs])
        flat_m = np.einsum("kuv,kj->uvj", weights, c.reshape(4, 3))
        normal = unit(cross(c[1, 0] - c[0, 0], c[0, 1] - c[0, 0]))
        bulge = self.bulge_m * 16 * us * (1 - us) * vs * (1 - vs)
        return sheet_arrays(flat_m + bulge[..., None] * normal)

    def divided(self, u: Sequence[float], v: Sequence[float], is_glass: Array) -> tuple[MeshArrays, MeshArrays]:
        """The cells between the values of u and v that are not glass, and those that are."""
        frames = list[MeshArrays]()
        panes = list[MeshArrays]()
        for i, u_range in enumerate(pairwise(u)):
            for j, v_range in enumerate(pairwise(v)):
                cells = panes if is_glass[i, j] else frames
                cells.append(self.part(u_range, v_range))
        return joined_arrays(frames), joined_arrays(panes)


def _cabin(car: CarShape, paint: Material) -> list[Part]:
    """Windscreen, rear window and side windows in frames of the body's colour, and the roof."""
    half_m = car.length_m / 2
    foot_front_m = half_m - car.bonnet_m
    foot_rear_m = -half_m + car.tail_m
    roof_front_m = foot_front_m - car.screen_m
    roof_rear_m = foot_rear_m + car.rear_m
    base_y = 0.9 * car.width_m / 2
    roof_y = car.roof_share * car.width_m / 2
    base_z = car.waist_m - 0.03
    roof_z = car.height_m - 0.05

    paint_meshes = []
    glass_meshes = []
    for foot_m, roof_m, direction, has_glass in (
        (foot_front_m, roof_front_m, 1.0, True),
        (foot_rear_m, roof_rear_m, -1.0, car.has_rear_glass),
    ):
        corners = np.array(
            [
                [[foot_m, -base_y, base_z], [roof_m, -roof_y, roof_z]],
                [[foot_m, base_y, base_z], [roof_m, roof_y, roof_z]],
            ]
        )
        is_glass = np.zeros((3, 3), bool)
        is_glass[1, 1] = has_glass
        frames, panes = _bulged_surface(corners, 0.05, (direction, 0, 0.3)).divided(
            (0, 0.06, 0.94, 1), (0, 0.09, 0.93, 1), is_glass
        )
        paint_meshes.append(_facing(frames, (direction, 0, 0.3)))
        if has_glass:
            glass_meshes.append(_facing(panes, (direction, 0, 0.3)))

    for side in SIDES:
        corners = np.array(
            [
                [[foot_rear_m, side * base_y, base_z], [roof_rear_m, side * roof_y, roof_z]],
                [[foot_front_m, side * base_y, base_z], [roof_front_m, side * roof_y, roof_z]],
            ]
        )
        patch = _bulged_surface(corners, 0.02, (0, side, 0))
        cuts_u = (0.0, 0.13, 0.53, 0.57, 0.93, 1.0)
        is_glass = np.zeros((5, 3), bool)
        is_glass[[1, 3], 1] = [car.has_rear_glass, True]
        frames, panes = patch.divided(cuts_u, (0, 0.08, 0.88, 1), is_glass)
        paint_meshes.append(_facing(frames, (0, side, 0)))
        glass_meshes.append(_facing(panes, (0, side, 0)))

    roof_corners = np.array(
        [
            [[roof_rear_m, -roof_y, roof_z], [roof_rear_m, roof_y, roof_z]],
            [[roof_front_m, -roof_y, roof_z], [roof_front_m, roof_y, roof_z]],
        ]
    )
    roof = _bulged_surface(roof_corners, 0.05, (0, 0, 1)).part((0, 1), (0, 1))
    paint_meshes.append(_facing(roof, (0, 0, 1)))
    return [Part(joined_arrays(paint_meshes), paint), Part(joined_arrays(glass_meshes), GLASS)]


def _bulged_surface(corners_m: Array, bulge_m: float, outward: Sequence[float]) -> _BulgedSurface:
    """A patch that bulges outwards."""
    normal = cross(corners_m[1, 0] - corners_m[0, 0], corners_m[0, 1] - corners_m[0, 0])
    sign = 1.0 if normal @ np.asarray(outward, float) > 0 else -1.0
    return _BulgedSurface(corners_m, sign * bulge_m)


# --- What is fixed to the body ---


@cache
def _wheel() -> tuple[Part, ...]:
    """A wheel whose axis is z, with its outer side up at z = 0."""
    r = TYRE_RADIUS_M
    tyre = lathe(
        [
            [0, -0.2],
            [0.2, -0.2],
            [r - 0.03, -0.19],
            [r, -0.17],
            [r, -0.03],
            [r - 0.02, -0.005],
            [0.225, 0],
            [0.22, -0.07],
            [0, -0.07],
        ],
        sections=16,
    )
    rim = lathe([[0, -0.02], [0.222, -0.02], [0.224, -0.002], [0.2, -0.003], [0.195, -0.009], [0, -0.009]], sections=16)
    spokes = []
    for angle_deg in 72.0 * np.arange(5):
        spoke = block_arrays((0.15, 0.05, 0.014), bevel_m=0.004)
        radial = put(spoke, GREY, 0.12, 0, -0.006)
        spokes.append(radial.moved(at(yaw=float(angle_deg))).arrays)
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
    half_m = car.length_m / 2
    foot_m = half_m - car.bonnet_m
    y_m = side * car.width_m / 2
    middle_z = 0.22 + (car.waist_m - 0.22) / 2
    gap = block_arrays((SEAM_M, 0.012, car.waist_m - 0.34), bevel_m=0)
    handle = block_arrays((0.16, 0.02, 0.026), bevel_m=0.006)
    mirror = cushion((0.11, 0.2, 0.13), power=4, cells=4)
    door_m = foot_m - 0.12 - 1.05
    lamp = block_arrays((0.3, 0.36, 0.13), bevel_m=0.03)
    rear = block_arrays((0.1, 0.3, 0.2 if car.tail_m < 0.3 else 0.13), bevel_m=0.02)
    parts = [
        put(mirror, paint, foot_m - 0.32, side * (car.width_m / 2 + 0.09), car.waist_m + 0.06),
        *(put(gap, BLACK, x_m, 0.994 * y_m, middle_z) for x_m in (foot_m - 0.12, door_m)),
        put(handle, CHROME, door_m + 0.14, 0.992 * y_m, car.waist_m - 0.12),
        put(
            lamp,
            HEADLAMP,
            half_m - 0.2,
            side * (0.92 * car.width_m / 2 - 0.2),
            car.nose_height_m - 0.1,
            yaw=-side * 16.0,
        ),
        put(rear, REAR_LAMP, -half_m + 0.035, side * (0.8 * car.width_m / 2 - 0.1), car.waist_m - 0.2, yaw=side * 12.0),
        put(block_arrays((0.03, 0.14, 0.03), bevel_m=0), INDICATOR, half_m + 0.002, side * 0.55, 0.5),
    ]
    if car.doors > 1:
        parts.append(put(handle, CHROME, door_m - 0.8, 0.99 * y_m, car.waist_m - 0.12))
    return parts


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
