from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from vobench.dataset.source import Views, open_source, png_frames, rate_hz, rectified
from vobench.errors import SequenceError
from vobench.geometry import se3
from vobench.geometry.camera import pixel_grid
from vobench.geometry.rig import PRESETS, Rig, mounted_rig
from vobench.sequence.topic import TRUTH_FILE

Make = Callable[..., Any]


@pytest.mark.parametrize(("stamps", "rate"), [([5], 0.0), ([5, 5], 0.0), ([0, 50_000_000, 100_000_000], 20.0)])
def test_a_rate_is_the_intervals_over_their_time(stamps: list[int], rate: float) -> None:
    assert rate_hz(np.array(stamps)) == rate


def test_a_rectified_pair_stays_as_it_was_recorded(rig_of: Callable[..., Rig]) -> None:
    views = rectified(rig_of())
    assert views.source_px is None
    assert views.rig.wheels is None
    picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
    assert views.show("left", picture) is picture
    assert views.dark_share("left", views.rig.left) == 0


def test_rectified_rows_are_those_of_one_point() -> None:
    pair = PRESETS["euroc"]
    rig = mounted_rig(pair.left, pair.right, pair.T_left_right, pitch_deg=10.0)
    views = rectified(rig)
    assert views.source_px is not None
    points_left = np.array([[0.3, -0.2, 4.0], [-1.0, 0.5, 6.0]])
    left = views.rig.left.project(points_left)
    right = views.rig.camera("right").project(se3.apply(se3.inverse(views.rig.T_left_right), points_left))
    np.testing.assert_allclose(left[:, 1], right[:, 1], atol=1e-9)
    assert (left[:, 0] > right[:, 0]).all()
    # A pixel of the view lies in the recorded picture where its ray does.
    grid = pixel_grid(views.rig.left)
    rays_body = views.rig.left.rays(grid) @ views.rig.T_body_left[:3, :3].T
    recorded = rig.left.project(rays_body @ rig.T_body_left[:3, :3])
    np.testing.assert_allclose(views.source_px["left"][100:110, 200], recorded[100:110, 200], atol=1e-6)


def test_what_lies_outside_the_recorded_picture_is_black_and_counted(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of()
    u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
    shifted = np.stack([u + 16.0, v], -1)
    shifted[0, 0] = np.nan
    views = Views(rig, {"left": shifted})
    picture = np.full((48, 64), 200, np.uint8)
    shown = views.show("left", picture)
    assert (shown[:, 48:] == 0).all()
    assert (shown[1:, :47] == 200).all()
    assert shown[0, 0] == 0
    np.testing.assert_allclose(views.dark_share("left", rig.left), (16 * 48 + 1) / (48 * 64))


def test_a_shift_by_half_a_pixel_is_the_mean_of_two(rig_of: Callable[..., Rig]) -> None:
    rig = rig_of()
    u, v = np.meshgrid(np.arange(64.0), np.arange(48.0))
    picture = np.tile(np.arange(0, 128, 2, dtype=np.uint8), (48, 1))
    shown = Views(rig, {"left": np.stack([u + 0.5, v], -1)}).show("left", picture)
    np.testing.assert_array_equal(shown[:, :63], picture[:, :63] + 1)


def test_a_pair_above_each_other_is_refused(rig_of: Callable[..., Rig]) -> None:
    with pytest.raises(SequenceError, match="so the pair cannot be rectified"):
        rectified(rig_of(T_left_right=se3.transform(np.eye(3), [-0.1, 0.0, 0.0])))


def test_a_source_has_what_was_recorded_and_none_for_the_rest(make_sequence: Make, rig_of: Callable[..., Rig]) -> None:
    made = make_sequence(rig_of(imu=True), depth=True)
    source = open_source(made.folder)
    assert source.channels == ("depth",)
    assert source.case == {"seed": 7}
    assert source.imu is not None
    assert source.rig.imu is not None
    assert replace(source, imu=None).rig.imu is None
    np.testing.assert_array_equal(source.twist, made.twist)
    plain = open_source(make_sequence(with_twist=False, case_json=b"[]").folder)
    assert plain.imu is None
    assert plain.bias is None
    assert plain.twist is None
    assert plain.case is None


def test_a_case_whose_bytes_changed_on_the_disk_is_refused_and_not_taken_for_none(make_sequence: Make) -> None:
    made = make_sequence(case_json=b'{"seed": 123456789}')
    path = made.folder / TRUTH_FILE
    data = path.read_bytes()
    assert data.count(b"123456789") == 1
    path.write_bytes(data.replace(b"123456789", b"123456780"))
    with pytest.raises(SequenceError, match=r"checksum of the attachment 'case\.json' differs from its content"):
        open_source(made.folder)


@pytest.mark.parametrize("case_json", [b'{"seed": ', b"", b'{"\xff": 7}'])
def test_a_damaged_case_is_refused_with_its_file(make_sequence: Make, case_json: bytes) -> None:
    made = make_sequence(case_json=case_json)
    with pytest.raises(SequenceError, match=r"case\.json is not JSON \(.*\): .*truth\.mcap$"):
        open_source(made.folder)


def test_png_pictures_pass_as_they_are_and_others_as_png(make_sequence: Make, rig_of: Callable[..., Rig]) -> None:
    for quality in (None, 80):
        made = make_sequence(rig_of(), jpeg_quality=quality)
        source = open_source(made.folder)
        recorded = list(source.sequence.encoded_frames())
        frames = list(png_frames(source.sequence, Views(source.rig)))
        assert [frame.t_ns for frame in frames] == made.t_ns.tolist()
        assert all(frame.pictures["right"].startswith(b"\x89PNG") for frame in frames)
        kept = [frame.pictures["left"] == old.left for frame, old in zip(frames, recorded, strict=True)]
        assert kept == [quality is None] * len(frames)
