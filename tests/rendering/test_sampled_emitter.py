"""A few samples stand for an emitter: they lie on it, and their strengths add up to its own."""

import numpy as np
import pytest

from vobench.geometry.triangle import areas_m2
from vobench.rendering.sampled_emitter import (
    OPEN_SKY_SAMPLES,
    PANEL_SAMPLES,
    SampledEmitter,
    joined_samples,
    sampled_emitters,
)
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Light, PointLight, Sky, Sun
from vobench.scene.material import Material
from vobench.scene.mesh import face_corners, quad
from vobench.scene.scene import ceiling_light
from vobench.scene.triangles import Thing, triangle_table

FLOOR = triangle_table([Thing("floor", quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)), "grey")], [-1], [-1])
VISIBILITY = Visibility(FLOOR, {"grey": Material()}, np.arange(len(FLOOR)))
PANEL = ceiling_light("panel", np.array([1.0, 0.3, 2.4]), (0.8, 0.4), power_lm=1000)
BULB = PointLight("bulb", np.array([-1.0, 0.5, 2.0]), 500.0)
SKY = Sky("sky", 2000.0, "uniform")
SUN = Sun("sun", 1e4, (0.0,), (0.0,), (30.0,))


def emitters_of(*lights: Light, most_samples: int = OPEN_SKY_SAMPLES) -> list[SampledEmitter]:
    return sampled_emitters(lights, VISIBILITY, [0.0] * len(lights), most_samples)


def strength_of_panel(panel: AreaLight) -> float:
    return panel.luminance_cd_m2 * float(areas_m2(face_corners(panel.mesh)).sum())


@pytest.mark.parametrize("most_samples", [2, PANEL_SAMPLES])
def test_the_samples_of_a_panel_add_up_to_its_strength(most_samples: int) -> None:
    (emitter,) = emitters_of(PANEL, most_samples=most_samples)
    assert len(emitter.places) <= most_samples
    assert emitter.strength.sum() == pytest.approx(strength_of_panel(PANEL))
    np.testing.assert_allclose(emitter.axes, np.tile([0, 0, -1, 0], (len(emitter.axes), 1)), atol=1e-12)


def test_the_samples_of_a_panel_lie_on_it_around_its_centre() -> None:
    (emitter,) = emitters_of(PANEL)
    np.testing.assert_allclose(emitter.places.mean(0), [1.0, 0.3, 2.4, 1.0])
    assert (np.linalg.norm(emitter.places[:, :3] - emitter.ball.centre_m, axis=1) <= emitter.ball.radius_m).all()


def test_lights_without_an_area_have_one_hard_sample() -> None:
    bulb, sun = emitters_of(BULB, SUN)
    assert bulb.is_hard
    assert sun.is_hard
    np.testing.assert_allclose(bulb.places, [[-1.0, 0.5, 2.0, 1.0]])
    np.testing.assert_allclose(sun.places, [[*SUN.direction(0), 0.0]])


def test_the_open_sky_has_directions_above_the_horizon_that_light_the_ground_as_it_does() -> None:
    (sky,) = emitters_of(SKY)
    assert (sky.places[:, 2] > 0).all()
    assert sky.strength @ sky.places[:, 2] == pytest.approx(np.pi * SKY.luminance_cd_m2(np.eye(3)[2:])[0], rel=0.01)


def test_samples_are_joined_in_the_order_of_their_emitters() -> None:
    samples = joined_samples(emitters_of(BULB, SKY))
    assert samples.light.tolist() == [0] + OPEN_SKY_SAMPLES * [1]
    assert samples.is_hard.tolist() == [True] + OPEN_SKY_SAMPLES * [False]
    assert (samples.is_open_sky == ~samples.is_hard).all()
    assert len(joined_samples([]).places) == 0
