"""Theta is found again in a drive, and a drive that cannot tell it is refused."""

from dataclasses import astuple

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.geometry.rig import PIONEER_WHEELS
from vobench.geometry.se3 import Array
from vobench.motion.disturbance import DISTURBANCE_STREAMS
from vobench.motion.drive import Drive, drive
from vobench.motion.identification import WINDOW_S, Fit, identify, identify_odometry
from vobench.motion.motor import MotorConstants, theta_of
from vobench.motion.pioneer import THETAS, Theta, accelerations
from vobench.motion.slip import SLIPS

ROBOTS = {**THETAS, "representative": theta_of(MotorConstants())}
EVERY_ROBOT = pytest.mark.parametrize("theta", ROBOTS.values(), ids=ROBOTS.keys())
Run = tuple[Array, Array, Array]


def run_of(speeds: Array, references: Array, theta: Theta) -> Run:
    """Speeds, accelerations by (18), references."""
    pairs = zip(speeds.tolist(), references.tolist(), strict=True)
    return speeds, np.array([accelerations(*now, *asked, theta=theta) for now, asked in pairs]), references


def random_run(theta: Theta, count: int = 200) -> Run:
    speeds, references = np.random.default_rng(0).uniform(-1, 1, (2, count, 2))
    return run_of(speeds, references, theta)


@EVERY_ROBOT
def test_a_noiseless_drive_tells_theta_to_a_billionth(theta: Theta) -> None:
    run = drive([(1, 1), (0, 1), (1, 0)], theta=theta, max_time_s=100)
    fit = identify(*run_of(run.state[:, 3:], run.references, theta))
    np.testing.assert_allclose(astuple(fit.theta), astuple(theta), rtol=1e-9, atol=1e-12)
    assert max(fit.u_ref_rms_mps, fit.omega_ref_rms_radps) < 1e-12
    assert 1 <= fit.condition < 10


def test_the_motion_of_a_robot_of_its_own_tells_that_robots_theta() -> None:
    run = drive([(1, 1), (0, 1), (1, 0)], theta_std=0.1, rngs={"theta": np.random.default_rng(3)})
    assert run.theta is not None
    assert run.theta != THETAS["pioneer_3dx"]
    middle_ns = (np.arange(len(run.t_ns) - 1) + 0.5) * 1e9 / 30
    seen = run.motion.at(middle_ns)
    speeds = np.stack([seen.velocity_mps[:, 0], seen.angular_velocity_radps[:, 2]], -1)
    rates = np.stack([seen.acceleration_mps2[:, 0], seen.angular_acceleration_radps2[:, 2]], -1)
    fit = identify(speeds, rates, run.references[:-1])
    np.testing.assert_allclose(astuple(fit.theta), astuple(run.theta), rtol=1e-9)


def test_noise_on_the_references_is_left_over_and_halves_in_theta_with_four_times_the_run() -> None:
    theta, noise, errors = THETAS["pioneer_3dx"], 0.01, []
    for count in (200, 800):
        speeds, rates, references = random_run(theta, count)
        noises = np.random.default_rng(1).normal(0, noise, (400, count, 2))
        fits = [identify(speeds, rates, references + one) for one in noises]
        assert np.mean([fit.u_ref_rms_mps for fit in fits]) == pytest.approx(noise, rel=0.05)
        assert np.mean([fit.omega_ref_rms_radps for fit in fits]) == pytest.approx(noise, rel=0.05)
        errors.append(np.std([astuple(fit.theta) for fit in fits], axis=0))
    np.testing.assert_allclose(errors[0] / errors[1], 2, rtol=0.2)


def test_the_order_and_the_mirror_of_the_instants_do_not_matter() -> None:
    theta = THETAS["pioneer_3dx"]
    run = random_run(theta)
    back, mirrored = [part[::-1] for part in run], [part * [1, -1] for part in run]
    for other in (back, mirrored):
        np.testing.assert_allclose(astuple(identify(*other).theta), astuple(theta), rtol=1e-11)


