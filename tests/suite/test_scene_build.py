"""What a scene's YAML names is built where it says: furniture, models, what makers make, and what of these moves."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from vobench.asset import FINISHES, FURNITURE
from vobench.asset import room as kinds
from vobench.errors import ModelError, SuiteError
from vobench.scene.fog import Fog
from vobench.scene.light import AreaLight, PointLight
from vobench.scene.material import LUMINANCE, linear
from vobench.scene.rain import Rain
from vobench.scene.scene import Scene
from vobench.suite.scene_build import build, build_once
from vobench.suite.scene_file import read_scene, scene_content

YAML = """name: yard
white_cd_m2: 50
seed: 3
materials: {stone: {pattern: terrazzo, albedo: 0.5, resolution_px: 8, colour: [1, 0.5, 0.25]}}
boxes: [{name: plinth, center_m: [0, 0, -0.1], size_m: [8, 8, 0.2], material: stone}]
sky: {illuminance_lx: 8000}
"""
MAKER = """import numpy as np
from vobench.asset.shape import at, lathe
from vobench.scene.material import Material
from vobench.scene.mesh import moved
from vobench.scene.triangles import Thing

def make(seed):
    column = lathe([[0, 0], [0.3, 0], [0.3, 2.0], [0, 2.0]])
    return (Thing("column", moved(column, at(seed, 0, 0)), "chalk"),), {"chalk": Material(colour=(0.8, 0.8, 0.7))}
