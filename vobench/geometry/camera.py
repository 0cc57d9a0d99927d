"""Camera models: pinhole, Brown-Conrady, Kannala-Brandt, double sphere, equirectangular."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array
from vobench.geometry.vector import unit

TOLERANCE = 1e-13  # of a focal length: 1e-10 px
KNOTS = 1025
MAX_STEPS = 60
# The value u, v of a map of the plane and the entries xx, xy and yy of its symmetric Jacobian, each (N,).
Distorted = tuple[Array, Array, Array, Array, Array]
Plane = Callable[[Array, Array], Distorted]


def rising_root(
    g: Callable[[Array], Array],
    slope: Callable[[Array], Array],
    target: Array,
    limit: float,
) -> Array:
    """The x (N,) in [0, limit] with g(x) = target, for a g that rises from g(0) = 0; NaN where there is none.

    A table brackets each root, and a Newton step that leaves its bracket becomes a bisection.
    """
    knots = np.linspace(0.0, limit, KNOTS)
    values = g(knots)
    is_reached = (target >= 0) & (target <= values[-1])
    target = np.where(is_reached, target, 0.0)

    above = np.searchsorted(values, target).clip(1, KNOTS - 1)
    low = knots[above - 1]
    high = knots[above]
    x = np.interp(target, values, knots)
    for _ in range(MAX_STEPS):
        error = g(x) - target
        if np.abs(error).max(initial=0.0) <= TOLERANCE:
            break
        low = np.where(error > 0, low, x)
        high = np.where(error > 0, x, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            newton = x - error / slope(x)
        middle = (low + high) / 2
        is_bracketed = (newton >= low) & (newton <= high)
        x = np.where(is_bracketed, newton, middle)
    return np.where(is_reached, x, np.nan)


def plane_root(
    f: Plane,
    target: tuple[Array, Array],
    start: tuple[Array, Array],
    limit: float,
) -> Array:
    """The points (2, N) within `limit` of the origin that f maps to the target; NaN where there are none.

    `f` gives its value and the distinct entries xx, xy, yy of its symmetric Jacobian, which is positive
    within the limit. So every Newton step points downhill, and is halved until it gets there.
    """
    x = np.stack(start)
    goal = np.stack(target)
    state = _residual(f, x, goal)
    step_share = np.ones(x.shape[1])
    open_columns = np.arange(x.shape[1])
    tolerance = TOLERANCE * np.maximum(1.0, np.hypot(*goal))
    for _ in range(MAX_STEPS):
        is_open = state[0, open_columns] > tolerance[open_columns]
        open_columns = open_columns[is_open]
        if not len(open_columns):
            break

        step = step_share[open_columns] * _newton_step(state[:, open_columns])
        trial = x[:, open_columns] - step
        trial_state = _residual(f, trial, goal[:, open_columns])
        is_nearer = trial_state[0] < state[0, open_columns]
        is_inside = np.hypot(*trial) <= limit
        is_better = is_nearer & is_inside

        improved = open_columns[is_better]
        x[:, improved] = trial[:, is_better]
        state[:, improved] = trial_state[:, is_better]
        halved = step_share[open_columns] / 2
        step_share[open_columns] = np.where(is_better, 1.0, halved)
    return np.where(state[0] <= tolerance, x, np.nan)


def _residual(f: Plane, x: Array, goal: Array) -> Array:
    """Distance, u and v from the goal to f(x), and the Jacobian's xx, xy and yy: rows of (6, N)."""
    u, v, *jacobian = f(*x)
    u = u - goal[0]
    v = v - goal[1]
    distance = np.hypot(u, v)
    return np.stack([distance, u, v, *jacobian])


def _newton_step(state: Array) -> Array:
    """The Jacobian's inverse times the residual, (2, N), by Cramer's rule."""
    _, u, v, xx, xy, yy = state
    determinant = xx * yy - xy * xy
    step_u = yy * u - xy * v
    step_v = xx * v - xy * u
    step: Array = np.stack([step_u, step_v]) / determinant
    return step


# What depth means: z, negative behind the camera, or the distance along the ray for a camera that sees all around.
DepthAlong = Literal["axis", "ray"]


@dataclass(frozen=True, slots=True)
class Focal:
    """A camera with a focal length: a lens maps directions to a plane, and a linear step maps that to pixels."""

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
        """The matrix (3, 3) of the pinhole that the lens is equal to near its axis."""
        return camera_matrix(self.fx_px, self.fy_px, self.cx_px, self.cy_px)

    def to_pixels(self, x: Array, y: Array) -> Array:
        """Pixels (..., 2) of points on the lens's plane."""
        u = self.fx_px * x + self.cx_px
        v = self.fy_px * y + self.cy_px
        return np.stack([u, v], -1)

    def from_pixels(self, uv_px: ArrayLike) -> tuple[Array, Array]:
        """Points on the lens's plane of pixels (..., 2)."""
        u, v = _components(uv_px)
        x = (u - self.cx_px) / self.fx_px
        y = (v - self.cy_px) / self.fy_px
        return x, y


