"""Reading a sequence's truth of every pixel, a stereo pair at a time; never for an estimator."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from vobench.errors import SequenceError
from vobench.geometry.rig import SIDES
from vobench.sensor.truth import CHANNELS, TruthFrame, TruthNames, check_channels
from vobench.sequence import messages as ros
from vobench.sequence.bag import Bag
from vobench.sequence.salvage import SALVAGE_NOTE
from vobench.sequence.truth_image import names_from_json, truth_topic, truth_values
from vobench.sequence.writer import NAMES_ATTACHMENT, TRUTH_FILE


@dataclass(frozen=True, slots=True)
class StereoTruth:
    """What is true of the pictures of one instant; no `right` where there is one camera."""

    index: int
    t_ns: int
    left: TruthFrame
    right: TruthFrame | None


def truth_channels(folder: Path) -> tuple[str, ...]:
    """The channels that were recorded with a sequence; none for most. Raises SequenceError for a torn file."""
    return _channels(Bag.open(Path(folder) / TRUTH_FILE))


def _channels(bag: Bag) -> tuple[str, ...]:
    return tuple(name for name in CHANNELS if bag.has(truth_topic("left", name)))


def read_truth_names(folder: Path) -> TruthNames:
    """What the ids of `instance` and `material` mean. Raises SequenceError where no channels were recorded."""
    return names_from_json(Bag.open(Path(folder) / TRUTH_FILE).attachment(NAMES_ATTACHMENT))


def read_truth_frames(folder: Path, channels: Iterable[str] | None = None) -> Iterator[StereoTruth]:
    """Some channels (None: all there are) of each instant's pictures; only the current ones are held in memory.

    Raises SequenceError where one was not recorded, or a picture lacks one; in a salvaged file that one is left out.
    """
    bag = Bag.open(Path(folder) / TRUTH_FILE)
    there = _channels(bag)
    wanted = there if channels is None else check_channels(channels)
    for name in wanted:
        if name not in there:
            recorded = ", ".join(there) or "none"
            raise SequenceError(f"no truth channel '{name}' was recorded, only {recorded}: {bag.path}")
    return _frames(bag, wanted)


def _frames(bag: Bag, channels: tuple[str, ...]) -> Iterator[StereoTruth]:
    present = [side for side in SIDES if any(bag.has(truth_topic(side, name)) for name in channels)]
    places = {truth_topic(side, name): (side, name) for side in present for name in channels}
    pictures = bag.messages(places)
    for index, (t_ns, group) in enumerate(groupby(pictures, key=lambda found: ros.stamp_ns(found[1]))):
        found: dict[str, dict[str, Any]] = {side: {} for side in present}
        for topic, message in group:
            side, name = places[topic]
            found[side][name] = truth_values(name, message)
        if any(len(values) != len(channels) for values in found.values()):
            if bag.note(SALVAGE_NOTE):
                continue
            raise SequenceError(f"truth frame {index} at {t_ns} ns lacks channels in {bag.path}")
        right = TruthFrame(**found["right"]) if "right" in found else None
        yield StereoTruth(index, t_ns, TruthFrame(**found["left"]), right)
