"""Chance acts on a drive through streams that do not see each other, and adds where the equations add."""

from collections.abc import Mapping
from dataclasses import astuple, replace
from functools import cache

import numpy as np
import pytest

from vobench.errors import MotionError, SettingError
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS
from vobench.motion.disturbance import (
    DELTAS,
    DISTURBANCE_STREAMS,
    MAX_SLIP,
    DeltaSettings,
    Disturbance,
    Generators,
    ornstein_uhlenbeck,
    random_disturbances,
)
from vobench.motion.drive import Drive, drive
from vobench.motion.floor_patch import SURFACES, FloorPatch, GroundSlip
from vobench.motion.pioneer import THETAS, accelerations
from vobench.motion.slip import SLIP_STREAMS, SLIPS, SlipSettings


def slip_path(count: int, slip: SlipSettings, *, step_s: float, rngs: Generators | None) -> Array:
    return random_disturbances(count, slip, DELTAS["none"], (), step_s=step_s, rngs=rngs).rows[:, :3]


def delta_path(count: int, delta: DeltaSettings, *, step_s: float, rngs: Generators | None) -> Array:
    return random_disturbances(count, SLIPS["none"], delta, (), step_s=step_s, rngs=rngs).rows[:, 3:]


BUMPY = DELTAS["bumpy"]
Pair = tuple[float, float]
COURSE = ((0.5, 0.3),)


def generators(seed: int) -> Mapping[str, np.random.Generator]:
    return dict(zip(DISTURBANCE_STREAMS, np.random.default_rng(seed).spawn(len(DISTURBANCE_STREAMS)), strict=True))


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
    found = np.stack([now.acceleration_mps2[:, 0], now.angular_acceleration_radps2[:, 2]], -1)
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
    with pytest.raises(SettingError, match=r"_(mps2|radps2|s): should be"):
        DeltaSettings(*bad)


NOMINAL = SLIPS["nominal"]
FAR, EVERYWHERE = ((9.0, 9.0), (1.0, 1.0)), ((0.0, 0.0), (20.0, 20.0))
GROUNDS = {
    "double": GroundSlip(2.0),
    "fivefold": GroundSlip(5.0),
    "sticky": GroundSlip(ratio_bias=0.1, angle_bias_rad=0.2),
    "sloping": GroundSlip(angle_bias_rad=0.1),
    "icy": GroundSlip(50.0, 0.3, 0.3),
}


