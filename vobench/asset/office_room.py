"""Furnishes the rooms of an office by their use."""

from collections.abc import Callable

from vobench.asset import bedroom, display, fitting, furniture, household, office
from vobench.asset.furnishing import add_armchair, add_cartons, add_dining_table, add_floor_plant, add_shelf
from vobench.asset.kitchen_place import add_kitchen_row
from vobench.asset.palette import Style
from vobench.asset.picture import one_of
from vobench.asset.room_layout import GAP_M, RoomLayout
from vobench.asset.spot import Spot
from vobench.asset.tabletop import TABLE_HEIGHT_M, add_tabletop_items
from vobench.asset.wall_decoration import add_pictures, add_sockets, framed_print
from vobench.asset.workstation import add_desk_blocks, add_wall_workstation
from vobench.scene.material import Material

# Storage
CABINET_DEPTH_M = 0.45
LOW_CABINET_M = 1.3  # lower cabinets have things on top
COATS_M = 0.2  # from the wall to the outside of coats on hooks
COAT_RACK_M = 1.1  # width

# Meeting rooms
SEAT_PITCH_M = 0.72  # of table for each seat
MEETING_TABLE_M = 1.15  # width
MEETING_CHAIR_M = 0.5  # of floor that a chair occupies beyond the edge of the table
MEETING_SEATS = (5, 4, 3, 2)  # along each side of the table, in the order in which they are tried
CHEST_HEIGHT_M = 0.7
TELEVISION_M = 1.2  # width
POSTER_SEEDS = 8  # pictures on televisions

# Rooms
SECOND_DESK_M2 = 13.0  # cells that are larger have a second desk
PANTRY_TABLE_M2 = 9.0  # pantries that are larger have a table for four, if it fits


# --- Storage ---


def _add_cabinet(layout: RoomLayout, style: Style) -> None:
    """Add a steel cabinet, with things on top if it is low."""
    rng = layout.rng
    width_m = float(rng.choice([0.8, 0.9, 1.0]))
    height_m = float(rng.choice([0.78, 1.2, 1.9]))
    cabinet = layout.add_at_wall(
        "cabinet",
        furniture.cabinet,
        (0.5, width_m + 0.02, height_m),
        back_m=CABINET_DEPTH_M / 2,
        width_m=width_m,
        depth_m=CABINET_DEPTH_M,
        height_m=height_m,
        colour=one_of(rng, "#8b9493", "#c9cac6", "#5b6b5d", style.kitchen.fronts),
    )
    if cabinet is not None and height_m < LOW_CABINET_M:
        name, spot = cabinet
        items = ("plant", "box", "books", "papers")
        add_tabletop_items(layout, name, spot, items, x_m=GAP_M + 0.22, width_m=width_m - 0.1, z_m=height_m)


def _add_copier(layout: RoomLayout) -> None:
    layout.add_at_wall("copier", office.copier, (0.68, 0.62, 1.06), back_m=0.31)


def _add_coat_stand(layout: RoomLayout) -> None:
    layout.add_at_wall("coat_stand", office.coat_stand, (0.5, 0.5, 1.8), back_m=0.25, front_m=0.0, in_corner=True)


def _add_coat_rack(layout: RoomLayout, style: Style) -> None:
    """Add a rack with coats to a wall."""
    spot = layout.add_on_wall(
        "coat_rack",
        bedroom.coat_rack,
        (COAT_RACK_M + 0.24, 1.3),
        middle_m=1.22,
        width_m=COAT_RACK_M,
        tones=style.tones,
    )
    if spot is not None:
        layout.floor.occupy(spot.footprint(COATS_M, COAT_RACK_M + 0.2), 1.8)


def _add_bin(layout: RoomLayout) -> None:
    layout.add_at_wall(
        "bin",
        furniture.waste_bin,
        (0.32, 0.32, 0.4),
        back_m=0.16,
        front_m=0.0,
        in_corner=True,
        width_m=0.28,
        height_m=0.34,
    )


# --- Walls ---


