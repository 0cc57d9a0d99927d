"""The shell of a floor plan: floors, ceilings, walls with holes, the panes of windows, and thresholds."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vobench.asset import fitting, furniture, office
from vobench.asset.floor_plan import SIDES, FloorPlan, Passage, Rect, Room, Side, Window, is_along_y
from vobench.asset.furniture import WHITE, Part
from vobench.asset.picture import LazyTexture
from vobench.asset.room import Instance
from vobench.asset.shape import at
from vobench.asset.wall import Hole, pierced, planked, reveal
from vobench.scene.material import Material
from vobench.scene.mesh_arrays import quad_arrays

if TYPE_CHECKING:
    from trimesh import Trimesh

THRESHOLD_M = 0.006  # thickness
THRESHOLD_BEVEL_M = 0.002


@dataclass(frozen=True, slots=True)
class RoomFinish:
    """The materials of a room's floor, ceiling and walls."""

    floor: Material
    ceiling: Material
    walls: Mapping[Side, Material]


def shell(
    plan: FloorPlan,
    finishes: Mapping[str, RoomFinish],
    *,
    reveals: Material = WHITE,
    thresholds: Material,
) -> Iterator[Instance]:
    """Floors, ceilings and walls of all rooms, the sides of the holes in them, and the panes of windows."""
    for number, room in enumerate(plan.rooms):
        yield from _room_surfaces(plan, room, finishes[room.name], seed=number)
    for number, passage in enumerate(plan.passages):
        yield f"passage_{number}", [_passage_reveal(plan, passage, finishes)]
        if passage.is_walkable:
            yield f"threshold_{number}", [_threshold(passage, thresholds)]
        else:
            yield f"glazing_{number}", _glazing(passage)
    for number, window in enumerate(plan.windows):
        yield f"window_{number}", _window(plan, window, reveals)


def _room_surfaces(plan: FloorPlan, room: Room, finish: RoomFinish, *, seed: int) -> Iterator[Instance]:
    """The floor, the ceiling and the walls of a room; the seed orders the planks of the floor."""
    rect = room.rect
    yield f"{room.name}.floor", [Part(_floor(rect, finish.floor, seed), finish.floor)]
    ceiling = pierced((rect.x0, rect.y0, plan.height_m), (0, rect.depth_m, 0), (rect.width_m, 0, 0))
    yield f"{room.name}.ceiling", [Part(ceiling, finish.ceiling)]
    for side in SIDES:
        yield f"{room.name}.wall_{side}", [Part(_wall(plan, room, side), finish.walls[side])]


def _passage_reveal(plan: FloorPlan, passage: Passage, finishes: Mapping[str, RoomFinish]) -> Part:
    """The sides of the hole of a passage, with the finish of the wall of its first room."""
    room = plan.room(passage.rooms[0])
    side = room.side_at(passage.rect)
    frame = _WallFrame(room, side, plan.height_m)
    hole = frame.hole(passage.rect, passage.sill_m, passage.head_m)
    depth_m = passage.rect.width_m if is_along_y(passage.rect) else passage.rect.depth_m
    sides = reveal(frame.corner_m, frame.edge_m, frame.up_m, hole, depth_m)
    return Part(sides, finishes[room.name].walls[side])


def _floor(rect: Rect, material: Material, seed: int) -> "Trimesh":
    """A floor, in planks along its longer side where the texture has some."""
    texture = material.texture
    if not (isinstance(texture, LazyTexture) and texture.planks):
        return pierced((rect.x0, rect.y0, 0), (rect.width_m, 0, 0), (0, rect.depth_m, 0))
    planks = texture.planks
    if rect.width_m >= rect.depth_m:
        corner_m = (rect.x0, rect.y0, 0)
        return planked(corner_m, (rect.width_m, 0, 0), (0, rect.depth_m, 0), planks, texture.tile_m, seed=seed)
    corner_m = (rect.x1, rect.y0, 0)
    return planked(corner_m, (0, rect.depth_m, 0), (-rect.width_m, 0, 0), planks, texture.tile_m, seed=seed)