"""


def glb(path: Path, *, emission: float = 0.0) -> None:
    """One triangle of a node called Sail, upright in glTF's axes, at (1, 2, 3) there."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32).tobytes()
    material = {"name": "cloth", "emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": {}}}
    material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": emission}}
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "Sail", "mesh": 0, "translation": [1, 2, 3]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
        "materials": [material if emission else {"name": "cloth"}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(points)}],
        "buffers": [{"byteLength": len(points)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(points), 0x004E4942) + points
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


@pytest.fixture
def yard(tmp_path: Path):
    """Builds the yard with some lines added."""

    def of(more: str = "") -> Scene:
        replaced = {line.split(":")[0] for line in more.splitlines()}
        kept = (line for line in YAML.splitlines() if line.split(":")[0] not in replaced)
        (tmp_path / "yard.yaml").write_text("\n".join([*kept, more]))
        return build(read_scene(tmp_path / "yard.yaml"), {})

    return of


def vertices(scene: Scene, name: str) -> np.ndarray:
    return np.concatenate([thing.mesh.vertices for thing in scene.things if thing.name == name])


def test_a_scene_that_is_built_once_is_equal_and_not_kept(tmp_path: Path) -> None:
    path = tmp_path / "yard.yaml"
    path.write_text(YAML, encoding="utf-8")
    spec = read_scene(path)
    once = build_once(spec, {})
    kept = build(spec, {})
    assert build(spec, {}).things is kept.things
    assert build_once(spec, {}).things[0] is not once.things[0]
    assert np.array_equal(once.things[0].mesh.vertices, kept.things[0].mesh.vertices)
    assert [light.name for light in once.lights] == [light.name for light in kept.lights]


def test_the_names_that_a_yaml_may_say_are_those_that_there_are() -> None:
    assert sorted(FURNITURE) == sorted(kinds.KINDS)
    assert sorted(FINISHES) == sorted(kinds.FINISHES)


def test_furniture_stands_where_it_says_with_its_front_as_it_says(yard) -> None:
    scene = yard("furniture: [{kind: desk, name: d, at_m: [2, 1, 0], yaw_deg: 90, size: {width_m: 2.0}}]\n")
    low, high = vertices(scene, "d").min(0), vertices(scene, "d").max(0)
    np.testing.assert_allclose((low + high)[:2] / 2, [2, 1], atol=0.1)
    assert high[0] - low[0] == pytest.approx(2.0, abs=0.02)  # turned: its width lies along x
    assert low[2] == pytest.approx(0, abs=1e-6)


def test_another_piece_changes_no_other(yard) -> None:
    one = "{kind: shelf, name: s, at_m: [0, 2, 0]}"
    alone, both = yard(f"furniture: [{one}]\n"), yard(f"furniture: [{{kind: mug, name: m, at_m: [1, 1, 0]}}, {one}]\n")
    np.testing.assert_array_equal(vertices(alone, "s"), vertices(both, "s"))


def test_a_piece_is_built_anew_for_another_place_or_seed_alone(yard, monkeypatch) -> None:
    built, build_piece = list[int](), kinds.Piece.build
    monkeypatch.setattr(kinds.Piece, "build", lambda piece, seed: built.append(seed) or build_piece(piece, seed))
    pots = [f"furniture: [{{kind: plant, name: pot, at_m: [{x}, 2, 0]}}]\n" for x in (0.125, 0.375)]
    lit = yard(pots[0]), yard(pots[0] + "white_cd_m2: 60\n"), yard(pots[1]), yard(pots[0] + "seed: 4\n")
    assert built == [3, 3, 4]
    first, dimmer, moved, other = (vertices(scene, "pot") for scene in lit)
    np.testing.assert_array_equal(first, dimmer)
    np.testing.assert_allclose(moved - first, np.broadcast_to([0.25, 0, 0], first.shape), atol=1e-6)
    assert other.shape != first.shape or np.abs(other - first).max() > 0.01


def test_what_a_maker_of_furniture_does_not_know_is_named(yard) -> None:
    with pytest.raises(SuiteError, match=r"furniture 'd': TypeError: .*'colour_of_legs'"):
        yard("furniture: [{kind: desk, name: d, at_m: [0, 0, 0], size: {colour_of_legs: red}}]\n")
    with pytest.raises(SuiteError, match=r"no piece of furniture named 'desc'\. Did you mean 'desk'"):
        yard("furniture: [{kind: desc, name: d, at_m: [0, 0, 0]}]\n")


def test_a_model_is_placed_and_its_names_begin_with_its_own(yard, tmp_path: Path) -> None:
    glb(tmp_path / "sail.glb")
    scene = yard("meshes: [{file: sail.glb, name: boat, at_m: [0, 0, 1], yaw_deg: 90, scale: 2}]\n")
    # glTF's (x, y, z) are (x, -z, y); then twice as large, turned to the left and lifted.
    expected = [[6, 2, 5], [6, 4, 5], [6, 2, 7]]
    np.testing.assert_allclose(sorted(vertices(scene, "boat.Sail").tolist()), sorted(map(list, expected)), atol=1e-6)
    assert {thing.material for thing in scene.things if thing.name == "boat.Sail"} == {"boat.cloth"}


def test_a_model_alone_is_a_scene_where_it_has_light(tmp_path: Path) -> None:
    glb(tmp_path / "lit.glb", emission=500.0)
    spec = read_scene(tmp_path / "lit.glb")
    (light,) = build(spec, {}).lights
    assert isinstance(light, AreaLight)
    assert light.luminance_cd_m2 == pytest.approx(500)
    assert light.power_lm == pytest.approx(500 * np.pi * 0.5)
    assert spec.white_cd_m2 is None
    glb(tmp_path / "dark.glb")
    assert {light.name for light in build(read_scene(tmp_path / "dark.glb"), {}).lights} == {"sun", "sky"}


@pytest.mark.parametrize(("colour", "share"), [((0.3, 0.3, 0.3), 0.3), (None, 0.5), ((1.0, 1.0, 1.0), 0.9)])
def test_a_dark_room_from_a_file_gets_a_lamp_for_what_its_walls_reflect(
    tmp_path: Path, colour: tuple[float, ...] | None, share: float
) -> None:
    room = trimesh.creation.box((4, 4, 3))
    room.invert()
    if colour:
        room.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(
            name="paint", baseColorFactor=[*colour, 1.0], roughnessFactor=1.0, metallicFactor=0.0
        ))  # fmt: skip
    room.export(tmp_path / "room.glb")
    spec = read_scene(tmp_path / "room.glb")
    (lamp,) = build(spec, {}).lights
    assert isinstance(lamp, AreaLight)
    assert lamp.power_lm == pytest.approx(400 * room.area * (1 - share), rel=0.01)