def _decorate_walls(layout: RoomLayout, style: Style, posters: int) -> None:
    """Add a whiteboard and a notice board to some rooms, and posters and sockets to all."""
    rng = layout.rng
    if layout.chance(0.75):
        layout.add_on_wall(
            "whiteboard",
            fitting.framed,
            (1.5, 1.0),
            middle_m=1.5,
            style="whiteboard",
            seed=int(rng.integers(3)),
            width_m=1.4,
            height_m=0.9,
            frame="#a4a7a6",
        )
    if layout.chance(0.45):
        layout.add_on_wall("noticeboard", fitting.noticeboard, (1.05, 0.8), middle_m=1.55, width_m=0.95, height_m=0.7)
    for _ in range(posters):
        _add_poster(layout, style)
    add_sockets(layout, 2)


def _add_poster(layout: RoomLayout, style: Style) -> None:
    rng = layout.rng
    kind = one_of(rng, "talk", "circles", "hills")
    width_m, height_m = (0.84, 1.18) if kind == "talk" else (0.6, 0.85)
    layout.add_on_wall(
        "picture",
        framed_print,
        (width_m, height_m),
        middle_m=1.6,
        style=kind,
        seed=style.prints[int(rng.integers(len(style.prints)))],
        width_m=width_m,
        height_m=height_m,
        frame=style.frame,
    )


# --- Open areas and cells ---


def _furnish_open(layout: RoomLayout, style: Style, top: Material) -> None:
    rng = layout.rng
    desk_count = add_desk_blocks(layout, style, top)
    if desk_count == 0:
        add_wall_workstation(layout, style, top)
    for _ in range(int(rng.integers(1, 4))):
        _add_cabinet(layout, style)
    for _ in range(int(rng.integers(1, 3))):
        add_shelf(layout, style, (1.0, 1.6, 2.0))
    _add_copier(layout)
    if layout.chance(0.5):
        _add_coat_stand(layout)
    if layout.chance(0.6):
        _add_visitor_seats(layout, style)
    for _ in range(int(rng.integers(2, 5))):
        add_floor_plant(layout)
    _add_bin(layout)
    _decorate_walls(layout, style, int(rng.integers(2, 5)))


def _add_visitor_seats(layout: RoomLayout, style: Style) -> None:
    """Add a sofa or two armchairs for visitors."""
    if layout.chance(0.5):
        layout.add_at_wall(
            "sofa",
            household.couch,
            (0.92, 1.8, 0.8),
            back_m=0.46,
            front_m=0.7,
            width_m=1.8,
            colour=style.cover,
            tones=style.tones,
        )
    else:
        add_armchair(layout, style)
        add_armchair(layout, style)


def _furnish_cell(layout: RoomLayout, style: Style, top: Material) -> None:
    rng = layout.rng
    add_wall_workstation(layout, style, top)
    if layout.room.rect.area_m2 > SECOND_DESK_M2 or layout.chance(0.4):
        add_wall_workstation(layout, style, top)
    add_shelf(layout, style)
    if layout.chance(0.6):
        _add_cabinet(layout, style)
    if layout.chance(0.3):
        add_armchair(layout, style)
    if layout.chance(0.4):
        _add_coat_stand(layout)
    if layout.chance(0.3):
        add_cartons(layout)
    if layout.chance(0.7):
        add_floor_plant(layout)
    _decorate_walls(layout, style, int(rng.integers(0, 3)))


# --- Meeting rooms ---


def _furnish_meeting(layout: RoomLayout, style: Style, top: Material) -> None:
    _add_meeting_table(layout, style, top)
    _add_television(layout, style)
    if layout.chance(0.7):
        add_floor_plant(layout)
    _decorate_walls(layout, style, 1)


