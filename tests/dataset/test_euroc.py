from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm

from vobench.dataset.euroc import point_velocity
from vobench.dataset.export import export
from vobench.geometry import se3
from vobench.geometry.rig import Rig
from vobench.trajectory.trajectory import Trajectory

Make = Callable[..., Any]


def test_a_velocity_is_the_derivative_of_the_position_of_its_point() -> None:
    twist = np.array([0.7, -0.2, 0.1, 0.3, -0.5, 0.9])  # constant in body axes
    w = twist[3:]
    generator = np.zeros((4, 4))
    generator[:3, :3] = [[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]]
    generator[:3, 3] = twist[:3]
    lever_m, half_s = np.array([0.3, -0.1, 0.2]), 1e-4
    T = np.stack([expm(generator * s) for s in (1 - half_s, 1.0, 1 + half_s)])
    path = Trajectory(np.array([1, 2, 3]), T)
    places = path.of_mounted(se3.transform(np.eye(3), lever_m)).positions_m
    slope = (places[2] - places[0]) / (2 * half_s)
    np.testing.assert_allclose(point_velocity(path, np.tile(twist, (3, 1)), lever_m)[1], slope, atol=1e-7)


def test_the_euroc_truth_has_velocity_and_biases_only_where_they_were_recorded(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    widths = []
    for index, (imu, with_twist) in enumerate([(True, True), (False, True), (True, False)]):
        made = make_sequence(rig_of(imu=imu), with_twist=with_twist)
        export(made.folder, tmp_path / f"out{index}", "euroc")
        rows = (tmp_path / f"out{index}/mav0/state_groundtruth_estimate0/data.csv").read_text().splitlines()
        assert len({row.count(",") for row in rows}) == 1, "the header has as many columns as the rows"
        widths.append(rows[1].count(",") + 1)
        if index == 0:
            biases = np.array([row.split(",")[11:] for row in rows[1:]], float)
            np.testing.assert_array_equal(biases, made.twist * np.repeat([1e-2, 1e-1], 3))
    assert widths == [17, 11, 8]
