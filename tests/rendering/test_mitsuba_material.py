"""Each kind of material becomes the plugin of Mitsuba that scatters light as it does."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vobench.rendering.mitsuba_material import CUTOUT_PX, Plugin, bsdf_plugin, grey
from vobench.scene.material import Material, Picture

MI = SimpleNamespace(Bitmap=lambda values: values)


def plugin(*, two_sided: bool = False, **properties: Any) -> Plugin:
    return bsdf_plugin(MI, Material(**properties), two_sided=two_sided)


@pytest.mark.parametrize(
    ("properties", "type_name"),
    [
        ({}, "diffuse"),
        ({"eta": 1.5}, "plastic"),
        ({"eta": 1.5, "roughness": 0.2}, "roughplastic"),
        ({"kind": "mirror"}, "conductor"),
        ({"kind": "mirror", "roughness": 0.2}, "roughconductor"),
        ({"kind": "pane", "eta": 1.5}, "thindielectric"),
        ({"metal": 0.5}, "blendbsdf"),
    ],
)
def test_each_material_has_its_type(properties: dict[str, Any], type_name: str) -> None:
    assert plugin(**properties)["type"] == type_name


def test_a_mirror_reflects_its_tint_and_a_rough_one_has_facets() -> None:
    smooth = plugin(kind="mirror", tint=0.9)
    rough = plugin(kind="mirror", tint=0.9, roughness=0.2)
    assert smooth["specular_reflectance"] == grey(0.9)
    assert "alpha" not in smooth
    assert (rough["distribution"], rough["alpha"]) == ("ggx", 0.2)


def test_both_sides_of_a_two_sided_surface_scatter_light_alike() -> None:
    assert plugin(two_sided=True) == {"type": "twosided", "bsdf": plugin()}


def test_a_texture_with_holes_has_a_mask() -> None:
    pixels = np.full((2, 3, 4), 255, np.uint8)
    pixels[0, 0, 3] = 0  # a transparent texel
    masked = plugin(texture=Picture(pixels, 1.0), cutout=0.5)
    opacity = masked["opacity"]["bitmap"][..., 0]
    assert masked["type"] == "mask"
    assert opacity.shape == (2 * CUTOUT_PX, 3 * CUTOUT_PX)
    assert set(np.unique(opacity)) == {0, 1}
