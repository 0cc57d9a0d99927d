"""Smoothing keeps even light and all light; further rays follow where light is noisy, and the noise is stated."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from tests.rendering.rectangles import rectangle, room
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.gathering import RayTotals, Smoothing
from vobench.rendering.illumination import Illumination
from vobench.scene.light import Sun
from vobench.scene.material import Material
from vobench.scene.scene import Scene

RNG = np.random.default_rng(0)
COARSE = BakeSettings(spacing_m=0.1, light_rays=4, indirect_spacing_m=0.2, indirect_rays=72)


def chain(count: int) -> Smoothing:
    """Surfels in a row, each of which takes light of its own and of its neighbours, by uneven weights."""
    weights = np.diag(RNG.uniform(0.4, 1, count))
    for step in (-1, 1):
        weights += np.diag(RNG.uniform(0.1, 0.5, count - 1), step)
    weights /= weights.sum(1, keepdims=True)
    return Smoothing(csr_matrix(weights.astype(np.float32)))


def test_smoothing_keeps_even_light_and_the_sum_of_any_light() -> None:
    smoothing = chain(50)
    np.testing.assert_allclose(smoothing.averaged(np.full(50, 3.0, np.float32)), 3, rtol=1e-5)
    light = RNG.random((50, 2)).astype(np.float32)
    smooth = smoothing.averaged(light)
    np.testing.assert_allclose(smooth.sum(0), light.sum(0), rtol=1e-5)
    assert (smooth.std(0) < 0.7 * light.std(0)).all()


def test_the_density_of_flux_in_proportion_to_area_is_even() -> None:
    area_m2 = RNG.uniform(0.001, 0.02, 50)
    density = chain(50).density(np.column_stack([5 * area_m2, 0 * area_m2]), area_m2)
    np.testing.assert_allclose(density[:, 0], 5, rtol=1e-4)
    assert (density[:, 1] == 0).all()


def test_the_luminance_of_surfels_does_not_depend_on_the_others() -> None:
    surfels = 200_003
    channels = 27
    near = RNG.random((2, surfels, channels))
    far = RNG.random((2, surfels, channels))
    sky = RNG.random((2, 1, surfels))
    rounds = RNG.integers(1, 8, surfels)
    luminance = RNG.random(channels).astype(np.float32)
    sky_weights = RNG.random(1).astype(np.float32)
    whole = RayTotals(near, far, sky, rounds).luminance_halves(luminance, sky_weights)
    parts = []
    for part in (slice(0, 777), slice(777, None)):
        totals = RayTotals(near[:, part], far[:, part], sky[..., part], rounds[part])
        parts.append(totals.luminance_halves(luminance, sky_weights))
    for half, by_parts in zip(whole, zip(*parts, strict=True), strict=True):
        assert (half == np.concatenate(by_parts, 1)).all()


def sunlit_room() -> Scene:
    """A room whose only light is a patch of sun that comes in by a hole in the roof."""
    walls = room((3, 3, 2.5), floor="grey", wall="grey", ceiling="grey")
    del walls[1]
    x, y = np.eye(3)[:2]
    middle_m = np.array([0, 0, 2.5])
    walls += [
        rectangle(middle_m + 0.9 * x, 3 * y, 1.2 * x, "grey", "east"),
        rectangle(middle_m - 0.9 * x, 3 * y, 1.2 * x, "grey", "west"),
        rectangle(middle_m + 0.9 * y, 1.2 * y, 0.6 * x, "grey", "north"),
        rectangle(middle_m - 0.9 * y, 1.2 * y, 0.6 * x, "grey", "south"),
    ]
    sun = Sun("sun", 5e4, (0.0,), (30.0,), (65.0,))
    return Scene("sunlit", tuple(walls), {"grey": Material(colour=(0.5, 0.5, 0.5))}, (sun,))


def on_map(baked: BakedScene) -> Array:
    """The light of all texels that are in a surfel."""
    light = Illumination(baked).at(0, 0)[..., 1].ravel()
    return light[baked.patches.surfel_of >= 0]


def test_further_rays_bring_the_noise_below_the_setting_and_it_is_as_stated() -> None:
    scene = sunlit_room()
    few = replace(COARSE, light_noise=1.0)
    enough = replace(COARSE, light_noise=0.06)
    stated = {}
    measured = {}
    for settings in (few, enough):
        first = bake(scene, settings)
        second = bake(scene, replace(settings, seed=1))
        mean = (on_map(first) + on_map(second)) / 2
        ratio = (on_map(first) - on_map(second)) / np.sqrt(2) / np.maximum(mean, 0.1 * mean.mean())
        stated[settings.light_noise] = first.light_noise
        measured[settings.light_noise] = ratio.std()
    assert stated[0.06] <= 0.06 < stated[1.0]
    assert measured[0.06] < 0.75 * measured[1.0]
    assert measured[0.06] < 0.07
    for noise, value in measured.items():
        assert stated[noise] == pytest.approx(value, rel=0.5)
