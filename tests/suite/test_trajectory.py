"""What a trajectory, a replayed file and an IMU may say, and the one sentence for what they may not."""

import re
from dataclasses import fields
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from pydantic import TypeAdapter

from vobench.errors import SuiteError
from vobench.geometry import se3
from vobench.motion.encoder import ENCODERS
from vobench.motion.motor import MotorConstants, theta_of
from vobench.motion.wheeled import Wheeled
from vobench.setting import hints
from vobench.suite.suite import read_plan
from vobench.suite.trajectory import KINDS, TrajectorySpec
from vobench.trajectory.kitti import format_kitti
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum, parse_tum

# ruff: noqa: E501 - a sentence stands in one line


DEFAULT = "{targets_m: [[0.5, 0]]}"
POSES = "[{t_s: 0, position_m: [0, 0, 1]}, {t_s: 1, position_m: [1, 0, 1]}, {t_s: 2, position_m: [1, 1, 1]}]"
# A valid trajectory of each kind, with no more keys than it needs.
LEAST = {
    "waypoints": "targets_m: [[0.5, 0]]",
    "circle": "radius_m: 1",
    "square": "side_m: 1",
    "figure_8": "length_m: 1",
    "lissajous": "size_m: [1, 1]",
    "stop_and_go": "legs_m: [1]",
    "pure_rotation": "angle_deg: 90",
    "reverse": "length_m: 1",
    "pose_spline": f"poses: {POSES}",
    "handheld": f"poses: {POSES}",
    "rail": "points_m: [[0, 0, 1], [1, 0, 1]]",
    "quadrotor": "points_m: [[0, 0, 1], [1, 0, 1]]",
    "replay": "file: path.tum",
    "wander": "length_m: 4",
}
ON_WHEELS = tuple(LEAST)[:8]
KIND = TypeAdapter(TrajectorySpec)


@pytest.fixture
def trajectory(bent, tmp_path):
    """The trajectory that some YAML comes to, in a suite that is otherwise right."""
    (tmp_path / "path.tum").write_text(format_tum(way()))
    return lambda text: bent((DEFAULT, text)).suite.trajectories["short"]


def way(*, count: int = 30, lean_rad: float = 0.0) -> Trajectory:
    """A path along x at 10 Hz, turning, whose body may lean to its right."""
    t = np.arange(count) / 10
    R_lean = np.array([[1, 0, 0], [0, np.cos(lean_rad), -np.sin(lean_rad)], [0, np.sin(lean_rad), np.cos(lean_rad)]])
    poses = se3.transform(se3.rotation_z(t / 5) @ R_lean, np.stack([t, t**2 / 9, 0 * t], -1))
    return Trajectory((np.arange(count) * 100_000_000).astype(np.int64), poses)


def test_there_is_an_example_of_every_kind_here():
    assert set(LEAST) == set(KINDS)


@pytest.mark.parametrize("kind", LEAST)
def test_every_kind_needs_few_keys_and_goes_through_json_unchanged(trajectory, kind):
    spec = trajectory(f"{{kind: {kind}, {LEAST[kind]}}}")
    assert spec.kind == kind
    assert type(spec) is KINDS[kind]
    assert KIND.validate_json(KIND.dump_json(spec)) == spec


def test_without_a_kind_it_is_waypoints_as_ever(trajectory):
    assert trajectory(DEFAULT) == trajectory("{kind: waypoints, targets_m: [[0.5, 0]]}")
    assert trajectory(DEFAULT).mover == "pioneer"


def test_motors_stand_in_for_theta_and_for_the_wheels_and_leave_no_trace_where_they_are_not_given(trajectory):
    motors = trajectory("{targets_m: [[1, 0]], motors: {r_m: 0.1, d_m: 0.4}}")
    assert motors.theta == theta_of(MotorConstants(r_m=0.1, d_m=0.4))
    assert (motors.wheels.radius_m, motors.wheels.track_m) == (0.1, 0.4)
    assert KIND.validate_json(KIND.dump_json(motors)) == motors
    assert [key in KIND.dump_python(motors) for key in ("robot", "motors")] == [False, True]
    assert [key in KIND.dump_python(trajectory(DEFAULT)) for key in ("robot", "motors")] == [True, False]