class _WallFrame:
    """The face of a wall, seen from inside: its lower left corner, its edge to the right, and its edge upwards."""

    def __init__(self, room: Room, side: Side, height_m: float) -> None:
        outward = np.array([*SIDES[side], 0.0])
        right = np.array([outward[1], -outward[0], 0.0])
        middle = np.array([*room.rect.center_m, 0.0])
        half = np.array([room.rect.width_m, room.rect.depth_m, 0.0]) / 2
        self.outward = outward
        self.right = right
        self.corner_m = middle + (outward - right) * half
        self.edge_m = right * half * 2
        self.up_m = np.array([0.0, 0.0, height_m])

    def hole(self, rect: Rect, sill_m: float, head_m: float) -> Hole:
        """The hole that a rectangle of the plan cuts out of the wall: along its edge, then upwards."""
        first_m = self._along_m(rect.x0, rect.y0)
        second_m = self._along_m(rect.x1, rect.y1)
        return min(first_m, second_m), max(first_m, second_m), sill_m, head_m

    def _along_m(self, x_m: float, y_m: float) -> float:
        """The coordinate along the edge of a place on the floor."""
        return float((np.array([x_m, y_m, 0.0]) - self.corner_m) @ self.right)


def _wall(plan: FloorPlan, room: Room, side: Side) -> "Trimesh":
    """A wall of a room with all its holes."""
    frame = _WallFrame(room, side, plan.height_m)
    holes = list[Hole]()
    doors = list[Hole]()
    for passage in plan.passages_of(room):
        if room.side_at(passage.rect) != side:
            continue
        hole = frame.hole(passage.rect, passage.sill_m, passage.head_m)
        if passage.is_walkable:
            doors.append(hole)
        else:
            holes.append(hole)
    for window in plan.windows_of(room):
        if room.side_at(window.rect) == side:
            holes.append(frame.hole(window.rect, window.sill_m, window.head_m))
    return pierced(frame.corner_m, frame.edge_m, frame.up_m, holes, doors=doors)


def _glazing(passage: Passage) -> list[Part]:
    """The pane of a hole between two rooms."""
    x, y = passage.rect.center_m
    width_m = max(passage.rect.width_m, passage.rect.depth_m)
    height_m = passage.head_m - passage.sill_m
    yaw_deg = 0.0 if is_along_y(passage.rect) else 90.0
    T_place_pane = at(x, y, passage.sill_m + height_m / 2, yaw=yaw_deg)
    pane = office.glazing(np.random.default_rng(0), width_m, height_m)
    return [part.moved(T_place_pane) for part in pane]


def _threshold(passage: Passage, material: Material) -> Part:
    """A strip on the floor of a doorway."""
    x, y = passage.rect.center_m
    size_m = (passage.rect.width_m, passage.rect.depth_m, THRESHOLD_M)
    return furniture.stood(size_m, material, x, y, 0, bevel=THRESHOLD_BEVEL_M)


def _window(plan: FloorPlan, window: Window, reveals: Material) -> list[Part]:
    """The reveals and the pane of a window."""
    room = plan.room(window.room)
    frame = _WallFrame(room, room.side_at(window.rect), plan.height_m)
    hole = frame.hole(window.rect, window.sill_m, window.head_m)
    depth_m = float(abs(frame.outward[:2] @ [window.rect.width_m, window.rect.depth_m]))
    left_m, right_m, sill_m, head_m = hole
    in_wall_m = frame.corner_m + frame.right * left_m + [0, 0, sill_m]
    pane = quad_arrays(
        in_wall_m + frame.outward * depth_m,
        frame.right * (right_m - left_m),
        (0, 0, head_m - sill_m),
    )
    sides = reveal(frame.corner_m, frame.edge_m, frame.up_m, hole, depth_m)
    return [Part(sides, reveals), Part(pane, fitting.PANE)]
