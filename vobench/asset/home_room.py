"""Furnishes the rooms of a home by their use."""

from collections.abc import Callable

from vobench.asset import bathroom, bedroom, fitting, furnishing, furniture, household
from vobench.asset.bed_place import add_bed
from vobench.asset.living_room import furnish_living_room
from vobench.asset.palette import Style
from vobench.asset.picture import one_of
from vobench.asset.room_layout import GAP_M, WALL, RoomLayout, Spot

BATH_CLOTHS = ("#8fb3c7", "#d8c3a0", "#b4533a", "#8a9a7b", "#e6e1d6", "#6b4353", "#3d7a7c")


def _furnish_kitchen(layout: RoomLayout, style: Style) -> None:
    row = furnishing.kitchen_row(layout, style)
    if row is not None:
        seats = 4 if layout.room.rect.area_m2 > 10.5 else 2
        table = furnishing.dining_table(layout, style, seats)
        if not table:
            furnishing.dining_table(layout, style, 2)
    if layout.chance(0.25):
        _add_bin(layout, 0.32, 0.42, back_m=0.16, width_m=0.28, height_m=0.38)
    if layout.chance(0.35):
        furnishing.floor_plant(layout)
    _finish_walls(layout, style)


def _add_bin(
    layout: RoomLayout, space_m: float, space_height_m: float, *, back_m: float, width_m: float, height_m: float
) -> None:
    """Add a bin in a corner, in a square space of a width and height."""
    layout.stand(
        "bin",
        furniture.waste_bin,
        (space_m, space_m, space_height_m),
        back_m=back_m,
        front_m=0.0,
        in_corner=True,
        width_m=width_m,
        height_m=height_m,
    )


def _finish_walls(layout: RoomLayout, style: Style, *, above: Spot | None = None) -> None:
    """Add one or two pictures, where there is space above a spot, and a socket."""
    count = int(layout.rng.integers(1, 3))
    furnishing.pictures(layout, style, count, [above] if above else [])
    furnishing.sockets(layout, 1)


# --- Bedrooms ---


def _furnish_bedroom(layout: RoomLayout, style: Style) -> None:
    is_large = layout.room.rect.area_m2 > 11
    bed_spot = add_bed(layout, style, (1.6, 1.4, 1.8) if is_large else (1.4, 0.9, 1.2))
    _add_wardrobe(layout, style)
    if layout.chance(0.55):
        furnishing.sideboard(layout, style)
    if layout.chance(0.45):
        furnishing.desk(layout, style)
    if layout.chance(0.4):
        furnishing.shelf(layout, style, (0.8, 1.0))
    if layout.chance(0.3):
        furnishing.armchair(layout, style)
    if layout.chance(0.5):
        _add_loose_rug(layout, style)
    if layout.chance(0.6):
        furnishing.floor_plant(layout)
    if layout.chance(0.4):
        layout.hang("mirror", fitting.framed, (0.5, 1.4), middle_m=1.05, style="mirror", width_m=0.5, height_m=1.4)
    _finish_walls(layout, style, above=bed_spot)


def _add_wardrobe(layout: RoomLayout, style: Style) -> None:
    """Add a wardrobe, or a narrow one if there is no space for the chosen width."""
    chosen_m = float(layout.rng.choice([1.0, 1.5, 1.9, 2.4]))
    for width_m in (chosen_m, 1.0):
        colour = one_of(layout.rng, "#e4e0d6", "#dcdbd6", style.kitchen.fronts) if style.is_painted else ""
        wardrobe = layout.stand(
            "wardrobe",
            bedroom.wardrobe,
            (0.66, width_m + 0.02, 2.34),
            front_m=0.55,
            in_corner=True,
            width_m=width_m,
            colour=colour,
            tones=style.tones,
        )
        if wardrobe is not None:
            return


def _add_loose_rug(layout: RoomLayout, style: Style) -> None:
    """Add a rug where the floor is free."""
    rng = layout.rng
    width_m = float(rng.uniform(1.2, 1.7))
    depth_m = float(rng.uniform(0.7, 1.1))
    spot = layout.open_spot(depth_m, width_m)
    if spot is not None:
        layout.add(
            "rug",
            furnishing.rug,
            spot.at(0),
            yaw_deg=spot.yaw_deg,
            width_m=width_m,
            depth_m=depth_m,
            seed=style.rugs[1],
        )


