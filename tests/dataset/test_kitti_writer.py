"""A sequence exported in KITTI's layout: the frames within the truth, and their poses."""

import numpy as np
import pytest

from vobench.dataset.export import export

START_NS = 1_403_636_579_763_555_584  # of make_sequence: its pictures are about 50 ms apart


@pytest.mark.parametrize("offsets_ns", [[60_000_000], [60_000_000, 80_000_000], [-2, -1], [1_000_000_000]])
def test_pictures_that_all_lie_outside_of_the_truth_are_exported_without_poses(make_sequence, tmp_path, offsets_ns):
    made = make_sequence(truth_ns=START_NS + np.array(offsets_ns))
    exported = export(made.folder, tmp_path / "out", "kitti")
    assert "No image lies within the time span of the truth, so there is no poses.txt." in exported.notes
    assert not any("interpolated" in note or "frames lie before" in note for note in exported.notes)
    assert not (tmp_path / "out" / "poses.txt").exists()
    assert len((tmp_path / "out" / "times.txt").read_text().splitlines()) == len(made.t_ns)


def test_a_single_true_pose_at_a_picture_is_exported_with_that_picture_alone(make_sequence, tmp_path):
    t_ns = make_sequence().t_ns
    made = make_sequence(truth_ns=t_ns[2:3])
    exported = export(made.folder, tmp_path / "out", "kitti")
    assert f"4 of {len(t_ns)} frames lie before or after the truth and were left out." in exported.notes
    assert len((tmp_path / "out" / "poses.txt").read_text().splitlines()) == 1
