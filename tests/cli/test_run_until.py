"""`vobench run --until decided`, with pictures that cost nothing and an estimator that does not look at them, twice."""

import json

import pytest


@pytest.mark.slow
def test_a_run_until_decided_ends_with_all_units_in_one_run_and_what_it_cost(vobench, drawn):
    said = vobench("run", "drawn", "--until", "decided", "--ratio", "10", "--budget", "20min")
    assert said.code == 0, said.err
    assert "Each pair is decided or alike after 8 places in 2 draws" in said.out
    assert "4 places: 0 of 1 pair settled" in said.err
    assert "8 places: 1 of 1 pair settled" in said.err
    latest = drawn / "latest"
    assert json.loads((latest / "until.json").read_text()) == {"ratio": 10.0, "level": 0.02}
    assert len(list((latest / "cases").iterdir())) == 8

    again = vobench("report", drawn)
    assert "Units were drawn until each pair was decided or alike within 10 ×" in again.out


@pytest.mark.slow
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