def test_encoders_have_one_set_of_errors_for_each_name():
    assert set(ENCODERS) == set(get_args(hints(Wheeled)["encoders"]))


@pytest.mark.parametrize("kind", ON_WHEELS)
def test_what_is_dumped_holds_no_key_of_another_mover(trajectory, kind):
    dumped = KIND.dump_python(trajectory(f"{{kind: {kind}, {LEAST[kind]}, mover: unicycle}}"))
    assert "slip" not in dumped
    assert "car" not in dumped
    assert {"mover", "encoders", "rate_hz", *KINDS[kind].__annotations__} - {"mover_keys"} <= set(dumped)


WRONG = [
    ("{kind: cirle, radius_m: 1}", ".kind: no kind of trajectory named 'cirle'. Did you mean 'circle'? Known: circle, figure_8, handheld, lissajous, pose_spline, pure_rotation, quadrotor, rail, replay, reverse, square, stop_and_go, wander, waypoints"),
    ("{kind: 3, radius_m: 1}", ".kind: no kind of trajectory named '3'. Known: circle, figure_8, handheld, lissajous, pose_spline, pure_rotation, quadrotor, rail, replay, reverse, square, stop_and_go, wander, waypoints"),
    ("{kind: {a: 1}, radius_m: 1}", ".kind: no kind of trajectory named '{'a': 1}'. Known: circle, figure_8, handheld, lissajous, pose_spline, pure_rotation, quadrotor, rail, replay, reverse, square, stop_and_go, wander, waypoints"),
    ("3", ": should be keys with values (got 3)"),
    ("{kind: circle}", ".radius_m: this key is missing"),
    ("{kind: circle, radius_m: -1}", ".radius_m: should be greater than 0 (got -1)"),
    ("{kind: rail, points_m: [[0, 0, 1], [1, 0, 1]], speed: 1}", ".speed: unknown key. Did you mean 'speed_mps'? Known: accel_mps2, kind, mount, points_m, rate_hz, speed_mps"),
    ("{kind: rail, points_m: [[0, 0, 1], [1, 0, 1]], slip: none}", ".slip: belongs to circle, figure_8, lissajous, pure_rotation, reverse, square, stop_and_go, waypoints; this is rail"),
    ("{radius_m: 1, targets_m: [[1, 1]]}", ".radius_m: belongs to circle, reverse; the kind is waypoints by default"),
    ("{kind: circle, radius_m: 1, targets_m: [[1, 1]]}", ".targets_m: belongs to waypoints; this is circle"),
    ("{kind: circle, radius_m: 1, side_m: 2}", ".side_m: belongs to square; this is circle"),
    ("{kind: circle, radius_m: 1, mover: unicycle, slip: none}", ".slip: does not belong to mover 'unicycle', which has accel_mps2, clockwise, encoders, kind, laps, mount, mover, radius_m, rate_hz, speed_mps, start_heading_deg, start_m"),
    ("{kind: circle, radius_m: 1, car: small_robot}", ".car: does not belong to mover 'pioneer'"),
    ("{targets_m: [[1, 0]], mover: unicycle, floor: [{surface: wet, center_m: [0, 0], size_m: [1, 1]}]}", ".floor: does not belong to mover 'unicycle'"),
    ("{targets_m: [[1, 0]], mover: ackermann}", ".mover: should be one of pioneer, unicycle here (got 'ackermann')"),
    ("{kind: pure_rotation, angle_deg: 90, mover: ackermann}", ".mover: should be one of pioneer, unicycle here (got 'ackermann')"),
    ("{targets_m: [[1, 0]], mover: tank}", ".mover: should be 'pioneer', 'unicycle' or 'ackermann' (got 'tank')"),
    ("{targets_m: [[1, 0]], floor: [{surface: wett, center_m: [0, 0], size_m: [1, 1]}]}", ".floor.0.surface: no surface named 'wett'. Did you mean 'wet'? Known: carpet, seam, wet"),
    ("{kind: handheld, poses: [{t_s: 0, position_m: [0, 0, 1]}]}", ".poses: should have 3 or more entries, but has 1"),
    ("{kind: handheld, poses: [{t_s: 0, position_m: [0, 0, 1], yaw: 3}, {t_s: 1, position_m: [0, 0, 1]}, {t_s: 2, position_m: [0, 0, 1]}]}", ".poses.0.yaw: unknown key. Did you mean 'yaw_deg'? Known: pitch_deg, position_m, roll_deg, t_s, yaw_deg"),
    ("{kind: pure_rotation, angle_deg: 0}", ".angle_deg: should be another angle than 0"),
    ("{kind: reverse, length_m: 1, controller: paper}", ".controller: does not belong to mover 'pioneer'"),
    ("{kind: replay, file: path.tum, axes: eurok}", ".axes: no convention of axes named 'eurok'. Did you mean 'euroc'? Known: body, camera, euroc, kitti, tartanair"),
    ("{kind: replay, file: path.tum, axes: 'axes:x,x,z'}", ".axes: axes are x, y and z, each once, with or without a minus, such as z,-x,-y; not 'axes:x,x,z'"),
    ("{kind: lissajous, size_m: [1, 1], ratio: [2, 4]}", ".ratio: should be two whole numbers from 1 to 20 without a common divisor (got [2, 4])"),
    ("{targets_m: [[1, 0]], encoders: bad}", ".encoders: should be 'exact' or 'nominal' (got 'bad')"),
    ("{targets_m: [[1, 0]], robot: pioneer_2, motors: {}}", ".motors: sets the robot, which robot sets as well; remove one of them"),
    ("{targets_m: [[1, 0]], mover: unicycle, motors: {}}", ".motors: does not belong to mover 'unicycle'"),
    ("{targets_m: [[1, 0]], motors: {m_kg: 0}}", ".motors.m_kg: should be greater than 0 (got 0)"),
    ("{targets_m: [[1, 0]], motors: {m: 9}}", ".motors.m: unknown key. Known: Be_Nmsprad, Ie_kgm2"),
    ("{kind: replay, file: path.tum, start_heading_deg: 90}", ".start_heading_deg: belongs to start_m; without it the body starts as recorded"),
]  # fmt: skip


