"""A twin repeats the path of a recording, and orders of estimators that are known are compared rightly."""

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vobench.analysis import camera_fit, path_placement, recording_twin
from vobench.analysis.path_placement import Placement
from vobench.analysis.realism import Realism
from vobench.analysis.realism_report import realism_of
from vobench.analysis.recording_twin import REAL, TWIN, TwinSuite, compare_twin, write_twin_suite
from vobench.analysis.twin_places import PlacedPath
from vobench.dataset.recording import Recording
from vobench.errors import InputError, UnknownNameError
from vobench.geometry import se3
from vobench.geometry.rig import looking
from vobench.runner.folder import RunFolder, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.recording import read_recording
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum, parse_tum

RANKED = ("stereo_pnp", "mono_vo", "stand_still")


@pytest.fixture(scope="module")
def recording(recorded_case: Path) -> Recording:
    return read_recording(recorded_case)


@pytest.fixture(scope="module")
def realism(recording: Recording) -> Realism:
    return realism_of(recording)


def fit_in_few_steps(patch: pytest.MonkeyPatch, cache: Path) -> None:
    """Place paths and fit cameras in few steps, with light from this cache."""
    patch.setattr(path_placement, "NEAR_DRAWS", 20)
    patch.setattr(camera_fit, "PASSES", 1)
    patch.setattr(camera_fit, "MAX_TRIALS", 2)
    patch.setattr(recording_twin, "FITTED_PICTURES", 2)
    patch.setenv("VOBENCH_CACHE", str(cache))


@pytest.fixture(scope="module")
def written(recorded_case: Path, tmp_path_factory: pytest.TempPathFactory) -> TwinSuite:
    """The suite of a twin in the closet that was recorded, placed and fitted in few steps."""
    root = tmp_path_factory.mktemp("written")
    closet = next(recorded_case.resolve().parents[4].glob("closet.yaml"))
    with pytest.MonkeyPatch.context() as patch:
        fit_in_few_steps(patch, root / "cache")
        suite = write_twin_suite(recorded_case, out=root / "twin", place=str(closet), estimators=list(RANKED))
    shutil.copytree(root / "twin", root / "pristine")
    return suite


@pytest.fixture
def suite(written: TwinSuite, monkeypatch: pytest.MonkeyPatch) -> TwinSuite:
    """The suite with its folder as it was written, whatever tests have done to it."""
    folder = written.file.parent
    fit_in_few_steps(monkeypatch, folder.parent / "cache")
    shutil.rmtree(folder)
    shutil.copytree(folder.parent / "pristine", folder)
    return written


def test_the_suite_has_the_recording_and_its_repetition(suite: TwinSuite, recording: Recording) -> None:
    plan = read_plan(str(suite.file))
    assert [case.name for case in plan.cases] == [TWIN, REAL]
    assert [entry.label for entry in plan.estimator_entries] == [
        "stereo_pnp",
        "mono_vo",
        "stand_still",
    ]
    (case,) = plan.simulated
    left, recorded = case.build_rig().left, recording.rig.left
    assert (left.width_px, left.height_px) == (recorded.width_px, recorded.height_px)
    assert case.rig.calibration_error.right_roll_deg == pytest.approx(0.5, abs=0.1)
    assert case.camera.exposure_gain > 0
    assert case.trajectory.rate_hz == pytest.approx(10)


def again(suite: TwinSuite, recorded_case: Path, names: Sequence[str] = RANKED) -> TwinSuite:
    """The suite that the same request, with these estimators, writes to the same folder."""
    closet = next(recorded_case.resolve().parents[4].glob("closet.yaml"))
    return write_twin_suite(recorded_case, out=suite.file.parent, place=str(closet), estimators=list(names))


def test_an_interrupted_twin_goes_on_where_it_was(suite, recorded_case, monkeypatch) -> None:
    assert len(suite.placed) == 1
    text = suite.file.read_text()
    without_camera = {key: value for key, value in json.loads(text).items() if key != "cameras"}
    suite.file.write_text(json.dumps(without_camera))  # as if the fit of the camera was interrupted
    monkeypatch.setattr(recording_twin, "find_places", None)
    resumed = again(suite, recorded_case)
    assert resumed.file.read_text() == text
    assert [placed.as_dict() for placed in resumed.placed] == [placed.as_dict() for placed in suite.placed]

    # A complete suite is not written again, also where it was edited.
    edited = json.loads(text) | {"summary": "edited"}
    suite.file.write_text(json.dumps(edited))
    monkeypatch.setattr(recording_twin, "fit_camera", None)
    again(suite, recorded_case)
    assert json.loads(suite.file.read_text()) == edited
    with pytest.raises(InputError, match="in use for another request"):
        again(suite, recorded_case, ["stereo_pnp", "lk_epipolar", "stand_still"])


