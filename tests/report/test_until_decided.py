"""Runs of a suite until each pair of estimators is settled: when they end, what they cost, what their boards say."""

import json
from dataclasses import dataclass, field

import numpy as np
import pytest

from vobench.errors import InputError, SuiteError
from vobench.report import page
from vobench.report.board_table import remarks
from vobench.report.until_decided import parse_duration_s, record, recorded_ratio, run_until_decided
from vobench.runner.bundle import bundle, merged, opened
from vobench.runner.folder import CASE, UNTIL, write_hashes
from vobench.runner.store import write_json
from vobench.suite.draw import Draws

SUITE = """name: drawn
scenes: [{name: flat, seeds: 2}]
trajectories: {tour: {kind: wander, body: pioneer, length_m: 2, seed: 1}}
estimators: [wheel_odometry, lk_epipolar]
"""
DRAW_S = 60.0


@dataclass
class Clock:
    """A clock that only draws move."""

    now_s: float = 0.0

    def __call__(self):
        return self.now_s


@dataclass
class FakeRuns:
    """Runs plans without estimators: each has losses by a known ratio, place by place."""

    path: object
    write_run: object
    scored: object
    ratios: dict
    clock: Clock
    place_std: float = 0.2
    looks: list = field(default_factory=list)

    def folder(self, plan):
        scores = [score for case in plan.simulated for score in self.scores_of(case)]
        folder = self.write_run(self.path / "drawn" / f"run{len(self.looks)}", scores)
        for case in plan.simulated:
            place = {"name": "flat", "generated": {"seed": case.scene.generated.seed}}
            write_json(folder.case(case.name) / CASE, {"scene": place, "trajectory": {"kind": "wander", "seed": 1}})
        return folder

    def scores_of(self, case):
        rng = np.random.default_rng(case.scene.generated.seed)
        for estimator, ratio in self.ratios.items():
            loss = 0.01 * ratio * np.exp(rng.normal(0, self.place_std))
            score = {"metrics": [{"name": "ate_trans", "rmse": loss}], "failure": {"lost_aware": 1 - loss}}
            yield self.scored(estimator, case=case.name, score=score, path_m=100.0)

    def look(self, plan):
        self.looks.append([case.name for case in plan.simulated])
        self.clock.now_s += DRAW_S
        return self.folder(plan)

    def finish(self, plan):
        self.looks.append([])
        folder = self.folder(plan)
        record(folder, ratio=1.5)
        return folder


@pytest.fixture
def until(tmp_path, write_run, scored):
    """Runs until decided with estimators of these ratios of losses; returns what ended, and the runs."""
    path = tmp_path / "drawn.yaml"
    path.write_text(SUITE)

    def run(ratios, *, budget_s=1e6, **settings):
        clock = Clock()
        runs = FakeRuns(tmp_path, write_run, scored, ratios, clock, **settings)
        draws = Draws(str(path), {})
        ended = run_until_decided(
            draws.plan, look=runs.look, finish=runs.finish, ratio=1.5, budget_s=budget_s, clock_s=clock
        )
        return ended, runs

    return run


def test_estimators_that_differ_much_are_decided_after_few_draws_in_the_right_order(until):
    ended, runs = until({"a": 3.0, "b": 1.0})
    assert ended.has_ended
    (pair,) = ended.pairs
    assert (pair.first, pair.second) == ("b", "a")
    assert ended.units == 2 * ended.draws == 2 * (len(runs.looks) - 1) < 30
    assert pair.sentence.endswith("decided")
    assert ended.cost == f"Each pair is decided or alike after {ended.units} places in {ended.draws} draws, " + (
        f"{ended.draws} min"
    )


def test_estimators_that_are_equally_good_are_found_alike(until):
    ended, _ = until({"a": 1.0, "b": 1.0})
    assert ended.has_ended
    assert "alike within 1.5 ×" in ended.pairs[0].sentence


def test_every_draw_has_places_of_its_own_and_the_final_run_has_all_of_them(until):
    ended, runs = until({"a": 2.0, "b": 1.0, "c": 4.0})
    drawn = [name for look in runs.looks for name in look]
    assert len(drawn) == len(set(drawn)) == ended.units
    assert {score.case for score in ended.folder.scores()} == set(drawn)


def test_the_budget_ends_a_run_that_could_go_on_and_the_cost_of_the_rest_is_estimated(until):
    ended, _ = until({"a": 1.25, "b": 1.0}, budget_s=5.5 * DRAW_S, place_std=0.5)
    assert (ended.draws, ended.has_ended) == (5, False)
    assert ended.cost.startswith("1 pair is open after 10 places in 5 draws, 5 min; about ")
    assert "more places would decide" in ended.cost


def test_a_first_draw_is_always_run_and_says_nothing_of_what_it_would_take(until):
    ended, _ = until({"a": 1.2, "b": 1.0}, budget_s=1.0)
    assert ended.draws == 1
    assert ended.cost.endswith("how many more it takes is not known yet")


def test_one_estimator_alone_has_nothing_to_be_decided_against(until):
    with pytest.raises(SuiteError, match="two ranked estimators"):
        until({"a": 1.0})


def test_the_board_of_such_a_run_has_tests_that_allow_for_looking(until):
    ended, _ = until({"a": 1.6, "b": 1.0}, place_std=0.3)
    board = page.run_board(ended.folder, ended.folder.scores())
    sentences = remarks(board)
    assert any(sentence.startswith("Units were drawn until each pair was decided") for sentence in sentences)
    assert ended.pairs[0].sentence in sentences
    (ended.folder.path / UNTIL).unlink()
    fixed = page.run_board(ended.folder, ended.folder.scores())
    low, high = board.totals[1].error_interval
    fixed_low, fixed_high = fixed.totals[1].error_interval
    assert low < fixed_low < fixed_high < high
    assert board.totals[1].p_above > fixed.totals[1].p_above


def test_a_bundle_and_a_merged_run_keep_how_units_were_drawn(until, tmp_path):
    ended, _ = until({"a": 3.0, "b": 1.0})
    write_hashes(ended.folder)
    bundle(ended.folder, tmp_path / "drawn.zip")
    with opened(tmp_path / "drawn.zip") as folder:
        assert recorded_ratio(folder) == 1.5
        with merged([folder, folder], ["one", "two"]) as both:
            assert recorded_ratio(both) == 1.5


@pytest.mark.parametrize("content", [{}, {"ratio": "x"}, {"ratio": 0.5}, {"ratio": True}])
def test_a_damaged_record_is_none(write_run, scored, tmp_path, content):
    folder = write_run(tmp_path / "run", [scored("a")])
    assert recorded_ratio(folder) is None
    (folder.path / UNTIL).write_text(json.dumps(content))
    assert recorded_ratio(folder) is None


@pytest.mark.parametrize(("text", "seconds"), [("90s", 90), ("40min", 2400), ("1.5h", 5400)])
def test_a_duration_has_a_unit(text, seconds):
    assert parse_duration_s(text) == seconds


@pytest.mark.parametrize("text", ["40", "min", "-3min", "0s", "1.2.3h", "forty min"])
def test_a_duration_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="as in 40min"):
        parse_duration_s(text)
