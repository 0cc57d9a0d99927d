"""A camera's image sensor after EMVA 1288: photons to electrons to 8-bit values, grey or in colour. Pure."""

import math
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le, Lt
from numpy.typing import NDArray

from vobench.errors import RenderError, SettingError
from vobench.geometry.se3 import Array
from vobench.sensor.exposure import AutoExposure, Exposure
from vobench.sensor.response import FULL_SCALE_DN, Grey, Response, linear_of_grey, quantise, response_of
from vobench.sensor.timing import Timing
from vobench.setting import FromPreset, NonNegative, Positive, Share, ValueCheck, settings

MS_PER_S = 1e3
# From this mean on the expansion below is off by less than 6e-4 in total variation, 1e-4 in variance and 1e-5 in mean.
EXPANSION_FROM = 10.0
# A Poisson count of mean 10 exceeds this with probability 1e-25.
MOST_SMALL = 60


def poisson(mean: Array, normal: Array) -> Array:
    """Poisson counts (...) of means (...), as float64: the quantiles of draws of a standard normal (...).

    The number of draws doesn't depend on the light, so a brighter frame doesn't change the noise of the next one.
    The quantile is expanded in powers of 1/√mean from a mean of 10 on, and found by summing the distribution below.
    Source: Giles (2016), Algorithm 955, ACM TOMS 42(1), Q_N1.
    """
    counts = _expansion(mean, normal)
    small = mean < EXPANSION_FROM
    if small.any():
        probability = scipy.special.ndtr(normal[small])
        counts[small] = _summed(mean[small], probability)
    return counts


def _expansion(mean: Array, w: Array) -> Array:
    """floor(mean + √mean w + 1/3 + w²/6 - (w³ + 2 w) / (72 √mean)), computed in place, as pictures are large."""
    root = np.sqrt(mean)
    square = w * w
    counts: Array = root * w
    counts += mean
    counts += 1 / 3
    counts += square / 6
    square += 2.0
    square *= w
    # Means below EXPANSION_FROM are replaced later; this only keeps the division finite.
    square /= 72 * np.maximum(root, 1.0, out=root)
    counts -= square
    np.floor(counts, out=counts)
    # At mean 10, one draw in a million would be -1.
    return np.maximum(counts, 0.0, out=counts)


def _summed(mean: Array, probability: Array) -> NDArray[np.int8]:
    """The smallest counts (M,) whose distribution function reaches the probabilities (M,)."""
    counts = np.zeros(len(mean), np.int8)
    term = np.exp(-mean)
    reached = term.copy()
    for count in range(1, MOST_SMALL + 1):
        beyond = probability > reached
        if not beyond.any():
            break
        counts += beyond.view(np.int8)
        term *= mean
        term *= 1 / count
        reached += term
    return counts


Radiance = NDArray[np.float32]
# Grey value of radiance 1, diffuse white in the scene's own light: the usual exposure of photographers.
WHITE_DN = 200
# Pictures are exposed a few rows at a time, so that intermediate arrays stay in the processor's cache.
PIXELS_AT_A_TIME = 1 << 15


@settings()
class CameraSensor:
    """A chip and its electronics; electrons saturate at `full_well_e`.

    `prnu` (relative), `dsnu_e`, `column_e` and the hot pixels are fixed in time. `adc_bits` none is a converter so
    fine that only the 8 bits kept are seen. A response is a name, a gamma or a table of signals.
    """

    full_well_e: Positive = 20_000.0
    black_dn: Annotated[float, Ge(0), Le(128)] = 0.0
    shot_noise: bool = False
    read_noise_e: NonNegative = 0.0
    prnu: Share = 0.0
    dsnu_e: NonNegative = 0.0
    column_e: NonNegative = 0.0
    dark_e_per_s: NonNegative = 0.0
    hot_share: Share = 0.0
    hot_e_per_s: NonNegative = 20_000.0
    adc_bits: Literal[8, 10, 12] | None = None
    response: Annotated[str | float | tuple[float, ...], ValueCheck(response_of, first=True)] = "srgb"

    @property
    def curve(self) -> Response:
        """The response."""
        return response_of(self.response)

    @property
    def dn_per_electron(self) -> float:
        """K of an exposure without gain: a full well is full scale."""
        return FULL_SCALE_DN / self.full_well_e

    @property
    def signal_of_grey(self) -> Array:
        """The signal (256,) of light at each grey value, in shares of full scale, which auto-exposure meters."""
        return linear_of_grey(self.curve) - self.black_dn / FULL_SCALE_DN


