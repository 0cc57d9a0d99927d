"""Rooms face inwards, boxes outwards, and a lamp gives off the power it is sold with."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.scene.light import AreaLight
from vobench.scene.scene import ceiling_light
from vobench.scene.surface import LAP_M, Surface, Window, box, rectangle, room, with_windows

ROOM = room((4, 6, 3), floor="floor", wall="wall", ceiling="ceiling")
CENTER_M, YAW_DEG = np.array([1.0, -2.0, 0.5]), 25.0
BOX = box(CENTER_M, (0.8, 0.4, 1.0), yaw_deg=YAW_DEG, material="wood")


def center(surface: Surface) -> np.ndarray:
    return surface.at(np.array(0.5), np.array(0.5))


def signed_volume(surfaces: list[Surface]) -> float:
    """Volume that the surfaces enclose, positive where all face outwards (Gauss's theorem)."""
    return sum(float(np.dot(center(s), np.cross(s.edge_u_m, s.edge_v_m))) / 3 for s in surfaces)


def test_every_side_of_a_room_faces_its_middle() -> None:
    for side in ROOM:
        assert np.dot(np.array([0, 0, 1.5]) - center(side), side.normal) > 1


def test_every_side_of_a_box_faces_away_from_its_middle() -> None:
    for side in BOX:
        assert np.dot(center(side) - CENTER_M, side.normal) > 0.1


def test_rooms_and_boxes_are_closed() -> None:
    assert signed_volume(ROOM) == pytest.approx(-4 * 6 * 3)
    assert signed_volume(BOX) == pytest.approx(0.8 * 0.4 * 1.0)
    for surfaces in (ROOM, BOX):
        areas = [np.cross(s.edge_u_m, s.edge_v_m) for s in surfaces]
        np.testing.assert_allclose(np.sum(areas, 0), 0, atol=1e-12)


def test_a_rooms_floor_is_at_zero_and_its_materials_are_where_they_belong() -> None:
    by_height = sorted(ROOM, key=lambda s: center(s)[2])
    assert [s.material for s in by_height] == ["floor", *["wall"] * 4, "ceiling"]
    np.testing.assert_allclose(center(by_height[0]), [0, 0, 0])
    np.testing.assert_allclose(center(by_height[-1]), [0, 0, 3])


def test_a_turned_box_is_the_straight_box_turned() -> None:
    straight = box(np.zeros(3), (0.8, 0.4, 1.0), yaw_deg=0, material="wood")
    R = se3.rotation_z(np.deg2rad(YAW_DEG))
    for turned, side in zip(BOX, straight, strict=True):
        np.testing.assert_allclose(turned.corner_m, R @ side.corner_m + CENTER_M, atol=1e-12)
        np.testing.assert_allclose(turned.normal, R @ side.normal, atol=1e-12)


def test_a_rectangle_lies_around_its_centre() -> None:
    surface = rectangle(np.array([1.0, 2.0, 3.0]), np.array([2.0, 0, 0]), np.array([0, 0.5, 0]), "wall")
    np.testing.assert_allclose(center(surface), [1, 2, 3])
    np.testing.assert_allclose(surface.at(np.array([0, 1]), np.array([0, 1])), [[0, 1.75, 3], [2, 2.25, 3]])
    assert surface.size_m == (2.0, 0.5)
    np.testing.assert_allclose(surface.normal, [0, 0, 1])


def flux_lm(lamp: AreaLight, *, rings: int = 2000) -> float:
    """Luminance of the panel integrated over its area and the half space before it, by the midpoint rule."""
    width, height = lamp.surface.size_m
    theta = (np.arange(rings) + 0.5) / rings * np.pi / 2
    cosine_sum = (np.cos(theta) * np.sin(theta)).sum() * (np.pi / 2 / rings) * 2 * np.pi
    return float(lamp.luminance_cd_m2 * width * height * cosine_sum)


@pytest.mark.parametrize("size_m", [(0.6, 0.6), (1.2, 0.1)])
def test_a_lamps_luminance_over_area_and_half_space_is_its_power(size_m: tuple[float, float]) -> None:
    lamp = ceiling_light("lamp", np.array([0, 0, 2.9]), size_m, power_lm=4000)
    assert flux_lm(lamp) == pytest.approx(4000, rel=1e-6)


def test_a_ceiling_light_shines_down_from_where_it_hangs() -> None:
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, 2.9]), (1.2, 0.6), power_lm=1)
    np.testing.assert_allclose(center(lamp.surface), [0.3, -0.2, 2.9])
    np.testing.assert_allclose(lamp.surface.normal, [0, 0, -1])
    corners = lamp.surface.at(np.array([0, 1]), np.array([0, 1]))
    np.testing.assert_allclose(np.ptp(corners, 0), [1.2, 0.6, 0])