def test_a_dark_hall_from_a_file_gets_lamps_all_over_its_floor_but_in_no_thing(tmp_path: Path) -> None:
    hall, block = trimesh.creation.box((60, 8, 40)), trimesh.creation.box((9, 7.9, 9))  # glTF's y is up
    hall.apply_translation((0, 4, 0))
    hall.invert()
    block.apply_translation((0, 3.95, 10))  # in the middle of one of six parts of the floor
    trimesh.Scene([hall, block]).export(tmp_path / "hall.glb")
    lights = build(read_scene(tmp_path / "hall.glb"), {}).lights
    assert all(isinstance(light, AreaLight) for light in lights)
    corners_m = np.array([vertices_of(light) for light in lights])  # (L, 4, 3)
    middles_m = corners_m.mean(1)
    quarters = np.unique(middles_m[:, :2] > 0, axis=0)
    assert len(quarters) == 4
    is_in_block = (np.abs(corners_m[..., :2] - [0, -10]) < 4.5).all(-1)
    assert not is_in_block.any()
    assert ((middles_m[:, 2] > 7) & (middles_m[:, 2] < 8)).all()


def vertices_of(light: AreaLight) -> np.ndarray:
    return np.asarray(light.mesh.vertices)


def test_a_board_shows_the_whole_of_its_picture_whatever_its_tile(yard) -> None:
    for tile_m in (1.0, 1.6):
        sign = f"{{pattern: poster, albedo: 0.5, tile_m: {tile_m}}}"
        stone = "{pattern: plain, albedo: 0.5}"
        board = "{center_m: [0, 0, 1], size_m: [1.2, 0.7], material: sign, name: b}"
        scene = yard(f"materials: {{sign: {sign}, stone: {stone}}}\nboards: [{board}]\n")
        (shown_board,) = [thing for thing in scene.things if thing.name == "b"]
        shown = np.asarray(shown_board.mesh.visual.uv) / scene.materials["sign"].tile_m
        np.testing.assert_allclose([shown.min(0), shown.max(0)], [[0, 0], [1, 1]])


def test_a_file_that_is_not_there_or_no_model_is_one_sentence(yard, tmp_path: Path) -> None:
    with pytest.raises(SuiteError, match=r"yard.yaml:7: meshes.0.file: there is no such file beside the scene"):
        yard("meshes: [{file: no.glb}]\n")
    (tmp_path / "bad.glb").write_bytes(b"nothing")
    with pytest.raises(ModelError, match=r"bad.glb: "):
        yard("meshes: [{file: bad.glb}]\n")


@pytest.mark.slow
def test_a_maker_gets_the_scenes_seed_and_what_it_raises_is_named(yard, tmp_path: Path) -> None:
    (tmp_path / "maker.py").write_text(MAKER)
    np.testing.assert_allclose(vertices(yard("maker: maker.py\n"), "column").mean(0)[:2], [3, 0], atol=0.05)
    (tmp_path / "maker.py").write_text(MAKER.replace("seed, 0, 0", "1 / 0, 0, 0"))
    with pytest.raises(SuiteError, match=r"maker.py: ZeroDivisionError: division by zero"):
        yard("maker: maker.py\n")
    (tmp_path / "maker.py").write_text(MAKER.replace('{"chalk"', '{"cheese"'))
    with pytest.raises(SuiteError, match=r"returns things without materials: chalk"):
        yard("maker: maker.py\n")


