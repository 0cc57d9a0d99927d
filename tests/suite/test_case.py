"""A case builds its scene, its nominal rig and its true rig."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry.rig import drawn_calibration_error, true_rig
from vobench.suite.suite import read_plan

# ruff: noqa: E501 - an entry stands in one line

NOISY = """name: noisy
seed: 3
repeats: 3
scenes: [{name: flat, seed: 1}]
trajectories: {tour: {kind: wander, body: pioneer, length_m: 2, seed: 1}}
estimators: [lk_epipolar]
"""


def test_a_lighting_sets_the_lamps_it_names_and_leaves_the_others(bent):
    levels = [case.build_scene().lights[0].level.mean(0, 0) for case in bent().cases]
    assert levels == [1, 150 / 600]


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


def test_a_case_of_a_robot_has_its_wheels_and_another_none(bent):
    assert bent().cases[0].build_rig().wheels is not None
    handheld = bent(("{targets_m: [[0.5, 0]]}", "{kind: pose_spline, poses: [{t_s: 0, position_m: [0, 0, 0]}, {t_s: 1, position_m: [0.2, 0, 0]}, {t_s: 2, position_m: [0.4, 0, 0]}, {t_s: 3, position_m: [0.5, 0, 0]}]}"))  # fmt: skip
    assert handheld.cases[0].build_rig().wheels is None


def test_a_drawn_calibration_error_depends_on_the_seed_alone(bent):
    level = ("pitch_deg: 90", "pitch_deg: 90, calibration_error: worn")

    def true_right(*changes):
        return bent(level, *changes).cases[0].build_true_rig().T_body_right.tobytes()

    assert true_right() == true_right()
    assert true_right(("seed: 1", "seed: 2")) != true_right()
    assert true_right(("sensor: clean", "sensor: mt9v034")) == true_right()


def test_random_calibration_errors_come_from_a_stream_of_their_own(bent):
    case = bent(("pitch_deg: 90", "pitch_deg: 90, calibration_error: worn")).cases[0]
    rig = case.build_rig()
    expected = true_rig(
        rig, drawn_calibration_error(case.rig.calibration_error, rig, np.random.default_rng([1, 7_301]))
    )
    assert case.build_true_rig().T_body_right.tobytes() == expected.T_body_right.tobytes()


def test_without_rigs_a_pair_looks_ahead_ten_degrees_below_the_horizon(bent):
    (case, *_) = bent(("rigs: {down: {pitch_deg: 90}}\n", "")).cases
    assert (case.variant["rig"], case.rig.pitch_deg) == ("ahead", 10)
    assert (case.rig.forward_m, case.rig.height_m, case.rig.picture_scale) == (0.25, 0.4, 1)


def test_repeats_share_place_and_drive_and_differ_in_their_seed(tmp_path):
    suite = tmp_path / "noisy.yaml"
    suite.write_text(NOISY)
    first, second, third = read_plan(str(suite)).simulated
    assert [case.name for case in (second, third)] == [f"{first.name}-repeat2", f"{first.name}-repeat3"]
    assert len({case.seed for case in (first, second, third)}) == 3
    assert [case.repeat for case in (first, second, third)] == [0, 1, 2]
    assert {case.repeat_of for case in (second, third)} == {first.name}
    assert replace(second, name=first.name, seed=first.seed, repeat=0, repeat_of=None) == first
