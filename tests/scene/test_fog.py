"""Fog takes light by Bouguer's law and leaves 2 % of contrast at its visibility."""

import numpy as np
import pytest

from vobench.scene.fog import Fog
from vobench.scene.scene import Scene, sized


def test_at_its_visibility_fog_leaves_two_percent_of_contrast() -> None:
    fog = Fog(visibility_m=60.0)
    assert fog.extinction_per_m == pytest.approx(3.912 / 60, rel=1e-4)
    assert fog.transmittance(np.array([60.0])) == pytest.approx(0.02)


def test_the_transmittance_of_two_stretches_is_the_product_of_theirs() -> None:
    fog = Fog(visibility_m=25.0)
    near_m = np.array([0.0, 3.0, 10.0])
    far_m = np.array([5.0, 7.0, 40.0])
    product = fog.transmittance(near_m) * fog.transmittance(far_m)
    np.testing.assert_allclose(fog.transmittance(near_m + far_m), product)


def test_a_scene_twice_as_large_has_fog_twice_as_thin() -> None:
    fog = sized(Scene("empty", (), {}, (), fog=Fog(visibility_m=30.0)), 2.0).fog
    assert fog == Fog(visibility_m=60.0)
    assert sized(Scene("empty", (), {}, ()), 2.0).fog is None
