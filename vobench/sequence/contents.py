"""What is in an MCAP file by its summary, or in any bag by going through it: topics, types, counts and rates."""

from dataclasses import dataclass
from pathlib import Path

from vobench.sequence.bag import Bag
from vobench.sequence.messages import Topic
from vobench.sequence.pose_topic import opened


@dataclass(frozen=True, slots=True)
class TopicFacts:
    """A topic, and when its first and last message were logged; stamps are None where it has none."""

    name: str
    type_name: str
    count: int
    start_ns: int | None
    end_ns: int | None

    @property
    def rate_hz(self) -> float | None:
        """Messages a second on average, None for fewer than two instants."""
        if self.start_ns is None or self.end_ns is None or self.end_ns == self.start_ns:
            return None
        return (self.count - 1) / (self.end_ns - self.start_ns) * 1e9


def topic_facts(path: Path) -> tuple[TopicFacts, ...]:
    """All topics of a file, by name. Raises SequenceError where it is no whole MCAP file."""
    bag = Bag.open(path)
    index = bag.index
    named = {
        channel.topic: index.schemas[channel.schema_id].name if channel.schema_id else ""
        for channel in index.channels.values()
    }
    return tuple(_facts(bag, Topic(name, type_name)) for name, type_name in sorted(named.items()))


def bag_facts(path: Path) -> tuple[TopicFacts, ...]:
    """The same of a bag of any make, gone through once; no message is decoded. Raises SequenceError."""
    found: dict[tuple[str, str], list[int]] = {}
    with opened(path) as reader:
        for connection, t_ns, _ in reader.messages():
            facts = found.setdefault((connection.topic, connection.msgtype), [0, t_ns, t_ns])
            facts[:] = facts[0] + 1, min(facts[1], t_ns), max(facts[2], t_ns)
    return tuple(TopicFacts(*names, *facts) for names, facts in sorted(found.items()))


def _facts(bag: Bag, topic: Topic) -> TopicFacts:
    stamps = bag.stamps(topic)
    start_ns, end_ns = (int(stamps.min()), int(stamps.max())) if len(stamps) else (None, None)
    return TopicFacts(topic.name, topic.type_name, len(stamps), start_ns, end_ns)
