"""Covariances that an estimator states are kept and held against its errors; poses of afterwards are a second track."""

import numpy as np
import pytest
from scipy.stats import chi2

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.report import page
from vobench.report.verify import verify_run
from vobench.runner.consistency import (
    COVARIANCE,
    HEAD,
    MEDIAN,
    NINETY_PERCENT,
    CovarianceConsistency,
    format_covariances,
    read_covariances,
    trial_consistency,
)
from vobench.runner.estimate import REVISED
from vobench.runner.folder import value_of
from vobench.trajectory.trajectory import Trajectory

ESTIMATORS = "[wheel_odometry, stand_still]"
NOISY = "{{name: noisy_truth, label: {}, params: {{position_m: {}, rotation_rad: {}, stated: {}}}}}"
LEVELS = [("fine", 0.001, 0.0005, 1.0), ("middling", 0.004, 0.002, 1.0), ("coarse", 0.02, 0.01, 1.0)]


def noisy(*levels):
    return f"[{', '.join(NOISY.format(*level) for level in levels)}]"


def mean_nees(found):
    return np.average([each.nees_mean for each in found], weights=[each.poses for each in found])


def board_of(run):
    return page.run_board(run, run.scores())


def test_the_quantiles_are_those_of_the_law():
    assert pytest.approx([chi2.median(6), chi2.ppf(0.9, 6)], rel=1e-6) == [MEDIAN, NINETY_PERCENT]


@pytest.mark.slow
def test_an_honest_covariance_is_within_its_band_over_20_repeats_and_a_tenth_of_it_is_named(bench, first):
    honest, bold, shy = ("honest", 0.005, 0.002, 1.0), ("bold", 0.005, 0.002, 0.1), ("shy", 0.005, 0.002, 10.0)
    run = bench.run((ESTIMATORS, noisy(honest, bold, shy)), ("seed: 1\n", "seed: 1\nrepeats: 20\n"))
    found = {name: [s.consistency for s in run.scores() if s.estimator == name] for name in ("honest", "bold", "shy")}
    poses = sum(each.poses for each in found["honest"])
    assert poses == sum(s.frames for s in run.scores() if s.estimator == "honest")
    low, high = chi2.ppf([0.025, 0.975], 6 * poses) / poses
    mean = {name: mean_nees(each) for name, each in found.items()}
    assert low < mean["honest"] < high
    assert [mean["bold"], mean["shy"]] == pytest.approx([10 * mean["honest"], mean["honest"] / 10], rel=1e-9)
    said = {cell.estimator: cell.consistency for cell in board_of(run).cells}
    assert said["honest"].startswith("claims what it holds: errors are ")
    assert said["bold"].startswith("claims too much: errors are ")
    assert said["shy"].startswith("claims too little: errors are ")
    assert "bold: claims too much" in (run.path / "leaderboard.md").read_text()
    gaps = {cell.estimator: cell.scale_gap for cell in board_of(run).cells}
    assert gaps["bold"] == pytest.approx(10**0.5, rel=0.2)


def test_a_board_orders_the_levels_of_noise_and_marks_the_oracle(bench, first):
    run = bench.run((ESTIMATORS, noisy(*LEVELS[::-1])))
    assert [total.estimator for total in board_of(run).totals] == ["fine", "middling", "coarse"]
    assert "| fine [oracle] |" in (run.path / "leaderboard.md").read_text()
    assert [finding for finding in verify_run(run) if finding.wrong] == []


@pytest.mark.slow
def test_a_covariance_of_the_body_becomes_the_cameras(bench, first, plugin):
    """The body's poses with noise, said to have its covariance: as honest as if the camera's were given."""
    folder = plugin(
        "e = self.drawn.normal(0, 1, 6) * self.sigma; R = Rotation.from_rotvec(e[3:]).as_matrix(); "
        "return Result(se3.transform(R, e[:3]), covariance=np.diag(self.sigma**2))",
        head="from scipy.spatial.transform import Rotation\nfrom vobench.geometry import se3",
    )
    code = (folder / "estimator.py").read_text()
    drawn = "self.drawn, self.sigma = np.random.default_rng(seed), np.array([1e-3, 2e-3, 1e-3, 0.01, 0.005, 0.01])"
    (folder / "estimator.py").write_text(code.replace("seed): ...", f"seed):\n        {drawn}"))
    manifest = (folder / "estimator.yaml").read_text()
    (folder / "estimator.yaml").write_text(manifest.replace("left_camera", "body"))
    still = ("{short: {targets_m: [[0.3, 0]], tolerance_m: 0.03, rate_hz: 5}}", STILL)
    lit = ("lightings: {full: {}, dim: {lamp: {power_lm: 150}}}", "lightings: {full: {}}")
    run = bench.run((ESTIMATORS, f"[{folder}]"), still, lit, ("seed: 1\n", "seed: 1\nrepeats: 10\n"))
    found = [score.consistency for score in run.scores()]
    poses = sum(each.poses for each in found)
    low, high = chi2.ppf([0.005, 0.995], 6 * poses) / poses
    assert low < mean_nees(found) < high


