"""A wall with windows is the wall without their holes, its texture unbroken, with panes behind."""

import numpy as np
import pytest

from vobench.scene.surface import Surface, room
from vobench.scene.window import LAP_M, Window, with_windows

WALLS = {s.instance: s for s in room((6, 4, 3), floor="f", wall="w", ceiling="c") if s.material == "w"}
SIZE_M, DEPTH_M = (0.8, 1.1), 0.2
WINDOWS = [
    Window((1.5, 1.4), SIZE_M, DEPTH_M, "glass", "white", "a"),
    Window((2.6, 1.4), (0.4, 1.1), 0.1, "glass", "white", "b"),
]


def area(surface: Surface) -> float:
    return float(np.prod(surface.size_m))


def center(surface: Surface) -> np.ndarray:
    return surface.at(np.array(0.5), np.array(0.5))


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
