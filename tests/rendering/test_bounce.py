"""Bounces are a geometric series that solves the linear system of radiosity."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from vobench.geometry.se3 import Array
from vobench.rendering.bounce import bounced

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
