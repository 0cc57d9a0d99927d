"""The settings of a bake have bounds, and the corners of faces have places on the light map."""

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle
from vobench.errors import SettingError
from vobench.rendering.baked_scene import INDIRECT_RAYS, BakeSettings
from vobench.scene.material import Material
from vobench.scene.scene import Scene


@pytest.mark.parametrize(
    "setting", [{"spacing_m": 0.0}, {"light_rays": 0}, {"indirect_rays": -1}, {"bounces": -1}, {"light_noise": 0.0}]
)
def test_settings_out_of_bounds_are_errors(setting) -> None:
    with pytest.raises(SettingError):
        BakeSettings(**setting)


def test_without_bounces_no_ray_for_indirect_light_is_needed() -> None:
    assert BakeSettings(bounces=0, indirect_rays=0).indirect_rays == 0
    assert BakeSettings().indirect_rays == INDIRECT_RAYS


def test_the_places_of_corners_are_shares_of_the_size_of_the_map(even_light) -> None:
    floor = rectangle(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "grey")
    baked = even_light(Scene("floor", (floor,), {"grey": Material()}, ()))
    size_px = (baked.atlas.width, baked.atlas.height)
    np.testing.assert_allclose(baked.light_uv * size_px, baked.atlas.light_px, rtol=1e-6)
    assert baked.light_uv.dtype == np.float32
