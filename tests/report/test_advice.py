"""What would decide a board: places by the variance that it saw, and time by what tasks took before."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.report.advice import cost_of_deciding
from vobench.report.leaderboard import make_board
from vobench.suite.suite import read_plan

SUITE = """name: drawn
scenes: [{name: flat, seeds: 8}]
trajectories: {tour: {kind: wander, body: pioneer, length_m: 2, seed: 1}}
estimators: [wheel_odometry, lk_epipolar]
"""
TYPICAL_S = {"bake": 30.0, "sequence": 20.0, "estimate": 10.0, "score": 0.5}


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "drawn.yaml"
    path.write_text(SUITE)
    return read_plan(str(path))


@pytest.fixture
def totals(scored):
    """Two estimators that differ by chance in eight places; 20 places would decide a ratio of 1.5."""
    rng = np.random.default_rng(0)
    scores = []
    for place in range(8):
        for name in ("a", "b"):
            loss = 0.01 * np.exp(rng.normal(0, 0.2))
            score = {"metrics": [{"name": "ate_trans", "rmse": loss}], "failure": {"lost_aware": 1 - loss}}
            scores.append(scored(name, case=f"place{place}", score=score, path_m=1e3))
    totals = make_board(scores, {}).totals
    assert totals[1].decided_above is False
    return [totals[0], replace(totals[1], places_needed=20)]


def test_places_drives_and_minutes_are_named(totals, plan):
    # each place: a bake of 30 s and a sequence of 20 s by two jobs, two estimates of 10 s alone, two scores of 0.5 s
    seconds_per_place = 30 / 2 + 20 / 2 + 2 * 10 + 2 * 0.5 / 2
    minutes = round(12 * seconds_per_place / 60)
    assert cost_of_deciding(totals, plan, TYPICAL_S, jobs=2) == (
        f"To decide a ratio of 1.5: about 12 more drives in 12 more places, about {minutes} min"
    )


def test_two_drives_in_each_place_are_twice_as_many_drives(totals, plan):
    twice = [totals[0], replace(totals[1], drives=16)]
    assert "about 24 more drives in 12 more places" in cost_of_deciding(twice, plan, TYPICAL_S, jobs=2)


def test_no_time_is_named_if_a_stage_was_never_timed(totals, plan):
    known = {"sequence": 20.0}
    assert cost_of_deciding(totals, plan, known, jobs=2).endswith("12 more drives in 12 more places")


def test_nothing_is_said_of_a_board_that_is_decided_or_not_tested_or_large_enough(totals, plan):
    for change in ({"decided_above": True}, {"decided_above": None}, {"places_needed": 8}, {"places_needed": None}):
        changed = [totals[0], replace(totals[1], **change)]
        assert cost_of_deciding(changed, plan, TYPICAL_S, jobs=2) == ""
