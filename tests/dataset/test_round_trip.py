"""A sequence that leaves in somebody else's layout and comes back is the same sequence."""

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vobench.dataset.export import export
from vobench.dataset.layout import read, writable
from vobench.dataset.read_back import pixel_difference
from vobench.dataset.rectified_view import rectified
from vobench.dataset.sequence import convert
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, DoubleSphere, KannalaBrandt
from vobench.geometry.rig import PRESETS, ImuCalibration, Rig, looking
from vobench.sequence import Sequence, read_truth

Make = Callable[..., Any]
LENSES = {
    "radtan": BrownConrady(64, 48, 40.1, 40.3, 31.7, 23.9, -0.2834, 0.0739, 1.9e-4, 1.76e-5),
    "radtan with k3": BrownConrady(64, 48, 40.1, 40.3, 31.7, 23.9, -0.058, 0.032, 5e-4, -9e-4, -0.012),
    "equidistant": KannalaBrandt(64, 48, 23.9, 23.8, 31.8, 24.1, 0.0034, 0.0007, -0.002, 0.0002),
    "double sphere": DoubleSphere(64, 48, 19.6, 19.7, 31.8, 24.1, -0.18, 0.59),
}
# The world in which KITTI's first camera looks along x.
LEVEL = looking(pitch_deg=0.0, position_m=(0.0, 0.0, 0.0))
CROOKED = PRESETS["euroc"].T_left_right


def there_and_back(folder: Path, form: str, out: Path) -> Path:
    """The sequence that an export of this one makes when it is imported again."""
    exported = export(folder, out / form, form)
    convert(read(out / form), out / "back")
    assert exported.form == form
    return out / "back"


def left_path(folder: Path, rig: Rig) -> tuple[np.ndarray, np.ndarray]:
    truth = read_truth(folder).of_mounted(rig.T_body_left)
    return truth.t_ns, truth.T_world_frame


def check_pictures(before: Path, after: Path, *, right: bool) -> None:
    for old, new in zip(Sequence.open(before).frames(), Sequence.open(after).frames(), strict=True):
        assert new.t_ns == old.t_ns
        np.testing.assert_array_equal(new.left, old.left)
        assert (new.right is not None) == right
        if new.right is not None:
            np.testing.assert_array_equal(new.right, old.right)


@pytest.mark.parametrize("form", writable())
@pytest.mark.parametrize("stereo", [True, False], ids=["two cameras", "one camera"])
def test_a_rectified_recording_comes_back_bit_for_bit(
    form: str, stereo: bool, make_sequence: Make, rig_of: Callable[..., Rig], tmp_path: Path
) -> None:
    made = make_sequence(rig_of(stereo=stereo))
    back = there_and_back(made.folder, form, tmp_path)
    rig = Sequence.open(back).rig
    check_pictures(made.folder, back, right=stereo and form != "tum")
    t_ns, T_world_left = left_path(back, rig)
    np.testing.assert_array_equal(t_ns, made.t_ns)
    since_start = se3.inverse(made.T_world_left[:1]) @ made.T_world_left
    expected = LEVEL @ since_start if form == "kitti" else made.T_world_left
    np.testing.assert_allclose(T_world_left, expected, atol=1e-9, rtol=0)
    told = replace(made.rig, right=None, T_body_right=None) if form == "tum" else made.rig
    assert pixel_difference(told, rig) < 1e-6


@pytest.mark.parametrize("form", ["euroc", "ros2", "tum"])
@pytest.mark.parametrize("lens", sorted(LENSES))
def test_a_bent_lens_comes_back_with_its_pixels_as_they_were(
    form: str, lens: str, make_sequence: Make, rig_of: Callable[..., Rig], tmp_path: Path
) -> None:
    made = make_sequence(rig_of(LENSES[lens], T_left_right=CROOKED))
    back = there_and_back(made.folder, form, tmp_path)
    rig = Sequence.open(back).rig
    assert type(rig.left) is type(made.rig.left)
    told = replace(made.rig, right=None, T_body_right=None) if form == "tum" else made.rig
    assert pixel_difference(told, rig) < 1e-6
    check_pictures(made.folder, back, right=form != "tum")
    np.testing.assert_allclose(left_path(back, rig)[1], made.T_world_left, atol=1e-9, rtol=0)


