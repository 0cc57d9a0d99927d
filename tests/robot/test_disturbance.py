"""Chance acts on a drive through streams that do not see each other, and adds where the equations add."""

from collections.abc import Mapping
from dataclasses import astuple, replace

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.robot import slip as slips
from vobench.robot.controller import CONTROLLERS
from vobench.robot.disturbance import DELTAS, STREAMS, DeltaSettings, delta_path
from vobench.robot.drive import drive
from vobench.robot.pioneer import THETAS, accelerations
from vobench.robot.slip import SLIPS

BUMPY = DELTAS["bumpy"]
COURSE = ((0.5, 0.3),)


def generators(seed: int) -> Mapping[str, np.random.Generator]:
    return dict(zip(STREAMS, np.random.default_rng(seed).spawn(len(STREAMS)), strict=True))


def test_the_streams_of_slip_are_the_first_of_a_drives() -> None:
    assert STREAMS[:3] == slips.STREAMS
    assert len(set(STREAMS)) == len(STREAMS)


@pytest.mark.parametrize("rate_hz", [10.0, 100.0])
def test_delta_is_stationary_with_its_stated_spread_and_memory_at_any_rate(rate_hz: float) -> None:
    settings, lag = DeltaSettings(0.2, 0.5, correlation_s=0.5), round(0.5 * rate_hz)
    path = delta_path(300_000, settings, step_s=1 / rate_hz, rngs=generators(2))
    np.testing.assert_allclose(path.std(0), [0.2, 0.5], rtol=0.04)
    for column in path.T:
        assert np.corrcoef(column[:-lag], column[lag:])[0, 1] == pytest.approx(np.exp(-1), abs=0.04)
    assert abs(np.corrcoef(path.T)[0, 1]) < 0.03


@pytest.mark.parametrize(("off", "left"), [({"speed_std_mps2": 0.0}, [0, 1]), ({"turn_std_radps2": 0.0}, [1, 0])])
def test_switching_one_push_off_leaves_the_other_and_all_slip_as_they_were(
    off: dict[str, float], left: list[int]
) -> None:
    options = {"slip": SLIPS["nominal"], "leg_s": 2.0}
    both = drive(COURSE, delta=BUMPY, rngs=generators(3), **options)
    one = drive(COURSE, delta=replace(BUMPY, **off), rngs=generators(3), **options)
    np.testing.assert_array_equal(one.slip, both.slip)
    np.testing.assert_array_equal(one.delta, both.delta * left)


def test_switching_slip_off_leaves_the_pushes_and_theta_as_they_were() -> None:
    options = {"delta": BUMPY, "theta_std": 0.05, "leg_s": 2.0}
    slipping = drive(COURSE, slip=SLIPS["slippery"], rngs=generators(4), **options)
    gripping = drive(COURSE, rngs=generators(4), **options)
    np.testing.assert_array_equal(gripping.delta, slipping.delta)
    assert gripping.theta == slipping.theta


def test_delta_adds_to_the_accelerations_of_18_and_two_add_like_one() -> None:
    theta = THETAS["pioneer_3dx"]
    first, second = np.array([0.3, -0.2]), np.array([-0.1, 0.7])

    def rates(delta: np.ndarray) -> np.ndarray:
        return np.array(accelerations(0.4, 0.8, 0.5, 1.0, theta=theta, delta=tuple(delta)))

    still = rates(np.zeros(2))
    np.testing.assert_allclose(rates(first + second) - still, first + second, atol=1e-14)
    np.testing.assert_allclose(rates(first) + rates(second) - 2 * still, first + second, atol=1e-14)


def test_the_pushes_are_in_the_accelerations_of_the_motion() -> None:
    run = drive(COURSE, rate_hz=25.0, delta=BUMPY, rngs=generators(5), leg_s=2.0)
    u, omega, asked = run.state[:, 3], run.state[:, 4], run.references
    modelled = np.stack(accelerations(u, omega, asked[:, 0], asked[:, 1], theta=run.theta), -1)
    now = run.motion.at(run.t_ns)
    found = np.stack([now.acceleration_mps2[:, 0], now.turn_rate_radps2[:, 2]], -1)
    np.testing.assert_allclose(found - modelled, run.delta, atol=1e-9)
    assert run.delta.std(0).min() > 0.05


def test_small_pushes_move_the_robot_in_proportion() -> None:
    # Without the bend of tanh, the limits and coupling the loop is linear in what pushes it along a straight line.
    linear = replace(CONTROLLERS["smooth"], axis_speed_mps=1e9, max_speed_mps=1e9, max_turn_radps=1e9)
    runs = [
        drive([(0.5, 0)], controller=linear, leg_s=3.0, delta=DeltaSettings(std, 0.0), rngs=generators(6))
        for std in (0.0, 0.1, 0.2)
    ]
    still, one, two = (run.state[:, 0] for run in runs)
    np.testing.assert_allclose(two - still, 2 * (one - still), atol=1e-12)
    assert np.abs(one - still).max() > 1e-3


def test_a_robot_differs_from_its_kind_by_the_same_share_in_every_parameter() -> None:
    theta = THETAS["pioneer_3dx"]
    robots = np.array([astuple(theta.perturbed(0.1, rng)) for rng in np.random.default_rng(7).spawn(3000)])
    np.testing.assert_allclose(np.log(robots / astuple(theta)).std(0), 0.1, rtol=0.06)
    np.testing.assert_allclose(np.median(robots, 0), astuple(theta), rtol=0.01)
    assert theta.perturbed(0.0, np.random.default_rng(0)) == theta


def test_a_drive_says_whose_parameters_it_was_and_drives_by_them() -> None:
    run = drive(COURSE, theta_std=0.1, rngs=generators(8))
    assert run.theta is not None
    assert run.theta != THETAS["pioneer_3dx"]
    np.testing.assert_array_equal(drive(COURSE, theta=run.theta).state, run.state)


def test_a_straining_wheel_runs_ahead_as_it_speeds_up_and_behind_as_it_brakes() -> None:
    strained = replace(SLIPS["none"], traction_s2pm=0.05)
    run, clean = drive([(1, 0)], slip=strained), drive([(1, 0)])
    np.testing.assert_array_equal(run.state, clean.state)
    ahead = np.diff(run.rim_rad - clean.rim_rad, axis=0)
    fastest = int(clean.state[:, 3].argmax()) * 4
    assert (ahead[:fastest] > 0).all()
    assert (ahead[fastest + 8 :] < 0).all()
    back = drive([(-1, 0)], slip=strained)
    np.testing.assert_allclose(back.rim_rad, -run.rim_rad, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"delta": BUMPY}, "'delta_u'"),
        ({"theta_std": 0.1}, "'theta'"),
        ({"theta_std": 0.9, "rngs": generators(0)}, r"0\.\.0\.5, got 0\.9"),
        ({"theta_std": float("nan"), "rngs": generators(0)}, "theta_std"),
        ({"theta_std": 0.1, "theta": None}, "ideal unicycle"),
    ],
)
def test_what_chance_cannot_do_is_refused(options: dict[str, object], sentence: str) -> None:
    with pytest.raises(MotionError, match=sentence):
        drive(COURSE, **options)


@pytest.mark.parametrize("bad", [(-0.1, 0.0), (0.1, float("nan")), (float("inf"), 0.0), (0.1, 0.1, 0.0)])
def test_delta_out_of_range_is_refused(bad: tuple[float, ...]) -> None:
    with pytest.raises(MotionError, match="delta needs"):
        DeltaSettings(*bad)
