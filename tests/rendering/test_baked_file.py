"""What is written of a baked scene is what is read, and damaged files are errors."""

from pathlib import Path

import numpy as np
import pytest

from tests.rendering.panoramas import waves
from tests.rendering.rectangles import rectangle, room
from vobench.asset.texture import Procedural
from vobench.errors import RenderError
from vobench.rendering.bake import bake
from vobench.rendering.baked_file import LIGHT_FILE, SURFEL_FILE, TEXTURE_FILE, load_baked, save_baked
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.illumination import AmbientLight, Illumination
from vobench.scene.light import Sky, Sun
from vobench.scene.material import Material, Picture
from vobench.scene.panorama import PanoramaMap
from vobench.scene.scene import Scene, ceiling_light


@pytest.fixture(scope="module")
def baked() -> BakedScene:
    floor = Material(texture=Procedural("terrazzo", 0.5, 0.5, 1.0, 64, 0), eta=1.5)
    materials = {"floor": floor, "wall": Material(texture=Procedural("plain", 0.6, 0.0, 1.0, 8, 0))}
    surfaces = tuple(room((2, 2, 2), floor="floor", wall="wall", ceiling="wall"))[1:]
    sun = Sun("sun", 1e4, (0.0, 10.0), (0.0, 10.0), (60.0, 70.0))
    lamp = ceiling_light("lamp", np.array([0, 0, 1.9]), (0.2, 0.2), power_lm=100)
    settings = BakeSettings(spacing_m=0.5, indirect_spacing_m=1.0, light_rays=1, indirect_rays=4)
    return bake(Scene("cell", surfaces, materials, (lamp, sun)), settings)


def test_what_was_saved_is_what_is_loaded(baked: BakedScene, tmp_path: Path) -> None:
    save_baked(tmp_path, baked)
    loaded = load_baked(tmp_path, baked.scene)
    assert loaded.settings == baked.settings
    assert loaded.direct.tobytes() == baked.direct.tobytes()
    assert loaded.bounced.tobytes() == baked.bounced.tobytes()
    assert loaded.direct.dtype == baked.direct.dtype
    assert loaded.light_uv.tobytes() == baked.light_uv.tobytes()
    assert Illumination(loaded).at(0, 0).tobytes() == Illumination(baked).at(0, 0).tobytes()
    assert AmbientLight(loaded).cd_m2(loaded.direct[0][..., None]).tolist() == (
        AmbientLight(baked).cd_m2(baked.direct[0][..., None]).tolist()
    )
    (track,) = loaded.tracks
    (expected,) = baked.tracks
    assert (track.light, track.times_ns) == (expected.light, expected.times_ns)
    assert track.bounced.tobytes() == expected.bounced.tobytes()


def test_generated_textures_are_loaded_as_pictures_one_for_all_that_share_it(tmp_path: Path) -> None:
    shared, glow = Procedural("terrazzo", 0.5, 0.5, 1.0, 64, 0), Procedural("poster", 0.4, 0.5, 2.0, 32, 1)
    kept = Picture(np.full((2, 2), 0.5, np.float32))
    made_of = {
        "spare": Material(texture=shared),
        "floor": Material(texture=shared, emission_cd_m2=(1.0, 1.0, 1.0), emission_texture=glow),
        "wall": Material(texture=shared, eta=1.5),
        "ceiling": Material(texture=kept),
        "unused": Material(texture=Procedural("wood", 0.4, 0.5, 1.0, 32, 1)),
    }
    scene = Scene("cell", tuple(room((2, 2, 2), floor="floor", wall="wall", ceiling="ceiling")), made_of, ())
    save_baked(tmp_path, bake(scene, BakeSettings(spacing_m=0.5, indirect_rays=0, bounces=0)))
    loaded = load_baked(tmp_path, scene).scene.materials
    for name, material in made_of.items():
        assert isinstance(loaded[name].texture, Picture) == (name != "unused")
        assert loaded[name].texture.pixels().tobytes() == material.texture.pixels().tobytes()
    assert loaded["floor"].texture is loaded["wall"].texture
    assert loaded["floor"].emission_texture.pixels().tobytes() == glow.pixels().tobytes()
    assert (loaded["floor"].emission_texture.tile_m, loaded["ceiling"].texture) == (2.0, kept)


def test_a_panorama_is_saved_with_the_light_and_not_generated_again(tmp_path: Path) -> None:
    class Generated:
        count = 0

        def map_under(self, sky: Sky) -> PanoramaMap:
            self.count += 1
            return waves()

    generated = Generated()
    floor = rectangle(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "grey")
    scene = Scene("floor", (floor,), {"grey": Material(colour=(0.5,) * 3)}, (Sky("sky", 100.0, panorama=generated),))
    save_baked(tmp_path, bake(scene, BakeSettings(spacing_m=0.5, indirect_rays=0, bounces=0)))
    so_far = generated.count
    (loaded,) = load_baked(tmp_path, scene).scene.lights
    assert isinstance(loaded, Sky)
    assert loaded.panorama is not None
    assert loaded.panorama.map_under(loaded).daylight.tobytes() == waves().daylight.tobytes()
    assert loaded.panorama.map_under(loaded).lamps.tobytes() == waves().lamps.tobytes()
    assert generated.count == so_far


@pytest.mark.parametrize("name", [LIGHT_FILE, SURFEL_FILE, TEXTURE_FILE, "sun.1.npz"])
@pytest.mark.parametrize("left", [0, 100])
def test_an_empty_or_torn_file_is_an_error_that_names_the_folder(baked, tmp_path, name, left):
    save_baked(tmp_path, baked)
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes()[:left])
    with pytest.raises(RenderError, match=str(tmp_path)):
        load_baked(tmp_path, baked.scene)