# `clean` measures nothing but quantisation. Of the others, shot noise and the size of a converter are facts. Full wells
# of the imx and of mt9m034 follow from the SNR in Balluff's tables (SNR = 10 log10 of it), read noise of the imx from
# the dynamic range there. All else is this project's assumption about that class of chip, not its data sheet.
CAMERAS = {
    "clean": CameraSensor(),
    # EuRoC's cameras
    "mt9v034": CameraSensor(
        shot_noise=True,
        read_noise_e=25.0,
        prnu=0.01,
        dsnu_e=10.0,
        column_e=2.0,
        dark_e_per_s=100.0,
        adc_bits=10,
    ),
    # small pixels (3 µm) behind a global shutter: RealSense D435i, OAK-D
    "ov9282": CameraSensor(
        full_well_e=7_000.0,
        shot_noise=True,
        read_noise_e=5.0,
        prnu=0.01,
        dsnu_e=3.0,
        column_e=1.0,
        dark_e_per_s=50.0,
        hot_share=1e-4,
        adc_bits=10,
    ),
    # 3.75 µm behind a rolling shutter
    "mt9m034": CameraSensor(
        full_well_e=24_500.0,
        shot_noise=True,
        read_noise_e=10.0,
        prnu=0.01,
        dsnu_e=5.0,
        column_e=2.0,
        dark_e_per_s=50.0,
        hot_share=1e-4,
        adc_bits=12,
    ),
    # machine vision with large (5.86 µm) and middling (3.45 µm) pixels
    "imx249": CameraSensor(
        full_well_e=32_400.0,
        shot_noise=True,
        read_noise_e=7.0,
        prnu=0.005,
        dsnu_e=2.0,
        dark_e_per_s=5.0,
        adc_bits=12,
    ),
    "imx255": CameraSensor(
        full_well_e=10_700.0,
        shot_noise=True,
        read_noise_e=3.0,
        prnu=0.005,
        dsnu_e=1.0,
        dark_e_per_s=5.0,
        adc_bits=12,
    ),
}


# YAML names a sensor beside the rest of a camera, and says in `chip` what differs from it.
SENSOR_PRESETS = FromPreset("camera sensor", CAMERAS, key="sensor", section="chip")


Colour = Literal["mono", "rgb", "bayer"]
# What linear red, green and blue (ITU-R BT.709) add to luminance.
LUMINANCE = (0.2126, 0.7152, 0.0722)


Falloff = Annotated[float, Ge(0), Le(4)]
Spread = Annotated[float, Ge(0), Le(100)]
Dirt = Annotated[float, Ge(0), Le(0.5)]
Drops = Annotated[float, Ge(0), Le(0.8)]
Flare = Annotated[float, Ge(0), Le(0.5)]
Ghost = Annotated[float, Ge(0), Le(0.1)]


@settings()
class CameraDifference:
    """What sets one eye apart: `gain` multiplies the light that its chip gets, the rest stands in place of both's."""

    gain: Positive = 1.0
    blur_sigma_px: Spread | None = None
    defocus_px: Spread | None = None
    vignetting: Falloff | None = None
    dirt: Dirt | None = None
    flare: Flare | None = None
    ghost: Ghost | None = None


