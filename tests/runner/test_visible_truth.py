"""Ground truth below the folders that an estimator may read is found, whatever form it has, and nothing else is."""

from pathlib import Path
from zipfile import ZipFile

import pytest

from vobench.dataset.layout import layouts
from vobench.estimator.program import EstimatorFailure
from vobench.estimator.readable_folders import READ_VARIABLE, SWITCH_VARIABLE
from vobench.runner import visible_truth as visible_truth_file
from vobench.runner.visible_truth import visible_truth


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder of an estimator, with its code."""
    monkeypatch.delenv(READ_VARIABLE, raising=False)
    monkeypatch.delenv(SWITCH_VARIABLE, raising=False)
    folder = tmp_path / "mine"
    put(folder, "estimator.py")
    return folder


def put(folder: Path, *names: str) -> None:
    for name in names:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("content")


def found(folder: Path, known: tuple[Path, ...] = ()) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in visible_truth(folder, known))


@pytest.mark.parametrize(
    ("file", "hidden"),
    [
        ("data/truth.mcap", "data/truth.mcap"),
        ("data/sensors.mcap", "data/sensors.mcap"),
        ("data/flight.bag", "data/flight.bag"),
        ("data/flight/flight_0.db3", "data/flight/flight_0.db3"),
        ("data/trial.rrd", "data/trial.rrd"),
        ("drives/short.tum", "drives/short.tum"),
        ("dataset/poses/00.txt", "dataset/poses/00.txt"),
        ("dataset/sequences/00/poses.txt", "dataset/sequences/00/poses.txt"),
        ("dataset/sequences/00/00.txt", "dataset/sequences/00/00.txt"),
        ("office/groundtruth.txt", "office/groundtruth.txt"),
        ("office/groundtruthSync.txt", "office/groundtruthSync.txt"),
        ("hall/mav0/state_groundtruth_estimate0/data.csv", "hall/mav0/state_groundtruth_estimate0"),
        ("hall/mav0/vicon0/data.csv", "hall/mav0/vicon0"),
        ("hall/mav0/leica0/data.csv", "hall/mav0/leica0"),
        ("hall/dso/gt_imu.csv", "hall/dso/gt_imu.csv"),
        ("street/P000/pose_left.txt", "street/P000/pose_left.txt"),
        ("street/P000/pose_lcam_front.txt", "street/P000/pose_lcam_front.txt"),
        ("cases/room/ground_truth.tum", "cases/room/ground_truth.tum"),
        ("groundtruth.txt", "groundtruth.txt"),  # directly beside the code
        ("Data/GroundTruth.TXT", "Data/GroundTruth.TXT"),
    ],
)
def test_the_truth_of_a_recording_is_found_by_its_name(folder, file, hidden):
    put(folder, file, "data/left.png", "hall/mav0/cam0/data.csv")
    assert found(folder) == [hidden]


def test_every_layout_of_vobench_names_its_truth():
    assert [name for name, layout in layouts().items() if not layout.truth] == []


@pytest.mark.parametrize(
    "file",
    [
        "model.onnx",
        "poses.py",
        "poses/model.txt.py",
        "vocabulary/words.txt",
        "weights.zip",
        "src/truth.py",
        "cases/x.yaml",
    ],
)
def test_other_files_are_not_hidden(folder, file):
    put(folder, file)
    assert found(folder) == []


def test_a_run_is_hidden_as_a_whole(folder):
    put(folder, "old/results/tiny/20260101T000000_ab/suite.json")
    put(folder, "old/results/tiny/20260101T000000_ab/cases/room/case.json")
    assert found(folder) == ["old/results/tiny/20260101T000000_ab"]


def test_of_an_opened_folder_that_is_a_run_what_tells_the_truth_is_hidden(folder, tmp_path, monkeypatch):
    put(tmp_path, "opened/suite.json", "opened/cases/room/case.json", "opened/leaderboard.html")
    monkeypatch.setenv(READ_VARIABLE, str(tmp_path / "opened"))
    hidden = {path.name for path in visible_truth(folder, [])}
    assert hidden == {"cases", "leaderboard.html"}


@pytest.mark.parametrize("names", [("suite.json", "cases/room/case.json"), ("sequences/ab/case.json", "state/locks/a")])
@pytest.mark.parametrize("below", ["", "deeper/still"])
def test_an_estimator_whose_folder_lies_in_a_run_or_a_cache_is_refused(folder, names, below):
    put(folder, *names)
    (folder / below).mkdir(parents=True, exist_ok=True)
    with pytest.raises(EstimatorFailure, match=f"refused: its folder lies in a (run|cache), .*: {folder}$"):
        visible_truth(folder / below, [])


def test_an_estimator_whose_folder_is_also_that_of_runs_is_refused_by_any_of_its_names(folder, tmp_path):
    (tmp_path / "link").symlink_to(folder)
    for name in (folder, tmp_path / "link"):
        with pytest.raises(EstimatorFailure, match="refused: its folder is also that of runs, the cache or a record"):
            visible_truth(name, [folder])
    assert visible_truth(folder, [tmp_path]) == []


def test_another_cache_is_hidden_as_a_whole(folder):
    put(folder, "cache/sequences/ab/case.json", "cache/state/seconds/score", "cache/estimates/ab/estimate.tum")
    assert found(folder) == ["cache"]


def test_a_bundle_is_found_whatever_its_name(folder):
    with ZipFile(folder / "harmless.zip", "w") as archive:
        archive.writestr("sequence_hashes.json", "{}")
    with ZipFile(folder / "weights.zip", "w") as archive:
        archive.writestr("weights.npy", "")
    assert found(folder) == ["harmless.zip"]


def test_folders_that_the_user_opened_are_searched(folder, tmp_path, monkeypatch):
    put(tmp_path, "opened/seq/groundtruth.txt")
    monkeypatch.setenv(READ_VARIABLE, str(tmp_path / "opened"))
    assert visible_truth(folder, []) == [tmp_path / "opened/seq/groundtruth.txt"]


def test_what_is_hidden_already_is_not_searched(folder):
    put(folder, "results/tiny/a/ground_truth.tum")
    assert found(folder, (folder / "results",)) == []


def test_links_are_not_followed(folder, tmp_path):
    put(tmp_path, "elsewhere/groundtruth.txt")
    (folder / "link").symlink_to(tmp_path / "elsewhere")
    (folder / "loop").symlink_to(folder)
    assert found(folder) == []


def test_a_folder_that_is_too_large_to_be_searched_is_refused(folder, monkeypatch):
    put(folder, "a/1", "a/2", "b/3")
    monkeypatch.setattr(visible_truth_file, "MOST_ENTRIES", 5)
    with pytest.raises(EstimatorFailure, match=f"refused: .*more than 5 files.*: {folder}"):
        visible_truth(folder, [])


def test_without_a_sandbox_nothing_is_searched(folder, monkeypatch):
    put(folder, "groundtruth.txt")
    monkeypatch.setenv(SWITCH_VARIABLE, "off")
    assert visible_truth(folder, []) == []
