"""From a suite to its plan: one factor a line, one case a combination."""

from pathlib import Path

import pytest

from vobench.errors import MOST_SAID, FilePlace, SuiteError, VobenchError
from vobench.runner.motion import body_motions
from vobench.suite import catalog, estimator_entry, scene_build, scene_file
from vobench.suite.axis import AXES
from vobench.suite.catalog import builtin_root
from vobench.suite.suite import read_plan
from vobench.suite.yaml_file import checked, plain

MORE = (
    ("{down: {pitch_deg: 90}}", "{down: {pitch_deg: 90}, ahead: {pitch_deg: 10}, tilt: {pitch_deg: 45}}"),
    ("{clean: {sensor: clean}}", "{clean: {sensor: clean}, noisy: {sensor: mt9v034}}"),
)


def test_cases_are_every_combination_and_have_names_of_their_own(bent):
    cases = bent(*MORE).cases
    assert len(cases) == 2 * 3 * 2
    assert len({case.name for case in cases}) == len({tuple(case.variant.items()) for case in cases}) == 12


def test_a_case_is_called_by_what_differs_in_its_suite(bent):
    assert [case.name for case in bent().cases] == ["full", "dim"]
    assert [case.name for case in bent(*MORE[:1]).cases][:2] == ["full-down", "full-ahead"]


def test_a_case_without_any_choice_is_called_by_its_trajectory(bent):
    assert [case.name for case in bent((", dim: {lamp: {power_lm: 150}}", "")).cases] == ["short"]


@pytest.mark.parametrize(
    ("axis", "change"),
    [
        ("lighting", ("power_lm: 150", "power_lm: 100")),
        ("rig", ("pitch_deg: 90", "pitch_deg: 80")),
        ("trajectory", ("[[0.5, 0]]", "[[0.5, 0.1]]")),
        ("camera", ("sensor: clean", "sensor: mt9v034")),
    ],
)
def test_one_line_changes_one_factor(bent, axis, change):
    before, after = (bent(*changes).cases[-1] for changes in ((), (change,)))
    assert [name for name in AXES if getattr(before, name) != getattr(after, name)] == [axis]


@pytest.fixture
def building(bent, tmp_path):
    """Reads the plan of a suite with this text that includes one that includes the suite, which has some text replaced."""

    def read(text, *changes, **more):
        bent()
        for old, new in changes:
            (tmp_path / "tiny.yaml").write_text((tmp_path / "tiny.yaml").read_text().replace(old, new))
        (tmp_path / "middle.yaml").write_text("include: tiny.yaml\nseed: 2\nlightings: {dim: {lamp: {power_lm: 99}}}\n")
        (tmp_path / "over.yaml").write_text(f"include: middle.yaml\n{text}")
        return read_plan("./over.yaml", **more)

    return read


def test_a_suite_goes_over_what_it_includes_key_by_key(building):
    text = "rigs: {down: {height_m: 0.3}, ahead: {pitch_deg: 10}}\nlightings: {full: null}\nestimators: [stand_still]\n"
    planned = building(text, changes={"trajectories.short.rate_hz": "5"})
    assert [case.name for case in planned.cases] == ["down", "ahead"]
    down, ahead = planned.simulated
    assert (down.rig.pitch_deg, down.rig.height_m, down.seed, down.trajectory.rate_hz) == (90, 0.3, 2, 5)
    assert ahead.lighting["lamp"].power_lm == 99
    assert [entry.label for entry in planned.estimator_entries] == ["stand_still"]


def test_a_mistake_is_said_with_the_file_that_it_is_in(building):
    with pytest.raises(SuiteError) as error:
        building("rigs: {down: {height_m: high}}\nscene: 3\n", ("pitch_deg: 90", "pitch_deg: 91"))
    misspelt = f"over.yaml:3: scene: unknown key. Did you mean 'scenes'? Known: {SUITE_KEYS}"
    said = ("over.yaml:2: rigs.down.height_m: should be a number (got 'high')", misspelt)
    assert all(sentence in str(error.value) for sentence in said)
    assert "tiny.yaml:5: rigs.down.pitch_deg: should be 90 or less (got 91)" in str(error.value)
    with pytest.raises(
        SuiteError, match=r"over.yaml:1: include: .*middle.yaml:1: include: .*cannot include itself: .*over"
    ):
        building("", ("name: tiny", "name: tiny\ninclude: over.yaml"))


