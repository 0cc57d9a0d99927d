"""What a rough coat reflects: Fresnel's reflectance averaged over the facets of a GGX surface that are seen.

Source: Heitz, Sampling the GGX Distribution of Visible Normals, 2018; Walter et al., Microfacet Models for Refraction
through Rough Surfaces, 2007 (masking).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.material import fresnel

SMOOTH = 0.05  # roughness up to which the reflectance is Fresnel's
COSINES = np.linspace(0.05, 1.0, 20)  # at which the reflectance is computed
SIDE = 32  # of the grid of facets
EXPONENTS = np.linspace(1.0, 6.0, 51)


@dataclass(frozen=True, slots=True)
class RoughReflectance:
    """The reflectance of a rough coat, which is normal + rise * (1 - cosine) ** exponent."""

    normal: float
    rise: float
    exponent: float

    def at(self, cosine: Array) -> Array:
        """The reflectance at cosines (...) of the angle to the normal."""
        return self.normal + self.rise * (1 - cosine) ** self.exponent


@lru_cache(maxsize=256)
def rough_reflectance(eta: float, roughness: float) -> RoughReflectance:
    """The curve that is nearest to the reflectance of a coat with a roughness (GGX alpha), by least squares."""
    reflectance = np.array([directional_reflectance(eta, roughness, float(cosine)) for cosine in COSINES])
    normal = float(reflectance[-1])
    best = RoughReflectance(normal, 0.0, 1.0)
    least = np.inf
    for exponent in EXPONENTS:
        basis = (1 - COSINES) ** exponent
        rise = float(basis @ (reflectance - normal) / (basis @ basis))
        curve = RoughReflectance(normal, rise, float(exponent))
        error = float(np.sum((curve.at(COSINES) - reflectance) ** 2))
        if error < least:
            best = curve
            least = error
    return best


def directional_reflectance(eta: float, roughness: float, cosine: float) -> float:
    """The share of light at the cosine of an angle to the normal that facets mirror once."""
    to_eye = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    facets = _visible_facets(to_eye, roughness)
    along = np.clip(facets @ to_eye, 0, 1)
    mirrored = 2 * along[:, None] * facets - to_eye
    is_above = mirrored[:, 2] > 0
    unmasked = np.where(is_above, _unmasked(np.abs(mirrored[:, 2]), roughness), 0)
    return float(np.mean(fresnel(along, eta) * unmasked))


def _visible_facets(to_eye: Array, roughness: float) -> Array:
    """Normals (N, 3) of facets as often as they are seen from a direction (3,), on a grid of equal shares."""
    middles = (np.arange(SIDE) + 0.5) / SIDE
    first, second = (grid.ravel() for grid in np.meshgrid(middles, middles))
    stretched = to_eye * [roughness, roughness, 1]
    stretched /= np.linalg.norm(stretched)
    # The second of the tangents leads upwards, since below the horizon no facet is seen.
    is_upright = np.hypot(stretched[0], stretched[1]) < 1e-9
    across = np.array([1.0, 0, 0]) if is_upright else np.array([-stretched[1], stretched[0], 0])
    across /= np.linalg.norm(across)
    upwards = np.cross(stretched, across)

    radius = np.sqrt(first)
    u = radius * np.cos(2 * np.pi * second)
    v = radius * np.sin(2 * np.pi * second)
    share = (1 + stretched[2]) / 2
    v = (1 - share) * np.sqrt(1 - u**2) + share * v
    w = np.sqrt(np.maximum(1 - u**2 - v**2, 0))
    hemisphere = u[:, None] * across + v[:, None] * upwards + w[:, None] * stretched
    facets = hemisphere * [roughness, roughness, 1]
    return np.asarray(facets / np.linalg.norm(facets, axis=1, keepdims=True))


def _unmasked(cosine: Array, roughness: float) -> Array:
    """The share of facets (...) that nothing masks at cosines (...) (Smith)."""
    squared_tangent = (1 - cosine**2) / np.maximum(cosine**2, 1e-12)
    return np.asarray(2 / (1 + np.sqrt(1 + roughness**2 * squared_tangent)))
