"""Recordings that were made elsewhere, from the suite to the leaderboard, and whether a run is what it says."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from vobench.dataset.export import export
from vobench.errors import SequenceError, SuiteError
from vobench.geometry import se3
from vobench.report import page
from vobench.report.verify import verify_run
from vobench.runner.folder import CASE, HASHES, SCORE, SEQUENCE
from vobench.runner.ground_truth import LONGEST_GAP_NS, left_truth
from vobench.runner.import_recording import read_all
from vobench.runner.score import score_estimate, stands_still
from vobench.runner.task import is_done, perform, sequence_tasks
from vobench.sequence import Sequence, SequenceWriter, read_truth
from vobench.suite.suite import read_plan
from vobench.trajectory.trajectory import Trajectory


@pytest.fixture(scope="session")
def layouts(first, tmp_path_factory):
    """The simulated sequence of the suite in three layouts."""
    folder = tmp_path_factory.mktemp("layouts")
    for form in ("euroc", "kitti", "ros2"):
        export((first.case("full") / SEQUENCE).resolve(), folder / form, form)
    return folder


@pytest.fixture(scope="session")
def recorded(bench, layouts):
    """A run on the three, with the suite's file."""
    suite = layouts / "real.yaml"
    suite.write_text("name: real\nsource: [euroc, kitti, {path: ros2, name: bag}]\nestimators: [stand_still]\n")
    plan = read_plan(str(suite))
    return bench.run_plan(plan, root=layouts / "runs", cache="real")


def test_layouts_of_one_sequence_score_as_it_does(first, recorded):
    simulated = next(s for s in first.scores() if (s.case, s.estimator) == ("full", "stand_still"))
    errors = [score.value("ate_trans", "rmse") for score in recorded.scores()]
    assert [score.status for score in recorded.scores()] == ["ok"] * 3
    assert errors == pytest.approx([simulated.value("ate_trans", "rmse")] * 3, rel=1e-6)


def test_a_case_keeps_what_its_import_assumed(recorded):
    case = json.loads((recorded.case("kitti") / CASE).read_text())
    assert case["source"]["path"].endswith("/kitti")
    assert any("left grey camera" in note for note in case["import"].values())


def test_an_import_is_made_once_and_again_when_a_file_changes(bench, layouts, tmp_path):
    suite = tmp_path / "one.yaml"
    suite.write_text(f"name: one\nsource: {layouts / 'euroc'}\nestimators: [stand_still]\n")
    plan, store = read_plan(str(suite)), bench.folder / "once"
    (task,) = sequence_tasks(plan.recorded[0])
    before = perform(task, store)
    assert perform(task, store) == before
    calibration = layouts / "euroc" / "mav0" / "cam0" / "sensor.yaml"
    calibration.write_text(calibration.read_text() + "# looked at\n")
    (changed,) = sequence_tasks(plan.recorded[0])
    assert is_done(task, store)
    assert not is_done(changed, store)
    assert perform(changed, store) != before


def test_a_recording_without_truth_is_said_before_anything_is_run(layouts, tmp_path):
    suite = tmp_path / "bare.yaml"
    bare = tmp_path / "bare"
    (layouts / "kitti").rename(bare)
    try:
        (bare / "poses.txt").rename(tmp_path / "poses")
        suite.write_text("name: bare\nsource: bare\nestimators: [stand_still]\n")
        with pytest.raises(
            SuiteError, match=r"bare\.yaml:2: source: no ground truth, so nothing could be scored: .*bare"
        ):
            read_all(read_plan(str(suite)))
    finally:
        (tmp_path / "poses").rename(bare / "poses.txt")
        bare.rename(layouts / "kitti")


def test_why_nothing_could_be_scored_is_said_before_anything_is_run(layouts, tmp_path):
    suite, folder = tmp_path / "late.yaml", tmp_path / "late"
    suite.write_text("name: late\nsource: late\nestimators: [stand_still]\n")
    shutil.copytree(layouts / "euroc", folder)
    truth = folder / "mav0/state_groundtruth_estimate0/data.csv"
    head, first, second, *_ = truth.read_text().splitlines(keepends=True)
    for rows, said in (
        (first, "the ground truth covers 1 of "),
        (f"9{second}", r"no ground truth \(The truth .* was dropped: it shares no time"),
    ):
        truth.write_text(head + rows)
        with pytest.raises(SuiteError, match=rf"late\.yaml:2: source: {said}.*, so nothing could be scored: .*late"):
            read_all(read_plan(str(suite)))