def test_scenes_and_estimators_are_found_beside_their_suite_from_anywhere(bent, tmp_path, monkeypatch):
    manifest = "name: stand_still\nversion: mine\nclass: estimator:Mine\npose_of: body\nsummary: Mine.\n"
    bent()
    (tmp_path / "estimators" / "stand_still").mkdir(parents=True)
    (tmp_path / "estimators" / "stand_still" / "estimator.yaml").write_text(manifest)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for only in ((), ("stand_still",)):
        planned = read_plan("../tiny.yaml", only_estimators=only)
        assert planned.estimator_entries[0].manifest.version == "mine"
    assert [(e.kind, e.name, e.origin) for e in read_plan("../tiny.yaml").found] == [
        ("estimator", "stand_still", "beside the suite"),
        ("estimator", "constant_velocity", "built in"),
        ("scene", "closet", "beside the suite"),
    ]


def test_what_cases_share_is_made_once_however_many_there_are(bent, monkeypatch):
    calls = []
    for module, name in (
        (scene_file, "read_scene_with_mistakes"),
        (scene_build, "build"),
        (estimator_entry, "read_manifest"),
    ):
        made = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args, made=made, name=name: (calls.append(name), made(*args))[1])
    ways = ", ".join(f"way_{k}: {{targets_m: [[0.{k + 1}, 0]]}}" for k in range(9))
    cameras = ", ".join(f"camera_{k}: {{blur_sigma_px: {k}}}" for k in range(5))
    few = bent(), sorted(calls)
    calls.clear()
    many = bent(("short: {targets_m: [[0.5, 0]]}", ways), ("clean: {sensor: clean}", cameras)), sorted(calls)
    assert (len(few[0].cases), len(many[0].cases)) == (2, 90)
    assert few[1] == many[1] == ["read_manifest", "read_manifest", "read_scene_with_mistakes"]


def test_merge_keys_and_aliases_keep_a_suite_short(bent):
    planned = bent(("{down: {pitch_deg: 90}}", "\n  down: &down {pitch_deg: 90}\n  wide: {<<: *down, baseline_m: 0.2}"))
    assert planned.suite.rigs["wide"].pitch_deg == 90
    assert planned.suite.rigs["wide"].baseline_m == 0.2


def test_a_plan_goes_through_json_unchanged(bent):
    suite = bent().suite
    assert checked(type(suite), plain(suite)) == suite


# Planning these two builds fifteen scenes; tests/suite/test_scenario.py reads them and plans what they are made of.
LONG = {"daily", "full"}


