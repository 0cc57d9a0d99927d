"""A path is exported as what it is: a sequence, a file of one, or a trajectory."""

import numpy as np
import pytest

from vobench.dataset.conversion import convert
from vobench.errors import InputError
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum


@pytest.fixture
def trajectory_file(tmp_path):
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[:, 0, 3] = [0.0, 0.5, 1.25]
    path = tmp_path / "truth.tum"
    path.write_text(format_tum(Trajectory(np.array([0, 10**9, 3 * 10**9]), poses)))
    return path


def test_a_trajectory_in_kittis_form_has_a_second_file_with_its_stamps(trajectory_file, tmp_path):
    conversion = convert(trajectory_file, tmp_path / "poses.txt", "kitti")
    assert conversion.file_count == 2
    assert conversion.notes == ("Poses in KITTI's form have no stamps; the stamps are in poses.times.txt.",)
    assert (tmp_path / "poses.times.txt").read_text().split() == ["0.000000000", "1.000000000", "3.000000000"]


def test_other_forms_lose_nothing(trajectory_file, tmp_path):
    conversion = convert(trajectory_file, tmp_path / "copy.tum", "tum")
    assert (conversion.file_count, conversion.notes) == (1, ())
    assert (tmp_path / "copy.tum").read_text() == trajectory_file.read_text()


def test_a_folder_that_is_no_sequence_gets_the_remedy(tmp_path):
    with pytest.raises(InputError, match=r"has no sensors\.mcap.*vobench import creates one"):
        convert(tmp_path, tmp_path / "out", "euroc")
