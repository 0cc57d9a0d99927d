"""What vobench check prints."""

import pytest

from vobench.cli.check import _format_duration


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(None, ""), (0.0, "0 s"), (59.6, "60 s"), (599.0, "599 s"), (600.0, "10 min"), (5400.0, "90 min")],
)
def test_a_duration_is_in_seconds_up_to_ten_minutes_and_then_in_minutes(seconds, text):
    assert _format_duration(seconds) == text


def test_check_prints_cases_estimators_and_where_each_was_found(vobench, here):
    printed = vobench("check", "tiny").out
    for part in ("tiny: cases", "short", "wheel_odometry", "encoders", "stand_still", "nothing", "./scenes"):
        assert part in printed
    assert printed.endswith("1 cases, 2 estimators, 2 trials: the suite is valid\n")
    assert "to do" not in printed


def test_a_dry_run_prints_the_tasks_as_well(vobench, here):
    printed = vobench("run", "tiny", "--dry-run").out
    assert "in the cache" in printed
    assert "bake" in printed
    assert not (here / "runs").exists()
