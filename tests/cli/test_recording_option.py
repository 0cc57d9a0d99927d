"""How a recording is read, by the options of the command line."""

from pathlib import Path

import pytest

from vobench.cli.recording_option import RecordingOptions, parse_topics
from vobench.dataset.recording import Topics
from vobench.errors import UnknownNameError


@pytest.mark.parametrize(
    ("entries", "topics"),
    [
        (None, Topics()),
        ([], Topics()),
        (["left=/cam0"], Topics(left="/cam0")),
        (["left=/cam0", "imu=/imu=1"], Topics(left="/cam0", imu="/imu=1")),
        (["left=/cam0", "left=/cam1"], Topics(left="/cam1")),
    ],
)
def test_topics_are_given_by_their_roles(entries, topics):
    assert parse_topics(entries) == topics


@pytest.mark.parametrize("entry", ["left", "left=", "=/cam0", "middle=/cam0"])
def test_a_topic_without_a_known_role_or_a_name_is_refused_with_an_example(entry):
    with pytest.raises(UnknownNameError, match=r"^--topic .*: no topic named .*; as in --topic left=/cam0$"):
        parse_topics([entry])


def test_every_option_reaches_the_reader():
    options = RecordingOptions(calibration=Path("a"), truth=Path("b"), rate=5.0, topic=["truth=/gt"])
    read = options.read_options(Path("c"))
    assert (read.calibration, read.imu, read.truth, read.rate_hz) == (Path("a"), Path("c"), Path("b"), 5.0)
    assert read.topics == Topics(truth="/gt")
    assert RecordingOptions().read_options().imu is None
