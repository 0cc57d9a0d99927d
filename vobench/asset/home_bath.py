"""Furnishes the bathrooms of homes: a tub or a shower, a washbasin, a toilet, towels, a mat."""

from vobench.asset import bathroom
from vobench.asset.home_piece import add_bin
from vobench.asset.palette import Style
from vobench.asset.picture import one_of
from vobench.asset.placed_piece import WALL
from vobench.asset.room_layout import RoomLayout

TOWEL_COLOURS = ("#8fb3c7", "#d8c3a0", "#b4533a", "#8a9a7b", "#e6e1d6", "#6b4353", "#3d7a7c")
TUB_SHARE = 0.55  # of bathrooms with a tub, if it fits
TUB_M = (0.76, 1.7, 0.6)  # depth, width, height of the space for a tub
SHOWER_M = (0.92, 0.92, 2.15)
BASIN_WIDTHS_M = (0.6, 0.8)
NARROW_BASIN_M = 0.6  # width, where the chosen one does not fit
BASIN_HEIGHT_M = 1.95  # with the mirror above it
TOILET_DEPTH_M = 0.58
TOILET_HEIGHT_M = 1.15  # with the cistern
TOILET_SPACES_M = ((0.5, 0.4), (0.42, 0.25))  # width and free floor in front, in the order in which they are tried
BRUSH_Y_M = 0.32  # from the middle of the toilet to its brush


def furnish_bath(layout: RoomLayout, style: Style) -> None:
    """Furnish a bathroom."""
    wants_tub = layout.chance(TUB_SHARE)
    basin_m = float(layout.rng.choice(BASIN_WIDTHS_M))
    _add_tub_or_shower(layout, wants_tub=wants_tub)
    _add_washbasin(layout, style, basin_m)
    _add_toilet(layout)
    towel_colour = one_of(layout.rng, *TOWEL_COLOURS)
    layout.add_on_wall("towel_rail", bathroom.towel_rail, (0.56, 1.2), middle_m=0.95, colour=towel_colour)
    mat_spot = layout.free_spot_on_floor(0.5, 0.8)
    if mat_spot is not None:
        mat_colour = one_of(layout.rng, *TOWEL_COLOURS)
        layout.add("bath_mat", bathroom.bath_mat, mat_spot.point(0), yaw_deg=mat_spot.yaw_deg, colour=mat_colour)
    if layout.chance(0.2):
        add_bin(layout, width_m=0.22, height_m=0.28, back_m=0.12)


def _add_tub_or_shower(layout: RoomLayout, *, wants_tub: bool) -> None:
    """Add a tub in a corner, or a shower if no tub is wanted or there is no space for it."""
    if wants_tub:
        tub = layout.add_at_wall("bathtub", bathroom.bathtub, TUB_M, front_m=0.3, wall_gap_m=0.0, in_corner=True)
        if tub is not None:
            return
    layout.add_at_wall("shower", bathroom.shower, SHOWER_M, front_m=0.4, wall_gap_m=0.0, in_corner=True)


def _add_washbasin(layout: RoomLayout, style: Style, chosen_m: float) -> None:
    """Add a basin, or a narrow one if there is no space for the chosen width."""
    for width_m in (chosen_m, NARROW_BASIN_M):
        basin = layout.add_at_wall(
            "washbasin",
            bathroom.washbasin,
            (0.5, width_m + 0.08, BASIN_HEIGHT_M),
            front_m=0.45,
            wall_gap_m=0.0,
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
    for width_m, front_m in TOILET_SPACES_M:
        size_m = (TOILET_DEPTH_M, width_m, TOILET_HEIGHT_M)
        toilet = layout.add_at_wall("toilet", bathroom.toilet, size_m, front_m=front_m, wall_gap_m=0.0, support=WALL)
        if toilet is None:
            continue
        _, spot = toilet
        y_m = BRUSH_Y_M if layout.chance(0.5) else -BRUSH_Y_M
        footprint = spot.rectangle(0.02, 0.14, y_m - 0.06, y_m + 0.06)
        if layout.floor.fits([footprint]):
            layout.add("brush", bathroom.toilet_brush, spot.point(0.08, y_m), yaw_deg=spot.yaw_deg)
            layout.floor.occupy(footprint, 0.4)
        return
