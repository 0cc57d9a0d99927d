"""A recording reads back as it was written, and says so when it cannot."""

import json
import shutil
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from vobench.errors import SequenceError, UnknownNameError
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import (
    PRESETS,
    CalibrationError,
    ImuCalibration,
    Rig,
    WheelGeometry,
    mounted_rig,
    stereo_rig,
    true_rig,
)
from vobench.sensor.imu import ImuReadings
from vobench.sensor.pixel_truth import CHANNELS, TruthFrame, TruthNames
from vobench.sequence import (
    Sequence,
    SequenceWriter,
    has_truth,
    payload_hash,
    read_case,
    read_disturbances,
    read_import_notes,
    read_imu_bias,
    read_provenance,
    read_true_rig,
    read_truth,
    read_truth_frames,
    read_truth_names,
    read_twist,
    truth_channels,
)
from vobench.sequence.bag import Bag
from vobench.sequence.bag_writer import BagWriter
from vobench.sequence.calibration import write_mounts
from vobench.sequence.camera_info import camera_info_messages
from vobench.sequence.cdr import serialise
from vobench.sequence.message import image_message, odometry_message
from vobench.sequence.picture import encode
from vobench.sequence.topic import IMAGE_TOPICS, INFO_TOPICS, ODOMETRY, TF_STATIC, TRUTH_TOPICS


def test_pixels_and_stamps_come_back_exactly(recording, folder):
    frames = list(Sequence.open(folder).frames())
    assert [f.index for f in frames] == list(range(len(recording.t_ns)))
    np.testing.assert_array_equal([f.t_ns for f in frames], recording.t_ns)
    np.testing.assert_array_equal([f.left for f in frames], recording.left)
    np.testing.assert_array_equal([f.right for f in frames], recording.right)
    assert frames[0].left.dtype == np.uint8


def test_encoder_readings_come_back_exactly(recording, folder):
    t_ns, ticks = Sequence.open(folder).encoders()
    assert t_ns.dtype == ticks.dtype == np.int64
    np.testing.assert_array_equal(t_ns, recording.encoder_t_ns)
    np.testing.assert_array_equal(ticks, recording.ticks)


def test_truth_comes_back_to_the_last_bits(recording, folder):
    truth = read_truth(folder)
    np.testing.assert_array_equal(truth.t_ns, recording.t_ns)
    np.testing.assert_allclose(truth.T_world_frame, recording.T_map_body, rtol=0, atol=1e-12)


