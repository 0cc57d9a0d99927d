"""Scores that other tools publish for real trajectories, found again."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.metric.score import ScoreSettings, score
from vobench.metric.segment import devkit_distances, mean_drift, segment_errors
from vobench.metric.settings import KITTI_LENGTHS_M, LIKE
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import parse_tum

DATA = Path(__file__).parents[2] / ".." / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="no folder ../shared/data with the published trajectories")


@cache
def read_tum(path):
    return parse_tum((DATA / path).read_text(), name=path)


@cache
def read_kitti(path):
    """Matrices as the file has them, stamped with their row."""
    rows = np.loadtxt(DATA / path).reshape(-1, 3, 4)
    return Trajectory(np.arange(len(rows)) * 10**8, se3.transform(rows[:, :, :3], rows[:, :, 3]))


def read_tartanair(name):
    rows = np.loadtxt(DATA / "trajectories" / "tartanair" / f"pose_{name}.txt")
    q_xyzw = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    return se3.transform(se3.from_quaternion(q_xyzw), rows[:, :3])


def evo_cases():
    if not DATA.is_dir():
        return []
    cases = json.loads((DATA / "evo_expected.json").read_text())["cases"]
    return [pytest.param(case, id=case["id"]) for case in cases]


@pytest.mark.parametrize("case", evo_cases())
def test_evo_finds_the_same_statistics(asked_of_evo, case):
    settings, metric = asked_of_evo(case["tool"], case["flags"])
    read = read_tum if case["fmt"] == "tum" else read_kitti
    gt, est = read(case["ref"]), read(case["est"])
    ours = score(gt, est, settings=settings).metric(metric).statistics
    assert ours.n == case["n"]
    for name, expected in case["stats"].items():
        # A minimum near zero holds the rounding of positions and matrices of size one.
        assert getattr(ours, name) == pytest.approx(expected, rel=1e-9, abs=1e-9 if name == "min" else 0), name


def test_every_published_case_is_among_them():
    assert len(evo_cases()) == len(json.loads((DATA / "evo_expected.json").read_text())["cases"])


def test_the_score_of_defaults_is_evo_with_se3_alignment():
    gt = read_tum("trajectories/freiburg1_xyz-groundtruth.txt")
    result = score(gt, read_tum("trajectories/freiburg1_xyz-rgbdslam.txt"))
    rmse = {metric.name: metric.statistics.rmse for metric in result.metrics}
    assert rmse["ate_trans"] == pytest.approx(0.013470088849733695, rel=1e-9)
    assert rmse["ate_rot"] == pytest.approx(2.057699602015454, rel=1e-9)
    assert rmse["rpe_trans"] == pytest.approx(0.0057643708489283196, rel=1e-9)
    assert rmse["rpe_rot"] == pytest.approx(0.35361316104479856, rel=1e-9)


def test_tums_own_scripts_find_the_same():
    gt = read_tum("trajectories/freiburg1_xyz-groundtruth.txt")
    result = score(gt, read_tum("trajectories/freiburg1_xyz-rgbdslam.txt"), settings=LIKE["tum"])
    found = {m.name: m.statistics for m in result.metrics}
    assert (found["ate_trans"].n, found["rpe_trans"].n, found["rpe_rot"].n) == (786, 753, 753)
    assert f"{found['ate_trans'].rmse:.6f}" == "0.013473"
    assert f"{found['rpe_trans'].rmse:.6f}" == "0.021217"
    assert f"{found['rpe_rot'].rmse:.6f}" == "0.934480"


def test_the_kitti_devkit_finds_the_same_segments_to_the_printed_digits():
    gt, est = (read_kitti(f"trajectories/KITTI_00_{name}.txt") for name in ("gt", "ORB"))
    s = segment_errors(
        gt.T_world_frame,
        est.T_world_frame,
        np.arange(len(gt)),
        devkit_distances(gt.positions_m),
        lengths_m=KITTI_LENGTHS_M,
        step_frames=10,
        precision="devkit",
    )
    speed_mps = (s.length_m / (0.1 * (s.last - s.first + 1))).astype(np.float32)
    rows = zip(s.first, s.rot_radpm, s.trans_ratio, s.length_m, speed_mps, strict=True)
    printed = (DATA / "kitti_devkit_00_ORB_segments.txt").read_text().splitlines()
    assert [f"{first} {r:f} {t:f} {length:f} {speed:f}" for first, r, t, length, speed in rows] == printed
    assert f"{mean_drift(s.trans_ratio, s.length_m):.8g}" == "0.0069973371"
    assert f"{mean_drift(s.rot_radpm, s.length_m):.7g}" == "4.421829e-05"


def test_like_kitti_quotes_the_devkits_means_and_float64_is_close():
    gt, est = (read_kitti(f"trajectories/KITTI_00_{name}.txt") for name in ("gt", "ORB"))
    devkit, ours = (score(gt, est, settings=settings) for settings in (LIKE["kitti"], ScoreSettings()))
    t_rel, r_rel = (devkit.metric(name).statistics for name in ("kitti_t_rel", "kitti_r_rel"))
    assert (t_rel.n, r_rel.n) == (3283, 3283)
    assert t_rel.mean == pytest.approx(0.0069973371, rel=1e-8)
    assert np.deg2rad(r_rel.mean) == pytest.approx(4.421829e-05, rel=2e-7)
    # In float64 4 of 3,283 segments end a frame elsewhere, and no angle is rounded.
    assert ours.metric("kitti_t_rel").statistics.mean == pytest.approx(t_rel.mean, rel=2e-5)
    assert ours.metric("kitti_r_rel").statistics.mean == pytest.approx(r_rel.mean, rel=7e-4)


@pytest.mark.parametrize(("like", "ate_m"), [("tartanair", 1.204507439280004), ("tartanair_mono", 0.8344983411575012)])
def test_tartanairs_evaluator_finds_the_same_absolute_errors(like, ate_m):
    t_ns = np.arange(734) * 10**9
    result = score(Trajectory(t_ns, read_tartanair("gt")), Trajectory(t_ns, read_tartanair("est")), settings=LIKE[like])
    assert result.metric("ate_trans").statistics.rmse == pytest.approx(ate_m, rel=1e-12)


def test_tartanairs_evaluator_finds_the_same_drift_and_a_sample_of_our_motions():
    t_ns = np.arange(734) * 10**9
    gt, est = (Trajectory(t_ns, read_tartanair(name)) for name in ("gt", "est"))
    result = score(gt, est, settings=LIKE["tartanair_mono"])
    assert result.metric("kitti_r_rel").statistics.mean == pytest.approx(0.07987194481751003, rel=1e-12)
    assert result.metric("kitti_t_rel").statistics.mean == pytest.approx(0.05710317871475973, rel=1e-12)
    # Theirs are means over 10,000 random pairs of frames, ours over all: rotation in rad, translation in m.
    for name, theirs in (("rpe_rot", np.rad2deg(0.030297256815805043)), ("rpe_trans", 1.2416853348984116)):
        ours = result.metric(name).statistics
        assert ours.n == 734**2
        assert abs(ours.mean - theirs) < 3 * ours.std / np.sqrt(10_000)
