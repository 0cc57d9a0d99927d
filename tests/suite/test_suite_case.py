"""The axes of a suite and their combinations; what a suite leaves out is found in its scenes."""

from itertools import product

import pytest

from tests.suite.conftest import CLOSET
from vobench.errors import VobenchError
from vobench.geometry.rig import CalibrationError
from vobench.scene.light import Light
from vobench.suite import scene_build
from vobench.suite.axis import RigSettings
from vobench.suite.scene_file import read_scene
from vobench.suite.suite import read_plan
from vobench.suite.suite_case import check_buildable, scene_lights

SHORT = "trajectories: {short: {targets_m: [[0.5, 0]]}}\n"


@pytest.fixture
def plan(tmp_path):
    """Reads the plan of a suite over scenes that are copies of the closet."""

    def read(text, scenes=("closet",)):
        for name in scenes:
            (tmp_path / f"{name}.yaml").write_text(CLOSET.replace("name: closet", f"name: {name}"))
        head = f"name: small\nscenes: [{', '.join(scenes)}]\nestimators: [stand_still]\n"
        (tmp_path / "small.yaml").write_text(head + text)
        return read_plan(str(tmp_path / "small.yaml"))

    return read


def test_cases_come_in_the_order_of_scenes_then_lightings_then_rigs_then_cameras(plan):
    text = (
        "lightings: {full: {}, dim: {lamp: {power_lm: 150}}}\nrigs: {down: {pitch_deg: 90}, ahead: {pitch_deg: 10}}\n"
        "cameras: {clean: {}, slow: {exposure_ms: 9}}\n"
    )
    cases = plan(text + SHORT, scenes=("closet", "attic")).simulated
    expected = product(("closet", "attic"), ("full", "dim"), ("down", "ahead"), ("clean", "slow"))
    assert [case.name for case in cases] == ["-".join(names) for names in expected]


def test_every_case_has_the_values_of_the_variants_that_it_names(plan):
    text = "rigs: {down: {pitch_deg: 90}, ahead: {pitch_deg: 10}}\ncameras: {clean: {}, slow: {exposure_ms: 9}}\n"
    planned = plan(text + SHORT)
    assert len(planned.simulated) == 4
    for case in planned.simulated:
        assert case.rig == planned.suite.rigs[case.variant["rig"]]
        assert case.camera == planned.suite.cameras[case.variant["camera"]]
        assert case.trajectory == planned.suite.trajectories[case.variant["trajectory"]]
        assert case.scene.name == case.variant["scene"]


def test_a_suite_without_rigs_looks_ahead_and_a_bit_down(plan):
    (case,) = plan(SHORT).simulated
    assert case.variant["rig"] == "ahead"
    assert 0 < case.rig.pitch_deg < 45


def test_a_suite_without_trajectories_goes_round_in_each_scene_and_in_no_other(plan):
    one = plan("").simulated
    assert [(case.variant["scene"], case.variant["trajectory"]) for case in one] == [("closet", "found")]
    two = plan("rigs: {down: {pitch_deg: 90}, ahead: {pitch_deg: 10}}\n", scenes=("closet", "attic")).simulated
    assert [(case.variant["scene"], case.variant["trajectory"]) for case in two] == [
        ("closet", "found_closet"),
        ("closet", "found_closet"),
        ("attic", "found_attic"),
        ("attic", "found_attic"),
    ]
    assert one[0].trajectory == two[0].trajectory


def test_cases_of_a_design_are_named_by_what_differs_between_them(plan):
    design = "spread: {units: 1, each: 1}\n"
    text = "lightings: {full: {}, dim: {lamp: {power_lm: 150}}}\ncameras: {a: {}, b: {}, c: {}}\n"
    cases = plan(text + SHORT + design).simulated
    expected = product(("full", "dim"), ("a", "b", "c"))
    assert [case.name for case in cases] == [f"{lighting}-{camera}-closet-short" for lighting, camera in expected]


def test_what_a_suite_says_once_holds_for_every_case(plan):
    text = "seed: 5\ntruth: [depth]\nframes: [1, 4]\ntruth_noise: {position_m: 0.01}\ncameras: {a: {}, b: {}}\n"
    cases = plan(text + SHORT).simulated
    assert len(cases) == 2
    for case in cases:
        assert (case.seed, case.truth, case.frames, case.truth_noise.position_m) == (5, ("depth",), (1, 4), 0.01)


def test_poses_are_read_for_the_trajectory_that_replays_them_alone(plan, tmp_path):
    rows = "".join(f"{k / 10} {k / 100} 0 0.5 0 0 0 1\n" for k in range(20))
    (tmp_path / "path.tum").write_text(rows)
    text = "trajectories:\n  short: {targets_m: [[0.5, 0]]}\n  again: {kind: replay, file: path.tum}\n"
    by_name = {case.variant["trajectory"]: case.replayed for case in plan(text).simulated}
    assert by_name["short"] is None
    assert len(by_name["again"].splitlines()) == 20


def test_a_rig_whose_calibration_error_no_camera_can_have_is_refused():
    rig = RigSettings(pitch_deg=0)
    assert check_buildable(rig) is rig
    turned = RigSettings(pitch_deg=0, calibration_error=CalibrationError(level="worn"))
    assert check_buildable(turned) is turned
    unread = RigSettings(pitch_deg=0, calib="calib.txt")
    with pytest.raises(VobenchError, match="was not read"):
        check_buildable(unread)


def test_geometry_is_built_only_for_lights_that_the_file_does_not_list(tmp_path, monkeypatch):
    built = []
    build = scene_build.build

    def counted(*arguments):
        built.append(arguments)
        return build(*arguments)

    monkeypatch.setattr(scene_build, "build", counted)
    (tmp_path / "closet.yaml").write_text(CLOSET)
    scene = read_scene(tmp_path / "closet.yaml")

    def names(lights: tuple[Light, ...]) -> list[str]:
        return [light.name for light in lights]

    assert names(scene_lights(scene, ["lamp"])) == ["lamp"]
    assert names(scene_lights(scene, [])) == ["lamp"]
    assert not built
    assert names(scene_lights(scene, ["candle"])) == ["lamp"]
    assert len(built) == 1


def test_a_mount_replaces_its_keys_of_every_rig_and_no_others(plan):
    drives = "trajectories: {low: {targets_m: [[0.5, 0]]}, high: {targets_m: [[0.5, 0]], mount: {height_m: 1.2}}}\n"
    rigs = "rigs: {down: {pitch_deg: 90, height_m: 0.5}, ahead: {pitch_deg: 5, height_m: 0.6}}\n"
    seen = {}
    for case in plan(rigs + drives).simulated:
        rig = case.build_rig()
        assert rig.T_body_left[2, 3] == pytest.approx(case.rig.height_m)
        seen[case.variant["rig"], case.variant["trajectory"]] = (case.rig.pitch_deg, case.rig.height_m)
    assert seen == {
        ("down", "low"): (90, 0.5),
        ("down", "high"): (90, 1.2),
        ("ahead", "low"): (5, 0.6),
        ("ahead", "high"): (5, 1.2),
    }
