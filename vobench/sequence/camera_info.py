"""The sensor_msgs/CameraInfo message: created from a camera, and parsed."""

from typing import Any

import numpy as np

from vobench.errors import SequenceError
from vobench.geometry.camera import (
    BrownConrady,
    Camera,
    DoubleSphere,
    Equirectangular,
    KannalaBrandt,
    Pinhole,
    camera_matrix,
)
from vobench.geometry.rig import Rig, projection, rectification
from vobench.geometry.se3 import Array
from vobench.sequence.message import header_message
from vobench.sequence.message_type import new_message
from vobench.sequence.topic import LEFT, LEFT_INFO, RIGHT

# The names of distortion models in a CameraInfo. ROS defines the first two, vobench the others.
PLUMB_BOB = "plumb_bob"
EQUIDISTANT = "equidistant"
DOUBLE_SPHERE = "double_sphere"
# The models whose parameters are focal lengths, a principal point and coefficients.
FOCAL_MODELS: dict[str, type[BrownConrady] | type[KannalaBrandt] | type[DoubleSphere]] = {
    PLUMB_BOB: BrownConrady,
    EQUIDISTANT: KannalaBrandt,
    DOUBLE_SPHERE: DoubleSphere,
}
EQUIRECTANGULAR = "equirectangular"


def model_name(camera: Camera) -> str:
    """The name of a camera's distortion model. A pinhole camera has PLUMB_BOB, with coefficients of 0."""
    if isinstance(camera, Equirectangular):
        return EQUIRECTANGULAR
    for name, model in FOCAL_MODELS.items():
        if isinstance(camera, model):
            return name
    return PLUMB_BOB


def camera_info_messages(t_ns: int, rig: Rig) -> tuple[Any, ...]:
    """The sensor_msgs/CameraInfo of each camera. For a pair that can be rectified, R and P rectify it."""
    if rig.right is None:
        return (camera_info_message(t_ns, LEFT, rig.left),)
    rectified = rectification(rig)
    if rectified is None:
        return camera_info_message(t_ns, LEFT, rig.left), camera_info_message(t_ns, RIGHT, rig.right)
    left = camera_info_message(t_ns, LEFT, rig.left, R=rectified.R_view_left, P=rectified.P_left)
    right = camera_info_message(t_ns, RIGHT, rig.right, R=rectified.R_view_right, P=rectified.P_right)
    return left, right


def camera_info_message(
    t_ns: int,
    frame_id: str,
    camera: Camera,
    *,
    R: Array | None = None,
    P: Array | None = None,
) -> Any:
    """A sensor_msgs/CameraInfo. `R` (3, 3) and `P` (3, 4) rectify a stereo pair.

    Without them, R is the identity and P projects with the matrix of the camera, as ROS defines for a single camera.
    """
    if R is None:
        R = np.eye(3)
    if P is None:
        P = projection(camera.K, 0.0)
    coefficients = np.zeros(5)  # those of plumb_bob, which stands for a pinhole camera
    if not isinstance(camera, Pinhole):
        coefficients = np.array([getattr(camera, name) for name in camera.coefficients])
    full_picture = new_message(  # in ROS, a region of size 0 is the full picture
        "sensor_msgs/msg/RegionOfInterest",
        x_offset=0,
        y_offset=0,
        height=0,
        width=0,
        do_rectify=False,
    )
    return new_message(
        LEFT_INFO.type_name,
        header=header_message(t_ns, frame_id),
        height=camera.height_px,
        width=camera.width_px,
        distortion_model=model_name(camera),
        d=coefficients,
        k=_model_matrix(camera).ravel(),
        r=R.ravel(),
        p=P.ravel(),
        binning_x=0,  # no binning
        binning_y=0,
        roi=full_picture,
    )


def _model_matrix(camera: Camera) -> Array:
    """The matrix (3, 3) of the focal lengths and principal point that are parameters of the camera model.

    For a double sphere it differs from `camera.K`, which has the focal lengths at the optical axis.
    """
    if isinstance(camera, DoubleSphere):
        return camera_matrix(camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px)
    return camera.K


def parse_camera(message: Any) -> Camera:
    """The camera that a CameraInfo message describes.

    Raises SequenceError for an unknown distortion model, or a wrong number of coefficients.
    """
    size_px = (int(message.width), int(message.height))
    coefficients = [float(value) for value in message.d]
    name = message.distortion_model
    if name == EQUIRECTANGULAR:
        return Equirectangular(*size_px)
    fx_px, _, cx_px, _, fy_px, cy_px = message.k[:6].tolist()
    has_no_distortion = not any(coefficients)
    if name == PLUMB_BOB and has_no_distortion:
        return Pinhole(*size_px, fx_px, fy_px, cx_px, cy_px)
    model = FOCAL_MODELS.get(name)
    if model is None or len(coefficients) != len(model.coefficients):
        known = ", ".join(f"{key} ({len(known_model.coefficients)})" for key, known_model in FOCAL_MODELS.items())
        raise SequenceError(
            f"camera {message.header.frame_id} has the distortion model '{name}' with {len(coefficients)} "
            f"coefficients. Known: {known}, {EQUIRECTANGULAR} (0)"
        )
    return model(*size_px, fx_px, fy_px, cx_px, cy_px, *coefficients)