POSES = ", ".join(f"{{t_s: {t}, position_m: [0, 0, 0]}}" for t in (0, 1, 2))
STILL = f"{{still: {{kind: pose_spline, rate_hz: 5, poses: [{POSES}]}}}}"


def test_poses_of_afterwards_are_a_second_track(bench, first, plugin):
    folder = plugin("return Result(np.eye(4))")
    with (folder / "estimator.py").open("a") as file:
        file.write("    def finish(self):\n        T = np.eye(4); T[2, 3] = 0.1\n        return {0: np.eye(4), 1: T}\n")
    run = bench.run((ESTIMATORS, f"[{folder}]"))
    score = run.scores()[0]
    assert value_of(score.revised, "ate_trans", "rmse") not in (None, score.value("ate_trans", "rmse"))
    assert score.revised["association"]["pairs"] == 2
    assert "mine: revised estimate: ATE " in (run.path / "leaderboard.md").read_text()
    assert [finding for finding in verify_run(run) if finding.wrong] == []
    assert len((run.estimate(score.case, "mine", 0) / REVISED).read_text().splitlines()) == 2


def test_one_that_knows_no_scale_is_aligned_with_one_and_marked(bench, first, plugin):
    """Half the length of the wheels' path: as good as the wheels once a scale is allowed."""
    from vobench.suite.catalog import builtin_root

    code = (builtin_root() / "estimators" / "wheel_odometry" / "estimator.py").read_text()
    folder = plugin("...", needs="[encoders]")
    halved = "class Mine(WheelOdometry):\n    def process(self, frame):\n        from dataclasses import replace\n"
    halved += "        r = super().process(frame); T = r.T_odom_frame.copy(); T[:3, 3] /= 2\n"
    (folder / "estimator.py").write_text(f"{code}\n\n{halved}        return replace(r, T_odom_frame=T)\n")
    manifest = (folder / "estimator.yaml").read_text().replace("left_camera", "body")
    (folder / "estimator.yaml").write_text(f"{manifest}metric: false\n")
    run = bench.run((ESTIMATORS, f"[{folder}, wheel_odometry]"))
    cells = {cell.estimator: cell for cell in board_of(run).cells}
    assert cells["mine"].claims == ("Sim(3)",)
    assert cells["mine"].spread("ate_mm")[0] < 0.2 * 0.15e3
    assert {s.score["alignment"]["kind"] for s in run.scores() if s.estimator == "mine"} == {"sim3"}
    assert "| mine [Sim(3)] |" in (run.path / "leaderboard.md").read_text()


def test_covariances_go_through_their_file_unchanged(tmp_path):
    P = np.cov(np.random.default_rng(1).normal(size=(6, 40)))
    (tmp_path / COVARIANCE).write_text(format_covariances([(10**8, P), (3 * 10**8, 2 * P)]))
    read = read_covariances(tmp_path / COVARIANCE, np.array([1, 2, 3]) * 10**8)
    assert np.array_equal(read[[0, 2]], [P, 2 * P])
    assert np.isnan(read[1]).all()


def test_a_file_of_covariances_of_other_poses_is_refused(tmp_path):
    (tmp_path / COVARIANCE).write_text(format_covariances([(5, np.eye(6))]))
    with pytest.raises(InputError, match=r"none of 1 covariances has the stamp of a pose: .*covariance\.txt"):
        read_covariances(tmp_path / COVARIANCE, np.array([6]))


@pytest.mark.parametrize(("factor", "verdict"), [(1, "what it holds"), (5, "too much"), (0.2, "too little")])
def test_the_gap_is_the_factor_between_errors_and_deviations(factor, verdict):
    found = CovarianceConsistency.of(factor**2 * np.random.default_rng(2).chisquare(6, 20_000))
    assert found.scale_gap == pytest.approx(factor, rel=0.02)
    assert found.sentence.startswith(f"claims {verdict}: ")


