"""Camera models: pinhole, Brown-Conrady, Kannala-Brandt, double sphere, equirectangular."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from vobench.geometry.se3 import Array

TOLERANCE = 1e-13  # of a focal length: 1e-10 px
KNOTS = 1025
MOST_STEPS = 60

Plane = Callable[[Array, Array], tuple[Array, Array, Array, Array, Array]]


def rising_root(g: Callable[[Array], Array], slope: Callable[[Array], Array], target: Array, limit: float) -> Array:
    """The x (N,) in [0, limit] with g(x) = target, for a g that rises from g(0) = 0; NaN where there is none.

    A table brackets each root, and a Newton step that leaves its bracket becomes a bisection.
    """
    knots = np.linspace(0.0, limit, KNOTS)
    values = g(knots)
    reached = (target >= 0) & (target <= values[-1])
    target = np.where(reached, target, 0.0)
    above = np.searchsorted(values, target).clip(1, KNOTS - 1)
    low = knots[above - 1]
    high = knots[above]
    x = np.interp(target, values, knots)
    for _ in range(MOST_STEPS):
        error = g(x) - target
        if np.abs(error).max(initial=0.0) <= TOLERANCE:
            break
        low = np.where(error > 0, low, x)
        high = np.where(error > 0, x, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = x - error / slope(x)
        x = np.where((step >= low) & (step <= high), step, (low + high) / 2)
    return np.where(reached, x, np.nan)


def plane_root(f: Plane, target: tuple[Array, Array], start: tuple[Array, Array], limit: float) -> Array:
    """The places (2, N) within `limit` of the origin that f sends to the target; NaN where there are none.

    `f` gives its value and the distinct entries xx, xy, yy of its symmetric Jacobian, which is positive
    within the limit. So every Newton step points downhill, and is halved until it gets there.
    """
    x = np.stack(start)
    goal = np.stack(target)
    state = _missed(f, x, goal)
    share = np.ones(x.shape[1])
    left = np.arange(x.shape[1])
    enough = TOLERANCE * np.maximum(1.0, np.hypot(*goal))
    for _ in range(MOST_STEPS):
        left = left[state[0, left] > enough[left]]
        if not len(left):
            break
        trial = x[:, left] - share[left] * _newton_step(state[:, left])
        trial_state = _missed(f, trial, goal[:, left])
        better = (trial_state[0] < state[0, left]) & (np.hypot(*trial) <= limit)
        x[:, left[better]] = trial[:, better]
        state[:, left[better]] = trial_state[:, better]
        share[left] = np.where(better, 1.0, share[left] / 2)
    return np.where(state[0] <= enough, x, np.nan)


def _missed(f: Plane, x: Array, goal: Array) -> Array:
    """How far, right and down f misses the goal, and its Jacobian's xx, xy, yy: rows of (6, N)."""
    u, v, *jacobian = f(*x)
    u = u - goal[0]
    v = v - goal[1]
    return np.stack([np.hypot(u, v), u, v, *jacobian])


def _newton_step(state: Array) -> Array:
    _, u, v, xx, xy, yy = state
    step: Array = np.stack([yy * u - xy * v, xx * v - xy * u]) / (xx * yy - xy * xy)
    return step


# What depth means: z, negative behind the camera, or the distance along the ray where it sees all around.
DepthAlong = Literal["axis", "ray"]


@dataclass(frozen=True, slots=True)
class Focal:
    """A camera whose linear last step goes from a plane to pixels, which need not be square."""

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
        """The (3, 3) matrix of the pinhole that the lens is like about its axis."""
        return camera_matrix(self.fx_px, self.fy_px, self.cx_px, self.cy_px)

    def to_pixels(self, x: Array, y: Array) -> Array:
        """Pixels (..., 2) of places on the lens's plane."""
        return np.stack([self.fx_px * x + self.cx_px, self.fy_px * y + self.cy_px], -1)

    def from_pixels(self, uv_px: ArrayLike) -> tuple[Array, Array]:
        """Places on the lens's plane of pixels (..., 2)."""
        u, v = np.moveaxis(np.asarray(uv_px, float), -1, 0)
        return (u - self.cx_px) / self.fx_px, (v - self.cy_px) / self.fy_px


@dataclass(frozen=True, slots=True)
class Pinhole(Focal):
    """A pinhole camera."""

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN for points not in front of the camera."""
        return self.to_pixels(*on_plane(points_camera))

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2)."""
        x, y = self.from_pixels(uv_px)
        return unit(np.stack([x, y, np.ones_like(x)], -1))


def camera_matrix(fx_px: float, fy_px: float, cx_px: float, cy_px: float) -> Array:
    """The (3, 3) matrix of a pinhole."""
    return np.array([[fx_px, 0, cx_px], [0, fy_px, cy_px], [0, 0, 1.0]])


def pixel_grid(camera: "Camera") -> Array:
    """Columns and rows (H, W, 2) of the centres of all pixels."""
    u, v = np.meshgrid(np.arange(camera.width_px, dtype=float), np.arange(camera.height_px, dtype=float))
    return np.stack([u, v], -1)


