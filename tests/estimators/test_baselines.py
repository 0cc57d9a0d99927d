"""The estimators that look at no picture."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.estimator import EncoderReadings, Frame, Status
from vobench.geometry import se3
from vobench.geometry.rig import PIONEER_WHEELS, paper_lens, stereo_rig

RIG = stereo_rig(paper_lens(square_pixels=True), pitch_deg=90)
METRES_PER_TICK = 2 * np.pi * PIONEER_WHEELS.radius_m / PIONEER_WHEELS.ticks_per_revolution


def rolled(T_world_body, path_m, turn_rad, *, per_frame=10):
    """Frames of a robot whose path and heading grow evenly: readings since the last frame, exact to a tick."""
    n = len(T_world_body)
    share = np.arange(n * per_frame) / (per_frame * (n - 1))
    half = PIONEER_WHEELS.track_m / 2
    wheels_m = np.stack([share * (path_m - half * turn_rad), share * (path_m + half * turn_rad)], -1)
    ticks = np.floor(wheels_m / METRES_PER_TICK).astype(np.int64)
    t_ns = np.arange(n * per_frame, dtype=np.int64) * 10**9 // (30 * per_frame)
    ends = np.arange(n) * per_frame + 1
    starts = np.r_[0, ends[:-1]]
    return [
        Frame(k, int(t_ns[b - 1]), encoders=EncoderReadings(t_ns[a:b], ticks[a:b]))
        for k, (a, b) in enumerate(zip(starts, ends, strict=True))
    ]


def test_one_who_stands_still_is_always_at_the_start(bed):
    results = bed.estimated("stand_still", RIG, [Frame(k, k * 33_333_333) for k in range(3)])
    assert all((result.T_odom_frame == np.eye(4)).all() for result in results)


def poses(results):
    return np.stack([result.T_odom_frame for result in results])


@pytest.mark.parametrize("speed_mps", [0.5, 12.0, -0.2])
def test_constant_velocity_is_right_on_a_straight_line_at_any_speed(bed, speed_mps):
    frames = rolled(np.empty((121, 4, 4)), path_m=4 * speed_mps, turn_rad=0.0)
    truth = bed.drive((120, speed_mps, 0.0))
    # A tick at either end of the second that is measured, over four of them.
    np.testing.assert_allclose(poses(bed.estimated("constant_velocity", RIG, frames)), truth, atol=4 * METRES_PER_TICK)


def test_constant_velocity_follows_the_wheels_for_a_second_and_never_looks_again(bed):
    bent = rolled(np.empty((121, 4, 4)), path_m=2.0, turn_rad=6.0)
    stopped = [
        replace(f, encoders=replace(f.encoders, ticks=0 * f.encoders.ticks)) if k > 30 else f
        for k, f in enumerate(bent)
    ]
    held, wheels = (poses(bed.estimated(name, RIG, bent)) for name in ("constant_velocity", "wheel_odometry"))
    np.testing.assert_allclose(held[:31], wheels[:31], atol=1e-12)
    assert np.array_equal(poses(bed.estimated("constant_velocity", RIG, stopped)), held)
    steps = se3.inverse(held[31:-1]) @ held[32:]
    np.testing.assert_allclose(
        steps, np.broadcast_to(se3.transform(np.eye(3), [0.5 / 30, 0, 0]), steps.shape), atol=1e-5
    )


def test_constant_velocity_without_encoders_is_lost(bed):
    (result,) = bed.estimated("constant_velocity", RIG, [Frame(0, 0)])
    assert (result.status, result.reason) == (Status.LOST, "no_encoders")


def test_wheels_close_an_exact_circle(bed):
    """A full turn with 30 long arcs: only the exact arc, not its chord or tangent, comes back."""
    frames = rolled(np.empty((31, 4, 4)), path_m=2.0, turn_rad=2 * np.pi, per_frame=1)
    end = bed.estimated("wheel_odometry", RIG, frames)[-1].T_odom_frame
    assert np.linalg.norm(end[:3, 3]) < 1e-4
    assert se3.rotation_angle(end[:3, :3]) < 1e-4


def test_wheels_follow_the_body_along_an_arc_at_every_frame(bed):
    truth = bed.drive((30, 0.6, 1.5))
    frames = rolled(truth, path_m=0.6, turn_rad=1.5)
    T = np.stack([result.T_odom_frame for result in bed.estimated("wheel_odometry", RIG, frames)])
    np.testing.assert_allclose(T, truth, atol=1e-4)


def test_how_often_the_wheels_are_read_does_not_matter_on_an_arc(bed):
    ends = [
        bed.estimated("wheel_odometry", RIG, rolled(np.empty((31, 4, 4)), 0.6, 1.5, per_frame=n))[-1].T_odom_frame
        for n in (1, 20)
    ]
    np.testing.assert_allclose(ends[0], ends[1], atol=2e-5)


def test_mirrored_wheels_drive_the_mirrored_path(bed):
    ticks = np.array([[0, 0], [900, 400], [2000, 1500]])
    t_ns = np.array([0, 1, 2])
    one, other = (
        bed.estimated("wheel_odometry", RIG, [Frame(0, 2, encoders=EncoderReadings(t_ns, counts))])[0].T_odom_frame
        for counts in (ticks, ticks[:, ::-1])
    )
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    np.testing.assert_allclose(mirror @ one @ mirror, other, atol=1e-15)


def test_a_frame_without_new_readings_keeps_the_pose(bed):
    frames = rolled(np.empty((4, 4, 4)), 0.1, 0.1)
    none = EncoderReadings(np.zeros(0, np.int64), np.zeros((0, 2), np.int64))
    results = bed.estimated("wheel_odometry", RIG, [*frames, Frame(4, 200_000_000, encoders=none)])
    np.testing.assert_array_equal(results[-1].T_odom_frame, results[-2].T_odom_frame)


def test_wheel_odometry_without_encoders_is_lost(bed):
    (result,) = bed.estimated("wheel_odometry", RIG, [Frame(0, 0)])
    assert (result.status, result.reason) == (Status.LOST, "no_encoders")


@pytest.mark.parametrize(("name", "path"), [("wheel_odometry", 0.3), ("constant_velocity", 0.3)])
def test_the_body_moves_along_its_own_x_axis_whatever_way_the_camera_looks(bed, name, path):
    frames = rolled(np.empty((31, 4, 4)), path_m=path, turn_rad=0.0)
    end = bed.estimated(name, RIG, frames)[-1].T_odom_frame
    np.testing.assert_allclose(end[:3, 3], [path, 0, 0], atol=1e-4)
