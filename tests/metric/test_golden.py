"""Figures of other tools for a pair of trajectories that is made here from a seed, found again without any data.

evo's are of evo 1.38.1: `evo_ape FORM gt est FLAGS --save_results`, likewise `evo_rpe`, on the pair as `format_tum` and
`format_kitti` write it; each row has the command, the number of errors and rmse, mean, median, std, min, max, sse.
KITTI's and rpg's are of independent programs in scalar loops, word for word after the devkit's evaluate_odometry.cpp
(float32, one sum after the other) and rpg_trajectory_evaluation's compute_trajectory_errors.py (sim3 of all poses).
"""

# ruff: noqa: E501 - a command and its figures stand in one line

from dataclasses import replace

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.metric.score import ScoreSettings, score
from vobench.metric.settings import LIKE
from vobench.trajectory.trajectory import Trajectory

STATISTICS = ("rmse", "mean", "median", "std", "min", "max", "sse")
# fmt: off
EVO = [
    ('ape tum', 660, [274.9502401533647, 234.57688083205898, 237.68633951080767, 143.42705999739, 2.9312850610770353, 488.2129992471503, 49894438.80985933]),
    ('ape tum -a', 660, [5.4980304903867845, 4.752590970507549, 4.709374730033945, 2.7642753734519396, 0.21400175556786752, 12.349816573373081, 19950.70392032701]),
    ('ape tum -a -s -r angle_deg', 660, [2.519047878337816, 2.3347067884915003, 2.0145450091291233, 0.9459103684440487, 0.9616404895215606, 4.321639445215255, 4188.097460816446]),
    ('ape tum --align_origin -r full', 660, [33.78422614006745, 25.193969462450884, 20.322952832143258, 22.508616985685943, 9.374983073986135e-16, 74.30722839618316, 753306.7976829234]),
    ('ape kitti -a -r rot_part', 700, [0.0622802590567775, 0.05740315425362685, 0.05096157423282737, 0.024160061049460054, 0.021872110834209757, 0.10828797155586632, 2.715181467725521]),
    ('ape tum -a --project_to_plane xy', 660, [5.490995225463714, 4.74530574497604, 4.7022785954934125, 2.762806897479933, 0.2056151124319047, 12.348556294848363, 19899.6788536031]),
    ('rpe tum', 659, [0.10817539268371346, 0.07010692607583463, 0.05851108533445579, 0.08238285318240116, 0.00446082916918083, 1.9459153201518262, 7.711562368719625]),
    ('rpe tum -a -s -r angle_deg -d 10 -u m', 93, [0.1569223174927201, 0.12779070458110275, 0.11109616234862302, 0.09107222161532773, 0.036535984129922795, 0.6163186040001208, 2.290089076637602]),
    ('rpe tum -d 5 -u m --all_pairs', 444, [0.2216363223986766, 0.19232138511967892, 0.18366973278815124, 0.11015963068228875, 0.014238872038477922, 0.5424073358068466, 21.81046077644609]),
    ('rpe tum -d 3 -u d -r angle_deg --pairs_from_reference', 223, [0.09924323155645395, 0.07578581022659296, 0.06079257051212846, 0.06407597036383278, 0.005737891464496039, 0.6228490425050864, 2.19637583917825]),
    ('rpe kitti -d 20 -u f --all_pairs -r full', 680, [1.299046256444915, 1.137877056581467, 1.1525045453181324, 0.6267032635059787, 0.10572719625913186, 2.3247537061657844, 1147.5143999408124]),
]
# fmt: on
KITTI_T_REL, KITTI_R_REL = 0.0475650392472744, 8.767291001277044e-05
RPG = {
    "rel_trans": 14.641506072768296,
    "rel_trans_percent": 4.66259016390785,
    "rel_rot": 1.4358162197296371,
    "rel_yaw": 1.1069099329521215,
    "rel_gravity": 0.8502862308745001,
}


def drive_pair(*, whole=False):
    """A kilometre with hills and turns at 10 Hz, and an estimate that drifts, whose clock is 3 ms late, with gaps."""
    rng = np.random.default_rng(2024)
    n = 700
    yaw = np.cumsum(rng.normal(scale=0.03, size=n))
    axes = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    R = se3.rotation_z(yaw) @ axes @ se3.rotation_z(0.1 * np.sin(0.05 * np.arange(n))) @ axes.T
    steps_m = rng.uniform(1.0, 2.0, n)[:, None] * R[:, :, 0] + [0.0, 0.0, 0.05]
    T_gt = se3.transform(R, np.cumsum(steps_m, axis=0))
    wrong = axes @ se3.rotation_z(np.cumsum(rng.normal(scale=1e-3, size=n))) @ axes.T
    drift_m = np.cumsum(rng.normal(scale=0.02, size=(n, 3)), axis=0)
    T_est = se3.transform(se3.rotation_z(0.4 + 1e-4 * np.arange(n)) @ wrong, 1.02 * drift_m) @ T_gt
    t_ns = np.arange(n, dtype=np.int64) * 10**8
    kept = np.arange(n) if whole else np.r_[4:300, 330:500, 501:695]
    return Trajectory(t_ns, T_gt), Trajectory(t_ns[kept] + (0 if whole else 3_000_000), T_est[kept])


@pytest.mark.parametrize(("command", "n", "figures"), EVO, ids=[row[0] for row in EVO])
def test_evo_finds_the_same_statistics(asked_of_evo, command, n, figures):
    tool, form, *flags = command.split(maxsplit=2)
    settings, name = asked_of_evo(tool, "".join(flags))
    metric = score(*drive_pair(whole=form == "kitti"), settings=settings).metric(name)
    assert metric.statistics.n == n
    for name, expected in zip(STATISTICS, figures, strict=True):
        found = getattr(metric.statistics, name)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 if name == "min" else 0), name


def test_the_kitti_devkit_finds_the_same_means_to_every_digit_of_float32():
    found = score(*drive_pair(whole=True), settings=LIKE["kitti"])
    t_rel, r_rel = (found.metric(name).statistics for name in ("kitti_t_rel", "kitti_r_rel"))
    assert (t_rel.n, t_rel.mean) == (328, KITTI_T_REL)
    assert r_rel.mean == pytest.approx(np.rad2deg(KITTI_R_REL), rel=1e-6)
    exact = score(*drive_pair(whole=True), settings=replace(LIKE["kitti"], segment_precision="float64"))
    assert exact.metric("kitti_t_rel").statistics.mean != t_rel.mean


def test_rpg_finds_the_same_relative_errors():
    found = score(*drive_pair(whole=True), settings=LIKE["rpg"])
    assert found.alignment.scale == pytest.approx(1.0004466258579676, rel=1e-12)
    for name, mean in RPG.items():
        statistics = found.metric(name).statistics
        assert (statistics.n, statistics.mean) == (2659, pytest.approx(mean, rel=1e-9)), name


def test_the_defaults_are_evos_with_an_alignment_and_pairs_of_the_truth():
    found = score(*drive_pair(), settings=ScoreSettings())
    assert found.metric("ate_trans").statistics.rmse == pytest.approx(EVO[1][2][0], rel=1e-9)
    assert found.metric("rpe_trans").statistics.rmse == pytest.approx(EVO[6][2][0], rel=1e-9)
