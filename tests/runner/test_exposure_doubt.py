"""Largely saturated or black pictures are doubted in one sentence, with the key that mends them."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.rendering.seen_light import SeenLight
from vobench.runner import exposure_doubt
from vobench.runner.exposure_doubt import doubts_of_plan, doubts_of_run, exposure_doubts

SEEN = np.random.default_rng(0).uniform(20, 60, (1, 500)).astype(np.float32)  # cd/m² by the closet's lamp


@pytest.fixture
def light(tmp_path, monkeypatch):
    """A folder with what cameras see, which is that of every case."""

    def of(factor: float = 1.0):
        SeenLight(factor * SEEN, np.zeros(500, bool), ("lamp",), (1.0,)).save(tmp_path)
        return tmp_path

    monkeypatch.setattr(exposure_doubt, "_light", lambda _: tmp_path)
    return of


def test_a_fitting_white_is_not_doubted(bench, light):
    scene = bench.plan().simulated[0].scene
    assert exposure_doubts(scene, light()) == []


@pytest.mark.parametrize(("factor", "verb"), [(10.0, "raise"), (1e-3, "lower")])
def test_a_scene_with_a_wrong_white_is_told_a_right_one(bench, light, factor, verb):
    scene = bench.plan().simulated[0].scene
    (sentence,) = exposure_doubts(scene, light(factor))
    assert f"{verb} white_cd_m2 of the scene from 50 to about" in sentence
    white_cd_m2 = float(sentence.split("about ")[1].split()[0])
    assert exposure_doubts(replace(scene, white_cd_m2=white_cd_m2), light(factor)) == []
    assert exposure_doubts(replace(scene, white_cd_m2=None), light(factor)) == []


def test_cases_of_a_plan_with_the_same_doubt_share_a_line(bench, light):
    light(10.0)
    dim, full = sorted(doubts_of_plan(bench.plan()))
    assert full.startswith("full: ")
    assert "white_cd_m2 of the scene" in full
    assert dim.startswith("dim: ")
    assert "lower exposure_gain of the camera from 1 to about" in dim  # white is that of the scene's own lighting


@pytest.mark.parametrize("stops", [1, 3])
def test_a_gain_in_decibels_is_doubted_as_an_exposure_that_is_as_bright(bench, light, stops):
    light(1.0)
    decibels = 20 * np.log10(2) * stops

    def doubts(camera):
        return doubts_of_plan(bench.plan(("seed: 1", f"seed: 1\ncameras: {{a: {camera}}}"), ("full: {}, ", "")))

    by_gain = doubts(f"{{gain_db: {decibels:.9f}}}")
    assert by_gain == doubts(f"{{exposure_compensation_ev: {stops}}}")
    assert bool(by_gain) == (stops == 3)


def test_auto_exposure_scenarios_and_unknown_light_are_not_doubted(bench, light, monkeypatch):
    light(10.0)
    plan = bench.plan(("seed: 1", "seed: 1\ncameras: {auto: {auto_exposure: {}}}"))
    assert doubts_of_plan(plan) == []
    cases = tuple(replace(case, scenario="low_light") for case in bench.plan().simulated)
    assert doubts_of_plan(replace(bench.plan(), simulated=cases)) == []
    monkeypatch.setattr(exposure_doubt, "_light", lambda _: None)
    assert doubts_of_plan(bench.plan()) == []


def test_a_run_is_doubted_by_its_pictures(bench, light, monkeypatch):
    plan = bench.plan(("seed: 1", "seed: 1\ncameras: {glaring: {exposure_gain: 40}}"), ("full: {}, ", ""))
    folder = bench.run_plan(plan, root=bench.folder / "glaring", cache="cache")
    light(1.0)
    (sentence,) = doubts_of_run(plan, folder)
    assert "98% of the pixels are saturated" in sentence
    assert "lower exposure_gain of the camera from 40 to about" in sentence
    assert sentence.endswith("(in its first images)")
    monkeypatch.setattr(exposure_doubt, "_light", lambda _: None)
    (blind,) = doubts_of_run(plan, folder)
    assert "change the camera's exposure_gain, or use auto_exposure" in blind


def test_a_run_that_is_well_exposed_is_not_doubted(bench, first, light):
    light(1.0)
    assert doubts_of_run(bench.plan(), first) == []
