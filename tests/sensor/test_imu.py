"""What an IMU says adds up to the motion, and its errors come one by one."""

from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vobench.errors import InputError, SettingError
from vobench.geometry import se3
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.motion.controller import CONTROLLERS
from vobench.motion.drive import drive
from vobench.motion.slip import SLIP_STREAMS, SLIPS
from vobench.sensor.imu import (
    FLAWLESS,
    IMUS,
    STREAMS,
    ImuSettings,
    Triad,
    initial_bias,
    measure,
    random_walk,
    readings_of,
)
from vobench.trajectory.kinematics import STANDARD_GRAVITY_MPS2, Kinematics, level

PLACED = {"position_m": (0.25, -0.1, 0.3), "rotation_deg": (-110.0, 0.0, -90.0)}
PLACE = ImuSettings(**PLACED).T_body_imu
TILTED = se3.transform(Rotation.from_euler("ZYX", [0.3, -0.5, 0.7]).as_matrix(), [1, 2, 3])
TOUR = ((1, 1), (2, 2), (0, 2), (2, 0), (-1, 1), (1, -1), (0, 0), (0, 1))
NOISY = replace(IMUS["bmi055"], **PLACED)


def generators(seed: int) -> dict[str, np.random.Generator]:
    return dict(zip(STREAMS, np.random.default_rng(seed).spawn(len(STREAMS)), strict=True))


@dataclass(frozen=True, slots=True)
class Jerky:
    """Straight ahead from rest, with an acceleration of its own in each third of a tenth of a second."""

    accelerations: Array
    breaks_ns: Array
    start_ns: int = 0

    @property
    def end_ns(self) -> int:
        return round(len(self.accelerations) * 1e9 / 30)

    def at(self, t_ns: Array) -> Kinematics:
        t_s, step_s = np.asarray(t_ns, float) / 1e9, 1 / 30
        piece = np.clip((t_s / step_s).astype(int), 0, len(self.accelerations) - 1)
        a = np.where((t_s < 0) | (t_s > self.end_ns / 1e9), 0.0, self.accelerations[piece])
        v_before = np.concatenate([[0.0], np.cumsum(self.accelerations) * step_s])[piece]
        v = v_before + self.accelerations[piece] * (t_s - piece * step_s)
        still = np.zeros_like(t_s)
        ahead = [np.stack([x, still, still], -1) for x in (v, a)]
        none = np.zeros((len(t_s), 3))
        return Kinematics(level(still, still, still), ahead[0], none, ahead[1], none)


def jerky() -> Jerky:
    accelerations = np.random.default_rng(3).normal(size=60)
    return Jerky(accelerations, np.arange(1, 60) * 1e9 / 30)  # start and end are breaks of any motion


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("place", "rate_hz"), [({}, 200), (PLACED, 400)], ids=["at the body's origin", "on an arm"])
def test_a_minute_of_fast_motion_in_six_degrees_closes(bed, seed, place, rate_hz):
    motion = bed.shaken(seed)
    imu = ImuSettings(rate_hz=rate_hz, **place)
    closed = bed.closure(motion, measure(motion, imu)[0], rate_hz, imu.T_body_imu)
    assert closed.off_m < 1e-3
    assert closed.off_deg < 1e-4


@pytest.mark.parametrize("place", [{}, PLACED], ids=["at the axle", "on an arm"])
@pytest.mark.parametrize(("controller", "slip"), [("paper", "none"), ("smooth", "slippery")])
def test_a_minute_of_a_robots_drive_closes(bed, controller, slip, place):
    rngs = dict(zip(SLIP_STREAMS, np.random.default_rng(1).spawn(len(SLIP_STREAMS)), strict=True))
    motion = drive(TOUR * 2, controller=CONTROLLERS[controller], slip=SLIPS[slip], rngs=rngs).motion
    assert motion.end_ns > 60e9
    imu = ImuSettings(rate_hz=200, **place)
    closed = bed.closure(motion, measure(motion, imu)[0], 200, imu.T_body_imu)
    assert closed.off_m < 1e-3
    assert closed.off_deg < 1e-6


def test_what_does_not_close_is_the_integrators_and_goes_at_least_with_the_third_power_of_the_step(bed):
    motion = bed.shaken(4, lasts_s=20)
    off_m = [
        bed.closure(motion, measure(motion, ImuSettings(rate_hz=hz, **PLACED))[0], hz, PLACE).off_m
        for hz in (100, 200, 400)
    ]
    assert off_m[0] > 7 * off_m[1] > 49 * off_m[2]


