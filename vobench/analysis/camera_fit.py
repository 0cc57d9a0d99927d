"""Fits a simulated camera to the appearance of images: exposure, contrast, blur and noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
import scipy

from vobench.analysis.conditions import chip_noise_dn
from vobench.analysis.image_noise import noise_dn, saturated_share
from vobench.analysis.image_statistics import edge_px, gradients
from vobench.geometry.se3 import Array
from vobench.runner.store import SILENT, Progress
from vobench.sensor.image_sensor import CameraSensor, CameraSettings, NoiseStreams, Radiance, expose
from vobench.sensor.lens import blur, gaussian_transfer
from vobench.sequence.picture import Image


@dataclass(frozen=True, slots=True)
class CameraLook:
    """The properties of images that a camera is fitted to: mean and standard deviation of grey values, noise, edges.

    Noise is measured in flat parts, whose grey values are `flat_dn` (N,). Edges are measured by their width.
    `saturated_share` is the share of saturated pixels.
    """

    mean_dn: float
    sd_dn: float
    noise_dn: float
    edge_px: float
    flat_dn: Array
    saturated_share: float = 0.0


def look_of(pictures: Sequence[Image]) -> CameraLook:
    """The look of grey images, as means over them."""
    rows = []
    flat_dn = []
    for picture in pictures:
        sigma_dn, flat_values_dn = noise_dn(picture)
        width_px = edge_px(picture, gradients(picture))
        rows.append((picture.mean(), picture.std(), sigma_dn, width_px, saturated_share(picture)))
        flat_dn.append(flat_values_dn)
    mean_dn, sd_dn, mean_sigma_dn, mean_width_px, share = np.mean(rows, axis=0).tolist()
    return CameraLook(mean_dn, sd_dn, mean_sigma_dn, mean_width_px, np.concatenate(flat_dn), share)


# --- The pictures of a camera ---

WINDOWS = 6  # across a picture
MIN_WINDOW_PX = 128


class Lights:
    """The light (H, W) of some pictures before the lens, of which any camera takes pictures with the same noise."""

    def __init__(self, pictures: Sequence[Radiance], *, seed: int = 0) -> None:
        self._pictures = pictures
        self._seed = seed
        self._blurred = lru_cache(maxsize=2)(self._blur)

    def windows(self) -> "Lights":
        """One window of each picture, as high as the picture; those of successive pictures cover the view.

        They are not reduced in scale, so noise and edges in them are those of the whole pictures.
        """
        windows = []
        for index, picture in enumerate(self._pictures):
            width_px = picture.shape[1]
            window_px = min(width_px, max(width_px // WINDOWS, MIN_WINDOW_PX))
            positions = np.linspace(0, width_px - window_px, width_px // window_px).astype(int)
            first = positions[index % len(positions)]
            windows.append(picture[:, first : first + window_px])
        return Lights(windows, seed=self._seed)

    def develop(self, settings: CameraSettings) -> list[Image]:
        """The pictures of a camera with settings as of `camera_of`: its lens blurs, and its chip is noisy."""
        noise = NoiseStreams(*np.random.default_rng(self._seed).spawn(2))
        return [expose(light, settings, noise) for light in self._blurred(settings.blur_sigma_px)]

    def _blur(self, sigma_px: float) -> list[Radiance]:
        """The light behind the lens."""
        if sigma_px == 0:
            return list(self._pictures)
        shapes = {picture.shape for picture in self._pictures}
        transfers = {shape: gaussian_transfer(shape, sigma_px) for shape in shapes}
        return [blur(picture, transfers[picture.shape]) for picture in self._pictures]


# --- The camera ---

WELL_E = 20_000.0
READ_NOISE_E = 25.0
ADC_BITS: Literal[10] = 10
ROUNDING_VARIANCE = 1 / 12  # the variance of the rounding errors of grey values


@dataclass(frozen=True, slots=True)
class _Parameters:
    """The parameters of a fitted camera.

    Grey values are light ** gamma. The chip is `noise` times as noisy as one of WELL_E electrons.
    """

    gain: float
    gamma: float
    blur_px: float
    noise: float

    def settings(self) -> CameraSettings:
        return camera_of(self.gain, self.gamma, self.blur_px, self.noise)


def camera_of(gain: float, gamma: float, blur_px: float, noise: float) -> CameraSettings:
    """A camera with an exposure, a blur, a noisy chip, and grey values that are light ** gamma.

    The chip is `noise` times as noisy as one of 20,000 electrons.
    """
    chip = CameraSensor(
        full_well_e=WELL_E / noise**2,
        read_noise_e=READ_NOISE_E / noise,
        shot_noise=True,
        adc_bits=ADC_BITS,
        response=1 / gamma,
    )
    return CameraSettings(chip=chip, exposure_gain=gain, blur_sigma_px=blur_px)


# --- The fit ---

# Bounds of the search.
GAIN_BOUNDS = (0.02, 60.0)
GAMMA_BOUNDS = (0.2, 1.2)
BLUR_BOUNDS_PX = (0.0, 3.0)
NOISE_BOUNDS = (0.03, 30.0)

START_GAMMA = 0.45
START_BLUR_PX = 0.5
HALVINGS = 7  # for the gain at the start
# Relative errors of mean, standard deviation and width of edges that count alike, and errors of the share of saturated
# pixels. If a place cannot have them all, edges give way first.
TOLERANCES = np.array([0.01, 0.02, 0.1])
SATURATED_TOLERANCE = 0.03
# Steps of the logarithms of gain and gamma, and of the squared blur, for derivatives. They are large compared with the
# steps that rounded grey values cause.
STEPS = np.array([0.05, 0.05, 0.2])
MAX_TRIALS = 12  # of a fit, each with derivatives
CONVERGED = 1e-2
PASSES = 3
USUAL_DEVELOPMENTS = 80  # of all passes


def fit_camera(
    wanted: CameraLook,
    lights: Lights,
    *,
    progress: Progress = SILENT,
) -> tuple[CameraSettings, CameraLook]:
    """The camera whose pictures of these lights are most similar to the wanted look, and the look of its pictures.

    The camera is fitted to windows of the pictures. Whole pictures then show by how much the look of windows differs
    from theirs, and the fit is repeated with a look that is corrected by that.
    """
    windows = lights.windows()
    with progress.step(f"camera: about {USUAL_DEVELOPMENTS} developments of windows of pictures") as show_share:
        fit = _Fit(windows, wanted, show_share)
        parameters = fit.start()
        target = wanted
        for _ in range(PASSES):
            parameters = fit.solve(parameters, target)
            settings = parameters.settings()
            look = look_of(lights.develop(settings))
            of_windows = look_of(windows.develop(settings))
            target = replace(
                wanted,
                mean_dn=wanted.mean_dn * _ratio(of_windows.mean_dn, look.mean_dn),
                sd_dn=wanted.sd_dn * _ratio(of_windows.sd_dn, look.sd_dn),
                edge_px=wanted.edge_px * _ratio(of_windows.edge_px, look.edge_px),
                saturated_share=wanted.saturated_share + of_windows.saturated_share - look.saturated_share,
            )
    return settings, look


def _ratio(value: float, other: float) -> float:
    """The ratio of two statistics of pictures; 1 if either is 0, as the edges of pictures without any."""
    return value / other if value > 0 and other > 0 else 1.0


class _Fit:
    """Fits the parameters of a camera, and counts the developments for that."""

    def __init__(self, lights: Lights, wanted: CameraLook, show_share: Callable[[float], object]) -> None:
        self._lights = lights
        self._wanted = wanted
        self._show_share = show_share
        self._developments = 0

    def start(self) -> _Parameters:
        """Parameters with the gain that gives the wanted mean of grey values."""
        blur_px = START_BLUR_PX if self._wanted.edge_px > 0 else 0.0
        parameters = self._parameters(1.0, START_GAMMA, blur_px)

        def mean_dn(log_gain: float) -> float:
            images = self._develop(replace(parameters, gain=float(np.exp(log_gain))))
            return float(np.mean([image.mean() for image in images]))

        low, high = np.log(GAIN_BOUNDS)
        log_gain = solve_increasing(mean_dn, self._wanted.mean_dn, (low, high))
        return replace(parameters, gain=float(np.exp(log_gain)))

    def solve(self, start: _Parameters, target: CameraLook) -> _Parameters:
        """The parameters whose pictures have the target's mean, standard deviation and edges most nearly."""

        @lru_cache(maxsize=1)
        def residuals_at(key: tuple[float, ...]) -> Array:
            return _residuals(self._develop(self._of_vector(key)), target)

        def residuals(vector: Array) -> Array:
            return residuals_at(tuple(vector.tolist()))

        def derivatives(vector: Array) -> Array:
            at_vector = residuals(vector)
            columns = []
            for index, step in enumerate(STEPS):
                signed_step = step if vector[index] + step <= high[index] else -step
                moved = vector.copy()
                moved[index] += signed_step
                images = self._develop(self._of_vector(moved.tolist()))
                columns.append((_residuals(images, target) - at_vector) / signed_step)
            return np.stack(columns, axis=1)

        low, high = _bounds()
        vector = np.array([np.log(start.gain), np.log(start.gamma), start.blur_px**2])
        solution = scipy.optimize.least_squares(
            residuals,
            np.clip(vector, low + 1e-6, high - 1e-6),
            derivatives,
            bounds=(low, high),
            x_scale=STEPS,
            ftol=CONVERGED,
            xtol=CONVERGED,
            max_nfev=MAX_TRIALS,
        )
        return self._of_vector(solution.x.tolist())

    def _of_vector(self, vector: Sequence[float]) -> _Parameters:
        """The parameters of the logarithms of gain and gamma, and the squared blur."""
        log_gain, log_gamma, squared_blur = vector
        return self._parameters(float(np.exp(log_gain)), float(np.exp(log_gamma)), max(squared_blur, 0.0) ** 0.5)

    def _parameters(self, gain: float, gamma: float, blur_px: float) -> _Parameters:
        """Parameters with the noise that gives the wanted one."""
        return _Parameters(gain, gamma, blur_px, _fit_noise(gamma, self._wanted))

    def _develop(self, parameters: _Parameters) -> list[Image]:
        images = self._lights.develop(parameters.settings())
        self._developments += 1
        self._show_share(min(self._developments / USUAL_DEVELOPMENTS, 1.0))
        return images


