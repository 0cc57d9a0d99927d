"""A model as a scene: its exposure follows from its light and its reflectance."""

from types import SimpleNamespace

import numpy as np
import pytest

from vobench.asset import model as model_module
from vobench.asset.shape import at, block
from vobench.scene.light import PointLight, Sky, Sun
from vobench.scene.material import LUMINANCE, Material
from vobench.scene.mesh import Thing, flipped, moved, quad
from vobench.suite.bare_model import DAYLIGHT_SKY, DAYLIGHT_SUN, bare_model_scene

GREY = 0.5


@pytest.fixture
def read(monkeypatch, tmp_path):
    """The scene of a model that has these things, lights and materials."""

    def scene(*things, lights=(), materials=None, name="barn.glb"):
        scales = []

        def read_model(path, *, scale=1.0):
            scales.append(scale)
            return SimpleNamespace(everything=things, lights=lights, materials=materials or {"grey": grey(GREY)})

        monkeypatch.setattr(model_module, "read_model", read_model)
        return bare_model_scene(tmp_path / name), scales

    return scene


def grey(reflectance):
    return Material(colour=(reflectance,) * 3)


def room(size_m=(4.0, 4.0, 2.5), *, material="grey"):
    """A closed room, seen from inside, that stands on z = 0."""
    return Thing("room", moved(flipped(block(size_m, bevel_m=0)), at(z_m=size_m[2] / 2)), material)


AREA_M2 = 2 * 4 * 4 + 4 * 4 * 2.5
BULB = PointLight("bulb", np.array([0.0, 0.0, 2.0]), 1000.0)


def test_lamps_in_a_closed_room_are_exposed_for_with_all_bounces(read):
    spec, _ = read(room(), lights=(BULB,))
    assert spec.white_cd_m2 == pytest.approx(1000 / (AREA_M2 * (1 - GREY)) / np.pi)
    assert (spec.lamps, spec.sun, spec.sky) == ((), None, None)


def test_twice_the_light_is_twice_the_exposure(read):
    once, _ = read(room(), lights=(BULB,))
    twice, _ = read(room(), lights=(BULB, BULB))
    assert twice.white_cd_m2 == pytest.approx(2 * once.white_cd_m2)


def test_luminous_faces_count_as_lamps(read):
    glowing = Material(emission_cd_m2=(100.0, 100.0, 100.0), colour=(GREY,) * 3)
    screen = Thing("screen", quad((0, 0, 1), (1, 0, 0), (0, 0, 0.5)), "glow")
    spec, _ = read(room(), screen, materials={"grey": grey(GREY), "glow": glowing})
    emitted_lm = np.pi * 0.5 * 100 * np.sum(LUMINANCE)
    absorption_m2 = AREA_M2 * (1 - GREY) + 0.5 * (1 - GREY)
    assert spec.white_cd_m2 == pytest.approx(emitted_lm / absorption_m2 / np.pi)


def test_sun_and_sky_of_the_model_add_up_and_its_walls_do_not_matter(read):
    sun = Sun("sun", 20_000.0, (0.0,), (30.0,), (50.0,))
    sky = Sky("sky", 5_000.0)
    spec, _ = read(room(), lights=(sun, sky))
    assert spec.white_cd_m2 == pytest.approx(25_000 / np.pi)


def test_white_walls_do_not_reflect_for_ever(read):
    spec, _ = read(room(), lights=(BULB,), materials={"grey": grey(1.0)})
    assert spec.white_cd_m2 == pytest.approx(1000 / (AREA_M2 * 0.1) / np.pi)


def test_mirrors_reflect_half(read):
    spec, _ = read(room(), lights=(BULB,), materials={"grey": Material("mirror", tint=0.9)})
    assert spec.white_cd_m2 == pytest.approx(1000 / (AREA_M2 * 0.5) / np.pi)


def test_dim_light_is_exposed_for_at_least_one_candela(read):
    weak = PointLight("bulb", np.array([0.0, 0.0, 2.0]), 1.0)
    assert read(room(), lights=(weak,))[0].white_cd_m2 == 1


def test_a_dark_room_gets_a_lamp_that_gives_400_lx(read):
    spec, _ = read(room())
    (lamp,) = spec.lamps
    assert lamp.name == "lamp_1"
    assert lamp.power_lm == pytest.approx(400 * AREA_M2 * (1 - GREY))
    assert spec.white_cd_m2 == pytest.approx(400 / np.pi)


def test_the_lamps_of_a_dark_hall_share_the_power(read):
    spec, _ = read(room((20.0, 12.0, 2.5)))
    area_m2 = 2 * 20 * 12 + 2 * (20 + 12) * 2.5
    assert len(spec.lamps) == 6
    assert [lamp.name for lamp in spec.lamps] == [f"lamp_{number}" for number in range(1, 7)]
    assert sum(lamp.power_lm for lamp in spec.lamps) == pytest.approx(400 * area_m2 * (1 - GREY))


def test_a_dark_place_below_the_sky_gets_daylight(read):
    ground = Thing("ground", quad((-4, -4, 0), (8, 0, 0), (0, 8, 0)), "grey")
    spec, _ = read(ground)
    assert (spec.sun, spec.sky, spec.lamps) == (DAYLIGHT_SUN, DAYLIGHT_SKY, ())
    assert (spec.sun.azimuth_deg, spec.sky.kind) == (30, "clear")
    assert spec.white_cd_m2 == pytest.approx((30_000 * np.sin(np.deg2rad(50)) + 8_000) / np.pi)


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
