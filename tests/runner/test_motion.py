"""Every kind of trajectory is one exact motion, from which poses, speeds, wheels and stamps all come."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import SuiteError
from vobench.geometry import se3
from vobench.motion.controller import CONTROLLERS
from vobench.motion.disturbance import DISTURBANCE_STREAMS
from vobench.motion.drive import drive
from vobench.motion.slip import SLIPS
from vobench.runner.motion import body_motion, body_motions, generator
from vobench.suite.scene_spec import MoverSpec, PathKey
from vobench.suite.suite import read_plan

POSES = "[{t_s: 5, position_m: [0, 0, 1]}, {t_s: 6, position_m: [1, 0, 1.2], pitch_deg: 10}, {t_s: 7, position_m: [1, 1, 1], yaw_deg: 60}]"  # fmt: skip
WAYS = {
    "waypoints": "targets_m: [[0.5, 0.3]], tolerance_m: 0.05",
    "ideal": "targets_m: [[0.5, 0.3]], tolerance_m: 0.05, mover: unicycle",
    "clock": "targets_m: [[0.5, 0.3], [0, 1]], leg_s: 1",
    "rough": "targets_m: [[0.5, 0.3]], tolerance_m: 0.05, slip: slippery, delta: bumpy, robot_spread: 0.1, floor: [{surface: wet, center_m: [0.2, 0.1], size_m: [0.2, 1]}]",
    "circle": "kind: circle, radius_m: 0.5, laps: 0.4",
    "circle_ideal": "kind: circle, radius_m: 0.5, mover: unicycle, start_m: [1, 2], start_heading_deg: 30",
    "circle_car": "kind: circle, radius_m: 1, mover: ackermann, speed_mps: 1, laps: 0.3",
    "square": "kind: square, side_m: 0.5, mover: unicycle",
    "figure_8": "kind: figure_8, length_m: 1.5, mover: unicycle",
    "lissajous": "kind: lissajous, size_m: [2, 1.5], mover: unicycle, speed_mps: 0.7",
    "stop_and_go": "kind: stop_and_go, legs_m: [0.3, 0.2]",
    "pure_rotation": "kind: pure_rotation, angle_deg: -180, slip: slippery",
    "rotation_ideal": "kind: pure_rotation, angle_deg: -180, mover: unicycle",
    "reverse": "kind: reverse, length_m: 0.5, radius_m: 1, pause_s: 0.3, delta: nominal",
    "reverse_car": "kind: reverse, length_m: 0.5, radius_m: 1, pause_s: 0.3, mover: ackermann, speed_mps: 0.5",
    "pose_spline": f"kind: pose_spline, poses: {POSES}",
    "handheld": f"kind: handheld, poses: {POSES}, ease_s: 0.5",
    "rail": "kind: rail, points_m: [[0, 0, 1], [1, 0.2, 1.3], [1, 1, 1]]",
    "quadrotor": "kind: quadrotor, points_m: [[0, 0, 1], [1, 0.2, 1.3], [1, 1, 1]]",
    "replay": "kind: replay, file: way.tum, start_m: [1, 2, 1], start_heading_deg: 90",
}
FLYING = tuple(WAYS)[-5:]


@pytest.fixture
def case(tmp_path):
    """The case of one trajectory in the built-in room."""
    rows = (f"{k / 10} {k / 20} {(k / 30) ** 2} 1 0 0 0 1\n" for k in range(40))
    (tmp_path / "way.tum").write_text("".join(rows))

    def read(way: str, *, seed: int = 1):
        text = f"name: it\nseed: {seed}\nscenes: [room]\nrigs: {{it: {{pitch_deg: 10}}}}\nestimators: [stand_still]\n"
        (tmp_path / "it.yaml").write_text(f"{text}trajectories: {{way: {{{way}}}}}\n")
        return read_plan(str(tmp_path / "it.yaml")).simulated[0]

    return read


@pytest.mark.parametrize("name", WAYS)
def test_velocity_is_the_slope_of_position_and_acceleration_that_of_velocity(case, name):
    travel = body_motion(case(WAYS[name]))
    motion, half_ns = travel.motion, 20_000
    # Away from where acceleration may jump.
    amid = np.linspace(motion.start_ns, motion.end_ns, 57)[1:-1]
    near = np.abs(amid[:, None] - motion.breaks_ns).min(1, initial=np.inf) if len(motion.breaks_ns) else np.inf
    amid = amid[near > 2 * half_ns] if len(motion.breaks_ns) else amid
    before, now, after = (motion.at(amid + shift) for shift in (-half_ns, 0, half_ns))
    R, step_s = now.T_world_body[:, :3, :3], 2 * half_ns / 1e9

    def slope(later, earlier):
        return np.einsum("kji,kj->ki", R, later - earlier) / step_s

    np.testing.assert_allclose(
        slope(after.T_world_body[:, :3, 3], before.T_world_body[:, :3, 3]), now.velocity_mps, atol=1e-6
    )
    speeds = [np.einsum("kij,kj->ki", m.T_world_body[:, :3, :3], m.velocity_mps) for m in (after, before)]
    np.testing.assert_allclose(slope(*speeds), now.acceleration_mps2, atol=1e-4)
    turned = np.swapaxes(before.T_world_body[:, :3, :3], -1, -2) @ after.T_world_body[:, :3, :3]
    skew = (turned - np.swapaxes(turned, -1, -2)) / 2 / step_s
    np.testing.assert_allclose(
        np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1), now.angular_velocity_radps, atol=1e-6
    )
    np.testing.assert_allclose(
        (after.angular_velocity_radps - before.angular_velocity_radps) / step_s,
        now.angular_acceleration_radps2,
        atol=1e-4,
    )


@pytest.mark.parametrize("name", WAYS)
def test_stamps_begin_at_0_and_are_index_over_rate_and_every_one_is_an_encoders_too(case, name):
    spec = case(f"{WAYS[name]}, rate_hz: 24")
    travel = body_motion(spec)
    np.testing.assert_array_equal(travel.t_ns, np.rint(np.arange(len(travel.t_ns)) * 1e9 / 24).astype(np.int64))
    assert abs(travel.motion.end_ns - travel.t_ns[-1]) <= 1e9 / 24
    assert (travel.rims is None) == (spec.build_rig().wheels is None) == (name in FLYING)
    if travel.rims:
        np.testing.assert_array_equal(travel.rims.t_ns[::4], travel.t_ns)


@pytest.mark.parametrize("name", WAYS)
def test_the_same_seed_goes_the_same_way_to_the_last_bit(case, name):
    once, again, other = (body_motion(case(WAYS[name], seed=seed)).at_frames() for seed in (1, 1, 2))
    assert once.T_world_body.tobytes() == again.T_world_body.tobytes()
    has_chance = name in {
        "waypoints",
        "clock",
        "rough",
        "circle",
        "stop_and_go",
        "pure_rotation",
        "reverse",
        "handheld",
    }
    assert (once.T_world_body.tobytes() != other.T_world_body.tobytes()) == has_chance


def test_waypoints_are_the_controllers_drive_and_nothing_else(case):
    travel = body_motion(case("targets_m: [[0.5, 0.3], [0, 1]], start_m: [0.1, 0], start_heading_deg: 20"))
    rngs = {stream: generator(1, f"slip.{stream}") for stream in DISTURBANCE_STREAMS}
    start = (0.1, 0.0, np.deg2rad(20))
    alone = drive([[0.5, 0.3], [0, 1]], start=start, controller=CONTROLLERS["smooth"], slip=SLIPS["nominal"], rngs=rngs)
    assert travel.drive.state.tobytes() == alone.state.tobytes()
    assert travel.motion.pieces.tobytes() == alone.motion.pieces.tobytes()


@pytest.mark.parametrize("more", ["delta: bumpy", "robot_spread: 0.2", "controller: easy", "max_accel_mps2: 0.1"])
def test_whatever_else_moves_the_robot_leaves_the_draws_of_slip(case, more):
    plain, moved = (body_motion(case(f"targets_m: [[0.5, 0.3]], leg_s: 1{text}")).drive for text in ("", f", {more}"))
    assert plain.slip.any()
    assert plain.slip.tobytes() == moved.slip.tobytes()
    assert plain.state.tobytes() != moved.state.tobytes()
    assert (plain.delta.any(), moved.delta.any()) == (False, more == "delta: bumpy")


@pytest.mark.parametrize("more", ["slip: slippery", "slip: none", "robot_spread: 0.2"])
def test_whatever_else_moves_the_robot_leaves_the_draws_of_the_pushes(case, more):
    way = "targets_m: [[0.5, 0.3]], leg_s: 1, delta: bumpy"
    plain, moved = (body_motion(case(f"{way}{text}")).drive for text in ("", f", {more}"))
    assert plain.delta.tobytes() == moved.delta.tobytes()
    assert plain.state.tobytes() != moved.state.tobytes()


def test_the_perturbed_robot_is_the_same_one_however_it_slips(case):
    way = "targets_m: [[0.5, 0.3]], leg_s: 1, robot_spread: 0.2"
    thetas = [
        body_motion(case(f"{way}, slip: {slip}", seed=seed)).drive.theta
        for slip, seed in (("none", 1), ("slippery", 1), ("none", 2))
    ]
    assert thetas[0] == thetas[1] != thetas[2]


def test_a_wet_floor_under_wheels_that_do_not_slide_sideways_turns_the_rims_further_and_nothing_else(case):
    way = "targets_m: [[0.5, 0.3]], leg_s: 3, slip: none"
    dry, wet = (
        body_motion(case(f"{way}, floor: [{{surface: wet, center_m: [0, 0], size_m: {size}}}]"))
        for size in ("[0.01, 0.01]", "[4, 4]")
    )
    assert dry.at_frames().T_world_body.tobytes() == wet.at_frames().T_world_body.tobytes()
    np.testing.assert_allclose(wet.rims.rim_rad[-1] * 0.96, dry.rims.rim_rad[-1], rtol=1e-3)


def test_the_pioneer_comes_after_the_ideal_robot_within_its_lag(case):
    way = "kind: circle, radius_m: 1, slip: none"
    led, ideal = (body_motion(case(text)) for text in (way, "kind: circle, radius_m: 1, mover: unicycle"))
    np.testing.assert_array_equal(led.t_ns, ideal.t_ns)
    places = [travel.at_frames().T_world_body[:, :2, 3] for travel in (led, ideal)]
    np.testing.assert_array_equal(places[0][0], places[1][0])
    away = np.linalg.norm(places[0] - places[1], axis=1)
    assert 0.005 < away.max() < 0.15


@pytest.mark.parametrize(
    "way", ["kind: pure_rotation, angle_deg: 400", "kind: reverse, length_m: 1.5, radius_m: -1, pause_s: 1"]
)
def test_the_pioneer_goes_back_and_turns_on_the_spot_as_the_ideal_robot_does_but_for_slip(case, way):
    ideal, dry, wet = (
        body_motion(case(f"{way}, {more}, start_m: [0.3, 1], start_heading_deg: 70")).at_frames().T_world_body
        for more in ("mover: unicycle", "slip: none", "slip: slippery, delta: bumpy")
    )
    np.testing.assert_allclose(dry, ideal, atol=2e-4)
    assert 0.01 < np.abs(wet - ideal).max() < 1


def test_another_robot_of_the_kind_is_told_the_same_and_ends_elsewhere(case):
    way = "kind: reverse, length_m: 1, radius_m: 2, slip: none"
    this, other = (body_motion(case(f"{way}, robot_spread: {spread}")).drive for spread in (0, 0.2))
    assert this.references.tobytes() == other.references.tobytes()
    assert np.linalg.norm(this.state[-1, :2] - other.state[-1, :2]) > 1e-4


@pytest.mark.parametrize(
    ("mover", "half_track_m", "radius_m"), [("unicycle", 0.1655, 0.0975), ("ackermann", 0.125, 0.05)]
)
def test_wheels_roll_as_far_as_the_ground_goes_by_under_them(case, mover, half_track_m, radius_m):
    rims = body_motion(case(f"kind: circle, radius_m: 2, speed_mps: 1, mover: {mover}")).rims
    around_m = 2 * np.pi * np.array([2 - half_track_m, 2 + half_track_m])
    # A car comes in late by its steering's lag.
    tolerance = {"unicycle": 1e-6, "ackermann": 0.02}[mover]
    np.testing.assert_allclose(rims.rim_rad[-1] * radius_m, around_m, rtol=tolerance)


def test_a_car_steers_late_and_keeps_near_its_way(case):
    car, ideal = (
        body_motion(case(f"kind: figure_8, length_m: 8, speed_mps: 1, mover: {mover}")).at_frames().T_world_body
        for mover in ("ackermann", "unicycle")
    )
    assert 1e-4 < np.linalg.norm(car[:, :2, 3] - ideal[:, :2, 3], axis=1).max() < 0.3


def test_a_replay_starts_where_it_is_sent_and_keeps_its_shape(case):
    poses = body_motion(case(WAYS["replay"])).at_frames().T_world_body
    np.testing.assert_allclose(poses[0, :3, 3], [1, 2, 1], atol=1e-9)
    np.testing.assert_allclose(poses[0, :3, :3], se3.rotation_z(np.pi / 2), atol=1e-9)
    t_s = np.arange(len(poses)) / 30
    np.testing.assert_allclose(poses[:, 1, 3] - 2, t_s / 2, atol=1e-4)
    np.testing.assert_allclose(1 - poses[:, 0, 3], (t_s / 3) ** 2, atol=1e-4)


# ruff: noqa: E501 - a sentence stands in one line


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
        body_motions(at_height(0.4))
    said = str(refused.value)
    place = f"{tmp_path / 'boxed.yaml'}:5: trajectories.desk"
    assert said.startswith(f"{place}: a camera of rig 'down' runs into 'desk' of scene 'room' after")


def test_a_camera_inside_a_mover_is_refused_with_place_and_time(at_height, tmp_path):
    plan = at_height(0.9)
    keys = tuple(PathKey(t_s=t, position_m=(4.0 - 2 * t, -1.5, 1.2)) for t in (0, 1))
    cart = MoverSpec(name="cart", size_m=(0.4, 0.4, 0.8), material="brick", path=keys, repeats=True)
    scene = replace(plan.simulated[0].scene, movers=(cart,))
    with pytest.raises(SuiteError, match=r"a camera of rig 'down' runs into 'cart' of scene 'room' after"):
        body_motions(replace(plan, simulated=(replace(plan.simulated[0], scene=scene),)))


def test_a_camera_above_the_furniture_is_none_of_our_business(at_height):
    assert body_motions(at_height(0.9))["desk"].drive.reached


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
        body_motions(read_plan(str(tmp_path / "slow.yaml")))
    assert str(refused.value).startswith(f"{tmp_path / 'slow.yaml'}:7: cameras.slow: {sentence}")


class TestWaysOfAllKinds:
    """Bodies that fly may go where robots cannot, and no further."""

    def travelled(self, folder, trajectory, rig="pitch_deg: 10, forward_m: 0, height_m: 0"):
        text = f"name: air\nscenes: [room]\nrigs: {{it: {{{rig}}}}}\ntrajectories: {{way: {{{trajectory}}}}}\n"
        (folder / "air.yaml").write_text(text + "estimators: [stand_still]\n")
        return body_motions(read_plan(str(folder / "air.yaml")))["way"]

    def test_a_camera_at_the_bodys_own_place_is_where_the_body_flies(self, tmp_path):
        travel = self.travelled(tmp_path, "kind: rail, points_m: [[0, 0, 1], [1, 0, 1.5]]")
        assert travel.at_frames().T_world_body[-1, 2, 3] == pytest.approx(1.5)

    @pytest.mark.parametrize(
        ("trajectory", "sentence"),
        [
            ("kind: rail, points_m: [[0, 0, 1], [1, 0, -0.5]]", "a camera of rig 'it' is under the floor of scene 'room' after"),
            ("kind: quadrotor, points_m: [[0, 0, 1], [0, 0, 4]]", "a camera of rig 'it' leaves the room (10 × 10 × 3 m around the origin) of scene 'room' after"),
            ("kind: circle, radius_m: 1", "a camera of rig 'it' is under the floor of scene 'room' after 0.0 s"),
            ("kind: circle, radius_m: 1, speed_mps: 3", "the path of h moves at 1.32 m/s after 4.9 s, but the controller allows 0.75 m/s"),
            ("kind: circle, radius_m: 1000, mover: unicycle, rate_hz: 100", "2.095e+04 s at 100 Hz are 20945"),
            ("kind: square, side_m: 1, mover: ackermann", "a car cannot turn on the spot"),
            ("kind: pose_spline, poses: [{t_s: 5, position_m: [0, 0, 1]}, {t_s: 6, position_m: [1, 0, 1]}, {t_s: 6, position_m: [2, 0, 1]}]", "pose 2 is at 6 s, the same time as pose 1 at 6 s; times should increase"),
            ("kind: quadrotor, points_m: [[0, 0, 1], [0, 0.1, 1]], t_s: [0, 0.02]", "the trajectory ends within its first frame at 30 Hz"),
            ("targets_m: [[0, 0]]", "the trajectory ends within its first frame at 30 Hz"),
            ("kind: quadrotor, points_m: [[0, 0, 1], [1, 0, 1]], t_s: [5, 4]", "point 1 is at 4 s, earlier than point 0 at 5 s"),
            ("kind: pure_rotation, angle_deg: 720, turn_radps: 3", "the reference after 2.4 s is 3.21 rad/s, but the controller allows 1.745 rad/s"),
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