@settings()
class CameraDifferences:
    """How the two cameras of a pair differ."""

    left: CameraDifference = CameraDifference()
    right: CameraDifference = CameraDifference()


@settings()
class CameraSettings:
    """The chip behind the lens, how it is exposed, and what the lens does to the light.

    `colour` mono weighs red, green and blue by `spectrum`; bayer records the mosaic of a chip behind RGGB filters as
    it is, rgb interpolates it. White light gives each of them the same grey value.

    The aperture is set for `exposure_ms`: then, and without gain, radiance 1 comes to 200 grey values;
    `exposure_gain` multiplies that light, and each step of `exposure_compensation_ev` doubles it.
    `readout_ms` of a rolling shutter is height × line delay.
    `vignetting` 1 is cos⁴θ (the exponent is 4 · vignetting), cut off by the lens's rims at `vignetting_cutoff_deg`;
    `blur_sigma_px` is a Gaussian's, `defocus_px` the diameter of the disc that a point out of focus makes,
    `dirt` the mean share of light that dirt on the front lens keeps from its way, `lens_drops` the share of the glass
    before the lens that drops of water cover, `flare` the share that lens and
    barrel scatter, `ghost` the share that is mirrored through the picture's middle. `unlike` says how the eyes differ.
    """

    chip: CameraSensor = CAMERAS["clean"]
    colour: Colour = "mono"
    spectrum: tuple[NonNegative, NonNegative, NonNegative] = LUMINANCE
    exposure_gain: Positive = 1.0
    exposure_compensation_ev: Annotated[float, Ge(-12), Le(12)] = 0.0
    exposure_ms: Annotated[float, Ge(0.001), Le(1000)] = 5.0
    gain_db: Annotated[float, Ge(0), Le(48)] = 0.0
    auto_exposure: AutoExposure | None = None
    shutter: Literal["global", "rolling"] = "global"
    readout_ms: Annotated[float, Ge(0), Le(1000)] | None = None
    motion_blur: bool = False
    vignetting: Falloff = 0.0
    vignetting_cutoff_deg: Annotated[float, Gt(0), Lt(90)] | None = None
    blur_sigma_px: Spread = 0.0
    defocus_px: Spread = 0.0
    dirt: Dirt = 0.0
    lens_drops: Drops = 0.0
    flare: Flare = 0.0
    ghost: Ghost = 0.0
    jpeg_quality: Annotated[int, Ge(1), Le(100)] | None = None
    unlike: CameraDifferences = CameraDifferences()
    timing: Timing = Timing()

    def __post_init__(self) -> None:
        if self.shutter == "rolling" and self.readout_ms is None:
            raise SettingError(
                "a rolling shutter needs readout_ms: rows × the time from one row to the next, such as 20"
            )
        if self.shutter == "global" and self.readout_ms is not None:
            raise SettingError("readout_ms belongs to a rolling shutter; add shutter: rolling")

    def eye(self, side: Literal["left", "right"]) -> "CameraSettings":
        """The settings of one of the two cameras."""
        eye: CameraDifference = getattr(self.unlike, side)
        settings_of_eye = asdict(eye)
        del settings_of_eye["gain"]
        overrides = {key: value for key, value in settings_of_eye.items() if value is not None}
        return replace(self, exposure_gain=self.exposure_gain * eye.gain, **overrides)

    @property
    def weights(self) -> tuple[float, float, float] | None:
        """The weights of red, green and blue in the value of a mono chip; None for a chip in colour."""
        return self.spectrum if self.colour == "mono" else None

    @property
    def exposure(self) -> Exposure:
        """The exposure of every picture, or of the first ones where auto-exposure follows."""
        return Exposure(self.exposure_ms / MS_PER_S, self.gain_db)

    @property
    def readout_s(self) -> float:
        """The time from the first row to the one that would follow the last; 0 for a global shutter."""
        return (self.readout_ms or 0.0) / MS_PER_S

    @property
    def compensation(self) -> float:
        """The factor on the light that exposure_compensation_ev states."""
        return math.exp2(self.exposure_compensation_ev)

    @property
    def white_e(self) -> float:
        """Mean electrons (mu_e) of radiance 1 at the exposure that the aperture is set for."""
        stored = np.array(WHITE_DN / FULL_SCALE_DN)
        share = float(self.chip.curve.decode(stored))
        return share * self.chip.full_well_e * self.exposure_gain * self.compensation


