import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation

from vobench.dataset import export as exporting
from vobench.dataset.export import FORMS_WITHOUT_STAMPS, TRAJECTORY_FORMS, export, export_trajectory
from vobench.dataset.layout import read, sniff, writable
from vobench.dataset.rectified_view import rectified
from vobench.errors import InputError, SequenceError, VobenchError
from vobench.geometry import se3
from vobench.geometry.camera import Equirectangular
from vobench.geometry.rig import PRESETS, CalibrationError, Rig, mounted_rig, side_by_side, true_rig
from vobench.sequence import Sequence, SequenceWriter
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.kitti import parse_times
from vobench.trajectory.trajectory import Trajectory

Make = Callable[..., Any]
FORMS = tuple(writable())
# Nothing in a recording has a say in what files are called: stamps and numbers do.
NAMES = re.compile(
    r"(mav0/(cam[01]/(data/\d+\.png|data\.csv|sensor\.yaml)|(imu0|state_groundtruth_estimate0)/(data\.csv|sensor\.yaml)"
    r"|base_link/sensor\.yaml)|image_[01]/\d{6}\.png|(calib|times|poses|rgb|depth|groundtruth|accelerometer|imu)\.txt"
    r"|(rgb|depth)/\d+\.\d{9}\.png|metadata\.yaml|out\.mcap"
    r"|NOTES\.txt|camchain\.yaml|imu\.yaml|photometric/cam[01]/(camera\.txt|times\.txt|pcalib\.txt|vignette\.png))"
)


@pytest.fixture
def real() -> Rig:
    """EuRoC's pair: bent lenses, not parallel."""
    pair = PRESETS["euroc"]
    return mounted_rig(pair.left, pair.right, pair.T_left_right, pitch_deg=10.0)


