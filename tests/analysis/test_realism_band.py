"""The bands of statistics in real recordings, by domain."""

from pathlib import Path

import pytest

from vobench.analysis.realism import STATISTICS
from vobench.analysis.realism_band import CAR_BANDS, DOMAINS, domain_of
from vobench.errors import UnknownNameError


def test_each_statistic_has_a_band_of_cars() -> None:
    assert list(CAR_BANDS) == [statistic.name for statistic in STATISTICS]


def test_the_ends_of_a_band_are_in_it() -> None:
    for band in CAR_BANDS.values():
        assert [band.verdict(value) for value in (band.low, band.high)] == ["in", "in"]
        assert band.verdict(band.low - 0.01) == "low"
        assert band.verdict(band.high + 0.01) == "high"


def test_values_at_the_rim_of_a_band_are_in_it_as_they_are_printed() -> None:
    unevenness = CAR_BANDS["corner_unevenness"]
    assert [unevenness.verdict(value) for value in (0.884, 0.346, 0.886, 0.344)] == ["in", "in", "high", "low"]


def test_the_bands_are_those_of_the_documentation() -> None:
    text = (Path(__file__).parents[2] / "docs" / "realism.md").read_text()
    for statistic in STATISTICS:
        band = CAR_BANDS[statistic.name]
        assert f"\n| {statistic.title} | {band.low:g} … {band.high:g} |" in text, statistic.name


@pytest.mark.parametrize("domain", DOMAINS.values(), ids=list(DOMAINS))
def test_a_domain_says_which_recordings_were_measured_and_few_make_no_band(domain) -> None:
    sentence = domain.sentence()
    assert all(recording in sentence for recording in domain.recordings)
    assert bool(domain.bands) == (len(domain.recordings) >= 3)
    assert sentence.startswith("The bands are" if domain.bands else "There are no bands")


def test_an_unknown_domain_is_refused() -> None:
    with pytest.raises(UnknownNameError, match=r"no domain named 'cat'\. Did you mean 'car'\?"):
        domain_of("cat")
