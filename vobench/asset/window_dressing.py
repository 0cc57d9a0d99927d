"""What belongs to windows: frames, radiators below them, curtains or blinds, and things on their sills."""

from dataclasses import dataclass

import numpy as np

from vobench.asset import fitting, furniture, houseplant
from vobench.asset.floor_plan import Side, Window, along_m
from vobench.asset.furniture import DARK, Part
from vobench.asset.palette import Style
from vobench.asset.picture import Rng, one_of
from vobench.asset.placed_piece import SHELL, WALL
from vobench.asset.room_layout import RoomLayout
from vobench.asset.shape import tube
from vobench.asset.spot import Spot
from vobench.asset.wall_space import WallRegion

# Radiators
RADIATOR_SILL_M = 0.68  # the least height of a sill above a radiator
RADIATOR_BELOW_SILL_M = 0.28  # from the sill to the panel's height, of which 0.12 m are below the panel
RADIATOR_HEIGHTS_M = (0.4, 0.55)  # of the panel, from and to
RADIATOR_FOOT_M = 0.14  # what the panel's height leaves out: 0.12 m below it, and the rim
RADIATOR_DEPTH_M = 0.16
RADIATOR_SIDE_M = 0.1  # of free floor and wall beside a radiator, for its valve

# Curtains
CURTAIN_M = 0.42  # width
CURTAIN_DEPTH_M = 0.12
CURTAIN_OFFSET_M = 0.1  # from the edge of the window to the middle of the curtain
ROD_ABOVE_HEAD_M = 0.1  # from the head of the window
ROD_OUT_M = 0.06  # from the wall
ROD_MARGIN_M = 0.06  # of free wall around a rod
ROD_END_M = 0.05  # by which a rod is longer than the curtains at either end
CORNER_M = 0.05  # between a rod and a corner of the room
FLOOR_LENGTH_SILL_M = 0.5  # curtains of windows with lower sills reach to the floor
CURTAIN_COLUMNS = 19  # of vertices; the least that shows all folds

# Sills
SILL_M = 0.6  # the least height of a sill with things on it
EMPTY_SILLS = 0.6  # share
SILL_PLANTS = 0.75  # share of plants on the other sills; on the rest is a mug


@dataclass(frozen=True, slots=True)
class _WindowPlace:
    """A window of a room, and the spot on the floor below its middle."""

    window: Window
    spot: Spot
    width_m: float

    @property
    def depth_m(self) -> float:
        """The distance between the face of the wall and the pane."""
        return min(self.window.rect.width_m, self.window.rect.depth_m)

    @property
    def side(self) -> Side:
        """The wall of the window."""
        return self.spot.side


def dress_windows(layout: RoomLayout, style: Style) -> None:
    """Add the frame, a radiator, curtains or a blind, and things on the sill to each window of a room."""
    use = layout.room.use
    for window in layout.plan.windows_of(layout.room):
        side = layout.room.side_at(window.rect)
        start_m, end_m = along_m(side, window.rect)
        place = _WindowPlace(window, layout.spot(side, (start_m + end_m) / 2), end_m - start_m)
        _add_frame(layout, place)
        if use not in ("bath", "kitchen") and window.sill_m > RADIATOR_SILL_M:
            _add_radiator(layout, place)
        if style.window_dressing == "curtains" and use not in ("bath", "kitchen"):
            _add_curtains(layout, style, place)
        elif style.window_dressing == "blinds" and use != "bath":
            _add_blind(layout, place)
        _add_sill_item(layout, place)


def _add_frame(layout: RoomLayout, place: _WindowPlace) -> None:
    window = place.window
    layout.add(
        "window_frame",
        fitting.window_frame,
        place.spot.point(0),
        (window.sill_m + window.head_m) / 2,
        yaw_deg=place.spot.yaw_deg,
        support=SHELL,
        width_m=place.width_m,
        height_m=window.head_m - window.sill_m,
        depth_m=place.depth_m,
    )


def _add_radiator(layout: RoomLayout, place: _WindowPlace) -> None:
    """Add a radiator below a window if its floor is free."""
    spot = place.spot
    height_m = float(np.clip(place.window.sill_m - RADIATOR_BELOW_SILL_M, *RADIATOR_HEIGHTS_M))
    length_m = place.width_m - 0.12
    footprint = spot.footprint(RADIATOR_DEPTH_M, length_m + 2 * RADIATOR_SIDE_M)
    if not layout.floor.fits([footprint]):
        return
    layout.add(
        "radiator",
        fitting.panel_radiator,
        spot.point(0),
        yaw_deg=spot.yaw_deg,
        support=WALL,
        width_m=length_m,
        height_m=height_m,
    )
    top_m = height_m + RADIATOR_FOOT_M
    layout.floor.occupy(footprint, top_m)
    start_m = spot.along_m - length_m / 2 - RADIATOR_SIDE_M
    end_m = spot.along_m + length_m / 2 + RADIATOR_SIDE_M
    layout.walls.occupy(place.side, WallRegion(start_m, end_m, 0.0, top_m))


