"""What is shown of a trial: its frames, aligned like its score, and its numbers by frame."""

import io
import json
import zipfile

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.report.cell_notes import disparity_offset_sentence
from vobench.report.practice import FRAMES as COUNT
from vobench.report.practice import PRACTICES, STEP_NS
from vobench.report.trial_view import NO_OUTPUT, summary, trial_view
from vobench.runner.estimate import ESTIMATE, POINTS, TRACKS
from vobench.runner.folder import SEQUENCE, RunFolder, read_tum
from vobench.runner.frames import COLUMNS, FRAMES, GROUND_TRUTH, TIME_COLUMNS, TIMES, new_table
from vobench.trajectory.align import Alignment
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

SHIFT = Alignment("se3", np.eye(3), np.array([1.0, 2.0, 3.0]), 1.0, ()).as_dict()
METRIC = {"name": "ate_trans", "unit": "m", "rmse": 0.25, "mean": 0.125, "max": 0.5}


@pytest.fixture
def trial(scored):
    return scored("a", "lost", frames=COUNT, path_m=0.095, score={"metrics": [METRIC], "alignment": SHIFT})


@pytest.fixture
def folder(tmp_path, trial) -> RunFolder:
    """A run with one trial: errors jump at frame 12, frame 3 has no answer and no pose."""
    run = RunFolder(tmp_path)
    place = run.estimate("down", "a", 0)
    place.mkdir(parents=True)
    sequence = PRACTICES["drive"].write(tmp_path / "recorded")
    (run.case("down") / SEQUENCE).symlink_to(sequence)
    truth = read_tum(sequence / GROUND_TRUTH)
    (run.case("down") / GROUND_TRUTH).write_text(format_tum(truth))
    known = np.delete(np.arange(COUNT), 3)
    (place / ESTIMATE).write_text(format_tum(Trajectory(truth.t_ns[known], truth.T_world_frame[known])))
    with new_table(place / FRAMES, COLUMNS) as frames, new_table(place / TIMES, TIME_COLUMNS) as times:
        for index in range(COUNT):
            row = {"frame": index, "t_ns": index * STEP_NS, "exposure_s": 0.002, "gain_db": 6}
            if index != 3:
                row |= {"status": "ok", "position_error_m": 0.25 if index >= 12 else 0.0, "rotation_error_deg": 1.5}
                row["stats"] = json.dumps({"depth_m": index} if index % 2 else {})
            frames.writerow(row)
            times.writerow({"frame": index, "wall_ms": index, "cpu_ms": 1, "memory_mib": 9})
    with zipfile.ZipFile(place / TRACKS, "w") as archive:
        for index in (2, 6):
            archive.writestr(f"{index:06d}.npy", npy([[1, 2, 3, 4, 1], [5, 6, 7, 8, 0]]))
        archive.writestr(f"{POINTS}000006.npy", npy([[1.0, 0.0, 0.0]]))
    return run


def npy(rows):
    """An array in single precision as the bytes of its file."""
    file = io.BytesIO()
    np.save(file, np.array(rows, np.float32))
    return file.getvalue()


def test_every_frame_has_its_errors_status_and_numbers(folder, trial):
    view = trial_view(folder, trial)
    assert len(view.error_m) == len(view.statuses) == len(list(view.frames())) == COUNT
    assert (view.title, view.label, view.first) == ("a on down", "a", 0)
    assert view.statuses[3] == NO_OUTPUT
    assert set(view.statuses) == {"ok", NO_OUTPUT}
    assert np.flatnonzero(np.isnan(view.error_m)).tolist() == [3]
    assert view.rotation_deg[5] == 1.5
    np.testing.assert_array_equal(view.costs["latency_ms"], np.arange(COUNT))
    assert view.costs["exposure_ms"][0] == 2.0
    assert view.costs["gain_db"][0] == 6.0
    depths = view.stats["depth_m"]
    assert np.isnan(depths[::2]).all()
    assert depths[5] == 5.0


