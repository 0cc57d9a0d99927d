"""Paint: a plain layer over the bodies of a scene, under which their textures disappear."""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Gt, Lt
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array
from vobench.scene.material import LUMINANCE, WHITE, Material, Rgb, Texture, linear, srgb
from vobench.setting import Share, settings


@settings()
class Paint:
    """Plain paint on everything but lamps, mirrors and panes.

    `cover` is the share of each surface that it covers, in spots too small to be seen: a reflectance R becomes
    (1 - cover) R + cover albedo. `albedo` is the reflectance of the paint, which is grey.
    """

    cover: Share
    albedo: Annotated[float, Gt(0), Lt(1)] = 0.5

    def over(self, reflectance: ArrayLike) -> Array:
        """The reflectance (...) of painted surfaces, given that of the bare ones."""
        return np.asarray((1 - self.cover) * np.asarray(reflectance) + self.cover * self.albedo)


@dataclass(frozen=True, slots=True, eq=False)
class PaintedTexture:
    """The texture of a material under paint.

    `bare` is the texture without paint, and `bare_colour` the colour of its material.
    `colour` is the colour of the painted material, by which renderers multiply the pixels.

    The pixels of a grey texture are exact in luminance, but all have the same hue.
    """

    bare: Texture
    bare_colour: Rgb
    colour: Rgb
    paint: Paint

    @property
    def tile_m(self) -> float:
        """The texture coordinates of a mesh that one repeat covers, in metres for most meshes."""
        return self.bare.tile_m

    def pixels(self) -> NDArray[Any]:
        """The pixels: grey ones as linear reflectance, others in sRGB, with their opacity."""
        pixels = self.bare.pixels()
        if pixels.ndim == 2:
            luminous = self.paint.over(pixels * _luminance(self.bare_colour)) / _luminance(self.colour)
            return np.clip(luminous, 0, 1).astype(np.float32)
        bare = linear(pixels[..., :3]) * np.array(self.bare_colour, np.float32)
        encoded = srgb(self.paint.over(bare) / np.array(self.colour))
        return np.concatenate([encoded, pixels[..., 3:]], axis=-1)


def painted(material: Material, paint: Paint) -> Material:
    """A material under paint. Mirrors, panes and what emits light stay bare, and a coat is above the paint."""
    emits_light = any(material.emission_cd_m2)
    if material.kind != "body" or emits_light or paint.cover == 0:
        return material
    metal = (1 - paint.cover) * material.metal
    if material.texture is None:
        red, green, blue = paint.over(material.colour).tolist()
        return replace(material, colour=(red, green, blue), metal=metal)
    colour = _painted_hue(material.colour, paint)
    texture = PaintedTexture(material.texture, material.colour, colour, paint)
    return replace(material, colour=colour, texture=texture, metal=metal)


def _painted_hue(colour: Rgb, paint: Paint) -> Rgb:
    """The hue of a painted texture as the colour whose largest channel is 1: grey, the more paint there is."""
    luminance = _luminance(colour)
    if luminance == 0:
        return WHITE
    bare_hue = np.array(colour) / luminance
    hue = (1 - paint.cover) * bare_hue + paint.cover
    red, green, blue = (hue / hue.max()).tolist()
    return red, green, blue


def _luminance(colour: Rgb) -> float:
    """The luminous reflectance of a colour."""
    return float(np.array(colour) @ np.array(LUMINANCE))