def test_a_recording_that_stands_still_has_a_drift_and_no_error_among_others(bench, layouts, tmp_path):
    shutil.copytree(layouts / "kitti", tmp_path / "rest")
    poses = tmp_path / "rest/poses.txt"
    rows = poses.read_text().splitlines()
    poses.write_text("\n".join([rows[0]] * len(rows)))
    suite = tmp_path / "rest.yaml"
    suite.write_text(
        f"name: rest\nsource: [rest, {layouts / 'kitti'}]\nestimators: [lk_epipolar, stand_still, constant_velocity]\n"
    )
    run = bench.run_plan(read_plan(str(suite)), root=tmp_path / "runs", cache="rest")
    scores = {(s.case, s.estimator): s for s in run.scores()}
    assert scores["rest", "stand_still"].drift_m == 0.0
    drift_m = scores["rest", "lk_epipolar"].drift_m
    assert drift_m > 0.1  # it sees the pictures of a drive
    assert scores["rest", "lk_epipolar"].status == "ok"
    assert scores["kitti", "lk_epipolar"].drift_m is None
    unfit = scores["rest", "constant_velocity"]
    assert (unfit.status, unfit.reason) == ("not_applicable", "it needs 'encoders', but this recording has no wheels")
    board = (run.path / "leaderboard.md").read_text()
    assert f"lk_epipolar: drift of {1e3 * drift_m:.1f} mm while the camera is stationary" in board
    made = page.run_board(run, run.scores())
    kitti = {cell.estimator: cell.spread("ate") for cell in made.cells if cell.case == "kitti"}
    assert all(total.ate_percent == kitti[total.estimator][0] for total in made.totals if kitti[total.estimator])


@pytest.mark.parametrize(
    ("moved_m", "turned_deg", "still"), [(4.9e-3, 0.49, True), (5.1e-3, 0, False), (0, 0.51, False)]
)
def test_a_path_stands_still_by_how_far_it_strays_and_not_by_its_length(moved_m, turned_deg, still):
    there = np.arange(1000) % 2
    T = se3.transform(se3.rotation_z(np.deg2rad(turned_deg) * there), np.outer(there, [0.6, 0.0, 0.8]) * moved_m)
    anywhere = se3.transform(se3.rotation_z(1.0), [100.0, -20.0, 3.0])
    assert stands_still(Trajectory(np.arange(1000), anywhere @ T)) is still


def test_an_estimate_with_poses_outside_the_truth_alone_has_no_score():
    estimate = Trajectory(np.array([5]), np.eye(4)[None])
    truth = Trajectory(np.array([10, 20]), np.stack([np.eye(4)] * 2))
    assert score_estimate(estimate, truth, ()) is None


def wrong(run):
    return [(finding.kind, finding.what) for finding in verify_run(run) if finding.wrong]


def test_a_run_verifies_as_it_was_left(first, recorded):
    for run in (first, recorded):
        findings = list(verify_run(run))
        assert not [finding for finding in findings if finding.wrong]
        assert {finding.kind for finding in findings} == {"hash", "ground truth", "cache", "score"}


@pytest.fixture
def changed(first, tmp_path):
    """A copy of a run, one of whose files is written anew."""
    from vobench.runner.folder import RunFolder

    def change(name: str, old: str, new: str) -> RunFolder:
        copy = tmp_path / "copy"
        shutil.copytree(first.path, copy, symlinks=True)
        path = copy / name
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new, 1))
        return RunFolder(copy)

    return change


def test_a_changed_score_is_found(changed):
    run = changed(f"cases/full/estimates/stand_still/0/{SCORE}", '"rmse": 0.', '"rmse": 1.')
    assert wrong(run) == [
        ("hash", f"cases/full/estimates/stand_still/0/{SCORE}"),
        ("score", "stand_still on full, 0"),
    ]
    (said,) = (finding.wrong for finding in verify_run(run) if finding.wrong and finding.kind == "score")
    assert re.fullmatch(r"the score differs: metrics ate_trans rmse: 1\.\d+ is stated, 0\.\d+ is computed", said)


def test_a_changed_estimate_is_found_by_its_hash_and_by_its_score(changed):
    run = changed("cases/full/estimates/wheel_odometry/0/estimate.tum", "0.000000000 0.0 ", "0.000000000 0.1 ")
    assert wrong(run) == [
        ("hash", "cases/full/estimates/wheel_odometry/0/estimate.tum"),
        ("score", "wheel_odometry on full, 0"),
    ]


