"""Lightings set the power and the level of a scene's lights."""

from pathlib import Path

import numpy as np
import pytest

from vobench.errors import SuiteError
from vobench.scene.light import Flicker, PointLight, Sky, Steady, Sun
from vobench.suite.scene_lighting import require_possible, with_lighting
from vobench.suite.scene_spec import LevelSpec, LightOverride
from vobench.suite.yaml_source import YamlFile


def test_a_lighting_changes_levels_and_leaves_the_light_itself_alone(hall):
    dim = hall(lighting={"bulb": LightOverride(power_lm=50), "sky": LightOverride(illuminance_lx=800)})
    for before, after in zip(hall().lights, dim.lights, strict=True):
        share = {"bulb": 0.1, "sky": 0.1}.get(after.name, 1.0)
        assert after.level.mean(0, 10**9) == pytest.approx(share * before.level.mean(0, 10**9))
        assert getattr(after, "power_lm", None) == getattr(before, "power_lm", None)
        assert isinstance(after.level, Steady) == isinstance(before.level, Steady), "what is steady stays so"


def test_a_lighting_may_let_a_light_flicker(hall):
    flicker = LevelSpec(flicker=Flicker(depth=0.5))
    (bulb,) = (light for light in hall(lighting={"bulb": LightOverride(level=flicker)}).lights if light.name == "bulb")
    assert (bulb.level.mean(0, 0), bulb.level.mean(5_000_000, 5_000_000)) == (pytest.approx(1.5), pytest.approx(0.5))


def test_lamps_are_all_lights_but_sun_and_sky(hall):
    half = LightOverride(level=LevelSpec(steady=0.5))
    dim = hall(lighting={"lamps": half, "bulb": LightOverride(power_lm=50)})
    for before, after in zip(hall().lights, dim.lights, strict=True):
        share = 1.0 if isinstance(before, Sun | Sky) else 0.5
        if before.name == "bulb":
            share = 0.05  # of half of its power of 500 lm
        assert after.level.mean(0, 10**9) == pytest.approx(share * before.level.mean(0, 10**9))


def test_a_level_of_all_lamps_multiplies_that_of_each():
    lamp = PointLight("bulb", np.zeros(3), 500.0, level=Steady(0.4))
    flicker = LightOverride(level=LevelSpec(flicker=Flicker(depth=0.5)))
    (flickering,) = with_lighting([lamp], {"lamps": flicker})
    assert flickering.level.mean(0, 0) == pytest.approx(0.4 * 1.5)
    (dimmed,) = with_lighting([flickering], {"lamps": LightOverride(level=LevelSpec(steady=0.5))})
    assert dimmed.level.mean(0, 0) == pytest.approx(0.4 * 1.5 * 0.5)
    with pytest.raises(SuiteError, match="'bulb' changes over time already"):
        with_lighting([flickering], {"lamps": flicker})


def test_lamps_need_a_lamp():
    with pytest.raises(SuiteError, match="there are no lamps in this scene"):
        with_lighting([Sky("sky", 800.0)], {"lamps": LightOverride(level=LevelSpec(steady=0.5))})


@pytest.mark.parametrize(
    ("lighting", "sentence"),
    [
        ({"lamps": LightOverride(power_lm=1)}, "lighting: lamps have only a level in common"),
        ({"blub": LightOverride(power_lm=1)}, "lighting: no light named 'blub'. Did you mean 'bulb'?"),
        ({"bulb": LightOverride(illuminance_lx=1)}, "lighting: illuminance_lx does not belong to 'bulb'"),
        ({"sun": LightOverride(power_lm=1)}, "lighting: power_lm does not belong to 'sun'"),
    ],
)
def test_a_wrong_lighting_is_named(hall, lighting, sentence):
    with pytest.raises(SuiteError) as refused:
        hall(lighting=lighting)
    assert str(refused.value).startswith(sentence)


def test_a_light_that_is_nothing_cannot_be_made_brighter(hall):
    with pytest.raises(
        SuiteError, match="'bulb' is 0 in the scene, so it cannot be set to 5; increase it in the scene"
    ):
        hall("power_lm: 500", "power_lm: 0", lighting={"bulb": LightOverride(power_lm=5)})


SCENE = YamlFile(
    Path("hall.yaml"),
    {"room": {"size_m": [4, 3, 2]}, "lamps": [{"name": "bulb"}, {"power_lm": 5}], "meshes": [{"name": 3}], "sun": {}},
)


@pytest.mark.parametrize("name", ["bulb", "bulb.left", "sun"])
def test_a_light_of_a_scene_that_is_not_built_may_be_any_name_in_its_file_or_daylight(name):
    require_possible(name, SCENE)


@pytest.mark.parametrize("name", ["blub", "sky", "room"])
def test_a_light_that_no_scene_built_of_this_file_can_have_is_named(name):
    with pytest.raises(SuiteError, match=f"lighting: no light named '{name}'"):
        require_possible(name, SCENE)
