"""Declared calibration error: how a true rig differs from the nominal one that estimators are told."""

from dataclasses import dataclass, replace

import numpy as np

from vobench.errors import VobenchError
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.lens import BrownConrady, KannalaBrandt
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.geometry.sphere import DoubleSphere


@dataclass(frozen=True, slots=True)
class CalibrationError:
    """The true rig minus what its calibration says; ratios are shares of what it says.

    Focal length, centre and distortion are off in both cameras alike. The right camera alone is
    turned, about its own z (roll, to the right), x (pitch, upwards) and y (yaw, to the right), and
    shifted along the baseline: the left camera stays where the calibration has it.
    """

    focal_ratio: float = 0.0
    center_px: tuple[float, float] = (0.0, 0.0)
    distortion_ratio: float = 0.0
    baseline_ratio: float = 0.0
    right_roll_deg: float = 0.0
    right_pitch_deg: float = 0.0
    right_yaw_deg: float = 0.0


def true_rig(nominal: Rig, error: CalibrationError) -> Rig:
    """The rig that the pictures are made with. Raises VobenchError where an error has nothing to act on."""
    return replace(
        nominal,
        left=true_camera(nominal.left, error),
        right=true_camera(nominal.camera("right"), error),
        T_body_right=_true_right(nominal, error),
    )


def true_camera(nominal: Camera, error: CalibrationError) -> Camera:
    """The camera with its focal length, centre and distortion off. Raises VobenchError."""
    if error.distortion_ratio and not any(getattr(nominal, name) for name in nominal.coefficients):
        raise VobenchError(f"distortion_ratio {error.distortion_ratio:g} needs a lens with distortion, got {nominal}")
    if not isinstance(nominal, Pinhole | BrownConrady | KannalaBrandt | DoubleSphere):
        if error.focal_ratio or any(error.center_px):
            raise VobenchError(f"focal_ratio and center_px need a camera with a focal length, got {nominal}")
        return nominal
    return replace(
        nominal,
        fx_px=nominal.fx_px * (1 + error.focal_ratio),
        fy_px=nominal.fy_px * (1 + error.focal_ratio),
        cx_px=nominal.cx_px + error.center_px[0],
        cy_px=nominal.cy_px + error.center_px[1],
        **{name: getattr(nominal, name) * (1 + error.distortion_ratio) for name in nominal.coefficients},
    )


def _true_right(nominal: Rig, error: CalibrationError) -> Array:
    # Written so that no error at all changes no bit.
    T_body_right = nominal.T_body_camera("right").copy()
    T_body_right[:3, 3] += error.baseline_ratio * (T_body_right - nominal.T_body_left)[:3, 3]
    angles_deg = [error.right_roll_deg, error.right_pitch_deg, error.right_yaw_deg]
    if any(angles_deg):
        from scipy.spatial.transform import Rotation

        T_body_right[:3, :3] @= Rotation.from_euler("ZXY", np.array(angles_deg), degrees=True).as_matrix()
    return T_body_right