# --- Studies ---


def _furnish_study(layout: RoomLayout, style: Style) -> None:
    desk_spot = furnishing.desk(layout, style)
    for _ in range(int(layout.rng.integers(1, 3))):
        furnishing.shelf(layout, style)
    if layout.chance(0.5):
        furnishing.armchair(layout, style)
    if layout.chance(0.35) and layout.room.rect.area_m2 > 8:
        layout.stand("sofa", household.couch, (0.92, 1.7, 0.8), back_m=0.46, width_m=1.7, colour=style.cloths[1])
    if layout.chance(0.4):
        furnishing.sideboard(layout, style)
    if layout.chance(0.4):
        furnishing.floor_lamp(layout)
    if layout.chance(0.5):
        furnishing.cartons(layout)
    furnishing.floor_plant(layout)
    if layout.chance(0.5):
        board_m = (0.95, 0.65)
        layout.hang(
            "noticeboard", fitting.noticeboard, board_m, above=desk_spot, middle_m=1.62, width_m=0.9, height_m=0.6
        )
    _finish_walls(layout, style)


# --- Halls ---


def _furnish_hall(layout: RoomLayout, style: Style) -> None:
    cabinet_spot = _add_shoe_cabinet(layout)
    if cabinet_spot is not None and layout.chance(0.6):
        mirror_m = (0.55, 0.75)
        layout.hang(
            "mirror",
            fitting.framed,
            mirror_m,
            middle_m=1.6,
            above=cabinet_spot,
            style="mirror",
            width_m=0.5,
            height_m=0.7,
        )
    _add_coats(layout, style)
    if layout.chance(0.45):
        _add_runner(layout, style)
    is_wide = layout.room.rect.depth_m > 1.7 and layout.room.rect.width_m > 1.7
    if is_wide:
        _furnish_wide_hall(layout, style)
    _finish_walls(layout, style)


def _add_shoe_cabinet(layout: RoomLayout) -> Spot | None:
    """Add a shoe cabinet with things on it; the spot at which it stands, None if there is no space for it."""
    rng = layout.rng
    width_m = float(rng.choice([0.7, 0.9]))
    cabinet = layout.stand(
        "shoe_cabinet",
        bedroom.shoe_cabinet,
        (0.31, width_m + 0.02, 0.88),
        front_m=0.6,
        width_m=width_m,
        colour=one_of(rng, "#dcdbd6", "#c9c4b8", "#5b6b5d"),
    )
    if cabinet is None:
        return None
    name, spot = cabinet
    kinds = ("box", "mug", "plant")[: int(rng.integers(1, 4))]
    furnishing.scatter(layout, name, spot, kinds, x_m=GAP_M + 0.14, width_m=width_m - 0.12, z_m=0.87)
    return spot


def _furnish_wide_hall(layout: RoomLayout, style: Style) -> None:
    if layout.chance(0.6):
        layout.stand(
            "wardrobe",
            bedroom.wardrobe,
            (0.66, 1.02, 2.34),
            front_m=0.5,
            in_corner=True,
            width_m=1.0,
            colour="#e4e0d6" if style.is_painted else "",
            tones=style.tones,
        )
    if layout.chance(0.5):
        furnishing.shelf(layout, style, (0.8, 1.0))
    if layout.chance(0.5):
        furnishing.floor_plant(layout)


def _add_coats(layout: RoomLayout, style: Style) -> None:
    """Add a rack with coats, and shoes on the floor below it."""
    rng = layout.rng
    rack_m = float(rng.choice([0.7, 0.9, 1.1]))
    spot = layout.hang(
        "coat_rack", bedroom.coat_rack, (rack_m + 0.24, 1.3), middle_m=1.22, width_m=rack_m, tones=style.tones
    )
    if spot is None:
        return
    for _ in range(int(rng.integers(0, 3))):
        y = float(rng.uniform(-0.3, 0.3)) * rack_m
        body = spot.rect(0.02, 0.38, y - 0.17, y + 0.17)
        if layout.fits([body]):
            yaw_deg = spot.yaw_deg + float(rng.normal(0, 8))
            layout.add("shoes", bedroom.shoes, spot.at(0.05, y), yaw_deg=yaw_deg)
            layout.take(body, 0.12)


