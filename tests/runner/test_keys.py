"""Every key of every trajectory is heeded, in the unit and towards the side that its name and the docs say."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from vobench.motion.spline import Pose
from vobench.runner.motion import body_motion
from vobench.suite.suite import read_plan
from vobench.suite.trajectory import KINDS, TrajectorySpec
from vobench.trajectory.kinematics import level
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

POSES = [{"t_s": t, "position_m": [t / 2, 0, 1], "pitch_deg": 5 * t} for t in (0, 1, 2)]
POINTS = [[0, 0, 1], [0.5, 0.1, 1.2], [0.6, 0.5, 1]]
# A short way of each kind, and what else each of its own keys may say.
BASE = {
    "waypoints": {"targets_m": [[0.3, 0.2], [0.2, 0.4]]},
    "circle": {"radius_m": 0.4},
    "square": {"side_m": 0.5},
    "figure_8": {"length_m": 3},
    "lissajous": {"size_m": [1.2, 1], "mover": "unicycle"},
    "stop_and_go": {"legs_m": [0.2, 0.3]},
    "pure_rotation": {"angle_deg": 90},
    "reverse": {"length_m": 0.3, "radius_m": 1},
    "pose_spline": {"poses": POSES},
    "handheld": {"poses": POSES},
    "rail": {"points_m": POINTS},
    "quadrotor": {"points_m": POINTS},
    "replay": {"file": "way.tum", "start_m": [0, 0, 1]},
    "wander": {"length_m": 3},
}
OTHER = {
    "targets_m": [[0.3, 0.1], [0.2, 0.4]],
    "tolerance_m": 0.05,
    "leg_s": 0.7,
    "radius_m": 0.5,
    "laps": 2,
    "clockwise": True,
    "speed_mps": 0.2,
    "accel_mps2": 0.3,
    "side_m": 0.6,
    "corner_radius_m": 0.1,
    "turn_radps": 0.5,
    "turn_accel_radps2": 1,
    "length_m": 2.9,
    "width_m": 1.4,
    "size_m": [1, 1],
    "ratio": [2, 3],
    "phase_deg": 10,
    "legs_m": [0.3, 0.2],
    "pause_s": 0.5,
    "angle_deg": 91,
    "poses": [*POSES[:2], {"t_s": 2, "position_m": [1, 0.1, 1]}],
    "ease_s": 0.5,
    "shake": "standing",
    "points_m": [*POINTS, [0.7, 0.7, 1]],
    "t_s": [0, 3, 5],
    "yaw_deg": 30,
    "exact": True,
    "knot_hz": 4,
    "speed": 0.5,
    "start_m": [0.1, 0.2],
    "start_heading_deg": 20,
    "start_seed": 1,
    "rate_hz": 24,
    "mover": "unicycle",
    "robot": "pioneer_3dx_laser",
    "robot_spread": 0.1,
    "controller": "easy",
    "max_accel_mps2": 0.1,
    "max_turn_accel_radps2": 0.2,
    "slip": "slippery",
    "floor": [{"surface": "wet", "center_m": [0, 0], "size_m": [9, 9]}],
    "delta": "bumpy",
    "integrator": "euler",
    "substeps": 3,
    "body": "hand",
    "seed": 2,
}
RATE_HZ = 6  # few pictures, for a body goes its way whatever is taken of it
# What the encoders count, when a drive or a replay gives up, whose poses a file holds,
# how many drives there are, and where the cameras sit (tests/suite).
NOT_OF_THE_MOTION = {
    "kind",
    "encoders",
    "max_time_s",
    "max_gap_s",
    "file",
    "seeds",
    "times",
    "recorded_hz",
    "axes",
    "mount",
}
# Nothing turns on a straight way, and nothing drives on in a turn on the spot.
IDLE = {("stop_and_go", "max_turn_accel_radps2"), ("pure_rotation", "max_accel_mps2")}
KIND = TypeAdapter(TrajectorySpec)


@pytest.fixture(scope="module")
def goes(tmp_path_factory):
    """Where a body of these keys goes and what its wheels do, as bytes."""
    folder = tmp_path_factory.mktemp("keys")
    t = np.arange(30) / 10
    T = level(t / 3 + np.sin(7 * t) / 50, t**2 / 30, 0.1 * t)
    (folder / "way.tum").write_text(format_tum(Trajectory((np.arange(30) * 100_000_000).astype(np.int64), T)))
    (folder / "it.yaml").write_text(
        "name: it\nscenes: [room]\nrigs: {it: {pitch_deg: 10}}\nestimators: [stand_still]\n"
        "trajectories: {way: {kind: replay, file: way.tum}}\n"
    )
    (case,) = read_plan(str(folder / "it.yaml")).simulated

    def travel(kind, **keys):
        spec = KIND.validate_python({"kind": kind, "rate_hz": RATE_HZ, **BASE[kind], **keys})
        gone = body_motion(replace(case, trajectory=spec))
        return gone.at_frames().T_world_body, gone.rims.rim_rad if gone.rims else None

    return travel


def said(gone):
    return gone[0].tobytes(), gone[1] if gone[1] is None else gone[1].tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_changes_where_the_body_goes_or_how_its_wheels_turn(goes, kind):
    mover = KIND.dump_python(KIND.validate_python({"kind": kind, **BASE[kind]}))
    keys = set(mover) - NOT_OF_THE_MOTION - {key for its, key in IDLE if its == kind}
    assert keys <= set(OTHER)
    plain = said(goes(kind))
    for key in sorted(keys):
        other = {"lissajous": {"mover": "pioneer", "speed_mps": 0.1}}.get(kind, {}) if key == "mover" else {}
        value = [*OTHER[key], 1.5] if (kind, key) == ("replay", "start_m") else OTHER[key]
        assert said(goes(kind, **{key: value, **other})) != plain, key


def test_motors_change_where_the_robot_goes_and_how_its_wheels_turn(goes):
    fitted, light, heavy, wide = (
        goes("stop_and_go", slip="none", **keys)
        for keys in ({}, *({"motors": motors} for motors in ({}, {"m_kg": 30}, {"r_m": 0.2})))
    )
    assert len({said(gone)[0] for gone in (fitted, light, heavy, wide)}) == 4
    assert light[1][-1, 0] / wide[1][-1, 0] == pytest.approx(0.2 / 0.0975, rel=0.05)


def test_a_car_of_another_make_steers_and_rolls_differently(goes):
    gone = [goes("circle", radius_m=9, laps=0.1, mover="ackermann", car=car) for car in ("small_robot", "kitti_like")]
    assert abs(gone[0][1][-1] / gone[1][1][-1]).min() > 5


@pytest.mark.parametrize("kind", ["circle", "square"])
def test_clockwise_is_to_the_right(goes, kind):
    left, right = (goes(kind, mover="unicycle", clockwise=clockwise)[0] for clockwise in (False, True))
    np.testing.assert_allclose(right[:, 1, 3], -left[:, 1, 3], atol=1e-12)
    assert left[:, 1, 3].max() > 0.45


@pytest.mark.parametrize(
    ("angle", "column", "towards"),
    [("yaw_deg", 0, [0, 1, 0]), ("pitch_deg", 0, [0, 0, -1]), ("roll_deg", 1, [0, 0, 1])],
)
def test_yaw_is_to_the_left_pitch_down_and_roll_to_the_right(angle, column, towards):
    T = Pose(t_s=0.0, position_m=(1.0, 2.0, 3.0), **{angle: 90.0}).T_world_body
    np.testing.assert_allclose(T[:3, column], towards, atol=1e-12)
    np.testing.assert_allclose(T[:3, 3], [1, 2, 3])


def test_heading_and_phase_are_in_degrees_and_a_quadrotor_looks_where_it_is_told(goes):
    start = goes("circle", mover="unicycle", start_heading_deg=90, start_m=[1, 2])[0][0]
    np.testing.assert_allclose(start[:2, [0, 3]], [[0, 1], [1, 2]], atol=1e-12)
    np.testing.assert_allclose(goes("lissajous", phase_deg=360)[0], goes("lissajous")[0], atol=1e-6)
    looks = goes("quadrotor", yaw_deg=90)[0][:, :3, 0]
    assert looks[:, 1].min() > 0.9


@pytest.mark.parametrize("exact", [True, False])
def test_a_replay_at_half_the_speed_takes_twice_as_long(goes, exact):
    as_recorded, slow = (goes("replay", speed=speed, exact=exact)[0] for speed in (1, 0.5))
    np.testing.assert_allclose(slow[::2][: len(as_recorded)], as_recorded, atol=1e-9)


def test_a_turned_patch_lies_turned(goes):
    """Straight ahead, the left wheel runs over a long patch beside the way until the patch is turned away."""
    patch = {"surface": "wet", "center_m": [0.5, 0.165], "size_m": [3, 0.1]}
    beside, across = (
        goes("stop_and_go", legs_m=[1], slip="none", floor=[{**patch, "yaw_deg": yaw}])[1][-1] for yaw in (0, 90)
    )
    assert beside[0] / beside[1] > 1.03
    assert 1 / 1.01 < across[0] / across[1] < 1.01
