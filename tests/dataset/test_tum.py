from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from vobench.dataset.export import export
from vobench.dataset.tum import DEPTH_PER_M, FARTHEST_M, depth_values
from vobench.geometry.rig import Rig

Make = Callable[..., Any]


def test_depth_is_in_steps_of_a_fifth_of_a_millimetre_and_0_where_unknown() -> None:
    depth_m = np.array([[0.0002, 1.0, 2.00009, FARTHEST_M, FARTHEST_M + 1e-3, np.nan, np.inf, -1.0]], np.float32)
    assert depth_values(depth_m).tolist() == [[1, 5000, 10000, 65535, 0, 0, 0, 0]]


def test_depth_pictures_hold_the_true_depth(rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence(rig_of(), depth=True)
    export(made.folder, tmp_path / "out", "tum")
    lines = [line.split() for line in (tmp_path / "out/depth.txt").read_text().splitlines() if line[0] != "#"]
    assert len(lines) == len(made.t_ns)
    for (_, name), depth_m in zip(lines, made.depth_m, strict=True):
        stored = cv2.imread(str(tmp_path / "out" / name), cv2.IMREAD_UNCHANGED)
        assert stored.dtype == np.uint16
        near = depth_m <= FARTHEST_M
        assert np.abs(stored[near] / DEPTH_PER_M - depth_m[near]).max() <= 0.5001 / DEPTH_PER_M
        assert not stored[~near].any()


def test_what_an_imu_felt_is_there_with_every_digit(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(rig_of(imu=True))
    export(made.folder, tmp_path / "out", "tum")
    rows = [line.split() for line in (tmp_path / "out/imu.txt").read_text().splitlines() if line[0] != "#"]
    np.testing.assert_array_equal([int(row[0].replace(".", "")) for row in rows], made.imu.t_ns)
    values = np.array([row[1:] for row in rows], float)
    np.testing.assert_array_equal(values, np.hstack([made.imu.gyro_radps, made.imu.accel_mps2]))
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "out/accelerometer.txt")[:, 1:], made.imu.accel_mps2)
