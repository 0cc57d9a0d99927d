"""`vobench run --until decided`, with pictures that cost nothing and an estimator that does not look at them, twice."""

import json

import pytest

GENERATOR = '''"""Closets by seed."""

import trimesh

from vobench.plugin import GeneratedPlace, Material, Thing

GREY = (0.5, 0.5, 0.5)


def generate(seed, lighting):
    """A plain floor with a wall whose distance depends on the seed, and a lamp that shines."""
    floor = trimesh.creation.box((6.0, 6.0, 0.1))
    floor.apply_translation((0.0, 0.0, -0.05))
    wall = trimesh.creation.box((0.1, 6.0, 2.0))
    wall.apply_translation((2.5 + 0.01 * (seed % 10), 0.0, 1.0))
    lamp = trimesh.creation.box((0.5, 0.5, 0.02))
    lamp.apply_translation((0.0, 0.0, 2.0))
    materials = {"grey": Material(colour=GREY), "lamp": Material(colour=GREY, emission_cd_m2=(500.0, 500.0, 500.0))}
    things = [Thing("floor", floor, "grey"), Thing("wall", wall, "grey"), Thing("lamp", lamp, "lamp")]
    return GeneratedPlace(things, materials)
'''
SUITE = """name: drawn
scenes: [{name: cells, seeds: 4}]
rigs: {down: {pitch_deg: 90}}
trajectories: {tour: {kind: wander, body: pioneer, length_m: 0.5, rate_hz: 4, seed: 1}}
estimators: [wheel_odometry, {name: wheel_odometry, label: twin}]
"""


@pytest.fixture
def drawn(here):
    """A suite with places by seed."""
    folder = here / "scenes" / "cells"
    folder.mkdir()
    (folder / "scene.yaml").write_text("name: cells\nwhite_cd_m2: 50\ngenerator: generator.py\n")
    (folder / "generator.py").write_text(GENERATOR)
    (here / "suites" / "drawn.yaml").write_text(SUITE)
    return here / "runs" / "drawn"


@pytest.mark.slow
def test_a_run_until_decided_ends_with_all_units_in_one_run_and_what_it_cost(vobench, drawn):
    said = vobench("run", "drawn", "--until", "decided", "--ratio", "2", "--budget", "20min")
    assert said.code == 0, said.err
    assert "Each pair is decided or alike after 8 places in 2 draws" in said.out
    assert "4 places: 0 of 1 pair settled" in said.err
    assert "8 places: 1 of 1 pair settled" in said.err
    latest = drawn / "latest"
    assert json.loads((latest / "until.json").read_text()) == {"ratio": 2.0, "level": 0.02}
    assert len(list((latest / "cases").iterdir())) == 8

    again = vobench("report", drawn)
    assert "Units were drawn until each pair was decided or alike within 2 ×" in again.out


def test_a_run_out_of_budget_says_how_to_go_on(vobench, drawn):
    said = vobench("run", "drawn", "--until", "decided", "--budget", "0.01s")
    assert said.code == 0, said.err
    assert "1 pair is open after 4 places in 1 draw" in said.out
    assert "To resume, run the same command again" in said.out


def test_a_suite_without_places_to_draw_and_a_budget_without_an_end_are_refused(vobench, drawn):
    said = vobench("run", "tiny", "--until", "decided")
    assert (said.code, "fresh units require places that can be drawn" in said.err) == (1, True)
    said = vobench("run", "drawn", "--budget", "3min")
    assert (said.code, "--budget requires --until decided" in said.err) == (1, True)