def test_rig_comes_back(recording, folder):
    rig = Sequence.open(folder).rig
    assert (rig.left, rig.right, rig.wheels) == (recording.rig.left, recording.rig.right, recording.rig.wheels)
    np.testing.assert_allclose(rig.T_body_left, recording.rig.T_body_left, rtol=0, atol=1e-15)
    np.testing.assert_allclose(rig.T_body_right, recording.rig.T_body_right, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", PRESETS)
def test_estimators_are_told_the_nominal_rig_and_the_truth_holds_the_true_one(name, tmp_path):
    preset = PRESETS[name]
    nominal = mounted_rig(preset.left, preset.right, preset.T_left_right, pitch_deg=12)
    true = true_rig(
        nominal, CalibrationError(focal_ratio=0.01, center_px=(2.0, -1.0), baseline_ratio=-0.02, right_yaw_deg=1)
    )
    black = [np.zeros((camera.height_px, camera.width_px), np.uint8) for camera in (nominal.left, nominal.right)]
    with SequenceWriter(tmp_path, nominal, case_json=b"", true_rig=true) as sequence:
        sequence.write_frame(0, *black)
    for rig, read in ((nominal, Sequence.open(tmp_path).rig), (true, read_true_rig(tmp_path))):
        assert (read.left, read.right, read.wheels) == (rig.left, rig.right, rig.wheels)
        np.testing.assert_allclose(read.T_body_left, rig.T_body_left, rtol=0, atol=1e-15)
        np.testing.assert_allclose(read.T_body_right, rig.T_body_right, rtol=0, atol=1e-15)


def test_without_a_calibration_error_the_true_rig_is_the_one_that_is_told(folder):
    told, true = Sequence.open(folder).rig, read_true_rig(folder)
    assert (told.left, told.right, told.wheels) == (true.left, true.right, true.wheels)
    np.testing.assert_array_equal(told.T_body_right, true.T_body_right)


def test_payload_hash_follows_the_true_rig_though_no_sensor_shows_it(recording, tmp_path):
    off = true_rig(recording.rig, CalibrationError(right_roll_deg=0.1))
    for name, rig in (("exact", None), ("off", off)):
        with SequenceWriter(tmp_path / name, recording.rig, case_json=b"", true_rig=rig) as sequence:
            sequence.write_frame(0, recording.left[0], recording.right[0])
    sensors = [(tmp_path / name / "sensors.mcap").read_bytes() for name in ("exact", "off")]
    assert sensors[0] == sensors[1]
    assert payload_hash(tmp_path / "exact") != payload_hash(tmp_path / "off")


def test_encoded_frames_are_the_frames_undecoded(recording, folder):
    sequence = Sequence.open(folder)
    assert len(sequence) == len(recording.t_ns)
    frame = next(islice(sequence.encoded_frames(), 4, None))
    assert (frame.index, frame.t_ns) == (4, recording.t_ns[4])
    picture = cv2.imdecode(np.frombuffer(frame.right, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(picture, recording.right[4])


def test_exposures_come_back_as_they_were(recording, folder):
    t_ns, exposures = Sequence.open(folder).exposures()
    np.testing.assert_array_equal(t_ns, recording.t_ns)
    np.testing.assert_array_equal(exposures, [(0.001 * (i + 1), 6.0) for i in range(len(t_ns))])


def test_jpeg_is_smaller_near_the_picture_and_says_what_it_is(recording, tmp_path):
    smooth = cv2.GaussianBlur(recording.left[0], (0, 0), 4)
    for name, quality in (("png", None), ("jpeg", 90)):
        with SequenceWriter(tmp_path / name, recording.rig, case_json=b"", jpeg_quality=quality) as sequence:
            sequence.write_frame(0, smooth, smooth)
    png, jpeg = (next(Sequence.open(tmp_path / name).encoded_frames()) for name in ("png", "jpeg"))
    assert (png.form, jpeg.form) == ("png", "jpeg")
    assert len(jpeg.left) < len(png.left)
    (decoded,) = Sequence.open(tmp_path / "jpeg").frames()
    assert 0 < np.abs(decoded.left.astype(int) - smooth).max() <= 6


def test_case_comes_back_from_the_truth_and_is_not_among_the_sensors(folder):
    assert read_case(folder) == b'{"seed": 7}'
    assert b"seed" not in (folder / "sensors.mcap").read_bytes()


def test_sensors_are_read_without_the_truth_and_the_truth_without_sensors(folder, tmp_path):
    for name in ("sensors", "truth"):
        (tmp_path / name).mkdir()
        shutil.copy(folder / f"{name}.mcap", tmp_path / name)
    assert len(list(Sequence.open(tmp_path / "sensors").frames())) == len(read_truth(tmp_path / "truth"))


def test_payload_hash_follows_pixels_but_not_their_compression(recording, folder, tmp_path, monkeypatch):
    encode = cv2.imencode
    monkeypatch.setattr(cv2, "imencode", lambda ext, image: encode(ext, image, [cv2.IMWRITE_PNG_COMPRESSION, 0]))
    same = recording.write(tmp_path / "same")
    assert (same / "sensors.mcap").read_bytes() != (folder / "sensors.mcap").read_bytes()
    assert payload_hash(same) == payload_hash(folder)
    right = recording.right.copy()
    right[5, 0, 0] ^= 1
    assert payload_hash(replace(recording, right=right).write(tmp_path / "other")) != payload_hash(folder)


def test_payload_hash_follows_stamps_encoders_and_wheels(recording, folder, tmp_path):
    others = {
        "stamps": replace(recording, t_ns=recording.t_ns + 1),
        "encoders": replace(recording, ticks=recording.ticks + 1),
        "truth": replace(recording, T_map_body=recording.T_map_body[::-1]),
        "wheels": replace(recording, rig=replace(recording.rig, wheels=WheelGeometry(0.2, 0.3, 4096))),
    }
    hashes = {payload_hash(other.write(tmp_path / name)) for name, other in others.items()}
    assert len(hashes | {payload_hash(folder)}) == 5


def test_a_frame_by_its_number_or_its_instant_is_the_one_of_the_stream(make, tmp_path):
    """95 frames lie in several chunks."""
    recording = make(95)
    sequence = Sequence.open(recording.write(tmp_path))
    np.testing.assert_array_equal(sequence.frame_stamps(), recording.t_ns)
    for index in (0, 1, 29, 30, 31, 64, 94):
        frame, t_ns = sequence.frame(index), int(recording.t_ns[index])
        assert (frame.index, frame.t_ns) == (index, t_ns)
        np.testing.assert_array_equal([frame.left, frame.right], [recording.left[index], recording.right[index]])
        assert [sequence.frame_at(t).index for t in (t_ns, t_ns + 5)] == [index, index]
        assert index == 0 or sequence.frame_at(t_ns - 1).index == index - 1


def test_a_frame_that_is_not_there_is_refused(folder):
    sequence = Sequence.open(folder)
    for index in (-1, 9):
        with pytest.raises(SequenceError, match=rf"has 9 messages and none numbered {index} in"):
            sequence.frame(index)
    with pytest.raises(SequenceError, match=r"^there is no frame at or before -1 ns in"):
        sequence.frame_at(-1)


@pytest.mark.parametrize(("form", "options"), [("png", [cv2.IMWRITE_PNG_COMPRESSION, 9]), ("jpeg", [])])
def test_pictures_that_are_encoded_already_pass_bit_for_bit(recording, tmp_path, form, options):
    pair = [cv2.imencode(f".{form}", picture[0], options)[1].tobytes() for picture in (recording.left, recording.right)]
    with SequenceWriter(tmp_path, recording.rig, case_json=None) as writer:
        writer.write_encoded_frame(5, *pair, form)
        with pytest.raises(SequenceError, match=rf"^cam_left should be gif but is {form}$"):
            writer.write_encoded_frame(6, *pair, "gif")
        with pytest.raises(SequenceError, match=r"^not an 8-bit grey PNG or JPEG: cam_right$"):
            writer.write_encoded_frame(6, pair[0], b"gif", form)
    (frame,) = Sequence.open(tmp_path).encoded_frames()
    assert (frame.t_ns, frame.form, frame.left, frame.right) == (5, form, *pair)


def test_an_imported_recording_keeps_its_stamps_its_notes_and_says_what_is_not_known(recording, tmp_path):
    first_ns = 1_403_636_579_763_555_584
    notes, versions = {"form": "euroc", "notes": "no wheels"}, {"vobench": "1.2", "numpy": "2"}
    with SequenceWriter(
        tmp_path, recording.rig, case_json=None, start_ns=first_ns, notes=notes, provenance=versions
    ) as writer:
        writer.write_frame(first_ns, recording.left[0], recording.right[0])
        assert not (tmp_path / "truth.mcap").exists()
        writer.write_truth(first_ns + 7, recording.T_map_body[0], None)
        writer.write_truth(first_ns + 9, recording.T_map_body[1], recording.twist[1])
    assert Sequence.open(tmp_path).frame_stamps().tolist() == [first_ns]
    assert read_truth(tmp_path).t_ns.tolist() == [first_ns + 7, first_ns + 9]
    assert read_twist(tmp_path) is None
    assert (read_import_notes(tmp_path), read_provenance(tmp_path)) == (notes, versions)
    with pytest.raises(SequenceError, match=r"^no attachment 'case\.json' in"):
        read_case(tmp_path)
    (first, _) = (m for _, m in Bag.open(tmp_path / "truth.mcap").messages((ODOMETRY,)))
    assert (first.twist.covariance[0], first.twist.twist.linear.x, first.pose.covariance[0]) == (-1, 0, 0)


def test_twist_comes_back_and_truth_is_there_or_not(recording, folder, tmp_path):
    np.testing.assert_array_equal(read_twist(folder), recording.twist)
    assert has_truth(folder)
    assert (read_import_notes(folder), read_provenance(folder)) == ({}, {})
    assert not has_truth(tmp_path)
    with SequenceWriter(tmp_path, recording.rig, case_json=b""):
        pass
    assert not has_truth(tmp_path)
    assert len(read_truth(tmp_path)) == 0
    assert read_twist(tmp_path) is None


def test_a_recording_of_the_time_before_exposure_imu_and_true_rig_still_reads(recording, tmp_path):
    rig, infos = recording.rig, [serialise(info) for info in camera_info_messages(0, recording.rig)]
    with BagWriter(tmp_path / "sensors.mcap", (TF_STATIC, *INFO_TOPICS, *IMAGE_TOPICS), encoded=False) as bag:
        write_mounts(bag, rig, 0)
        for topic, info in zip(INFO_TOPICS, infos, strict=True):
            bag.write(topic, 0, info)
        for topic, picture in zip(IMAGE_TOPICS, (recording.left[0], recording.right[0]), strict=True):
            bag.write(topic, 0, serialise(image_message(0, "cam_left", encode(picture, rig.left, "a"), codec="png")))
    with BagWriter(tmp_path / "truth.mcap", TRUTH_TOPICS, encoded=False) as bag:
        write_mounts(bag, rig, 0)
        bag.write(ODOMETRY, 0, serialise(odometry_message(0, np.eye(4), np.zeros(6))))
    sequence = Sequence.open(tmp_path)
    (frame,) = sequence.frames()
    np.testing.assert_array_equal(frame.right, recording.right[0])
    assert sequence.rig.imu is None
    assert [len(stamps) for stamps in (sequence.exposures()[0], sequence.encoders()[0], sequence.imu().t_ns)] == [
        0,
        0,
        0,
    ]
    assert len(read_truth(tmp_path)) == 1
    assert len(read_imu_bias(tmp_path).t_ns) == len(read_disturbances(tmp_path)[0]) == 0
    assert len(payload_hash(tmp_path)) == 64
    with pytest.raises(SequenceError, match=r"^/ground_truth/cam_left/camera_info should be .* but is missing"):
        read_true_rig(tmp_path)


def test_what_disturbs_the_robot_comes_back_as_it_was_written(recording, folder):
    stamps, disturbed = read_disturbances(folder)
    np.testing.assert_array_equal(stamps, recording.t_ns)
    np.testing.assert_array_equal(disturbed, np.hstack([recording.slip, recording.push]))


def test_payload_hash_follows_what_disturbs_the_robot(recording, folder, tmp_path):
    other = replace(recording, push=recording.push + 1e-9).write(tmp_path)
    assert payload_hash(other) != payload_hash(folder)


def test_payload_hash_follows_what_the_imu_says_and_how_it_is_described(recording, tmp_path):
    imu = ImuCalibration(np.eye(4), 200.0, 1e-4, 1e-3, 1e-5, 1e-4)
    hashes = set()
    for name, rate_hz, gyro in (("a", 200.0, 0.0), ("b", 100.0, 0.0), ("c", 200.0, 1.0)):
        rig = replace(recording.rig, imu=replace(imu, rate_hz=rate_hz, gyro_noise=1e-4 * (200 / rate_hz) ** 0.5))
        with SequenceWriter(tmp_path / name, rig, case_json=b"") as writer:
            writer.write_imu(ImuReadings(np.array([1]), np.full((1, 3), gyro), np.zeros((1, 3))))
            writer.write_frame(5, recording.left[0], recording.right[0])
        hashes.add(payload_hash(tmp_path / name))
    assert len(hashes) == 3


def test_the_left_pictures_can_be_had_without_the_right_ones(recording, folder):
    frames = list(Sequence.open(folder).frames(right=False))
    assert {frame.right for frame in frames} == {None}
    np.testing.assert_array_equal([frame.left for frame in frames], recording.left)


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