def _bounds() -> tuple[Array, Array]:
    """The bounds of the logarithms of gain and gamma, and of the squared blur."""
    bounds = np.array([np.log(GAIN_BOUNDS), np.log(GAMMA_BOUNDS), np.square(BLUR_BOUNDS_PX)])
    return bounds[:, 0], bounds[:, 1]


def _residuals(images: Sequence[Image], target: CameraLook) -> Array:
    """The differences (4,) to a target's mean, standard deviation, edges and saturated share, in units of tolerances.

    Those of mean, standard deviation and edges are relative.
    """
    rows = [(image.mean(), image.std(), edge_px(image, gradients(image)), saturated_share(image)) for image in images]
    mean_dn, sd_dn, width_px, share = np.mean(rows, axis=0).tolist()
    ratios = np.array([
        mean_dn / max(target.mean_dn, 1.0),
        sd_dn / max(target.sd_dn, 1.0),
        width_px / target.edge_px if target.edge_px > 0 else 1.0,
    ])  # fmt: skip
    relative = np.log(np.maximum(ratios, 1e-3)) / TOLERANCES
    saturated = (share - target.saturated_share) / SATURATED_TOLERANCE
    return np.asarray([*relative, saturated], float)


def _fit_noise(gamma: float, wanted: CameraLook) -> float:
    """The noise of the chip relative to one of WELL_E electrons, at the grey values of flat parts."""
    if not len(wanted.flat_dn):
        return NOISE_BOUNDS[0]
    reference_chip = camera_of(1.0, gamma, 0.0, 1.0).chip
    reference_dn = np.array([chip_noise_dn(reference_chip, grey_dn) for grey_dn in wanted.flat_dn])
    wanted_dn = max(wanted.noise_dn**2 - ROUNDING_VARIANCE, 0.0) ** 0.5
    rms_reference_dn = np.mean(reference_dn**2) ** 0.5
    return float(np.clip(wanted_dn / rms_reference_dn, *NOISE_BOUNDS))


def solve_increasing(
    function: Callable[[float], float],
    wanted: float,
    bounds: tuple[float, float],
) -> float:
    """The argument within bounds at which an increasing function has a value, by bisection."""
    low, high = bounds
    for _ in range(HALVINGS):
        middle = float((low + high) / 2)
        if function(middle) < wanted:
            low = middle
        else:
            high = middle
    return float((low + high) / 2)