@dataclass(frozen=True, slots=True)
class NoiseStreams:
    """A generator for each kind of noise; every picture takes the same number of draws, whatever its brightness."""

    shot: np.random.Generator
    read: np.random.Generator


@dataclass(frozen=True, slots=True)
class FixedPattern:
    """Deviations of a chip's pixels that don't change, all (H, W): relative gain, offset and dark current."""

    gain: Array
    offset_e: Array
    dark_e_per_s: Array

    def of(self, rows: slice) -> "FixedPattern":
        """The pattern of some rows."""
        return FixedPattern(self.gain[rows], self.offset_e[rows], self.dark_e_per_s[rows])


def fixed_pattern(
    shape: tuple[int, int],
    sensor: CameraSensor,
    rng: np.random.Generator,
) -> FixedPattern:
    """Draw one chip's pattern, once per camera; each effect has a child of `rng` of its own.

    Hot pixels stay hot when `hot_share` grows; their dark current is exponential with mean `hot_e_per_s`.
    """
    prnu, dsnu, column, hot = rng.spawn(4)
    gain = 1 + sensor.prnu * prnu.standard_normal(shape)
    pixel_offset_e = sensor.dsnu_e * dsnu.standard_normal(shape)
    column_offset_e = sensor.column_e * column.standard_normal(shape[1])
    is_hot = hot.random(shape) < sensor.hot_share
    hot_e_per_s = is_hot * sensor.hot_e_per_s * hot.standard_exponential(shape)
    return FixedPattern(
        gain=np.maximum(gain, 0.0),
        offset_e=pixel_offset_e + column_offset_e,
        dark_e_per_s=sensor.dark_e_per_s + hot_e_per_s,
    )


def expose(
    radiance: Radiance,
    camera: CameraSettings,
    noise: NoiseStreams,
    *,
    pattern: FixedPattern | None = None,
    exposure: Exposure | None = None,
) -> Grey:
    """One picture of linear radiance, where 1 is diffuse white in the scene's own light: (H, W) of (H, W).

    Of radiance (H, W, 3) in red, green and blue: the mosaic (H, W), or (H, W, 3) where the camera's colour is rgb.
    The default exposure is the one that the aperture is set for. A longer exposure gives more electrons, gain only a
    larger K. Radiance is the mean over the exposure.
    Raises RenderError for radiance that is negative or not a number. Source: EMVA 1288, release 3.1, section 2.
    """
    _require_radiance(radiance)
    exposure = exposure or Exposure(camera.exposure_ms / MS_PER_S)
    if radiance.ndim == 2:
        return _exposed_grey(radiance, camera, noise, pattern, exposure)
    filtered = mosaic(radiance)
    if camera.colour == "rgb":
        return _exposed_colour(filtered, camera, noise, pattern, exposure)
    return _exposed_grey(filtered, camera, noise, pattern, exposure)


def _require_radiance(radiance: Radiance) -> None:
    if radiance.min() >= 0:  # False for NaN
        return
    v, u = np.argwhere(~(radiance >= 0))[0][:2]
    raise RenderError(f"radiance must be 0 or more, got {radiance[v, u]} at pixel ({u}, {v})")


