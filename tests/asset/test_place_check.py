"""Checks of interiors: each fault that is put into a valid place is reported."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset import home, place_check
from vobench.asset.furniture import WHITE, stood
from vobench.asset.interior import Interior
from vobench.asset.placed_piece import FLOOR, PlacedPiece
from vobench.asset.shape import at
from vobench.scene.light import AreaLight


@pytest.fixture(scope="module")
def flat() -> Interior:
    interior = home.furnished_flat(1, "day")
    assert place_check.complaints(interior) == []
    return interior


def with_piece(interior: Interior, piece: PlacedPiece) -> Interior:
    others = [each for each in interior.pieces if each.name != piece.name]
    return replace(interior, pieces=(*others, piece))


def moved(piece: PlacedPiece, x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0) -> PlacedPiece:
    return replace(piece, parts=tuple(part.moved(at(x_m, y_m, z_m)) for part in piece.parts))


def named(interior: Interior, text: str) -> PlacedPiece:
    return next(piece for piece in interior.pieces if text in piece.name)


def test_a_piece_in_another_one_is_reported(flat: Interior) -> None:
    shelf = named(flat, ".shelf_")
    copy = replace(moved(shelf, 0.1, 0.1), name=f"{shelf.room}.twin_1")
    found = place_check.complaints(with_piece(flat, copy))
    assert any("overlap" in complaint and "twin_1" in complaint for complaint in found)


def test_a_piece_that_hovers_over_the_floor_or_its_table_is_reported(flat: Interior) -> None:
    found = place_check.complaints(with_piece(flat, moved(named(flat, ".shelf_"), z_m=0.05)))
    assert any("not on the floor" in complaint for complaint in found)
    names = {piece.name for piece in flat.pieces}
    on_top = next(piece for piece in flat.pieces if piece.support in names)
    found = place_check.complaints(with_piece(flat, moved(on_top, z_m=0.05)))
    assert any("hovers" in complaint for complaint in found)


def test_a_picture_away_from_its_wall_is_reported(flat: Interior) -> None:
    picture = named(flat, ".picture_")
    room = flat.plan.room(picture.room)
    middle = np.mean([part.arrays.vertices_m.mean(axis=0) for part in picture.parts], axis=0)
    to_middle = np.array(room.rect.center_m) - middle[:2]
    found = place_check.complaints(with_piece(flat, moved(picture, *to_middle.tolist())))
    assert f"{picture.name} touches no wall" in found


def test_a_piece_that_stands_in_a_wall_is_reported(flat: Interior) -> None:
    shelf = named(flat, ".shelf_")
    found = place_check.complaints(with_piece(flat, moved(shelf, 20.0)))
    assert any("into a wall" in complaint for complaint in found)


def test_a_room_behind_a_blocked_door_is_reported(flat: Interior) -> None:
    door = next(passage for passage in flat.plan.passages if "bath_1" in passage.rooms)
    x_m, y_m = door.rect.center_m
    crate = PlacedPiece("bath_1.crate_1", "bath_1", (stood((0.9, 0.9, 0.8), WHITE, x_m, y_m),), FLOOR)
    found = place_check.complaints(with_piece(flat, crate))
    assert any(complaint.startswith("bath_1 has 0.00 m2") for complaint in found)


def test_a_place_without_light_is_reported(flat: Interior) -> None:
    assert any("no lamp is on" in complaint for complaint in place_check.complaints(replace(flat, lights=())))


def test_too_many_faces_are_reported_and_lamps_count(flat: Interior) -> None:
    lamp = flat.lights[0] if isinstance(flat.lights[0], AreaLight) else None
    counted = place_check.face_count(flat)
    if lamp is not None:
        assert counted - place_check.face_count(replace(flat, lights=flat.lights[1:])) == len(lamp.mesh.faces)
    heavy = replace(flat, shell=flat.shell * 40)
    assert any("faces, where" in complaint for complaint in place_check.complaints(heavy))


def test_a_chair_may_stand_under_its_table_but_its_back_may_not(flat: Interior) -> None:
    chair = next(piece for piece in flat.pieces if piece.may_overlap)
    table = next(piece for piece in flat.pieces if piece.name == chair.may_overlap[0])
    table_middle = np.mean([part.arrays.vertices_m.mean(axis=0) for part in table.parts], axis=0)
    chair_middle = np.mean([part.arrays.vertices_m.mean(axis=0) for part in chair.parts], axis=0)
    x_m, y_m, _ = (table_middle - chair_middle).tolist()
    found = place_check.complaints(with_piece(flat, moved(chair, x_m, y_m)))
    assert any("overlap" in complaint and chair.name in complaint for complaint in found)


def test_free_places_are_apart_from_furniture_and_walls(flat: Interior) -> None:
    places = place_check.free_places(flat)
    assert len(places) > 500
    rects = [room.rect.grown(-place_check.BODY_RADIUS_M + 0.06) for room in flat.plan.rooms]
    rects += [passage.rect.grown(0.6) for passage in flat.plan.passages]
    for x_m, y_m in places[::37].tolist():
        assert any(rect.holds(x_m, y_m) for rect in rects)