@pytest.mark.parametrize(
    ("speeds", "untold"),
    [
        (np.stack([np.linspace(0, 1, 50), np.zeros(50)], -1), "theta_2, theta_3, theta_5, theta_6"),
        (np.stack([np.zeros(50), np.linspace(0, 1, 50)], -1), "theta_1, theta_3, theta_4, theta_5"),
        (np.stack([np.full(50, 0.5), np.linspace(0, 1, 50) ** 2], -1), "theta_5, theta_6"),
        (np.zeros((50, 2)), "theta_1, theta_2, theta_3, theta_4, theta_5, theta_6"),
    ],
    ids=["straight", "on the spot", "even speed", "standing"],
)
def test_a_run_that_cannot_tell_a_parameter_names_it(speeds: Array, untold: str) -> None:
    references = np.random.default_rng(2).uniform(-1, 1, (50, 2)) * (np.abs(speeds).max(0) > 0)
    with pytest.raises(MotionError, match=f"does not determine {untold}: drive with"):
        identify(*run_of(speeds, references, THETAS["pioneer_3dx"]))


@pytest.mark.parametrize("shape", [(50, 3), (2, 2), (50,)])
def test_runs_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(MotionError, match="three arrays"):
        identify(np.ones(shape), np.ones(shape), np.ones(shape))


def test_a_run_with_a_hole_is_refused() -> None:
    speeds, rates, references = random_run(THETAS["pioneer_3dx"])
    rates[7, 1] = np.nan
    with pytest.raises(MotionError, match="finite everywhere"):
        identify(speeds, rates, references)


TARGETS = [(1, 1), (0, 1), (1, 0)]
PIONEER = THETAS["pioneer_3dx"]


def odometry(run: Drive) -> Array:
    """Distance rolled in m and heading in rad (M, 2) as wheels tell them."""
    left, right = run.rim_rad.T * PIONEER_WHEELS.radius_m
    return np.stack([(left + right) / 2, (right - left) / PIONEER_WHEELS.track_m], -1)


def by_wheels(run: Drive, *, every: int = 1) -> Fit:
    """The fit of what wheel odometry makes of a drive, of every so manieth reading."""
    return identify_odometry(run.encoder_t_ns[::every] / 1e9, odometry(run)[::every], run.t_ns / 1e9, run.references)


@pytest.mark.parametrize("name", ["pioneer_3dx", "robulab_10", "representative"])
def test_wheels_that_do_not_slip_tell_theta_to_a_ten_thousandth(name: str) -> None:
    theta = ROBOTS[name]
    fit = by_wheels(drive(TARGETS, theta=theta, max_time_s=100))
    np.testing.assert_allclose(astuple(fit.theta), astuple(theta), rtol=1e-4, atol=1e-6)
    assert max(fit.u_ref_rms_mps, fit.omega_ref_rms_radps) < 1e-5


def test_errors_fall_as_the_square_of_the_distance_of_readings_or_faster() -> None:
    run = drive(TARGETS)
    errors = [np.abs(np.array(astuple(by_wheels(run, every=n).theta)) / astuple(PIONEER) - 1) for n in (4, 1)]
    assert (errors[0][[0, 1, 3, 5]] < 1e-3).all()
    assert (errors[1][1:] < errors[0][1:] / 4**2).all()


def test_wheels_that_slip_by_a_hundredth_tell_lags_and_gains_to_three_hundredths() -> None:
    for seed in range(3):
        rngs = {name: np.random.default_rng([seed, k]) for k, name in enumerate(DISTURBANCE_STREAMS)}
        fit = by_wheels(drive(TARGETS, slip=SLIPS["nominal"], rngs=rngs))
        off = np.array(astuple(fit.theta)) / astuple(PIONEER) - 1
        assert np.abs(off[[0, 1, 3, 5]]).max() < 0.03
        assert 1e-3 < fit.u_ref_rms_mps < 0.02


def test_odometry_from_another_start_and_hour_tells_the_same_theta() -> None:
    run = drive(TARGETS)
    moved_s, moved = 100.0, odometry(run) + np.array([7.0, 2.0])
    fit = identify_odometry(run.encoder_t_ns / 1e9 + moved_s, moved, run.t_ns / 1e9 + moved_s, run.references)
    np.testing.assert_allclose(astuple(fit.theta), astuple(by_wheels(run).theta), rtol=2e-5)


def test_a_drive_shorter_than_a_window_is_refused() -> None:
    t_s = np.arange(10) / 30
    with pytest.raises(MotionError, match=f"lasts {WINDOW_S:g} s and three periods of control or more, got 0.3 s"):
        identify_odometry(t_s, np.zeros((10, 2)), t_s, np.zeros((10, 2)))
