"""Settings of tools, changed."""

from dataclasses import replace

import pytest

from vobench.errors import SettingError, UnknownNameError
from vobench.metric.settings import LIKE, ScoreSettings
from vobench.runner.score_settings import settings_like


def test_without_a_preset_and_changes_settings_are_ours():
    assert settings_like() == ScoreSettings()
    assert settings_like(alignment=None, full=None) == ScoreSettings()


@pytest.mark.parametrize("preset", LIKE)
def test_a_preset_without_changes_is_itself(preset):
    assert settings_like(preset, rpe_unit=None) == LIKE[preset]


def test_a_change_is_put_over_the_preset():
    assert settings_like("evo", alignment="origin") == replace(LIKE["evo"], alignment="origin")


@pytest.mark.parametrize(
    ("preset", "change", "rule"),
    [
        ("tum", {"rpe_unit": "s"}, "tum"),
        ("tum", {"rpe_delta": 2.0}, "tum"),
        ("tum", {"rpe_unit": "m"}, "spanning"),
        ("tum", {"project": "xy"}, "spanning"),
        ("tartanair", {"rpe_all_pairs": True}, "tartanair"),
        ("tartanair", {"rpe_pairs_from": "est"}, "spanning"),
        ("tartanair", {"rpe_delta": 5.0}, "spanning"),
        ("tartanair", {"project": "xy"}, "tartanair"),
    ],
)
def test_pairs_that_the_rule_of_a_tool_does_not_know_are_chosen_by_ours(preset, change, rule):
    assert settings_like(preset, **change).rpe_rule == rule


def test_names_that_are_not_known_are_refused_with_what_they_are_of():
    with pytest.raises(UnknownNameError, match="no preset named 'evoo'"):
        settings_like("evoo")
    with pytest.raises(UnknownNameError, match="no plane named 'zx'"):
        settings_like(project="zx")


def test_a_value_that_measures_nothing_is_refused_with_the_name_of_its_setting():
    with pytest.raises(SettingError) as raised:
        settings_like(rpe_delta=-1.0)
    assert raised.value.keys == ("rpe_delta",)
