"""Pieces of a course against their closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import fresnel

from vobench.robot.course import Piece, course


def place(pieces, s):
    return course(pieces).at(np.atleast_1d(np.asarray(s, float))).T_world_body[:, :2, 3]


@given(st.floats(0.1, 10), st.floats(0.1, 50))
def test_an_arc_lies_on_its_circle(radius_m, length_m):
    s = np.linspace(0, length_m, 50)
    x, y = place([Piece(length_m, 1 / radius_m)], s).T
    np.testing.assert_allclose(x, radius_m * np.sin(s / radius_m), atol=1e-12 * (radius_m + length_m))
    np.testing.assert_allclose(y, radius_m * (1 - np.cos(s / radius_m)), atol=1e-12 * (radius_m + length_m))


@given(st.floats(0.05, 3), st.floats(0.5, 6))
def test_a_clothoid_is_fresnels(bent, length_m):
    s, scale = np.linspace(0, length_m, 50), np.sqrt(np.pi / bent)
    sine, cosine = fresnel(s / scale)
    np.testing.assert_allclose(place([Piece(length_m, bent=bent)], s), scale * np.stack([cosine, sine], -1), atol=1e-11)


def test_a_line_back_ends_behind():
    np.testing.assert_allclose(place([Piece(3.0, advance=-1.0)], 3.0), [[-3, 0]], atol=1e-15)


def test_a_turn_on_the_spot_changes_the_heading_alone():
    k = course([Piece(1.0), Piece(np.pi / 2, 1.0, advance=0.0), Piece(2.0)]).at(
        np.array([1.0 + np.pi / 2, 3 + np.pi / 2])
    )
    np.testing.assert_allclose(k.T_world_body[:, :2, 3], [[1, 0], [1, 2]], atol=1e-15)
    np.testing.assert_allclose(k.T_world_body[:, :2, 0], [[0, 1], [0, 1]], atol=1e-15)


def test_ahead_and_back_along_a_clothoid_is_nowhere():
    there, back = Piece(4.0, 0.3, 0.2), Piece(4.0, -1.1, 0.2, advance=-1.0)
    k = course([there, back]).at(np.array([8.0]))
    np.testing.assert_allclose(k.T_world_body[0], np.eye(4), atol=1e-13)


def test_breaks_are_where_pieces_meet_however_far_they_turn():
    np.testing.assert_allclose(course([Piece(30.0, 2.0), Piece(1.0), Piece(5.0, -3.0)]).breaks, [30, 31])


@pytest.mark.parametrize("laps", [1, 100, 1000])
def test_many_laps_close(laps):
    np.testing.assert_allclose(place([Piece(2 * np.pi * laps, 1.0)], 2 * np.pi * laps), [[0, 0]], atol=1e-12 * laps)