def test_the_suite_in_a_folder_is_read_as_it_is(suite, realism) -> None:
    read = recording_twin.read_twin_suite(suite.file.parent)
    assert read.file == suite.file
    assert [placed.as_dict() for placed in read.placed] == [placed.as_dict() for placed in suite.placed]
    assert dict(read.realism.values) == dict(realism.values)
    other = json.loads(suite.file.read_text())
    other["source"][0]["name"] = "else"
    suite.file.write_text(json.dumps(other))
    with pytest.raises(InputError, match="has the cases real and twin, and this one twin, else"):
        recording_twin.read_twin_suite(suite.file.parent)


def test_a_folder_without_a_suite_is_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="should be the folder of a twin, with"):
        recording_twin.read_twin_suite(tmp_path)


def test_the_rebuilt_place_is_as_near_as_the_recording_everywhere(recorded_case, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(recording_twin, "fitted_camera", lambda *_, **settings: {"vignetting": settings["vignetting"]})
    suite = write_twin_suite(
        recorded_case, out=tmp_path / "twin", place="recorded", placements=2, estimators=list(RANKED)
    )
    first, second = suite.placed
    assert first.model != second.model
    assert first.title == "the recorded place"
    assert max(placed.placement.misfit for placed in suite.placed) < 0.1
    assert max(placed.placement.nearness for placed in suite.placed) < 1.3
    assert PlacedPath.of_dict(json.loads(json.dumps(first.as_dict()))).scene() == first.scene()

    # The second one has calibration errors that are drawn.
    cases = [read_plan(str(file)).simulated[0] for file in (suite.file, *suite.more)]
    assert cases[0].rig.calibration_error != cases[1].rig.calibration_error
    assert cases[0].camera.vignetting == pytest.approx(0, abs=0.1)


def test_the_path_of_the_twin_is_that_of_the_recording_moved_as_a_whole(suite: TwinSuite, recording: Recording) -> None:
    path = parse_tum((suite.file.parent / "path.tum").read_text(), name="path")
    (case,) = read_plan(str(suite.file)).simulated
    assert recording.truth is not None
    T_place_left = path.T_world_frame @ case.build_rig().T_body_left
    T_world_left = recording.truth.T_world_frame @ recording.rig.T_body_left
    moved, true = (se3.inverse(T[:-1]) @ T[1:] for T in (T_place_left, T_world_left))
    np.testing.assert_allclose(moved[:, :3, 3], true[:, :3, 3], atol=1e-6)
    turns, true_turns = (se3.rotation_angle(T[:, :3, :3]) for T in (moved, true))
    np.testing.assert_allclose(turns, true_turns, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"truth": None}, "needs a path, and this recording has none"),
        ({"still": True}, "this recording is stationary"),
        ({"short": True}, "takes 12 images or more with a truth, and this recording has 5"),
    ],
)
def test_a_recording_that_cannot_be_repeated_is_a_sentence(recording, realism, change, sentence) -> None:
    truth = recording.truth
    if "truth" in change:
        truth = None
    if "still" in change:
        truth = Trajectory(truth.t_ns, np.repeat(truth.T_world_frame[:1], len(truth), axis=0))
    if "short" in change:
        truth = Trajectory(truth.t_ns[:5], truth.T_world_frame[:5])
    with pytest.raises(InputError, match=sentence):
        recording_twin.recorded_path(replace(recording, truth=truth), realism.pair)


def test_a_recording_without_a_pair_is_a_sentence(recording: Recording, realism: Realism) -> None:
    with pytest.raises(InputError, match="needs a stereo pair that can be rectified and matched"):
        recording_twin.recorded_path(recording, None)


def test_what_is_asked_is_checked_before_the_recording_is_read(tmp_path: Path) -> None:
    nowhere = tmp_path / "nowhere"
    with pytest.raises(InputError, match="3 estimators or more, and -e names 2"):
        write_twin_suite(nowhere, out=tmp_path / "new", estimators=["a", "b"])
    with pytest.raises(UnknownNameError, match="no scene named 'offise'"):
        write_twin_suite(nowhere, out=tmp_path / "new", place="offise")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    with pytest.raises(InputError):
        write_twin_suite(nowhere, out=tmp_path / "full")


# Standard deviations in m a step of estimators' positions.
NOISE_M = {"good": 0.001, "fair": 0.01, "bad": 0.05}