@pytest.mark.parametrize(("text", "sentence"), WRONG, ids=[text for text, _ in WRONG])
def test_a_wrong_trajectory_is_one_sentence_with_file_line_and_key(trajectory, tmp_path, text, sentence):
    with pytest.raises(SuiteError) as refused:
        trajectory(text)
    said = str(refused.value)
    assert said.startswith(f"{tmp_path / 'tiny.yaml'}:6: trajectories.short{sentence}")
    assert "\n" not in said


def test_the_line_is_that_of_the_key_also_where_the_trajectory_has_many(trajectory):
    with pytest.raises(SuiteError, match=r"tiny\.yaml:10: trajectories\.short\.slip: does not belong"):
        trajectory("{\n kind: circle,\n radius_m: 1,\n mover: unicycle,\n slip: none}")


def test_a_patch_ends_at_its_corners(trajectory):
    patch = trajectory(
        "{targets_m: [[1, 0]], floor: [{surface: wet, center_m: [1, 2], size_m: [0.4, 0.2], yaw_deg: 30}]}"
    ).floor[0]
    corners = patch.corners_m - patch.center_m
    assert [patch.contains(*(0.999 * corner + patch.center_m)) for corner in corners] == [True] * 4
    assert [patch.contains(*(1.001 * corner + patch.center_m)) for corner in corners] == [False] * 4


