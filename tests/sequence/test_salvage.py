"""What a killed writer or a bad disk leaves: never read as complete, and all that is whole in it comes back."""

import contextlib
import os
import signal
import subprocess
import sys
from io import BytesIO

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from vobench.errors import SequenceError
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.sensor.pixel_truth import TruthFrame
from vobench.sequence import (
    Sequence,
    SequenceWriter,
    payload_hash,
    read_case,
    read_provenance,
    read_truth,
    read_truth_frames,
    salvage,
    salvage_sequence,
)
from vobench.sequence.bag import Bag
from vobench.sequence.mcap_index import HEAD, MAGIC

KILLS = 20

# Forks a writer for each folder, for starting Python takes longer than writing. Half a second lies between frames, so
# that a chunk is a second old at the third. A writer says its number, then a dot for each frame that it has handed
# over, and goes on until it is killed.
RECORDER = """
import os, sys
from pathlib import Path
import numpy as np
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.sequence import SequenceWriter

def record(folder):
    rig = stereo_rig(Pinhole(48, 32, 40.5, 41.25, 23.5, 15.5), pitch_deg=30)
    with SequenceWriter(folder, rig, case_json=b"{}", provenance={"vobench": "1"}) as writer:
        os.write(1, b"%d " % os.getpid())
        for index in range(1_000_000):
            pair = np.random.default_rng(index).integers(0, 256, (2, 32, 48), np.uint8)
            writer.write_frame(index * 500_000_000, *pair)
            writer.write_truth(index * 500_000_000, np.eye(4), None)
            os.write(1, b".")

for folder in sys.argv[1:]:
    child = os.fork()
    if not child:
        record(Path(folder))
    os.waitpid(child, 0)
    os.write(1, b"\\n")
"""


def pair(index):
    return np.random.default_rng(index).integers(0, 256, (2, 32, 48), np.uint8)


def test_killed_at_any_moment_a_writer_loses_less_than_two_seconds_and_nothing_reads_as_complete(tmp_path):
    rng, folders = np.random.default_rng(6), [tmp_path / str(kill) for kill in range(KILLS)]
    with subprocess.Popen([sys.executable, "-c", RECORDER, *folders], stdout=subprocess.PIPE, bufsize=0) as mother:
        for folder in folders:
            child = int(b"".join(iter(lambda: mother.stdout.read(1).strip(), b"")))
            written = sum(len(mother.stdout.read(1)) for _ in range(rng.integers(3, 150)))
            os.kill(child, signal.SIGKILL)
            written += len(mother.stdout.readline().strip())
            check_recovery(folder, written)


def check_recovery(folder, written):
    assert not (folder / "sensors.mcap").exists()
    assert not (folder / "truth.mcap").exists()
    with pytest.raises(SequenceError, match=r"was never finished; `vobench salvage` recovers .*sensors\.mcap\.part$"):
        Sequence.open(folder)
    salvage_sequence(folder, folder / "whole")
    frames = list(Sequence.open(folder / "whole").frames())
    assert written - 3 <= len(frames) <= written + 1
    assert written - 3 <= len(read_truth(folder / "whole")) <= written + 1
    for frame in frames:
        np.testing.assert_array_equal([frame.left, frame.right], pair(frame.index))
    assert read_case(folder / "whole") == b"{}"
    assert read_provenance(folder / "whole") == {"vobench": "1"}


@pytest.fixture
def long_folder(make, tmp_path):
    """A recording of several chunks."""
    return make(95).write(tmp_path / "long")


def test_a_file_cut_anywhere_gives_back_every_chunk_that_is_whole(long_folder, tmp_path, counts):
    data = (long_folder / "sensors.mcap").read_bytes()
    before = 0
    for cut in np.linspace(0, len(data) - 1, 60, dtype=int).tolist():
        (tmp_path / "torn.mcap").write_bytes(data[:cut])
        try:
            found = salvage(tmp_path / "torn.mcap", tmp_path / "whole.mcap").messages
        except SequenceError:
            assert not (tmp_path / "whole.mcap").exists()
            assert before == 0
            continue
        whole = messages_of_whole_chunks(data[:cut])
        assert sum(found.values()) == whole >= before
        assert found.get("/cam_left/image/compressed") == found.get("/cam_right/image/compressed")
        before = whole
    assert before == messages_of_whole_chunks(data) == sum(counts(long_folder / "sensors.mcap").values())