def lay_out(root: Path, recorded_case: Path, noise_m: dict[str, dict[str, float]]) -> RunFolder:
    """A run whose two cases are the same recording, with estimates of known noise."""
    folder = RunFolder(root / "run")
    template = json.loads(next(recorded_case.glob("estimates/*/0/score.json")).read_text())
    truth = read_tum(recorded_case / GROUND_TRUTH)
    for case, estimators in noise_m.items():
        folder.case(case).mkdir(parents=True)
        (folder.case(case) / "sequence").symlink_to((recorded_case / "sequence").resolve())
        (folder.case(case) / GROUND_TRUTH).write_text(format_tum(truth))
        for seed, (name, sigma_m) in enumerate(estimators.items()):
            place = folder.estimate(case, name, 0)
            place.mkdir(parents=True)
            T = truth.T_world_frame.copy()
            T[:, :3, 3] += np.random.default_rng(seed).normal(0, sigma_m, (len(T), 3))
            (place / "estimate.tum").write_text(format_tum(Trajectory(truth.t_ns, T)))
            (place / "score.json").write_text(json.dumps({**template, "case": case, "estimator": name}))
    return folder


@pytest.fixture(scope="module")
def measure_once() -> Callable[[Recording], Realism]:
    """The statistics of the first recording that it is called with, for twins whose images are the same."""
    measured: list[Realism] = []

    def realism(recording: Recording) -> Realism:
        if not measured:
            measured.append(realism_of(recording))
        return measured[0]

    return realism


@pytest.fixture
def known(
    recorded_case: Path,
    realism: Realism,
    measure_once: Callable[[Recording], Realism],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
):
    """Compares a recording with itself as its twin, with these noises of estimators on both."""

    def compare(real, twin):
        source = {"path": str((recorded_case / "sequence").resolve()), "name": REAL}
        (tmp_path / "twin.yaml").write_text(
            json.dumps({"name": "twin", "source": [source], "estimators": ["stand_still"]})
        )
        placed = PlacedPath("closet", None, Placement(np.eye(4), 1.1, 0.1, 1.3, 1))
        suite = TwinSuite(tmp_path / "twin.yaml", (placed,), realism)
        folder = lay_out(tmp_path, recorded_case, {REAL: real, TWIN: twin})
        monkeypatch.setattr(Plan, "only", lambda plan, cases, scenes: plan)
        monkeypatch.setattr(recording_twin, "realism_of", measure_once)
        return compare_twin(suite, run_plan=lambda plan, /: folder)

    return compare


def test_a_recording_agrees_with_itself_in_order_errors_and_pictures(known, tmp_path: Path) -> None:
    report = known(NOISE_M, NOISE_M)
    facts = report.as_dict()
    assert facts["tau"] == 1
    assert [row["estimator"] for row in report.rows()] == ["good", "fair", "bad"]
    assert all(row[REAL] == row[TWIN] for row in report.rows())
    assert {row["is"] for row in facts["statistics"]} == {"in"}
    assert all(real == twin for real, twin in facts["also"].values())
    assert facts["places"] == [{"place": "closet", "scale": 1.1, "misfit": 0.1, "nearness": 1.3}]
    predicted = facts["prediction"]["estimators"]
    assert [row["estimator"] for row in predicted] == ["good", "fair", "bad"]
    assert [row["error"] for row in predicted] == pytest.approx([row[TWIN]["mean"] for row in report.rows()])
    assert facts["prediction"]["in_intervals"] == [0, 0]  # of a single place
    assert json.loads((tmp_path / "twin.json").read_text()) == json.loads(json.dumps(facts))


def test_the_opposite_order_is_a_tau_of_minus_one_and_the_table_shows_both_sides(known) -> None:
    opposite = dict(zip(NOISE_M, reversed(NOISE_M.values()), strict=True))
    report = known(NOISE_M, opposite)
    assert report.as_dict()["tau"] == -1
    frame = report.to_frame().set_index("estimator")
    assert frame["real_mean"].is_monotonic_increasing
    assert frame["twin_mean"].is_monotonic_decreasing
    assert (frame["real_p10"] < frame["real_p90"]).all()


def test_two_estimators_are_no_order(known) -> None:
    two = {name: NOISE_M[name] for name in ("good", "bad")}
    with pytest.raises(InputError, match="an order needs 3 estimators"):
        known(two, two)


# --- Parts, without a run ---


def test_the_replay_has_the_rate_of_the_recording_and_half_as_many_knots(recording, realism) -> None:
    settings = recording_twin.recorded_path(recording, realism.pair).trajectory_settings()
    assert settings == {"kind": "replay", "file": "path.tum", "rate_hz": 10.0, "knot_hz": 5.0}