class TestReplay:
    """The file's content is part of the case; its name and place are not."""

    def case(self, bent, **more):
        keys = "".join(f", {key}: {value}" for key, value in more.items())
        return bent((DEFAULT, f"{{kind: replay{keys}}}")).simulated[0]

    def test_what_the_file_holds_is_in_the_case_wherever_it_lies(self, bent, tmp_path):
        (tmp_path / "deep").mkdir()
        for name in ("a.tum", "deep/b.txt"):
            (tmp_path / name).write_text(format_tum(way()))
        here, there = (self.case(bent, file=name) for name in ("a.tum", "deep/b.txt"))
        assert here.replayed == there.replayed
        (tmp_path / "a.tum").write_text(format_tum(way(count=29)))
        assert self.case(bent, file="a.tum").replayed != there.replayed

    def test_kitti_comes_out_in_our_axes_with_times_or_a_rate(self, bent, tmp_path):
        ours = way()
        S = np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]])  # to right, down, ahead
        optical = se3.transform(S @ ours.T_world_frame[:, :3, :3] @ S.T, ours.positions_m @ S.T)
        (tmp_path / "00.txt").write_text(format_kitti(optical))
        (tmp_path / "times.txt").write_text("".join(f"{k / 10}\n" for k in range(30)))
        for more in ({"times": "times.txt"}, {"recorded_hz": 10}):
            read = parse_tum(self.case(bent, file="00.txt", axes="kitti", **more).replayed, name="it")
            np.testing.assert_array_equal(read.t_ns, ours.t_ns)
            np.testing.assert_allclose(read.T_world_frame, ours.T_world_frame, atol=1e-12)

    def test_eurocs_body_has_its_x_axis_up_and_ours_ahead(self, bent, tmp_path):
        ours = way(lean_rad=0.2)
        R_body_imu = np.array([[0.0, 0, 1], [0, -1, 0], [1, 0, 0]])  # columns: its up, right and ahead
        its = se3.transform(ours.T_world_frame[:, :3, :3] @ R_body_imu, ours.positions_m)
        (tmp_path / "it.tum").write_text(format_tum(Trajectory(ours.t_ns, its)))
        read = parse_tum(self.case(bent, file="it.tum", axes="euroc").replayed, name="it")
        np.testing.assert_allclose(read.T_world_frame, ours.T_world_frame, atol=1e-12)

    @pytest.mark.parametrize(
        ("files", "more", "sentence"),
        [
            ({}, {"file": "no.tum"}, "cannot read {0}/no.tum: No such file or directory"),
            ({"a.tum": ""}, {"file": "a.tum"}, "no pose, because the file is empty: {0}/a.tum"),
            ({"a.tum": format_tum(way())}, {"file": "a.tum", "recorded_hz": 10}, "times and recorded_hz are for files without stamps, but this file has stamps: {0}/a.tum"),
            ({"k.txt": format_kitti(np.tile(np.eye(4), (3, 1, 1)))}, {"file": "k.txt"}, "no stamps in k.txt; set times, to a file with stamps, or recorded_hz"),
            ({"k.txt": format_kitti(np.tile(np.eye(4), (3, 1, 1))), "t.txt": "1\n2\n"}, {"file": "k.txt", "times": "t.txt"}, "2 stamps in t.txt for 3 poses in k.txt"),
        ],
        ids=["missing", "empty", "stamped", "unstamped", "too few times"],
    )  # fmt: skip
    def test_a_file_that_cannot_be_replayed_is_one_sentence(self, bent, tmp_path, files, more, sentence):
        for name, text in files.items():
            (tmp_path / name).write_text(text)
        with pytest.raises(SuiteError) as refused:
            self.case(bent, **more)
        assert str(refused.value) == f"{tmp_path / 'tiny.yaml'}:6: trajectories.short.file: {sentence.format(tmp_path)}"

    @pytest.mark.parametrize(
        ("times", "sentence"),
        [(None, "cannot read {0}/t.txt: No such file or directory"), ("0.1 2\n", "{0}/t.txt:1: ")],
    )
    def test_a_file_of_times_that_is_none_is_said_of_that_key(self, bent, tmp_path, times, sentence):
        (tmp_path / "k.txt").write_text(format_kitti(np.tile(np.eye(4), (3, 1, 1))))
        if times:
            (tmp_path / "t.txt").write_text(times)
        with pytest.raises(SuiteError) as refused:
            self.case(bent, file="k.txt", times="t.txt")
        said = f"{tmp_path / 'tiny.yaml'}:6: trajectories.short.times: {sentence.format(tmp_path)}"
        assert str(refused.value).startswith(said)


