"""Scores that other tools publish for real trajectories, found again."""

import json
from pathlib import Path

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.metric.ate import absolute_errors
from vobench.metric.rpe import relative_errors
from vobench.metric.score import ScoreSettings, score
from vobench.metric.segment import KITTI_LENGTHS_M, segment_errors
from vobench.metric.statistic import statistics
from vobench.trajectory.align import align
from vobench.trajectory.associate import associate
from vobench.trajectory.text import parse_tum
from vobench.trajectory.trajectory import Trajectory

DATA = Path(__file__).parents[2] / ".." / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="no folder ../shared/data with the published trajectories")

ALIGNMENTS = ("none", "origin", "se3", "sim3")
MOVED = [f"ape/{kind}/{part}" for kind in ALIGNMENTS for part in ("trans_part", "angle_deg")]
RELATIVE = [f"rpe/{delta}/{part}" for delta in ("f1", "f10all") for part in ("trans_part", "angle_deg")]


def read_tum(path):
    return parse_tum((DATA / path).read_text(), name=path)


def read_kitti(path):
    """Matrices as the file has them, stamped with their row."""
    rows = np.loadtxt(DATA / path).reshape(-1, 3, 4)
    return Trajectory(np.arange(len(rows)), se3.transform(rows[:, :, :3], rows[:, :, 3]))


def read_tartanair(path):
    rows = np.loadtxt(DATA / path)
    q_xyzw = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    return Trajectory(np.arange(len(rows)), se3.transform(se3.from_quaternion(q_xyzw), rows[:, :3]))


def evo_cases():
    if not DATA.is_dir():
        return []
    cases = json.loads((DATA / "evo_expected.json").read_text())["cases"]
    wanted = (*MOVED, *RELATIVE, "ape/se3/tmax0.02")
    return [pytest.param(case, id=case["id"]) for case in cases if case["id"].partition("/")[2] in wanted]


def measured(case):
    """Errors as evo's command measures them; its `f10all` counts matched poses, not frames of the truth."""
    read = read_tum if case["fmt"] == "tum" else read_kitti
    gt, est = read(case["ref"]), read(case["est"])
    _, tool, how, part = case["id"].split("/")
    pairs = associate(gt.t_ns, est.t_ns, max_diff_ns=20_000_000 if part == "tmax0.02" else 10_000_000)
    T_gt, T_est = gt.T_world_frame[pairs.gt], est.T_world_frame[pairs.est]
    if tool == "ape":
        errors = absolute_errors(T_gt, align(T_est, T_gt, kind=how).apply(T_est))
    else:
        errors = relative_errors(T_gt, T_est, np.arange(len(pairs)), delta={"f1": 1, "f10all": 10}[how])
    return np.rad2deg(errors.rot_rad) if part == "angle_deg" else errors.trans_m


@pytest.mark.parametrize("case", evo_cases())
def test_evo_finds_the_same_statistics(case):
    # No stamp of these files is wanted twice, so evo's many-to-one pairs are our one-to-one pairs.
    ours = statistics(measured(case))
    assert ours.n == case["n"]
    for name, expected in case["stats"].items():
        # A minimum near zero holds the rounding of positions and matrices of size one.
        assert getattr(ours, name) == pytest.approx(expected, rel=1e-9, abs=1e-9 if name == "min" else 0), name


def test_the_score_of_defaults_is_evo_with_se3_alignment():
    gt = read_tum("trajectories/freiburg1_xyz-groundtruth.txt")
    result = score(gt, read_tum("trajectories/freiburg1_xyz-rgbdslam.txt"))
    rmse = {metric.name: metric.statistics.rmse for metric in result.metrics}
    assert rmse["ate_trans"] == pytest.approx(0.013470088849733695, rel=1e-9)
    assert rmse["ate_rot"] == pytest.approx(2.057699602015454, rel=1e-9)
    assert rmse["rpe_trans"] == pytest.approx(0.0057643708489283196, rel=1e-9)
    assert rmse["rpe_rot"] == pytest.approx(0.35361316104479856, rel=1e-9)


def test_the_kitti_devkit_finds_the_same_segments():
    gt, est = (read_kitti(f"trajectories/KITTI_00_{name}.txt") for name in ("gt", "ORB"))
    s = segment_errors(
        gt.T_world_frame,
        est.T_world_frame,
        np.arange(len(gt)),
        gt.distances_m(),
        lengths_m=KITTI_LENGTHS_M,
        step_frames=10,
    )
    devkit = np.loadtxt(DATA / "kitti_devkit_00_ORB_segments.txt")
    devkit = devkit[np.lexsort((devkit[:, 0], devkit[:, 3]))]
    np.testing.assert_array_equal(np.stack([s.first, s.length_m], -1), devkit[:, [0, 3]])
    # The devkit sums the path in float32, which ends 4 of the 3,283 segments a frame elsewhere.
    same_end = np.abs(s.length_m / (0.1 * (s.last - s.first + 1)) - devkit[:, 4]) < 1e-5
    assert np.count_nonzero(~same_end) == 4
    # It prints six decimals, and its float32 arc cosine resolves 3.5e-4 rad.
    np.testing.assert_allclose(s.trans_ratio[same_end], devkit[same_end, 2], rtol=0, atol=1e-6)
    np.testing.assert_allclose(s.rot_radpm[same_end], devkit[same_end, 1], rtol=0, atol=2e-6)
    assert s.trans_ratio.mean() == pytest.approx(0.00699733457787, rel=2e-5)
    assert s.rot_radpm.mean() == pytest.approx(4.42183086317e-05, rel=7e-4)


def test_tartanairs_evaluator_finds_the_same_scores_without_scale():
    gt, est = (read_tartanair(f"trajectories/tartanair/pose_{name}.txt") for name in ("gt", "est"))
    lengths = tuple(float(length) for length in range(5, 45, 5))
    result = score(gt, est, settings=ScoreSettings(max_diff_ns=0))
    assert result.metric("ate_trans").statistics.rmse == pytest.approx(1.204507439280004, rel=1e-12)
    s = segment_errors(gt.T_world_frame, est.T_world_frame, np.arange(len(gt)), gt.distances_m(), lengths_m=lengths)
    of_length = [s.rot_radpm[s.length_m == length].mean() for length in lengths]
    assert np.rad2deg(np.mean(of_length)) == pytest.approx(0.07987194481751003, rel=1e-12)
