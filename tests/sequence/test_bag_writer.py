"""A bag is written in order of time, whole or not at all."""

import pytest

from vobench.errors import SequenceError
from vobench.sequence.bag import Bag
from vobench.sequence.bag_writer import CHUNK_BYTES, CHUNK_NS, BagWriter, note_checksum, replacing
from vobench.sequence.topic import EXPOSURE, IMU, Topic

ONE, TWO = Topic("/one", EXPOSURE.type_name), Topic("/two", EXPOSURE.type_name)


def chunks(path, messages, *, encoded=True):
    """How many messages each chunk has of (topic, stamp, bytes)."""
    with BagWriter(path, (ONE, TWO), encoded=encoded) as bag:
        for topic, t_ns, size in messages:
            bag.write(topic, t_ns, bytes(size))
    return [sum(counts.values()) for counts in Bag.open(path).counts]


def test_a_file_gets_its_name_when_it_is_whole(tmp_path):
    path = tmp_path / "a"
    with replacing(path) as stream:
        stream.write(b"x")
        assert not path.exists()
    assert path.read_bytes() == b"x"
    with pytest.raises(ZeroDivisionError), replacing(path) as stream:
        stream.write(bytes(1 // len(stream.name[:0])))
    assert path.read_bytes() == b"x"
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


def test_a_chunk_ends_after_a_second(tmp_path):
    assert chunks(tmp_path / "a", [(ONE, t, 1) for t in (0, CHUNK_NS - 1, CHUNK_NS, CHUNK_NS + 1)]) == [2, 2]


def test_a_full_chunk_ends_before_the_next_stamp_and_of_raw_pictures_before_the_next_message(tmp_path):
    messages = [(ONE, 1, CHUNK_BYTES), (TWO, 1, 1), (ONE, 2, 1)]
    assert chunks(tmp_path / "a", messages) == [2, 1]
    assert chunks(tmp_path / "b", messages, encoded=False) == [1, 2]
    assert chunks(tmp_path / "c", [(ONE, 1, CHUNK_BYTES - 1), (TWO, 2, 1), (ONE, 3, 1)]) == [2, 1]


@pytest.mark.parametrize("topic", [ONE, TWO])
def test_stamps_rise_per_topic_and_never_fall(tmp_path, topic):
    with BagWriter(tmp_path / "a", (ONE, TWO), encoded=True) as bag:
        bag.write(ONE, 5, b"")
        bag.write(TWO, 5, b"")
        for t_ns in (4, 5):
            with pytest.raises(
                SequenceError, match=rf"^{topic.name}: the stamp {t_ns} ns does not come after 5 ns in "
            ):
                bag.write(topic, t_ns, b"")
        bag.write(topic, 6, b"")
        with pytest.raises(SequenceError, match="the rig of this recording has no sensor for /imu: "):
            bag.write(IMU, 7, b"")


def test_the_first_stamp_may_be_0(tmp_path):
    assert chunks(tmp_path / "a", [(ONE, 0, 1), (TWO, 0, 1)]) == [2]


def test_notes_and_attachments_come_back_whatever_the_order_of_their_entries(tmp_path):
    path = tmp_path / "a"
    with BagWriter(path, (ONE,), encoded=True) as bag:
        bag.attach("first.json", "application/json", b"1")
        bag.attach("case.json", "application/json", b"{}")
        bag.note("n", {"b": "2", "a": "1"})
        bag.note("m", {})
    bag = Bag.open(path)
    assert bag.note("n") == {"a": "1", "b": "2"}
    assert bag.note("m") == {}
    assert bag.note("no") == {}
    assert (bag.attachment("case.json"), bag.attachment("first.json")) == (b"{}", b"1")
    assert bag.has_attachment("case.json")
    assert not bag.has_attachment("other")
    assert bag.summary.attachment_indexes[0].create_time == bag.summary.attachment_indexes[0].log_time == 0
    assert note_checksum({"b": "2", "a": "1"}) == note_checksum({"a": "1", "b": "2"}) != note_checksum({"a": "1"})
