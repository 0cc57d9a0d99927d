"""Recordings into sequences: what goes in comes out."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.dataset.export import export
from vobench.dataset.layout import read
from vobench.dataset.sequence import convert
from vobench.errors import VobenchError
from vobench.geometry import se3
from vobench.sequence import Sequence, read_truth
from vobench.trajectory.trajectory import Trajectory


def same_pictures(sequence: Sequence, made) -> None:
    for frame, left, right in zip(sequence.frames(), made.left, made.right, strict=True):
        assert np.array_equal(frame.left, left)
        if frame.right is not None:
            assert np.array_equal(frame.right, right)


def test_a_sequence_of_our_own_comes_back_whole(make_sequence, rig_of, imported):
    made = make_sequence(rig_of(imu=True))
    before, folder = Sequence.open(made.folder), imported(made.folder)
    after = Sequence.open(folder)
    same_pictures(after, made)
    assert [frame.left for frame in after.encoded_frames()] == [frame.left for frame in before.encoded_frames()]
    for old, new in zip(before.encoders(), after.encoders(), strict=True):
        assert np.array_equal(old, new)
    for old, new in zip(before.exposures(), after.exposures(), strict=True):
        assert np.array_equal(old, new)
    assert np.array_equal(before.imu().gyro_radps, after.imu().gyro_radps)
    assert before.imu().t_ns.tolist() == after.imu().t_ns.tolist()
    assert np.abs(read_truth(folder).T_world_frame - made.T_world_body).max() < 1e-12


def test_pictures_that_are_jpeg_stay_the_same_bytes(make_sequence, imported):
    made = make_sequence(jpeg_quality=90)
    before = [(f.form, f.left, f.right) for f in Sequence.open(made.folder).encoded_frames()]
    assert [(f.form, f.left, f.right) for f in Sequence.open(imported(made.folder)).encoded_frames()] == before


@pytest.mark.parametrize("parts", [{"stereo": True, "imu": True}, {"stereo": False}, {"imu": True, "stereo": False}])
def test_by_way_of_euroc_everything_comes_back(make_sequence, rig_of, imported, tmp_path, parts):
    made = make_sequence(rig_of(**parts))
    export(made.folder, tmp_path / "out", "euroc")
    folder = imported(tmp_path / "out")
    sequence, truth = Sequence.open(folder), read_truth(folder)
    same_pictures(sequence, made)
    assert sequence.frame_stamps().tolist() == made.t_ns.tolist() == truth.t_ns.tolist()
    assert np.abs(truth.T_world_frame - made.T_world_body).max() < 1e-9
    assert np.abs(sequence.rig.T_body_left - made.rig.T_body_left).max() < 1e-9
    assert sequence.rig.left == made.rig.left
    if made.rig.imu:
        assert np.array_equal(sequence.imu().accel_mps2, Sequence.open(made.folder).imu().accel_mps2)
        assert np.abs(sequence.rig.imu.T_body_imu - made.rig.imu.T_body_imu).max() < 1e-9


def test_by_way_of_kitti_the_left_camera_comes_back(make_sequence, imported, tmp_path):
    made = make_sequence()
    export(made.folder, tmp_path / "out", "kitti")
    folder = imported(tmp_path / "out")
    sequence, truth = Sequence.open(folder), read_truth(folder)
    same_pictures(sequence, made)
    assert sequence.frame_stamps().tolist() == made.t_ns.tolist() == truth.t_ns.tolist()
    since_start = se3.inverse(made.T_world_left[:1]) @ made.T_world_left
    left = truth.of_mounted(sequence.rig.T_body_left).T_world_frame
    assert np.abs(se3.inverse(left[:1]) @ left - since_start).max() < 1e-9
    assert np.abs(sequence.rig.T_left_right - made.rig.T_left_right).max() < 1e-12


def test_by_way_of_tum_one_camera_comes_back(make_sequence, imported, tmp_path):
    made = make_sequence()
    export(made.folder, tmp_path / "out", "tum")
    folder = imported(tmp_path / "out")
    sequence, truth = Sequence.open(folder), read_truth(folder)
    same_pictures(sequence, made)
    assert sequence.frame_stamps().tolist() == made.t_ns.tolist() == truth.t_ns.tolist()
    assert np.abs(truth.T_world_frame - made.T_world_left).max() < 1e-9


def test_by_way_of_a_ros_2_bag_everything_comes_back(make_sequence, imported, tmp_path):
    made = make_sequence()
    export(made.folder, tmp_path / "out", "ros2")
    folder = imported(tmp_path / "out")
    sequence, truth = Sequence.open(folder), read_truth(folder)
    same_pictures(sequence, made)
    assert sequence.frame_stamps().tolist() == made.t_ns.tolist() == truth.t_ns.tolist()
    assert np.abs(truth.T_world_frame - made.T_world_body).max() < 1e-9
    assert np.abs(sequence.rig.T_body_left - made.rig.T_body_left).max() < 1e-9
    assert np.abs(sequence.rig.T_left_right - made.rig.T_left_right).max() < 1e-9
    assert sequence.rig.left == made.rig.left


def test_the_same_input_gives_the_same_bytes(scene, tmp_path):
    recording = read(scene.euroc(tmp_path / "in"))
    for name in ("one", "two"):
        convert(recording, tmp_path / name, provenance={"vobench": "0"})
    for name in ("sensors.mcap", "truth.mcap"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()


def test_notes_and_form_go_into_the_sequence(scene, tmp_path, imported):
    from vobench.sequence import read_import_notes

    folder = imported(scene.tartanair(tmp_path / "in"))
    notes = read_import_notes(folder)
    assert notes["form"] == "tartanair"
    assert any("z up" in note for note in notes.values())


def test_readings_of_two_sensors_are_merged_in_order_of_time(scene, tmp_path, make_sequence, rig_of):
    """Encoders and IMU at clashing stamps: each reading arrives once, in order."""
    made = make_sequence(rig_of(imu=True))
    recording = read(made.folder)
    t_ns = np.sort(np.concatenate([recording.imu.t_ns[::3], recording.imu.t_ns[1::3] + 7]))
    ticks = np.stack([np.arange(len(t_ns)), -np.arange(len(t_ns))], -1)
    convert(replace(recording, encoders=(t_ns, ticks)), tmp_path / "out")
    after = Sequence.open(tmp_path / "out")
    assert after.encoders()[0].tolist() == t_ns.tolist()
    assert np.array_equal(after.encoders()[1], ticks)
    assert after.imu().t_ns.tolist() == recording.imu.t_ns.tolist()


def test_a_truth_that_ends_early_is_kept_as_far_as_it_goes(scene, tmp_path):
    recording = read(scene.kitti(tmp_path))
    short = Trajectory(recording.truth.t_ns[:2], recording.truth.T_world_frame[:2])
    convert(replace(recording, truth=short), tmp_path / "out")
    assert len(read_truth(tmp_path / "out")) == 2


def test_pictures_that_fail_to_come_are_missed(scene, tmp_path):
    recording = read(scene.kitti(tmp_path))
    more = replace(recording, t_ns=np.append(recording.t_ns, recording.t_ns[-1] + 1))
    with pytest.raises(VobenchError, match="5 images were read, but the recording should have 6"):
        convert(more, tmp_path / "out")
    assert not (tmp_path / "out" / "sensors.mcap").exists()


def test_a_wrong_picture_leaves_no_sequence(scene, tmp_path):
    euroc = scene.euroc(tmp_path / "in")
    (euroc / f"mav0/cam0/data/{scene.t_ns[4]}.png").write_bytes(b"")
    recording = read(euroc)
    with pytest.raises(VobenchError, match="it is empty"):
        convert(recording, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []
    with pytest.raises(VobenchError):
        Sequence.open(tmp_path / "out")
