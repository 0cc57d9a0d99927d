"""Every kind of trajectory is one exact motion, from which poses, speeds, wheels and stamps all come."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.pipeline.motion import travel_of
from vobench.pipeline.stream import generator
from vobench.robot.controller import CONTROLLERS
from vobench.robot.disturbance import STREAMS
from vobench.robot.drive import drive
from vobench.robot.slip import SLIPS
from vobench.suite.expand import read_plan

POSES = "[{t_s: 5, position_m: [0, 0, 1]}, {t_s: 6, position_m: [1, 0, 1.2], pitch_deg: 10}, {t_s: 7, position_m: [1, 1, 1], yaw_deg: 60}]"  # fmt: skip # noqa: E501
WAYS = {
    "waypoints": "targets_m: [[0.5, 0.3]], tolerance_m: 0.05",
    "ideal": "targets_m: [[0.5, 0.3]], tolerance_m: 0.05, mover: unicycle",
    "clock": "targets_m: [[0.5, 0.3], [0, 1]], leg_s: 1",
    "rough": "targets_m: [[0.5, 0.3]], tolerance_m: 0.05, slip: slippery, delta: bumpy, robot_spread: 0.1, floor: [{surface: wet, center_m: [0.2, 0.1], size_m: [0.2, 1]}]",  # noqa: E501
    "circle": "kind: circle, radius_m: 0.5",
    "circle_ideal": "kind: circle, radius_m: 0.5, mover: unicycle, start_m: [1, 2], start_heading_deg: 30",
    "circle_car": "kind: circle, radius_m: 1, mover: ackermann, speed_mps: 1",
    "square": "kind: square, side_m: 0.5, mover: unicycle",
    "figure_8": "kind: figure_8, length_m: 1.5, mover: unicycle",
    "lissajous": "kind: lissajous, size_m: [2, 1.5], mover: unicycle, speed_mps: 0.7",
    "stop_and_go": "kind: stop_and_go, legs_m: [0.3, 0.2]",
    "pure_rotation": "kind: pure_rotation, angle_deg: -180",
    "reverse": "kind: reverse, length_m: 0.5, radius_m: 1, pause_s: 0.3",
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
    travel = travel_of(case(WAYS[name]))
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
    np.testing.assert_allclose(np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1), now.turn_radps, atol=1e-6)
    np.testing.assert_allclose((after.turn_radps - before.turn_radps) / step_s, now.turn_rate_radps2, atol=1e-4)


@pytest.mark.parametrize("name", WAYS)
def test_stamps_begin_at_0_and_are_index_over_rate_and_every_one_is_an_encoders_too(case, name):
    spec = case(f"{WAYS[name]}, rate_hz: 24")
    travel = travel_of(spec)
    np.testing.assert_array_equal(travel.t_ns, np.rint(np.arange(len(travel.t_ns)) * 1e9 / 24).astype(np.int64))
    assert abs(travel.motion.end_ns - travel.t_ns[-1]) <= 1e9 / 24
    assert (travel.rims is None) == (spec.build_rig().wheels is None) == (name in FLYING)
    if travel.rims:
        np.testing.assert_array_equal(travel.rims.t_ns[::4], travel.t_ns)


@pytest.mark.parametrize("name", WAYS)
def test_the_same_seed_goes_the_same_way_to_the_last_bit(case, name):
    once, again, other = (travel_of(case(WAYS[name], seed=seed)).at_frames() for seed in (1, 1, 2))
    assert once.T_world_body.tobytes() == again.T_world_body.tobytes()
    has_chance = name in {"waypoints", "clock", "rough", "circle", "stop_and_go", "handheld"}
    assert (once.T_world_body.tobytes() != other.T_world_body.tobytes()) == has_chance


def test_waypoints_are_the_controllers_drive_and_nothing_else(case):
    travel = travel_of(case("targets_m: [[0.5, 0.3], [0, 1]], start_m: [0.1, 0], start_heading_deg: 20"))
    rngs = {stream: generator(1, f"slip.{stream}") for stream in STREAMS}
    start = (0.1, 0.0, np.deg2rad(20))
    alone = drive([[0.5, 0.3], [0, 1]], start=start, controller=CONTROLLERS["smooth"], slip=SLIPS["nominal"], rngs=rngs)
    assert travel.drive.state.tobytes() == alone.state.tobytes()
    np.testing.assert_allclose(travel.at_frames().T_world_body, alone.T_world_body, atol=1e-9)  # stamps are whole ns


def test_one_disturbance_more_leaves_the_draws_of_the_others(case):
    plain, pushed = (
        travel_of(case(f"targets_m: [[0.5, 0.3]], leg_s: 1{more}")).drive for more in ("", ", delta: bumpy")
    )
    assert plain.slip.tobytes() == pushed.slip.tobytes()
    assert not plain.delta.any()
    assert pushed.delta.any()


def test_the_pioneer_comes_after_the_ideal_robot_within_its_lag(case):
    way = "kind: circle, radius_m: 1, slip: none"
    led, ideal = (travel_of(case(text)) for text in (way, "kind: circle, radius_m: 1, mover: unicycle"))
    np.testing.assert_array_equal(led.t_ns, ideal.t_ns)
    places = [travel.at_frames().T_world_body[:, :2, 3] for travel in (led, ideal)]
    np.testing.assert_array_equal(places[0][0], places[1][0])
    away = np.linalg.norm(places[0] - places[1], axis=1)
    assert 0.005 < away.max() < 0.15


@pytest.mark.parametrize(
    ("mover", "half_track_m", "radius_m"), [("unicycle", 0.1655, 0.0975), ("ackermann", 0.125, 0.05)]
)
def test_wheels_roll_as_far_as_the_ground_goes_by_under_them(case, mover, half_track_m, radius_m):
    rims = travel_of(case(f"kind: circle, radius_m: 2, mover: {mover}")).rims
    around_m = 2 * np.pi * np.array([2 - half_track_m, 2 + half_track_m])
    # A car comes in late by its steering's lag.
    tolerance = {"unicycle": 1e-6, "ackermann": 0.02}[mover]
    np.testing.assert_allclose(rims.rim_rad[-1] * radius_m, around_m, rtol=tolerance)


def test_a_replay_starts_where_it_is_sent_and_keeps_its_shape(case):
    poses = travel_of(case(WAYS["replay"])).at_frames().T_world_body
    np.testing.assert_allclose(poses[0, :3, 3], [1, 2, 1], atol=1e-9)
    np.testing.assert_allclose(poses[0, :3, :3], se3.rotation_z(np.pi / 2), atol=1e-9)
    t_s = np.arange(len(poses)) / 30
    np.testing.assert_allclose(poses[:, 1, 3] - 2, t_s / 2, atol=1e-4)
    np.testing.assert_allclose(1 - poses[:, 0, 3], (t_s / 3) ** 2, atol=1e-4)
