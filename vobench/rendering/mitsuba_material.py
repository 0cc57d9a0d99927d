"""Materials as plugins of Mitsuba, which are dictionaries of their type and their parameters."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from vobench.rendering.cutout import is_opaque
from vobench.scene.material import Map, Material, Rgb, Texture, linear_texture

Plugin = dict[str, Any]

CUTOUT_PX = 4  # the side of a texel of the texture, in pixels of the mask that shows its holes


def bsdf_plugin(mi: Any, material: Material, *, two_sided: bool) -> Plugin:
    """The BSDF of a material, for surfaces that are visible from one side or from both."""
    if material.kind == "pane":
        return {
            "type": "thindielectric",
            "int_ior": material.eta,
            "ext_ior": 1.0,
            "specular_transmittance": grey(material.tint),
        }
    bsdf = _opaque_bsdf(mi, material)
    if two_sided:
        bsdf = {"type": "twosided", "bsdf": bsdf}
    if material.cutout is not None and material.texture is not None:
        opacity = _bitmap(mi, _opacity(material, material.texture), filter_type="nearest")
        bsdf = {"type": "mask", "opacity": opacity, "bsdf": bsdf}
    return bsdf


def _opaque_bsdf(mi: Any, material: Material) -> Plugin:
    """The BSDF of a mirror, or of a body that is diffuse, coated, metallic, or a mixture of these."""
    if material.kind == "mirror":
        return _conductor(material, grey(material.tint))

    colour = _textured(mi, material.texture, material.colour)
    body = _coated(material, colour) if material.is_coated else {"type": "diffuse", "reflectance": colour}
    if not material.metal:
        return body
    metal = _conductor(material, colour)
    return {"type": "blendbsdf", "weight": material.metal, "0": body, "1": metal}


def _conductor(material: Material, reflectance: Plugin) -> Plugin:
    """A surface that reflects light only specularly."""
    return {
        "type": "roughconductor" if material.roughness else "conductor",
        "material": "none",
        **_facets(material),
        "specular_reflectance": reflectance,
    }


def _coated(material: Material, colour: Plugin) -> Plugin:
    """A diffuse body under a dielectric coat."""
    return {
        "type": "roughplastic" if material.roughness else "plastic",
        **_facets(material),
        "int_ior": material.eta,
        "ext_ior": 1.0,
        "nonlinear": True,
        "specular_reflectance": grey(material.tint),
        "diffuse_reflectance": colour,
    }


def _facets(material: Material) -> Plugin:
    """The parameters of the distribution of microfacets. A smooth material has none."""
    if not material.roughness:
        return {}
    return {"distribution": "ggx", "alpha": material.roughness}


def _opacity(material: Material, texture: Texture) -> Map:
    """The mask (rows, columns) of a material with holes: 1 where it is solid, 0 in a hole."""
    texel_rows, texel_columns = texture.pixels().shape[:2]
    rows = CUTOUT_PX * texel_rows
    columns = CUTOUT_PX * texel_columns
    v = (np.arange(rows) + 0.5) / rows
    u = (np.arange(columns) + 0.5) / columns
    uv = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    return is_opaque(material, uv).reshape(rows, columns).astype(np.float32)


def area_emitter(mi: Any, material: Material) -> Any:
    """The light that a surface of a material emits, loaded into Mitsuba."""
    radiance = _textured(mi, material.emission_texture, material.emission_cd_m2)
    return mi.load_dict({"type": "area", "radiance": radiance})


def rgb(values: Iterable[float]) -> Plugin:
    """A value for each of red, green and blue."""
    return {"type": "rgb", "value": [float(value) for value in values]}


def grey(value: float) -> Plugin:
    """The same value for red, green and blue."""
    return rgb((value, value, value))


def _textured(mi: Any, texture: Texture | None, colour: Rgb) -> Plugin:
    """A colour times a texture, if there is one. Row 0 of the texture is at v = 0."""
    if texture is None:
        return rgb(colour)
    return _bitmap(mi, linear_texture(texture) * np.array(colour, np.float32), filter_type="bilinear")


def _bitmap(mi: Any, values: Map, *, filter_type: str) -> Plugin:
    """A texture of linear values (rows, columns) or (rows, columns, 3), which repeats."""
    with_channels = values if values.ndim == 3 else values[..., None]
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(with_channels)),
        "raw": True,
        "wrap_mode": "repeat",
        "filter_type": filter_type,
    }
