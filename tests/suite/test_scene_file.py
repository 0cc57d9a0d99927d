"""A scene's YAML: every kind of thing it may hold is built where it says, and what is wrong is one line."""

from pathlib import Path

import numpy as np
import pytest
from trimesh import Trimesh

from vobench.errors import SuiteError
from vobench.scene.light import AreaLight, PointLight, Sky, SpotLight, Sun
from vobench.scene.material import LUMINANCE
from vobench.scene.mesh import joined
from vobench.scene.scene import Scene
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

# ruff: noqa: E501 - tables of sentences are easier to read a line each


def of_material(scene: Scene, material: str) -> Trimesh:
    """All that has a material."""
    return joined([thing.mesh for thing in scene.things if thing.material == material])


def test_materials_are_of_the_kind_they_say(hall):
    materials = hall().materials
    kinds = [materials[name].kind for name in ("grain", "stone", "steel", "pane")]
    assert kinds == ["body", "body", "mirror", "pane"]
    assert [materials[name].is_coated for name in ("grain", "stone")] == [False, True]
    assert (materials["stone"].eta, materials["stone"].roughness, materials["steel"].tint) == (1.4, 0.1, 0.6)


def test_lights_are_of_the_kind_they_say_and_a_luminous_thing_is_one(hall):
    lights = hall().lights
    assert [type(light) for light in lights] == [AreaLight, PointLight, SpotLight, Sun, Sky, AreaLight]
    assert lights[5].name == "box_1"
    assert lights[5].luminance_cd_m2 == pytest.approx(100)
    assert lights[5].power_lm == pytest.approx(100 * np.pi * 6 * 0.1**2)


def test_coloured_light_has_the_power_it_is_said_to_have(hall):
    scene = hall("power_lm: 500", "power_lm: 500, colour: [1, 0.5, 0.25]")
    (bulb,) = (light for light in scene.lights if light.name == "bulb")
    assert np.array(bulb.colour) @ LUMINANCE == pytest.approx(1)
    assert bulb.colour[1] / bulb.colour[0] == pytest.approx(0.5)
    assert bulb.power_lm == 500


