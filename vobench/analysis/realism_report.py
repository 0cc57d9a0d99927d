"""Reports how realistic the images of a recording are, compared with real images or another recording."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.analysis.realism import STATISTICS, Realism, Statistic, measure, pair_sentences, residual, shots_of
from vobench.analysis.realism_band import CAR, DOMAINS, Domain, StatisticBand, domain_of
from vobench.analysis.stereo_fit import StereoFit, Uncertain
from vobench.dataset.recording import ReadOptions, Recording
from vobench.runner.data_frame import data_frame
from vobench.runner.recording import DEFAULT_OPTIONS, read_recording

if TYPE_CHECKING:
    from vobench.runner.data_frame import DataFrame

SIMILAR_SHARE = 0.25  # relative difference below which values of two recordings count as equal


@dataclass(frozen=True, slots=True)
class RealismReport:
    """The realism of a recording, and that of another recording if they are compared.

    `path` and `against_path` are the paths of the recordings. The bands of `domain` are those of real recordings.
    """

    path: Path
    found: Realism
    against_path: Path | None = None
    against: Realism | None = None
    domain: Domain = DOMAINS[CAR]

    def rows(self) -> list[dict[str, Any]]:
        """One row per statistic: its value, its band or the other recording's value, and what would change it.

        `is` is "in", "low" or "high" relative to the band, and empty without one; the band of another recording is its
        value ± 25 %.
        """
        values = self.found.values
        measured = [statistic for statistic in STATISTICS if statistic.name in values]
        return [self._row(statistic, values[statistic.name]) for statistic in measured]

    def _row(self, statistic: Statistic, value: float) -> dict[str, Any]:
        row: dict[str, Any] = {"statistic": statistic.title, "name": statistic.name}
        row |= {"unit": statistic.unit, "value": value}
        band = self.domain.bands.get(statistic.name)
        if self.against is None:
            row |= {"low": None, "high": None} if band is None else {"low": band.low, "high": band.high}
        else:
            other = self.against.values.get(statistic.name)
            row |= {"against": other}
            if other is not None:
                half_width = SIMILAR_SHARE * abs(other)
                band = StatisticBand(other - half_width, other + half_width)
        if band is None:
            return {**row, "is": "", "knob": ""}
        verdict = band.verdict(value)
        return {**row, "is": verdict, "knob": statistic.knob(verdict)}

    @property
    def inside(self) -> int:
        """The number of statistics that are in their bands."""
        return [row["is"] for row in self.rows()].count("in")

    def sentences(self) -> list[str]:
        """On what the bands rest, and the errors of the stereo pair and their most likely causes."""
        of_bands = [] if self.against else [self.domain.sentence()]
        return [*of_bands, *pair_sentences(self.found)]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, as `vobench realism --json` prints them."""
        pair = self.found.pair
        return {
            "pictures": self.found.pictures,
            "domain": self.domain.name,
            "inside": self.inside,
            "statistics": self.rows(),
            "also": dict(self.found.also),
            "pair": None if pair is None else _pair_facts(pair),
            "says": self.sentences(),
        }

    def to_frame(self) -> "DataFrame":
        """A pandas table of `rows`."""
        return data_frame(self.rows())


def measure_realism(
    path: Path,
    *,
    against: Path | None = None,
    domain: str = CAR,
    form: str | None = None,
    options: ReadOptions = DEFAULT_OPTIONS,
) -> RealismReport:
    """Measure how realistic the images of a recording are.

    Args:
        path: a sequence, the folder of a run's case, a dataset's folder, or a bag.
        against: another recording that replaces the bands of real ones.
        domain: what carries the camera: "car", "drone", "hand" or "robot". Only "car" has bands.
        form: the form of the recording at `path`, if its content does not determine it.
        options: what the recording at `path` does not state itself: calibration, ground truth, rate, topics.

    Raises:
        InputError: a recording cannot be read, or has fewer than two pictures.
        UnknownNameError: there is no such domain.
    """
    bands = domain_of(domain)
    recording = read_recording(path, form=form, options=options)
    other = None if against is None else read_recording(against)
    found = realism_of(recording)
    found_in_other = None if other is None else realism_of(other)
    return RealismReport(path, found, against, found_in_other, bands)


def realism_of(recording: Recording) -> Realism:
    """Measure the statistics of a recording's images."""
    return measure(shots_of(recording), recording.rig)


def _pair_facts(pair: StereoFit) -> dict[str, Any]:
    """The fit of a stereo pair as plain JSON values."""
    estimates: dict[str, Uncertain | None] = {
        "yaw_deg": pair.yaw_deg,
        "roll_deg": pair.roll_deg,
        "pitch_deg": pair.pitch_deg,
        "offset_px": pair.offset_px,
        "xy_px": pair.xy_px,
    }
    facts: dict[str, Any] = {}
    for name, estimate in estimates.items():
        facts[name] = None if estimate is None else {"value": estimate.value, "sigma": estimate.sigma}
    return {
        **facts,
        "row_noise_px": pair.row_noise_px,
        "gain": pair.gain,
        "disparity_px": pair.disparity_px,
        "yaw_from": pair.yaw_from,
        "calibration_error": residual(pair),
    }
