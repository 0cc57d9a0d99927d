"""A recording's pictures beside the bands of real ones, and beside another recording."""

from pathlib import Path

import pytest

from vobench.analysis.realism import STATISTICS, Realism
from vobench.analysis.realism_band import CAR_BANDS, domain_of
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
        band = CAR_BANDS[row["name"]]
        assert (row["low"], row["high"]) == (band.low, band.high)
        assert row["is"] == band.verdict(row["value"])
        assert row["knob"] == statistic.knob(row["is"])
        assert bool(row["knob"]) == (row["is"] != "in")
    assert report.inside == [row["is"] for row in report.rows()].count("in")


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


def realism(**values: float) -> Realism:
    return Realism(values, {}, {}, None, 14)


@pytest.mark.parametrize(
    ("other", "verdict"), [(50.0, "in"), (41.0, "in"), (39.0, "high"), (66.0, "in"), (68.0, "low")]
)
def test_values_of_two_recordings_are_alike_within_a_quarter_of_the_others(other: float, verdict: str) -> None:
    report = RealismReport(Path("a"), realism(grey_sd=50.0), Path("b"), realism(grey_sd=other))
    (row,) = report.rows()
    assert row == {
        "statistic": "standard deviation of grey",
        "name": "grey_sd",
        "unit": "DN",
        "value": 50.0,
        "against": other,
        "is": verdict,
        "knob": row["knob"],
    }
    assert bool(row["knob"]) == (verdict != "in")


def test_negative_values_are_compared_by_their_size() -> None:
    report = RealismReport(Path("a"), realism(spectrum_slope=-2.5), Path("b"), realism(spectrum_slope=-3.0))
    assert report.rows()[0]["is"] == "in"


def test_a_statistic_that_the_other_recording_lacks_is_judged_by_its_range() -> None:
    report = RealismReport(Path("a"), realism(row_error_px=0.3, burnt=50.0), Path("b"), realism(burnt=50.0))
    rows = {row["name"]: row for row in report.rows()}
    assert (rows["row_error_px"]["against"], rows["row_error_px"]["is"]) == (None, "in")
    assert rows["burnt"]["is"] == "in"
    assert {row["name"]: row["is"] for row in RealismReport(Path("a"), report.found).rows()}["burnt"] == "high"


def test_facts_of_a_report_without_a_pair() -> None:
    facts = RealismReport(Path("a"), realism(burnt=5.0)).as_dict()
    assert (facts["pair"], facts["inside"], facts["pictures"]) == (None, 1, 14)
    assert facts["says"] == RealismReport(Path("a"), realism(burnt=5.0)).sentences()


def test_inside_counts_the_statistics_in_their_bands() -> None:
    middle = {name: (band.low + band.high) / 2 for name, band in CAR_BANDS.items()}
    assert RealismReport(Path("a"), realism(**middle)).inside == 9
    assert RealismReport(Path("a"), realism(**{**middle, "burnt": 50.0})).inside == 8
    del middle["row_error_px"]
    assert RealismReport(Path("a"), realism(**middle)).inside == 8


def test_a_domain_without_bands_has_values_and_no_verdicts() -> None:
    report = RealismReport(Path("a"), realism(burnt=50.0), domain=domain_of("hand"))
    (row,) = report.rows()
    assert (row["value"], row["low"], row["high"], row["is"], row["knob"]) == (50.0, None, None, "", "")
    assert report.inside == 0
    assert report.as_dict()["domain"] == "hand"
    assert report.sentences()[0].startswith("There are no bands for the domain hand")


def test_what_is_compared_with_another_recording_is_not_said_to_rest_on_bands() -> None:
    report = RealismReport(Path("a"), realism(burnt=50.0), Path("b"), realism(burnt=50.0), domain_of("hand"))
    assert not any("bands" in sentence for sentence in report.sentences())
    assert report.rows()[0]["is"] == "in"
