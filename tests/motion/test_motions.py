"""Laws of every motion: what is said of velocity, acceleration and rest agrees with where the body is."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.motion.ackermann import ACKERMANNS, ackermann
from vobench.motion.course import Circle, Figure8, Lissajous, PureRotation, Reverse, Square, StopAndGo
from vobench.motion.handheld import SHAKES, HandheldMotion, draw_shake
from vobench.motion.quadrotor import Quadrotor
from vobench.motion.rail import Rail
from vobench.motion.replay import Replay
from vobench.motion.spline import pose_spline
from vobench.trajectory.trajectory import Trajectory

STEP_S = 2e-4
SPAN_S = 0.05
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
POINTS = [[0, 0, 0], [0, 0, 1], [2, 0, 1.5], [3, 2, 1], [1, 3, 2], [0, 2, 1]]
START = (1.0, -2.0, 2.5)


def poses(seed=0, count=10):
    rng = np.random.default_rng(seed)
    R = Rotation.from_rotvec(np.cumsum(0.4 * rng.normal(size=(count, 3)), 0)).as_matrix()
    return np.cumsum(rng.uniform(0.6, 1.4, count)), se3.transform(R, np.cumsum(rng.normal(size=(count, 3)), 0))


def recording():
    motion = pose_spline(*poses(3))
    t_ns = np.arange(motion.start_ns, motion.end_ns, 20_000_000)
    return Trajectory(t_ns, motion.at(t_ns).T_world_body)


def at(start):
    return {"start_m": start[:2], "start_heading_deg": np.rad2deg(start[2])}


PLANAR = {
    "circle": lambda start=START: Circle(radius_m=2, speed_mps=1, laps=2, **at(start)).way(),
    "circle to the right": lambda start=START: Circle(
        radius_m=2, speed_mps=1, laps=0.7, clockwise=True, **at(start)
    ).way(),
    "square": lambda start=START: Square(side_m=2, speed_mps=1, **at(start)).way(),
    "square, rounded": lambda start=START: Square(
        side_m=4, speed_mps=1, corner_radius_m=0.5, laps=2, **at(start)
    ).way(),
    "figure 8": lambda start=START: Figure8(length_m=4, speed_mps=1, laps=2, **at(start)).way(),
    "lissajous": lambda start=START: Lissajous(
        size_m=(8, 6),
        ratio=(3, 2),
        phase_deg=np.rad2deg(0.4),
        speed_mps=1,
        **at(start),
    ).way(),
    "stop and go": lambda start=START: StopAndGo(legs_m=[1, 2, 0.05], speed_mps=0.5, pause_s=1, **at(start)).way(),
    "pure rotation": lambda start=START: PureRotation(angle_deg=np.rad2deg(-7), turn_radps=1, **at(start)).way(),
    "reverse": lambda start=START: Reverse(length_m=3, speed_mps=1, pause_s=0.5, **at(start)).way(),
    "reverse on an arc": lambda start=START: Reverse(length_m=3, speed_mps=1, radius_m=-2, **at(start)).way(),
}
CARS = {
    "car on an 8": lambda start=START: ackermann(Figure8(length_m=10, speed_mps=1, **at(start)).way()),
    "car, ahead and back": lambda start=START: ackermann(
        Reverse(length_m=3, speed_mps=1, radius_m=2, **at(start)).way()
    ),
    "car in town": lambda start=START: ackermann(
        Square(
            side_m=60,
            speed_mps=8,
            corner_radius_m=10,
            accel_mps2=1.5,
            **at(start),
        ).way(),
        ACKERMANNS["kitti_like"],
    ),
}
SPATIAL = {
    "pose spline": lambda: pose_spline(*poses()),
    "pose spline, eased": lambda: pose_spline(*poses(), ease_s=1.0),
    "rail": lambda: Rail(points_m=POINTS[2:], speed_mps=1).motion(),
    "straight rail": lambda: Rail(points_m=POINTS[1:3], speed_mps=1).motion(),
    "handheld": lambda: HandheldMotion(pose_spline(*poses()), draw_shake(SHAKES["running"], np.random.default_rng(1))),
    "quadrotor": lambda: Quadrotor(points_m=POINTS, speed_mps=1).motion(),
    "quadrotor, fixed yaw": lambda: Quadrotor(
        points_m=POINTS, speed_mps=1, t_s=[0, 2, 4, 6, 8, 11], yaw_deg=np.rad2deg(1.0)
    ).motion(),
    "replay, interpolated": lambda: Replay(file="", exact=True, speed=0.5).motion(recording()),
    "replay, smoothed": lambda: Replay(file="", start_m=(1, 2, 3), start_heading_deg=30).motion(recording()),
}
KINDS = {**PLANAR, **CARS, **SPATIAL}
AT_REST = [*PLANAR, *CARS, "pose spline, eased", "rail", "straight rail", "quadrotor", "quadrotor, fixed yaw"]
CLOSED = ["circle", "square", "square, rounded", "figure 8", "lissajous", "reverse", "reverse on an arc"]


@cache
def motion_of(kind):
    return KINDS[kind]()


every_kind = pytest.mark.parametrize("kind", KINDS)
wheeled = pytest.mark.parametrize("kind", [*PLANAR, *CARS])


def edges_s(motion):
    return np.concatenate([[motion.start_ns], motion.breaks_ns, [motion.end_ns]]) / 1e9


def instants(motion):
    """Random times clear of breaks."""
    edges = edges_s(motion)
    t_s = np.random.default_rng(5).uniform(edges[0], edges[-1], 400)
    return t_s[np.abs(t_s[:, None] - edges).min(1) > 3 * STEP_S]


def in_world(k, vectors):
    return np.einsum("kij,kj->ki", k.T_world_body[:, :3, :3], vectors)


def derivative(function, t_s):
    """Central differences of the fourth order."""
    weights = np.array([1, -8, 8, -1]) / 12 / STEP_S
    return sum(w * function(t_s + n * STEP_S) for w, n in zip(weights, (-2, -1, 1, 2), strict=True))


@every_kind
def test_velocity_is_the_derivative_of_position(kind):
    motion = motion_of(kind)
    t_s = instants(motion)
    expected = derivative(lambda t: motion.at(t * 1e9).T_world_body[:, :3, 3], t_s)
    k = motion.at(t_s * 1e9)
    np.testing.assert_allclose(in_world(k, k.velocity_mps), expected, atol=2e-7)


@every_kind
def test_acceleration_is_the_derivative_of_velocity(kind):
    motion = motion_of(kind)
    t_s = instants(motion)

    def velocity(t):
        k = motion.at(t * 1e9)
        return in_world(k, k.velocity_mps)

    k = motion.at(t_s * 1e9)
    np.testing.assert_allclose(in_world(k, k.acceleration_mps2), derivative(velocity, t_s), atol=2e-6)


@every_kind
def test_turn_is_the_derivative_of_rotation_in_body_axes(kind):
    motion = motion_of(kind)
    t_s = instants(motion)
    k = motion.at(t_s * 1e9)
    R_rate = derivative(lambda t: motion.at(t * 1e9).T_world_body[:, :3, :3], t_s)
    skew = np.swapaxes(k.T_world_body[:, :3, :3], -1, -2) @ R_rate
    np.testing.assert_allclose(
        k.angular_velocity_radps, np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], -1), atol=2e-7
    )


@every_kind
def test_turn_rate_is_the_derivative_of_turn(kind):
    motion = motion_of(kind)
    t_s = instants(motion)
    expected = derivative(lambda t: motion.at(t * 1e9).angular_velocity_radps, t_s)
    np.testing.assert_allclose(motion.at(t_s * 1e9).angular_acceleration_radps2, expected, atol=5e-6)


@every_kind
def test_accelerations_summed_between_breaks_give_the_way(kind):
    motion = motion_of(kind)
    marks = np.unique(np.concatenate([edges_s(motion), np.arange(*edges_s(motion)[[0, -1]], SPAN_S)]))
    half = np.diff(marks) / 2
    t_s = (marks[:-1] + half)[:, None] + half[:, None] * NODES
    k, ends = motion.at(t_s.ravel() * 1e9), motion.at(edges_s(motion)[[0, -1]] * 1e9)

    def summed(vectors):
        return np.einsum(
            "kn,n,knd->d", half[:, None] * np.ones(8), WEIGHTS, in_world(k, vectors).reshape(*t_s.shape, 3)
        )

    gained = np.diff(in_world(ends, ends.velocity_mps), axis=0)[0]
    np.testing.assert_allclose(summed(k.acceleration_mps2), gained, atol=2e-7)
    np.testing.assert_allclose(summed(k.velocity_mps), np.diff(ends.T_world_body[:, :3, 3], axis=0)[0], atol=2e-7)


@every_kind
def test_pose_and_velocities_do_not_jump_at_breaks(kind):
    motion = motion_of(kind)
    before, after = motion.at(motion.breaks_ns - 100), motion.at(motion.breaks_ns + 100)
    np.testing.assert_allclose(before.T_world_body, after.T_world_body, atol=1e-5)
    np.testing.assert_allclose(before.twist, after.twist, atol=1e-5)


@every_kind
def test_breaks_rise_and_lie_inside(kind):
    edges = edges_s(motion_of(kind))
    assert (np.diff(edges) > 0).all()


@every_kind
def test_rotations_are_rotations_and_all_is_finite(kind):
    motion = motion_of(kind)
    k = motion.at(np.linspace(motion.start_ns, motion.end_ns, 500))
    assert se3.is_rotation(k.T_world_body[:, :3, :3], tolerance=1e-12)
    assert np.isfinite(
        [k.velocity_mps, k.acceleration_mps2, k.angular_velocity_radps, k.angular_acceleration_radps2]
    ).all()


@every_kind
def test_a_little_before_and_after_it_goes_on_evenly(kind):
    motion = motion_of(kind)
    for edge_ns, way in ((motion.start_ns, -1), (motion.end_ns, 1)):
        there, beyond = motion.at(np.array([edge_ns])), motion.at(np.array([edge_ns + way * 1_000_000]))
        np.testing.assert_allclose(beyond.twist, there.twist, atol=0.05)
        moved = way * 1e-3 * in_world(there, there.velocity_mps)
        np.testing.assert_allclose((beyond.T_world_body - there.T_world_body)[:, :3, 3], moved, atol=1e-4)


@every_kind
def test_whole_nanoseconds_and_fractions_are_the_same_instants(kind):
    motion = motion_of(kind)
    t_ns = np.array([motion.start_ns, (motion.start_ns + motion.end_ns) // 2, motion.end_ns])
    np.testing.assert_array_equal(motion.at(t_ns).T_world_body, motion.at(t_ns.astype(float)).T_world_body)


@pytest.mark.parametrize("kind", AT_REST)
def test_it_starts_and_ends_at_rest(kind):
    motion = motion_of(kind)
    np.testing.assert_allclose(motion.at(np.array([motion.start_ns, motion.end_ns])).twist, 0, atol=1e-8)


@wheeled
def test_wheels_roll_along_x_and_turn_about_z_alone(kind):
    motion = motion_of(kind)
    k = motion.at(np.linspace(motion.start_ns, motion.end_ns, 500))
    assert not k.velocity_mps[:, 1:].any()
    assert not k.angular_velocity_radps[:, :2].any()
    np.testing.assert_allclose(
        k.acceleration_mps2[:, 1], k.velocity_mps[:, 0] * k.angular_velocity_radps[:, 2], atol=1e-12
    )
    assert not k.T_world_body[:, 2, 3].any()


@wheeled
def test_another_start_moves_the_way_and_nothing_else(kind):
    there, here = motion_of(kind), KINDS[kind](start=(0.0, 0.0, 0.0))
    t_ns = np.linspace(there.start_ns, there.end_ns, 200)
    T = se3.transform(se3.rotation_z(START[2]), [*START[:2], 0.0])
    np.testing.assert_allclose(there.at(t_ns).T_world_body, T @ here.at(t_ns).T_world_body, atol=1e-9)
    np.testing.assert_allclose(there.at(t_ns).twist, here.at(t_ns).twist, atol=1e-9)


@pytest.mark.parametrize("kind", CLOSED)
def test_a_closed_way_ends_where_it_began(kind):
    motion = motion_of(kind)
    first, last = motion.at(np.array([motion.start_ns, motion.end_ns])).T_world_body
    np.testing.assert_allclose(last, first, atol=1e-12)