def test_readings_add_up_to_the_change_of_speed_where_acceleration_jumps():
    motion = jerky()
    readings, _ = measure(motion, ImuSettings(rate_hz=200))
    gained = np.cumsum(readings.accel_mps2[:, 0]) / 200
    true = motion.at(readings.t_ns + 0.5e9 / 200).velocity_mps[:, 0]
    np.testing.assert_allclose(gained[:-1], true[:-1], atol=1e-12)
    blind, _ = measure(replace(motion, breaks_ns=np.zeros(0)), ImuSettings(rate_hz=200))
    assert np.abs(blind.accel_mps2 - readings.accel_mps2).max() > 1e-2


@pytest.mark.parametrize(("slow_hz", "fast_hz"), [(8, 200), (40, 200)])
def test_a_slow_reading_is_the_mean_of_all_fast_ones_in_its_time(bed, slow_hz, fast_hz):
    motion, ratio = bed.shaken(8, lasts_s=5), fast_hz // slow_hz
    slow, fast = (measure(motion, ImuSettings(rate_hz=hz, **PLACED))[0] for hz in (slow_hz, fast_hz))
    for name in ("gyro_radps", "accel_mps2"):
        within = getattr(fast, name)[ratio // 2 + 1 :][: ratio * (len(slow.t_ns) - 2)]
        means = within.reshape(-1, ratio, 3).mean(1)
        np.testing.assert_allclose(getattr(slow, name)[1:-1], means, atol=1e-6)


def test_standing_still_reads_no_turn_and_gravity_upwards(bed):
    readings, bias = measure(bed.at_rest(TILTED, end_ns=60 * 10**9), ImuSettings(**PLACED))
    up = (TILTED @ PLACE)[2, :3]
    assert not readings.gyro_radps.any()
    np.testing.assert_allclose(readings.accel_mps2, np.tile(9.80665 * up, (12_001, 1)), atol=1e-13)
    assert not bias.gyro_radps.any()
    assert not bias.accel_mps2.any()


def test_an_imu_on_an_arm_feels_its_own_path(bed):
    """Against differences of where it is, not the formula of the lever arm."""
    motion, hz = bed.shaken(5, lasts_s=0.2), 10_000
    readings, _ = measure(motion, ImuSettings(rate_hz=hz, **PLACED))
    steps_ns = readings.t_ns + np.array([[-1], [0], [1]]) * 1e9 / hz
    before, T, after = (motion.at(t_ns).T_world_body @ PLACE for t_ns in steps_ns)
    in_world = (before + after - 2 * T)[:, :3, 3] * hz**2 + [0, 0, STANDARD_GRAVITY_MPS2]
    R_imu_world = np.swapaxes(T[:, :3, :3], -1, -2)
    np.testing.assert_allclose(readings.accel_mps2, (R_imu_world @ in_world[..., None])[..., 0], atol=2e-4)
    turned = Rotation.from_matrix((se3.inverse(before) @ after)[:, :3, :3]).as_rotvec() * hz / 2
    np.testing.assert_allclose(readings.gyro_radps, turned, atol=1e-4)


@pytest.mark.parametrize("rate_hz", [200.0, 30.0, 37.5, 1000 / 3])
def test_stamps_are_index_over_rate_from_start_to_end(bed, rate_hz):
    start_ns = 7_000_000_001
    motion = bed.at_rest(np.eye(4), start_ns=start_ns, end_ns=start_ns + 2_000_000_000)
    t_ns = measure(motion, ImuSettings(rate_hz=rate_hz))[0].t_ns
    assert t_ns.dtype == np.int64
    assert t_ns[0] == start_ns
    assert motion.end_ns - 1e9 / rate_hz < t_ns[-1] <= motion.end_ns
    np.testing.assert_allclose(t_ns - start_ns, np.arange(len(t_ns)) * 1e9 / rate_hz, atol=0.5)


def test_a_longer_motion_begins_with_the_readings_of_a_shorter_one_across_the_seams(bed):
    short, long = (bed.shaken(6, lasts_s=s) for s in (30, 70))
    exact = ImuSettings(rate_hz=200)
    fewer, more = (measure(motion, exact)[0] for motion in (short, long))
    assert len(fewer.t_ns) > 4096
    np.testing.assert_allclose(more.accel_mps2[: len(fewer.t_ns)], fewer.accel_mps2, rtol=0, atol=1e-8)


def test_a_start_long_after_zero_changes_nothing(bed):
    early = bed.at_rest(TILTED, end_ns=10**10)
    late = replace(early, start_ns=1_403_636_579_758_555_392, end_ns=1_403_636_589_758_555_392)
    one, other = (measure(motion, NOISY, rngs=generators(1))[0] for motion in (early, late))
    np.testing.assert_array_equal(one.accel_mps2, other.accel_mps2)
    np.testing.assert_array_equal(one.gyro_radps, other.gyro_radps)


def test_the_same_seed_reads_the_same_and_another_does_not(bed):
    motion = bed.at_rest(TILTED, end_ns=10**9)
    one, same, other = (measure(motion, NOISY, rngs=generators(seed))[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.gyro_radps, same.gyro_radps)
    assert (one.gyro_radps != other.gyro_radps).any()


OFF = {
    "gyro_white": ("gyro", "noise"),
    "accel_white": ("accel", "noise"),
    "gyro_walk": ("gyro", "walk"),
    "accel_walk": ("accel", "walk"),
}


@pytest.mark.parametrize("stream", OFF)
def test_switching_one_stream_off_leaves_the_draws_of_the_others(bed, stream):
    """Without the chip's rounding, whatever the stream added is the whole difference."""
    triad, field = OFF[stream]
    smooth = replace(NOISY, gyro=replace(NOISY.gyro, step=0.0), accel=replace(NOISY.accel, step=0.0))
    quiet = replace(smooth, **{triad: replace(getattr(smooth, triad), **{field: 0.0})})
    motion = bed.at_rest(TILTED, end_ns=10**9)
    rngs = generators(1)
    del rngs[stream]
    (loud_readings, loud_bias), (readings, bias) = (
        measure(motion, settings, rngs=some) for settings, some in ((smooth, generators(1)), (quiet, rngs))
    )
    array = {"gyro": "gyro_radps", "accel": "accel_mps2"}
    other = array["accel" if triad == "gyro" else "gyro"]
    np.testing.assert_array_equal(getattr(readings, other), getattr(loud_readings, other))
    np.testing.assert_array_equal(getattr(bias, other), getattr(loud_bias, other))
    lost = getattr(loud_readings, array[triad]) - getattr(readings, array[triad])
    alone = generators(1)[stream].standard_normal(lost.shape)
    if field == "noise":
        np.testing.assert_allclose(lost, alone * getattr(smooth, triad).noise * np.sqrt(200), atol=1e-12)
    else:
        np.testing.assert_allclose(lost, getattr(loud_bias, array[triad]) - getattr(bias, array[triad]), atol=1e-12)


def test_the_recorded_bias_is_what_is_left_of_the_readings_without_white_noise(bed):
    silent = [replace(triad, noise=0.0, step=0.0) for triad in (NOISY.gyro, NOISY.accel)]
    settings = replace(NOISY, gyro=silent[0], accel=silent[1])
    motion = bed.shaken(7, lasts_s=2)
    readings, bias = measure(motion, settings, rngs=generators(3))
    truth, _ = measure(motion, ImuSettings(**PLACED))
    np.testing.assert_allclose(readings.gyro_radps - truth.gyro_radps, bias.gyro_radps, atol=1e-12)
    np.testing.assert_allclose(readings.accel_mps2 - truth.accel_mps2, bias.accel_mps2, atol=1e-12)
    np.testing.assert_array_equal(bias.t_ns, readings.t_ns)


def test_each_start_has_a_bias_of_its_own_of_the_size_that_was_asked_for(bed):
    motion = bed.at_rest(np.eye(4), end_ns=0)
    firsts = [measure(motion, NOISY, rngs=generators(seed))[1] for seed in range(300)]
    gyro, accel = (np.concatenate([getattr(b, name) for b in firsts]) for name in ("gyro_radps", "accel_mps2"))
    assert gyro.std() == pytest.approx(np.deg2rad(1.0), rel=0.1)
    assert accel.std() == pytest.approx(0.07 * 9.80665, rel=0.1)


@pytest.mark.parametrize(("biased", "exact"), [("gyro", "accel"), ("accel", "gyro")])
def test_one_triad_may_start_with_a_bias_and_the_other_without(bed, biased, exact):
    settings = replace(ImuSettings(), **{biased: Triad(bias_std=0.1)})
    _, bias = measure(bed.at_rest(np.eye(4), end_ns=0), settings, rngs=generators(1))
    array = {"gyro": bias.gyro_radps, "accel": bias.accel_mps2}
    assert array[biased].all()
    assert not array[exact].any()


def test_a_calibration_says_what_the_imu_is():
    calibration = NOISY.calibration
    assert (calibration.gyro_noise, calibration.accel_walk) == (NOISY.gyro.noise, NOISY.accel.walk)
    assert calibration.rate_hz == 200
    np.testing.assert_array_equal(calibration.T_body_imu, PLACE)


def test_chance_without_a_generator_is_refused_by_name(bed):
    motion = bed.at_rest(np.eye(4), end_ns=10**9)
    with pytest.raises(InputError, match=r"generator for each of gyro_white, .*'start_bias' is missing"):
        measure(motion, NOISY)
    lacking = generators(1)
    del lacking["accel_walk"]
    with pytest.raises(InputError, match="'accel_walk' is missing"):
        measure(motion, NOISY, rngs=lacking)


@pytest.mark.parametrize("rate_hz", [0, -200, nan, inf, 1e9])
def test_a_rate_that_is_none_is_refused(rate_hz):
    with pytest.raises(SettingError, match=r"^rate_hz: should be "):
        ImuSettings(rate_hz=rate_hz)


def test_an_imu_is_placed_as_a_camera_that_looks_there():
    expected = looking(pitch_deg=20, position_m=(0.25, -0.1, 0.3))
    np.testing.assert_allclose(PLACE, expected, atol=1e-15)


# gyro in rad/s, accel in m/s²: white noise, walk.
SAID = {
    "exact": (0, 0, 0, 0),
    "adis16448": (1.6968e-4, 1.9393e-5, 2e-3, 3e-3),
    "mpu6000": (8.727e-5, 1.4105e-6, 2.3536e-3, 1.7652e-5),
    "bmi055": (2.4435e-4, 1.3713e-6, 1.47100e-3, 4.1606e-5),
}


@pytest.mark.parametrize("name", IMUS)
def test_a_preset_has_the_densities_of_its_source(name):
    c = IMUS[name].calibration
    assert (c.gyro_noise, c.gyro_walk, c.accel_noise, c.accel_walk) == pytest.approx(SAID[name], rel=1e-4)
    assert c.rate_hz == 200


@pytest.mark.parametrize(("name", "gyro_deg_per_hour", "accel_micro_g"), [("mpu6000", 4.6, 36), ("bmi055", 2.0, 30)])
def test_a_walk_that_is_forgotten_keeps_within_its_stability(name, gyro_deg_per_hour, accel_micro_g):
    gyro, accel = (t.walk * np.sqrt(t.correlation_s / 2) for t in (IMUS[name].gyro, IMUS[name].accel))
    assert np.rad2deg(gyro) * 3600 == pytest.approx(gyro_deg_per_hour)
    assert accel / 9.80665 * 1e6 == pytest.approx(accel_micro_g)


@pytest.mark.parametrize("name", sorted(set(IMUS) - {"exact"}))
def test_a_chip_counts_to_its_limit_in_no_more_than_sixteen_bits(name):
    for triad in (IMUS[name].gyro, IMUS[name].accel):
        assert 2**10 < triad.limit / triad.step < 2**15 * 1.01


def draws(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((count, 3))


@pytest.mark.parametrize("rate_hz", [10.0, 200.0])
def test_the_mean_over_a_second_is_as_noisy_at_any_rate(rate_hz):
    silence = np.zeros((round(2000 * rate_hz), 3))
    readings = readings_of(Triad(noise=0.01), silence, silence, draws(len(silence)), step_s=1 / rate_hz)
    seconds = readings.reshape(2000, -1, 3).mean(1)
    assert seconds.std() == pytest.approx(0.01, rel=0.03)


@pytest.mark.parametrize("rate_hz", [10.0, 200.0])
def test_a_walk_goes_as_far_in_a_second_at_any_rate(rate_hz):
    path = random_walk(Triad(walk=0.01), draws(round(2000 * rate_hz) + 1), step_s=1 / rate_hz)
    assert not path[0].any()
    assert np.diff(path[:: round(rate_hz)], axis=0).std() == pytest.approx(0.01, rel=0.03)


@pytest.mark.parametrize("rate_hz", [10.0, 100.0])
def test_a_walk_that_is_forgotten_has_spread_and_memory_at_any_rate(rate_hz):
    triad = Triad(walk=0.01, correlation_s=0.5)
    lag = round(0.5 * rate_hz)
    path = random_walk(triad, draws(200_000), step_s=1 / rate_hz)
    assert path.std() == pytest.approx(0.01 * np.sqrt(0.5 / 2), rel=0.03)
    assert np.corrcoef(path[:-lag, 0], path[lag:, 0])[0, 1] == pytest.approx(np.exp(-1), abs=0.03)


def test_a_walk_that_is_forgotten_has_its_spread_from_the_first_reading_on():
    triad = Triad(walk=0.01, correlation_s=0.5)
    firsts = np.stack([random_walk(triad, draws(1, seed), step_s=0.01)[0] for seed in range(1000)])
    assert firsts.std() == pytest.approx(0.005, rel=0.05)


def test_a_memory_of_ages_is_a_walk_that_is_never_forgotten():
    numbers = draws(1000)
    numbers[0] = 0.0
    never, ages = (random_walk(Triad(walk=0.01, correlation_s=tau), numbers, step_s=0.01) for tau in (None, 1e7))
    np.testing.assert_allclose(ages, never, atol=1e-6)


@pytest.mark.parametrize("correlation_s", [0.5, None])
def test_a_longer_walk_begins_with_the_shorter_one(correlation_s):
    triad, numbers = Triad(walk=0.01, correlation_s=correlation_s), draws(500)
    short, long = (random_walk(triad, numbers[:n], step_s=0.01) for n in (50, 500))
    np.testing.assert_array_equal(long[:50], short)


def test_walking_leaves_the_numbers_it_was_given_alone():
    numbers = draws(10)
    random_walk(Triad(walk=1.0), numbers, step_s=0.1)
    np.testing.assert_array_equal(numbers, draws(10))


def test_without_flaws_the_truth_is_read():
    true, none = draws(100), np.zeros((100, 3))
    np.testing.assert_array_equal(readings_of(FLAWLESS, true, none, draws(100, 1), step_s=0.01), true)


def test_scale_and_misalignment_act_on_the_truth_and_not_on_the_bias():
    triad = Triad(bias=(0.1, 0.2, 0.3), gain=((1.01, 0.02, 0), (0, 0.98, 0), (0, 0, 1)))
    bias = initial_bias(triad, np.zeros(3))[None]
    (reading,) = readings_of(triad, np.array([[1.0, 2.0, 3.0]]), bias, np.zeros((1, 3)), step_s=0.01)
    np.testing.assert_allclose(reading, [1.05 + 0.1, 1.96 + 0.2, 3.3])


def test_a_chip_reads_whole_steps_within_its_range():
    chip, none = Triad(limit=1.0, step=0.25), np.zeros((4, 3))
    true = np.array([[0.12, -0.13, 0.9], [5.0, -5.0, 0.0], [0.24, 0.26, 0.5], [np.pi, 1e9, -1e9]])
    said = [[0, -0.25, 1], [1, -1, 0], [0.25, 0.25, 0.5], [1, 1, -1]]
    np.testing.assert_array_equal(readings_of(chip, true, none, none, step_s=0.01), said)


@pytest.mark.parametrize("field", ["noise", "walk", "bias_std", "step"])
@pytest.mark.parametrize("value", [-1e-9, nan, inf, 1e4])
def test_a_size_that_is_none_is_refused_by_name(field, value):
    with pytest.raises(SettingError, match=f"^{field}: should be (0 or more|a finite number|1000 or less)"):
        replace(FLAWLESS, **{field: value})


@pytest.mark.parametrize("field", ["correlation_s", "limit"])
@pytest.mark.parametrize("value", [0.0, -1.0, nan])
def test_a_bound_that_is_none_is_refused_by_name(field, value):
    with pytest.raises(SettingError, match=f"^{field}: should be (greater than 0|a finite number)"):
        replace(FLAWLESS, **{field: value})


@pytest.mark.parametrize(("field", "value"), [("bias", (0, 1)), ("bias", (0, nan, 0)), ("gain", (1.0, 1.0, 1.0))])
def test_numbers_that_are_too_few_or_none_are_refused_by_name(field, value):
    with pytest.raises(SettingError, match=rf"^{field}(\.\d)?: (this key is missing|should be a (finite number|list))"):
        replace(FLAWLESS, **{field: value})


def test_by_itself_an_imu_is_at_the_origin_of_the_body_along_its_axes():
    np.testing.assert_array_equal(ImuSettings().T_body_imu, np.eye(4))


@pytest.mark.parametrize(
    ("name", "gyro_deg_per_s", "accel_g"),
    [("adis16448", 1000, 18), ("mpu6000", 2000, 16), ("bmi055", 1000, 4)],
)
def test_a_preset_has_the_range_of_its_chip(name, gyro_deg_per_s, accel_g):
    np.testing.assert_allclose(IMUS[name].gyro.limit, np.deg2rad(gyro_deg_per_s))
    np.testing.assert_allclose(IMUS[name].accel.limit, accel_g * 9.80665)
