"""What `vobench render` refuses, before anything is drawn."""

import cv2
import pytest

from vobench.cli.render import CameraOptions, EngineOptions

WRONG = [
    (("--at", "9", "0", "1"), "--at should be inside the room (2 × 2 × 1.5 m around the origin), got (9.0, 0.0, 1.0)"),
    (("--at", "nan", "0", "1"), "--at should be inside the room"),
    (("--yaw", "nan"), "--yaw should be a finite number, got nan"),
    (("--pitch", "inf"), "--pitch should be a finite number, got inf"),
    (("--time", "nan"), "--time should be a finite number, got nan"),
    (("--time", "1e12"), "--time should be within 1e+09 s of the start, got 1e+12"),
    (("--out", "look.jpg"), "--out should be a .png in an existing folder, got look.jpg"),
    (("--out", "nowhere/look.png"), "--out should be a .png in an existing folder, got nowhere/look.png"),
    (("--camera", "fisheyes"), "no camera named 'fisheyes'. Did you mean 'fisheye'?"),
    (("--sensor", "film"), "no camera sensor named 'film'. Known: clean"),
    (("--engine", "rater"), "--engine: no engine named 'rater'. Did you mean 'raster'?"),
    (("--samples", "5"), "the engine raster takes 4 or 16 samples, got 5"),
    (
        ("--engine", "pyrender", "--samples", "4"),
        "samples requires engine raster or path, but the engine is pyrender; remove samples",
    ),
    (("--engine", "pyrenderer"), "--engine: no engine named 'pyrenderer'. Did you mean 'pyrender'?"),
    (("--engine", "path", "--samples", "0"), "--samples: should be 1 or more (got 0)"),
    (("--engine", "path", "--samples", "65537"), "--samples: should be 65536 or less (got 65537)"),
]


@pytest.mark.parametrize(("words", "sentence"), WRONG, ids=[" ".join(words) for words, _ in WRONG])
def test_what_cannot_be_drawn_gets_one_sentence(vobench, here, words, sentence):
    said = vobench("render", "closet", "--at", "0", "0", "1", "--out", "look.png", *words)
    assert said.code == 1
    assert sentence in said.err
    assert len(said.err.splitlines()) == 1
    assert not list(here.glob("*.png"))


def test_truth_lies_beside_the_picture(vobench, here):
    said = vobench("render", "closet", "--at", "0", "0", "1", "--out", "look.png", "--truth")
    assert said.code == 0
    written = said.out.split()
    assert written[0] == "look.png"
    assert {"look.depth.png", "look.normals.png", "look.truth.npz"} < set(written)
    assert sorted(written) == sorted(path.name for path in here.glob("look.*"))


def test_stock_pyrender_draws_without_light_computed_before(vobench, here):
    said = vobench("render", "closet", "--at", "0", "0", "1", "--out", "look.png", "--engine", "pyrender")
    assert (said.code, said.out) == (0, "look.png\n")
    picture = cv2.imread("look.png")
    assert picture.std() > 0
    assert not (here / "cache" / "bakes").exists()


def test_without_options_the_camera_stands_a_little_above_the_origin_and_adds_no_gain():
    camera = CameraOptions()
    assert (camera.at, camera.yaw, camera.pitch) == ((0.0, 0.0, 1.2), 0.0, 10.0)
    assert (camera.gain, camera.time, camera.sensor, camera.camera) == (1.0, 0.0, "clean", "paper_blender")
    assert (EngineOptions().engine, EngineOptions().samples) == ("raster", None)
