"""Bounces are a geometric series, surfels weigh their points, and faces give back no more than they get."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from vobench.geometry.se3 import Array
from vobench.rendering.indirect_light import Response, Surfels, bounced

RNG = np.random.default_rng(0)


def cavity(count: int, openness: float) -> csr_matrix:
    """Surfels that see one another by random shares, each of which adds up to 1 less an opening."""
    table = RNG.random((count, count))
    table *= (1 - openness) / table.sum(1, keepdims=True)
    return csr_matrix(table.astype(np.float32))


def first(lights: int, count: int) -> Array:
    return np.zeros((lights, count), np.float32)


@pytest.mark.parametrize("openness", [0.0, 0.3])
def test_even_light_in_a_cavity_adds_up_to_the_geometric_series(openness: float) -> None:
    seen_shares = cavity(12, openness)
    albedo = 0.5
    reflectance = np.full((12, 3), albedo, np.float32)
    light = bounced(np.ones((1, 12, 3), np.float32), reflectance, seen_shares, first(1, 12), bounces=64)
    seen = 1 - openness
    np.testing.assert_allclose(light, seen / (1 - seen * albedo), rtol=2e-3)


def test_bounces_agree_with_the_linear_system() -> None:
    seen_shares = cavity(20, 0.1)
    reflectance = RNG.uniform(0.1, 0.7, (20, 3)).astype(np.float32)
    sent = RNG.random((2, 20, 3)).astype(np.float32)
    light = bounced(sent, reflectance, seen_shares, first(2, 20), bounces=64)
    table = seen_shares.toarray()
    for lamp in range(2):
        for channel in range(3):
            system = np.eye(20) - table @ np.diag(reflectance[:, channel])
            expected = np.linalg.solve(system, table @ sent[lamp, :, channel])
            np.testing.assert_allclose(light[lamp, :, channel], expected, rtol=1e-2)


def test_no_bounce_is_dark_one_is_what_is_seen_and_each_more_adds_light() -> None:
    seen_shares = cavity(8, 0.2)
    reflectance = np.full((8, 1), 0.6, np.float32)
    sent = RNG.random((1, 8, 1)).astype(np.float32)
    by_count = [bounced(sent, reflectance, seen_shares, first(1, 8), bounces=count) for count in (0, 1, 2, 3)]
    assert (by_count[0] == 0).all()
    np.testing.assert_allclose(by_count[1][0, :, 0], seen_shares @ sent[0, :, 0], rtol=1e-6)
    for fewer, more in pairwise(by_count):
        assert (more > fewer).all()


def test_light_by_mirrors_is_seen_once_and_then_bounces_as_all_other_light() -> None:
    seen_shares = cavity(8, 0.2)
    reflectance = np.full((8, 1), 0.6, np.float32)
    by_mirrors = RNG.random((1, 8)).astype(np.float32)
    dark = np.zeros((1, 8, 1), np.float32)
    once = bounced(dark, reflectance, seen_shares, by_mirrors, bounces=1)
    np.testing.assert_allclose(once[0, :, 0], by_mirrors[0], rtol=1e-6)
    twice = bounced(dark, reflectance, seen_shares, by_mirrors, bounces=2)
    again = seen_shares @ (0.6 * by_mirrors[0])
    np.testing.assert_allclose(twice[0, :, 0] - once[0, :, 0], again, rtol=1e-4)


def test_means_of_surfels_are_weighted_and_even_values_stay() -> None:
    surfels = Surfels(np.array([0, 0, 1, 1, 1], np.int32), np.array([0, 2]), np.ones(2, np.float32))
    weights = np.array([1.0, 3.0, 1.0, 1.0, 2.0])
    values = np.array([[0.0], [4.0], [1.0], [2.0], [3.0]])
    np.testing.assert_allclose(surfels.mean(values, weights), [[3.0], [2.25]])
    np.testing.assert_allclose(surfels.mean(np.full((5, 3), 0.7), weights), 0.7, rtol=1e-6)
    assert len(surfels) == 2


def test_a_face_mirrors_and_scatters_no_more_than_all_light() -> None:
    etas = np.array([0.0, 1.3, 1.5, 2.0], np.float32)
    ones = np.ones(4, np.float32)
    lamp = np.full(4, -1, np.int32)
    response = Response(np.ones(4, bool), etas, ones, 0 * ones, 0 * ones, lamp, np.zeros(4, bool))
    face = np.repeat(np.arange(4, dtype=np.int32), 50)
    cosine = np.tile(np.linspace(0.01, 1, 50), 4)
    mirrored, scattered = response.mirrored(face, cosine), response.scattered(face, cosine)
    np.testing.assert_allclose(mirrored + scattered, 1, atol=1e-6)
    assert (mirrored[face == 0] == 0).all()
    by_face = mirrored.reshape(4, 50)
    assert (np.diff(by_face[1:], axis=1) <= 1e-6).all()  # the more grazing, the more is mirrored
    assert (np.diff(by_face[:, -1]) > 0).all()
    metal = Response(np.ones(4, bool), 0 * etas, ones, 0.8 * ones, 0 * ones, lamp, np.zeros(4, bool))
    np.testing.assert_allclose(metal.mirrored(face, cosine), 0.8, rtol=1e-6)
