"""From a suite to its plan: one factor a line, one case a combination."""

import pytest

from vobench.catalog import catalog
from vobench.catalog.catalog import builtin_root
from vobench.errors import SuiteError, UnknownNameError
from vobench.suite import expand, scene_file
from vobench.suite.expand import AXES, plan, read_plan

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


def test_a_lighting_sets_the_lamps_it_names_and_leaves_the_others(bent):
    levels = [case.build_scene().lights[0].level.mean(0, 0) for case in bent().cases]
    assert levels == [1, 150 / 600]


def test_a_suites_parameters_go_over_the_manifests(bent):
    assert [entrant.params for entrant in bent().entrants] == [{}, {"measure_s": 0.1}]


def test_one_estimator_takes_part_twice_under_two_labels(bent):
    planned = bent(("stand_still,", "{name: constant_velocity, label: slow, params: {measure_s: 1}},"))
    assert [(e.label, e.params["measure_s"]) for e in planned.entrants] == [("slow", 1), ("constant_velocity", 0.1)]


def test_parameters_reach_an_estimator_as_plain_python(bent):
    (value,) = bent().entrants[1].params.values()
    assert type(value) is float


def test_every_estimator_runs_repeats_times_on_every_case(bent):
    planned = bent(("seed: 1", "seed: 1\nrepeats: 3"))
    runs = [run for case in planned.cases for run in planned.runs(case)]
    assert len(runs) == len({(run.case.name, run.entrant.label, run.repeat) for run in runs}) == 2 * 2 * 3


def test_asking_for_estimators_takes_the_suites_own_settings_first(bent):
    planned = bent(only=("constant_velocity", "wheel_odometry"))
    assert [(e.label, e.params) for e in planned.entrants] == [
        ("constant_velocity", {"measure_s": 0.1}),
        ("wheel_odometry", {}),
    ]


def test_asking_for_one_estimator_twice_is_an_error(bent):
    with pytest.raises(SuiteError, match="two estimators are called 'stand_still'"):
        bent(only=("stand_still", "stand_still"))


def test_asking_for_an_unknown_estimator_names_the_nearest(bent):
    with pytest.raises(UnknownNameError, match="Did you mean 'stand_still'"):
        bent(only=("stand_stil",))


def test_scenes_and_estimators_are_found_beside_their_suite_from_anywhere(bent, tmp_path, monkeypatch):
    manifest = "name: stand_still\nversion: mine\nclass: estimator:Mine\npose_of: body\nsummary: Mine.\n"
    bent()
    (tmp_path / "estimators" / "stand_still").mkdir(parents=True)
    (tmp_path / "estimators" / "stand_still" / "estimator.yaml").write_text(manifest)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for only in ((), ("stand_still",)):
        planned = read_plan("../tiny.yaml", only_estimators=only)
        assert planned.entrants[0].manifest.version == "mine"
    assert [(e.kind, e.name, e.origin) for e in read_plan("../tiny.yaml").found] == [
        ("estimator", "stand_still", "beside the suite"),
        ("estimator", "constant_velocity", "built in"),
        ("scene", "closet", "beside the suite"),
    ]


def test_what_cases_share_is_made_once_however_many_there_are(bent, monkeypatch):
    calls = []
    for module, name in (
        (scene_file, "survey"),
        (scene_file, "build"),
        (scene_file, "lights"),
        (expand, "read_manifest"),
    ):
        made = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args, made=made, name=name: (calls.append(name), made(*args))[1])
    ways = ", ".join(f"way_{k}: {{targets_m: [[0.{k + 1}, 0]]}}" for k in range(9))
    cameras = ", ".join(f"camera_{k}: {{blur_sigma_px: {k}}}" for k in range(5))
    few = bent(), sorted(calls)
    calls.clear()
    many = bent(("short: {targets_m: [[0.5, 0]]}", ways), ("clean: {sensor: clean}", cameras)), sorted(calls)
    assert (len(few[0].cases), len(many[0].cases)) == (2, 90)
    assert few[1] == many[1] == ["build", "lights", "read_manifest", "read_manifest", "survey"]


def test_merge_keys_and_aliases_keep_a_suite_short(bent):
    planned = bent(("{down: {pitch_deg: 90}}", "\n  down: &down {pitch_deg: 90}\n  wide: {<<: *down, baseline_m: 0.2}"))
    assert planned.suite.rigs["wide"].pitch_deg == 90
    assert planned.suite.rigs["wide"].baseline_m == 0.2


def test_a_plan_goes_through_json_unchanged(bent):
    suite = bent().suite
    assert type(suite).model_validate_json(suite.model_dump_json()) == suite


@pytest.mark.parametrize("name", sorted(path.stem for path in (builtin_root() / "suites").glob("*.yaml")))
def test_every_suite_of_the_house_is_valid_and_called_as_its_file(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    suite = read_plan(name).suite
    assert suite.name == name
    assert plan(suite).cases
    assert catalog.find("suite", name).origin == "built in"


def test_a_rig_takes_lenses_and_their_places_from_its_preset_and_a_baseline_over_it(bent):
    euroc = bent(("pitch_deg: 90", "pitch_deg: 90, lens: euroc")).cases[0].build_rig()
    assert euroc.left != euroc.right
    assert euroc.baseline_m == pytest.approx(0.110, abs=1e-3)
    wide = bent(("pitch_deg: 90", "pitch_deg: 90, lens: euroc, baseline_m: 0.3")).cases[0].build_rig()
    assert (wide.left, wide.right) == (euroc.left, euroc.right)
    assert wide.baseline_m == pytest.approx(0.3)


def test_a_calibration_error_makes_the_true_rig_another_and_the_told_one_not(bent):
    plain, off = (
        bent(("pitch_deg: 90", f"pitch_deg: 90{more}")).cases[0]
        for more in ("", ", calibration_error: {focal_ratio: 0.02, right_yaw_deg: 0.5}")
    )
    told, true = off.build_rig(), off.build_true_rig()
    assert told.left == plain.build_rig().left == plain.build_true_rig().left
    assert told.T_body_right.tobytes() == plain.build_true_rig().T_body_right.tobytes()
    assert true.left.fx_px == pytest.approx(1.02 * told.left.fx_px)
    assert true.T_body_left.tobytes() == told.T_body_left.tobytes()
    assert true.T_body_right.tobytes() != told.T_body_right.tobytes()
