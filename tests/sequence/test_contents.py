"""What is in a file is the same by its summary and by going through it."""

from pathlib import Path

import pytest

from vobench.errors import SequenceError
from vobench.sequence.contents import TopicFacts, bag_facts, topic_facts


@pytest.mark.parametrize("name", ["sensors.mcap", "truth.mcap"])
def test_the_summary_and_the_messages_say_the_same(folder: Path, name: str) -> None:
    facts = topic_facts(folder / name)
    assert facts == bag_facts(folder / name)
    assert facts


def test_a_rate_takes_two_instants() -> None:
    assert TopicFacts("/a", "x", 3, 0, 1_000_000_000).rate_hz == 2.0
    assert TopicFacts("/a", "x", 1, 5, 5).rate_hz is None
    assert TopicFacts("/a", "x", 0, None, None).rate_hz is None


def test_a_torn_file_is_a_sentence(folder: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes((folder / "sensors.mcap").read_bytes()[:-100])
    for facts in (topic_facts, bag_facts):
        with pytest.raises(SequenceError, match=r"torn\.mcap"):
            facts(torn)
