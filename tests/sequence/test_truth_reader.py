"""What is true of every pixel comes back as it was written, beside the truth and never beside the sensors."""

import json
import shutil
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from vobench.errors import SequenceError, UnknownNameError
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig, stereo_rig
from vobench.sensor.truth import CHANNELS, TruthFrame, TruthNames
from vobench.sequence import (
    SequenceWriter,
    payload_hash,
    read_truth,
    read_truth_frames,
    read_truth_names,
    truth_channels,
)

NAMES = TruthNames(("", "floor", "Stuhl №1"), ("", "oak"))
COUNT = 3
Write = Callable[..., Path]


def make_frame(rng: np.random.Generator, channels: tuple[str, ...], *, height_px: int = 32, width_px: int = 48):
    values = {}
    for name in channels:
        channel = CHANNELS[name]
        shape = channel.shape(height_px, width_px)
        if channel.dtype is np.float32:
            values[name] = rng.normal(size=shape).astype(np.float32)
            values[name][:2] = np.nan
        else:
            values[name] = rng.integers(0, 2 if channel.dtype is np.bool_ else 65536, shape).astype(channel.dtype)
    return TruthFrame(**values)


def write(folder: Path, rig: Rig, channels: tuple[str, ...], *, seed: int = 0) -> list[tuple[TruthFrame, TruthFrame]]:
    rng, grey = np.random.default_rng(seed), np.zeros((32, 48), np.uint8)
    frames = [(make_frame(rng, channels), make_frame(rng, channels)) for _ in range(COUNT)]
    with SequenceWriter(folder, rig, case_json=b"{}", truth_channels=channels, truth_names=NAMES) as writer:
        for index, (left, right) in enumerate(frames):
            writer.write_frame(index * 1000, grey, grey)
            writer.write_truth(index * 1000, np.eye(4), np.zeros(6))
            writer.write_truth_frame(index * 1000, "left", left)
            writer.write_truth_frame(index * 1000, "right", right)
    return frames


@pytest.fixture(scope="module")
def rig() -> Rig:
    return stereo_rig(Pinhole(48, 32, 40.5, 41.25, 23.5, 15.5), pitch_deg=30)


@pytest.fixture(scope="module")
def recorded(rig, tmp_path_factory):
    folder = tmp_path_factory.mktemp("truth")
    return folder, write(folder, rig, tuple(CHANNELS))


def assert_same(found: TruthFrame, written: TruthFrame) -> None:
    there, expected = found.channels(), written.channels()
    assert list(there) == list(expected)
    for name, values in expected.items():
        assert there[name].dtype == values.dtype
        np.testing.assert_array_equal(there[name], values)


def test_every_channel_comes_back_to_the_last_bit(recorded):
    folder, written = recorded
    frames = list(read_truth_frames(folder))
    assert [(f.index, f.t_ns) for f in frames] == [(i, i * 1000) for i in range(COUNT)]
    for frame, (left, right) in zip(frames, written, strict=True):
        assert_same(frame.left, left)
        assert_same(frame.right, right)


def test_one_channel_can_be_read_alone_in_any_order_of_asking(recorded):
    folder, written = recorded
    for frame, (left, _) in zip(read_truth_frames(folder, ["shadow", "depth"]), written, strict=True):
        assert_same(frame.left, TruthFrame(depth=left.depth, shadow=left.shadow))


def test_only_the_channels_asked_for_are_recorded(rig, tmp_path):
    write(tmp_path, rig, ("flow", "depth"))
    assert truth_channels(tmp_path) == ("depth", "flow")
    assert [sorted(f.right.channels()) for f in read_truth_frames(tmp_path)] == [["depth", "flow"]] * COUNT


def test_names_come_back(recorded):
    assert read_truth_names(recorded[0]) == NAMES


def test_path_is_read_beside_the_channels_and_the_channels_without_sensors(recorded, tmp_path):
    shutil.copy(recorded[0] / "truth.mcap", tmp_path)
    assert len(read_truth(tmp_path)) == len(list(read_truth_frames(tmp_path))) == COUNT


def test_sequence_without_channels_has_the_same_bytes_as_before_there_were_any(rig, recorded, folder, tmp_path):
    for name in ("never", "none"):
        channels = {} if name == "never" else {"truth_channels": (), "truth_names": NAMES}
        with SequenceWriter(tmp_path / name, rig, case_json=b"{}", **channels) as writer:
            writer.write_truth(0, np.eye(4), np.zeros(6))
    for file in ("sensors.mcap", "truth.mcap"):
        assert (tmp_path / "never" / file).read_bytes() == (tmp_path / "none" / file).read_bytes()
    assert truth_channels(folder) == ()
    assert b"truth_names" not in (folder / "truth.mcap").read_bytes()


def test_channels_leave_what_estimators_see_as_it_was(rig, recorded, tmp_path):
    write(tmp_path, rig, ())
    assert (tmp_path / "sensors.mcap").read_bytes() == (recorded[0] / "sensors.mcap").read_bytes()


