from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from vobench.dataset.picture import EncodedPicture
from vobench.dataset.recording import NO_TRUTH, UNRECTIFIABLE, PictureStream, RecordedFrame, Recording, assemble
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.sensor.imu import ImuReadings
from vobench.sequence.message import END_OF_STAMPS_NS
from vobench.trajectory.trajectory import Trajectory

GREY = np.random.default_rng(1).integers(0, 256, (48, 64), np.uint8)


def file(end: str = ".png", pixels: np.ndarray = GREY) -> bytes:
    return cv2.imencode(end, pixels)[1].tobytes()


def stream(*frames: tuple[bytes | np.ndarray, ...]) -> PictureStream:
    def shots() -> Iterator[RecordedFrame]:
        for t_ns, contents in enumerate(frames):
            yield RecordedFrame(t_ns, tuple(EncodedPicture(f"image {t_ns}", content) for content in contents))

    return PictureStream.open(shots)


def truth_at(*t_ns: int) -> Trajectory:
    return Trajectory(np.array(t_ns), np.tile(np.eye(4), (len(t_ns), 1, 1)))


def readings(*t_ns: int) -> ImuReadings:
    return ImuReadings(np.array(t_ns), np.zeros((len(t_ns), 3)), np.zeros((len(t_ns), 3)))


def test_grey_files_are_kept_and_others_become_png_of_the_same_pixels() -> None:
    jpeg = file(".jpg")
    (frame,) = stream((jpeg,)).encoded_frames()
    assert (frame.left, frame.form, frame.right) == (jpeg, "jpeg", None)
    colour = np.dstack([GREY, GREY, GREY])
    (frame,) = stream((file(pixels=colour), colour)).encoded_frames()
    assert frame.form == "png"
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(frame.left, np.uint8), cv2.IMREAD_UNCHANGED), GREY)
    assert frame.right == frame.left
    with pytest.raises(InputError, match="a recording should have one image or more, but has none"):
        stream()


def test_a_pair_of_two_forms_becomes_one_of_png() -> None:
    png, jpeg = file(), file(".jpg")
    (frame,) = stream((png, jpeg)).encoded_frames()
    (decoded,) = stream((png, jpeg)).frames()
    assert frame.form == "png"
    assert frame.right is not None
    found = cv2.imdecode(np.frombuffer(frame.right, np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(found, decoded.right)


def test_a_picture_that_is_not_as_the_first_is_refused_by_its_name_but_another_form_is_taken() -> None:
    assert len(list(stream((file(),), (file(".jpg"),)).frames())) == 2
    with pytest.raises(InputError, match=r"^the first image has 64 x 48 .*, but this one has 32 x 48 .*: image 1$"):
        list(stream((GREY,), (GREY[:, ::2],)).frames())


def recording(rig: Rig, t_ns: tuple[int, ...] = (100, 200), **given: Any) -> Recording:
    pictures = stream((GREY,) * len(rig.sides))
    return assemble("x", rig, pictures, np.array(t_ns), calibration="c.yaml", **{"truth": None, **given})


def test_the_start_is_the_first_stamp_of_pictures_truth_and_readings(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of(imu=True)
    assert recording(rig).start_ns == 100
    assert recording(rig, truth=truth_at(90, 150, 250)).start_ns == 90
    assert recording(rig, truth=truth_at(110, 150), imu=readings(80, 95, 120)).start_ns == 95
    assert recording(rig, imu=readings()).start_ns == 100


def test_a_recording_without_readings_has_no_imu_in_its_rig(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of(imu=True)
    assert recording(rig).rig.imu is None
    assert recording(rig, imu=readings(1, 2)).rig.imu is None, "dropped, for it shares no time with the images"
    assert recording(rig, imu=readings(90, 210)).rig.imu == rig.imu
    assert recording(rig).frame_count == 2


def test_notes_come_once_and_a_missing_truth_is_one(rig_of: Callable[..., Rig]) -> None:
    assert recording(rig_of(), notes=["a", "b", "a"]).notes == ("a", "b", NO_TRUTH)
    assert recording(rig_of(), notes=["a"], truth=truth_at(100, 200)).notes == ("a",)
    left_of = rig_of(T_left_right=se3.transform(np.eye(3), [-0.1, 0.0, 0.0]))
    assert recording(left_of).notes == (UNRECTIFIABLE, NO_TRUTH)


def test_two_cameras_in_one_place_and_pictures_of_another_size_are_refused(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of(T_left_right=se3.transform(np.eye(3), [1e-6, 0.0, 0.0]))
    with pytest.raises(InputError, match=r"should be more than 1e-06 m apart, but are 1e-06 m apart: c\.yaml$"):
        recording(rig)
    smaller = replace(rig_of(), right=replace(rig_of().left, width_px=63))  # type: ignore[type-var]
    with pytest.raises(InputError, match=r"^the first right image has 64 x 48 pixels, but .* for 63 x 48: c\.yaml$"):
        recording(smaller)


def test_stamps_are_within_the_time_of_ros(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of(imu=True)
    last = END_OF_STAMPS_NS - 1
    assert recording(rig, (0, last)).start_ns == 0
    for stamps, said in (((-1, 5), "an image has -1"), ((0, last + 1), f"an image has {last + 1}")):
        with pytest.raises(InputError, match=rf"^stamps should be within 0 and {last} ns, but {said}$"):
            recording(rig, stamps)
    with pytest.raises(InputError, match=r"but a true pose has -3$"):
        recording(rig, (0, 5), truth=truth_at(-3, 4))
    with pytest.raises(InputError, match=r"but an IMU reading has -3$"):
        recording(rig, (0, 5), imu=readings(-3, 4))
