"""Defines the errors of a stereo pair's calibration that are fitted, and how each shifts points in the images."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vobench.estimator.stereo import Eye, StereoPair
from vobench.geometry.camera import Focal
from vobench.geometry.rig import CameraError, has_tangential, true_camera, turned
from vobench.geometry.se3 import Array, transform


@dataclass(frozen=True, slots=True)
class PairParameter:
    """An error of the right camera, or of both cameras.

    `sigma` is the standard deviation of its prior, which holds what images do not determine; `error` is the error of
    one camera for a value. It is None for the baseline, which no image of one camera shows.
    """

    name: str
    sigma: float
    error: Callable[[float], CameraError] | None
    is_common: bool = False


BASELINE = "baseline_ratio"
ROLL = "right_roll_deg"
PITCH = "right_pitch_deg"
YAW = "right_yaw_deg"
RIGHT_FOCAL = "right focal_ratio"
RIGHT_CENTER_X = "right center_x_px"
RIGHT_CENTER_Y = "right center_y_px"
RIGHT_TANGENTIAL_1 = "right tangential_1"
RIGHT_TANGENTIAL_2 = "right tangential_2"
RIGHT_DISTORTION = "right distortion_ratio"
FOCAL = "focal_ratio"
CENTER_X = "center_x_px"
CENTER_Y = "center_y_px"
DISTORTION = "distortion_ratio"

# The priors of the errors of both cameras are about those of RESIDUALS of a rig, others are wide.
PARAMETERS = (
    PairParameter(BASELINE, 0.006, None, is_common=True),
    PairParameter(FOCAL, 0.005, lambda value: CameraError(focal_ratio=value), is_common=True),
    PairParameter(CENTER_X, 3.0, lambda value: CameraError(center_px=(value, 0.0)), is_common=True),
    PairParameter(CENTER_Y, 3.0, lambda value: CameraError(center_px=(0.0, value)), is_common=True),
    PairParameter(DISTORTION, 0.02, lambda value: CameraError(distortion_ratio=value), is_common=True),
    PairParameter(ROLL, 0.5, lambda value: CameraError(roll_deg=value)),
    PairParameter(PITCH, 0.5, lambda value: CameraError(pitch_deg=value)),
    PairParameter(YAW, 0.5, lambda value: CameraError(yaw_deg=value)),
    PairParameter(RIGHT_FOCAL, 0.005, lambda value: CameraError(focal_ratio=value)),
    PairParameter(RIGHT_CENTER_X, 5.0, lambda value: CameraError(center_px=(value, 0.0))),
    PairParameter(RIGHT_CENTER_Y, 5.0, lambda value: CameraError(center_px=(0.0, value))),
    PairParameter(RIGHT_TANGENTIAL_1, 0.005, lambda value: CameraError(tangential=(value, 0.0))),
    PairParameter(RIGHT_TANGENTIAL_2, 0.005, lambda value: CameraError(tangential=(0.0, value))),
    PairParameter(RIGHT_DISTORTION, 0.02, lambda value: CameraError(distortion_ratio=value)),
)
LENS_TERMS = (RIGHT_CENTER_X, RIGHT_CENTER_Y, RIGHT_TANGENTIAL_1, RIGHT_TANGENTIAL_2, RIGHT_DISTORTION)

DIFFERENCE = 0.01  # of a prior's standard deviation, for numerical derivatives


def parameters_of(pair: StereoPair, *, with_lens_terms: bool) -> tuple[PairParameter, ...]:
    """The errors that the cameras of a pair can have: with those of the right lens, or without them."""
    camera = pair.right.camera
    has_focal_length = isinstance(camera, Focal)
    has_distortion = any(getattr(camera, name) for name in camera.coefficients)
    excluded: set[str] = set() if with_lens_terms else set(LENS_TERMS)
    if not has_focal_length:
        excluded |= {FOCAL, CENTER_X, CENTER_Y, RIGHT_FOCAL, RIGHT_CENTER_X, RIGHT_CENTER_Y}
    if not has_distortion:
        excluded |= {DISTORTION, RIGHT_DISTORTION}
    if not has_tangential(camera):
        excluded |= {RIGHT_TANGENTIAL_1, RIGHT_TANGENTIAL_2}
    return tuple(parameter for parameter in PARAMETERS if parameter.name not in excluded)


@dataclass(frozen=True, slots=True)
class PairDerivatives:
    """How P parameters shift N points of the rectified views, in px per standard deviation of their priors.

    `left_px` and `right_px` (N, 2, P) are the shifts of pixels of either view.
    """

    left_px: Array
    right_px: Array

    @property
    def disparity_px(self) -> Array:
        """The changes (N, P) of disparities."""
        changes: Array = (self.left_px - self.right_px)[:, 0]
        return changes

    @property
    def row_px(self) -> Array:
        """The changes (N, P) of the right row minus the left row."""
        changes: Array = (self.right_px - self.left_px)[:, 1]
        return changes


def pair_derivatives(
    parameters: tuple[PairParameter, ...], pair: StereoPair, left_px: Array, right_px: Array
) -> PairDerivatives:
    """The derivatives for matches by their pixels (N, 2) in both images. The baseline shifts none by itself."""
    in_left = left_derivatives(parameters, pair, left_px)
    in_right = np.stack([_shift(pair.right, right_px, parameter) for parameter in parameters], -1)
    return PairDerivatives(in_left, in_right)


def left_derivatives(parameters: tuple[PairParameter, ...], pair: StereoPair, left_px: Array) -> Array:
    """The shifts (N, 2, P) of pixels (N, 2) of the left image in its view."""
    shifts = []
    for parameter in parameters:
        is_shifted = parameter.is_common
        shifts.append(_shift(pair.left, left_px, parameter) if is_shifted else np.zeros(np.shape(left_px)))
    return np.stack(shifts, -1)


def _shift(eye: Eye, uv_px: Array, parameter: PairParameter) -> Array:
    """By how much a standard deviation of a parameter shifts pixels (N, 2) of a camera in its view."""
    if parameter.error is None:
        return np.zeros(np.shape(uv_px))
    error = parameter.error(DIFFERENCE * parameter.sigma)
    camera = true_camera(eye.camera, error)
    R_view_camera = turned(transform(eye.R_view_camera, np.zeros(3)), error)[:3, :3]
    rays = eye.rays(uv_px)
    shifted_px = camera.project(rays @ R_view_camera)
    shift: Array = (eye.in_view(shifted_px) - eye.in_view(uv_px)) / DIFFERENCE
    return shift
