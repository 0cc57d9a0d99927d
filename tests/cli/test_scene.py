"""vobench scene says what is in a scene, and draws it."""

import cv2
import pytest

from vobench.suite import scene_build


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


MAKER = """
from pathlib import Path
Path({ran!r}).touch()
from vobench.asset.room import things
def make(seed):
    return (), {{}}
"""


@pytest.mark.parametrize("verb", ["check", "scene", "render", "drive", "run"])
def test_a_strangers_maker_does_not_run_before_it_is_trusted(vobench, here, tmp_path_factory, verb):
    strange = tmp_path_factory.mktemp("strange")
    ran = strange / "ran"
    (strange / "maker.py").write_text(MAKER.format(ran=str(ran)))
    (strange / "theirs.yaml").write_text((here / "scenes" / "closet.yaml").read_text() + "maker: maker.py\n")
    suite = (here / "suites" / "tiny.yaml").read_text().replace("[closet]", f"['{strange}/theirs.yaml']")
    (here / "suites" / "theirs.yaml").write_text(suite)
    asked = f"{strange}/theirs.yaml" if verb in ("scene", "render") else "theirs"
    said = vobench(verb, asked)
    assert said.code == (0 if verb == "drive" else 1)  # which goes on, and says what cameras cannot be checked
    assert "--trust" in said.err + said.out
    assert not ran.exists()
    trusted = vobench(verb, asked, "--trust")
    assert ran.exists()
    assert trusted.err.count(f"runs the program {strange}/maker.py") == 1
    ran.unlink()
    scene_build._scenes.clear()  # what this process has built it does not build again
    vobench(verb, asked)
    assert ran.exists() or verb == "run"  # what is cached needs no maker
