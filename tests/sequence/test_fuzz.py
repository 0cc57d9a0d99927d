"""A thousand damaged and hostile recordings: each is read, or refused in one line, in little time and memory."""

import resource
import shutil
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Footer, MessageIndex, Schema, Statistics

from vobench.errors import VobenchError
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import ImuCalibration, stereo_rig
from vobench.sensor.imu import ImuReadings
from vobench.sensor.pixel_truth import TruthFrame
from vobench.sequence import (
    Sequence,
    SequenceWriter,
    payload_hash,
    read_case,
    read_imu_bias,
    read_provenance,
    read_true_rig,
    read_truth,
    read_truth_frames,
    read_twist,
)
from vobench.sequence.bag import Bag
from vobench.sequence.mcap_file import MAGIC, MAX_BYTES
from vobench.sequence.recording import read_poses
from vobench.sequence.topic import TF_STATIC

COUNT, LIMIT_S = 1000, 5
HEADROOM_BYTES = 1_200_000_000  # four times what a record may hold
FILES = ("sensors.mcap", "truth.mcap")
HUGE = (2**63, 2**64 - 1, 2**63 - 1, 2**32, 2**31, 2**28, 0, 1)


class TooSlowError(BaseException):
    """Not an Exception, which readers turn into an error of their own."""