def test_a_score_that_cannot_be_read_and_one_that_was_added_are_found_beside_all_else(changed):
    run = changed(f"cases/full/estimates/stand_still/0/{SCORE}", "{", "{{")
    (run.case("full") / "estimates" / "mine").symlink_to("wheel_odometry")
    sentences = {
        finding.what: finding.wrong for finding in verify_run(run) if finding.wrong and finding.kind == "score"
    }
    assert sorted(sentences) == ["mine on full, 0", "stand_still on full, 0"]
    assert "not a score as vobench writes it (Invalid JSON" in sentences["stand_still on full, 0"]
    assert sentences["mine on full, 0"] == "not part of the run: its hashes do not list this file"


def test_a_changed_truth_is_found_even_where_its_hash_is_changed_too(changed):
    run = changed("cases/dim/ground_truth.tum", "\n0.2", "\n0.20001")
    from vobench.runner.folder import write_hashes

    write_hashes(run)
    assert ("ground truth", "dim") in wrong(run)


def test_a_file_of_a_sequence_that_is_not_what_the_caches_manifest_says_is_found(changed, tmp_path):
    run = changed(HASHES, "{", "{")
    link = run.case("full") / SEQUENCE
    shutil.copytree(link.resolve(), tmp_path / "damaged")
    link.unlink()
    link.symlink_to(tmp_path / "damaged")
    exposures = tmp_path / "damaged" / "exposures.csv"  # of which the run keeps no hash
    exposures.write_bytes(bytes(exposures.stat().st_size))
    assert wrong(run) == [("cache", "full")]


def test_a_sequence_that_is_gone_and_a_missing_file_are_said(changed, tmp_path):
    run = changed(HASHES, "{", "{")
    (run.path / "leaderboard.md").unlink()
    (run.case("full") / SEQUENCE).unlink()
    (run.case("full") / SEQUENCE).symlink_to(tmp_path / "gone")
    sentences = {finding.what: finding.wrong for finding in verify_run(run) if finding.wrong}
    assert sentences["leaderboard.md"] == "the file is missing"
    assert "no longer in the cache" in sentences[f"cases/full/{SEQUENCE}/sensors.mcap"]
    assert "no longer in the cache" in sentences["full"]


def sequence(folder: Path, frames_ns, truth_ns, first) -> Path:
    """A recording of black pictures, with a truth that walks along x at 1 m/s."""
    rig = Sequence.open((first.case("full") / SEQUENCE).resolve()).rig
    black = np.zeros((rig.left.height_px, rig.left.width_px), np.uint8)
    with SequenceWriter(folder, rig, case_json=None) as writer:
        for t_ns in truth_ns:
            T = np.eye(4)
            T[0, 3] = t_ns / 1e9
            writer.write_truth(t_ns, T, None)
        for t_ns in frames_ns:
            writer.write_frame(t_ns, black, black)
    return folder


def test_the_truth_at_pictures_lies_between_the_poses_around_them(first, tmp_path):
    folder = sequence(tmp_path, [50, 100, 150_000_000], [0, 100, 200_000_000], first)
    truth = left_truth(folder)
    mount = Sequence.open(folder).rig.T_body_left
    assert truth.t_ns.tolist() == [50, 100, 150_000_000]
    assert np.allclose(truth.positions_m[:, 0] - mount[0, 3], truth.t_ns / 1e9, rtol=0, atol=1e-12)


def test_pictures_outside_the_truth_or_in_a_gap_of_it_are_not_scored(first, tmp_path):
    gap = LONGEST_GAP_NS
    folder = sequence(tmp_path, [5, 10, 20, 20 + gap // 2, 21 + gap, 40 + gap], [10, 20, 21 + gap, 30 + gap], first)
    assert left_truth(folder).t_ns.tolist() == [10, 20, 21 + gap]


def test_a_truth_at_the_pictures_own_stamps_is_taken_as_it_is(first):
    folder = (first.case("full") / SEQUENCE).resolve()
    mount = Sequence.open(folder).rig.T_body_left
    assert np.array_equal(left_truth(folder).T_world_frame, read_truth(folder).T_world_frame @ mount)


@pytest.mark.parametrize(
    ("truth_ns", "sentence"), [([], "no ground truth"), ([100, 200], "covers none of the images in time")]
)
def test_a_recording_that_cannot_be_scored_says_why(first, tmp_path, truth_ns, sentence):
    with pytest.raises(SequenceError, match=sentence):
        left_truth(sequence(tmp_path, [5, 6], truth_ns, first))