TRIMESH_MAKER = """import trimesh
from vobench.scene.material import Material
from vobench.scene.triangles import Thing

def make(seed):
    column = trimesh.creation.cylinder(0.3, 2.0)
    return [Thing("column", column, "chalk")], {"chalk": Material(colour=(0.8, 0.8, 0.7))}
"""


@pytest.mark.slow
def test_a_maker_may_return_meshes_of_trimesh_and_nothing_else(yard, tmp_path: Path) -> None:
    maker = tmp_path / "maker.py"
    maker.write_text(TRIMESH_MAKER)
    column = vertices(yard("maker: maker.py\n"), "column")
    np.testing.assert_allclose([column[:, 2].min(), column[:, 2].max()], [-1, 1])
    maker.write_text(TRIMESH_MAKER.replace("trimesh.creation.cylinder(0.3, 2.0)", "[[0, 0, 0]]"))
    with pytest.raises(SuiteError, match=r"returns 'column' with a mesh of type list; it should be a trimesh"):
        yard("maker: maker.py\n")
    grain = "Material(texture=__import__('vobench.asset.texture').asset.texture.Procedural('plaster', 0.5))"
    maker.write_text(TRIMESH_MAKER.replace("Material(colour=(0.8, 0.8, 0.7))", grain))
    with pytest.raises(SuiteError, match=r"'column' with a texture but without texture coordinates; set mesh.visual"):
        yard("maker: maker.py\n")


def test_files_count_by_what_is_in_them_wherever_they_lie(yard, tmp_path: Path) -> None:
    said = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "yard.yaml").write_text(f"{YAML}maker: maker.py\n")
        (tmp_path / folder / "maker.py").write_text(MAKER)
        said.append(scene_content(read_scene(tmp_path / folder / "yard.yaml")))
    assert said[0] == said[1]
    (tmp_path / "b" / "maker.py").write_text(MAKER + "# another\n")
    assert scene_content(read_scene(tmp_path / "b" / "yard.yaml")) != said[0]


def test_what_moves_stands_in_the_middle_of_its_own_frame_with_its_own_size(yard) -> None:
    path = "path: [{t_s: 0, position_m: [0, 0, 0]}, {t_s: 1, position_m: [1, 0, 0]}]"
    box, table = yard(
        f"movers: [{{name: b, size_m: [1, 2, 0.5], material: stone, {path}}}, {{name: s, kind: table, {path}}}]\n"
    ).movers
    (thing,) = box.things
    np.testing.assert_allclose(thing.mesh.bounds, [[-0.5, -1, -0.25], [0.5, 1, 0.25]])
    assert thing.mesh.area == pytest.approx(2 * (1 * 2 + 1 * 0.5 + 2 * 0.5))
    corners_m = np.concatenate([thing.mesh.vertices for thing in table.things])
    low_m, high_m = corners_m.min(0), corners_m.max(0)
    assert low_m[2] == pytest.approx(0, abs=1e-6)
    assert (low_m + high_m)[:2] == pytest.approx([0, 0], abs=0.05)


def test_furniture_and_models_can_move(yard, tmp_path: Path) -> None:
    glb(tmp_path / "sail.glb")
    path = "path: [{t_s: 0, position_m: [0, 0, 0]}, {t_s: 1, position_m: [1, 0, 0]}]"
    scene = yard(f"movers: [{{name: c, kind: chair, {path}}}, {{name: s, file: sail.glb, {path}}}]\n")
    assert [mover.name for mover in scene.movers] == ["c", "s"]
    assert {thing.name for mover in scene.movers for thing in mover.things} == {"c", "s"}
    assert {thing.material for mover in scene.movers for thing in mover.things} <= set(scene.materials)
    with pytest.raises(SuiteError, match="should be a box with size_m and material, or a kind of furniture"):
        yard(f"movers: [{{name: c, kind: chair, file: sail.glb, {path}}}]\n")


