"""What a person may say of a recording that its own files don't."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Topics:
    """Which topics of a bag are meant; None where its own names say so."""

    left: str | None = None
    right: str | None = None
    left_info: str | None = None
    right_info: str | None = None
    truth: str | None = None
    imu: str | None = None


@dataclass(frozen=True, slots=True)
class Options:
    """Kalibr's camchain.yaml and imu.yaml, a trajectory file with the truth, and topics of a bag.

    `rate_hz` is for pictures without stamps. Pictures of both eyes are one pair up to `within_ns` apart.
    """

    calibration: Path | None = None
    imu: Path | None = None
    truth: Path | None = None
    rate_hz: float | None = None
    within_ns: int = 1_000_000
    topics: Topics = Topics()