def test_payload_hash_follows_the_channels(rig, recorded, tmp_path):
    for name, channels, seed in (("same", tuple(CHANNELS), 0), ("other", tuple(CHANNELS), 1), ("fewer", (), 0)):
        write(tmp_path / name, rig, channels, seed=seed)
    assert payload_hash(tmp_path / "same") == payload_hash(recorded[0])
    hashes = {payload_hash(path) for path in (recorded[0], tmp_path / "other", tmp_path / "fewer")}
    assert len(hashes) == 3


def test_another_decoder_sees_pictures_of_the_right_kind(recorded):
    folder, written = recorded
    with (folder / "truth.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        topics = [f"/ground_truth/cam_right/{name}" for name in ("depth", "flow", "instance", "moving")]
        found = {m.channel.topic: m.decoded_message for m in reader.iter_decoded_messages(topics)}
    kinds = {topic.rsplit("/", 1)[1]: (m.encoding, m.step, m.header.frame_id) for topic, m in found.items()}
    assert kinds == {
        "depth": ("32FC1", 4 * 48, "cam_right"),
        "flow": ("32FC2", 8 * 48, "cam_right"),
        "instance": ("16UC1", 2 * 48, "cam_right"),
        "moving": ("mono8", 48, "cam_right"),
    }
    last = written[-1][1]
    depth = np.frombuffer(bytes(found[topics[0]].data), "<f4").reshape(32, 48)
    np.testing.assert_array_equal(depth, last.depth)
    assert set(bytes(found[topics[3]].data)) == {0, 255}


def test_channel_that_was_not_recorded_is_named(rig, folder, tmp_path):
    write(tmp_path, rig, ("depth",))
    with pytest.raises(SequenceError, match=r"^no truth channel 'flow' was recorded, only depth: .*truth\.mcap$"):
        read_truth_frames(tmp_path, ["flow"])
    with pytest.raises(SequenceError, match="was recorded, only none"):
        read_truth_frames(folder, ["flow"])
    with pytest.raises(UnknownNameError, match="no truth channel 'flo'"):
        read_truth_frames(tmp_path, ["flo"])
    with pytest.raises(UnknownNameError, match="no truth channel 'flo'"):
        SequenceWriter(tmp_path / "x", rig, case_json=b"", truth_channels=["flo"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"moving": None}, r"truth channel moving of the left camera should be .*'bool'\), got None"),
        ({"depth": np.zeros((32, 48), np.float32)}, r"truth channel depth .* should be None, got "),
        ({"flow": np.zeros((32, 47, 2), np.float32)}, r"should be \(\(32, 48, 2\), 'float32'\), got \(\(32, 47, 2\)"),
        ({"flow": np.zeros((32, 48, 2))}, r"'float32'\), got .*'float64'\)$"),
    ],
)
def test_frame_of_another_form_is_refused(rig, tmp_path, change, said):
    frame = make_frame(np.random.default_rng(0), ("flow", "moving"))
    with (
        pytest.raises(SequenceError, match=said),
        SequenceWriter(tmp_path, rig, case_json=b"", truth_channels=("flow", "moving")) as writer,
    ):
        writer.write_truth_frame(0, "left", replace(frame, **change))


def test_pair_with_one_side_missing_is_refused_when_read(rig, tmp_path):
    with SequenceWriter(tmp_path, rig, case_json=b"", truth_channels=("moving",)) as writer:
        writer.write_truth_frame(7, "left", make_frame(np.random.default_rng(0), ("moving",)))
    with pytest.raises(SequenceError, match=r"^truth frame 0 at 7 ns lacks channels in "):
        list(read_truth_frames(tmp_path))


def test_names_of_another_form_are_refused(rig, tmp_path, monkeypatch):
    monkeypatch.setattr("vobench.sequence.writer.names_to_json", lambda names: json.dumps({"instance": 3}).encode())
    write(tmp_path, rig, ("moving",))
    with pytest.raises(SequenceError, match="are not lists of instances and materials"):
        read_truth_names(tmp_path)


def test_memory_stays_flat_while_channels_pass(tmp_path):
    """39 MB of flow pass through the few copies of one picture that MCAP works on."""
    rig = stereo_rig(Pinhole(320, 240, 200.0, 200.0, 159.5, 119.5), pitch_deg=0)
    rng = np.random.default_rng(0)
    left, right = (make_frame(rng, ("flow",), height_px=240, width_px=320) for _ in range(2))

    def work() -> None:
        with SequenceWriter(tmp_path, rig, case_json=b"", truth_channels=("flow",)) as writer:
            for index in range(32):
                writer.write_truth_frame(index, "left", left)
                writer.write_truth_frame(index, "right", right)
        assert sum(1 for _ in read_truth_frames(tmp_path)) == 32

    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (tmp_path / "truth.mcap").stat().st_size > 30_000_000
    assert peak < 12_000_000
