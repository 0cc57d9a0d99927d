"""How a surface answers light: matt, polished, mirror or glass.

eta   refractive index of a coat or pane against air
F     Fresnel's share of unpolarised light that a boundary reflects
"""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.texture import Texture


@dataclass(frozen=True, slots=True)
class Matt:
    """Reflects its texture's share of the light alike in all directions (Lambert)."""

    texture: Texture


@dataclass(frozen=True, slots=True)
class Polished:
    """A texture under a clear coat, such as waxed stone: matt below, and a mirror that grows towards grazing.

    `tint` scales what the coat mirrors; `roughness` is the RMS slope of its facets (GGX alpha), 0 for none.
    """

    texture: Texture
    eta: float = 1.5
    tint: float = 1.0
    roughness: float = 0.0


@dataclass(frozen=True, slots=True)
class Mirror:
    """A metal that reflects the share `tint` at every angle; `roughness` as in Polished."""

    tint: float = 0.9
    roughness: float = 0.0


@dataclass(frozen=True, slots=True)
class Glass:
    """A thin pane: mirrors a little, lets the rest pass straight; `tint` scales what passes. It dims light, no more."""

    eta: float = 1.5
    tint: float = 1.0


Material = Matt | Polished | Mirror | Glass


def texture_of(material: Material) -> Texture | None:
    """The texture a material shows, None for one without a body."""
    return material.texture if isinstance(material, Matt | Polished) else None


def fresnel(cosine: Array, eta: float | Array) -> Array:
    """F (...) at cosines (...) of the angle to the normal, from air onto eta. Source: Born and Wolf, section 1.5."""
    c = np.clip(np.abs(cosine), 0.0, 1.0)
    inside = np.sqrt(1 - (1 - c * c) / eta**2)
    across, along = (c - eta * inside) / (c + eta * inside), (inside - eta * c) / (inside + eta * c)
    reflected: Array = 0.5 * (across**2 + along**2)
    return reflected


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
    """What a texture of albedo (...) reflects per light let in and out of its coat, all inner bounces added.

    Outgoing luminance = under_coat · E_in (1 - F(out)) / π, where E_in is the illuminance that enters,
    weighted by 1 - F(in). Source: the plastic of Mitsuba 3 (nonlinear), after Jakob (2010).
    """
    lit: Array = albedo / (1 - albedo * inner_reflectance(eta)) / eta**2
    return lit