def listing(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", [{}, {"imu": True}, {"stereo": False}, {"stereo": False, "imu": True}], ids=str)
def test_every_form_is_whole_recognised_and_named_by_stamps_alone(
    form: str, kind: dict[str, bool], make_sequence: Make, rig_of: Callable[..., Rig], tmp_path: Path
) -> None:
    made = make_sequence(rig_of(**kind), depth="imu" in kind)
    exported = export(made.folder, tmp_path / "out", form)
    files = listing(tmp_path / "out")
    assert set(exported.files) == files
    assert [name for name in files if not NAMES.fullmatch(name)] == []
    assert sniff(tmp_path / "out") == form
    assert (tmp_path / "out/NOTES.txt").read_text(encoding="utf-8").splitlines() == list(exported.notes)
    assert ("imu.yaml" in files) == ("imu" in kind and form != "kitti"), "KITTI has no readings of an IMU"
    assert not list(tmp_path.glob(".out*"))


@pytest.mark.parametrize("form", FORMS)
def test_the_same_sequence_gives_the_same_bytes(form: str, make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence()
    first, second = tmp_path / "a/out", tmp_path / "b/out"
    names = export(made.folder, first, form).files
    assert export(made.folder, second, form).files == names
    assert all((first / name).read_bytes() == (second / name).read_bytes() for name in names)


def test_a_folder_in_use_a_file_and_an_unknown_form_are_sentences(make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence()
    (tmp_path / "used").mkdir()
    (tmp_path / "used/mine.txt").write_text("keep")
    (tmp_path / "file").write_text("keep")
    for out in (tmp_path / "used", tmp_path / "file", made.folder):
        with pytest.raises(InputError, match="a new or empty folder") as caught:
            export(made.folder, out, "euroc")
        assert str(out) in str(caught.value)
    with pytest.raises(
        InputError, match=r"no form to export to named 'rosbag'\. Did you mean 'ros2'\? Known: euroc, kitti, ros2, tum"
    ):
        export(made.folder, tmp_path / "new", "rosbag")
    assert listing(tmp_path / "used") == {"mine.txt"}


def test_an_empty_folder_is_taken(make_sequence: Make, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    assert export(make_sequence().folder, tmp_path / "out", "tum").files


@pytest.mark.parametrize("form", FORMS)
def test_an_export_that_breaks_off_leaves_nothing(
    form: str, make_sequence: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = make_sequence()

    def full(*_: object) -> list[str]:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(exporting, "write_photometric", full)
    before = set(tmp_path.iterdir())
    with pytest.raises(SequenceError, match=r"cannot write the export .No space left"):
        export(made.folder, tmp_path / "out", form)
    assert set(tmp_path.iterdir()) == before


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("wrong", ["lens", "mount", "path", "stamps", "no truth"])
def test_an_export_that_reads_back_as_something_else_is_refused(
    form: str, wrong: str, make_sequence: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = make_sequence()

    def misread(folder: Path, *, form: str) -> Any:
        found = read(folder, form=form)
        rig, truth = found.rig, found.truth
        assert truth is not None
        nudge = se3.transform(np.eye(3), [2e-9, 0.0, 0.0])
        match wrong:
            case "lens":
                rig = replace(rig, left=replace(rig.left, cx_px=rig.left.cx_px + 1e-5))  # type: ignore[type-var]
            case "mount":
                rig = replace(rig, T_body_left=rig.T_body_left @ nudge)
            case "path":
                truth = Trajectory(truth.t_ns, truth.T_world_frame @ nudge)
            case "stamps":
                truth = Trajectory(truth.t_ns + 1, truth.T_world_frame)
            case _:
                truth = None
        return replace(found, rig=rig, truth=truth)

    monkeypatch.setattr(exporting, "read", misread)
    with pytest.raises(SequenceError, match=f"the {form} folder, read back,"):
        export(made.folder, tmp_path / "out", form)
    assert not (tmp_path / "out").exists()


def test_kitti_says_that_it_resampled_and_projects_as_the_recording_does(
    real: Rig, make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(real, count=2)
    exported = export(made.folder, tmp_path / "out", "kitti")
    assert any("resampled" in note for note in exported.notes)
    rows = [line.partition(":")[2].split() for line in (tmp_path / "out/calib.txt").read_text().splitlines()]
    P_left, P_right = np.array(rows, float).reshape(2, 3, 4)
    # A point's places in the KITTI pictures, and in the recorded ones, carry the same grey value.
    points_left = np.array([[0.2, 0.1, 3.0], [-0.5, 0.3, 2.0], [1.0, -0.4, 6.0], [0.0, 0.0, 9.0]])
    views = rectified(made.rig)
    R_view_left = views.rig.T_body_left[:3, :3].T @ made.rig.T_body_left[:3, :3]
    points_view = np.hstack([points_left @ R_view_left.T, np.ones((4, 1))])
    for side, P, picture, name in (
        ("left", P_left, made.left[0], "image_0"),
        ("right", P_right, made.right[0], "image_1"),
    ):
        homogeneous = points_view @ P.T
        u, v = (homogeneous[:, :2] / homogeneous[:, 2:]).T
        T_left_camera = se3.inverse(made.rig.T_body_left) @ made.rig.T_body_camera(side)
        recorded = made.rig.camera(side).project(se3.apply(se3.inverse(T_left_camera), points_left))
        shown = cv2.imread(str(tmp_path / f"out/{name}/000000.png"), cv2.IMREAD_UNCHANGED)
        there, here = grey_at(shown, np.stack([u, v], -1)), grey_at(picture, recorded)
        assert np.abs(there - here).max() < 8, "a wrong place would differ by tens of grey values"


def grey_at(picture: np.ndarray, uv: np.ndarray) -> np.ndarray:
    u, v = uv.astype(np.float32).T
    return cv2.remap(picture.astype(np.float32), u[None], v[None], cv2.INTER_LINEAR)[0]


def test_a_pair_above_each_other_is_no_kitti_pair_but_keeps_in_euroc(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    up = se3.transform(np.eye(3), [0.0, -0.1, 0.0])
    made = make_sequence(rig_of(T_left_right=up))
    with pytest.raises(SequenceError, match="so the pair cannot be rectified"):
        export(made.folder, tmp_path / "kitti", "kitti")
    assert export(made.folder, tmp_path / "euroc", "euroc").files


def test_kitti_leaves_out_frames_without_truth_and_says_so(make_sequence: Make, tmp_path: Path) -> None:
    everything = make_sequence().t_ns
    made = make_sequence(truth_ns=np.array([everything[1] - 7, everything[2] + 11, everything[3]]))
    exported = export(made.folder, tmp_path / "out", "kitti")
    assert sum(name.startswith("image_0") for name in exported.files) == 3
    assert any(note.startswith("2 of 5 frames lie before or after") for note in exported.notes)
    assert any("2 poses were interpolated between true poses" in note for note in exported.notes)


@pytest.mark.parametrize("form", FORMS)
def test_a_recording_without_truth_or_case_is_exported_and_said_to_be(
    form: str, make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(truth_ns=np.zeros(0, np.int64), case_json=None)
    exported = export(made.folder, tmp_path / "out", form)
    assert read(tmp_path / "out").truth is None
    assert form == "ros2" or any("No truth" in note for note in exported.notes)


def test_jpeg_pictures_become_png_of_the_same_pixels(make_sequence: Make, tmp_path: Path) -> None:
    made = make_sequence(jpeg_quality=80)
    exported = export(made.folder, tmp_path / "out", "euroc")
    assert any("JPEG" in note for note in exported.notes)
    for before, after in zip(Sequence.open(made.folder).frames(), read(tmp_path / "out").frames(), strict=True):
        np.testing.assert_array_equal(before.left, after.left)


def test_a_declared_calibration_error_is_said(rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path) -> None:
    told = rig_of()
    made = make_sequence(told, true_rig=true_rig(told, CalibrationError(focal_ratio=0.01, baseline_ratio=0.02)))
    notes = export(made.folder, tmp_path / "out", "euroc").notes
    assert any("the nominal one, which estimators are given" in note for note in notes)
    bag = export(made.folder, tmp_path / "bag", "ros2")
    assert any("/ground_truth/tf_static" in note for note in bag.notes)
    with AnyReader([tmp_path / "bag"]) as reader:
        assert {c.topic for c in reader.connections} >= {"/tf_static", "/ground_truth/tf_static"}


def test_a_camera_that_sees_all_around_goes_into_a_bag_and_is_refused_elsewhere(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(rig_of(Equirectangular(96, 48), stereo=False))
    assert any("no camchain.yaml" in note for note in export(made.folder, tmp_path / "bag", "ros2").notes)
    for form in ("euroc", "tum"):
        with pytest.raises(VobenchError, match="sees all around"):
            export(made.folder, tmp_path / form, form)


def test_a_bag_has_every_message_of_both_files_and_their_notes(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(rig_of(imu=True), depth=True)
    export(made.folder, tmp_path / "out", "ros2")

    def messages(paths: list[Path]) -> Iterator[tuple[str, int, bytes]]:
        with AnyReader(paths) as reader:
            for connection, t_ns, data in reader.messages():
                assert reader.deserialize(data, connection.msgtype) is not None
                yield connection.topic, t_ns, bytes(data)

    before = list(messages([made.folder / "sensors.mcap", made.folder / "truth.mcap"]))
    after = list(messages([tmp_path / "out"]))
    assert sorted(set(before)) == sorted(after), "/tf_static lies in both files and comes once"
    assert [t for _, t, _ in after] == sorted(t for _, t, _ in after)
    metadata = (tmp_path / "out/metadata.yaml").read_text(encoding="utf-8")
    assert all(name in metadata for name in ("vobench.wheels", "vobench.imu", "case.json", "truth_names.json"))


def test_a_calibrated_pair_that_stands_rectified_keeps_its_pixels_in_kitti(
    rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path
) -> None:
    made = make_sequence(rig_of(T_left_right=side_by_side(0.4)))
    exported = export(made.folder, tmp_path / "out", "kitti")
    assert any("pixels are unchanged" in note for note in exported.notes)
    stored = cv2.imread(str(tmp_path / "out/image_1/000003.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(stored, made.right[3])


@pytest.mark.parametrize("form", ["euroc", "tum", "ros2"])
def test_a_chain_that_puts_the_imu_elsewhere_is_refused(
    form: str, rig_of: Callable[..., Rig], make_sequence: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, camchain = make_sequence(rig_of(imu=True)), exporting.kalibr.camchain

    def nudged(rig: Rig, *more: Any) -> str:
        assert rig.imu
        T_body_imu = rig.imu.T_body_imu @ se3.transform(np.eye(3), [0.0, 0.0, 1e-8])
        return camchain(replace(rig, imu=replace(rig.imu, T_body_imu=T_body_imu)), *more)

    monkeypatch.setattr(exporting.kalibr, "camchain", nudged)
    with pytest.raises(SequenceError, match=r"camchain\.yaml, read back, puts the IMU \d\.\d*e-09 from its place"):
        export(made.folder, tmp_path / "out", form)


@pytest.mark.parametrize("form", FORMS)
def test_an_imu_that_said_nothing_and_a_single_frame_are_no_trouble(
    form: str, rig_of: Callable[..., Rig], tmp_path: Path
) -> None:
    rig = rig_of(imu=True)
    picture = np.arange(48 * 64, dtype=np.uint8).reshape(48, 64)
    with SequenceWriter(tmp_path / "sequence", rig, case_json=None) as writer:
        writer.write_frame(5, picture, picture)
    assert "imu.yaml" not in export(tmp_path / "sequence", tmp_path / "out", form).files
    assert read(tmp_path / "out").frame_count == 1


def random_path(seed: int, count: int, start_ns: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    t_ns = start_ns + np.cumsum(rng.integers(1, 10**8, count))
    R = Rotation.from_rotvec(rng.normal(size=(count, 3)) * rng.choice([1e-9, 1.0, 10.0])).as_matrix()
    return Trajectory(t_ns, se3.transform(R, rng.normal(size=(count, 3)) * rng.choice([1e-6, 1.0, 1e4])))


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 30),
    start_ns=st.sampled_from([0, 1_403_636_579_763_555_584, 10**18]),
    form=st.sampled_from(TRAJECTORY_FORMS),
)
def test_every_form_returns_stamps_exactly_and_poses_to_1e_9(
    seed: int, count: int, start_ns: int, form: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path, file = random_path(seed, count, start_ns), tmp_path_factory.mktemp("path") / "path.txt"
    written = export_trajectory(path, file, form)
    found = parse_any(file.read_text(encoding="utf-8"), name="path")
    has_times = form in FORMS_WITHOUT_STAMPS
    stamps = parse_times(written[1].read_text(encoding="utf-8"), name="times") if has_times else found.t_ns
    np.testing.assert_array_equal(stamps, path.t_ns)
    scale = max(1.0, float(np.abs(path.positions_m).max()))
    np.testing.assert_allclose(found.T, path.T_world_frame, atol=1e-9 * scale, rtol=0)
    np.testing.assert_array_equal(found.T[:, :3, 3], path.positions_m)


def test_euroc_says_its_unit_and_order_and_tum_is_what_evo_reads(tmp_path: Path) -> None:
    path = random_path(1, 4, 10**18)
    export_trajectory(path, tmp_path / "path.csv", "euroc")
    header, first, *_ = (tmp_path / "path.csv").read_text(encoding="utf-8").splitlines()
    assert header.startswith("#timestamp [ns], p_RS_R_x [m]")
    assert [name.split("_")[-1][0] for name in header.split(", ")[4:]] == list("wxyz")
    assert int(first.split(",")[0]) == path.t_ns[0]
    export_trajectory(path, tmp_path / "path.tum", "tum")
    rows = np.loadtxt(tmp_path / "path.tum")
    np.testing.assert_allclose(Rotation.from_quat(rows[:, 4:]).as_matrix(), path.T_world_frame[:, :3, :3], atol=1e-12)


def test_a_file_that_is_there_and_an_unknown_form_are_sentences(tmp_path: Path) -> None:
    path, file = random_path(2, 3, 0), tmp_path / "path.txt"
    with pytest.raises(InputError, match=r"no form of trajectory 'csv'\. Known: tum, kitti, euroc, tartanair"):
        export_trajectory(path, file, "csv")
    assert not list(tmp_path.iterdir())
    export_trajectory(path, file, "kitti")
    before = {one: one.read_bytes() for one in tmp_path.iterdir()}
    assert {one.name for one in before} == {"path.txt", "path.times.txt"}
    file.unlink()
    for form in ("kitti", "tum"):
        if form == "tum":
            file.write_text("mine")
        with pytest.raises(InputError, match="the file exists already"):
            export_trajectory(path, file, form)
    assert (tmp_path / "path.times.txt").read_bytes() == before[tmp_path / "path.times.txt"]
