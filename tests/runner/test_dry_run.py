"""A dry run says what a run would make and why."""

from dataclasses import replace

import pytest

from tests.runner.conftest import Bench
from vobench.runner import dry_run
from vobench.runner.dry_run import StageEstimate, pending_tasks
from vobench.runner.folder import RunFolder
from vobench.runner.store import Store
from vobench.runner.task import Task, plan


@pytest.fixture(autouse=True)
def _nothing_is_kept():
    dry_run._stored.cache_clear()


def said(bench: Bench, *changes: tuple[str, str]) -> dict[str, StageEstimate]:
    return {each.stage: each for each in pending_tasks(plan(bench.plan(*changes), {}), bench.folder / "cache")}


def test_of_what_is_in_the_cache_nothing_is_to_do_and_its_stages_have_taken_time(bench: Bench, first: RunFolder):
    assert [each.pending for each in said(bench).values()] == [0, 0, 0, 0]
    assert all(len(Store(bench.folder / "cache").seconds(stage)) >= 1 for stage in ("bake", "estimate"))


def test_a_change_is_named_where_it_enters_and_what_hangs_on_it_names_that(bench: Bench, first: RunFolder):
    found = said(bench, ("seed: 1", "seed: 77"))
    assert found["bake"].pending == 0
    assert found["sequence"].reasons == {"case.seed: 1 → 77": 2}
    after_sequence = {"the sequence that it requires must be computed first": 4}
    assert found["estimate"].reasons == after_sequence
    assert found["score"].reasons == after_sequence
    assert found["sequence"].seconds > 0


def test_another_estimator_renders_nothing_and_another_lighting_makes_one_sequence(bench: Bench, first: RunFolder):
    more = said(bench, ("stand_still]", "stand_still, constant_velocity]"))
    assert [more[stage].pending for stage in ("bake", "sequence", "estimate", "score")] == [0, 0, 2, 2]
    lit = said(bench, ("{full: {}", "{dusk: {lamp: {power_lm: 20}}, full: {}"))
    assert [lit[stage].pending for stage in ("bake", "sequence", "estimate", "score")] == [0, 1, 2, 2]


def test_damage_is_named(bench: Bench, first: RunFolder):
    task: Task = next(one for one in plan(bench.plan(), {}) if one.stage == "score")
    path = bench.folder / "cache" / task.key / "score.json"
    whole = path.read_bytes()
    path.write_bytes(whole[:-1])
    try:
        reasons = said(bench)["score"].reasons
    finally:
        path.write_bytes(whole)
    assert list(reasons.values()) == [1]
    assert next(iter(reasons)).startswith(f"damaged: score.json has {len(whole) - 1} bytes")


def test_changed_code_and_changed_limits_are_told_apart(bench: Bench, first: RunFolder):
    root, limited = bench.folder / "cache", bench.plan().limited(trial_s=5.0)
    found = {each.stage: each for each in pending_tasks(plan(limited, {}), root)}
    assert found["estimate"].reasons == {"limits.trial_s: 7200.0 → 5.0": 4}
    changed = [replace(one, inputs={**one.inputs, "code": "x"}) for one in plan(bench.plan(), {})]
    assert {*pending_tasks([one for one in changed if one.stage == "estimate"], root)[0].reasons} == {
        "its code in vobench changed"
    }
