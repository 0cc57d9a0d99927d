"""Fits a simulated camera to the appearance of images: exposure, contrast, blur and noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vobench.analysis.conditions import chip_noise_dn
from vobench.analysis.image_noise import noise_dn
from vobench.analysis.image_statistics import edge_px, gradients
from vobench.geometry.se3 import Array
from vobench.sensor.image_sensor import CameraSensor, CameraSettings
from vobench.sequence.picture import Image


@dataclass(frozen=True, slots=True)
class CameraLook:
    """The properties of images that a camera is fitted to: mean and standard deviation of grey values, noise, edges.

    Noise is measured in flat parts, whose grey values are `flat_dn` (N,). Edges are measured by their width.
    """

    mean_dn: float
    sd_dn: float
    noise_dn: float
    edge_px: float
    flat_dn: Array


def look_of(pictures: Sequence[Image]) -> CameraLook:
    """The look of grey images, as means over them."""
    rows = []
    flat_dn = []
    for picture in pictures:
        sigma_dn, flat_values_dn = noise_dn(picture)
        width_px = edge_px(picture, gradients(picture))
        rows.append((picture.mean(), picture.std(), sigma_dn, width_px))
        flat_dn.append(flat_values_dn)
    mean_dn, sd_dn, mean_sigma_dn, mean_width_px = np.mean(rows, axis=0).tolist()
    return CameraLook(mean_dn, sd_dn, mean_sigma_dn, mean_width_px, np.concatenate(flat_dn))


Develop = Callable[[CameraSettings], list[Image]]  # the images that a camera takes of the scene

WELL_E = 20_000.0
READ_NOISE_E = 25.0
ADC_BITS: Literal[10] = 10
ROUNDING_VARIANCE = 1 / 12  # the variance of the rounding errors of grey values

# Bounds of the search.
GAIN_BOUNDS = (0.02, 60.0)
GAMMA_BOUNDS = (0.2, 1.2)
BLUR_BOUNDS_PX = (0.0, 3.0)
NOISE_BOUNDS = (0.03, 30.0)
ROUNDS = 3
HALVINGS = 7


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


def fit_camera(wanted: CameraLook, develop: Develop) -> tuple[CameraSettings, CameraLook]:
    """The camera whose images are most similar to the wanted look, and the look of its images."""
    parameters = _Parameters(gain=1.0, gamma=0.45, blur_px=0.0, noise=0.05)
    for _ in range(ROUNDS):
        parameters = replace(parameters, gamma=_fit_gamma(parameters, wanted, develop))
        parameters = replace(parameters, gain=_fit_gain(parameters, wanted, develop))
        parameters = replace(parameters, blur_px=_fit_blur_px(parameters, wanted, develop))
        parameters = replace(parameters, noise=_fit_noise(parameters, wanted))
    settings = parameters.settings()
    return settings, look_of(develop(settings))


def _fit_gamma(parameters: _Parameters, wanted: CameraLook, develop: Develop) -> float:
    """The exponent that gives the wanted standard deviation of grey values, with the gain that gives their mean."""

    def sd_dn(gamma: float) -> float:
        of_gamma = replace(parameters, gamma=gamma)
        exposed = replace(of_gamma, gain=_fit_gain(of_gamma, wanted, develop))
        images = np.stack(develop(exposed.settings()))
        return float(np.mean([image.std() for image in images]))

    return solve_increasing(sd_dn, wanted.sd_dn, GAMMA_BOUNDS)


def _fit_gain(parameters: _Parameters, wanted: CameraLook, develop: Develop) -> float:
    """The gain that gives the wanted mean of grey values."""

    def mean_dn(log_gain: float) -> float:
        exposed = replace(parameters, gain=float(np.exp(log_gain)))
        return float(np.stack(develop(exposed.settings())).mean())

    low, high = np.log(GAIN_BOUNDS)
    return float(np.exp(solve_increasing(mean_dn, wanted.mean_dn, (low, high))))


def _fit_blur_px(parameters: _Parameters, wanted: CameraLook, develop: Develop) -> float:
    """The blur that gives the wanted width of edges."""

    def width_px(blur_px: float) -> float:
        return look_of(develop(replace(parameters, blur_px=blur_px).settings())).edge_px

    return solve_increasing(width_px, wanted.edge_px, BLUR_BOUNDS_PX)


def _fit_noise(parameters: _Parameters, wanted: CameraLook) -> float:
    """The noise of the chip relative to one of WELL_E electrons, at the grey values of flat parts."""
    if not len(wanted.flat_dn):
        return NOISE_BOUNDS[0]
    reference_chip = camera_of(1.0, parameters.gamma, 0.0, 1.0).chip
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
