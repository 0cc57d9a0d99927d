"""vobench scene says what is in a scene, and draws it."""

import cv2


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