def test_the_estimate_is_aligned_as_in_its_score_and_the_truth_is_not(folder, trial):
    view = trial_view(folder, trial)
    gap_m = view.estimate.positions_m - view.ground_truth.positions_m[np.delete(np.arange(COUNT), 3)]
    np.testing.assert_allclose(gap_m, np.tile([1.0, 2.0, 3.0], (COUNT - 1, 1)), atol=1e-9)
    plain = trial_view(folder, trial.model_copy(update={"score": None}))
    np.testing.assert_allclose(plain.estimate.positions_m[0], view.ground_truth.positions_m[0], atol=1e-9)


def test_a_failed_trial_goes_wrong_where_its_error_jumps_and_a_survivor_nowhere(folder, trial):
    assert trial_view(folder, trial).wrong_at == 12
    assert trial_view(folder, trial.model_copy(update={"status": "ok"})).wrong_at is None


def test_a_window_keeps_what_lies_in_it(folder, trial):
    view = trial_view(folder, trial, window=slice(5, 9))
    stamps = [index * STEP_NS for index in range(5, 9)]
    assert [frame.t_ns for frame in view.frames()] == stamps
    assert view.ground_truth.t_ns.tolist() == view.estimate.t_ns.tolist() == stamps
    assert (view.first, len(view.error_m), view.costs["latency_ms"].tolist()) == (5, 4, [5, 6, 7, 8])
    assert view.wrong_at is None
    assert trial_view(folder, trial, window=slice(10, 15)).wrong_at == 2


def test_a_window_beyond_the_recording_and_a_sequence_that_is_gone_are_sentences(folder, trial):
    with pytest.raises(InputError, match=f"--frames {COUNT}:{COUNT} holds none of the {COUNT} frames of down"):
        trial_view(folder, trial, window=slice(50, 60))
    (folder.case("down") / SEQUENCE).unlink()
    with pytest.raises(
        InputError, match="the sequence is no longer in the cache; run the suite again to recreate it: "
    ):
        trial_view(folder, trial)


def test_without_recorded_truth_of_pixels_and_scene_there_is_none(folder, trial):
    view = trial_view(folder, trial)
    assert (view.truth, view.scene) == (None, None)


@pytest.mark.parametrize(("window", "frames"), [(slice(None), [2, 6]), (slice(6, 9), [0]), (slice(3, 6), [])])
def test_tracks_and_points_are_those_of_the_window_by_its_frames(folder, trial, window, frames):
    view = trial_view(folder, trial, window=window)
    assert sorted(view.tracks) == sorted(view.steps) == frames
    assert sorted(view.points) == frames[-1:]
    for index in frames:
        points_px, is_inlier = view.tracks[index]
        assert points_px.tolist() == [[3, 4], [7, 8]]
        assert is_inlier.tolist() == [True, False]
        assert view.steps[index].tolist() == [[1, 2], [5, 6]]
    for points_m in view.points.values():
        np.testing.assert_allclose(points_m, [[2.0, 2.0, 3.0]])


def test_points_of_an_estimate_without_a_score_are_not_aligned(folder, trial):
    view = trial_view(folder, trial.model_copy(update={"score": None}))
    assert view.points[6].tolist() == [[1.0, 0.0, 0.0]]


def test_the_summary_is_the_score_in_markdown(trial):
    assert summary(trial).splitlines() == [
        "# a on down",
        "",
        "**lost** — it went dark",
        "",
        f"{COUNT} frames, 0.10 m, coverage 100.0%",
        "",
        "| metric | rmse | mean | max |",
        "|---|---|---|---|",
        "| ate_trans (m) | 0.25 | 0.125 | 0.5 |",
    ]
    unscored = trial.model_copy(update={"score": None, "reason": ""})
    assert summary(unscored).splitlines()[2:] == ["**lost**", "", f"{COUNT} frames, 0.10 m, coverage 100.0%"]


def test_the_summary_has_the_offset_of_disparities_that_the_estimator_found(trial):
    note = disparity_offset_sentence(1.1)
    assert summary(trial, note).splitlines()[6] == (
        "Disparities of this stereo pair look off by +1.1 px: check its calibration"
    )
