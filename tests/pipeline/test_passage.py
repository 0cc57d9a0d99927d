"""A case that cannot be driven is refused before anything is rendered."""

# ruff: noqa: E501 - a sentence stands in one line

from dataclasses import replace

import pytest

from vobench.errors import SuiteError
from vobench.pipeline.passage import travel_all
from vobench.suite.expand import read_plan
from vobench.suite.scene_spec import MoverSpec

SUITE = """
name: boxed
scenes: [room]
rigs: {{down: {{pitch_deg: 90, height_m: {height_m}}}}}
trajectories: {{desk: {{targets_m: [[3.2, -1.5]]}}}}
estimators: [stand_still]
"""


@pytest.fixture
def at_height(tmp_path):
    """A drive to the desk of the built-in room, which is 0.8 m high, with cameras this high."""

    def plan(height_m):
        (tmp_path / "boxed.yaml").write_text(SUITE.format(height_m=height_m))
        return read_plan(str(tmp_path / "boxed.yaml"))

    return plan


def test_a_camera_inside_the_furniture_is_refused_with_place_and_time(at_height, tmp_path):
    with pytest.raises(SuiteError) as refused:
        travel_all(at_height(0.4))
    said = str(refused.value)
    assert said.startswith(
        f"{tmp_path / 'boxed.yaml'}:5: trajectories.desk: a camera of rig 'down' is inside the box of"
    )
    assert "wood at (3.2, -1.5, 0.4) m of scene 'room' after" in said


def test_a_camera_inside_a_mover_is_refused_with_place_and_time(at_height, tmp_path):
    plan = at_height(0.9)
    keys = tuple({"t_s": float(t), "position_m": (4.0 - 2 * t, -1.5, 1.2)} for t in (0, 1))
    cart = MoverSpec(name="cart", size_m=(0.4, 0.4, 0.8), material="wood", path=keys, repeats=True)
    scene = plan.simulated[0].scene.model_copy(update={"movers": (cart,)})
    with pytest.raises(SuiteError, match=r"a camera of rig 'down' is inside the mover 'cart' of scene 'room' after"):
        travel_all(replace(plan, simulated=(plan.simulated[0].model_copy(update={"scene": scene}),)))


def test_a_camera_above_the_furniture_is_none_of_our_business(at_height):
    assert travel_all(at_height(0.9))["desk"].drive.reached


@pytest.mark.parametrize(
    ("camera", "sentence"),
    [
        ("exposure_ms: 40", "exposure_ms 40 is longer than a frame of trajectory 'desk', which lasts 33.3 ms at 30 Hz"),
        ("shutter: rolling, readout_ms: 34", "readout_ms 34 is longer"),
        ("auto_exposure: {t_max_ms: 50}", "auto_exposure.t_max_ms 50 is longer"),
    ],
)
def test_pictures_that_take_longer_than_a_frame_are_refused(tmp_path, camera, sentence):
    suite = SUITE.format(height_m=0.9) + f"cameras: {{slow: {{{camera}}}}}\n"
    (tmp_path / "slow.yaml").write_text(suite)
    with pytest.raises(SuiteError) as refused:
        travel_all(read_plan(str(tmp_path / "slow.yaml")))
    assert str(refused.value).startswith(f"{tmp_path / 'slow.yaml'}:7: cameras.slow: {sentence}")


