"""The matrices of a calib.txt."""

import numpy as np
import pytest

from vobench.dataset.kitti_calibration import format_calibration, read_pair
from vobench.dataset.layout import read
from vobench.errors import InputError, VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig


def test_a_matrix_that_is_not_rectified_is_refused(scene, tmp_path):
    folder = scene.kitti(tmp_path)
    (folder / "calib.txt").write_text("P0: 40 3 23 0 0 40 15 0 0 0 1 0\nP1: 40 0 23 -20 0 40 15 0 0 0 1 0\n")
    with pytest.raises(VobenchError, match=r"calib\.txt: P0 should be a rectified camera"):
        read(folder)


def test_a_matrix_that_occurs_twice_is_refused_with_both_lines(scene, tmp_path):
    path = scene.kitti(tmp_path) / "calib.txt"
    path.write_text(path.read_text() + "P1: 40 0 23 -80 0 40 15 0 0 0 1 0\n")
    with pytest.raises(VobenchError, match=r"calib\.txt:6: P1 should occur once, but is also in line 2"):
        read(path.parent)


def test_the_text_of_a_pair_is_read_back(tmp_path):
    path = tmp_path / "calib.txt"
    camera = Pinhole(48, 32, 40.5, 41.25, 23.5, 15.75)
    T_body_right = se3.transform(np.eye(3), [0.54, 0.0, 0.0])
    path.write_text(format_calibration(Rig(camera, camera, np.eye(4), T_body_right)))
    rig = read_pair(path, size_px=(48, 32))
    assert rig.left == rig.right == camera
    np.testing.assert_allclose(rig.T_body_right, T_body_right, atol=1e-15)


def test_the_first_pair_is_preferred_and_half_a_pair_is_none(tmp_path):
    path = tmp_path / "calib.txt"
    lines = {name: f"{name}: 700 0 620 {x} 0 700 188 0 0 0 1 0\n" for name, x in (("P0", 0), ("P1", -350), ("P2", 70))}
    path.write_text("".join(lines.values()))
    assert read_pair(path).baseline_m == pytest.approx(0.5)
    path.write_text(lines["P0"] + lines["P2"])
    with pytest.raises(InputError, match="a pair needs P0 and P1, or P2 and P3; the file has P0, P2"):
        read_pair(path)


def test_an_assumed_size_must_fit_the_principal_point(tmp_path):
    path = tmp_path / "calib.txt"
    path.write_text("P0: 40 0 24 0 0 40 16 0 0 0 1 0\nP1: 40 0 24 -20 0 40 16 0 0 0 1 0\n")
    with pytest.raises(InputError, match=r"P0 has its principal point at .*24.*16.*1241 x 376; pass size_px"):
        read_pair(path)
    assert read_pair(path, size_px=(48, 32)).left.width_px == 48