def test_a_moved_surface_is_where_its_mover_is_and_keeps_its_texture() -> None:
    surface = Surface(np.array([1.0, 0, 0]), np.array([0, 2.0, 0]), np.array([0, 0, 1.0]), "m", "thing", (0.3, 0.4))
    T_world_mover = se3.transform(se3.rotation_z(np.pi / 2), [10.0, 0, 0])
    moved = surface.moved(T_world_mover)
    np.testing.assert_allclose(center(moved), se3.apply(T_world_mover, center(surface)[None])[0], atol=1e-12)
    np.testing.assert_allclose(moved.normal, T_world_mover[:3, :3] @ surface.normal, atol=1e-12)
    assert (moved.material, moved.instance, moved.texture_corner_m) == ("m", "thing", (0.3, 0.4))


def test_places_on_a_texture_are_metres_from_its_corner() -> None:
    surface = Surface(np.zeros(3), np.array([0, 2.0, 0]), np.array([0, 0, 3.0]), "m", "", (0.5, 0.25))
    np.testing.assert_allclose(surface.on_texture_m(np.array([0, 1]), np.array([0, 0.5])), [[0.5, 0.25], [2.5, 1.75]])


WALLS = {s.instance: s for s in room((6, 4, 3), floor="f", wall="w", ceiling="c") if s.material == "w"}
SIZE_M, DEPTH_M = (0.8, 1.1), 0.2
WINDOWS = [
    Window((1.5, 1.4), SIZE_M, DEPTH_M, "glass", "white", "a"),
    Window((2.6, 1.4), (0.4, 1.1), 0.1, "glass", "white", "b"),
]


def area(surface: Surface) -> float:
    return float(np.prod(surface.size_m))


@pytest.fixture(params=["wall_east", "wall_west", "wall_north", "wall_south"])
def wall(request: pytest.FixtureRequest) -> Surface:
    return WALLS[request.param]


def windows_in(wall: Surface) -> list[Window]:
    """WINDOWS, fitted to the wall's own directions: u is up where edge_u is."""
    if abs(wall.edge_u_m[2]) < 1:
        return WINDOWS
    return [Window(w.center_m[::-1], w.size_m[::-1], w.depth_m, w.pane, w.reveal, w.instance) for w in WINDOWS]


def test_the_parts_of_a_wall_and_its_windows_make_up_the_wall_and_its_lap(wall: Surface) -> None:
    parts = with_windows(wall, windows_in(wall))
    of_wall = sum(area(p) for p in parts if p.material == "w")
    width, height = wall.size_m
    whole = (width + 2 * LAP_M) * (height + 2 * LAP_M)
    assert of_wall == pytest.approx(whole - 0.8 * 1.1 - 0.4 * 1.1)
    assert sum(area(p) for p in parts if p.material == "glass") == pytest.approx(0.8 * 1.1 + 0.4 * 1.1)


def test_panes_lie_behind_the_wall_and_look_into_the_room(wall: Surface) -> None:
    panes = [p for p in with_windows(wall, windows_in(wall)) if p.material == "glass"]
    behind = [float((center(wall) - center(p)) @ wall.normal) for p in panes]
    assert behind == pytest.approx([0.2, 0.1])
    np.testing.assert_allclose([p.normal for p in panes], [wall.normal] * 2)


def test_reveals_face_the_middle_of_their_hole(wall: Surface) -> None:
    parts = with_windows(wall, windows_in(wall)[:1])
    (pane,) = (p for p in parts if p.material == "glass")
    reveals = [p for p in parts if p.material == "white"]
    assert len(reveals) == 4
    middle = center(pane) + DEPTH_M / 2 * wall.normal
    for reveal in reveals:
        inward = middle - center(reveal)
        assert reveal.normal @ inward == pytest.approx(np.linalg.norm(inward))
    assert sum(area(r) for r in reveals) == pytest.approx(2 * DEPTH_M * sum(SIZE_M))


def test_a_texture_runs_on_over_the_parts_as_over_the_whole_wall(wall: Surface) -> None:
    width, height = wall.size_m
    for part in with_windows(wall, windows_in(wall)):
        if part.material == "w":
            offset = center(part) - wall.corner_m
            on_wall = [offset @ wall.edge_u_m / width, offset @ wall.edge_v_m / height]
            np.testing.assert_allclose(part.on_texture_m(np.array(0.5), np.array(0.5)), on_wall, atol=1e-12)


def test_parts_share_their_corners_to_the_last_bit(wall: Surface) -> None:
    """A corner that lies on another part's edge would open a joint in pictures."""
    parts = [p for p in with_windows(wall, windows_in(wall)) if p.material == "w"]
    corners = np.unique(
        np.float32([p.at(np.array(u), np.array(v)) for p in parts for u in (0, 1) for v in (0, 1)]), axis=0
    )
    cuts = 2 + 2 + 2 * len(WINDOWS)
    assert len(corners) == cuts * 6  # every crossing of the grid once: 8 lines one way, 6 the other (equal heights)
