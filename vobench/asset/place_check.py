"""Checks of generated interiors: nothing overlaps or floats, every room is reached, something shines."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy

from vobench.asset.floor_plan import Room
from vobench.asset.interior import Interior
from vobench.asset.placed_piece import CEILING, FLOOR, SHELL, WALL, PlacedPiece
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Sky, Sun

TOLERANCE_M = 0.012  # of contacts
ON_WALL_M = 0.05  # from the wall at most
OVERLAP_M = 0.03  # that bounding boxes may share, since pieces are turned and not boxes
LOW_M = 0.02  # lower pieces lie on the floor under others, such as rugs
CHAIR_SEAT_M = 0.62  # above which a chair must not reach into its table
CELL_M = 0.05
BODY_RADIUS_M = 0.25
BODY_HEIGHT_M = 1.0
FACES = 25000.0  # at most, and so many more per square metre of floor
FACES_PER_M2 = 450.0
FREE_ROOM_M2 = 0.4
WINDOWLESS = "store"  # the use of rooms that need no window


@dataclass(frozen=True, slots=True)
class _Box:
    """The bounding box of a piece."""

    piece: PlacedPiece
    low_m: Array
    high_m: Array


def _box(piece: PlacedPiece) -> _Box:
    vertices = np.concatenate([part.arrays.vertices_m for part in piece.parts])
    return _Box(piece, vertices.min(axis=0), vertices.max(axis=0))


def complaints(interior: Interior) -> list[str]:
    """What is wrong with an interior, in sentences; empty if nothing is."""
    boxes = [_box(piece) for piece in interior.pieces]
    found = [*_overlaps(boxes), *_loose(interior, boxes), *_outside(interior, boxes)]
    found += [*_unreached(interior, boxes), *_unlit(interior), *_missing(interior)]
    faces = face_count(interior)
    most = FACES + FACES_PER_M2 * interior.plan.area_m2
    if faces > most:
        found.append(f"it has {faces} faces, where {most:.0f} are right")
    return found


def face_count(interior: Interior) -> int:
    """The number of faces of an interior, with its lamps."""
    parts = [part for _, parts in interior.shell for part in parts]
    parts += [part for piece in interior.pieces for part in piece.parts]
    lamps = [light for light in interior.lights if isinstance(light, AreaLight)]
    return sum(len(part.arrays.faces) for part in parts) + sum(len(lamp.mesh.faces) for lamp in lamps)


def _is_furniture(piece: PlacedPiece) -> bool:
    """Whether a piece is something that may not enter others, unlike linings, frames and curtains."""
    return piece.support != SHELL or ".leaf_" in piece.name


def _overlaps(boxes: Sequence[_Box]) -> Iterator[str]:
    """Pieces whose bounding boxes overlap, except for those on, under or beside each other by intent."""
    by_room = dict[str, list[_Box]]()
    for box in boxes:
        if _is_furniture(box.piece):
            by_room.setdefault(box.piece.room, []).append(box)
    for in_room in by_room.values():
        for one, other in combinations(in_room, 2):
            depth_m = float((np.minimum(one.high_m, other.high_m) - np.maximum(one.low_m, other.low_m)).min())
            if depth_m > OVERLAP_M and not _may_overlap(one, other):
                yield f"{one.piece.name} and {other.piece.name} overlap by {depth_m:.2f} m"


def _may_overlap(one: _Box, other: _Box) -> bool:
    """Whether one of two pieces stands under the other by intent, and no part of it reaches into it."""
    for inner, outer in ((one, other), (other, one)):
        if outer.piece.name in inner.piece.may_overlap:
            return not _enters(inner, outer)
    return False


def _enters(inner: _Box, outer: _Box) -> bool:
    """Whether what is high of a chair lies within the box of its table."""
    vertices = np.concatenate([part.arrays.vertices_m for part in inner.piece.parts])
    high = vertices[vertices[:, 2] > outer.high_m[2] - 0.02]
    is_above_low = np.all(high[:, :2] > outer.low_m[:2] + OVERLAP_M, axis=1)
    is_below_high = np.all(high[:, :2] < outer.high_m[:2] - OVERLAP_M, axis=1)
    return bool(np.any(is_above_low & is_below_high))


def _loose(interior: Interior, boxes: Sequence[_Box]) -> Iterator[str]:
    """Pieces that do not touch what holds them."""
    by_name = {box.piece.name: box for box in boxes}
    for box in boxes:
        support = box.piece.support
        room = interior.plan.room(box.piece.room)
        if support == FLOOR and not -0.004 <= box.low_m[2] <= TOLERANCE_M:
            yield f"{box.piece.name} stands at {box.low_m[2]:.3f} m, not on the floor"
        if support == CEILING and abs(box.high_m[2] - interior.plan.height_m) > TOLERANCE_M:
            yield f"{box.piece.name} ends at {box.high_m[2]:.3f} m, not at the ceiling"
        if support == WALL and not _touches_wall(room, box):
            yield f"{box.piece.name} touches no wall"
        if support in by_name:
            yield from _not_on(box, by_name[support])


def _touches_wall(room: Room, box: _Box) -> bool:
    gaps: list[float] = [
        box.low_m[0] - room.rect.x0,
        room.rect.x1 - box.high_m[0],
        box.low_m[1] - room.rect.y0,
        room.rect.y1 - box.high_m[1],
    ]
    return bool(min(gaps) < ON_WALL_M)


def _not_on(box: _Box, parent: _Box) -> Iterator[str]:
    """Whether a piece that lies on another one hovers, or hangs over its edge."""
    is_at_top = box.low_m[2] - parent.high_m[2] < TOLERANCE_M
    if not is_at_top:
        yield f"{box.piece.name} hovers {box.low_m[2] - parent.high_m[2]:.3f} m above {parent.piece.name}"
    middle = (box.low_m + box.high_m)[:2] / 2
    if (middle < parent.low_m[:2]).any() or (middle > parent.high_m[:2]).any():
        yield f"{box.piece.name} is not above {parent.piece.name}"


def _outside(interior: Interior, boxes: Sequence[_Box]) -> Iterator[str]:
    """Pieces that reach into a wall."""
    for box in boxes:
        if box.piece.support == SHELL and ".leaf_" not in box.piece.name:
            continue
        rect = interior.plan.room(box.piece.room).rect
        beyond_m = max(rect.x0 - box.low_m[0], box.high_m[0] - rect.x1, rect.y0 - box.low_m[1], box.high_m[1] - rect.y1)
        if beyond_m > TOLERANCE_M:
            yield f"{box.piece.name} reaches {beyond_m:.3f} m into a wall"
        if box.high_m[2] > interior.plan.height_m + TOLERANCE_M:
            yield f"{box.piece.name} reaches above the ceiling"


def _floor_map(interior: Interior, boxes: Sequence[_Box]) -> tuple[Array, Array, Array]:
    """Cell centres along x and y, and where the middle of a body can be (rows, columns)."""
    outer = interior.plan.outer
    x = np.arange(outer.x0 - 0.1, outer.x1 + 0.1, CELL_M)
    y = np.arange(outer.y0 - 0.1, outer.y1 + 0.1, CELL_M)
    is_floor = np.zeros((len(y), len(x)), bool)
    rects = [room.rect for room in interior.plan.rooms]
    rects += [passage.rect.grown(0.001) for passage in interior.plan.passages if passage.is_walkable]
    for rect in rects:
        is_floor |= ((x > rect.x0) & (x < rect.x1)) & ((y > rect.y0) & (y < rect.y1))[:, None]
    # Linings narrow the doorways.
    for box in boxes:
        is_low = box.low_m[2] < BODY_HEIGHT_M and box.high_m[2] > LOW_M
        is_in_way = _is_furniture(box.piece) and is_low
        if is_in_way:
            in_x = (x > box.low_m[0]) & (x < box.high_m[0])
            in_y = (y > box.low_m[1]) & (y < box.high_m[1])
            is_floor &= ~(in_x & in_y[:, None])
    distance_m = scipy.ndimage.distance_transform_edt(is_floor) * CELL_M
    return x, y, distance_m > BODY_RADIUS_M


def _unreached(interior: Interior, boxes: Sequence[_Box]) -> Iterator[str]:
    """Rooms that a body cannot reach."""
    x, y, is_free = _floor_map(interior, boxes)
    labels, _ = scipy.ndimage.label(is_free)
    counts = np.bincount(labels.ravel())
    counts[0] = 0
    largest = int(counts.argmax())
    for room in interior.plan.rooms:
        rect = room.rect
        inside = ((x > rect.x0) & (x < rect.x1)) & ((y > rect.y0) & (y < rect.y1))[:, None]
        area_m2 = float(((labels == largest) & inside).sum()) * CELL_M**2
        if area_m2 < FREE_ROOM_M2:
            yield f"{room.name} has {area_m2:.2f} m2 that a body reaches, where {FREE_ROOM_M2} m2 are right"


def free_places(interior: Interior) -> Array:
    """Places (N, 2) where the middle of a body can be."""
    x, y, is_free = _floor_map(interior, [_box(piece) for piece in interior.pieces])
    rows, columns = np.nonzero(is_free)
    return np.column_stack([x[columns], y[rows]])


def _unlit(interior: Interior) -> Iterator[str]:
    """Whether nothing shines."""
    has_lamp = any(isinstance(light, AreaLight) for light in interior.lights)
    has_sky = any(isinstance(light, Sun | Sky) and light.illuminance_lx > 100 for light in interior.lights)
    if not has_lamp and not has_sky:
        yield "no lamp is on, and it is dark outside"
    needs_window = any(room.use != WINDOWLESS for room in interior.plan.rooms)
    if needs_window and not interior.plan.windows:
        yield "it has no window"


def _missing(interior: Interior) -> Iterator[str]:
    """Rooms without what they are for."""
    for room in interior.plan.rooms:
        count = sum(piece.room == room.name and _is_furniture(piece) for piece in interior.pieces)
        if count < 2:
            yield f"{room.name} holds only {count} pieces"