@dataclass(frozen=True, slots=True)
class Pinhole(Focal):
    """A pinhole camera."""

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN for points not in front of the camera."""
        return self.to_pixels(*on_plane(points_camera))

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2)."""
        return _directions(*self.from_pixels(uv_px))


def camera_matrix(fx_px: float, fy_px: float, cx_px: float, cy_px: float) -> Array:
    """The matrix (3, 3) of a pinhole."""
    K = np.eye(3)
    K[0, 0] = fx_px
    K[1, 1] = fy_px
    K[0, 2] = cx_px
    K[1, 2] = cy_px
    return K


def focal_and_center_px(K: Array) -> list[float]:
    """The values fx, fy, cx, cy of a camera matrix (3, 3) or of a projection matrix (3, 4)."""
    return [float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])]


def pixel_grid(camera: "Camera") -> Array:
    """Columns and rows (H, W, 2) of the centres of all pixels."""
    columns = np.arange(camera.width_px, dtype=float)
    rows = np.arange(camera.height_px, dtype=float)
    u, v = np.meshgrid(columns, rows)
    return np.stack([u, v], -1)


def on_plane(points_camera: ArrayLike) -> tuple[Array, Array]:
    """Coordinates x and y where the rays to points (..., 3) meet the plane z = 1; NaN for points not in front."""
    x, y, z = _components(points_camera)
    z = np.where(z > 0, z, np.nan)
    with np.errstate(over="ignore"):  # the ray of a point at nearly 90 degrees meets the plane infinitely far out
        return x / z, y / z


def _components(vectors: ArrayLike) -> Array:
    """The components (n, ...) of vectors (..., n)."""
    return np.moveaxis(np.asarray(vectors, float), -1, 0)


def _directions(x: Array, y: Array) -> Array:
    """Unit directions (..., 3) of points on the plane z = 1."""
    return unit(np.stack([x, y, np.ones_like(x)], -1))