def test_a_material_takes_a_colour_and_a_lamp_a_hue(yard) -> None:
    scene = yard("lamps: [{name: l, kind: point, center_m: [0, 0, 2], power_lm: 100, colour: [0, 1, 0]}]\n")
    assert scene.materials["stone"].colour == (1, 0.5, 0.25)
    (lamp,) = (light for light in scene.lights if isinstance(light, PointLight))
    assert lamp.colour == pytest.approx((0, 1 / 0.7152, 0))
    with pytest.raises(SuiteError, match="light should not be black"):
        yard("lamps: [{name: l, kind: point, center_m: [0, 0, 2], power_lm: 100, colour: [0, 0, 0]}]\n")


def test_a_scene_of_nothing_is_refused(tmp_path: Path) -> None:
    (tmp_path / "void.yaml").write_text("name: void\nwhite_cd_m2: 1\nsky: {illuminance_lx: 1}\n")
    with pytest.raises(SuiteError, match="a scene needs something visible: room, boxes, boards, furniture"):
        read_scene(tmp_path / "void.yaml")


def test_a_screen_gives_the_light_of_its_picture(yard) -> None:
    scene = yard("furniture: [{kind: monitor, name: m, at_m: [0, 0, 1]}]\n")
    (lamp,) = (light for light in scene.lights if isinstance(light, AreaLight))
    look = scene.materials[lamp.material]
    assert look.emission_texture is not None
    shown = np.array(look.emission_cd_m2) * linear(look.emission_texture.pixels()[..., :3]).mean((0, 1), dtype=float)
    assert lamp.luminance_cd_m2 == pytest.approx(shown @ LUMINANCE, rel=1e-6)
    np.testing.assert_allclose(lamp.luminance_cd_m2 * np.array(lamp.colour), shown, rtol=1e-6)
    assert shown.max() < 0.9 * max(look.emission_cd_m2)


def test_a_scene_has_the_fog_of_its_file_which_grows_with_its_scale(tmp_path: Path) -> None:
    (tmp_path / "yard.yaml").write_text(YAML + "fog: {visibility_m: 60, airlight: sky}\nscale: 2\n")
    assert build(read_scene(tmp_path / "yard.yaml"), {}).fog == Fog(visibility_m=120.0, airlight="sky")


def test_a_scene_has_the_rain_of_its_file(tmp_path: Path) -> None:
    (tmp_path / "yard.yaml").write_text(YAML + "rain: {rate_mm_per_h: 5, puddles: 0.1, wind_mps: [2, 0]}\n")
    rain = build(read_scene(tmp_path / "yard.yaml"), {}).rain
    assert rain == Rain(rate_mm_per_h=5.0, puddles=0.1, wind_mps=(2.0, 0.0))


def test_rain_without_a_sky_is_refused(tmp_path: Path) -> None:
    lamp = "lamps: [{name: bulb, kind: point, center_m: [0, 0, 2], power_lm: 900}]\n"
    indoors = YAML.replace("sky: {illuminance_lx: 8000}\n", lamp)
    (tmp_path / "yard.yaml").write_text(indoors + "rain: {}\n")
    with pytest.raises(SuiteError, match="rain falls from a sky, and the scene has none"):
        build(read_scene(tmp_path / "yard.yaml"), {})


def test_airlight_of_a_sky_without_a_sky_is_refused(tmp_path: Path) -> None:
    lamp = "lamps: [{name: bulb, kind: point, center_m: [0, 0, 2], power_lm: 900}]\n"
    indoors = YAML.replace("sky: {illuminance_lx: 8000}\n", lamp)
    (tmp_path / "yard.yaml").write_text(indoors + "fog: {visibility_m: 60, airlight: sky}\n")
    with pytest.raises(SuiteError, match="airlight 'sky' requires a sky, and the scene has none"):
        build(read_scene(tmp_path / "yard.yaml"), {})