@pytest.mark.parametrize("name", sorted({path.stem for path in (builtin_root() / "suites").glob("*.yaml")} - LONG))
def test_every_suite_of_the_house_is_valid_and_called_as_its_file(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    plan = read_plan(name)
    assert plan.suite.name == name
    assert plan.cases
    assert catalog.find("suite", name).origin == "built in"


# ruff: noqa: E501 - a sentence stands in one line


SUITE_KEYS = "base_seed, calibrations, cameras, estimators, frames, include, lightings, modes, name, rendering, repeats, rigs, scenarios, scenes, seed, share_time, source, spread, summary, trajectories, truth, truth_noise"
RIG_KEYS = """baseline_m, calib, calibration_error, camchain, forward_m, height_m, imu, lens, own, picture_scale,\
 pitch_deg, size_px"""
LENSES = "d435i, euroc, fisheye, paper_blender, paper_literal, tartanair, zed2i"
ESTIMATORS = (
    "constant_velocity, feature_vo, imu_dead_reckoning, imu_visual, lk_epipolar, mono_vo, noisy_truth, planar_floor, "
    "stand_still, stereo_pnp, wheel_odometry, wheel_visual"
)
A_NAME = "should be lower-case letters, digits, _ and ., a letter or digit first"

# What is replaced, what with, and what comes after the file's path.
WRONG = [
    ("seed:", "sed:", f":2: sed: unknown key. Did you mean 'seed'? Known: {SUITE_KEYS}"),
    ("seed: 1", "xyz: 1", f":2: xyz: unknown key. Known: {SUITE_KEYS}"),
    ("pitch_deg", "pich_deg", f":5: rigs.down.pich_deg: unknown key. Did you mean 'pitch_deg'? Known: {RIG_KEYS}"),
    ("{power_lm: 150}", "{power: 1, power_lm: 1}", ":4: lightings.dim.lamp.power: unknown key. Did you mean 'power_lm'? Known: illuminance_lx, level, power_lm"),
    ("params:", "parms:", ":8: estimators.1.parms: unknown key. Did you mean 'params'? Known: label, limits, name, params"),
    ("pitch_deg: 90", "", ":5: rigs.down.pitch_deg: this key is missing"),
    ("seed: 1", "seed: one", ":2: seed: should be a whole number (got 'one')"),
    ("seed: 1", "seed: '1'", ":2: seed: should be a whole number (got '1')"),
    ("seed: 1", "seed: true", ":2: seed: should be a whole number (got true)"),
    ("seed: 1", "seed: 1.5", ":2: seed: should be a whole number (got 1.5)"),
    ("seed: 1", "seed:", ":2: seed: should be a whole number (got nothing)"),
    ("seed: 1", "seed: -1", ":2: seed: should be 0 or more (got -1)"),
    ("seed: 1", "seed: 1\nrendering: {samples: 5}", ":3: rendering.samples: the engine raster takes 4 or 16 samples, got 5"),
    ("seed: 1", "seed: 1\nrendering: {engine: pyrendr}", ":3: rendering.engine: no engine named 'pyrendr'. Did you mean 'pyrender'? Known: path, pyrender, raster"),
    ("seed: 1", "seed: 1\nrendering: {engine: path, samples: 65537}", ":3: rendering.samples: should be 65536 or less (got 65537)"),
    ("seed: 1", "seed: 1\nrepeats: 101", ":3: repeats: should be 100 or less (got 101)"),
    ("seed: 1", "seed: 1\nseed: 2", ':3:1: found duplicate key "seed" with value "2" (original value: "1")'),
    ("seed: 1", "3: 1", ":2: 3: a key should be text (put it in quotes; got 3)"),
    ("name: tiny", "name: 12", ":1: name: should be text (a number or a date needs quotes) (got 12)"),
    ("name: tiny", "name: My Suite", f":1: name: {A_NAME} (got 'My Suite')"),
    ("name: tiny", "name: !!python/object:os.system x", ":1: name: should be a number, text, a list or keys with values (got x)"),
    ("rigs:", "rig:", f":5: rig: unknown key. Did you mean 'rigs'? Known: {SUITE_KEYS}"),
    ("{down: {pitch_deg: 90}}", "{3: {pitch_deg: 90}}", ":5: rigs.3: a key should be text (put it in quotes; got 3)"),
    ("down:", "a/b:", f":5: rigs.a/b: {A_NAME} (got 'a/b')"),
    ("pitch_deg: 90", "pitch_deg: .nan", ":5: rigs.down.pitch_deg: should be a finite number (got nan)"),
    ("pitch_deg: 90", "pitch_deg: -.inf", ":5: rigs.down.pitch_deg: should be a finite number (got -inf)"),
    ("pitch_deg: 90", "pitch_deg: 91", ":5: rigs.down.pitch_deg: should be 90 or less (got 91)"),
    ("pitch_deg: 90", "pitch_deg: down", ":5: rigs.down.pitch_deg: should be a number (got 'down')"),
    ("pitch_deg: 90", "pitch_deg: 90, baseline_m: -1", ":5: rigs.down.baseline_m: should be greater than 0 (got -1)"),
    ("{pitch_deg: 90}", "90", ":5: rigs.down: should be keys with values (got 90)"),
    ("{down: {pitch_deg: 90}}", "{}", ":5: rigs: should have 1 or more entries, but has 0"),
    ("[closet]", "closet", ":3: scenes: should be a list, as in [a, b] (got 'closet')"),
    ("[closet]", "[closset]", ":3: scenes.0: no scene named 'closset'. Did you mean 'closet'? Known: car_park, closet, corridor, flat, hall, office, park, ramp, room, street, warehouse"),
    ("[closet]", "[./no.yaml]", ":3: scenes.0: no scene file at no.yaml. Known by name: car_park, closet, corridor, flat, hall, office, park, ramp, room, street, warehouse"),
    ("[closet]", "[closet, closet]", ":3: scenes.1: two scenes are called 'closet'; list each once, from files with different names"),
    ("{lamp:", "{lmp:", ":4: lightings.dim.lmp: lighting: no light named 'lmp'. Did you mean 'lamp'? Known: lamp, lamps"),
    ("pitch_deg: 90", "pitch_deg: 90, lens: x", f":5: rigs.down.lens: no lens named 'x'. Known: {LENSES}"),
    ("pitch_deg: 90", "pitch_deg: 90, lens: eurok", f":5: rigs.down.lens: no lens named 'eurok'. Did you mean 'euroc'? Known: {LENSES}"),
    ("pitch_deg: 90", "pitch_deg: 90, calibration_error: {right_yaw: 1}", ":5: rigs.down.calibration_error.right_yaw: unknown key. Did you mean 'right_yaw_deg'? Known: baseline_ratio, center_px, distortion_ratio, focal_ratio, left, level, right, right_pitch_deg, right_roll_deg, right_yaw_deg"),
    ("pitch_deg: 90", "pitch_deg: 90, calibration_error: {right_yaw_deg: 11}", ":5: rigs.down.calibration_error.right_yaw_deg: should be 10 or less (got 11)"),
    ("pitch_deg: 90", "pitch_deg: 90, calibration_error: {focal_ratio: -1}", ":5: rigs.down.calibration_error.focal_ratio: should be greater than -1 (got -1)"),
    ("pitch_deg: 90", "pitch_deg: 90, lens: d435i, calibration_error: {distortion_ratio: 0.1}", ":5: rigs.down: distortion_ratio 0.1 needs a lens with distortion, got Pinhole(width_px=848, height_px=480, fx_px=427.259765625, fy_px=427.259765625, cx_px=422.357269287109, cy_px=233.807525634766)"),
    ("[[0.5, 0]]", "[[0.5, 0]], slip: slipery", ":6: trajectories.short.slip: no slip named 'slipery'. Did you mean 'slippery'? Known: nominal, none, slippery, straining"),
    ("[[0.5, 0]]", "[[0.5, 0]], controller: smoth", ":6: trajectories.short.controller: no controller named 'smoth'. Did you mean 'smooth'? Known: easy, paper, smooth"),
    ("[[0.5, 0]]", "[]", ":6: trajectories.short.targets_m: should have 1 or more entries, but has 0"),
    ("[[0.5, 0]]", "[[0.5, 0, 1]]", ":6: trajectories.short.targets_m.0: should have 2 or fewer entries, but has 3"),
    ("[[0.5, 0]]", "[[0.5, a]]", ":6: trajectories.short.targets_m.0.1: should be a number (got 'a')"),
    ("sensor: clean", "sensor: grainy", ":7: cameras.clean.sensor: no camera sensor named 'grainy'. Known: clean, imx249, imx255, mt9m034, mt9v034, ov9282"),
    ("stand_still,", "stnd_still,", f":8: estimators.0: no estimator named 'stnd_still'. Did you mean 'stand_still'? Known: {ESTIMATORS}"),
    ("stand_still,", "./stand_still,", f":8: estimators.0: no estimator file at stand_still/estimator.yaml. Known by name: {ESTIMATORS}"),
    ("stand_still,", "3,", ":8: estimators.0: should be keys with values (got 3)"),
    ("stand_still,", "constant_velocity,", ":8: estimators.1: two estimators are called 'constant_velocity'; give one of them another label"),
    ("measure_s", "mesure_s", ":8: estimators.1.params.mesure_s: no parameter named 'mesure_s'. Did you mean 'measure_s'? Known: measure_s"),
    ("measure_s: 0.1", "measure_s: fast", ":8: estimators.1.params.measure_s: parameter 'measure_s' should be of the type of its default 1.0, got 'fast'"),
    ("measure_s: 0.1", "measure_s: 2020-01-01", ":8: estimators.1.params.measure_s: should be a number, text, a list or keys with values (got 2020-01-01)"),
    ("rigs:", "\trigs:", r":5:1: found character '\t' that cannot start any token"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "sentence"), WRONG, ids=[f"{new.strip()}" for _, new, _ in WRONG])
def test_a_wrong_suite_gets_one_line_with_file_line_key_value_and_remedy(bent, tmp_path, old, new, sentence):
    assert said_of(tmp_path, lambda: bent((old, new))) == [sentence]


ANOTHER = "truth: [dpth]\n"
IS_SAID = "truth.0: no ground-truth channel named 'dpth'. Did you mean 'depth'? Known: "


@pytest.mark.parametrize(("old", "new", "sentence"), WRONG[:-1], ids=[new.strip() for _, new, _ in WRONG[:-1]])
def test_a_mistake_is_said_as_well_where_there_is_another(bent, tmp_path, old, new, sentence):
    said = said_of(tmp_path, lambda: bent((old, new), more=ANOTHER))
    assert sorted(line for line in said if IS_SAID not in line) == [sentence]
    assert len(said) == 2


def said_of(folder, read):
    """The lines that are said of the suite when it is read."""
    with pytest.raises(SuiteError) as refused:
        read()
    return [line.removeprefix(str(folder / "tiny.yaml")) for line in str(refused.value).splitlines()]


TEN = [
    ("seed: 1", "seed: one\nseed: 2\nreapeats: 3"),
    ("[closet]", "[closet, atic]"),
    ("power_lm: 150}}", "power_lm: -1}}, dark: {lmp: {power_lm: 0}}"),
    ("{down: {pitch_deg: 90}}", "{down: {pitch_deg: 90, lens: eurok}, up: {pitch_deg: .nan}}"),
    ("[[0.5, 0]]", "[[0.5, a]]"),
    ("{sensor: clean}", "{shutter: rolling}"),
    ("[stand_still,", "[stand_stil,"),
    ("measure_s:", "mesure_s:"),
]
TOLD = [
    ":2: seed: should be a whole number (got 'one')",
    ':3:1: found duplicate key "seed" with value "2" (original value: "one")',
    ":4: reapeats: unknown key. Did you mean 'repeats'?",
    ":5: scenes.0: {}/scenes/closet.yaml:3: materials.grain.albedo: should be less than 1 (got 2)",
    ":5: scenes.0: {}/scenes/closet.yaml:5: lamps.0.center_m: should be inside the room",
    ":5: scenes.1: no scene named 'atic'.",
    ":6: lightings.dim.lamp.power_lm: should be 0 or more (got -1)",
    ":6: lightings.dark.lmp: lighting: no light named 'lmp'. Did you mean 'lamp'?",
    ":7: rigs.down.lens: no lens named 'eurok'. Did you mean 'euroc'?",
    ":7: rigs.up.pitch_deg: should be a finite number (got nan)",
    ":8: trajectories.short.targets_m.0.1: should be a number (got 'a')",
    ":9: cameras.clean: a rolling shutter needs readout_ms",
    ":10: estimators.0: no estimator named 'stand_stil'. Did you mean 'stand_still'?",
    ":10: estimators.1.params.mesure_s: no parameter named 'mesure_s'. Did you mean 'measure_s'?",
]
IN_SCENE = ("albedo: 0.5", "albedo: 2", "[0, 0, 1.4]", "[0, 0, 1.6]")


def test_mistakes_of_every_sort_are_said_at_once_in_the_order_of_the_file(bent, tmp_path):
    with pytest.raises(SuiteError) as refused:
        bent(*TEN, scene=IN_SCENE)
    said = [str(mistake).removeprefix(str(tmp_path / "tiny.yaml")) for mistake in refused.value.mistakes]
    for line, told in zip(sorted(said), sorted(TOLD), strict=True):
        assert line.startswith(told.format(tmp_path))
    assert [int(line.split(":")[1]) for line in said] == sorted(int(told.split(":")[1]) for told in TOLD)
    lines = str(refused.value).splitlines()
    assert len(lines) == MOST_SAID + 1
    assert lines[-1] == f"and {len(TOLD) - MOST_SAID} more mistakes"


def test_every_mistake_has_its_file_line_key_and_value_apart(bent, tmp_path):
    with pytest.raises(SuiteError) as refused:
        bent(("seed: 1", "seed: one"), scene=("wall: grain", "wall: grane"))
    seed, wall = refused.value.mistakes
    assert seed.places == (FilePlace(str(tmp_path / "tiny.yaml"), 2, key="seed", value="one"),)
    asking, at_fault = wall.places
    assert (asking.line, asking.key, asking.value) == (3, "scenes.0", "closet")
    assert at_fault == FilePlace(str(tmp_path / "scenes" / "closet.yaml"), 4, key="room.wall", value="grane")
    assert wall.sentence.startswith("no material named 'grane'. Did you mean 'grain'? Known: brick, carpet,")


def test_entries_after_a_wrong_one_keep_their_number(bent, tmp_path):
    said = said_of(tmp_path, lambda: bent(("[stand_still,", "[3, stnd_still,")))
    assert [line.partition(" no ")[0] for line in said] == [
        ":8: estimators.0: should be keys with values (got 3)",
        ":8: estimators.1:",
    ]


def test_what_is_wrong_with_an_axis_is_said_once_for_all_its_cases(bent, tmp_path):
    planned = bent(
        ("[[0.5, 0]]}", "[[0.5, 0]]}, far: {targets_m: [[1.5, 0]]}, never: {targets_m: [[9, 9]], max_time_s: 1}"),
        ("{sensor: clean}", "{sensor: clean}, slow: {exposure_ms: 100}"),
    )
    said = said_of(tmp_path, lambda: body_motions(planned))
    assert len(planned.cases) == 12
    assert [line.split(": ")[1] for line in said] == ["trajectories.far", "trajectories.never", *["cameras.slow"] * 2]


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", ": should be keys with values, but is empty"),
        (b"# nothing\n", ": should be keys with values, but is empty"),
        (b"- a\n", ": should be keys with values, but is a list"),
        (b"hello\n", ": should be keys with values, but is the single value 'hello'"),
        (b"name: [\n", ":2:1: expected the node content, but found '<stream end>'"),
        (b"\xff\xfe\x00", ": not a text file in UTF-8"),
        (b"a: [" * 3000, ":1:404: is nested more than 100 deep"),
        (b"name: a\n---\nname: b\n", ":2:1: but found another document"),
    ],
    ids=["empty", "comment", "list", "scalar", "torn", "binary", "deep", "two"],
)  # fmt: skip
def test_a_file_that_is_no_suite_at_all_is_refused_by_name(bent, tmp_path, content, sentence):
    bent()
    (tmp_path / "tiny.yaml").write_bytes(content)
    with pytest.raises(SuiteError) as refused:
        read_plan("./tiny.yaml")
    assert str(refused.value) == f"{tmp_path / 'tiny.yaml'}{sentence}"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("wall: grain", "wall: grane", ":4: room.wall: no material named 'grane'. Did you mean 'grain'? Known: brick, "),
        ("albedo: 0.5", "albedo: 1", ":3: materials.grain.albedo: should be less than 1 (got 1)"),
        ("terrazzo", "tiles", ":3: materials.grain.pattern: no pattern named 'tiles'"),
        ("power_lm: 600", "power_lm: -1", ":5: lamps.0.power_lm: should be 0 or more (got -1)"),
        ("size_m: [3, 3, 1.5]", "size_m: [3, 3]", ":4: room.size_m.2: this key is missing"),
    ],
)  # fmt: skip
def test_a_wrong_scene_is_named_with_the_line_of_the_suite_that_asks_for_it(bent, tmp_path, old, new, sentence):
    with pytest.raises(SuiteError) as refused:
        bent(scene=(old, new))
    files = f"{tmp_path / 'tiny.yaml'}:3: scenes.0: {tmp_path / 'scenes' / 'closet.yaml'}"
    assert str(refused.value).startswith(f"{files}{sentence}")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[[0.5, 0]]", "[[0.5, 0], [9, 9]], max_time_s: 3", "target 2 at (9, 9) m was not entered in max_time_s"),
        ("[[0.5, 0]]", "[[1.5, 0]]", "a camera of rig 'down' leaves the room (3 × 3 × 1.5 m around the origin) of scene 'closet' after"),
        ("pitch_deg: 90", "pitch_deg: 90, height_m: 1.5", "a camera of rig 'down' leaves the room"),
        ("[[0.5, 0]]", "[[0.5, 0]], rate_hz: 0.1", "gain_per_s 0.8 at 0.1 Hz"),
    ],
)  # fmt: skip
def test_a_drive_that_cannot_be_is_said_before_anything_is_rendered(bent, tmp_path, old, new, sentence):
    planned = bent((old, new))
    with pytest.raises(VobenchError) as refused:
        body_motions(planned)
    assert str(refused.value).startswith(f"{tmp_path / 'tiny.yaml'}:6: trajectories.short: {sentence}")


DOCS = Path(__file__).parents[2] / "docs" / "suites.md"


def test_the_suite_of_the_docs_is_valid(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lighting.yaml").write_text(DOCS.read_text(encoding="utf-8").split("```yaml\n")[1].split("```")[0])
    assert [case.name for case in read_plan("./lighting.yaml").cases] == ["both", "one_lamp"]
