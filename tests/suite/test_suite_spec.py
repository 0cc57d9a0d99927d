"""What a suite's YAML may say, and which keys need which others."""

import pytest

from vobench.errors import SettingError
from vobench.suite.suite_spec import EstimatorSettings, Rendering, Suite, TruthNoise, missing_axis
from vobench.suite.yaml_file import checked, json_schema


@pytest.mark.parametrize(
    ("keys", "is_complete"),
    [
        ({"scenes"}, True),
        ({"scenes", "rigs", "trajectories"}, True),
        ({"scenarios"}, True),
        ({"source"}, True),
        ({"source", "scenarios", "cameras"}, True),
        ({"scenarios", "rigs"}, False),
        ({"source", "trajectories"}, False),
        ({"source", "scenes", "trajectories"}, True),
        ({"rigs", "trajectories"}, False),
        (set(), False),
    ],
)
def test_a_suite_needs_scenes_or_only_what_needs_none(keys, is_complete):
    missing = missing_axis(keys)
    assert (missing is None) is is_complete
    assert is_complete or missing.startswith("scenes: this key is missing; ")


@pytest.mark.parametrize("engine", ["raster", "path", "pyrender"])
def test_only_the_raster_engine_needs_the_light_of_the_scene(engine):
    assert Rendering(engine=engine).needs_bake is (engine == "raster")


def test_each_engine_takes_its_own_numbers_of_samples():
    assert Rendering(engine="path", samples=5).samples == 5
    for samples in (4, 16):
        assert Rendering(engine="raster", samples=samples).samples == samples
    for samples in (1, 5, 64):
        with pytest.raises(SettingError, match=f"the engine raster takes 4 or 16 samples, got {samples}"):
            Rendering(engine="raster", samples=samples)
    with pytest.raises(SettingError, match="samples requires engine raster or path, but the engine is pyrender"):
        Rendering(engine="pyrender", samples=4)


def test_short_forms_mean_their_long_ones():
    content = {"name": "s", "scenarios": {"dusk": 3}, "calibrations": ["worn", "none"], "estimators": ["a"]}
    suite = checked(Suite, content)
    assert suite.scenarios == {"dusk": (3,)}
    assert suite.calibrations == {"worn": (0, 1, 2, 3, 4, 5), "none": (0, 1, 2, 3, 4, 5)}
    assert suite.estimators == (EstimatorSettings(name="a"),)


def test_without_a_key_a_suite_has_the_truth_one_mode_and_one_repeat():
    suite = checked(Suite, {"name": "s", "scenes": ["room"], "estimators": ["a"]})
    assert suite.truth_noise == TruthNoise(position_m=0.0, rotation_deg=0.0)
    assert (suite.modes, suite.repeats, suite.seed, suite.share_time) == (("step",), 1, 0, False)
    assert (suite.lightings, suite.rendering) == ({"as_built": {}}, Rendering())


def test_calibrations_without_scenarios_are_refused():
    content = {"name": "s", "source": "x", "calibrations": {"worn": [1]}, "estimators": ["a"]}
    with pytest.raises(ValueError, match="calibrations: requires scenarios, and the suite has none"):
        checked(Suite, content)


@pytest.mark.parametrize("key", ["lightings", "rigs", "cameras"])
def test_scenarios_are_spread_with_one_variant_of_every_other_axis(key):
    variants = {"lightings": {}, "rigs": {"pitch_deg": 90}, "cameras": {}}
    content = {
        "name": "s",
        "scenes": [{"name": "flat", "seeds": 2}],
        "trajectories": {"tour": {"kind": "wander", "length_m": 1}},
        "scenarios": {"dusk": 3},
        "spread": {"units": 2, "each": 1},
        "estimators": ["a"],
    }
    one = {"a": variants[key]}
    assert set(getattr(checked(Suite, {**content, key: one}), key)) == {"a"}
    with pytest.raises(ValueError, match=f"{key}: scenarios are spread with one variant of {key}, but there are sev"):
        checked(Suite, {**content, key: {**one, "b": variants[key]}})


def test_the_schema_allows_the_short_forms():
    properties = json_schema(Suite)["properties"]
    assert {"type": "string"} in properties["estimators"]["items"]["anyOf"]
    assert [choice["type"] for choice in properties["calibrations"]["anyOf"]] == ["object", "array", "null"]
