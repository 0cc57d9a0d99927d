"""Creates cameras from the names that Kalibr, EuRoC and ROS give to distortion models."""

from collections.abc import Sequence

from vobench.errors import InputError
from vobench.geometry.camera import BrownConrady, Camera, KannalaBrandt, Pinhole

# The names of each distortion model, in lower case.
RADTAN_NAMES = ("radtan", "radial-tangential", "plumb_bob", "rational_polynomial")
EQUIDISTANT_NAMES = ("equidistant", "equi", "fisheye", "kannala_brandt")
NO_DISTORTION_NAMES = ("none", "")

RADTAN_COUNTS = (4, 5, 8, 12, 14)  # the numbers of coefficients in OpenCV; those after the fifth must be 0
RADTAN_USED = 5  # k1, k2, p1, p2, k3
EQUIDISTANT_COUNT = 4


def focal_camera(
    size_px: tuple[int, int],
    focal_px: Sequence[float],
    model: str,
    coefficients: Sequence[float],
    *,
    place: str,
) -> Camera:
    """The camera with fx, fy, cx, cy and a distortion model, given by any of its names.

    Raises InputError, whose message begins with `place`.
    """
    if len(focal_px) != 4 or not all(focal > 0 for focal in focal_px[:2]):
        actual = list(focal_px)
        raise InputError(f"{place}: a camera should have fx, fy, cx, cy with fx and fy above 0, but has {actual}")

    name = model.strip().lower()
    is_undistorted = not any(coefficients)
    if is_undistorted and name in (*NO_DISTORTION_NAMES, *RADTAN_NAMES):
        return Pinhole(*size_px, *focal_px)
    if name in RADTAN_NAMES and len(coefficients) in RADTAN_COUNTS and not any(coefficients[RADTAN_USED:]):
        return BrownConrady(*size_px, *focal_px, *coefficients[:RADTAN_USED])
    if name in EQUIDISTANT_NAMES and len(coefficients) == EQUIDISTANT_COUNT:
        return KannalaBrandt(*size_px, *focal_px, *coefficients)
    raise InputError(
        f"{place}: no camera model has the distortion model '{model}' with the coefficients {list(coefficients)}. "
        f"Known: radtan or plumb_bob (4 or 5), equidistant (4), none (0)"
    )