def _add_runner(layout: RoomLayout, style: Style) -> None:
    """Add a long rug in the middle of a hall."""
    rect = layout.room.rect
    is_along_x = rect.width_m > rect.depth_m
    length_m = min(2.6, max(rect.width_m, rect.depth_m) - 1.2)
    if length_m < 1.0:
        return
    layout.add(
        "rug",
        furnishing.rug,
        rect.center_m,
        yaw_deg=90.0 if is_along_x else 0.0,
        width_m=length_m,
        depth_m=0.68,
        seed=style.rugs[1],
    )


# --- Bathrooms ---


def _furnish_bath(layout: RoomLayout, style: Style) -> None:
    wants_tub = layout.chance(0.55)
    basin_m = float(layout.rng.choice([0.6, 0.8]))
    _add_tub_or_shower(layout, wants_tub=wants_tub)
    _add_washbasin(layout, style, basin_m)
    _add_toilet(layout)
    towel_colour = one_of(layout.rng, *BATH_CLOTHS)
    layout.hang("towel_rail", bathroom.towel_rail, (0.56, 1.2), middle_m=0.95, colour=towel_colour)
    mat_spot = layout.open_spot(0.5, 0.8)
    if mat_spot is not None:
        mat_colour = one_of(layout.rng, *BATH_CLOTHS)
        layout.add("bath_mat", bathroom.bath_mat, mat_spot.at(0), yaw_deg=mat_spot.yaw_deg, colour=mat_colour)
    if layout.chance(0.2):
        _add_bin(layout, 0.26, 0.32, back_m=0.12, width_m=0.22, height_m=0.28)


def _add_tub_or_shower(layout: RoomLayout, *, wants_tub: bool) -> None:
    """Add a tub in a corner, or a shower if there is no space for it."""
    if wants_tub:
        tub_m = (0.76, 1.7, 0.6)
        tub = layout.stand("bathtub", bathroom.bathtub, tub_m, front_m=0.3, first_m=0.0, in_corner=True)
        if tub is not None:
            return
    layout.stand("shower", bathroom.shower, (0.92, 0.92, 2.15), front_m=0.4, first_m=0.0, in_corner=True)


def _add_washbasin(layout: RoomLayout, style: Style, chosen_m: float) -> None:
    """Add a basin, or a narrow one if there is no space for the chosen width."""
    for width_m in (chosen_m, 0.6):
        basin = layout.stand(
            "washbasin",
            bathroom.washbasin,
            (0.5, width_m + 0.08, 1.95),
            front_m=0.45,
            first_m=0.0,
            width_m=width_m,
            colour=one_of(layout.rng, "#d8d6d0", "#5b6b5d", "#46586a"),
            tones=style.tones if layout.chance(0.5) else "",
            mirror_m=(width_m, 0.75),
            support=WALL,
        )
        if basin is not None:
            return


def _add_toilet(layout: RoomLayout) -> None:
    """Add a toilet, with less space around it if there is not enough, and a brush beside it."""
    for width_m, front_m in ((0.5, 0.4), (0.42, 0.25)):
        toilet_m = (0.58, width_m, 1.15)
        toilet = layout.stand("toilet", bathroom.toilet, toilet_m, front_m=front_m, first_m=0.0, support=WALL)
        if toilet is None:
            continue
        _, spot = toilet
        y = 0.32 if layout.chance(0.5) else -0.32
        body = spot.rect(0.02, 0.14, y - 0.06, y + 0.06)
        if layout.fits([body]):
            layout.add("brush", bathroom.toilet_brush, spot.at(0.08, y), yaw_deg=spot.yaw_deg)
            layout.take(body, 0.4)
        return


FURNISH: dict[str, Callable[[RoomLayout, Style], None]] = {
    "living": furnish_living_room,
    "kitchen": _furnish_kitchen,
    "bedroom": _furnish_bedroom,
    "study": _furnish_study,
    "hall": _furnish_hall,
    "bath": _furnish_bath,
}
