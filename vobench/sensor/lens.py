"""Effects of the lens on linear radiance: vignetting, blur, flare and dirt. Pure."""

from dataclasses import dataclass

import numpy as np
import scipy

from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.se3 import Array
from vobench.sensor.image_sensor import CameraSettings, Radiance
from vobench.sensor.lens_drops import LensDrops, lens_drops

SMUDGES = 5
SPECKS = 60
# Smallest and largest radii, relative to the picture's width.
SMUDGE_RADII = (0.05, 0.2)
SPECK_RADII = (0.004, 0.015)
# The share of the light lost to dirt that it scatters onto the chip; the rest is absorbed. An assumption.
SCATTERED = 0.5
# Relative to the picture's width: the distance scale of veiling glare, and the spread of a ghost. Assumptions.
VEIL_SCALE = 0.1
GHOST_SPREAD = 0.02
# Points across a pixel for the share of it that a disc covers.
SUBPIXELS = 32


@dataclass(frozen=True, slots=True)
class LensMaps:
    """The effects of one lens, computed once per camera; None is no effect.

    `shade` (H, W) is the share of light that is transmitted; `veil` (H, W) the share of the picture's mean that dirt
    adds; `transfer` (H, W) the blur and flare over the frequencies of a cosine transform; `drops` where the light
    of each pixel comes from behind drops.
    """

    shade: Radiance | None = None
    veil: Radiance | None = None
    transfer: Array | None = None
    drops: LensDrops | None = None


def lens_maps(
    effects: CameraSettings,
    camera: Camera,
    rng: np.random.Generator,
    drops_rng: np.random.Generator | None = None,
) -> LensMaps:
    """The maps of a camera's lens; only dirt draws from `rng`, and only drops from `drops_rng`.

    Raises ValueError if there are drops, but nothing to draw them from.
    """
    shape = (camera.height_px, camera.width_px)
    shade = None
    veil = None
    if effects.vignetting > 0 or effects.vignetting_cutoff_deg is not None:
        rays = camera.rays(pixel_grid(camera))
        shade = vignetting(rays, strength=effects.vignetting, cutoff_deg=effects.vignetting_cutoff_deg)
    if effects.dirt > 0:
        lost = dirt(shape, effects.dirt, rng)
        transmitted = np.ones(shape) if shade is None else shade
        shade = transmitted * (1 - lost)
        veil = SCATTERED * transmitted * lost

    transfer = None
    if effects.blur_sigma_px > 0 or effects.defocus_px > 0:
        transfer = gaussian_transfer(shape, effects.blur_sigma_px) * disc_transfer(shape, effects.defocus_px)
    if effects.flare > 0 or effects.ghost > 0:
        direct = 1.0 if transfer is None else transfer
        transfer = flare_transfer(direct, shape, effects.flare, effects.ghost)
    drops = None
    if effects.lens_drops > 0:
        if drops_rng is None:
            raise ValueError("drops on the lens need drops_rng")
        drops = lens_drops(camera, effects.lens_drops, drops_rng)
    return LensMaps(_single(shade), _single(veil), transfer, drops)


def apply_lens(radiance: Radiance, maps: LensMaps) -> Radiance:
    """Radiance (H, W), or (H, W, 3) in colour, as it reaches the chip behind drops, dirt, vignetting, blur and flare.

    Source of the dirt's two terms: Gu, Ramamoorthi, Belhumeur and Nayar (2009), equation 3.
    """
    if radiance.ndim == 3:
        channels = [apply_lens(channel, maps) for channel in np.moveaxis(radiance, -1, 0)]
        return np.stack(channels, -1)
    if maps.drops is not None:
        radiance = maps.drops.apply(radiance)
    transmitted = radiance if maps.shade is None else radiance * maps.shade
    if maps.veil is not None:
        mean = np.float32(radiance.mean(dtype=np.float64))
        transmitted = transmitted + maps.veil * mean
    return transmitted if maps.transfer is None else blur(transmitted, maps.transfer)