class TestWaysOfAllKinds:
    """Bodies that fly may go where robots cannot, and no further."""

    def travelled(self, folder, trajectory, rig="pitch_deg: 10, forward_m: 0, height_m: 0"):
        text = f"name: air\nscenes: [room]\nrigs: {{it: {{{rig}}}}}\ntrajectories: {{way: {{{trajectory}}}}}\n"
        (folder / "air.yaml").write_text(text + "estimators: [stand_still]\n")
        return travel_all(read_plan(str(folder / "air.yaml")))["way"]

    def test_a_camera_at_the_bodys_own_place_is_where_the_body_flies(self, tmp_path):
        travel = self.travelled(tmp_path, "kind: rail, points_m: [[0, 0, 1], [1, 0, 1.5]]")
        assert travel.at_frames().T_world_body[-1, 2, 3] == pytest.approx(1.5)

    @pytest.mark.parametrize(
        ("trajectory", "sentence"),
        [
            ("kind: rail, points_m: [[0, 0, 1], [1, 0, -0.5]]", "a camera of rig 'it' is under the floor of scene 'room' after"),
            ("kind: quadrotor, points_m: [[0, 0, 1], [0, 0, 4]]", "a camera of rig 'it' leaves the room (10 × 10 × 3 m around the origin) of scene 'room' after"),
            ("kind: circle, radius_m: 1", "a camera of rig 'it' is under the floor of scene 'room' after 0.0 s"),
            ("kind: circle, radius_m: 1, speed_mps: 3", "the path of h moves at 1.32 m/s after 4.9 s, and the controller gives 0.75 m/s at most"),
            ("kind: circle, radius_m: 1000, mover: unicycle, rate_hz: 100", "2.095e+04 s at 100 Hz are 20945"),
            ("kind: square, side_m: 1, mover: ackermann", "a car cannot turn on the spot"),
            ("kind: pose_spline, poses: [{t_s: 5, position_m: [0, 0, 1]}, {t_s: 6, position_m: [1, 0, 1]}, {t_s: 6, position_m: [2, 0, 1]}]", "pose 2 is at 6 s, the same time as pose 1 at 6 s; times should rise"),
            ("kind: quadrotor, points_m: [[0, 0, 1], [0, 0.1, 1]], t_s: [0, 0.02]", "the way ends within its first frame at 30 Hz"),
            ("targets_m: [[0, 0]]", "the way ends within its first frame at 30 Hz"),
            ("kind: quadrotor, points_m: [[0, 0, 1], [1, 0, 1]], t_s: [5, 4]", "point 1 is at 4 s, earlier than point 0 at 5 s"),
            ("kind: pure_rotation, angle_deg: 720, turn_radps: 3", "the robot would be asked for 3.21 rad/s after 2.4 s, and 1.745 rad/s is the most"),
            ("targets_m: [[1, 0]], controller: paper, integrator: euler, substeps: 1, rate_hz: 10", "gain_per_s 10 at 10 Hz with euler"),
        ],
    )  # fmt: skip
    def test_a_way_that_cannot_be_gone_is_one_sentence(self, tmp_path, trajectory, sentence):
        with pytest.raises(SuiteError) as refused:
            self.travelled(tmp_path, trajectory)
        assert str(refused.value).startswith(f"{tmp_path / 'air.yaml'}:4: trajectories.way: {sentence}")

    @pytest.mark.parametrize("y_m", [-4.5, 4.5])
    def test_either_camera_may_be_the_one_that_leaves_the_room(self, tmp_path, y_m):
        way = f"kind: rail, points_m: [[-1, {y_m}, 1], [-0.5, {y_m}, 1]]"
        assert len(self.travelled(tmp_path, way).t_ns) > 50
        with pytest.raises(SuiteError, match="leaves the room"):
            self.travelled(tmp_path, way, "pitch_deg: 10, forward_m: 0, height_m: 0, baseline_m: 1.5")

    @pytest.mark.parametrize(("exact", "imu"), [(True, False), (False, True), (True, True)])
    def test_an_imu_and_an_exact_replay_do_not_go_together(self, tmp_path, exact, imu):
        rows = "".join(f"{k / 10} {k / 20} 0 1 0 0 0 1\n" for k in range(30))
        (tmp_path / "it.tum").write_text(rows)
        rig = f"pitch_deg: 10, forward_m: 0, height_m: 0{', imu: exact' if imu else ''}"
        trajectory = f"kind: replay, file: it.tum, exact: {str(exact).lower()}"
        if exact and imu:
            with pytest.raises(SuiteError, match="the IMU of rig 'it' would feel the noise of an exact replay"):
                self.travelled(tmp_path, trajectory, rig)
        else:
            assert len(self.travelled(tmp_path, trajectory, rig).t_ns) == 88
