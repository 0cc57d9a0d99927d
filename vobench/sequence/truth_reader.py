"""Reading a sequence's truth of every pixel, a stereo pair at a time; never for an estimator."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from vobench.errors import SequenceError
from vobench.geometry.rig import SIDES
from vobench.sensor.truth import CHANNELS, TruthFrame, TruthNames, check_channels
from vobench.sequence import bag
from vobench.sequence import messages as ros
from vobench.sequence.truth_image import names_from_json, truth_topic, truth_topics, truth_values
from vobench.sequence.writer import NAMES_ATTACHMENT, TRUTH_FILE


@dataclass(frozen=True, slots=True)
class StereoTruth:
    """What is true of the two pictures of one instant."""

    index: int
    t_ns: int
    left: TruthFrame
    right: TruthFrame


def truth_channels(folder: Path) -> tuple[str, ...]:
    """The channels that were recorded with a sequence; none for most. Raises SequenceError for a torn file."""
    held = set(bag.held(Path(folder) / TRUTH_FILE, truth_topics()))
    return tuple(name for name in CHANNELS if truth_topic("left", name) in held)


def read_truth_names(folder: Path) -> TruthNames:
    """What the ids of `instance` and `material` mean. Raises SequenceError where no channels were recorded."""
    return names_from_json(bag.attachment(Path(folder) / TRUTH_FILE, NAMES_ATTACHMENT))


def read_truth_frames(folder: Path, channels: Iterable[str] | None = None) -> Iterator[StereoTruth]:
    """Some channels (None: all there are) of each stereo pair; only the current one is held in memory.

    Raises SequenceError where one was not recorded, or a picture lacks one.
    """
    path, there = Path(folder) / TRUTH_FILE, truth_channels(folder)
    wanted = there if channels is None else check_channels(channels)
    for name in wanted:
        if name not in there:
            raise SequenceError(f"no truth channel '{name}' was recorded, only {', '.join(there) or 'none'}: {path}")
    return _frames(path, wanted)


def _frames(path: Path, channels: tuple[str, ...]) -> Iterator[StereoTruth]:
    places = {truth_topic(side, name): (side, name) for side in SIDES for name in channels}
    pictures = bag.messages(path, tuple(places))
    for index, (t_ns, group) in enumerate(groupby(pictures, key=lambda found: ros.stamp_ns(found[1]))):
        sides: dict[str, dict[str, Any]] = {side: {} for side in SIDES}
        for topic, message in group:
            side, name = places[topic]
            sides[side][name] = truth_values(name, message)
        if any(len(found) != len(channels) for found in sides.values()):
            raise SequenceError(f"truth frame {index} at {t_ns} ns lacks channels in {path}")
        yield StereoTruth(index, t_ns, TruthFrame(**sides["left"]), TruthFrame(**sides["right"]))
