"""Street furniture: traffic signs, cable cabinets, and hoops with bicycles. They stand on z = 0 at the origin."""

import numpy as np

from vobench.asset import picture
from vobench.asset.furniture import BLACK, DARK, SIDES, STEEL, Part, coated, matt, put, stood
from vobench.asset.picture import NAVY, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays, tube
from vobench.asset.vehicle import RUBBER
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

SIGN_RED = "#b3241c"
SIGN_GREEN = "#2f4a36"
# Text and colour of each sign
SIGNS = (
    ("30", SIGN_RED),
    ("P", NAVY),
    ("ZONE", NAVY),
    ("ONE WAY", NAVY),
    ("TAXI", SIGN_GREEN),
    ("NO ENTRY", SIGN_RED),
)
SIGN_POLE_M = 2.7
SIGN_M = 2.4  # height of the middle of the plate

CABINET_PAINTS = ("#4c5a50", "#8d9092", "#6d6a62")

BICYCLE_PAINTS = ("#8d1f1c", "#20334e", "#17191b", "#3f6c87", "#d9dad7")
BICYCLE_TO_HOOP_M = 0.19
WHEEL_RADIUS_M = 0.33  # to the middle of the tyre
TYRE_RADIUS_M = 0.015  # of the tyre's cross-section
HUB_M = 0.345  # height of the hubs: the tyres touch the ground
WHEELS_X_M = (-0.52, 0.52)
SPOKE_M = 0.32
SPOKE_ANGLES_DEG = np.arange(0, 180, 30)


def traffic_sign(rng: Rng) -> list[Part]:
    """One of SIGNS on a pole, to be read from both sides along x."""
    text, colour = SIGNS[int(rng.integers(len(SIGNS)))]
    face = matt(texture=picture.sign(text, colour))
    pole = tube(np.array([[0, 0, 0], [0, 0, SIGN_POLE_M]]), 0.03)
    plate = block_arrays((0.06, 0.63, 0.32), bevel_m=0.004)
    parts = [put(pole, STEEL), put(plate, STEEL, z=SIGN_M)]
    for side in SIDES:
        card = card_arrays((0.62, 0.31))
        yaw_deg = 90 * (1 - side)  # 0 on the front, 180 on the back
        parts.append(put(card, face, side * 0.034, z=SIGN_M, yaw=yaw_deg))
    return parts


def cable_cabinet(rng: Rng) -> list[Part]:
    """A cabinet of a telephone company: a body, a lid that projects, and the gap between its doors."""
    paint = coated(one_of(rng, *CABINET_PAINTS), roughness=0.4)
    body = stood((0.4, 0.9, 1.15), paint, bevel=0.015)
    lid = stood((0.46, 0.96, 0.05), paint, z=1.15, bevel=0.01)
    gap_of_doors = stood((0.41, 0.01, 1.0), DARK, z=0.08, bevel=0)
    return [body, lid, gap_of_doors]


def bicycle_hoop(rng: Rng) -> list[Part]:
    """Two bicycles at a hoop, side by side along x."""
    hoop = tube([[-0.3, 0, 0], [-0.3, 0, 0.75], [0.3, 0, 0.75], [0.3, 0, 0]], 0.024)
    parts = [put(hoop, STEEL)]
    for side in SIDES:
        paint = coated(one_of(rng, *BICYCLE_PAINTS), roughness=0.2)
        T_hoop_bicycle = at(0.0, side * BICYCLE_TO_HOOP_M)
        parts += [part.moved(T_hoop_bicycle) for part in _bicycle(paint)]
    return parts


def _bicycle(paint: Material) -> list[Part]:
    """A bicycle along x: tyres, spokes, frame and saddle."""
    saddle = block_arrays((0.26, 0.14, 0.05), bevel_m=0.02)
    return [
        Part(_tyres(), RUBBER),
        Part(_spokes(), STEEL),
        Part(_bicycle_frame(), paint),
        put(saddle, BLACK, -0.21, 0, 0.93),
    ]


def _tyres() -> MeshArrays:
    """The tyres of both wheels."""
    angles_rad = np.linspace(0, 2 * np.pi, 25)
    x_m = WHEEL_RADIUS_M * np.cos(angles_rad)
    y_m = np.zeros_like(angles_rad)
    z_m = WHEEL_RADIUS_M * np.sin(angles_rad) + HUB_M
    circle_m = np.column_stack([x_m, y_m, z_m])
    tyres = []
    for wheel_x_m in WHEELS_X_M:
        tyre = tube(circle_m + np.array([wheel_x_m, 0, 0]), TYRE_RADIUS_M, sections=5)
        tyres.append(as_arrays(tyre))
    return joined_arrays(tyres)


def _spokes() -> MeshArrays:
    """The spokes of both wheels. Each runs through the hub, from rim to rim."""
    spokes = []
    for wheel_x_m in WHEELS_X_M:
        hub_m = np.array([wheel_x_m, 0, HUB_M])
        for angle_rad in np.deg2rad(SPOKE_ANGLES_DEG):
            to_rim_m = SPOKE_M * np.array([np.cos(angle_rad), 0, np.sin(angle_rad)])
            spoke = tube(np.stack([hub_m - to_rim_m, hub_m + to_rim_m]), 0.002, sections=3)
            spokes.append(as_arrays(spoke))
    return joined_arrays(spokes)


def _bicycle_frame() -> MeshArrays:
    """The tubes of the frame, the fork and the handlebar."""
    rear_hub = (-0.52, 0, HUB_M)
    front_hub = (0.52, 0, HUB_M)
    crank = (-0.08, 0, 0.32)
    seat = (-0.17, 0, 0.78)
    saddle = (-0.2, 0, 0.9)
    head = (0.34, 0, 0.85)
    lower_head = (0.36, 0, 0.8)
    stem = (0.33, 0, 1.0)
    right_grip = (0.33, -0.26, 1.0)
    left_grip = (0.33, 0.26, 1.0)
    lines_m = (
        (rear_hub, crank),
        (crank, saddle),
        (rear_hub, seat),
        (crank, lower_head),
        (seat, head),
        (front_hub, stem),
        (right_grip, left_grip),
    )
    tubes = []
    for start_m, end_m in lines_m:
        frame_tube = tube([start_m, end_m], 0.017, sections=6)
        tubes.append(as_arrays(frame_tube))
    return joined_arrays(tubes)
