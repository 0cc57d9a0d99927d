"""A model as a scene: it keeps its own lights, and gets others if it is dark."""

from types import SimpleNamespace

import numpy as np
import pytest

from vobench.asset import model as model_module
from vobench.asset.shape import at, block
from vobench.scene.light import PointLight, Sky, Sun
from vobench.scene.material import Material
from vobench.scene.mesh import flipped, moved, quad
from vobench.scene.triangles import Thing
from vobench.suite.bare_model import LEAST_LX, bare_model_scene
from vobench.suite.default_light import DAYLIGHT_SKY, DAYLIGHT_SUN

GREY = 0.5


@pytest.fixture
def read(monkeypatch, tmp_path):
    """The scene of a model that has these things, lights and materials."""

    def scene(*things, lights=(), materials=None, name="barn.glb"):
        scales = []

        def read_model(path, *, scale=1.0):
            scales.append(scale)
            return SimpleNamespace(all_things=things, lights=lights, materials=materials or {"grey": grey(GREY)})

        monkeypatch.setattr(model_module, "read_model", read_model)
        return bare_model_scene(tmp_path / name), scales

    return scene


def grey(reflectance):
    return Material(colour=(reflectance,) * 3)


def room(size_m=(4.0, 4.0, 2.5), *, material="grey"):
    """A closed room, seen from inside, that stands on z = 0."""
    return Thing("room", moved(flipped(block(size_m, bevel_m=0)), at(z_m=size_m[2] / 2)), material)


def screen():
    return Thing("screen", quad((0, 0, 1), (1, 0, 0), (0, 0, 0.5)), "glow")


def glowing(luminance_cd_m2):
    return Material(emission_cd_m2=(luminance_cd_m2,) * 3, colour=(GREY,) * 3)


AREA_M2 = 2 * 4 * 4 + 4 * 4 * 2.5
BULB = PointLight("bulb", np.array([0.0, 0.0, 2.0]), 1000.0)


def test_a_model_with_lights_is_taken_as_it_is_and_white_follows_from_its_light(read):
    spec, _ = read(room(), lights=(BULB,))
    assert (spec.lamps, spec.sun, spec.sky) == ((), None, None)
    assert spec.white_cd_m2 is None


@pytest.mark.parametrize("light", [Sun("sun", 20_000.0, (0.0,), (30.0,), (50.0,)), Sky("sky", 5_000.0)])
def test_a_model_with_a_sun_or_a_sky_gets_no_lamps(read, light):
    spec, _ = read(room(), lights=(light,))
    assert (spec.lamps, spec.sun, spec.sky) == ((), None, None)


def test_luminous_faces_count_as_lamps(read):
    spec, _ = read(room(), screen(), materials={"grey": grey(GREY), "glow": glowing(1000.0)})
    assert (spec.lamps, spec.sun, spec.sky) == ((), None, None)


def test_a_screen_that_hardly_glows_leaves_a_room_dark_so_lamps_are_added(read):
    spec, _ = read(room(), screen(), materials={"grey": grey(GREY), "glow": glowing(1.0)})
    assert len(spec.lamps) == 1


@pytest.mark.parametrize("size_m", [(0.5, 0.4), (2.0, 1.5)])
@pytest.mark.parametrize(("share", "is_lit"), [(0.8, False), (1.3, True)])
def test_a_luminous_panel_counts_by_the_power_that_it_emits_whatever_its_size(read, size_m, share, is_lit):
    """A diffuse panel of luminance L and area A emits π L A lumens."""
    x_m, y_m = size_m
    panel = Thing("panel", quad((0, 0, 2.4), (0, y_m, 0), (x_m, 0, 0)), "glow")
    dim_room_lm = LEAST_LX * AREA_M2 * (1 - GREY)
    luminance_cd_m2 = share * dim_room_lm / (np.pi * x_m * y_m)
    spec, _ = read(room(), panel, materials={"grey": grey(GREY), "glow": glowing(luminance_cd_m2)})
    assert (spec.lamps == ()) == is_lit


def test_lamps_that_light_hidden_faces_only_are_no_reason_to_add_others(read):
    """1,000 lm give 29 lx in the room, however large the faces are that nobody sees."""
    hidden = Thing("hidden", moved(block((3.0, 3.0, 0.2), bevel_m=0), at(z_m=-5)), "grey")
    many = [hidden] * 40
    spec, _ = read(room(), *many, lights=(BULB,))
    assert spec.lamps == ()


def test_a_dark_room_gets_lamps_that_give_400_lx_and_a_dark_yard_daylight(read):
    spec, _ = read(room())
    assert sum(lamp.power_lm for lamp in spec.lamps) == pytest.approx(400 * AREA_M2 * (1 - GREY), rel=0.01)
    ground = Thing("ground", quad((-4, -4, 0), (8, 0, 0), (0, 8, 0)), "grey")
    spec, _ = read(ground)
    assert (spec.sun, spec.sky, spec.lamps) == (DAYLIGHT_SUN, DAYLIGHT_SKY, ())


@pytest.mark.parametrize(
    ("material", "absorption"),
    [(grey(1.0), 0.1), (Material("mirror", tint=0.9), 0.5)],
    ids=["white walls do not reflect for ever", "mirrors reflect half"],
)
def test_the_power_follows_from_what_walls_absorb(read, material, absorption):
    spec, _ = read(room(), materials={"grey": material})
    assert sum(lamp.power_lm for lamp in spec.lamps) == pytest.approx(400 * AREA_M2 * absorption, rel=0.01)


@pytest.mark.parametrize(("side_m", "scale"), [(299.0, 1.0), (301.0, 0.01)])
def test_a_very_large_model_is_in_centimetres(read, side_m, scale):
    spec, scales = read(room((side_m, side_m, 2.5)), lights=(BULB,))
    assert spec.meshes[0].scale == scale
    assert scales == ([1.0] if scale == 1 else [1.0, scale])


@pytest.mark.parametrize(
    ("file", "name"), [("Old Barn (2).glb", "old_barn_2"), ("é.glb", "model"), ("_a-b_.glb", "a_b"), ("x9.glb", "x9")]
)
def test_the_scene_is_called_as_its_file(read, file, name):
    assert read(room(), lights=(BULB,), name=file)[0].name == name
