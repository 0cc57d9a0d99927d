"""vobench scene says what is in a scene, and draws it."""

import cv2
import trimesh


def test_it_says_what_is_there_and_what_is_free(vobench):
    said = vobench("scene", "closet")
    assert said.code == 0
    lines = said.out.splitlines()
    assert lines[0].startswith("closet: ")
    assert any(line.startswith("free circle: ") and "floor at 0.00 m" in line for line in lines)
    facts = vobench("scene", "closet", "--json").json
    assert facts["faces"] > 0
    assert facts["backs"] == 0


def test_it_draws_a_plan_and_views_to_four_sides(vobench, here):
    assert vobench("scene", "closet", "--out", "look.png").code == 0
    assert cv2.imread(str(here / "look.png")).shape == (640, 1440, 3)


def test_a_wrong_path_is_one_line(vobench, here):
    said = vobench("scene", "closet", "--out", "nowhere/look.png")
    assert said.code == 1
    assert said.err.strip().endswith("--out should be a .png in a folder that exists, got nowhere/look.png")
    (here / "bad.glb").write_bytes(b"no model")
    assert "bad.glb: " in vobench("scene", "bad.glb").err


def test_a_hall_with_z_up_is_doubted_until_its_scene_says_so(vobench, here):
    hall = trimesh.creation.box((8, 7.66, 2.5), trimesh.transformations.translation_matrix((0, 0, 1.25)))
    hall.invert()
    trimesh.Scene([hall]).export(here / "hall.glb")
    lying = vobench("scene", "hall.glb").out
    assert "size: 8.00 x 2.50 x 7.66 m" in lying
    doubt = "hall.glb: stands on its side? It is read with y up; if z is up, say so in a scene's YAML: "
    assert f"{doubt}meshes: [{{file: hall.glb, up: z}}]" in lying.splitlines()

    said = "name: hall\nwhite_cd_m2: 100\nmeshes: [{file: hall.glb, up: z}]\nsky: {illuminance_lx: 8000}\n"
    (here / "hall.yaml").write_text(said)
    upright = vobench("scene", "hall.yaml").out
    assert "size: 8.00 x 7.66 x 2.50 m" in upright
    assert "floor at 0.00 m" in upright
    assert "side?" not in upright
