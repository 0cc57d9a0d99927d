"""A picture of a scene, where the camera stands and when."""

import numpy as np
import pytest

from tests.runner.conftest import CLOSET
from vobench.errors import InputError, UnknownNameError
from vobench.runner.scene_picture import STILL_CHANNELS, render_scene


@pytest.fixture
def closet(tmp_path_factory, monkeypatch):
    folder = tmp_path_factory.getbasetemp() / "scene_picture"  # one light for all tests here
    folder.mkdir(exist_ok=True)
    monkeypatch.setenv("VOBENCH_CACHE", str(folder / "cache"))
    (folder / "closet.yaml").write_text(CLOSET)
    return str(folder / "closet.yaml")


def test_depth_falls_as_the_camera_comes_nearer_to_the_wall(closet):
    depths_m = []
    for x_m in (0.0, 0.4):
        picture = render_scene(closet, at_m=(x_m, 0.0, 0.7), pitch_deg=0.0, with_truth=True)
        height, width = picture.truth["depth"].shape
        depths_m.append(float(picture.truth["depth"][height // 2, width // 2]))
    assert depths_m[0] == pytest.approx(1.0, abs=2e-3)
    assert depths_m[1] == pytest.approx(0.6, abs=2e-3)


def test_gain_brightens(closet):
    means = [render_scene(closet, at_m=(0, 0, 0.7), gain=gain).rgb.mean() for gain in (0.25, 0.5)]
    assert 1.3 < means[1] / means[0] < 2.1


def test_a_picture_is_saved_with_a_file_per_channel_and_one_of_all_values(closet, tmp_path):
    picture = render_scene(closet, at_m=(0, 0, 0.7), with_truth=True)
    written = picture.save(tmp_path / "look.png")
    assert [path.name for path in written] == [
        "look.png",
        *(f"look.{name}.png" for name in picture.truth),
        "look.truth.npz",
    ]
    assert set(picture.truth) == set(STILL_CHANNELS)
    with np.load(tmp_path / "look.truth.npz") as values:
        np.testing.assert_array_equal(values["depth"], picture.truth["depth"])


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"yaw_deg": float("nan")}, "--yaw should be a finite number, got nan"),
        ({"time_s": 1e12}, r"--time should be within 1e\+09 s of the start, got 1e\+12"),
        ({"at_m": (9, 0, 1)}, r"--at should be inside the room"),
        ({"samples": 5}, "the engine raster takes 4 or 16 samples, got 5"),
        ({"engine": "pyrender", "samples": 4}, "samples requires engine raster or path"),
    ],
)
def test_a_wrong_setting_is_refused_before_anything_is_computed(closet, options, sentence):
    with pytest.raises(InputError, match=sentence):
        render_scene(closet, **options)


def test_unknown_names_are_named(closet):
    with pytest.raises(UnknownNameError, match="no camera named"):
        render_scene(closet, camera="paper_blendr")
    with pytest.raises(UnknownNameError, match="no camera sensor named"):
        render_scene(closet, sensor="claen")