def test_nobody_can_change_a_verdict_after_the_fact():
    found = CovarianceConsistency.of(np.full(100, 6.0))
    with pytest.raises(ValueError, match="frozen"):
        found.scale_gap = 1.0


def estimate_with_covariances(folder, est, scale):
    rows = [(t, np.eye(6) * 1e-4) for t in est.t_ns.tolist()]
    (folder / COVARIANCE).write_text(format_covariances(rows))
    return lambda gt, start_ns: trial_consistency(folder, gt, est, start_ns=start_ns, scale=scale)


@pytest.mark.parametrize("scale", [1.0, 2.0, 0.25])
@pytest.mark.parametrize("first", [0, 7])
def test_a_perfect_estimate_of_any_scale_has_no_error_wherever_the_truth_begins(tmp_path, scale, first):
    """The truth begins at the first picture, or later; the estimate is in odom, in units of its own."""
    rng = np.random.default_rng(3)
    n = 30
    s = np.linspace(0, 4, n)
    positions_m = np.stack([s, np.sin(s), 0.1 * s], -1) + rng.normal(size=3)
    T_world_left = np.stack([se3.transform(se3.rotation_z(0.3 * a), p) for a, p in zip(s, positions_m, strict=True)])
    T_odom_left = se3.inverse(T_world_left[0]) @ T_world_left
    T_odom_left[:, :3, 3] /= scale
    t_ns = np.arange(n, dtype=np.int64) * 10**8
    consistency_of = estimate_with_covariances(tmp_path, Trajectory(t_ns, T_odom_left), scale)
    found = consistency_of(Trajectory(t_ns[first:], T_world_left[first:]), start_ns=0)
    assert found.poses == n - first
    assert found.nees_median < 1e-9
    assert found.covered_90 == 1.0


def test_an_error_of_one_deviation_in_one_axis_has_a_nees_of_one(tmp_path):
    n = 5
    t_ns = np.arange(n, dtype=np.int64) * 10**8
    T = np.tile(np.eye(4), (n, 1, 1))
    moved = T.copy()
    moved[1:, 1, 3] = 0.01
    found = estimate_with_covariances(tmp_path, Trajectory(t_ns, moved), 1.0)(Trajectory(t_ns, T), 0)
    assert found.nees_median == pytest.approx(1.0)
    assert found.nees_mean == pytest.approx(0.8)


def test_without_stated_covariances_there_is_no_consistency(tmp_path):
    t_ns = np.arange(3, dtype=np.int64)
    still = Trajectory(t_ns, np.tile(np.eye(4), (3, 1, 1)))
    assert trial_consistency(tmp_path, still, still, start_ns=0, scale=1.0) is None
    (tmp_path / COVARIANCE).write_text(HEAD)
    assert np.isnan(read_covariances(tmp_path / COVARIANCE, t_ns)).all()
    assert trial_consistency(tmp_path, still, still, start_ns=0, scale=1.0) is None


@pytest.mark.parametrize(
    ("gap", "verdict"), [(1.0, "what it holds"), (2.0, "too much"), (1.5, "too much"), (0.5, "too little")]
)
def test_many_independent_errors_tell_a_factor_of_one_and_a_half(gap, verdict):
    nees = gap**2 * np.random.default_rng(0).chisquare(6, 200)
    found = CovarianceConsistency.of(nees)
    assert found.sentence.startswith(f"claims {verdict}: errors are {found.scale_gap:.2g} x the deviations it states")
    assert found.gap_low < 1 < found.gap_high < 1.2


def walk_nees(rng, poses=150):
    """The NEES of a random walk of six errors whose covariance grows as it should."""
    errors = np.cumsum(rng.standard_normal((poses, 6)), axis=0)
    return np.sum(errors**2, axis=1) / np.arange(1, poses + 1)


def test_of_consistent_random_walks_about_one_in_twelve_is_called_inconsistent_and_most_that_claim_half_are():
    rng = np.random.default_rng(1)
    verdicts = []
    for _ in range(200):
        nees = walk_nees(rng)
        verdicts.append([CovarianceConsistency.of(factor * nees).sentence.split(":")[0] for factor in (1.0, 4.0)])
    honest, halved = zip(*verdicts, strict=True)
    assert honest.count("claims what it holds") >= 200 * (1 - 1 / 12) - 8
    assert halved.count("claims too much") >= 160
