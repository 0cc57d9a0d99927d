"""Settings of a score: refused combinations, segments that fit the path, and the settings of other tools."""

import pytest

from vobench.errors import SettingError
from vobench.metric.settings import (
    INDOOR_LENGTHS_M,
    KITTI_LENGTHS_M,
    LIKE,
    TARTANAIR_LENGTHS_M,
    ScoreSettings,
    settled,
)


@pytest.mark.parametrize(
    ("path_m", "lengths_m", "step_frames"),
    [
        (0.0, INDOOR_LENGTHS_M, 1),
        (39.9, INDOOR_LENGTHS_M, 1),
        (40.0, TARTANAIR_LENGTHS_M, 1),
        (299.9, TARTANAIR_LENGTHS_M, 1),
        (300.0, KITTI_LENGTHS_M, 10),
        (5000.0, KITTI_LENGTHS_M, 10),
    ],
)
def test_segments_fit_the_length_of_the_path(path_m, lengths_m, step_frames):
    complete = settled(ScoreSettings(), path_m)

    assert (complete.segment_lengths_m, complete.segment_step_frames) == (lengths_m, step_frames)


def test_given_segments_stay():
    settings = ScoreSettings(segment_lengths_m=(3.0,), segment_step_frames=7)

    assert settled(settings, 1000.0) == settings
    assert settled(ScoreSettings(segment_lengths_m=(3.0,)), 1000.0).segment_step_frames == 1
    assert settled(ScoreSettings(segment_lengths_m=KITTI_LENGTHS_M), 1.0).segment_step_frames == 10
    assert settled(ScoreSettings(segment_step_frames=7), 1000.0).segment_lengths_m == KITTI_LENGTHS_M


def test_a_relative_error_is_by_default_that_of_consecutive_frames():
    settings = ScoreSettings()

    assert (settings.rpe_delta, settings.rpe_unit, settings.rpe_all_pairs) == (1, "f", False)


def test_completing_settings_changes_nothing_else_and_nothing_the_second_time():
    settings = ScoreSettings(alignment="yaw", fail_ratio=0.3)
    once = settled(settings, 50.0)

    assert settled(once, 5000.0) == once
    assert (once.alignment, once.fail_ratio) == ("yaw", 0.3)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"rpe_delta": 1.5}, "should be a whole number of frames (got 1.5)"),
        ({"rpe_delta": 180.1, "rpe_unit": "d"}, "should be half a turn or less (got 180.1)"),
        ({"rpe_delta": 3.2, "rpe_unit": "r"}, "should be half a turn or less (got 3.2)"),
        ({"rpe_rule": "tum"}, "should be spanning unless the pairs are those of tum (got 'tum')"),
        ({"rpe_rule": "tartanair"}, "should be spanning unless the pairs are those of tartanair (got 'tartanair')"),
        (
            {"rpe_rule": "tum", "rpe_unit": "s", "rpe_all_pairs": True, "rpe_pairs_from": "est", "project": "xy"},
            "should be spanning in a plane (got 'tum')",
        ),
        ({"scale_rule": "tartanair", "alignment": "sim3"}, "should be se3 with the scale of TartanAir (got 'sim3')"),
    ],
)
def test_a_combination_that_cannot_be_measured_is_refused(wrong, message):
    with pytest.raises(SettingError) as error:
        ScoreSettings(**wrong)

    assert message in str(error.value)


@pytest.mark.parametrize(
    "right",
    [
        {"rpe_delta": 2.0},
        {"rpe_delta": 1.5, "rpe_unit": "m"},
        {"rpe_delta": 1.5, "rpe_unit": "s"},
        {"rpe_delta": 180.0, "rpe_unit": "d"},
        {"rpe_delta": 3.14159, "rpe_unit": "r"},
        {"rpe_delta": 1000.0, "rpe_unit": "m"},
        {"project": "xy"},
        {"rpe_rule": "evo"},
        {"rpe_rule": "tartanair", "rpe_all_pairs": True},
        {"scale_rule": "tartanair", "alignment": "se3"},
        {"alignment": "sim3"},
    ],
)
def test_a_combination_that_can_be_measured_is_accepted(right):
    settings = ScoreSettings(**right)

    assert {name: getattr(settings, name) for name in right} == right


def test_other_tools_differ_from_the_defaults_by_their_own_rules_alone():
    defaults = ScoreSettings()
    names = ScoreSettings.__dataclass_fields__
    changed = {}
    for tool, settings in LIKE.items():
        changed[tool] = {name for name in names if getattr(settings, name) != getattr(defaults, name)}

    assert changed["evo"] == {"alignment", "association", "rpe_pairs_from", "rpe_rule"}
    assert changed["kitti"] == {"alignment", "segment_lengths_m", "segment_step_frames", "segment_precision"}
    assert changed["rpg"] == {"alignment", "association", "max_diff_ns", "full"}
    assert changed["tartanair_mono"] - changed["tartanair"] == {"scale_rule"}
    assert changed["openvins"] >= {"relative_rule", "std_ddof"}
    assert {LIKE[tool].max_diff_ns for tool in ("rpg", "tum", "openvins")} == {20_000_000}
    assert LIKE["openvins"].std_ddof == 1
