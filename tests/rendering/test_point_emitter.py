"""Lamps without size and the sun have hard shadows, and the illuminance of photometry."""

import numpy as np

from tests.rendering.receivers import receivers, summed
from vobench.rendering.point_emitter import bulb_emitter, sun_emitter
from vobench.scene.light import SUN_RADIUS_RAD, PointLight, SpotLight, Sun

BULB = PointLight("bulb", np.array([0.2, 0.1, 5.0]), 4 * np.pi * 100)
SUN = Sun("sun", 1e5, (0.0, 10.0), (0.0, 90.0), (30.0, 30.0))


def test_a_bulb_gives_its_intensity_over_the_squared_distance() -> None:
    texels = receivers(eta=0.0)
    emitter = bulb_emitter(BULB)
    numbers = np.full(len(texels), 0.3, np.float32)
    vectors_m, strength = emitter.towards(texels)(numbers, numbers)
    np.testing.assert_allclose(texels.points_m + vectors_m, np.tile(BULB.position_m, (40, 1)), atol=1e-5)
    np.testing.assert_allclose(strength, 100 / (vectors_m**2).sum(1), rtol=1e-5)
    assert emitter.is_hard
    assert (emitter.width_rad(texels.points_m) == 0).all()


def test_a_spot_gives_nothing_beside_its_cone() -> None:
    spot = SpotLight("spot", np.array([0.0, 0, 5.0]), np.array([0.0, 0, -1.0]), 500.0, 5.0, 10.0)
    texels = receivers(eta=0.0)
    numbers = np.full(len(texels), 0.3, np.float32)
    vectors_m, strength = bulb_emitter(spot).towards(texels)(numbers, numbers)
    angle_deg = np.rad2deg(np.arccos(vectors_m[:, 2] / np.linalg.norm(vectors_m, axis=1)))
    assert (strength[angle_deg > 10.1] == 0).all()
    assert (strength[angle_deg < 9.9] > 0).all()


def test_the_sun_gives_its_illuminance_times_the_cosine_from_a_disc_of_its_size() -> None:
    texels = receivers(eta=0.0)
    emitter = sun_emitter(SUN, 0)
    np.testing.assert_allclose(summed(emitter, texels), 1e5 * 0.5, rtol=1e-3)
    a, b = np.random.default_rng(0).random((2, len(texels))).astype(np.float32)
    vectors_m, _ = emitter.towards(texels)(a, b)
    directions = vectors_m / np.linalg.norm(vectors_m, axis=1, keepdims=True)
    offsets = np.linalg.norm(directions - emitter.direction, axis=1)
    assert offsets.max() <= SUN_RADIUS_RAD * 1.01
    assert offsets.max() > SUN_RADIUS_RAD / 2


def test_the_sun_is_where_it_is_at_the_instant() -> None:
    for t_ns in (0, 5_000_000_000):
        np.testing.assert_allclose(sun_emitter(SUN, t_ns).direction, SUN.direction(t_ns))
