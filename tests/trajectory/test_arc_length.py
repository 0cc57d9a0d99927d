"""Arc length to twelve digits."""

import numpy as np
import pytest
from scipy.special import ellipe

from vobench.trajectory.arc_length import arc_length

KNOTS = np.linspace(0, 2 * np.pi, 2049)


def test_a_circle_has_its_circumference_and_even_parameter():
    arc = arc_length(lambda phi: np.full_like(phi, 3.0), KNOTS)
    assert arc.length == pytest.approx(6 * np.pi, rel=1e-14)
    s = np.linspace(0, arc.length, 100)
    np.testing.assert_allclose(arc.parameter(s), s / 3, atol=1e-13)


@pytest.mark.parametrize("narrow", [0.9, 0.5, 0.2])
def test_an_ellipse_has_the_length_of_its_elliptic_integral(narrow):
    def speed(phi):
        return np.hypot(np.sin(phi), narrow * np.cos(phi))

    arc = arc_length(speed, KNOTS)
    assert arc.length == pytest.approx(4 * ellipe(1 - narrow**2), rel=1e-13)
    s = np.linspace(0, arc.length, 1000)
    np.testing.assert_allclose(arc.parameter(s, 1) * speed(arc.parameter(s)), 1, atol=1e-9)
