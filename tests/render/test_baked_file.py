"""A baked scene comes back from disk as it was, or not at all."""

from pathlib import Path

import numpy as np
import pytest

from vobench.errors import RenderError
from vobench.render.bake import BakedScene, BakeSettings, bake
from vobench.render.baked_file import LIGHT, load_baked, save_baked
from vobench.scene.light import Sun
from vobench.scene.material import Matt, Polished
from vobench.scene.scene import Scene, ceiling_light
from vobench.scene.surface import room
from vobench.scene.texture import Texture


@pytest.fixture(scope="module")
def baked() -> BakedScene:
    floor = Polished(Texture("terrazzo", 0.5, 0.5, 1.0, 64, 0))
    materials = {"floor": floor, "wall": Matt(Texture("plain", 0.6, 0.0, 1.0, 8, 0))}
    surfaces = tuple(room((2, 2, 2), floor="floor", wall="wall", ceiling="wall"))[1:]
    sun = Sun("sun", 1e4, (0.0, 10.0), (0.0, 10.0), (60.0, 70.0))
    lamp = ceiling_light("lamp", np.array([0, 0, 1.9]), (0.2, 0.2), power_lm=100)
    settings = BakeSettings(spacing_m=0.5, indirect_spacing_m=1.0, light_rays=1, indirect_rays=4)
    return bake(Scene("cell", surfaces, materials, (lamp, sun)), settings)


def test_what_was_saved_is_what_is_loaded(baked: BakedScene, tmp_path: Path) -> None:
    save_baked(tmp_path, baked)
    loaded = load_baked(tmp_path, baked.scene)
    assert loaded.layout == baked.layout
    assert loaded.settings == baked.settings
    assert loaded.light.tobytes() == baked.light.tobytes()
    assert loaded.light.dtype == baked.light.dtype
    (track,), (kept,) = loaded.tracks, baked.tracks
    assert (track.light, track.times_ns) == (kept.light, kept.times_ns)
    assert track.bounced.tobytes() == kept.bounced.tobytes()
    assert sorted(loaded.albedo) == sorted(baked.albedo)
    for name, tile in baked.albedo.items():
        assert loaded.albedo[name].tobytes() == tile.tobytes()


@pytest.mark.parametrize("name", [LIGHT, "sun.1.npz"])
@pytest.mark.parametrize("left", [0, 100])
def test_an_empty_or_torn_file_is_an_error_that_names_the_folder(baked, tmp_path, name, left):
    save_baked(tmp_path, baked)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:left])
    with pytest.raises(RenderError, match=str(tmp_path)):
        load_baked(tmp_path, baked.scene)


def test_a_missing_texture_is_an_error_that_names_the_folder(baked: BakedScene, tmp_path: Path) -> None:
    save_baked(tmp_path, baked)
    (tmp_path / "albedo.floor.npy").unlink()
    with pytest.raises(RenderError, match=str(tmp_path)):
        load_baked(tmp_path, baked.scene)
