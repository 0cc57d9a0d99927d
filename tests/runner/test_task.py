"""A suite's tasks: which there are, after which others, and that any process may perform them."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import pytest

from vobench.runner.entry import MANIFEST, seal
from vobench.runner.task import bake_task, is_done, missing, perform, plan, sequence_tasks
from vobench.scene.fog import Fog
from vobench.scene.rain import Rain
from vobench.scene.wind import Wind
from vobench.suite.scene_spec import LevelSpec


@pytest.fixture
def tasks(bench):
    return plan(bench.plan(), {})


def test_a_suite_is_one_light_for_each_scene_one_sequence_a_case_and_an_estimate_and_a_score_a_trial(tasks):
    stages = [task.stage for task in tasks]
    assert {stage: stages.count(stage) for stage in stages} == {"bake": 1, "sequence": 2, "estimate": 4, "score": 4}


def test_every_task_comes_once_and_after_all_that_it_needs(tasks):
    keys = [task.key for task in tasks]
    assert len(set(keys)) == len(keys)
    for index, task in enumerate(tasks):
        assert set(task.needs) <= set(keys[:index])


def test_planning_twice_says_the_same_and_writes_nothing(bench, tasks):
    before = sorted(bench.folder.rglob("*"))
    assert [task.key for task in plan(bench.plan(), {})] == [task.key for task in tasks]
    assert sorted(bench.folder.rglob("*")) == before


def test_tasks_pickle_and_keep_their_keys(tasks):
    assert [task.key for task in pickle.loads(pickle.dumps(tasks))] == [task.key for task in tasks]


def test_a_traced_case_needs_no_light(bench):
    traced = plan(bench.plan(("seed: 1", "seed: 1\nrendering: {engine: path}")), {})
    assert {task.stage for task in traced} == {"sequence", "estimate", "score"}
    assert traced[0].needs == ()


def test_equal_cases_of_two_names_share_a_sequence_and_are_scored_each(bench):
    twins = plan(bench.plan(("dim: {lamp: {power_lm: 150}}", "twin: {}")), {})
    stages = [task.stage for task in twins]
    assert (stages.count("sequence"), stages.count("estimate"), stages.count("score")) == (1, 2, 4)


@pytest.mark.parametrize(
    "change",
    [
        {"summary": "a closet"},
        {"white_cd_m2": 80.0},
        {"white_cd_m2": None},
        {"fog": Fog(visibility_m=30.0)},
        {"wind": Wind()},
    ],
    ids=["summary", "white", "no white", "fog", "wind"],
)
def test_a_change_of_a_scene_that_does_not_light_it_keeps_its_light(bench, change):
    scene = bench.plan().simulated[0].scene
    assert bake_task(replace(scene, **change)).key == bake_task(scene).key


@pytest.mark.parametrize(
    ("rain", "is_kept"),
    [
        (Rain(rate_mm_per_h=30.0, wind_mps=(3.0, 0.0), puddles=0.1), True),
        (Rain(puddles=0.2), False),
        (Rain(seed=1, puddles=0.1), False),
        (None, False),
    ],
    ids=["rate and wind", "puddles", "seed", "none"],
)
def test_of_rain_all_but_its_drops_counts_for_the_light(bench, rain, is_kept):
    scene = bench.plan().simulated[0].scene
    wet = bake_task(replace(scene, rain=Rain(puddles=0.1)))
    assert (bake_task(replace(scene, rain=rain)).key == wet.key) == is_kept


@pytest.mark.parametrize(
    ("change", "is_kept"),
    [({"level": LevelSpec(steady=0.5)}, True), ({"power_lm": 601.0}, False), ({"center_m": (0, 0, 1.3)}, False)],
    ids=["level", "power", "place"],
)
def test_of_a_lamp_all_but_its_level_counts_for_the_light(bench, change, is_kept):
    scene = bench.plan().simulated[0].scene
    (lamp,) = scene.lamps
    changed = replace(scene, lamps=(replace(lamp, **change),))
    assert (bake_task(changed).key == bake_task(scene).key) == is_kept


def test_light_is_computed_only_for_sequences_that_are_still_to_be_made(tasks, tmp_path):
    assert missing(tasks, tmp_path) == tasks
    for task in tasks:
        if task.stage == "sequence":
            (tmp_path / task.key).mkdir(parents=True)
            seal(tmp_path / task.key)
    assert {task.stage for task in missing(tasks, tmp_path)} == {"estimate", "score"}


def test_a_task_performed_in_another_process_makes_the_same_files(bench, first, tasks, tmp_path):
    store = bench.folder / "cache"
    assert all(is_done(task, store) for task in tasks)
    chosen = [task for task in tasks if task.stage in ("estimate", "score")][:2]
    beside = tmp_path / "store"
    (beside / "sequences").mkdir(parents=True)
    (beside / tasks[1].key).symlink_to(store / tasks[1].key)
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        made = [pool.submit(perform, task, beside, 1).result() for task in chosen]
    for task, folder in zip(chosen, made, strict=True):
        names = {path.name for path in folder.iterdir()}
        assert names == {path.name for path in (store / task.key).iterdir()}
        for name in names - {"times.csv", MANIFEST}:
            assert (folder / name).read_bytes() == (store / task.key / name).read_bytes()


def test_a_case_of_stock_pyrender_needs_no_light_and_counts_its_release(bench):
    stock = plan(bench.plan(("seed: 1", "seed: 1\nrendering: {engine: pyrender}")), {})
    assert "bake" not in {task.stage for task in stock}
    sequence = next(task for task in stock if task.stage == "sequence")
    assert {"PyOpenGL", "pyrender2"} <= set(sequence.inputs["libraries"])
    assert "mitsuba" not in sequence.inputs["libraries"]


@pytest.mark.parametrize("engine", ["path", "pyrender"])
def test_whatever_the_engine_a_scene_without_white_needs_its_light(bench, engine):
    drawn = bench.plan(("seed: 1", f"seed: 1\nrendering: {{engine: {engine}}}")).simulated[0]
    assert [task.stage for task in sequence_tasks(drawn)] == ["sequence"]
    unstated = replace(drawn, scene=replace(drawn.scene, white_cd_m2=None))
    bake, sequence = sequence_tasks(unstated)
    assert bake.stage == "bake"
    assert sequence.needs == (bake.key,)
