"""What the lens does to light on its way: falloff to the corners, blur, flare and dirt, on linear radiance. Pure."""

from dataclasses import dataclass

import numpy as np
import scipy

from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array
from vobench.sensor.image_sensor import CameraSettings, Radiance

SMUDGES = 5
SPECKS = 60
# radii over the picture's width
SMUDGE_SHARE = (0.05, 0.2)
SPECK_SHARE = (0.004, 0.015)
# Of the light that dirt takes, the share that it scatters onto the chip; the rest is absorbed. An assumption.
SCATTERED = 0.5
# Over the picture's width: the distance scale of the veil of flare, and the spread of a ghost. Assumptions.
VEIL_SHARE = 0.1
GHOST_SHARE = 0.02
# Points across a pixel for the share of it that a disc covers.
FINE = 32


@dataclass(frozen=True, slots=True)
class LensMaps:
    """One lens, made once per camera; None is no effect.

    `shade` (H, W) is the share of light that passes; `veil` (H, W) the share of the picture's mean that dirt adds;
    `transfer` (H, W) the blur and flare over the frequencies of a cosine transform.
    """

    shade: Radiance | None = None
    veil: Radiance | None = None
    transfer: Array | None = None


def lens_maps(effects: CameraSettings, camera: Camera, rng: np.random.Generator) -> LensMaps:
    """The maps of a camera's lens; only dirt draws from `rng`."""
    shape = (camera.height_px, camera.width_px)
    shade = veil = transfer = None
    if effects.vignetting > 0 or effects.vignetting_cutoff_deg is not None:
        rays = camera.rays(pixel_grid(camera))
        shade = vignetting(rays, strength=effects.vignetting, cutoff_deg=effects.vignetting_cutoff_deg)
    if effects.dirt > 0:
        taken = dirt(shape, effects.dirt, rng)
        passed = np.ones(shape) if shade is None else shade
        shade = passed * (1 - taken)
        veil = SCATTERED * passed * taken
    if effects.blur_sigma_px > 0 or effects.defocus_px > 0:
        transfer = gaussian_transfer(shape, effects.blur_sigma_px) * disc_transfer(shape, effects.defocus_px)
    if effects.flare > 0 or effects.ghost > 0:
        transfer = flare_transfer(1.0 if transfer is None else transfer, shape, effects.flare, effects.ghost)
    return LensMaps(_single(shade), _single(veil), transfer)


def through_lens(radiance: Radiance, maps: LensMaps) -> Radiance:
    """Radiance (H, W), or (H, W, 3) in colour, as it reaches the chip: past dirt, falloff, blur and flare.

    Source of the dirt's two terms: Gu, Ramamoorthi, Belhumeur and Nayar (2009), equation 3.
    """
    if radiance.ndim == 3:
        return np.stack([through_lens(channel, maps) for channel in np.moveaxis(radiance, -1, 0)], -1)
    passed = radiance if maps.shade is None else radiance * maps.shade
    if maps.veil is not None:
        passed = passed + maps.veil * np.float32(radiance.mean(dtype=np.float64))
    return passed if maps.transfer is None else blur(passed, maps.transfer)


def vignetting(rays: Array, *, strength: float = 1.0, cutoff_deg: float | None = None) -> Array:
    """Share of light (H, W) along rays (H, W, 3): cos⁴ of the angle to the axis to the power of `strength`.

    With a cutoff also the overlap of two equal pupils that part as tan θ and lose each other at that angle.
    No light comes from 90° on (with `strength` above 0), nor where a ray is NaN. Source: Asada et al. (1996).
    """
    cosine = np.clip(rays[..., 2] / np.linalg.norm(rays, axis=-1), 0.0, 1.0)
    share: Array = cosine ** (4 * strength)
    if cutoff_deg is not None:
        tangent = np.sqrt(1 - cosine**2) / np.maximum(cosine, 1e-9)
        apart = np.minimum(tangent / np.tan(np.deg2rad(cutoff_deg)), 1.0)
        share = share * 2 / np.pi * (np.arccos(apart) - apart * np.sqrt(1 - apart**2))
    return np.nan_to_num(share, nan=0.0)


def blur(radiance: Radiance, transfer: Array) -> Radiance:
    """Radiance (H, W) spread by that transfer; the picture is mirrored at its borders.

    What leaves a pixel arrives in others: the sum stays.
    """
    blurred = scipy.fft.idctn(scipy.fft.dctn(radiance.astype(np.float64)) * transfer, overwrite_x=True)
    # Rounding may leave -1e-17 where there was no light.
    arrived: Radiance = np.maximum(blurred, 0.0, out=blurred).astype(np.float32)
    return arrived


def gaussian_transfer(shape: tuple[int, int], sigma_px: float) -> Array:
    """Transfer (H, W) of a Gaussian over pixels; its variance is sigma² exactly, also far below a pixel."""
    weights = _gaussian(sigma_px)
    down, across = (_cosines(size, len(weights)) @ weights for size in shape)
    return np.outer(down, across)