@dataclass(frozen=True, slots=True)
class BrownConrady(Focal):
    """Radial and tangential distortion (ROS: plumb_bob, Kalibr: radtan). Source: Brown (1966), OpenCV.

    Beyond `fold_radius` the polynomials decrease, so that several directions would share a pixel: those have none.
    """

    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "p1", "p2", "k3")
    k1: float
    k2: float
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @property
    def fold_radius(self) -> float:
        """Radius on the plane z = 1 up to which the lens is one-to-one; infinite for most."""
        # The radial part has the derivative d(r R)/dr along the radius and R across it. At radius r the tangential
        # part has eigenvalues within 6 p r. While both derivatives stay above that, the symmetric Jacobian is
        # positive on a disc, which is convex, so the lens is one-to-one there.
        k1 = self.k1
        k2 = self.k2
        k3 = self.k3
        tangential = -6 * float(np.hypot(self.p1, self.p2))
        along = (1, tangential, 3 * k1, 0, 5 * k2, 0, 7 * k3)
        across = (1, tangential, k1, 0, k2, 0, k3)
        return min(_first_root(along), _first_root(across))

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN behind the camera and beyond the fold."""
        x, y = on_plane(points_camera)
        is_seen = x * x + y * y < self.fold_radius**2
        x = np.where(is_seen, x, np.nan)
        y = np.where(is_seen, y, np.nan)
        return self.to_pixels(*self._distorted(x, y)[:2])

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        u, v = self.from_pixels(uv_px)
        undistorted = self._undistorted(u.ravel(), v.ravel())
        x, y = undistorted.reshape(2, *u.shape)
        return _directions(x, y)

    def _distorted(self, x: Array, y: Array) -> Distorted:
        """The distorted x and y, and the entries xx, xy, yy of the Jacobian, which is symmetric."""
        p1 = self.p1
        p2 = self.p2
        x_squared = x * x
        y_squared = y * y
        r_squared = x_squared + y_squared
        radial = self._radial_factor(r_squared)
        slope = self._radial_factor_slope(r_squared)

        u_tangential = p2 * (r_squared + 2 * x * x)
        v_tangential = p1 * (r_squared + 2 * y * y)
        u = x * radial + 2 * p1 * x * y + u_tangential
        v = y * radial + 2 * p2 * x * y + v_tangential

        xx = radial + x_squared * slope + 2 * p1 * y + 6 * p2 * x
        yy = radial + y_squared * slope + 6 * p1 * y + 2 * p2 * x
        xy = x * y * slope + 2 * (p1 * x + p2 * y)
        return u, v, xx, xy, yy

    def _radial_factor(self, r_squared: Array) -> Array:
        """By how much radial distortion lengthens a radius: 1 + k1 r² + k2 r⁴ + k3 r⁶."""
        outer = self.k2 + r_squared * self.k3
        return 1 + r_squared * (self.k1 + r_squared * outer)

    def _radial_factor_slope(self, r_squared: Array) -> Array:
        """The derivative of the radial factor by r, divided by r."""
        outer = 2 * self.k2 + r_squared * 3 * self.k3
        return 2 * (self.k1 + r_squared * outer)

    def _radius(self, r: Array) -> Array:
        """The distorted radius without tangential terms."""
        return r * self._radial_factor(r**2)

    def _radius_slope(self, r: Array) -> Array:
        """The derivative of the distorted radius by r."""
        r_squared = r**2
        outer = 5 * self.k2 + r_squared * 7 * self.k3
        return 1 + r_squared * (3 * self.k1 + r_squared * outer)

    def _undistorted(self, u: Array, v: Array) -> Array:
        """The points (2, N) that the lens distorts to u and v; NaN beyond the fold."""
        radius = np.hypot(u, v)
        largest = radius.max(initial=1.0, where=np.isfinite(radius))
        limit = _reach(self._radius, largest, self.fold_radius)

        # Tangential terms move a point by at most 3 |p| r², so a point farther out has no origin.
        edge = float(self._radius(np.array(limit))) * (1 - 1e-12)
        tangential_reach = 3 * np.hypot(self.p1, self.p2) * limit**2
        has_origin = radius <= edge + tangential_reach
        u = u[has_origin]
        v = v[has_origin]
        radius = radius[has_origin]

        radial_origin = rising_root(self._radius, self._radius_slope, np.minimum(radius, edge), limit)
        scale = radial_origin / np.maximum(radius, 1e-300)
        start = (u * scale, v * scale)
        points = np.full((2, len(has_origin)), np.nan)
        points[:, has_origin] = plane_root(self._distorted, (u, v), start, limit)
        return points


@dataclass(frozen=True, slots=True)
class KannalaBrandt(Focal):
    """A fisheye by a polynomial in the angle (ROS: equidistant, Kalibr: equi). Source: Kannala and Brandt (2006).

    It works on directions, so its field of view may exceed 180°, up to `fold_rad` from the axis.
    """

    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "k3", "k4")
    k1: float
    k2: float
    k3: float
    k4: float

    @property
    def fold_rad(self) -> float:
        """Angle from the axis up to which the lens is one-to-one; at most 180°."""
        slope = (1, 0, 3 * self.k1, 0, 5 * self.k2, 0, 7 * self.k3, 0, 9 * self.k4)
        return min(np.pi, _first_root(slope))

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN beyond the fold, straight behind and at the centre."""
        x, y, z = _components(points_camera)
        axis_distance = np.hypot(x, y)
        theta = np.arctan2(axis_distance, z)
        is_beside_axis = axis_distance > 0
        is_seen = (theta < self.fold_rad) & (is_beside_axis | (z > 0))

        radius = np.where(is_seen, self._radius(theta), np.nan)
        scale = radius / np.where(is_beside_axis, axis_distance, 1.0)
        return self.to_pixels(x * scale, y * scale)

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = self.from_pixels(uv_px)
        radius = np.hypot(x, y)
        roots = rising_root(self._radius, self._radius_slope, radius.ravel(), self.fold_rad)
        theta = roots.reshape(radius.shape)
        scale = np.sin(theta) / np.where(radius > 0, radius, 1.0)
        direction_z = np.cos(theta)
        return np.stack([x * scale, y * scale, direction_z], -1)

    def _radius(self, theta: Array) -> Array:
        """Distance from the centre on the lens's plane at an angle from the axis."""
        t = theta * theta
        outer = self.k3 + t * self.k4
        inner = self.k1 + t * (self.k2 + t * outer)
        return theta * (1 + t * inner)

    def _radius_slope(self, theta: Array) -> Array:
        """The derivative of that distance by the angle."""
        t = theta * theta
        outer = 7 * self.k3 + t * 9 * self.k4
        inner = 3 * self.k1 + t * (5 * self.k2 + t * outer)
        return 1 + t * inner


@cache
def _first_root(coefficients: tuple[float, ...]) -> float:
    """The smallest positive root of a polynomial, lowest power first; infinite without one."""
    highest_first = np.trim_zeros(np.array(coefficients[::-1], float), "f")
    roots = np.roots(highest_first)
    is_real = np.abs(roots.imag) < 1e-9 * np.abs(roots)
    is_positive = roots.real > 0
    candidates = roots.real[is_real & is_positive]
    return float(candidates.min(initial=np.inf))