def on_plane(points_camera: ArrayLike) -> tuple[Array, Array]:
    """Where the rays to points (..., 3) meet the plane z = 1; NaN for points not in front."""
    x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
    z = np.where(z > 0, z, np.nan)
    with np.errstate(over="ignore"):  # a point all but beside the camera is seen infinitely far out
        return x / z, y / z


def unit(vectors: Array) -> Array:
    """Vectors (..., n) with their length taken out."""
    directions: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return directions


@dataclass(frozen=True, slots=True)
class BrownConrady(Focal):
    """Radial and tangential distortion (ROS: plumb_bob, Kalibr: radtan). Source: Brown (1966), OpenCV.

    Beyond `fold_radius` the polynomials turn back and far directions would land on near ones: no pixel.
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
        # Along the radius the radial part has d(r R)/dr, across it R. At radius r the tangential part has
        # eigenvalues within 6 p r. While both stay above that the symmetric Jacobian is positive on a disc,
        # which is convex, so the lens is one-to-one there.
        k1 = self.k1
        k2 = self.k2
        k3 = self.k3
        p = float(np.hypot(self.p1, self.p2))
        along = (1, -6 * p, 3 * k1, 0, 5 * k2, 0, 7 * k3)
        across = (1, -6 * p, k1, 0, k2, 0, k3)
        return min(_first_root(along), _first_root(across))

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN behind the camera and beyond the fold."""
        x, y = on_plane(points_camera)
        seen = x * x + y * y < self.fold_radius**2
        x = np.where(seen, x, np.nan)
        y = np.where(seen, y, np.nan)
        return self.to_pixels(*self._bent(x, y)[:2])

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = self.from_pixels(uv_px)
        x, y = self._straight(x.ravel(), y.ravel()).reshape(2, *x.shape)
        return unit(np.stack([x, y, np.ones_like(x)], -1))

    def _bent(self, x: Array, y: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Where the lens sends x and y, and the entries xx, xy, yy of the Jacobian, which is symmetric."""
        k1 = self.k1
        k2 = self.k2
        k3 = self.k3
        p1 = self.p1
        p2 = self.p2
        s = x * x + y * y
        radial = 1 + s * (k1 + s * (k2 + s * k3))
        slope = 2 * (k1 + s * (2 * k2 + s * 3 * k3))
        u = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x)
        v = y * radial + 2 * p2 * x * y + p1 * (s + 2 * y * y)
        xx = radial + x * x * slope + 2 * p1 * y + 6 * p2 * x
        yy = radial + y * y * slope + 6 * p1 * y + 2 * p2 * x
        return u, v, xx, x * y * slope + 2 * (p1 * x + p2 * y), yy

    def _straight(self, u: Array, v: Array) -> Array:
        """The places (2, N) that the lens sends to u and v; NaN beyond the fold."""

        def radial(r: Array) -> Array:
            return r * (1 + r**2 * (self.k1 + r**2 * (self.k2 + r**2 * self.k3)))

        def radial_slope(r: Array) -> Array:
            return 1 + r**2 * (3 * self.k1 + r**2 * (5 * self.k2 + r**2 * 7 * self.k3))

        far = np.hypot(u, v)
        limit = _reach(radial, far.max(initial=1.0, where=np.isfinite(far)), self.fold_radius)
        # Tangential terms move a point by at most 3 |p| s, so what is farther out has no origin.
        edge = float(radial(np.array(limit))) * (1 - 1e-12)
        possible = far <= edge + 3 * np.hypot(self.p1, self.p2) * limit**2
        u = u[possible]
        v = v[possible]
        far = far[possible]
        scale = rising_root(radial, radial_slope, np.minimum(far, edge), limit) / np.maximum(far, 1e-300)
        out = np.full((2, len(possible)), np.nan)
        out[:, possible] = plane_root(self._bent, (u, v), (u * scale, v * scale), limit)
        return out


@dataclass(frozen=True, slots=True)
class KannalaBrandt(Focal):
    """A fisheye by a polynomial in the angle (ROS: equidistant, Kalibr: equi). Source: Kannala and Brandt (2006).

    Works on directions, so it sees past 180°, up to `fold_rad` from the axis.
    """

    coefficients: ClassVar[tuple[str, ...]] = ("k1", "k2", "k3", "k4")
    k1: float
    k2: float
    k3: float
    k4: float

    @property
    def fold_rad(self) -> float:
        """Angle from the axis up to which the lens is one-to-one; at most 180°."""
        return min(np.pi, _first_root((1, 0, 3 * self.k1, 0, 5 * self.k2, 0, 7 * self.k3, 0, 9 * self.k4)))

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN beyond the fold, straight behind and at the centre."""
        x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
        aside = np.hypot(x, y)
        theta = np.arctan2(aside, z)
        seen = (theta < self.fold_rad) & ((aside > 0) | (z > 0))
        scale = np.where(seen, self._bent(theta), np.nan) / np.where(aside > 0, aside, 1.0)
        return self.to_pixels(x * scale, y * scale)

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = self.from_pixels(uv_px)
        far = np.hypot(x, y)
        theta = rising_root(self._bent, self._slope, far.ravel(), self.fold_rad).reshape(far.shape)
        aside = np.sin(theta) / np.where(far > 0, far, 1.0)
        return np.stack([x * aside, y * aside, np.cos(theta)], -1)

    def _bent(self, theta: Array) -> Array:
        t = theta * theta
        return theta * (1 + t * (self.k1 + t * (self.k2 + t * (self.k3 + t * self.k4))))

    def _slope(self, theta: Array) -> Array:
        t = theta * theta
        return 1 + t * (3 * self.k1 + t * (5 * self.k2 + t * (7 * self.k3 + t * 9 * self.k4)))


@cache
def _first_root(coefficients: tuple[float, ...]) -> float:
    """The smallest positive root of a polynomial, lowest power first; infinite without one."""
    roots = np.roots(np.trim_zeros(np.array(coefficients[::-1], float), "f"))
    positive = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(positive.min(initial=np.inf))


def _reach(g: Callable[[Array], Array], farthest: float, limit: float) -> float:
    """The limit, or a smaller radius that g sends beyond the farthest."""
    radius = 1.0
    while radius < limit and g(np.array(radius)) < farthest:
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
        """The (3, 3) matrix of the pinhole that the lens is like about its axis."""
        magnified = 1 + self.xi
        return camera_matrix(self.fx_px / magnified, self.fy_px / magnified, self.cx_px, self.cy_px)

    @property
    def least_cosine(self) -> float:
        """Cosine of the angle on the second sphere at which the lens folds over or its picture ends at infinity."""
        larger = max(self.alpha, 1 - self.alpha)
        smaller = min(self.alpha, 1 - self.alpha)
        return -smaller / larger

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN outside the cone that the lens sees."""
        x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
        # The paper states its bound in z; on the second sphere it is exact, and short.
        z = self.xi * np.sqrt(x * x + y * y + z * z) + z
        d = np.sqrt(x * x + y * y + z * z)
        seen = z > self.least_cosine * d
        scale = np.where(seen, self.alpha * d + (1 - self.alpha) * z, np.nan)
        return self.to_pixels(x / scale, y / scale)

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for pixels beyond the fold."""
        x, y = self.from_pixels(uv_px)
        s = x * x + y * y
        under_root = 1 - (2 * self.alpha - 1) * s
        root = np.sqrt(np.where(under_root > 0, under_root, np.nan))
        z = (1 - self.alpha**2 * s) / (self.alpha * root + 1 - self.alpha)
        scale = (z * self.xi + np.sqrt(z * z + (1 - self.xi**2) * s)) / (z * z + s)
        return unit(np.stack([scale * x, scale * y, scale * z - self.xi], -1))


@dataclass(frozen=True, slots=True)
class Equirectangular:
    """All directions in one picture: columns are longitudes, rows latitudes, ahead is in the middle.

    Its depth is the distance along the ray, since z would be negative for half of what it sees.
    """

    depth_along: ClassVar[DepthAlong] = "ray"
    coefficients: ClassVar[tuple[str, ...]] = ()
    width_px: int
    height_px: int

    @property
    def K(self) -> Array:
        """The (3, 3) matrix of the pinhole that the picture is like about its middle."""
        fx = self.width_px / (2 * np.pi)
        fy = self.height_px / np.pi
        return camera_matrix(fx, fy, (self.width_px - 1) / 2, (self.height_px - 1) / 2)

    def project(self, points_camera: ArrayLike) -> Array:
        """Pixels (..., 2) of points (..., 3); NaN for the camera's own place only."""
        x, y, z = np.moveaxis(np.asarray(points_camera, float), -1, 0)
        somewhere = np.where((x != 0) | (y != 0) | (z != 0), 1.0, np.nan)
        longitude = np.arctan2(x, z)
        latitude = np.arctan2(y, np.hypot(x, z))
        (fx, _, cx), (_, fy, cy), _ = self.K
        return np.stack([fx * longitude + cx, fy * latitude + cy], -1) * somewhere[..., None]

    def rays(self, uv_px: ArrayLike) -> Array:
        """Unit directions (..., 3) through pixels (..., 2); NaN for what lies off the picture's sphere."""
        (fx, _, cx), (_, fy, cy), _ = self.K
        u, v = np.moveaxis(np.asarray(uv_px, float), -1, 0)
        longitude = (u - cx) / fx
        latitude = (v - cy) / fy
        latitude = np.where((np.abs(longitude) <= np.pi) & (np.abs(latitude) <= np.pi / 2), latitude, np.nan)
        across = np.cos(latitude)
        return np.stack([across * np.sin(longitude), np.sin(latitude), across * np.cos(longitude)], -1)


# What sends directions to pixels and back. Equal ones are one key. `coefficients` names the fields that say how the
# lens bends, in the order of ROS; K is of the pinhole that it is like about its axis.
Camera = Pinhole | BrownConrady | KannalaBrandt | DoubleSphere | Equirectangular