def messages_of_whole_chunks(data):
    """How many messages the library finds before it breaks down."""
    records, count = StreamReader(BytesIO(data), emit_chunks=False).records, 0
    with contextlib.suppress(Exception):
        for record in records:
            count += isinstance(record, Message)
    return count


def test_a_whole_file_comes_back_with_the_same_payload_and_nothing_lost(folder, tmp_path):
    found = salvage_sequence(folder, tmp_path)
    assert [s.lost for s in found.values()] == [(), ()]
    assert found["truth.mcap"].attachments == ("case.json",)
    assert found["sensors.mcap"].notes == ("vobench.wheels",)
    assert payload_hash(tmp_path) == payload_hash(folder)


def test_salvaging_twice_gives_the_same_bytes(folder, tmp_path):
    data = (folder / "sensors.mcap").read_bytes()
    (tmp_path / "torn").write_bytes(data[:-500])
    for name in ("a", "b"):
        salvage(tmp_path / "torn", tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize("place", [200, 8])
def test_a_damaged_chunk_costs_only_its_own_frames(long_folder, tmp_path, place):
    """In its content, or in its length, which makes all that follows hard to find."""
    data = bytearray((long_folder / "sensors.mcap").read_bytes())
    index = Bag.open(long_folder / "sensors.mcap").index
    data[int(index.offset[2]) + place] ^= 1
    (long_folder / "sensors.mcap").write_bytes(data)
    frames = Sequence.open(long_folder).frames()
    with pytest.raises(SequenceError, match=r"the recording is damaged .*; `vobench salvage` recovers what is whole"):
        list(frames)
    found = salvage_sequence(long_folder, tmp_path / "whole")
    assert len(found["sensors.mcap"].lost) == 1
    stamps = [frame.t_ns for frame in Sequence.open(tmp_path / "whole").frames()]
    assert 0 < len(stamps) < 95
    gap = np.argmax(np.diff(stamps))
    assert index.start_ns[2] - stamps[gap] < 40_000_000
    assert stamps[gap + 1] - index.end_ns[2] < 40_000_000


def test_pixel_truth_that_is_cut_within_a_pair_ends_with_the_pair_before(tmp_path):
    """Large pictures have chunks of their own: the last one, of a right camera, is cut off."""
    rig = stereo_rig(Pinhole(400, 400, 200.0, 200.0, 199.5, 199.5), pitch_deg=0)
    flow = TruthFrame(flow=np.random.default_rng(0).normal(size=(400, 400, 2)).astype(np.float32))
    with SequenceWriter(tmp_path / "a", rig, case_json=b"", truth_channels=("flow",)) as writer:
        for index in range(3):
            writer.write_truth_frame(index, "left", flow)
            writer.write_truth_frame(index, "right", flow)
    cut_at = int(Bag.open(tmp_path / "a" / "truth.mcap").index.offset[-1])
    (tmp_path / "a" / "truth.mcap").write_bytes((tmp_path / "a" / "truth.mcap").read_bytes()[:cut_at])
    salvage_sequence(tmp_path / "a", tmp_path / "b")
    assert [frame.t_ns for frame in read_truth_frames(tmp_path / "b")] == [0, 1]


def test_messages_outside_of_chunks_and_of_other_packings_are_rescued(tmp_path):
    for packing, chunked in ((CompressionType.LZ4, True), (CompressionType.NONE, True), (CompressionType.ZSTD, False)):
        with (tmp_path / "torn").open("wb") as stream:
            writer = Writer(stream, compression=packing, use_chunking=chunked, chunk_size=100)
            writer.start(profile="x", library="y")
            channel = writer.register_channel("/a", "json", writer.register_schema("A", "jsonschema", b"{}"))
            for t_ns in range(20):
                writer.add_message(channel, t_ns, b"%d" % t_ns * 30, t_ns + 7, sequence=t_ns)
            writer.flush()
        found = salvage(tmp_path / "torn", tmp_path / "whole")
        assert found.messages == {"/a": 20}
        with (tmp_path / "whole").open("rb") as stream:
            reader = make_reader(stream)
            rows = [(s.name, m.log_time, m.publish_time, m.data, m.sequence) for s, _, m in reader.iter_messages()]
            assert reader.get_header().profile == "x"
        assert rows == [("A", t_ns, t_ns + 7, b"%d" % t_ns * 30, t_ns) for t_ns in range(20)]


def test_schemas_and_channels_that_are_stated_again_stay_one(tmp_path):
    """As rosbag2 states them in every chunk."""
    stream = BytesIO()
    for number in range(2):
        part = BytesIO()
        writer = Writer(part, use_chunking=False)
        writer.start()
        channel = writer.register_channel("/a", "json", writer.register_schema("A", "jsonschema", b"{}"))
        writer.add_message(channel, number, b"{}", number)
        writer.flush()
        begin = 0 if number == 0 else len(MAGIC) + HEAD.size + HEAD.unpack_from(part.getvalue(), len(MAGIC))[1]
        stream.write(part.getvalue()[begin:])
    (tmp_path / "torn").write_bytes(stream.getvalue())
    assert salvage(tmp_path / "torn", tmp_path / "whole").messages == {"/a": 2}
    index = Bag.open(tmp_path / "whole").index
    assert (len(index.schemas), len(index.channels)) == (1, 1)


def test_attachments_called_like_paths_outside_stay_inside_the_file(tmp_path):
    with (tmp_path / "torn").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_attachment(0, 0, "../../evil", "text/plain", b"evil")
        writer.add_message(writer.register_channel("/a", "json", 0), 0, b"{}", 0)
        writer.flush()
    (tmp_path / "deep" / "er").mkdir(parents=True)
    assert salvage(tmp_path / "torn", tmp_path / "deep" / "er" / "whole").attachments == ("../../evil",)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["deep", "er", "torn", "whole"]


def test_of_a_sequence_whose_truth_is_lost_the_sensors_come_back(folder, tmp_path):
    (tmp_path / "torn").mkdir()
    (tmp_path / "torn" / "sensors.mcap").write_bytes((folder / "sensors.mcap").read_bytes()[:-500])
    (tmp_path / "torn" / "truth.mcap.part").write_bytes(b"")
    found = salvage_sequence(tmp_path / "torn", tmp_path / "deep" / "whole")
    assert found["truth.mcap"].messages == {}
    assert "not an MCAP recording" in found["truth.mcap"].lost[0]
    assert [path.name for path in (tmp_path / "deep" / "whole").iterdir()] == ["sensors.mcap"]
    assert len(list(Sequence.open(tmp_path / "deep" / "whole").frames())) > 0


def test_a_place_that_cannot_be_written_is_an_error_and_no_loss(folder, tmp_path):
    (tmp_path / "truth.mcap").mkdir()
    with pytest.raises(SequenceError, match=r"^cannot salvage \(Is a directory\): .*truth\.mcap"):
        salvage_sequence(folder, tmp_path)


def test_a_damaged_attachment_is_refused_and_lost_and_no_message_with_it(folder, tmp_path):
    data = (folder / "truth.mcap").read_bytes()
    assert data.count(b'{"seed": 7}') == 1
    (tmp_path / "truth.mcap").write_bytes(data.replace(b'{"seed": 7}', b'{"seed": 8}'))
    with pytest.raises(SequenceError, match=r"the checksum of the attachment 'case\.json' differs"):
        read_case(tmp_path)
    found = salvage(tmp_path / "truth.mcap", tmp_path / "whole")
    assert found.attachments == ()
    assert "the checksum of the attachment 'case.json' differs from its content" in found.lost[0]
    assert found.messages == salvage(folder / "truth.mcap", tmp_path / "again").messages


def test_what_is_lost_is_noted_in_the_new_file(long_folder, tmp_path):
    data = (long_folder / "sensors.mcap").read_bytes()
    (tmp_path / "torn").write_bytes(data[: len(data) // 2])
    found = salvage(tmp_path / "torn", tmp_path / "whole")
    assert Bag.open(tmp_path / "whole").note("vobench.salvage") == {"lost": "; ".join(found.lost)}


def test_what_is_no_recording_or_has_nothing_whole_is_refused_and_leaves_no_file(tmp_path, folder):
    (tmp_path / "text").write_bytes(b"hello")
    (tmp_path / "early").write_bytes((folder / "sensors.mcap").read_bytes()[:300])
    for name, said in (
        ("text", "not an MCAP recording"),
        ("early", "no message is whole"),
        ("nowhere", "No such file"),
    ):
        with pytest.raises(SequenceError, match=said):
            salvage(tmp_path / name, tmp_path / "out")
    with pytest.raises(SequenceError, match="needs a file of its own"):
        salvage(tmp_path / "text", tmp_path / "text")
    with pytest.raises(SequenceError, match=r"^no sensors\.mcap, truth\.mcap or a \.part of one in"):
        salvage_sequence(tmp_path, tmp_path / "out")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["early", "text"]
