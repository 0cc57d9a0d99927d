"""A recording reads back as it was written, and says so when it cannot."""

import shutil
from dataclasses import replace
from itertools import islice

import cv2
import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.geometry.calibration import CalibrationError, true_rig
from vobench.geometry.preset import PRESETS
from vobench.geometry.rig import ImuCalibration, WheelGeometry, mounted
from vobench.sensor.imu import ImuReadings
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
    read_twist,
)
from vobench.sequence import messages as ros
from vobench.sequence.bag import Bag, BagWriter
from vobench.sequence.calibration import write_mounts
from vobench.sequence.cdr import serialise
from vobench.sequence.picture import encode


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
    nominal = mounted(preset.left, preset.right, preset.T_left_right, pitch_deg=12)
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
    (first, _) = (m for _, m in Bag.open(tmp_path / "truth.mcap").messages((ros.ODOMETRY,)))
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
    rig, infos = recording.rig, [serialise(info) for info in ros.camera_infos(0, recording.rig)]
    with BagWriter(
        tmp_path / "sensors.mcap", (ros.TF_STATIC, *ros.INFO_TOPICS, *ros.IMAGE_TOPICS), encoded=False
    ) as bag:
        write_mounts(bag, rig, 0)
        for topic, info in zip(ros.INFO_TOPICS, infos, strict=True):
            bag.write(topic, 0, info)
        for topic, picture in zip(ros.IMAGE_TOPICS, (recording.left[0], recording.right[0]), strict=True):
            bag.write(topic, 0, serialise(ros.image(0, "cam_left", encode(picture, rig.left, "a"), "png")))
    with BagWriter(tmp_path / "truth.mcap", ros.TRUTH_TOPICS, encoded=False) as bag:
        write_mounts(bag, rig, 0)
        bag.write(ros.ODOMETRY, 0, serialise(ros.odometry(0, np.eye(4), np.zeros(6))))
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