def test_a_spot_points_at_its_target_and_the_sun_where_its_angles_say(hall):
    by_name = {light.name: light for light in hall().lights}
    np.testing.assert_allclose(by_name["spot"].direction, [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(by_name["sun"].direction(0), [0, np.sqrt(3) / 2, 0.5], atol=1e-12)


@pytest.mark.parametrize(
    ("wall", "middle"),
    [("north", [1, 2.15, 1.5]), ("south", [1, -2.15, 1.5]), ("east", [3.15, 1, 1.5]), ("west", [-3.15, 1, 1.5])],
)
def test_a_window_is_in_its_wall_at_its_place_along_the_world_axis(hall, wall, middle):
    scene = hall("wall: north", f"wall: {wall}")
    pane = of_material(scene, "pane").vertices
    np.testing.assert_allclose(pane.mean(0), middle, atol=1e-9)
    assert np.ptp(pane, axis=0)[2] == pytest.approx(0.8)
    assert np.ptp(pane, axis=0)[:2].max() == pytest.approx(1.0)


def test_boards_stand_upright_and_look_where_they_face(hall):
    for yaw_deg, normal in ((0, [1, 0, 0]), (90, [0, 1, 0]), (-90, [0, -1, 0])):
        scene = hall("size_m: [1, 2], material: steel", f"size_m: [1, 2], yaw_deg: {yaw_deg}, material: steel")
        (board,) = (thing.mesh for thing in scene.things if thing.name == "looking_glass")
        np.testing.assert_allclose(board.vertex_normals, [normal] * len(board.vertex_normals), atol=1e-9)
        np.testing.assert_allclose(sorted(np.ptp(board.vertices, axis=0)), [0, 1, 2], atol=1e-9)


def test_movers_go_with_their_path(hall):
    (cart,) = hall().movers
    np.testing.assert_allclose(cart.path.pose(1e9)[:3, 3], [0.5, 0, 0.3])
    assert sum(len(thing.mesh.faces) for thing in cart.things) == 12


WRONG = [
    ("{kind: mirror, tint: 0.6}", "{kind: mirror, albedo: 0.6}", ":6: materials.steel.albedo: belongs to matt, polished; this is mirror"),
    ("{kind: mirror, tint: 0.6}", "{kind: chrome}", ":6: materials.steel.kind: no kind of material named 'chrome'. Known: glass, luminous, matt, mirror, polished"),
    ("pattern: terrazzo, ", "", ":4: materials.grain.pattern: this key is missing"),
    ("{kind: luminous, luminance_cd_m2: 100}", "{kind: luminous}", ":8: materials.glow.luminance_cd_m2: this key is missing"),
    ("target_m: [2, -1, 0], ", "", ":20: lamps.2.target_m: this key is missing"),
    ("target_m: [2, -1, 0], ", "target_m: [2, -1, 0], inner_deg: 40, ", ":20: lamps.2.inner_deg: should be at most outer_deg, 30 (got 40)"),
    ("albedo: 0.4, eta: 1.4", "albedo: 0.4, eta: 0.9", ":5: materials.stone.eta: should be 1 or more (got 0.9)"),
    ("target_m: [2, -1, 0], ", "target_m: [2, -1, 2], ", ":20: lamps.2.target_m: should differ from center_m (got [2.0, -1.0, 2.0] for both)"),
    ("kind: point", "kind: point, size_m: [1, 1]", ":19: lamps.1.size_m: belongs to panel; this is point"),
    ("center_m: [1, 1.5], size_m: [1, 0.8]", "center_m: [2.8, 1.5], size_m: [1, 0.8]", ":14: room.windows.0: the window reaches beyond its wall, which is 6 m long around 0 and 3 m high: center_m [2.8, 1.5], size_m [1.0, 0.8]"),
    ("pane: pane, reveal", "pane: pain, reveal", ":14: room.windows.0.pane: no material named 'pain'. Did you mean 'paint'? Known: brick, carpet, ceiling_tiles, concrete, glow, grain, mirror, oak_floor, paint, pane, paving, sage_plaster, steel, stone, terrazzo, white_plaster"),
    ("name: crate", "name: cart", ":24: movers.0: two things are called 'cart'; rename one of them"),
    ("{name: bulb", "{name: sky", ":19: lamps.1: two things are called 'sky'; rename one of them"),
    ("name: crate", "name: window_0", ":15: boxes.0: two things are called 'window_0'; rename one of them"),
    ("{name: bulb", "{name: box_1", ":15: boxes.1: two things are called 'box_1'; rename one of them"),
    ("reveal: grain}]", "reveal: grain}, {wall: north, center_m: [1.9, 1.5], size_m: [1, 0.8], pane: pane, reveal: grain}]", ":14: room.windows.1: the window overlaps window 0 of the north wall, which has center_m [1.0, 1.5], size_m [1.0, 0.8]; move one or make it smaller"),
    ("[-2.9, 0, 1.5]", "[-3, 0, 1.5]", ":16: boards.0.center_m: should be inside the room, 6 × 4 × 3 m around the origin (got [-3.0, 0.0, 1.5])"),
    ("[0, 0, 2.9]", "[0, 0, 3.1]", ":18: lamps.0.center_m: should be inside the room, 6 × 4 × 3 m around the origin (got [0.0, 0.0, 3.1])"),
    ("[1, 0, 0.3]", "[4, 0, 0.3]", ":24: movers.0.path.1: should be inside the room, 6 × 4 × 3 m around the origin (got [4.0, 0.0, 0.3])"),
    ("size_m: [0.5, 0.4, 0.6], material: grain", "size_m: [0.5, 0.4, 0.6], material: glow", ":24: movers.0.material: 'glow' is luminous, but movers cannot emit light; use another kind of material"),
    ("{t_s: 2, position", "{t_s: 0, position", ":24: movers.0: times should increase, but 0 follows 0"),
    ("azimuth_deg: 90, elevation_deg: 30", "azimuth_deg: 90", ":21: sun: should have either azimuth_deg and elevation_deg, or a path"),
    ("azimuth_deg: 90, elevation_deg: 30", "azimuth_deg: 90, path: [{t_s: 0, azimuth_deg: 0, elevation_deg: 9}]", ":21: sun: should have either azimuth_deg and elevation_deg, or a path"),
    ("{flicker: {depth: 0.3}}", "{steady: null}", ":18: lamps.0.level: should have exactly one of steady, flicker, dimmer, switched"),
    ("{flicker: {depth: 0.3}}", "{flicker: {depth: 0.3}, steady: 1}", ":18: lamps.0.level: should have exactly one of steady, flicker, dimmer, switched"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "sentence"), WRONG, ids=[new or f"no {old}" for old, new, _ in WRONG])
def test_a_wrong_scene_gets_one_line_with_file_line_key_and_remedy(hall, tmp_path, old, new, sentence):
    with pytest.raises(SuiteError) as refused:
        hall(old, new)
    assert str(refused.value).removeprefix(str(tmp_path / "hall.yaml")) == sentence


def test_windows_may_touch(hall):
    beside = "{wall: north, center_m: [2, 1.5], size_m: [1, 0.8], pane: pane, reveal: grain}]"
    assert len(of_material(hall("reveal: grain}]", f"reveal: grain}}, {beside}"), "pane").faces) == 4


@pytest.mark.parametrize(
    ("light", "zero"), [("", ""), ("sky: {illuminance_lx: 0}\n", "; all lights that it has are 0")]
)
def test_a_scene_without_any_light_is_refused(tmp_path, light, zero):
    text = f"name: cave\nwhite_cd_m2: 1\nmaterials: {{m: {{pattern: plain, albedo: 0.5}}}}\n{light}"
    (tmp_path / "cave.yaml").write_text(f"{text}room: {{size_m: [3, 3, 3], floor: m, wall: m, ceiling: m}}\n")
    with pytest.raises(SuiteError, match=f"a scene needs a light: lamps, a sun, a sky or a luminous material{zero}$"):
        read_scene(tmp_path / "cave.yaml")


@pytest.mark.parametrize("name", ["room", "office", "flat", "hall", "ramp", "park"])
def test_our_own_scenes_are_valid(name):
    path = Path(__file__).parents[2] / "scenes" / name / "scene.yaml"
    scene = build(read_scene(path), {})
    assert {thing.material for thing in scene.things} <= set(scene.materials)
    assert 20_000 < sum(len(thing.mesh.faces) for thing in scene.things) < 300_000


def test_who_walks_is_a_mover_for_each_limb_and_may_stand_on_the_floor(tmp_path):
    way = "path: [{t_s: 0, position_m: [-1, 0, 0]}, {t_s: 2, position_m: [1, 0, 0]}]"
    text = "name: stage\nwhite_cd_m2: 9\nroom: {size_m: [4, 4, 3], floor: oak_floor, wall: paint, ceiling: paint}\n"
    text += f"sky: {{illuminance_lx: 9}}\nmovers: [{{name: ada, kind: person, {way}}}]\n"
    (tmp_path / "stage.yaml").write_text(text)
    scene = build(read_scene(tmp_path / "stage.yaml"), {})
    assert {mover.name for mover in scene.movers} == {"ada"} == {t.name for m in scene.movers for t in m.things}
    assert len(scene.movers) == 7
    assert {thing.material for mover in scene.movers for thing in mover.things} <= set(scene.materials)


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_a_scale_multiplies_every_length(hall, scale):
    whole = hall()
    sized = hall("white_cd_m2: 50", f"white_cd_m2: 50\nscale: {scale}")
    for before, after in zip(whole.things, sized.things, strict=True):
        np.testing.assert_allclose(after.mesh.vertices, scale * before.mesh.vertices, atol=1e-9)
    for before, after in zip(whole.movers, sized.movers, strict=True):
        np.testing.assert_allclose(after.path.pose(1e9)[:3, 3], scale * before.path.pose(1e9)[:3, 3])
