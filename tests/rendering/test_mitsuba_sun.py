"""The plugin of the sun shines from its disc with its irradiance."""

import numpy as np
import pytest

from vobench.errors import MissingDependencyError
from vobench.rendering import mitsuba
from vobench.rendering.mitsuba_sun import PLUGIN, register_sun
from vobench.scene.light import SUN_RADIUS_RAD


def test_directions_are_on_the_disc_and_the_weight_is_the_irradiance() -> None:
    try:
        mitsuba.prepare()
    except MissingDependencyError as error:
        pytest.skip(str(error))
    import drjit as dr
    import mitsuba as mi

    register_sun()
    towards = np.array([0.0, 0.6, 0.8])
    sun = mi.load_dict({"type": PLUGIN, "irradiance": mi.ScalarColor3f(1.0, 2.0, 3.0), "direction": towards.tolist()})
    point = dr.zeros(mi.SurfaceInteraction3f, 100)
    numbers = np.random.default_rng(0).random((2, 100)).astype(np.float32)
    sample, weight = sun.sample_direction(point, mi.Point2f(*(mi.Float(row) for row in numbers)), True)
    cosine = np.clip(np.asarray(sample.d).T @ towards, -1, 1)
    assert cosine.min() >= np.cos(SUN_RADIUS_RAD) - 1e-6
    np.testing.assert_allclose(np.asarray(weight)[:, 0].ravel(), [1, 2, 3])