class TestImu:
    """An IMU on a rig: a preset by name, and what is different."""

    def rig(self, bent, imu, trajectory=DEFAULT):
        changes = [("pitch_deg: 90", f"pitch_deg: 90, imu: {imu}"), (DEFAULT, trajectory)]
        return bent(*changes).simulated[0].build_rig()

    def test_a_name_is_a_preset_as_it_is(self, bent):
        named, mapped = (self.rig(bent, imu).imu for imu in ("bmi055", "{like: bmi055}"))
        assert named.gyro_noise == mapped.gyro_noise > 0
        assert named.T_body_imu.tobytes() == np.eye(4).tobytes()

    def test_its_place_rate_and_single_properties_go_over_the_preset(self, bent):
        imu = self.rig(
            bent, "{like: bmi055, rate_hz: 100, position_m: [1, 2, 3], rotation_deg: [0, 0, 90], gyro: {noise: 0.5}}"
        ).imu
        preset = self.rig(bent, "bmi055").imu
        assert (imu.rate_hz, imu.gyro_noise, imu.accel_noise) == (100, 0.5, preset.accel_noise)
        np.testing.assert_allclose(imu.T_body_imu @ [1, 0, 0, 1], [1, 3, 3, 1], atol=1e-12)

    def test_without_one_there_is_none_and_on_wheels_there_are_wheels(self, bent):
        assert bent().simulated[0].build_rig().imu is None
        assert self.rig(bent, "bmi055").wheels is not None
        assert self.rig(bent, "bmi055", f"{{kind: rail, {LEAST['rail']}}}").wheels is None

    def test_a_car_has_the_wheels_of_a_car(self, bent):
        small, large = (
            self.rig(bent, "exact", f"{{kind: circle, radius_m: 9, mover: ackermann, car: {car}}}").wheels
            for car in ("small_robot", "kitti_like")
        )
        assert 4 * small.track_m < large.track_m

    @pytest.mark.parametrize(
        ("imu", "sentence"),
        [
            ("bmi56", ": no IMU named 'bmi56'. Did you mean 'bmi055'? Known: adis16448, bmi055, exact, mpu6000"),
            ("{like: bmi055, gyro: {noise: -1}}", ".gyro.noise: should be 0 or more (got -1)"),
            ("{like: bmi055, rate: 100}", ".rate: unknown key. Did you mean 'rate_hz'? Known: accel, gyro, like, position_m, rate_hz, rotation_deg"),
            ("3", ": should be keys with values (got 3)"),
        ],
    )  # fmt: skip
    def test_a_wrong_imu_is_one_sentence(self, bent, tmp_path, imu, sentence):
        with pytest.raises(SuiteError) as refused:
            self.rig(bent, imu)
        assert str(refused.value) == f"{tmp_path / 'tiny.yaml'}:5: rigs.down.imu{sentence}"


DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("spec", [*KINDS.values(), MotorConstants], ids=lambda spec: spec.__name__)
def test_every_key_is_in_the_docs_with_its_default(spec):
    page = (DOCS / "trajectories.md").read_text(encoding="utf-8")
    entries = [line for line in page.splitlines() if line.startswith(("| ", "- "))]  # of tables and lists
    for field in fields(spec):
        assert f"`{field.name}`" in page, field.name
        if isinstance(field.default, float) and field.default:
            of_key = [entry for entry in entries if f"`{field.name}`" in re.split(r" \||: ", entry[2:])[0]]
            assert any(f"{field.default:g}" in entry for entry in of_key), (field.name, of_key)


def test_the_suite_of_the_docs_has_every_kind_but_replay(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "trajectories.md").read_text(encoding="utf-8").split("```yaml\n")[1].split("```")[0]
    (tmp_path / "ways.yaml").write_text(text)
    kinds = {spec.kind for spec in read_plan("./ways.yaml").suite.trajectories.values()}
    assert kinds == set(KINDS) - {"replay"}
