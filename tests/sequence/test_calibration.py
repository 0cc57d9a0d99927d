"""Every rig comes back: with one camera or two, with wheels or without, with an IMU or without."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.rig import ImuCalibration
from vobench.sensor.imu import ImuBias, ImuReadings
from vobench.sequence import Sequence, SequenceWriter, read_imu_bias, read_true_rig
from vobench.sequence.bag import Bag
from vobench.sequence.bag_writer import BagWriter
from vobench.sequence.calibration import read_rig, write_mounts
from vobench.sequence.camera_info import camera_info_message
from vobench.sequence.cdr import serialise
from vobench.sequence.recording import topic_facts
from vobench.sequence.topic import LEFT_INFO, TF_STATIC

T_BODY_IMU = se3.transform(se3.from_quaternion(np.array([0.5, -0.5, 0.5, -0.5])), [0.1, -0.2, 0.3])
IMU = ImuCalibration(T_BODY_IMU, 200.0, 1.7e-4, 2e-3, 2e-5, 3e-3)


def one_camera(rig):
    return replace(rig, right=None, T_body_right=None)


def same(read, rig):
    assert (read.left, read.right, read.wheels) == (rig.left, rig.right, rig.wheels)
    np.testing.assert_allclose(read.T_body_left, rig.T_body_left, rtol=0, atol=1e-15)
    for found, written in ((read.T_body_right, rig.T_body_right), (read.imu, rig.imu)):
        assert (found is None) == (written is None)
    if rig.right:
        np.testing.assert_allclose(read.T_body_right, rig.T_body_right, rtol=0, atol=1e-15)
    if rig.imu:
        np.testing.assert_allclose(read.imu.T_body_imu, rig.imu.T_body_imu, rtol=0, atol=1e-15)
        assert replace(read.imu, T_body_imu=None) == replace(rig.imu, T_body_imu=None)


@pytest.mark.parametrize(("eyes", "wheeled", "imu"), list(product((1, 2), (False, True), (None, IMU))))
def test_every_rig_comes_back_and_only_its_topics_are_declared(recording, tmp_path, eyes, wheeled, imu):
    rig = replace(recording.rig, imu=imu, wheels=recording.rig.wheels if wheeled else None)
    rig = rig if eyes == 2 else one_camera(rig)
    with SequenceWriter(tmp_path, rig, case_json=b"") as writer:
        writer.write_frame(0, recording.left[0], recording.right[0] if eyes == 2 else None)
    sequence = Sequence.open(tmp_path)
    same(sequence.rig, rig)
    same(read_true_rig(tmp_path), rig)
    (frame,) = sequence.frames()
    assert (frame.right is None) == (eyes == 1)
    topics = [facts.name for facts in topic_facts(sequence.path)]
    assert [any(part in topic for topic in topics) for part in ("cam_right", "encoders", "imu")] == [
        eyes == 2,
        wheeled,
        imu is not None,
    ]
    assert len(sequence.encoders()[0]) == len(sequence.imu().t_ns) == len(sequence.exposures()[0]) == 0


def test_imu_readings_and_their_biases_come_back_to_the_last_bit(recording, tmp_path):
    rng, rig = np.random.default_rng(0), replace(recording.rig, imu=IMU)
    readings = ImuReadings(np.arange(1, 31) * 5_000_000, rng.normal(size=(30, 3)), rng.normal(size=(30, 3)))
    with SequenceWriter(tmp_path, rig, case_json=b"") as writer:
        writer.write_imu(ImuReadings(readings.t_ns[:10], readings.gyro_radps[:10], readings.accel_mps2[:10]))
        writer.write_frame(50_000_000, recording.left[0], recording.right[0])
        writer.write_imu(ImuReadings(readings.t_ns[10:], readings.gyro_radps[10:], readings.accel_mps2[10:]))
        for t_ns, gyro, accel in zip(readings.t_ns[::10], readings.accel_mps2, readings.gyro_radps, strict=False):
            writer.write_imu_bias(t_ns, gyro, accel)
    found, bias = Sequence.open(tmp_path).imu(), read_imu_bias(tmp_path)
    assert isinstance(bias, ImuBias)
    for name in ("t_ns", "gyro_radps", "accel_mps2"):
        np.testing.assert_array_equal(getattr(found, name), getattr(readings, name))
    np.testing.assert_array_equal(bias.t_ns, readings.t_ns[::10])
    np.testing.assert_array_equal(bias.gyro_radps, readings.accel_mps2[:3])
    np.testing.assert_array_equal(bias.accel_mps2, readings.gyro_radps[:3])
    assert found.t_ns.dtype == np.int64


def test_what_the_rig_does_not_have_cannot_be_written(recording, tmp_path):
    bare = one_camera(replace(recording.rig, wheels=None))
    one = ImuReadings(np.array([1]), np.zeros((1, 3)), np.zeros((1, 3)))
    with SequenceWriter(tmp_path, bare, case_json=b"") as writer:
        for write, arguments, topic in (
            (writer.write_imu, (one,), "/imu"),
            (writer.write_encoders, ([1], [[1, 2]]), "/encoders"),
            (writer.write_imu_bias, (1, np.zeros(3), np.zeros(3)), "/ground_truth/imu_bias"),
        ):
            with pytest.raises(SequenceError, match=rf"has no sensor for {topic}: "):
                write(*arguments)
        with pytest.raises(SequenceError, match=r"^this rig has 1 cameras, but a frame has 2 images$"):
            writer.write_frame(1, recording.left[0], recording.right[0])
    with (
        pytest.raises(SequenceError, match=r"^this rig has 2 cameras, but a frame has 1 images$"),
        SequenceWriter(tmp_path, recording.rig, case_json=b"") as writer,
    ):
        writer.write_frame(1, recording.left[0], None)


def test_a_note_with_a_flipped_bit_is_refused_and_one_without_a_checksum_is_read(recording, tmp_path):
    path = recording.write(tmp_path) / "sensors.mcap"
    whole = path.read_bytes()
    assert whole.count(b"4096") == 1
    path.write_bytes(whole.replace(b"4096", b"4097"))
    said = r"the checksum of the note 'vobench\.wheels' differs from its content"
    with pytest.raises(SequenceError, match=said):
        Sequence.open(tmp_path)
    path.write_bytes(whole.replace(b"vobench.crc32", b"of.no.meaning"))
    same(Sequence.open(tmp_path).rig, recording.rig)


def bag_with(path, rig, *, mounts=True, info=True, notes=()):
    with BagWriter(path, (TF_STATIC, LEFT_INFO), encoded=True) as bag:
        if mounts:
            write_mounts(bag, rig, 0)
        for name, entries in notes:
            bag.note(name, entries)
        if info:
            bag.write(LEFT_INFO, 0, serialise(camera_info_message(0, "cam_left", rig.left)))
    return Bag.open(path)


def test_a_calibration_with_a_hole_is_refused_by_name(recording, tmp_path):
    rig = replace(one_camera(recording.rig), wheels=None)
    there = (LEFT_INFO,)
    assert read_rig(bag_with(tmp_path / "good", rig), there).imu is None
    with pytest.raises(SequenceError, match=r"^/tf_static has no message in"):
        read_rig(bag_with(tmp_path / "a", rig, mounts=False), there)
    with pytest.raises(SequenceError, match=r"^/cam_left/camera_info has no message in"):
        read_rig(bag_with(tmp_path / "b", rig, info=False), there)
    numbers = {"rate_hz": "200", "gyro_noise": "0", "accel_noise": "0", "gyro_walk": "0"}
    with pytest.raises(SequenceError, match=r"the IMU is not described as rate_hz, .*'accel_walk'"):
        read_rig(bag_with(tmp_path / "c", rig, notes=[("vobench.imu", numbers)]), there)
    whole = {**numbers, "accel_walk": "0"}
    with pytest.raises(SequenceError, match=r"^/tf_static does not say where imu is mounted in"):
        read_rig(bag_with(tmp_path / "d", rig, notes=[("vobench.imu", whole)]), there)
    with pytest.raises(SequenceError, match=r"the wheels are not described as radius_m, track_m, ticks_per_revolution"):
        read_rig(bag_with(tmp_path / "e", rig, notes=[("vobench.wheels", {"radius_m": "x"})]), there)