@pytest.mark.parametrize("lens", ["radtan", "equidistant", "double sphere"])
def test_a_rectified_kitti_pair_comes_back_as_the_pair_that_was_written(
    lens: str, make_sequence: Make, rig_of: Callable[..., Rig], tmp_path: Path
) -> None:
    made = make_sequence(rig_of(LENSES[lens], T_left_right=CROOKED))
    back = there_and_back(made.folder, "kitti", tmp_path)
    rig, views = Sequence.open(back).rig, rectified(made.rig)
    assert pixel_difference(views.rig, rig) < 1e-6
    for index, frame in enumerate(Sequence.open(back).frames()):
        np.testing.assert_array_equal(frame.left, views.show("left", made.left[index]))
        assert frame.right is not None
        np.testing.assert_array_equal(frame.right, views.show("right", made.right[index]))
    T_world_view = made.T_world_body @ views.rig.T_body_left
    since_start = se3.inverse(T_world_view[:1]) @ T_world_view
    np.testing.assert_allclose(left_path(back, rig)[1], LEVEL @ since_start, atol=1e-9, rtol=0)


@pytest.mark.parametrize("form", ["euroc", "ros2"])
@pytest.mark.parametrize("stereo", [True, False], ids=["two cameras", "one camera"])
def test_an_imu_comes_back_with_every_reading(
    form: str, stereo: bool, make_sequence: Make, rig_of: Callable[..., Rig], tmp_path: Path
) -> None:
    made = make_sequence(rig_of(stereo=stereo, imu=True))
    back = there_and_back(made.folder, form, tmp_path)
    before, after = Sequence.open(made.folder), Sequence.open(back)
    assert before.rig.imu
    assert after.rig.imu
    old, new = before.imu(), after.imu()
    assert len(old.t_ns) > 30
    np.testing.assert_array_equal(new.t_ns, old.t_ns)
    np.testing.assert_array_equal(new.gyro_radps, old.gyro_radps)
    np.testing.assert_array_equal(new.accel_mps2, old.accel_mps2)
    T_left_imu = [se3.inverse(s.rig.T_body_left) @ s.rig.imu.T_body_imu for s in (before, after) if s.rig.imu]
    np.testing.assert_allclose(T_left_imu[1], T_left_imu[0], atol=1e-12)
    for each in fields(ImuCalibration):
        if each.name != "T_body_imu":
            assert getattr(after.rig.imu, each.name) == getattr(before.rig.imu, each.name)


@pytest.mark.parametrize("form", ["euroc", "ros2"])
def test_the_body_is_where_it_was(form: str, make_sequence: Make, rig_of: Callable[..., Rig], tmp_path: Path) -> None:
    for index, imu in enumerate((False, True)):
        made = make_sequence(rig_of(imu=imu))
        back = there_and_back(made.folder, form, tmp_path / str(index))
        np.testing.assert_allclose(read_truth(back).T_world_frame, made.T_world_body, atol=1e-9, rtol=0)
        np.testing.assert_allclose(Sequence.open(back).rig.T_body_left, made.rig.T_body_left, atol=1e-9, rtol=0)


@pytest.mark.parametrize("form", writable())
@pytest.mark.parametrize("start_ns", [0, 999_999_999, 2_147_483_600_123_456_789])
def test_stamps_come_back_to_the_nanosecond(form: str, start_ns: int, make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence(count=3, start_ns=start_ns)
    back = there_and_back(made.folder, form, tmp_path)
    np.testing.assert_array_equal(Sequence.open(back).frame_stamps(), made.t_ns)
    np.testing.assert_array_equal(read_truth(back).t_ns, made.t_ns)


@pytest.mark.parametrize("form", ["euroc", "ros2", "tum"])
def test_truth_at_its_own_rate_comes_back_at_its_own_stamps(form: str, make_sequence: Make, tmp_path: Path) -> None:
    t_ns = make_sequence().t_ns
    dense = np.arange(t_ns[0] - 3, t_ns[-1] + 7_000_000, 7_000_001)
    made = make_sequence(truth_ns=dense)
    back = there_and_back(made.folder, form, tmp_path)
    found = read_truth(back)
    kept = np.isin(dense, found.t_ns)
    assert kept.sum() == len(found) >= len(dense) - 1, "readers may cut what lies outside the images' time"
    poses = found.of_mounted(Sequence.open(back).rig.T_body_left).T_world_frame
    np.testing.assert_allclose(poses, made.T_world_left[kept], atol=1e-9, rtol=0)
