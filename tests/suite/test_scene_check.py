"""Everything in a room is inside of it, windows are within their walls and apart, and no name occurs twice."""

import pytest

from vobench.errors import SuiteError
from vobench.suite.scene_check import materials_used
from vobench.suite.scene_file import read_scene

WINDOW = "{wall: north, center_m: [1, 1.5], size_m: [1, 0.8], pane: pane, reveal: grain}"


def window(wall: str, along_m: float, up_m: float, width_m: float = 1.0, height_m: float = 0.8) -> str:
    return (
        f"{{wall: {wall}, center_m: [{along_m}, {up_m}], size_m: [{width_m}, {height_m}], pane: pane, reveal: grain}}"
    )


def is_accepted(hall, old: str, new: str) -> bool:
    try:
        hall(old, new)
    except SuiteError:
        return False
    return True


@pytest.mark.parametrize(
    ("wall", "along_m", "up_m", "fits"),
    [
        ("north", 0, 1.5, True),
        ("north", 2.4, 1.5, True),
        ("north", -2.4, 1.5, True),
        ("north", 2.5, 1.5, False),
        ("north", -2.5, 1.5, False),
        ("south", 2.4, 1.5, True),
        ("east", 1.4, 1.5, True),
        ("east", 1.6, 1.5, False),
        ("west", -1.6, 1.5, False),
        ("north", 0, 0.5, True),
        ("north", 0, 0.4, False),
        ("north", 0, 0.3, False),
        ("north", 0, 2.5, True),
        ("north", 0, 2.6, False),
        ("north", 0, 2.7, False),
    ],
)
def test_a_window_is_within_its_wall_and_touches_no_edge_of_it(hall, wall, along_m, up_m, fits):
    assert is_accepted(hall, WINDOW, window(wall, along_m, up_m)) is fits


@pytest.mark.parametrize(
    ("second", "fits"),
    [
        (window("north", 2.0, 1.5), True),
        (window("north", 1.99, 1.5), False),
        (window("north", 0.0, 1.5), True),
        (window("north", 1.0, 2.3), True),
        (window("north", 1.0, 2.2), False),
        (window("north", 1.9, 2.2), False),
        (window("south", 1.0, 1.5), True),
        (window("north", 1.0, 1.5, 0.2, 0.2), False),
    ],
)
def test_windows_of_one_wall_may_touch_but_not_overlap(hall, second, fits):
    assert is_accepted(hall, WINDOW, f"{WINDOW}, {second}") is fits


def test_the_centre_of_a_box_that_moves_is_above_the_floor(hall):
    path = "path: [{t_s: 0, position_m: [0, 0, 0.3]}"
    assert is_accepted(hall, path, path.replace("0.3", "0.1"))
    assert not is_accepted(hall, path, path.replace("0.3", "0.0"))
    assert not is_accepted(hall, path, path.replace("0.3", "3.0"))


def test_the_places_of_all_materials_are_known(hall, tmp_path):
    hall()
    used = dict(materials_used(read_scene(tmp_path / "hall.yaml")))
    assert used[("room", "floor")] == "stone"
    assert used[("room", "windows", 0, "pane")] == "pane"
    assert used[("room", "windows", 0, "reveal")] == "grain"
    assert used[("boxes", 1, "material")] == "glow"
    assert used[("boards", 0, "material")] == "steel"
    assert used[("movers", 0, "material")] == "grain"


def test_a_wall_with_a_material_of_its_own_is_checked_as_well(hall):
    assert is_accepted(hall, "wall: grain\n", "wall: grain\n  walls: {east: stone}\n")
    with pytest.raises(SuiteError, match=r"room\.walls\.east: no material named 'stoone'"):
        hall("wall: grain\n", "wall: grain\n  walls: {east: stoone}\n")


@pytest.mark.parametrize("name", ["floor", "ceiling", "wall_north", "wall_west", "window_0", "sun", "panel", "cart"])
def test_no_thing_may_have_the_name_of_another_or_of_a_part_of_the_room(hall, name):
    with pytest.raises(SuiteError, match=f"two things are called '{name}'; rename one of them"):
        hall("name: crate", f"name: {name}")


def test_a_second_window_takes_a_name_of_its_own(hall):
    crate = "]\nboxes: [{name: crate"
    window_1 = "]\nboxes: [{name: window_1"
    two_windows = f"{WINDOW}, {window('south', 0, 1.5)}"
    assert is_accepted(hall, f"{WINDOW}{crate}", f"{WINDOW}{window_1}")
    assert is_accepted(hall, f"{WINDOW}{crate}", f"{two_windows}{crate}")
    assert not is_accepted(hall, f"{WINDOW}{crate}", f"{two_windows}{window_1}")


@pytest.mark.parametrize(
    ("light", "is_lit"),
    [
        ("sky: {illuminance_lx: 1}", True),
        ("sun: {illuminance_lx: 1, azimuth_deg: 0, elevation_deg: 45}", True),
        ("lamps: [{name: bulb, kind: point, center_m: [0, 0, 1], power_lm: 1}]", True),
        ("furniture: [{kind: table, name: desk, at_m: [0, 0, 0]}]", True),
        ("sun: {illuminance_lx: 0, azimuth_deg: 0, elevation_deg: 45}", False),
        ("lamps: [{name: bulb, kind: point, center_m: [0, 0, 1], power_lm: 0}]", False),
        ("materials: {glow: {kind: luminous, luminance_cd_m2: 1}}", True),
    ],
)
def test_a_scene_needs_something_that_can_emit_light(tmp_path, light, is_lit):
    room = "room: {size_m: [4, 4, 3], floor: oak_floor, wall: paint, ceiling: paint}"
    path = tmp_path / "cave.yaml"
    path.write_text(f"name: cave\nwhite_cd_m2: 1\n{light}\n{room}\n")
    if is_lit:
        read_scene(path)
    else:
        with pytest.raises(SuiteError, match=r"a scene needs a light: .*; all lights that it has are 0"):
            read_scene(path)