def _reach(g: Callable[[Array], Array], largest: float, limit: float) -> float:
    """The limit, or a smaller radius that g maps beyond the largest value."""
    radius = 1.0
    while radius < limit and g(np.array(radius)) < largest:
        radius *= 2
    return min(radius, limit)


@dataclass(frozen=True, slots=True)
class DoubleSphere(Focal):
    """A fisheye with an inverse in closed form. Source: Usenko, Demmel and Cremers (2018), equations 40 to 46.

    |xi| < 1 shifts the second sphere, 0 <= alpha < 1 the pinhole behind it.
    """

    coefficients: ClassVar[tuple[str, ...]] = ("xi", "alpha")
    xi: float
    alpha: float

    @property
    def K(self) -> Array:
        """The matrix (3, 3) of the pinhole that the lens is equal to near its axis."""
        magnification = 1 + self.xi
        fx_px = self.fx_px / magnification
        fy_px = self.fy_px / magnification
        return camera_matrix(fx_px, fy_px, self.cx_px, self.cy_px)

    @property
    def least_cosine(self) -> float:
        """Cosine of the angle on the second sphere at which the lens folds over or its image ends at infinity."""
        larger = max(self.alpha, 1 - self.alpha)
        smaller = min(self.alpha, 1 - self.alpha)
        return -smaller / larger

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN outside the cone that the lens sees."""
        x, y, z = _components(points_camera)
        # The paper states its bound in z; on the second sphere it is exact, and short.
        squared_axis_distance = x * x + y * y
        first_distance = np.sqrt(squared_axis_distance + z * z)
        shifted_z = self.xi * first_distance + z
        second_distance = np.sqrt(squared_axis_distance + shifted_z * shifted_z)

        is_seen = shifted_z > self.least_cosine * second_distance
        depth = self.alpha * second_distance + (1 - self.alpha) * shifted_z
        depth = np.where(is_seen, depth, np.nan)
        return self.to_pixels(x / depth, y / depth)

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = self.from_pixels(uv_px)
        r_squared = x * x + y * y
        radicand = 1 - (2 * self.alpha - 1) * r_squared
        root = np.sqrt(np.where(radicand > 0, radicand, np.nan))

        numerator = 1 - self.alpha**2 * r_squared
        z = numerator / (self.alpha * root + 1 - self.alpha)
        second_root = np.sqrt(z * z + (1 - self.xi**2) * r_squared)
        scale = (z * self.xi + second_root) / (z * z + r_squared)
        direction_z = scale * z - self.xi
        return unit(np.stack([scale * x, scale * y, direction_z], -1))


@dataclass(frozen=True, slots=True)
class Equirectangular:
    """All directions in one image: columns are longitudes, rows latitudes, the optical axis is at the centre.

    Its depth is the distance along the ray, since z would be negative for half of its field of view.
    """

    depth_along: ClassVar[DepthAlong] = "ray"
    coefficients: ClassVar[tuple[str, ...]] = ()
    width_px: int
    height_px: int

    @property
    def K(self) -> Array:
        """The matrix (3, 3) of the pinhole that the image is equal to near its centre."""
        fx_px = self.width_px / (2 * np.pi)
        fy_px = self.height_px / np.pi
        cx_px = (self.width_px - 1) / 2
        cy_px = (self.height_px - 1) / 2
        return camera_matrix(fx_px, fy_px, cx_px, cy_px)

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN for the camera's own position only."""
        x, y, z = _components(points_camera)
        is_camera = (x == 0) & (y == 0) & (z == 0)
        validity = np.where(is_camera, np.nan, 1.0)
        longitude = np.arctan2(x, z)
        latitude = np.arctan2(y, np.hypot(x, z))
        (fx, _, cx), (_, fy, cy), _ = self.K
        u = fx * longitude + cx
        v = fy * latitude + cy
        return np.stack([u, v], -1) * validity[..., None]

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels outside the sphere's image."""
        (fx, _, cx), (_, fy, cy), _ = self.K
        u, v = _components(uv_px)
        longitude = (u - cx) / fx
        latitude = (v - cy) / fy
        is_on_sphere = (np.abs(longitude) <= np.pi) & (np.abs(latitude) <= np.pi / 2)
        latitude = np.where(is_on_sphere, latitude, np.nan)

        cosine = np.cos(latitude)
        x = cosine * np.sin(longitude)
        y = np.sin(latitude)
        z = cosine * np.cos(longitude)
        return np.stack([x, y, z], -1)


# A camera maps directions to pixels and back, and is hashable. `coefficients` names the fields of its distortion in the
# order of ROS; K is the matrix of the pinhole that it is equal to near its axis.
Camera = Pinhole | BrownConrady | KannalaBrandt | DoubleSphere | Equirectangular
