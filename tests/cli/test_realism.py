"""vobench realism measures a run's case and says what is off."""

import pytest


@pytest.mark.slow
def test_a_case_is_measured_beside_the_bands_and_beside_another(vobench, ran, here):
    cases = [*(ran / "latest" / "cases").iterdir()]
    said = vobench("realism", cases[0], "--plot", "plot.png", "--json")
    assert said.code == 0
    facts = said.json
    assert {row["is"] for row in facts["statistics"]} <= {"in", "low", "high"}
    assert facts["says"]
    assert (here / "plot.png").stat().st_size > 10_000
    beside = vobench("realism", cases[0], "--against", cases[0], "--json").json
    assert {row["is"] for row in beside["statistics"]} == {"in"}
    assert "changed by" in vobench("realism", cases[0]).out
    by_hand = vobench("realism", cases[0], "--domain", "hand").out
    assert "statistics in their bands" not in by_hand
    assert "no bands for the domain hand" in by_hand


def test_a_plot_of_another_kind_is_refused_in_one_line(vobench, ran):
    case = next((ran / "latest" / "cases").iterdir())
    said = vobench("realism", case, "--plot", "plot.gif")
    assert said.code == 1
    assert "the name of a plot should end in .svg, .png, .pdf" in said.err