def disc_transfer(shape: tuple[int, int], diameter_px: float) -> Array:
    """Transfer (H, W) of an even disc around a pixel's centre: each pixel gets the share that falls on its area."""
    shares = _disc(diameter_px)
    down, across = (_cosines(size, len(shares)) for size in shape)
    transfer: Array = down @ shares @ across.T
    return transfer


def flare_transfer(straight: Array | float, shape: tuple[int, int], flare: float, ghost: float) -> Array:
    """Transfer (H, W) of a lens that is `straight` but for the shares of light that it scatters and that it mirrors.

    The scattered share falls at distance r as (h² + r²)^-1.5, half of it within √3 h; the mirrored share comes, out of
    focus, to where a half turn about the picture's middle takes it.
    """
    height, width = shape
    down, across = (np.arange(size) for size in shape)
    veil = np.exp(-VEIL_SHARE * width * np.pi * np.hypot(down[:, None] / height, across / width))
    turned = np.where(np.add.outer(down, across) % 2, -1.0, 1.0) * gaussian_transfer(shape, GHOST_SHARE * width)
    transfer: Array = (1 - flare - ghost) * straight + flare * veil + ghost * turned
    return transfer


def _cosines(size: int, taps: int) -> Array:
    """The cosine waves (size, taps) of a transform over `size` pixels, at an odd number of taps around 0."""
    waves: Array = np.cos(np.outer(np.pi * np.arange(size) / size, np.arange(taps) - taps // 2))
    return waves


def _gaussian(sigma_px: float) -> Array:
    """Weights (N,) on the pixels around the centre, N odd, proportional to a Gaussian; their variance is sigma².

    A Gaussian of that very sigma, sampled, would be too narrow below a pixel, so a little wider one is sampled.
    """
    reach = int(np.ceil(6 * sigma_px)) + 2
    squares = (np.arange(2 * reach + 1) - reach) ** 2.0

    def weights(width_px: float) -> Array:
        values: Array = np.exp(-squares / (2 * width_px**2))
        normed: Array = values / values.sum()
        return normed

    def excess_px2(width_px: float) -> float:
        return float(weights(width_px) @ squares) - sigma_px**2

    return weights(scipy.optimize.brentq(excess_px2, 0.03, sigma_px + 1) if sigma_px > 0 else 0.03)


def _disc(diameter_px: float) -> Array:
    """Shares (N, N) of a disc on the pixels around its centre, N odd; they sum to 1."""
    reach = int(np.ceil(max(diameter_px - 1, 0) / 2))
    size = 2 * reach + 1
    fine = (np.arange(size * FINE) + 0.5) / FINE - size / 2
    inside = np.add.outer(fine**2, fine**2) <= max(diameter_px, 2 / FINE) ** 2 / 4
    counts = inside.reshape(size, FINE, size, FINE).sum((1, 3))
    shares: Array = counts / counts.sum()
    return shares


def dirt(shape: tuple[int, int], amount: float, rng: np.random.Generator) -> Array:
    """Share of light (H, W) that smudges and dust on the front lens take; `amount` on average.

    More of it is the same dirt, thicker: light falls off exponentially in it (Beer and Lambert).
    """
    thickness = _smudges(shape, rng) + _specks(shape, rng)
    grown = scipy.optimize.brentq(lambda by: float(np.mean(-np.expm1(-by * thickness))) - amount, 0.0, 1e6, xtol=1e-12)
    taken: Array = -np.expm1(-grown * thickness)
    return taken


def _smudges(shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Fingerprints (H, W): a few long, soft blobs."""
    thickness = np.zeros(shape)
    v, u = np.mgrid[: shape[0], : shape[1]]
    for _ in range(SMUDGES):
        dv = v - rng.uniform(0, shape[0])
        du = u - rng.uniform(0, shape[1])
        angle = rng.uniform(0, np.pi)
        long_px, wide_px = np.sort(rng.uniform(*SMUDGE_SHARE, 2))[::-1] * shape[1]
        along = du * np.cos(angle) + dv * np.sin(angle)
        aside = dv * np.cos(angle) - du * np.sin(angle)
        thickness += rng.uniform(0.3, 1.0) * np.exp(-((along / long_px) ** 2 + (aside / wide_px) ** 2) / 2)
    return thickness


def _specks(shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """Dust (H, W): small discs with soft rims, far out of focus as the front lens is."""
    thickness = np.zeros(shape)
    v, u = np.mgrid[: shape[0], : shape[1]]
    for _ in range(SPECKS):
        middle_v = rng.uniform(0, shape[0])
        middle_u = rng.uniform(0, shape[1])
        radius_px = rng.uniform(*SPECK_SHARE) * shape[1]
        distance = np.hypot(v - middle_v, u - middle_u) / radius_px
        thickness += rng.uniform(0.3, 1.0) * np.clip(3 * (1 - distance), 0.0, 1.0)
    return thickness


def _single(values: Array | None) -> Radiance | None:
    return None if values is None else values.astype(np.float32)