@pytest.fixture(autouse=True)
def _grounds(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, ground in GROUNDS.items():
        monkeypatch.setitem(SURFACES, name, ground)


def patch_of(surface: str, center_m: Pair, size_m: Pair, yaw_deg: float = 0.0) -> FloorPatch:
    return FloorPatch(surface=surface, center_m=center_m, size_m=size_m, yaw_deg=yaw_deg)


@cache
def driven(*patches: FloorPatch) -> Drive:
    rngs = dict(zip(DISTURBANCE_STREAMS, np.random.default_rng(1).spawn(6), strict=True))
    return drive([(1.5, 0.0)], slip=NOMINAL, floor=patches, rngs=rngs)


def test_a_patch_that_is_never_crossed_changes_nothing_to_the_last_bit() -> None:
    clean, patched = driven(), driven(patch_of("wet", *FAR))
    np.testing.assert_array_equal(patched.state, clean.state)
    np.testing.assert_array_equal(patched.rim_rad, clean.rim_rad)


def test_a_patch_under_everything_is_the_slip_settings_times_its_factor() -> None:
    rngs = dict(zip(DISTURBANCE_STREAMS, np.random.default_rng(1).spawn(6), strict=True))
    stronger = replace(NOMINAL, ratio_std=2 * NOMINAL.ratio_std, angle_std_rad=2 * NOMINAL.angle_std_rad)
    scaled = drive([(1.5, 0.0)], slip=stronger, rngs=rngs)
    np.testing.assert_allclose(driven(patch_of("double", *EVERYWHERE)).state, scaled.state, atol=1e-12)


def test_slip_changes_within_one_frame_of_the_axle_entering_and_leaving_the_patch() -> None:
    run = driven(patch_of("fivefold", (0.7, 0.0), (0.4, 3.0)))
    x_m, clean = run.motion.at(run.t_ns).T_world_body[:, 0, 3], driven()
    shared = slice(0, min(len(run.slip), len(clean.slip)))
    factor = run.slip[shared, 2] / clean.slip[shared, 2]
    inside = np.abs(x_m[shared] - 0.7) <= 0.2
    np.testing.assert_allclose(factor[(x_m[shared] < 0.498) | (x_m[shared] > 0.902)], 1.0)
    np.testing.assert_allclose(factor[inside & (np.abs(x_m[shared] - 0.7) < 0.198)], 5.0)
    assert inside.sum() > 10


def test_a_patch_under_one_wheel_makes_only_that_rim_run_ahead() -> None:
    left = driven(patch_of("sticky", (0.7, 0.3), (4.0, 0.5)))
    clean = driven()
    np.testing.assert_allclose(left.slip[:, 0], clean.slip[: len(left.slip), 0] + 0.1, atol=1e-12)
    np.testing.assert_array_equal(left.slip[:, 1], clean.slip[: len(left.slip), 1])
    np.testing.assert_array_equal(left.state, clean.state)


def test_a_pull_to_the_left_is_added_to_the_angle_at_which_the_robot_slides() -> None:
    run, clean = driven(patch_of("sloping", *EVERYWHERE)), driven()
    shared = min(len(run.slip), len(clean.slip))
    np.testing.assert_allclose(run.slip[:shared, 2], clean.slip[:shared, 2] + 0.1, atol=1e-12)
    assert (run.motion.at(run.t_ns).velocity_mps[1:shared, 1] > 0).all()


def test_slip_is_cut_before_the_formulas_lose_their_meaning() -> None:
    run = driven(patch_of("icy", *EVERYWHERE))
    assert np.abs(run.slip).max() == MAX_SLIP


def generators_slip(seed: int) -> dict[str, np.random.Generator]:
    return dict(zip(SLIP_STREAMS, np.random.default_rng(seed).spawn(len(SLIP_STREAMS)), strict=True))


@pytest.mark.parametrize("rate_hz", [10.0, 30.0, 200.0])
def test_spread_and_memory_do_not_depend_on_the_rate(rate_hz: float) -> None:
    lag = round(0.3 * rate_hz)
    path = ornstein_uhlenbeck(400_000, std=0.02, step_s=1 / rate_hz, correlation_s=0.3, rng=np.random.default_rng(5))
    assert path.std() == pytest.approx(0.02, rel=0.03)
    assert np.corrcoef(path[:-lag], path[lag:])[0, 1] == pytest.approx(np.exp(-1), abs=0.03)


def test_the_process_has_its_full_spread_from_the_first_sample_on() -> None:
    firsts = [
        ornstein_uhlenbeck(1, std=0.02, step_s=0.1, correlation_s=0.3, rng=rng)[0]
        for rng in np.random.default_rng(6).spawn(2000)
    ]
    assert np.std(firsts) == pytest.approx(0.02, rel=0.06)


def test_a_longer_path_begins_with_the_shorter_one() -> None:
    short, long = (slip_path(n, NOMINAL, step_s=1 / 30, rngs=generators_slip(1)) for n in (50, 500))
    np.testing.assert_array_equal(long[:50], short)


def test_switching_one_process_off_leaves_the_others_as_they_were() -> None:
    both = slip_path(100, NOMINAL, step_s=1 / 30, rngs=generators_slip(2))
    straight = slip_path(100, replace(NOMINAL, angle_std_rad=0.0), step_s=1 / 30, rngs=generators_slip(2))
    sliding = slip_path(100, replace(NOMINAL, ratio_std=0.0), step_s=1 / 30, rngs=generators_slip(2))
    np.testing.assert_array_equal(straight, both * [1, 1, 0])
    np.testing.assert_array_equal(sliding, both * [0, 0, 1])


def test_the_three_processes_are_independent() -> None:
    path = slip_path(100_000, SLIPS["slippery"], step_s=1.0, rngs=generators_slip(3))
    assert np.abs(np.corrcoef(path.T) - np.eye(3)).max() < 0.02


def test_a_slipping_rim_runs_ahead_of_the_ground() -> None:
    left, right = Disturbance(left=0.2, right=0.0).rim_rates(0.4, 0.4, radius_m=0.1)
    assert (left, right) == (pytest.approx(5.0), pytest.approx(4.0))


def test_skid_pushes_the_robot_out_of_its_turn() -> None:
    assert Disturbance(skid_s=0.02).side_speed(0.5, 1.0) == pytest.approx(-0.01)


def test_without_slip_no_generator_is_needed_and_with_slip_its_lack_is_named() -> None:
    assert not slip_path(10, SLIPS["none"], step_s=0.1, rngs=None).any()
    with pytest.raises(MotionError, match="needs a random generator for 'side', and rngs has none"):
        slip_path(10, NOMINAL, step_s=0.1, rngs={k: v for k, v in generators_slip(0).items() if k != "side"})


def test_between_two_instants_slip_is_on_the_straight_line() -> None:
    first, second = Disturbance(0.1, -0.2, 0.3, 0.02, 0.0, 1.0, -1.0), Disturbance(0.3, 0.0, -0.1, 0.02, 0.0, 0.0, 0.0)
    assert first.towards(second, 0.0) == first
    np.testing.assert_allclose(first.towards(second, 0.25), [0.15, -0.15, 0.2, 0.02, 0.0, 0.75, -0.75])


@pytest.mark.parametrize("speed", [0.4, -0.4])
def test_a_strained_rim_runs_ahead_of_the_ground_where_it_is_driven_on_and_behind_where_it_brakes(speed: float) -> None:
    slip = Disturbance(traction_s2pm=0.1)
    on, braked = (slip.rim_rates(speed, speed, radius_m=0.1, driven_mps2=(s * speed, s * speed)) for s in (1, -1))
    assert abs(on[0]) > abs(speed) / 0.1 > abs(braked[0])