def _add_meeting_table(layout: RoomLayout, style: Style, top: Material) -> None:
    """Add a table with chairs at its long sides, as long a one as fits."""
    for seats in MEETING_SEATS:
        length_m = SEAT_PITCH_M * seats + 0.2
        spot = layout.free_spot_on_floor(MEETING_TABLE_M + 2 * MEETING_CHAIR_M, length_m)
        if spot is None:
            continue
        table = layout.add(
            "meeting_table",
            office.meeting_table,
            spot.point(0),
            yaw_deg=spot.yaw_deg,
            length_m=length_m,
            width_m=MEETING_TABLE_M,
            look=top,
        )
        half_m = MEETING_TABLE_M / 2 + MEETING_CHAIR_M
        layout.floor.occupy(spot.rectangle(-half_m, half_m, -length_m / 2, length_m / 2), TABLE_HEIGHT_M)
        _add_meeting_chairs(layout, style, table, spot, seats)
        items = ("papers", "mug", "bottle", "plant")
        add_tabletop_items(layout, table, spot, items, x_m=0.0, width_m=length_m - 0.4, z_m=TABLE_HEIGHT_M)
        return


def _add_meeting_chairs(layout: RoomLayout, style: Style, table: str, spot: Spot, seats: int) -> None:
    """Add a number of chairs at each long side of a table. They are close together, so their boxes may overlap."""
    rng = layout.rng
    for sign in (-1, 1):
        for seat in range(seats):
            y_m = (seat - (seats - 1) / 2) * SEAT_PITCH_M
            turn_deg = (180.0 if sign > 0 else 0.0) + float(rng.normal(0, 8))
            from_edge_m = float(rng.uniform(0.05, 0.16))
            x_m = sign * (MEETING_TABLE_M / 2 + from_edge_m)
            chairs = (piece.name for piece in layout.placed if ".chair_" in piece.name)
            layout.add(
                "chair",
                office.task_chair,
                spot.point(x_m, y_m),
                yaw_deg=spot.yaw_deg + turn_deg,
                may_overlap=(table, *chairs),
                colour=style.cloths[1],
            )


def _add_television(layout: RoomLayout, style: Style) -> None:
    """Add a chest with a television on it."""
    chest = layout.add_at_wall(
        "sideboard",
        household.low_board,
        (0.46, 1.5, 1.4),
        back_m=0.216,
        front_m=0.5,
        width_m=1.5,
        height_m=CHEST_HEIGHT_M,
        tones=style.second_tones,
    )
    if chest is None:
        return
    name, spot = chest
    layout.add(
        "television",
        display.television,
        spot.point(GAP_M + 0.2),
        CHEST_HEIGHT_M,
        yaw_deg=spot.yaw_deg,
        support=name,
        width_m=TELEVISION_M,
        seed=int(layout.rng.integers(POSTER_SEEDS)),
    )


# --- Pantries and halls ---


def _furnish_pantry(layout: RoomLayout, style: Style, _: Material) -> None:
    add_kitchen_row(layout, style)
    has_table = layout.room.rect.area_m2 > PANTRY_TABLE_M2 and add_dining_table(layout, style, 4)
    if not has_table:
        add_dining_table(layout, style, 2)
    _add_bin(layout)
    if layout.chance(0.5):
        add_floor_plant(layout)
    add_pictures(layout, style, 2)
    add_sockets(layout, 1)


def _furnish_hall(layout: RoomLayout, style: Style, _: Material) -> None:
    rng = layout.rng
    for _number in range(int(rng.integers(1, 3))):
        _add_cabinet(layout, style)
    if layout.chance(0.6):
        _add_copier(layout)
    if layout.chance(0.5):
        _add_coat_rack(layout, style)
    for _number in range(int(rng.integers(1, 3))):
        add_floor_plant(layout)
    _decorate_walls(layout, style, int(rng.integers(2, 5)))


FURNISH: dict[str, Callable[[RoomLayout, Style, Material], None]] = {
    "open": _furnish_open,
    "cell": _furnish_cell,
    "meeting": _furnish_meeting,
    "pantry": _furnish_pantry,
    "hall": _furnish_hall,
}
"""How a room of each use is furnished: functions of its layout, the style, and the material of desk tops."""
