"""A recording's pictures beside the bands of real ones, and beside another recording."""

from pathlib import Path

import pytest

from vobench.analysis.realism import STATISTICS
from vobench.analysis.realism_report import RealismReport, measure_realism
from vobench.errors import InputError


@pytest.fixture(scope="module")
def report(recorded_case: Path) -> RealismReport:
    return measure_realism(recorded_case)


def test_every_statistic_has_its_band_its_verdict_and_its_knob(report: RealismReport) -> None:
    known = {statistic.name: statistic for statistic in STATISTICS}
    assert len(report.rows()) == len(report.found.values) > 5
    for row in report.rows():
        statistic = known[row["name"]]
        assert (row["low"], row["high"]) == (statistic.low, statistic.high)
        assert row["is"] == statistic.verdict(row["value"])
        assert bool(row["knob"]) == (row["is"] != "in")
    assert report.found.inside == [row["is"] for row in report.rows()].count("in")


def test_the_roll_of_the_right_eye_is_found_and_said(report: RealismReport) -> None:
    facts = report.as_dict()
    assert facts["pair"]["roll_deg"]["value"] == pytest.approx(0.5, abs=0.1)
    assert "right_roll_deg" in facts["pair"]["calibration_error"]
    assert any("roll" in sentence for sentence in facts["says"])


def test_beside_itself_every_statistic_of_a_recording_is_in(recorded_case: Path) -> None:
    report = measure_realism(recorded_case, against=recorded_case)
    rows = report.rows()
    assert {row["is"] for row in rows} == {"in"}
    assert all(row["against"] == row["value"] and "low" not in row for row in rows)


def test_the_table_has_the_rows(report: RealismReport) -> None:
    assert report.to_frame().to_dict("records") == report.rows()


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="an empty folder"):
        measure_realism(tmp_path)