def _add_curtains(layout: RoomLayout, style: Style, place: _WindowPlace) -> None:
    """Add two curtains on a rod if there is space for it beside and above the window."""
    window = place.window
    spot = place.spot
    curtain_y_m = place.width_m / 2 + CURTAIN_OFFSET_M
    reach_m = curtain_y_m + CURTAIN_M / 2  # from the middle of the window to the outer edge of a curtain
    rod_m = window.head_m + ROD_ABOVE_HEAD_M  # height above the floor
    wall_start_m, wall_end_m = layout.room.span_m(place.side)
    fits_at_start = spot.along_m - reach_m > wall_start_m + CORNER_M
    fits_at_end = spot.along_m + reach_m < wall_end_m - CORNER_M
    fits_below_ceiling = rod_m + ROD_MARGIN_M < layout.plan.height_m
    if not (fits_at_start and fits_at_end and fits_below_ceiling):
        return

    is_floor_length = window.sill_m < FLOOR_LENGTH_SILL_M
    height_m = rod_m - 0.04 if is_floor_length else rod_m - window.sill_m + 0.12
    for sign in (-1, 1):
        layout.add(
            "curtain",
            fitting.curtain,
            spot.point(0.01, sign * curtain_y_m),
            rod_m - 0.012,
            yaw_deg=spot.yaw_deg,
            support=SHELL,
            width_m=CURTAIN_M,
            height_m=height_m,
            colour=style.curtain,
            columns=CURTAIN_COLUMNS,
        )
    layout.add(
        "rod",
        _rod,
        spot.point(ROD_OUT_M),
        rod_m,
        yaw_deg=spot.yaw_deg,
        support=SHELL,
        length_m=2 * reach_m + 2 * ROD_END_M,
    )

    start_m = spot.along_m - reach_m - ROD_MARGIN_M
    end_m = spot.along_m + reach_m + ROD_MARGIN_M
    bottom_m = 0.02 if is_floor_length else window.sill_m - 0.16
    layout.walls.occupy(place.side, WallRegion(start_m, end_m, bottom_m, rod_m + ROD_MARGIN_M))
    if is_floor_length:
        for sign in (-1, 1):
            y_m = sign * curtain_y_m
            footprint = spot.rectangle(0, CURTAIN_DEPTH_M, y_m - CURTAIN_M / 2, y_m + CURTAIN_M / 2)
            layout.floor.occupy(footprint, rod_m)


def _rod(_: Rng, length_m: float) -> list[Part]:
    """A curtain rod along y."""
    path_m = np.array([[0.0, -length_m / 2, 0.0], [0.0, length_m / 2, 0.0]])
    return [Part(tube(path_m, 0.012, sections=8), DARK)]


def _add_blind(layout: RoomLayout, place: _WindowPlace) -> None:
    """Add a blind that covers a part of the window."""
    window = place.window
    covered_share = float(layout.rng.uniform(0.15, 0.8))
    drop_m = covered_share * (window.head_m - window.sill_m)
    layout.add(
        "blind",
        fitting.blind,
        place.spot.point(0.04 - place.depth_m / 2),
        window.head_m - 0.02,
        yaw_deg=place.spot.yaw_deg,
        support=SHELL,
        width_m=place.width_m - 0.04,
        drop_m=max(drop_m, 0.12),
    )


def _add_sill_item(layout: RoomLayout, place: _WindowPlace) -> None:
    """Put a plant or a mug on a window sill, or leave it empty."""
    rng = layout.rng
    if place.window.sill_m < SILL_M or layout.chance(EMPTY_SILLS):
        return
    z_m = place.window.sill_m + 0.002
    y_m = float(rng.uniform(-0.32, 0.32)) * place.width_m
    xy_m = place.spot.point(0.05 - place.depth_m / 2, y_m)
    if layout.chance(SILL_PLANTS):
        layout.add(
            "sill_plant",
            houseplant.houseplant,
            xy_m,
            z_m,
            support=SHELL,
            height_m=float(rng.uniform(0.2, 0.3)),
            habit=one_of(rng, *houseplant.HABITS),
            pot=one_of(rng, *houseplant.POT_COLOURS),
        )
    else:
        layout.add("sill_mug", furniture.mug, xy_m, z_m, support=SHELL)