@pytest.mark.slow
def test_a_thousand_damaged_recordings_are_read_or_refused_in_one_line(tmp_path):
    done = subprocess.run([sys.executable, __file__, tmp_path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    read, refused = map(int, done.stdout.split())
    assert read + refused == COUNT
    assert read > 50
    assert refused > 300


def test_a_bomb_of_zeros_is_refused_by_what_it_states_and_by_what_it_holds(tmp_path):
    for holds, states in ((300, MAX_BYTES * 8), (300, 100), (300, 2**63), (256, MAX_BYTES)):
        (tmp_path / "sensors.mcap").write_bytes(bomb(holds, states))
        done = subprocess.run([sys.executable, __file__, tmp_path, "only"], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-3000:]
        assert done.stdout.startswith("the recording is damaged")


def bomb(mebibytes, stated):
    """A recording whose one chunk unpacks to so much, though it may state another size."""
    packer = zstandard.ZstdCompressor(level=1, write_content_size=False).compressobj()
    packed = b"".join([*(packer.compress(bytes(1 << 20)) for _ in range(mebibytes)), packer.flush()])
    file, topic = RecordBuilder(), TF_STATIC
    file.write(MAGIC)
    begin = file.count
    Chunk("zstd", packed, 0, 0, uncompressed_crc=0, uncompressed_size=stated).write(file)
    index_at = file.count
    MessageIndex(0, [(0, 0)]).write(file)
    end = file.count
    Schema(id=1, data=b"", encoding="ros2msg", name=topic.type_name).write(file)
    Channel(id=0, topic=topic.name, message_encoding="cdr", metadata={}, schema_id=1).write(file)
    Statistics(
        attachment_count=0,
        channel_count=1,
        channel_message_counts={0: 1},
        chunk_count=1,
        message_count=1,
        message_end_time=0,
        message_start_time=0,
        metadata_count=0,
        schema_count=1,
    ).write(file)
    ChunkIndex(
        chunk_length=index_at - begin,
        chunk_start_offset=begin,
        compression="zstd",
        compressed_size=len(packed),
        message_end_time=0,
        message_index_length=end - index_at,
        message_index_offsets={0: index_at},
        message_start_time=0,
        uncompressed_size=stated,
    ).write(file)
    Footer(end, 0, 0).write(file)
    file.write(MAGIC)
    return file.end()


def write_recording(folder):
    """Two of each message, in few bytes."""
    imu = ImuCalibration(np.eye(4), 100.0, 1e-3, 1e-2, 1e-5, 1e-4)
    rig = stereo_rig(Pinhole(16, 12, 9.0, 9.0, 7.5, 5.5), pitch_deg=30)
    rig = type(rig)(rig.left, rig.right, rig.T_body_left, rig.T_body_right, rig.wheels, imu)
    rng = np.random.default_rng(0)
    with SequenceWriter(folder, rig, case_json=b"{}", truth_channels=("depth",), provenance={"vobench": "1"}) as writer:
        for t_ns in (1_000_000_000, 2_500_000_000):
            writer.write_imu(ImuReadings(np.array([t_ns]), rng.normal(size=(1, 3)), rng.normal(size=(1, 3))))
            writer.write_encoders([t_ns], [[1, 2]])
            writer.write_frame(t_ns, *rng.integers(0, 256, (2, 12, 16), np.uint8))
            writer.write_exposure(t_ns, 0.01, 6.0)
            writer.write_truth(t_ns, np.eye(4), np.zeros(6))
            writer.write_imu_bias(t_ns, np.zeros(3), np.ones(3))
            for side in ("left", "right"):
                writer.write_truth_frame(t_ns, side, TruthFrame(depth=np.ones((12, 16), np.float32)))


def places(data):
    """Where each record outside of chunks begins, and its opcode."""
    at, found = 8, []
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append((at, opcode, 9 + length))
        at += 9 + length
    return found


def damaged(data, rng):
    """One of ten kinds of damage; some take the checksums off first, so that what lies behind them is reached."""
    data, records = bytearray(data), places(data)
    if rng.random() < 0.6:
        unsealed(data, records)
    kind, at = rng.integers(10), int(rng.integers(len(data)))
    begin, _, length = records[rng.integers(len(records))]
    if kind < 3:
        for place in rng.integers(0, len(data), 2**kind):
            data[place] ^= 1 << rng.integers(8)
    elif kind == 3:
        del data[at:]
    elif kind == 4:
        put(data, at, HUGE[rng.integers(len(HUGE))])
    elif kind == 5:
        put(data, begin + 1, HUGE[rng.integers(len(HUGE))])
    elif kind == 6:  # a number within a record, and every chunk index consists of them
        put(data, begin + 9 + 8 * int(rng.integers(max(1, length // 8))), HUGE[rng.integers(len(HUGE))])
    elif kind == 7:
        other, _, _ = records[rng.integers(len(records))]
        data[other:other] = data[begin : begin + length]
    elif kind == 8:
        del data[begin : begin + length]
    else:
        data[at : at + 40] = rng.bytes(int(rng.integers(80)))
    return bytes(data)


def unsealed(data, records):
    """Take the checksums of chunks and of the summary away: 0 says that there is none."""
    for begin, opcode, _ in records:
        if opcode == Opcode.CHUNK:
            data[begin + 9 + 24 : begin + 9 + 28] = bytes(4)
        if opcode == Opcode.FOOTER:
            data[begin + 9 + 16 : begin + 9 + 20] = bytes(4)


def put(data, at, number):
    if at + 8 <= len(data):
        struct.pack_into("<Q", data, at, number)


def read_all(folder):
    """Everything a sequence is asked for."""
    sequence = Sequence.open(folder)
    stamps = sequence.frame_stamps()
    assert len(list(sequence.frames())) == len(sequence) == len(stamps)
    sequence.frame_at(int(stamps[-1]))
    for read in (sequence.imu, sequence.encoders, sequence.exposures):
        read()
    for read in (read_truth, read_twist, read_imu_bias, read_true_rig, read_case, read_provenance, payload_hash):
        read(folder)
    list(read_truth_frames(folder))


def attempt(work, *arguments):
    """Whether it went well; only an error of one line may say that it did not."""
    try:
        work(*arguments)
    except VobenchError as error:
        if "\n" in str(error):
            raise ValueError(f"more than a line: {error}") from error
        return False
    return True


def stop(number, frame):
    raise TooSlowError


def be_bounded():
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + HEADROOM_BYTES, used + HEADROOM_BYTES))
    signal.signal(signal.SIGALRM, stop)


def main(folder):
    write_recording(folder / "whole")
    whole = {name: (folder / "whole" / name).read_bytes() for name in FILES}
    be_bounded()
    outcome = np.zeros(2, int)
    for seed in range(COUNT):
        rng, bad, place = np.random.default_rng(seed), FILES[seed % 2], folder / str(seed)
        place.mkdir()
        for name in FILES:
            (place / name).write_bytes(damaged(whole[name], rng) if name == bad else whole[name])
        signal.alarm(LIMIT_S)
        try:
            well = attempt(read_all, place)
            if seed % 25 == 1:  # rosbags is slow, and has its own reader
                attempt(read_poses, place / "truth.mcap", "/ground_truth/odometry")
            outcome += (well, not well)
        except BaseException as error:
            raise RuntimeError(f"seed {seed}: {type(error).__name__}") from error
        signal.alarm(0)
        assert {path.name for path in folder.iterdir()} == {"whole", str(seed)}
        assert {path.name for path in place.rglob("*")} <= {*FILES}
        shutil.rmtree(place)
    print(*outcome)


def only(folder):
    be_bounded()
    signal.alarm(LIMIT_S)
    try:
        print(len(list(Bag.open(folder / "sensors.mcap").raw((TF_STATIC,)))))
    except VobenchError as error:
        print(error)


if __name__ == "__main__":
    (only if len(sys.argv) > 2 else main)(Path(sys.argv[1]))