def vignetting(
    rays: Array,
    *,
    strength: float = 1.0,
    cutoff_deg: float | None = None,
) -> Array:
    """The share of light (H, W) along rays (H, W, 3): cos⁴ of the angle to the axis, to the power of `strength`.

    With a cutoff it is multiplied by the overlap of two equal discs whose distance grows as tan θ and that no longer
    overlap at that angle. The share is 0 from 90° on (with `strength` above 0), and where a ray is NaN.
    Source: Asada et al. (1996).
    """
    length = np.linalg.norm(rays, axis=-1)
    cosine = np.clip(rays[..., 2] / length, 0.0, 1.0)
    share: Array = cosine ** (4 * strength)
    if cutoff_deg is not None:
        sine = np.sqrt(1 - cosine**2)
        tangent = sine / np.maximum(cosine, 1e-9)
        distance = np.minimum(tangent / np.tan(np.deg2rad(cutoff_deg)), 1.0)  # of the discs, in diameters
        overlap = np.arccos(distance) - distance * np.sqrt(1 - distance**2)
        share = share * 2 / np.pi * overlap
    return np.nan_to_num(share, nan=0.0)


def blur(radiance: Radiance, transfer: Array) -> Radiance:
    """Radiance (H, W) spread by a transfer; the picture is mirrored at its borders, and its sum is conserved."""
    spectrum = scipy.fft.dctn(radiance.astype(np.float64))
    blurred = scipy.fft.idctn(spectrum * transfer, overwrite_x=True)
    # Rounding may leave -1e-17 where there was no light.
    np.maximum(blurred, 0.0, out=blurred)
    single: Radiance = blurred.astype(np.float32)
    return single


def gaussian_transfer(shape: tuple[int, int], sigma_px: float) -> Array:
    """Transfer (H, W) of a Gaussian over pixels; its variance is sigma² exactly, also far below a pixel."""
    height, width = shape
    weights = _gaussian(sigma_px)
    vertical = _cosines(height, len(weights)) @ weights
    horizontal = _cosines(width, len(weights)) @ weights
    return np.outer(vertical, horizontal)


def disc_transfer(shape: tuple[int, int], diameter_px: float) -> Array:
    """Transfer (H, W) of a uniform disc around a pixel's centre: each pixel gets the share that covers its area."""
    height, width = shape
    shares = _disc(diameter_px)
    vertical = _cosines(height, len(shares))
    horizontal = _cosines(width, len(shares))
    transfer: Array = vertical @ shares @ horizontal.T
    return transfer


def flare_transfer(
    direct: Array | float,
    shape: tuple[int, int],
    flare: float,
    ghost: float,
) -> Array:
    """Transfer (H, W) of a lens with the transfer `direct` but for the shares of light in flare and in the ghost.

    Flare falls with the distance r as (h² + r²)^-1.5, half of it within √3 h. The ghost is the picture turned by half
    a turn about its middle, out of focus.
    """
    height, width = shape
    rows = np.arange(height)  # vertical frequencies
    columns = np.arange(width)  # horizontal frequencies
    frequency = np.hypot(rows[:, None] / height, columns / width)
    veil = np.exp(-VEIL_SCALE * width * np.pi * frequency)
    half_turn = np.where(np.add.outer(rows, columns) % 2, -1.0, 1.0)
    reflection = half_turn * gaussian_transfer(shape, GHOST_SPREAD * width)
    direct_share = 1 - flare - ghost
    transfer: Array = direct_share * direct + flare * veil + ghost * reflection
    return transfer


def _cosines(size: int, taps: int) -> Array:
    """The cosine waves (size, taps) of a transform over `size` pixels, at an odd number of taps around 0."""
    frequencies = np.pi * np.arange(size) / size
    positions = np.arange(taps) - taps // 2
    waves: Array = np.cos(np.outer(frequencies, positions))
    return waves


NARROWEST_PX = 0.03  # the width of a sampled Gaussian without weight on neighbouring pixels


