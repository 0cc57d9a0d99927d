"""Materials: how surfaces scatter, mirror and shine; Fresnel's law."""

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry.se3 import Array

Map = NDArray[np.float32]
Rgb = tuple[float, float, float]
WHITE: Rgb = (1.0, 1.0, 1.0)
WATER_ETA = 1.33  # the refractive index of water
# What red, green and blue of ITU-R BT.709 add to luminance.
LUMINANCE: Rgb = (0.2126, 0.7152, 0.0722)


class Texture(Protocol):
    """A picture that repeats every tile_m, u along its rows, v down from the first of them."""

    @property
    def tile_m(self) -> float:
        """The texture coordinates of a mesh that one repeat covers, in metres for most meshes."""

    def pixels(self) -> NDArray[Any]:
        """Linear reflectance (H, W) float32, or (H, W, 3 or 4) uint8 in sRGB, the fourth the opacity."""


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A texture of these pixels."""

    values: NDArray[Any]
    tile_m: float = 1.0

    def pixels(self) -> NDArray[Any]:
        """The pixels."""
        return self.values


@dataclass(frozen=True, slots=True, weakref_slot=True)
class Material:
    """How a surface looks. A body scatters light evenly (Lambert) under a coat; a mirror and a pane have no body.

    colour (3,) linear RGB reflectance, times the texture. eta: of the coat or the pane's glass, 1 for none;
    tint: scales what a coat or mirror mirrors, or what a pane lets pass. roughness: GGX alpha of coat or mirror.
    metal: the share of the body that is bare metal, which reflects specularly in its colour and scatters nothing.
    emission_cd_m2 (3,): luminance of each channel as white of that strength, times emission_texture.
    cutout: the opacity of the texture below which there is a hole, None where it is solid.
    is_foliage: whether it is the leaves of a tree or bush, which wind moves.
    """

    kind: Literal["body", "mirror", "pane"] = "body"
    colour: Rgb = WHITE
    texture: Texture | None = None
    eta: float = 1.0
    tint: float = 1.0
    roughness: float = 0.0
    metal: float = 0.0
    emission_cd_m2: Rgb = (0.0, 0.0, 0.0)
    emission_texture: Texture | None = None
    cutout: float | None = None
    is_foliage: bool = False

    @property
    def is_coated(self) -> bool:
        """Whether it is a body under a coat."""
        return self.kind == "body" and self.eta > 1

    @property
    def tile_m(self) -> float:
        """The length that one repeat of the texture covers; 1 without a texture."""
        return self.texture.tile_m if self.texture else 1.0


def linear(srgb: ArrayLike) -> Map:
    """Linear values of sRGB ones, both in [0, 1], or of uint8. Source: IEC 61966-2-1."""
    values = np.asarray(srgb)
    if values.dtype == np.uint8:
        return np.asarray(linear(np.arange(256, dtype=np.float32) / 255)[values])
    c = values.astype(np.float32)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4).astype(np.float32)


def srgb(values: ArrayLike) -> NDArray[np.uint8]:
    """Linear values as sRGB in uint8; values outside of [0, 1] are clipped. Source: IEC 61966-2-1."""
    c = np.clip(values, 0, 1)
    encoded = np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(255 * encoded), np.uint8)


def linear_texture(texture: Texture) -> Map:
    """Linear values (H, W, 3), or (H, W, 1) of a grey texture, row 0 at v = 0."""
    pixels = texture.pixels()
    return pixels[..., None] if pixels.ndim == 2 else linear(pixels[..., :3])


def emitted_cd_m2(material: Material) -> Array:
    """Luminance (3,) of each channel of what a material emits, the mean over its texture."""
    if material.emission_texture is None:
        return np.array(material.emission_cd_m2)
    mean = linear_texture(material.emission_texture).mean((0, 1), dtype=float)
    return np.asarray(material.emission_cd_m2 * mean)


def reflectance(material: Material) -> Map:
    """Luminous reflectance (H, W) float32 of a body's tile, row 0 at v = 0; one pixel where it has no texture."""
    colour = np.array(material.colour, np.float32)
    weights = np.array(LUMINANCE)
    luminous = colour @ weights
    if material.texture is None:
        return np.full((1, 1), luminous, np.float32)
    pixels = material.texture.pixels()
    is_grey = pixels.ndim == 2
    if is_grey:
        return np.asarray(pixels * np.float32(luminous), np.float32)
    return np.asarray(linear(pixels[..., :3]) @ (colour * weights).astype(np.float32))


def fresnel(cosine: Array, eta: float | Array) -> Array:
    """F (...) at cosines (...) of the angle to the normal, from air onto eta. Source: Born and Wolf, section 1.5."""
    c = np.clip(np.abs(cosine), 0.0, 1.0)
    inside = np.sqrt(1 - (1 - c * c) / eta**2)
    across = (c - eta * inside) / (c + eta * inside)
    along = (inside - eta * c) / (inside + eta * c)
    return np.asarray(0.5 * (across**2 + along**2))


def pane_reflectance(cosine: Array, eta: float | Array) -> Array:
    """Share (...) that a pane mirrors, all reflections between its two faces added: 2F / (1 + F)."""
    F = fresnel(cosine, eta)
    return 2 * F / (1 + F)


def inner_reflectance(eta: float) -> float:
    """Share of diffuse light under a coat that the coat sends back down.

    By the reciprocity of Fresnel's law: 1 - (1 - F̄) / eta², F̄ the mean of F over diffuse light from outside.
    """
    cosine = np.sqrt((np.arange(4096) + 0.5) / 4096)  # cosines of diffuse light: cos² is evenly spread
    return float(1 - (1 - fresnel(cosine, eta).mean()) / eta**2)


def under_coat(albedo: Array, eta: float) -> Array:
    """The reflectance of a texture of albedo (...) below its coat, with all inner reflections, per light transmitted.

    Outgoing luminance = under_coat · E_in (1 - F(out)) / π, where E_in is the illuminance that enters,
    weighted by 1 - F(in). Source: the plastic of Mitsuba 3 (nonlinear), after Jakob (2010).
    """
    return np.asarray(albedo / (1 - albedo * inner_reflectance(eta)) / eta**2)