def test_the_path_in_the_place_is_the_bodys_from_time_0_on(recording, realism) -> None:
    path = recording_twin.recorded_path(recording, realism.pair)
    T_place_world = se3.transform(se3.rotation_z(0.4), (1.0, 2.0, 3.0))
    placed = path.in_place(Placement(T_place_world, 1.0, 0.0, 1.0, 1))
    assert placed.t_ns[0] == 0
    np.testing.assert_array_equal(np.diff(placed.t_ns), np.diff(path.t_ns))
    T_body_left = path.rig.build().T_body_left
    np.testing.assert_allclose(placed.T_world_frame @ T_body_left, T_place_world @ path.T_world_left, atol=1e-9)


def test_frames_from_the_first_to_the_last_true_pose_are_repeated(recording, realism) -> None:
    t_ns = recording.truth.t_ns
    inner = Trajectory(t_ns[1:-1], recording.truth.T_world_frame[1:-1])
    path = recording_twin.recorded_path(replace(recording, truth=inner), realism.pair)
    assert path.t_ns.tolist() == t_ns[1:-1].tolist()


@pytest.mark.parametrize(("count", "is_enough"), [(12, True), (11, False)])
def test_twelve_pictures_are_enough_for_a_twin(recording, realism, count, is_enough) -> None:
    truth = Trajectory(recording.truth.t_ns[:count], recording.truth.T_world_frame[:count])
    short = replace(recording, truth=truth)
    if is_enough:
        assert len(recording_twin.recorded_path(short, realism.pair).t_ns) == count
    else:
        with pytest.raises(InputError, match=f"12 images or more with a truth, and this recording has {count}"):
            recording_twin.recorded_path(short, realism.pair)


def test_only_a_kitti_recording_is_levelled(recording, realism) -> None:
    tilt = looking(pitch_deg=5, position_m=(0, 0, 0))[:3, [2, 0, 1]] * [1, -1, -1]
    T = se3.transform(tilt, np.zeros(3)) @ recording.truth.T_world_frame
    tilted = replace(recording, truth=Trajectory(recording.truth.t_ns, T))
    heights = {}
    for form in ("kitti", recording.form):
        path = recording_twin.recorded_path(replace(tilted, form=form), realism.pair)
        heights[form] = np.ptp(path.T_world_left[:, 2, 3])
    assert heights["kitti"] < 0.2 * heights[recording.form]


def test_the_gain_of_the_right_camera_is_stated_in_the_linear_signal() -> None:
    settings = camera_fit.camera_of(0.8, 0.5, 0.9, 1.0)
    stated = recording_twin._camera_settings(settings, gain=1.1)
    assert stated["unlike"] == {"right": {"gain": 1.21}}  # grey values are the root of light here
    assert (stated["exposure_gain"], stated["blur_sigma_px"]) == (0.8, 0.9)
    assert stated["chip"]["full_well_e"] == 20_000


def test_the_spread_of_errors_is_that_of_the_known_ones() -> None:
    errors = np.append(np.arange(101.0), [np.nan, np.nan])
    assert recording_twin._spread(errors) == {"mean": 50, "p10": 10, "p50": 50, "p90": 90}


def test_figures_of_the_pair_are_compared_where_both_are_known(realism: Realism) -> None:
    pair = realism.pair
    assert pair is not None
    compared = recording_twin._compared(realism, realism)
    assert compared["roll of the right eye,°"] == (pair.roll_deg.value, pair.roll_deg.value)
    assert compared["disparity, 50 % are below, px"] == (pair.disparity_px[1],) * 2
    assert compared["noise where flat, DN"] == (realism.also["noise_dn"],) * 2
    unknown = replace(realism, pair=replace(pair, yaw_deg=None))
    assert "yaw of the right eye,°" not in recording_twin._compared(realism, unknown)
    assert "offset of the right eye, px" not in recording_twin._compared(unknown, realism)
    assert len(recording_twin._compared(realism, replace(realism, pair=None))) == 4


def test_a_prediction_says_that_the_offset_is_not_known(realism: Realism, tmp_path: Path) -> None:
    assert realism.pair is not None
    unknown = TwinSuite(tmp_path / "twin.yaml", (), replace(realism, pair=replace(realism.pair, yaw_deg=None)))
    known_yaw = replace(realism.pair, yaw_deg=realism.pair.roll_deg)
    known = TwinSuite(tmp_path / "twin.yaml", (), replace(realism, pair=known_yaw))
    assert "offset of disparity could not be determined" in recording_twin._basis(unknown)
    assert "offset" not in recording_twin._basis(known)
