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

if TYPE_CHECKING:
    from trimesh import Trimesh


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
        finish = finishes[room.name]
        rect = room.rect
        yield f"{room.name}.floor", [Part(_floor(rect, finish.floor, number), finish.floor)]
        top = pierced((rect.x0, rect.y0, plan.height_m), (0, rect.depth_m, 0), (rect.width_m, 0, 0))
        yield f"{room.name}.ceiling", [Part(top, finish.ceiling)]
        for side in SIDES:
            wall = _wall(plan, room, side)
            yield f"{room.name}.wall_{side}", [Part(wall, finish.walls[side])]
    for number, passage in enumerate(plan.passages):
        room = plan.room(passage.rooms[0])
        frame = _WallFrame(room, room.side_at(passage.rect), plan.height_m)
        hole = frame.hole(passage.rect, passage.sill_m, passage.head_m)
        depth_m = passage.rect.width_m if is_along_y(passage.rect) else passage.rect.depth_m
        sides = reveal(frame.corner_m, frame.edge_m, frame.up_m, hole, depth_m)
        finish = finishes[room.name]
        yield f"passage_{number}", [Part(sides, finish.walls[room.side_at(passage.rect)])]
        if passage.is_walkable:
            yield f"threshold_{number}", [_threshold(passage, thresholds)]
        else:
            yield f"glazing_{number}", _glazing(passage)
    for number, window in enumerate(plan.windows):
        yield f"window_{number}", _window(plan, window, reveals)


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
        """A hole of the wall: first and last coordinate along its edge and upwards."""
        ends = [float((np.array([x, y, 0.0]) - self.corner_m) @ self.right) for x, y in _diagonal(rect)]
        return min(ends), max(ends), sill_m, head_m


def _diagonal(rect: Rect) -> tuple[tuple[float, float], tuple[float, float]]:
    """Two opposite corners of a rectangle."""
    return (rect.x0, rect.y0), (rect.x1, rect.y1)


def _wall(plan: FloorPlan, room: Room, side: Side) -> "Trimesh":
    """A wall of a room with all its holes."""
    frame = _WallFrame(room, side, plan.height_m)
    holes = list[Hole]()
    doors = list[Hole]()
    for passage in plan.passages_of(room):
        if room.side_at(passage.rect) == side:
            kind = doors if passage.is_walkable else holes
            kind.append(frame.hole(passage.rect, passage.sill_m, passage.head_m))
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
    size_m = (passage.rect.width_m, passage.rect.depth_m, 0.006)
    return furniture.stood(size_m, material, x, y, 0, bevel=0.002)


def _window(plan: FloorPlan, window: Window, reveals: Material) -> list[Part]:
    """The reveals and the pane of a window."""
    from vobench.scene.mesh_arrays import quad_arrays

    room = plan.room(window.room)
    frame = _WallFrame(room, room.side_at(window.rect), plan.height_m)
    hole = frame.hole(window.rect, window.sill_m, window.head_m)
    depth_m = float(abs(frame.outward[:2] @ [window.rect.width_m, window.rect.depth_m]))
    u0, u1, v0, v1 = hole
    corner_m = frame.corner_m + frame.right * u0 + [0, 0, v0] + frame.outward * depth_m
    pane = quad_arrays(corner_m, frame.right * (u1 - u0), (0, 0, v1 - v0))
    sides = reveal(frame.corner_m, frame.edge_m, frame.up_m, hole, depth_m)
    return [Part(sides, reveals), Part(pane, fitting.PANE)]
