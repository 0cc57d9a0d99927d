"""vobench scene says what is in a scene, and draws it."""

from pathlib import Path

import cv2
import pytest
import trimesh

from tests.generated import write_cell
from vobench.estimator import isolation
from vobench.estimator.program import sandbox_here
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
    assert said.err.strip().endswith("--out should be a .png in an existing folder, got nowhere/look.png")
    (here / "bad.glb").write_bytes(b"no model")
    assert "bad.glb: " in vobench("scene", "bad.glb").err


def test_a_hall_with_z_up_is_doubted_until_its_scene_says_so(vobench, here):
    hall = trimesh.creation.box((8, 7.66, 2.5), trimesh.transformations.translation_matrix((0, 0, 1.25)))
    hall.invert()
    trimesh.Scene([hall]).export(here / "hall.glb")
    lying = vobench("scene", "hall.glb").out
    assert "size: 8.00 x 2.50 x 7.66 m" in lying
    doubt = "hall.glb: probably lies on its side. It is read with y up; if z is up, say so in a scene's YAML: "
    assert f"{doubt}meshes: [{{file: hall.glb, up: z}}]" in lying.splitlines()

    said = "name: hall\nwhite_cd_m2: 100\nmeshes: [{file: hall.glb, up: z}]\nsky: {illuminance_lx: 8000}\n"
    (here / "hall.yaml").write_text(said)
    upright = vobench("scene", "hall.yaml").out
    assert "size: 8.00 x 7.66 x 2.50 m" in upright
    assert "floor at 0.00 m" in upright
    assert "side?" not in upright


MAKER = """
from pathlib import Path
Path({ran!r}).touch()
from vobench.asset.room import things
def make(seed):
    return (), {{}}
"""
VERBS = ("check", "scene", "render", "drive", "run")


@pytest.fixture
def strange(here, tmp_path_factory):
    """A stranger's folder with the scene `theirs`, whose maker leaves a file `ran`, and a suite of it in ours."""
    folder = tmp_path_factory.mktemp("strange")
    (folder / "maker.py").write_text(MAKER.format(ran=str(folder / "ran")))
    (folder / "theirs.yaml").write_text((here / "scenes" / "closet.yaml").read_text() + "maker: maker.py\n")
    suite = (here / "suites" / "tiny.yaml").read_text().replace("[closet]", f"['{folder}/theirs.yaml']")
    (here / "suites" / "theirs.yaml").write_text(suite)
    return folder


@pytest.fixture
def no_sandbox(monkeypatch):
    monkeypatch.setenv("VOBENCH_SANDBOX", "off")
    sandbox_here.cache_clear()
    yield
    sandbox_here.cache_clear()


def _asked(verb, strange):
    return f"{strange}/theirs.yaml" if verb in ("scene", "render") else "theirs"


@pytest.mark.parametrize("verb", VERBS)
def test_without_a_sandbox_a_strangers_maker_does_not_run_before_it_is_trusted(vobench, strange, no_sandbox, verb):
    ran = strange / "ran"
    asked = _asked(verb, strange)
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


@pytest.mark.parametrize("verb", VERBS)
def test_in_the_sandbox_a_strangers_maker_leaves_nothing_and_is_named(vobench, strange, verb):
    if isolation.FILES in sandbox_here().sees:
        pytest.skip("this machine has no sandbox")
    said = vobench(verb, _asked(verb, strange))
    assert not (strange / "ran").exists()
    assert said.err.count(f"runs the program {strange}/maker.py") == 1
    assert "Read-only file system" in said.err + said.out or "Permission denied" in said.err + said.out


@pytest.fixture
def cell(here):
    """The scene `cell` of a stranger's generator beside the suites."""
    return write_cell(here / "scenes" / "cell")


def test_a_place_of_a_generator_is_surveyed_by_its_seed_and_its_lighting(vobench, cell):
    said = vobench("scene", "cell", "--seed", 3, "--lighting", "evening")
    assert said.code == 0
    assert said.out.splitlines()[0].startswith("cell.3.evening: 6 things, ")
    assert said.err.count("generator.py") == 1  # it runs in the sandbox, and is named
    other = vobench("scene", "cell", "--seed", 4, "--lighting", "evening").out
    assert [line for line in other.splitlines() if line.startswith("size: ")] != [
        line for line in said.out.splitlines() if line.startswith("size: ")
    ]


def test_a_contact_sheet_has_a_picture_for_each_seed(vobench, cell, here, monkeypatch):
    asked = []
    monkeypatch.setattr("vobench.cli.scene.save_place_sheet", lambda *words, **options: asked.append((words, options)))
    assert vobench("scene", "cell", "--seeds", 3, "--out", "sheet.png").code == 0
    assert vobench("scene", "cell", "--seeds", 2, "--seed", 7, "--lighting", "night", "--out", "sheet.png").code == 0
    (words, first), (_, second) = asked
    assert words == ("cell", Path("sheet.png"))
    assert (first["seeds"], first["first_seed"], first["lighting"]) == (3, 1, "drawn")
    assert (second["seeds"], second["first_seed"], second["lighting"]) == (2, 7, "night")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("cell",), "'cell' has only a generator; give it a seed, as in {name: cell, seed: 1}"),
        (("cell", "--seeds", 2), "--seeds draws a sheet; add --out sheet.png"),
        (("cell", "--lighting", "night"), "--lighting is for the places of a generator; add --seed"),
        (("closet", "--seed", 2), "'closet' has no generator, so it has no seeds; leave seed and seeds out"),
        (("cell", "--seed", 2, "--lighting", "nigth"), "no lighting named 'nigth'. Did you mean 'night'?"),
    ],
)
def test_a_mistake_about_seeds_is_one_line(vobench, cell, words, sentence):
    said = vobench("scene", *words)
    assert said.code == 1
    assert sentence in said.err
    assert said.err.count("\n") == 1
