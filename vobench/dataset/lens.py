"""Cameras by the names that others give to the same lenses."""

from vobench.errors import InputError
from vobench.geometry.camera import Camera, Pinhole
from vobench.geometry.lens import BrownConrady, KannalaBrandt

RADTAN = ("radtan", "radial-tangential", "plumb_bob", "rational_polynomial")
EQUIDISTANT = ("equidistant", "equi", "fisheye", "kannala_brandt")
NONE = ("none", "")


def focal_camera(
    size_px: tuple[int, int], focal_px: list[float], model: str, coefficients: list[float], *, place: str
) -> Camera:
    """The camera of fx, fy, cx, cy, a distortion model by any of its names and its coefficients.

    Raises InputError where that is no lens known here; `place` is the file or topic that says so.
    """
    if len(focal_px) != 4 or not all(value > 0 for value in focal_px[:2]):
        raise InputError(f"{place}: a camera should have fx, fy, cx, cy with fx and fy above 0, but has {focal_px}")
    name = model.strip().lower()
    if name in (*NONE, *RADTAN) and not any(coefficients):
        return Pinhole(*size_px, *focal_px)
    if name in RADTAN and len(coefficients) in (4, 5, 8, 12, 14) and not any(coefficients[5:]):
        return BrownConrady(*size_px, *focal_px, *coefficients[:5])
    if name in EQUIDISTANT and len(coefficients) == 4:
        return KannalaBrandt(*size_px, *focal_px, *coefficients)
    raise InputError(
        f"{place}: no lens here has the distortion model '{model}' with the coefficients {coefficients}. "
        f"Known: radtan or plumb_bob (4 or 5), equidistant (4), none (0)"
    )
