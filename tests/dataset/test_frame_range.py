"""A part of a recording by the numbers of its frames."""

import numpy as np
import pytest

from vobench.dataset.frame_range import frame_slice
from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions
from vobench.errors import InputError


@pytest.mark.parametrize(
    ("text", "frames"), [("2:5", slice(2, 5)), (":4", slice(None, 4)), ("3:", slice(3, None)), (":", slice(None))]
)
def test_both_numbers_are_optional(text: str, frames: slice) -> None:
    assert frame_slice(text) == frames


@pytest.mark.parametrize("text", ["5", "a:b", "-3:4", "1:2:3", ""])
def test_anything_else_is_refused_by_the_name_of_the_option(text: str) -> None:
    with pytest.raises(InputError, match=r"^--frames should be A:B, two frame numbers"):
        frame_slice(text, name="--frames")


def test_a_part_has_its_images_stamps_and_truth(scene, tmp_path):
    folder = scene.kitti(tmp_path)
    whole = read(folder)
    part = read(folder, options=ReadOptions(frames="1:3"))
    assert part.t_ns.tolist() == whole.t_ns[1:3].tolist()
    assert part.truth.t_ns.tolist() == whole.t_ns[1:3].tolist()
    assert part.start_ns == whole.t_ns[1]
    assert part.notes[-1] == f"Of {whole.frame_count} frames, 1 to 2 were taken."
    frames = list(part.frames())
    encoded = list(part.encoded_frames())
    assert [frame.index for frame in frames] == [frame.index for frame in encoded] == [0, 1]
    for frame, number in zip(frames, (1, 2), strict=True):
        assert np.array_equal(frame.left, scene.left[number])
        assert np.array_equal(frame.right, scene.right[number])


def test_readings_are_cut_to_the_images_too(make_sequence, rig_of):
    made = make_sequence(rig_of(imu=True))
    whole = read(made.folder)
    part = read(made.folder, options=ReadOptions(frames="2:4"))
    first_ns, last_ns = part.t_ns
    for stamps, all_stamps in (
        (part.imu.t_ns, whole.imu.t_ns),
        (part.encoders[0], whole.encoders[0]),
        (part.exposures[0], whole.exposures[0]),
    ):
        inside = all_stamps[(all_stamps >= first_ns) & (all_stamps <= last_ns)]
        assert set(inside.tolist()) <= set(stamps.tolist())
        assert (stamps < first_ns).sum() <= 1
        assert (stamps > last_ns).sum() <= 1
    assert len(part.imu.gyro_radps) == len(part.imu.t_ns) < len(whole.imu.t_ns)
    assert len(part.encoders[1]) == len(part.encoders[0])


def test_frames_that_are_not_there_are_refused(scene, tmp_path):
    folder = scene.kitti(tmp_path)
    count = read(folder).frame_count
    with pytest.raises(InputError, match=f"frames {count}: should be some of the recording's, which has {count}"):
        read(folder, options=ReadOptions(frames=f"{count}:"))
