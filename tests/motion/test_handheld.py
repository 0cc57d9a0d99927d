"""The hand's shake: its size, its band and its seed; and a body carried by a body."""

import numpy as np
import pytest
from scipy.signal import welch
from scipy.spatial.transform import Rotation

from vobench.errors import SettingError
from vobench.geometry import se3
from vobench.motion.course import Circle
from vobench.motion.handheld import BAND_HZ, SHAKES, HandheldMotion, ShakeSettings, composed, draw_shake
from vobench.motion.spline import pose_spline

RATE_HZ = 32.0
T_S = np.arange(0, 256, 1 / RATE_HZ)
SETTINGS = ShakeSettings((0.01, 0.02, 0.03), (0.001, 0.002, 0.003))


def poses():
    t_s = np.arange(8.0)
    R = Rotation.from_rotvec(0.5 * np.random.default_rng(0).normal(size=(8, 3))).as_matrix()
    return t_s, se3.transform(R, np.random.default_rng(1).normal(size=(8, 3)))


def shaken(settings, seed=0):
    """Translation and small rotation (K, 6)."""
    T = draw_shake(settings, np.random.default_rng(seed)).at(T_S).T_world_body
    return np.concatenate([T[:, :3, 3], Rotation.from_matrix(T[:, :3, :3]).as_rotvec()], -1)


def test_without_shake_it_is_its_spline():
    spline = pose_spline(*poses())
    motion = HandheldMotion(spline, draw_shake(SHAKES["none"], np.random.default_rng(0)))
    t_ns = np.linspace(0, 7e9, 100)
    np.testing.assert_allclose(motion.at(t_ns).T_world_body, spline.at(t_ns).T_world_body, atol=1e-15)
    np.testing.assert_allclose(motion.at(t_ns).twist, spline.at(t_ns).twist, atol=1e-14)
    np.testing.assert_array_equal(motion.breaks_ns, spline.breaks_ns)


@pytest.mark.parametrize("seed", range(3))
def test_its_rms_is_as_said(seed):
    expected = [*SETTINGS.rms_m, *SETTINGS.rms_rad]
    np.testing.assert_allclose(np.sqrt((shaken(SETTINGS, seed) ** 2).mean(0)), expected, rtol=0.1)


@pytest.mark.parametrize("name", ["standing", "walking", "running"])
def test_its_spectrum_lies_in_the_band(name):
    shake = SHAKES[name]
    translation = shaken(shake)[:, :3]
    frequency_hz, power = welch(translation, RATE_HZ, window="blackmanharris", nperseg=2048, detrend=False, axis=0)
    low_hz, high_hz = BAND_HZ
    outside = (frequency_hz < low_hz - 0.1) | (frequency_hz > high_hz + 0.1)
    assert (power[outside].sum(0) < 1e-6 * power.sum(0)).all()
    assert (power[frequency_hz > high_hz / 2].sum(0) > 1e-6 * power.sum(0)).all()


def test_every_octave_shakes_as_hard():
    shake = draw_shake(SETTINGS, np.random.default_rng(0))
    accelerations = shake.amplitude[:, :-1] * shake.frequency_hz[:, :-1] ** 2  # the last column holds the steps
    np.testing.assert_allclose(accelerations, np.broadcast_to(accelerations[:, :1], accelerations.shape))
    in_octave = np.floor(np.log2(shake.frequency_hz[:, :-1] / BAND_HZ[0])).astype(int)
    assert [np.bincount(row).tolist() for row in in_octave] == [[4, 4, 4, 4]] * 6


@pytest.mark.parametrize("seed", range(3))
def test_in_the_middle_between_two_sways_a_step_is_at_the_middle_of_its_lift(seed):
    """Sway and lift trace one figure, whichever step they begin with."""
    sway, lift = shaken(ShakeSettings(step_hz=2.0, bounce_m=0.02), seed)[:, 1:3].T / [[0.01], [0.02]]
    np.testing.assert_allclose(lift**2, 4 * sway**2 * (1 - sway**2), atol=1e-9)


def test_steps_lift_the_body_at_their_pace_and_sway_it_at_half():
    translation = shaken(ShakeSettings(step_hz=2.0, bounce_m=0.02))
    amplitude = np.sqrt(2 * (translation**2).mean(0))
    np.testing.assert_allclose(amplitude, [0, 0.01, 0.02, 0, 0, 0], atol=1e-9)
    frequency_hz, power = welch(translation[:, 1:3], RATE_HZ, nperseg=2048, axis=0)
    np.testing.assert_allclose(frequency_hz[power.argmax(0)], [1.0, 2.0])


def test_the_seed_decides_and_nothing_else():
    np.testing.assert_array_equal(shaken(SETTINGS, 1), shaken(SETTINGS, 1))
    assert np.abs(shaken(SETTINGS, 1) - shaken(SETTINGS, 2)).max() > 0.01


def test_more_of_one_axis_leaves_the_others_as_they_were():
    more = ShakeSettings((0.05, 0.02, 0.03), SETTINGS.rms_rad)
    np.testing.assert_array_equal(shaken(more)[:, 1:3], shaken(SETTINGS)[:, 1:3])


def test_something_mounted_is_a_body_carried_without_moving():
    carrier = Circle(radius_m=2, speed_mps=1).way().at(np.linspace(0, 5e9, 20))
    T_body_sensor = se3.transform(Rotation.random(random_state=2).as_matrix(), [0.3, -0.2, 0.5])
    still = np.zeros((20, 3))
    load = type(carrier)(np.broadcast_to(T_body_sensor, (20, 4, 4)), still, still, still, still)
    found, expected = composed(carrier, load), carrier.of_mounted(T_body_sensor)
    for field in (
        "T_world_body",
        "velocity_mps",
        "angular_velocity_radps",
        "acceleration_mps2",
        "angular_acceleration_radps2",
    ):
        np.testing.assert_allclose(getattr(found, field), getattr(expected, field), atol=1e-13)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"rms_m": (-1.0, 0, 0)}, r"rms_m\.0: should be 0 or more"),
        ({"rms_rad": (0, np.nan, 0)}, r"rms_rad\.1: should be a finite number"),
        ({"bounce_m": 0.1, "step_hz": 0.5}, r"step_hz: should be from 1 to 8 \(got 0.5\)"),
    ],
)
def test_a_shake_that_is_none_is_a_sentence(settings, sentence):
    with pytest.raises(SettingError, match=sentence):
        ShakeSettings(**settings)
