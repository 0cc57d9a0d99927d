"""The plans of parks by seed: hills, a pond, a loop of paths with links and exits, and what is near them."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

from vobench.asset.picture import Rng
from vobench.asset.site import Area
from vobench.geometry.se3 import Array

STEP_M = 0.25  # between points of a path
STEEPEST = 0.17  # the sum of the slopes of all waves of the ground
RIM_SHARE = 0.2  # of half the extent, in which the ground rises towards the border
SHORE_M = 0.14  # of the water's edge below the ground around the pond
WADING_M = 0.25  # depth of water in which a piece may stand
POND_CLEAR_M = 2.6  # between the middle of a path and the water
POND_SHARE = 0.72  # of parks
POND_TRIES = 30
LEAST_POND_M = 2.4  # radius
POND_LOBES = (2, 3, 4)  # numbers of waves of a shore
HILL_WAVES = 5
LOOP_WIDTH_M = (1.9, 3.0)
WIDTH_WAVES_M = (0.1, 0.06)  # amplitudes of the changes of a path's width
LEAST_RADIUS_M = 1.75  # of the bends of a loop, more than half its greatest width, so that its inner edge does not fold
LINK_TRIES = 12
LINK_APART_M = 3.0  # between a link and all other paths
LINK_MEDIAN_APART_M = 4.0  # likewise, if it crosses one
NEAR_BORDER_M = 3.5
DRY_EXIT_SHARE = 1.5  # distance of an exit from the middle of the pond, relative to the shore


@dataclass(frozen=True, slots=True)
class Pond:
    """A pond whose shore is a star-shaped curve around a centre (2,).

    `radius_m` is the mean radius.
    `lobes` (K, 3) are the waves of the shore: number around the pond, amplitude relative to the radius, and phase.
    `depth_m` is the depth of the bottom below the ground around.
    """

    center_m: Array
    radius_m: float
    lobes: Array
    depth_m: float

    def shore_m(self, bearing_rad: Array) -> Array:
        """The distance (...) of the shore from the centre at bearings (...)."""
        factor = np.ones_like(bearing_rad)
        for waves, amplitude, phase_rad in self.lobes.tolist():
            factor = factor + amplitude * np.cos(waves * bearing_rad + phase_rad)
        return self.radius_m * factor

    def share(self, points_m: Array) -> Array:
        """The distance (N,) of points (N, 2) from the centre relative to that of the shore."""
        to_point = points_m - self.center_m
        bearing_rad = np.arctan2(to_point[:, 1], to_point[:, 0])
        share: Array = np.linalg.norm(to_point, axis=1) / self.shore_m(bearing_rad)
        return share


@dataclass(frozen=True, slots=True)
class ParkGround:
    """The ground of a park: plane waves, a hollow for a pond, and a rim that rises towards the border.

    `half_m` is half the extent of the park along x and y.
    `waves` (K, 4) are amplitude in m, wave vector in rad/m along x and y, and phase.
    `rim_m` is the height of the rim at the border.
    `level_m` is the height of the ground around the pond.
    """

    half_m: tuple[float, float]
    waves: Array
    rim_m: float
    pond: Pond | None
    level_m: float

    @property
    def water_m(self) -> float:
        """The height of the water."""
        return self.level_m - SHORE_M

    def surface_m(self, points_m: Array) -> Array:
        """The height (N,) of the ground at points (N, 2), also below water."""
        height_m: Array = np.zeros(len(points_m))
        for amplitude_m, along_x, along_y, phase_rad in self.waves.tolist():
            height_m = height_m + amplitude_m * np.sin(points_m @ [along_x, along_y] + phase_rad)
        edge_share = np.max(np.abs(points_m) / self.half_m, axis=1)  # 0 in the middle, 1 at the border
        rim_share = np.clip((edge_share - 1 + RIM_SHARE) / RIM_SHARE, 0, 1)
        height_m = height_m + self.rim_m * rim_share**2
        if self.pond is None:
            return height_m
        # The ground is level around the pond, and has its hills from twice the distance of the shore.
        shore_share = self.pond.share(points_m)
        hilliness = _smooth_step((shore_share - 1.1) / 0.9)
        hollowness = _smooth_step((1.15 - shore_share) / 0.6)
        shaped_m: Array = self.level_m + hilliness * (height_m - self.level_m) - self.pond.depth_m * hollowness
        return shaped_m

    def heights_m(self, points_m: Array) -> Array:
        """The height (N,) of the ground at points (N, 2); NaN where the water is too deep to stand."""
        height_m = self.surface_m(points_m)
        if self.pond is None:
            return height_m
        is_deep = (height_m < self.water_m - WADING_M) & (self.pond.share(points_m) < 1.3)
        return np.where(is_deep, np.nan, height_m)

    def at(self, x_m: float, y_m: float) -> float:
        """The height of the ground at a point."""
        return float(self.surface_m(np.array([[x_m, y_m]]))[0])


def _smooth_step(t: Array) -> Array:
    """A step from 0 to 1 for t from 0 to 1, twice smooth."""
    t = np.clip(t, 0, 1)
    return t**3 * (10 - 15 * t + 6 * t**2)


@dataclass(frozen=True, slots=True)
class Path:
    """A path: points (N, 2), STEP_M apart, and its width (N,) there."""

    points_m: Array
    widths_m: Array

    @property
    def directions(self) -> Array:
        """Unit vectors (N, 2) ahead."""
        ahead = np.gradient(self.points_m, axis=0)
        is_closed = np.allclose(self.points_m[0], self.points_m[-1])
        if is_closed:
            ahead[[0, -1]] = self.points_m[1] - self.points_m[-2]
        directions: Array = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        return directions

    @property
    def left(self) -> Array:
        """Unit vectors (N, 2) to the left."""
        directions = self.directions
        return np.stack([-directions[:, 1], directions[:, 0]], axis=1)

    @property
    def length_m(self) -> float:
        """The length."""
        return STEP_M * (len(self.points_m) - 1)

    def areas(self, ground: ParkGround) -> list[Area]:
        """Convex areas, a metre long, that cover the path."""
        to_left_m = self.widths_m[:, None] / 2 * self.left
        left_m = self.points_m + to_left_m
        right_m = self.points_m - to_left_m
        steps_per_m = round(1.0 / STEP_M)
        last = len(self.points_m) - 1
        areas = []
        for start in range(0, last, steps_per_m):
            end = min(start + steps_per_m, last)
            corners_m = np.stack([right_m[start], right_m[end], left_m[end], left_m[start]])
            height_m = ground.at(*self.points_m[start].tolist())
            areas.append(Area(corners_m, height_m))
        return areas


@dataclass(frozen=True, slots=True)
class ParkPlan:
    """The plan of a park. The first path is the loop; links cross it, and exits lead to the border."""

    half_m: tuple[float, float]
    ground: ParkGround
    paths: tuple[Path, ...]

    @property
    def loop(self) -> Path:
        """The loop."""
        return self.paths[0]

    def path_tree(self) -> cKDTree:
        """The points of all paths, for the distance to the nearest path."""
        return cKDTree(np.concatenate([path.points_m for path in self.paths]))


def park_plan(rng: Rng) -> ParkPlan:
    """The plan of a park."""
    half_m = (float(rng.uniform(24, 36)), float(rng.uniform(19, 27)))
    loop_m = _loop(rng, half_m)
    has_pond = rng.random() < POND_SHARE
    pond = _pond(rng, loop_m, half_m) if has_pond else None
    ground = _ground(rng, half_m, pond)
    loop = _path(rng, loop_m, width_m=float(rng.uniform(*LOOP_WIDTH_M)))
    links = _links(rng, loop, pond)
    exits = _exits(rng, loop, half_m, pond)
    return ParkPlan(half_m, ground, (loop, *links, *exits))


def _links(rng: Rng, loop: Path, pond: Pond | None) -> list[Path]:
    """Up to two paths across the loop."""
    links: list[Path] = []
    for _ in range(int(rng.integers(0, 3))):
        link_m = _link(rng, loop, links, pond)
        if link_m is not None:
            links.append(_path(rng, link_m, width_m=float(rng.uniform(1.5, 2.1))))
    return links


def _exits(rng: Rng, loop: Path, half_m: tuple[float, float], pond: Pond | None) -> list[Path]:
    """One to three paths from the loop to the border, in different directions and not through the pond."""
    exits = []
    first_deg = float(rng.uniform(0, 360))
    for number in range(int(rng.integers(1, 4))):
        bearing_deg = first_deg + 120 * number + float(rng.uniform(-30, 30))
        exit_m = _exit(loop, half_m, float(np.deg2rad(bearing_deg)))
        is_dry = pond is None or pond.share(exit_m).min() > DRY_EXIT_SHARE
        if is_dry:
            exits.append(_path(rng, exit_m, width_m=float(rng.uniform(1.6, 2.4))))
    return exits


def _resampled(points_m: Array) -> Array:
    """Points about STEP_M apart along a polyline."""
    steps_m = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    along_m = np.concatenate([[0], np.cumsum(steps_m)])  # from the start of the polyline to each point
    length_m = along_m[-1]
    stops_m = np.linspace(0, length_m, int(length_m / STEP_M) + 1)
    return np.stack([np.interp(stops_m, along_m, axis) for axis in points_m.T], axis=1)


def _loop(rng: Rng, half_m: tuple[float, float]) -> Array:
    """A closed curve (N, 2) around the middle of the park, without sharp bends."""
    while True:
        curve_m = _closed_curve(rng, half_m)
        if _sharpest_bend_m(curve_m) > LEAST_RADIUS_M:
            return curve_m


def _sharpest_bend_m(curve_m: Array) -> float:
    """The least radius of the bends of a closed curve (N, 2) of points STEP_M apart."""
    steps_m = np.diff(curve_m, axis=0)
    steps_around_m = np.concatenate([steps_m, steps_m[:1]])
    headings_rad = np.unwrap(np.arctan2(steps_around_m[:, 1], steps_around_m[:, 0]))
    turns_rad = np.diff(headings_rad)
    return float(STEP_M / np.abs(turns_rad).max())


def _closed_curve(rng: Rng, half_m: tuple[float, float]) -> Array:
    """A random closed curve (N, 2) around the middle of the park."""
    count = int(rng.integers(6, 11))  # of points through which the curve runs
    numbers = np.arange(count) + rng.uniform(-0.22, 0.22, count)
    bearings_rad = 2 * np.pi * numbers / count + rng.uniform(0, 2 * np.pi)
    directions = np.stack([np.cos(bearings_rad), np.sin(bearings_rad)], axis=1)
    shares = rng.uniform(0.5, 0.78, count)  # of the way to the border
    points_m = shares[:, None] * np.array(half_m) * directions
    closed_m = np.concatenate([points_m, points_m[:1]])
    curve = CubicSpline(np.linspace(0, 1, count + 1), closed_m, bc_type="periodic")
    return _resampled(curve(np.linspace(0, 1, 2000)))


def _pond(rng: Rng, loop_m: Array, half_m: tuple[float, float]) -> Pond | None:
    """The largest of several random ponds that keep clear of the loop and of the border; None if there is no room."""
    largest: Pond | None = None
    most_m = float(rng.uniform(3.5, 8.5))
    for _ in range(POND_TRIES):
        center_m = rng.uniform(-0.62, 0.62, 2) * half_m
        to_loop_m = float(np.linalg.norm(loop_m - center_m, axis=1).min())
        to_border_m = float((np.array(half_m) - np.abs(center_m)).min())
        room_m = min(to_loop_m - POND_CLEAR_M, to_border_m - NEAR_BORDER_M - 3)
        radius_m = min(room_m / 1.3, most_m)  # lobes reach further than the radius
        is_largest = largest is None or radius_m > largest.radius_m
        if radius_m > LEAST_POND_M and is_largest:
            lobes = _lobes(rng)
            largest = Pond(center_m, radius_m, lobes, depth_m=float(rng.uniform(0.7, 1.1)))
    return largest


def _lobes(rng: Rng) -> Array:
    """The waves (K, 3) of a shore: number around the pond, amplitude relative to the radius, and phase."""
    lobes = []
    for waves in POND_LOBES:
        amplitude = rng.uniform(0.02, 0.24 / waves)
        phase_rad = rng.uniform(0, 2 * np.pi)
        lobes.append([waves, amplitude, phase_rad])
    return np.array(lobes)


def _ground(rng: Rng, half_m: tuple[float, float], pond: Pond | None) -> ParkGround:
    """Hills as a sum of waves, from flat lawns to slopes of a sixth."""
    lengths_m = rng.uniform(16, 55, HILL_WAVES)
    bearings_rad = rng.uniform(0, 2 * np.pi, HILL_WAVES)
    wave_numbers = 2 * np.pi / lengths_m  # in rad/m
    weights = rng.uniform(0.3, 1.0, HILL_WAVES)
    # The slope of a wave is its amplitude times its wave number.
    slope = float(rng.uniform(0.4, 1.0)) * STEEPEST
    amplitudes_m = weights * slope / float(weights @ wave_numbers)
    along_x = wave_numbers * np.cos(bearings_rad)
    along_y = wave_numbers * np.sin(bearings_rad)
    phases_rad = rng.uniform(0, 2 * np.pi, HILL_WAVES)
    waves = np.stack([amplitudes_m, along_x, along_y, phases_rad], axis=1)
    rim_m = float(rng.uniform(0.8, 2.4))

    without_pond = ParkGround(half_m, waves, rim_m, pond=None, level_m=0.0)
    if pond is None:
        return without_pond
    level_m = without_pond.at(*pond.center_m.tolist())
    return ParkGround(half_m, waves, rim_m, pond, level_m)


def _path(rng: Rng, points_m: Array, width_m: float) -> Path:
    """A path of a width that changes a little, and is the same at both ends."""
    turn_rad = np.linspace(0, 2 * np.pi, len(points_m))
    length_m = STEP_M * len(points_m)
    phases_rad = rng.uniform(0, 2 * np.pi, 2)
    slow = np.sin(round(length_m / 7) * turn_rad + phases_rad[0])
    fast = np.sin(round(length_m / 2.7) * turn_rad + phases_rad[1])
    wobble_m = WIDTH_WAVES_M[0] * slow + WIDTH_WAVES_M[1] * fast
    return Path(points_m, width_m + wobble_m)


def _link(rng: Rng, loop: Path, links: Sequence[Path], pond: Pond | None) -> Array | None:
    """A curve (N, 2) from one place of the loop to another one, clear of the pond; None if none is found."""
    loop_m = loop.points_m
    count = len(loop_m)
    others_m = np.concatenate([path.points_m for path in (loop, *links)])
    for _ in range(LINK_TRIES):
        first = int(rng.integers(count))
        last = (first + int(rng.uniform(0.35, 0.65) * count)) % count
        bend = float(rng.uniform(-0.22, 0.22))
        link_m = _bent_curve(loop_m[first], loop_m[last], bend, 600)
        is_dry = pond is None or _is_clear(pond, link_m)
        if is_dry and _leaves_others(link_m, others_m, may_cross=len(links) > 0):
            return link_m
    return None


def _leaves_others(link_m: Array, others_m: Array, *, may_cross: bool) -> bool:
    """Whether a link (N, 2) leaves the loop, and does not run beside another path; it may cross one."""
    first = len(link_m) // 5
    end = len(link_m) - ceil(len(link_m) / 5)
    inner_m = link_m[first:end]  # without the first and the last fifth
    to_others_m = cKDTree(others_m).query(inner_m)[0]
    is_apart = bool(to_others_m.min() > LINK_APART_M)
    is_mostly_apart = bool(np.median(to_others_m) > LINK_MEDIAN_APART_M)
    return is_apart or (may_cross and is_mostly_apart)


def _bent_curve(start_m: Array, end_m: Array, bend: float, count: int) -> Array:
    """A curve (N, 2) between two points, whose middle is displaced to the right by `bend` times their distance.

    `count` is the number of points at which the spline is computed before the curve is resampled.
    """
    to_right_m = np.array([end_m[1] - start_m[1], start_m[0] - end_m[0]])
    middle_m = (start_m + end_m) / 2 + bend * to_right_m
    curve = CubicSpline([0, 0.5, 1], np.stack([start_m, middle_m, end_m]))
    return _resampled(curve(np.linspace(0, 1, count)))


def _is_clear(pond: Pond, points_m: Array) -> bool:
    """Whether points (N, 2) keep clear of a pond."""
    to_shore_m = (pond.share(points_m) - 1) * 0.8 * pond.radius_m  # about, and rather too small
    return bool(to_shore_m.min() > POND_CLEAR_M - 1.0)


def _exit(loop: Path, half_m: tuple[float, float], bearing_rad: float) -> Array:
    """A curve (N, 2) from the loop to the border, and a little beyond."""
    outward = np.array([np.cos(bearing_rad), np.sin(bearing_rad)])
    border_m = outward / np.max(np.abs(outward) / half_m) * 1.03
    start = int(np.argmin(np.linalg.norm(loop.points_m - 0.72 * border_m, axis=1)))
    return _bent_curve(loop.points_m[start], border_m, 0.08, 300)
