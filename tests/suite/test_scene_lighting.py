"""Lightings set the power and the level of a scene's lights."""

import pytest

from vobench.errors import SuiteError
from vobench.scene.light import Flicker, Steady
from vobench.suite.scene_spec import LevelSpec, LightOverride


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


@pytest.mark.parametrize(
    ("lighting", "sentence"),
    [
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