def _exposed_grey(
    radiance: Radiance,
    camera: CameraSettings,
    noise: NoiseStreams,
    pattern: FixedPattern | None,
    exposure: Exposure,
) -> Grey:
    """Grey values (H, W) of radiance (H, W), a few rows at a time."""
    height, width = radiance.shape
    step = max(1, PIXELS_AT_A_TIME // width)  # rows
    grey = np.empty(radiance.shape, np.uint8)
    for first in range(0, height, step):
        rows = slice(first, first + step)
        rows_pattern = pattern.of(rows) if pattern else None
        electrons = _electrons(radiance[rows], camera, noise, rows_pattern, exposure)
        grey[rows] = _grey(_signal(electrons, camera.chip, exposure), camera.chip)
    return grey


def _exposed_colour(
    radiance: Radiance,
    camera: CameraSettings,
    noise: NoiseStreams,
    pattern: FixedPattern | None,
    exposure: Exposure,
) -> Grey:
    """Red, green and blue grey values (H, W, 3) of radiance (H, W) behind the filters."""
    electrons = _electrons(radiance, camera, noise, pattern, exposure)
    signal = _digital(_signal(electrons, camera.chip, exposure), camera.chip)
    planes = [quantise(plane, camera.chip.curve) for plane in demosaiced(signal)]
    return np.stack(planes, -1)


# The channel behind each of two by two pixels (Bayer, 1976): red, green; green, blue.
RGGB = np.array([[0, 1], [1, 2]])


def mosaic(radiance: Radiance) -> Radiance:
    """The light (H, W) behind the filters of a chip's pixels, of light (H, W, 3) in red, green and blue."""
    filtered = np.empty(radiance.shape[:2], radiance.dtype)
    for v, u in np.ndindex(RGGB.shape):
        channel = RGGB[v, u]
        filtered[v::2, u::2] = radiance[v::2, u::2, channel]
    return filtered


# Source: Malvar, He, Cutler (2004), High-quality linear interpolation for demosaicing, figure 2. Each weighs the
# pixels around one whose colour is missing.
# fmt: off
GREEN_AT_OTHER = np.array([
    [ 0, 0, -1, 0,  0],
    [ 0, 0,  2, 0,  0],
    [-1, 2,  4, 2, -1],
    [ 0, 0,  2, 0,  0],
    [ 0, 0, -1, 0,  0],
]) / 8.0
ALONG_ROW = np.array([
    [ 0,  0, 0.5,  0,  0],
    [ 0, -1, 0,   -1,  0],
    [-1,  4, 5,    4, -1],
    [ 0, -1, 0,   -1,  0],
    [ 0,  0, 0.5,  0,  0],
]) / 8.0
ACROSS = np.array([
    [ 0,   0, -1.5, 0,  0],
    [ 0,   2,  0,   2,  0],
    [-1.5, 0,  6,   0, -1.5],
    [ 0,   2,  0,   2,  0],
    [ 0,   0, -1.5, 0,  0],
]) / 8.0
# fmt: on
# The pixels of each colour in a mosaic: of the two greens, one is in the rows of red and one in those of blue.
RED = (slice(0, None, 2), slice(0, None, 2))
GREEN_IN_RED_ROWS = (slice(0, None, 2), slice(1, None, 2))
GREEN_IN_BLUE_ROWS = (slice(1, None, 2), slice(0, None, 2))
BLUE = (slice(1, None, 2), slice(1, None, 2))


def demosaiced(signal: Array) -> Array:
    """Red, green and blue (3, H, W) in 0..1 of a mosaic of signals (H, W)."""
    green = _interpolated(signal, GREEN_AT_OTHER)
    along_row = _interpolated(signal, ALONG_ROW)
    along_column = _interpolated(signal, ALONG_ROW.T)
    diagonal = _interpolated(signal, ACROSS)

    rgb = np.stack([along_row, green, along_column])
    rgb[0][RED] = signal[RED]
    rgb[0][GREEN_IN_BLUE_ROWS] = along_column[GREEN_IN_BLUE_ROWS]
    rgb[0][BLUE] = diagonal[BLUE]

    rgb[1][GREEN_IN_RED_ROWS] = signal[GREEN_IN_RED_ROWS]
    rgb[1][GREEN_IN_BLUE_ROWS] = signal[GREEN_IN_BLUE_ROWS]

    rgb[2][RED] = diagonal[RED]
    rgb[2][GREEN_IN_BLUE_ROWS] = along_row[GREEN_IN_BLUE_ROWS]
    rgb[2][BLUE] = signal[BLUE]
    return np.asarray(np.clip(rgb, 0.0, 1.0))


def _interpolated(signal: Array, kernel: Array) -> Array:
    return np.asarray(scipy.ndimage.correlate(signal, kernel, mode="mirror"))


def _electrons(
    radiance: Radiance,
    camera: CameraSettings,
    noise: NoiseStreams,
    pattern: FixedPattern | None,
    exposure: Exposure,
) -> Array:
    """Electrons (H, W) as read out of the wells."""
    sensor = camera.chip
    mean_e = _mean_electrons(radiance, camera, pattern, exposure)
    electrons = _collected(mean_e, sensor, noise.shot)
    if pattern is not None:
        electrons += pattern.offset_e
    if sensor.read_noise_e > 0:
        electrons += sensor.read_noise_e * noise.read.standard_normal(electrons.shape)
    return electrons


def _mean_electrons(
    radiance: Radiance, camera: CameraSettings, pattern: FixedPattern | None, exposure: Exposure
) -> Array:
    """Mean electrons mu_e (H, W) of light and dark current."""
    relative_time = exposure.time_s / (camera.exposure_ms / MS_PER_S)
    mean_e = radiance.astype(float)
    mean_e *= camera.white_e * relative_time
    if pattern is None:
        return mean_e + camera.chip.dark_e_per_s * exposure.time_s
    mean_e *= pattern.gain
    mean_e += pattern.dark_e_per_s * exposure.time_s
    return mean_e


def _collected(
    mean_e: Array,
    sensor: CameraSensor,
    rng: np.random.Generator,
) -> Array:
    """Electrons (H, W) in the wells: Poisson where shot noise is on, then saturation."""
    if sensor.shot_noise:
        # Means above twice a full well saturate as surely as that.
        limited_e = np.minimum(mean_e, 2 * sensor.full_well_e)
        mean_e = poisson(limited_e, rng.standard_normal(mean_e.shape))
    return np.minimum(mean_e, sensor.full_well_e, out=mean_e)


def _signal(electrons: Array, sensor: CameraSensor, exposure: Exposure) -> Array:
    """Electrons (H, W) amplified, as shares of full scale; in place."""
    electrons *= sensor.dn_per_electron * exposure.amplification
    electrons += sensor.black_dn
    electrons /= FULL_SCALE_DN
    return np.clip(electrons, 0.0, 1.0, out=electrons)


def _grey(signal: Array, sensor: CameraSensor) -> Grey:
    """Grey values (H, W) of signals; the signals are overwritten."""
    if sensor.adc_bits is None:
        return quantise(signal, sensor.curve)
    counts = _counts(signal, sensor.adc_bits)
    largest = _largest_count(sensor.adc_bits)
    grey_of_count = quantise(np.arange(largest + 1) / largest, sensor.curve)
    return grey_of_count.take(counts)


def _digital(signal: Array, sensor: CameraSensor) -> Array:
    """Signals (H, W) rounded to the converter's counts; the signals are overwritten."""
    if sensor.adc_bits is None:
        return signal
    return _counts(signal, sensor.adc_bits) / _largest_count(sensor.adc_bits)


def _largest_count(bits: int) -> int:
    return (1 << bits) - 1


def _counts(signal: Array, bits: int) -> NDArray[np.intp]:
    """The counts (H, W) of a converter; the signals are overwritten."""
    signal *= _largest_count(bits)
    signal += 0.5
    return signal.astype(np.intp)
