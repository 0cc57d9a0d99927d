"""What a camera is: directions to pixels and back. OpenCV axes (x right, y down, z forward), pixel centres at integers.

(0, 0) is the centre of the top-left pixel, for every model. The other models are in `lens` and `sphere`.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array

DepthAlong = Literal["axis", "ray"]


class Camera(Protocol):
    """Anything that sends directions to pixels and pixels to directions.

    Neither method asks whether a pixel lies within the picture: that is the caller's question.
    """

    @property
    def width_px(self) -> int:
        """Columns of the picture."""

    @property
    def height_px(self) -> int:
        """Rows of the picture."""

    @property
    def depth_along(self) -> DepthAlong:
        """What depth means: z, negative behind the camera, or the distance along the ray where it sees all around."""

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of the fields that say how the lens bends, in the order of ROS."""

    @property
    def K(self) -> Array:
        """Matrix (3, 3) of the pinhole that this camera is like about its axis."""

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN for points that the lens cannot see."""

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels that no direction leads to."""

    def pixel_grid(self) -> Array:
        """Centres (H, W, 2) of all pixels."""

    def __hash__(self) -> int:
        """Equal cameras are one key, so that rays may be kept."""


class Intrinsics(Protocol):
    """The linear last step of most cameras: from a plane to pixels."""

    @property
    def fx_px(self) -> float:
        """Pixels per unit to the right."""

    @property
    def fy_px(self) -> float:
        """Pixels per unit down."""

    @property
    def cx_px(self) -> float:
        """Column of the plane's origin."""

    @property
    def cy_px(self) -> float:
        """Row of the plane's origin."""


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A pinhole camera with pixels that need not be square."""

    depth_along: ClassVar[DepthAlong] = "axis"
    coefficients: ClassVar[tuple[str, ...]] = ()
    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float

    @property
    def K(self) -> Array:
        """The (3, 3) camera matrix."""
        return camera_matrix(self.fx_px, self.fy_px, self.cx_px, self.cy_px)

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN for points not in front of the camera."""
        return to_pixels(self, *on_plane(points_camera))

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2)."""
        x, y = from_pixels(self, uv_px)
        return unit(np.stack([x, y, np.ones_like(x)], -1))

    def pixel_grid(self) -> Array:
        """Centres (H, W, 2) of all pixels."""
        return pixel_centres(self.width_px, self.height_px)


def camera_matrix(fx_px: float, fy_px: float, cx_px: float, cy_px: float) -> Array:
    """The (3, 3) matrix of a pinhole."""
    return np.array([[fx_px, 0, cx_px], [0, fy_px, cy_px], [0, 0, 1.0]])


def pixel_centres(width_px: int, height_px: int) -> Array:
    """Columns and rows (H, W, 2) of a picture's pixels."""
    u, v = np.meshgrid(np.arange(width_px, dtype=float), np.arange(height_px, dtype=float))
    return np.stack([u, v], -1)


def on_plane(points_camera: ArrayLike) -> tuple[Array, Array]:
    """Where the rays to points (..., 3) meet the plane z = 1; NaN for points not in front."""
    x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
    z = np.where(z > 0, z, np.nan)
    with np.errstate(over="ignore"):  # a point all but beside the camera is seen infinitely far out
        return x / z, y / z


def to_pixels(camera: Intrinsics, x: Array, y: Array) -> Array:
    """Pixels (..., 2) of places on the lens's plane."""
    return np.stack([camera.fx_px * x + camera.cx_px, camera.fy_px * y + camera.cy_px], -1)


def from_pixels(camera: Intrinsics, uv_px: ArrayLike) -> tuple[Array, Array]:
    """Places on the lens's plane of pixels (..., 2)."""
    u, v = np.moveaxis(np.asarray(uv_px, float), -1, 0)
    return (u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px


def unit(vectors: Array) -> Array:
    """Vectors (..., n) with their length taken out."""
    directions: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return directions
