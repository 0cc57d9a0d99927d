"""One MCAP file in ROS 2 form: written in order of time and whole or not at all, read lazily."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mcap.reader import McapReader, make_reader
from mcap.writer import Writer

from vobench.errors import SequenceError
from vobench.sequence.messages import TYPES, Topic

PROFILE, SCHEMA_ENCODING, MESSAGE_ENCODING = "ros2", "ros2msg", "cdr"

# A late listener still gets the last message; rosbag2 reads this to replay /tf_static as ROS publishes it.
LATCHED_QOS = """\
- history: keep_last
  depth: 1
  reliability: reliable
  durability: transient_local
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: automatic
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""


class BagWriter:
    """Writes one bag under a temporary name and gives it its own when closed without an error."""

    def __init__(self, path: Path, topics: Sequence[Topic]) -> None:
        self.path = path
        self._part = path.with_name(path.name + ".part")
        self._stream = self._part.open("wb")
        self._mcap = Writer(self._stream)
        self._mcap.start(profile=PROFILE, library="vobench")
        schemas = {name: self._register_schema(name) for name in dict.fromkeys(t.type_name for t in topics)}
        self._channels = {topic: self._register_channel(topic, schemas[topic.type_name]) for topic in topics}
        self._last_ns = dict.fromkeys(topics, -1)
        self._end_ns = 0

    def _register_schema(self, type_name: str) -> int:
        definition = TYPES.generate_msgdef(type_name, ros_version=2)[0]
        return int(self._mcap.register_schema(type_name, SCHEMA_ENCODING, definition.encode()))

    def _register_channel(self, topic: Topic, schema: int) -> int:
        metadata = {
            "offered_qos_profiles": LATCHED_QOS if topic.latched else "",
            "topic_type_hash": TYPES.hash_rihs01(topic.type_name),
        }
        return int(self._mcap.register_channel(topic.name, MESSAGE_ENCODING, schema, metadata))

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Attach a file; done first, it survives in a torn bag."""
        self._mcap.add_attachment(0, 0, name, media_type, data)

    def note(self, name: str, entries: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._mcap.add_metadata(name, dict(entries))

    def write(self, topic: Topic, t_ns: int, message: Any) -> None:
        """Add a message. Raises SequenceError unless stamps rise per topic and never fall per file."""
        t_ns = int(t_ns)
        if t_ns <= self._last_ns[topic] or t_ns < self._end_ns:
            last = max(self._last_ns[topic], self._end_ns)
            raise SequenceError(f"{topic.name}: the stamp {t_ns} ns does not come after {last} ns in {self.path}")
        self._last_ns[topic] = self._end_ns = t_ns
        data = bytes(TYPES.serialize_cdr(message, topic.type_name))
        self._mcap.add_message(self._channels[topic], log_time=t_ns, data=data, publish_time=t_ns)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._mcap.finish()  # type: ignore[no-untyped-call]
        self._stream.close()
        if kind is None:
            self._part.replace(self.path)
        else:
            self._part.unlink(missing_ok=True)


@contextmanager
def _parsing(path: Path) -> Iterator[None]:
    """Say of any failure inside that the file at `path` cannot be read.

    A torn or foreign file makes the parsers below raise errors of a dozen unrelated kinds.
    """
    try:
        yield
    except SequenceError:
        raise
    except FileNotFoundError:
        raise SequenceError(f"no recording at {path}") from None
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else "no reason given"
        raise SequenceError(f"not a whole MCAP recording ({type(error).__name__}: {reason}): {path}") from error


@contextmanager
def _opened(path: Path) -> Iterator[McapReader]:
    with path.open("rb") as stream:
        yield make_reader(stream, validate_crcs=True)


def check_topics(path: Path, topics: Sequence[Topic]) -> dict[Topic, int]:
    """How many messages each topic has. Raises SequenceError where one is missing or of another type."""
    found = _found(path)
    for topic in topics:
        type_name = found[topic.name][0] if topic.name in found else "missing"
        if type_name != topic.type_name:
            raise SequenceError(f"{topic.name} should be {topic.type_name} but is {type_name} in {path}")
    return {topic: found[topic.name][1] for topic in topics}


def held(path: Path, topics: Sequence[Topic]) -> tuple[Topic, ...]:
    """Those of some topics that a bag has."""
    found = _found(path)
    return tuple(topic for topic in topics if found.get(topic.name, ("", 0))[0] == topic.type_name)


def _found(path: Path) -> dict[str, tuple[str, int]]:
    """Type and number of messages of each topic, by name."""
    with _parsing(path), _opened(path) as reader:
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            raise SequenceError(f"the recording has no summary, so it was not finished: {path}")
        counts = summary.statistics.channel_message_counts
        return {c.topic: (summary.schemas[c.schema_id].name, counts.get(c.id, 0)) for c in summary.channels.values()}


def messages(path: Path, topics: Sequence[Topic]) -> Iterator[tuple[Topic, Any]]:
    """Messages of some topics in order of time, one chunk of the file in memory at a time."""
    raws = raw_messages(path, topics)
    for topic, data in raws:
        with _parsing(path):
            message = TYPES.deserialize_cdr(data, topic.type_name)
        yield topic, message


def raw_messages(path: Path, topics: Sequence[Topic]) -> Iterator[tuple[Topic, bytes]]:
    """The CDR bytes of `messages`."""
    by_name = {topic.name: topic for topic in topics}
    with _parsing(path), _opened(path) as reader:
        for _, channel, message in reader.iter_messages(topics=list(by_name)):
            yield by_name[channel.topic], message.data


def note(path: Path, name: str) -> dict[str, str]:
    """The metadata record of that name. Raises SequenceError where there is none."""
    with _parsing(path), _opened(path) as reader:
        for record in reader.iter_metadata():
            if record.name == name:
                return dict(record.metadata)
    raise SequenceError(f"no metadata record {name!r} in {path}")


def attachment(path: Path, name: str) -> bytes:
    """The attached file of that name. Raises SequenceError where there is none."""
    with _parsing(path), _opened(path) as reader:
        for record in reader.iter_attachments():
            if record.name == name:
                return bytes(record.data)
    raise SequenceError(f"no attachment {name!r} in {path}")