def _gaussian(sigma_px: float) -> Array:
    """Weights (N,) on the pixels around the centre, N odd, proportional to a Gaussian; their variance is sigma².

    A Gaussian of that very sigma, sampled, would be too narrow below a pixel, so a slightly wider one is sampled.
    """
    reach = int(np.ceil(6 * sigma_px)) + 2
    squares = (np.arange(2 * reach + 1) - reach) ** 2.0  # squared distances to the centre

    def weights(width_px: float) -> Array:
        values: Array = np.exp(-squares / (2 * width_px**2))
        normalised: Array = values / values.sum()
        return normalised

    def excess_px2(width_px: float) -> float:
        return float(weights(width_px) @ squares) - sigma_px**2

    if sigma_px <= 0:
        return weights(NARROWEST_PX)
    return weights(scipy.optimize.brentq(excess_px2, NARROWEST_PX, sigma_px + 1))


def _disc(diameter_px: float) -> Array:
    """Shares (N, N) of a disc on the pixels around its centre, N odd; they sum to 1."""
    reach = int(np.ceil(max(diameter_px - 1, 0) / 2))
    size = 2 * reach + 1
    points_px = (np.arange(size * SUBPIXELS) + 0.5) / SUBPIXELS - size / 2
    squared_distances = np.add.outer(points_px**2, points_px**2)
    least_px = 2 / SUBPIXELS  # so that the disc covers some points
    is_inside = squared_distances <= max(diameter_px, least_px) ** 2 / 4
    counts = is_inside.reshape(size, SUBPIXELS, size, SUBPIXELS).sum((1, 3))
    shares: Array = counts / counts.sum()
    return shares


def dirt(
    shape: tuple[int, int],
    amount: float,
    rng: np.random.Generator,
) -> Array:
    """The share of light (H, W) that is lost to smudges and dust on the front lens; `amount` on average.

    A larger amount is the same dirt, thicker: light is absorbed exponentially in it (Beer and Lambert).
    """
    thickness = _smudges(shape, rng) + _specks(shape, rng)

    def excess(density: float) -> float:
        return float(np.mean(-np.expm1(-density * thickness))) - amount

    density = scipy.optimize.brentq(excess, 0.0, 1e6, xtol=1e-12)
    lost: Array = -np.expm1(-density * thickness)
    return lost


def _smudges(shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """The thickness (H, W) of fingerprints: a few long, soft blobs."""
    height, width = shape
    thickness = np.zeros(shape)
    v, u = np.mgrid[:height, :width]
    for _ in range(SMUDGES):
        dv = v - rng.uniform(0, height)
        du = u - rng.uniform(0, width)
        angle = rng.uniform(0, np.pi)
        radii_px = np.sort(rng.uniform(*SMUDGE_RADII, 2)) * width
        along = du * np.cos(angle) + dv * np.sin(angle)
        across = dv * np.cos(angle) - du * np.sin(angle)
        squares = (along / radii_px[1]) ** 2 + (across / radii_px[0]) ** 2
        thickness += rng.uniform(0.3, 1.0) * np.exp(-squares / 2)
    return thickness


def _specks(shape: tuple[int, int], rng: np.random.Generator) -> Array:
    """The thickness (H, W) of dust: small discs with soft rims, as the front lens is far out of focus."""
    height, width = shape
    thickness = np.zeros(shape)
    v, u = np.mgrid[:height, :width]
    for _ in range(SPECKS):
        middle_v = rng.uniform(0, height)
        middle_u = rng.uniform(0, width)
        radius_px = rng.uniform(*SPECK_RADII) * width
        distance = np.hypot(v - middle_v, u - middle_u) / radius_px  # in radii
        profile = np.clip(3 * (1 - distance), 0.0, 1.0)
        thickness += rng.uniform(0.3, 1.0) * profile
    return thickness


def _single(values: Array | None) -> Radiance | None:
    return None if values is None else values.astype(np.float32)
