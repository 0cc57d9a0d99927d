"""The ranges of the statistics of images in real recordings, by domain.

They were measured by `vobench realism`, on parts of these recordings. A domain with few recordings has no ranges.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from vobench.errors import require_known

CAR = "car"
PRINTED_DIGITS = 2
OFFSET_BAND_PX = (0.06, 1.01)  # the magnitudes of the offsets of disparities in the same recordings


@dataclass(frozen=True, slots=True)
class StatisticBand:
    """The least and the largest value of a statistic."""

    low: float
    high: float

    def verdict(self, value: float) -> str:
        """Whether a value, as it is printed, is "in" the band, too "low" or too "high"."""
        printed = round(value, PRINTED_DIGITS)
        if printed < round(self.low, PRINTED_DIGITS):
            return "low"
        return "high" if printed > round(self.high, PRINTED_DIGITS) else "in"


@dataclass(frozen=True, slots=True)
class Domain:
    """What carries the camera: the recordings that were measured, and the bands of statistics by name."""

    name: str
    recordings: tuple[str, ...]
    bands: Mapping[str, StatisticBand]

    def sentence(self) -> str:
        """On what the bands rest, or why there are none."""
        named = ", ".join(self.recordings) or "none"
        if self.bands:
            return f"The bands are those of {len(self.recordings)} recordings of a {self.name}: {named}."
        return f"There are no bands for the domain {self.name}, since too few recordings were measured: {named}."


# KITTI 00, 01 and 06 have gradients, kurtoses and slopes that are inside of these bands; the pair of UTBM's recording
# has no known extrinsics, so its row errors are not counted.
CAR_BANDS = {
    "row_error_px": StatisticBand(0.15, 0.52),
    "gradient_p99": StatisticBand(31, 75),
    "gradient_kurtosis": StatisticBand(15, 35),
    "spectrum_slope": StatisticBand(-3.45, -2.5),
    "corner_unevenness": StatisticBand(0.35, 0.88),
    "tracks_home": StatisticBand(50, 79),
    "track_life": StatisticBand(2.8, 6.5),
    "grey_sd": StatisticBand(50, 77),
    "burnt": StatisticBand(0.7, 10),
}
DOMAINS = {
    domain.name: domain
    for domain in (
        Domain(CAR, ("KITTI 00", "KITTI 01", "KITTI 06", "UTBM (Bumblebee2)"), CAR_BANDS),
        Domain("drone", ("EuRoC V1_01, standing",), {}),
        Domain("hand", (), {}),
        Domain("robot", (), {}),
    )
}


def domain_of(name: str) -> Domain:
    """The domain with a name. Raises UnknownNameError."""
    return DOMAINS[require_known("domain", name, DOMAINS)]
